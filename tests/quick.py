"""Small fits, for tests of what a fit does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import warp_cloth
from warp_cloth.fitting.fit import Fit

SMALL = ("garment.shape.vertices_per_side=9",)  # the shipped hanging square, 81 vertices: at rest in 0.02 s


def quick(source: Any, *overrides: str, **options: Any) -> Fit:
    return warp_cloth.fit(source, device="cpu", overrides=overrides, **options)


def hanging(mesh: Path, *pins: int, **solver: Any) -> dict[str, Any]:
    """A scene of one mesh that hangs by some of its vertices."""
    return {"garment": {"mesh": str(mesh), "units": "m", "pin": {"vertices": list(pins)}}, "solver": solver}
