"""A strip whose level ends are held nearer to each other than it is long.

python tests/benchmarks/validation/brought_together.py --workers 16 --picture brought_together.png
"""

from __future__ import annotations

from elastica import Shape, Strip
from strips import run_cases


def figures(shape: Shape) -> dict[str, float]:
    """How far its middle hangs below the clamps."""
    return {"sag": float(-shape.z[-1])}


if __name__ == "__main__":
    run_cases(__file__, {f"to_{part:g}": Strip(3.0, 0.0, 0.0, 3.0 * part) for part in (0.95, 0.8, 0.5)}, figures)
