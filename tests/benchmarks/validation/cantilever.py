"""A strip that is held at one end, over its length: the master curve of cantilever tests.

python tests/benchmarks/validation/cantilever.py --workers 16 --picture cantilever.png
"""

from __future__ import annotations

import numpy as np
from elastica import Shape, Strip
from strips import run_cases


def figures(shape: Shape) -> dict[str, float]:
    """Angle of the free end below the clamp, as the laboratory reads it [degrees]."""
    return {"angle": float(np.degrees(np.arctan2(-shape.z[-1], shape.x[-1])))}


if __name__ == "__main__":
    run_cases(__file__, {f"span_{span:g}": Strip(span, 0.0) for span in (1.0, 1.5, 2.0, 3.0)}, figures)
