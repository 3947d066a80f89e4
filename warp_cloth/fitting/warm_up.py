"""Warming a machine up: the kernels of usual scenes are compiled, and the shipped bodies and T-shirts made."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from warp_cloth.fitting.fit import fit
from warp_cloth.shapes.pattern import SIZE_MEASURES

ITERATIONS = "solver.iterations=20"  # enough to launch what a fit launches
# Scene and changes of every usual kind of fit; the kernels of a kind serve all garments and bodies.
KINDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    *(("tshirt", (f"garment.shape.size={size}",)) for size in ("M", *SIZE_MEASURES)),  # sewn panels; most are it
    ("tshirt", ("solver.method=multilevel", "collision.cloth=true")),  # and where they fall for long
    ("tshirt", ("collision.cloth=false",)),
    ("tshirt", ("garment.rest=mesh", "collision.cloth=false")),  # as a mesh modelled in 3-D begins
    ("tshirt", ("garment.rest=mesh", "collision.cloth=true")),  # and where it goes through itself
    ("tshirt", ("garment.rest=mesh", "solver.method=multilevel", "collision.cloth=false")),  # and where it is stiff
    ("sphere", ()),
    ("hanging", ()),
    ("hanging", ("solver.method=multilevel", "collision.cloth=false")),
)


def warm_up(
    device: str,
    on_kind: Callable[[str], None] = lambda _: None,
    kinds: Sequence[tuple[str, tuple[str, ...]]] = KINDS,
) -> None:
    """Fits each usual kind of scene for a moment on a device ("cpu", "cuda:0"), and writes the first one's files.

    ``on_kind`` is called with the name of each that begins; ``kinds``: which; all by default.

    Raises:
        OutputError: Warp's folder of compiled kernels cannot be written.
    """
    for number, (scene, changes) in enumerate(dict.fromkeys(kinds)):
        on_kind(" ".join((scene, *changes)))
        begun = fit(scene, device=device, overrides=(*changes, ITERATIONS))
        if number == 0:
            with tempfile.TemporaryDirectory() as folder:
                begun.save(Path(folder))
