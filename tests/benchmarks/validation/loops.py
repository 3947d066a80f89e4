"""Peirce's loops: a strip whose ends are held together, so that it hangs as a ring, a pear or a heart.

python tests/benchmarks/validation/loops.py --workers 16 --picture loops.png
"""

from __future__ import annotations

import numpy as np
from elastica import Shape, Strip
from strips import run_cases

CASES = {
    "ring": Strip(3.0, 0.0, -np.pi),
    "pear": Strip(3.0, -0.5 * np.pi, -np.pi),
    "heart": Strip(4.0, 0.5 * np.pi, -np.pi),
}


def figures(shape: Shape) -> dict[str, float]:
    """How far the loop hangs below its clamp, and its width."""
    return {"depth": float(-shape.z[-1]), "width": 2.0 * float(shape.x.max())}


if __name__ == "__main__":
    run_cases(__file__, CASES, figures)
