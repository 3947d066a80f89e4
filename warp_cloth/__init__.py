"""Garment fitting on NVIDIA Warp: the final worn shape of a garment on a body, with a certificate of rest.

>>> import warp_cloth
>>> worn = warp_cloth.fit("tshirt", overrides=["garment.shape.size=L"])
>>> worn.garments[0].points  # [m], shape [V, 3]
>>> worn.save("out")
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_cloth.base.errors import InputError

if TYPE_CHECKING:
    from warp_cloth.base.mesh import Mesh
    from warp_cloth.fitting.fit import Fit, Progress, fit
    from warp_cloth.model.result import Status, WornGarment
    from warp_cloth.scene import Scene, load_scene

_FOLDER = Path(__file__).resolve().parent
if not (_FOLDER / "kernels").is_dir():
    # in a checkout kernels/ and scenes/ lie next to this package; an installed package has them inside
    __path__.append(str(_FOLDER.parent))

__all__ = ["Fit", "InputError", "Mesh", "Progress", "Scene", "Status", "WornGarment", "fit", "load_scene"]

_HOMES = {
    "Fit": "fitting.fit",
    "Mesh": "base.mesh",
    "Progress": "fitting.fit",
    "Scene": "scene",
    "Status": "model.result",
    "WornGarment": "model.result",
    "fit": "fitting.fit",
    "load_scene": "scene",
}


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first used: Warp and USD are heavy, ``warp-cloth --help`` needs neither."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
