"""Garment fitting on NVIDIA Warp: the shape of a garment as worn on a body, with a certificate that it is at rest.

>>> import warp_cloth
>>> fit = warp_cloth.fit("tshirt", overrides={"garment.shape.size": "L"})
>>> fit.worn, fit.message
>>> [problem.code for problem in fit.problems]
>>> fit.garments[0].points  # [m], shape [V, 3]
>>> fit.save("out")  # USD stage, report, picture

fit         fits the garments of one scene, or fit("shirt.obj", on="body.obj"); returns a Fit
Fitter      fits one scene again and again, in other fabrics or sizes: Fitter("tshirt").fit(size="L"); the same bits
judge       says what is wrong with a given shape of garments, without a fit; returns a Judgement
load_scene  reads and checks a scene, with changes: load_scene("tshirt", {"garment.fabric": "denim"})
Fit         whether it is worn, problems, garments, report; save() writes them
FitProblem  what is wrong with a fit: a ProblemCode, a message, a remedy, figures, vertices and faces
InputError  raised on any bad input: one sentence with the place, the problem, and a remedy

Many fits: ``warp_cloth.batch`` (fit_many, fit_sizes, run_batch). Fit maps: ``warp_cloth.maps``.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_cloth.base.errors import InputError

if TYPE_CHECKING:
    from warp_cloth.base.mesh import Mesh
    from warp_cloth.fitting.fit import Fit, Progress, fit
    from warp_cloth.fitting.fitter import Fitter
    from warp_cloth.fitting.judge import Judgement, judge
    from warp_cloth.model.fit_problem import FitProblem, ProblemCode
    from warp_cloth.model.result import Status, WornGarment
    from warp_cloth.scene import Scene, load_scene

    __version__: str

_FOLDER = Path(__file__).resolve().parent
if not (_FOLDER / "kernels").is_dir():
    # in a checkout kernels/ and scenes/ are next to this package; an installed package contains them
    __path__.append(str(_FOLDER.parent))

__all__ = [
    "Fit",
    "FitProblem",
    "Fitter",
    "InputError",
    "Judgement",
    "Mesh",
    "ProblemCode",
    "Progress",
    "Scene",
    "Status",
    "WornGarment",
    "fit",
    "judge",
    "load_scene",
]

_MODULES = {
    "Fit": "fitting.fit",
    "FitProblem": "model.fit_problem",
    "Fitter": "fitting.fitter",
    "Judgement": "fitting.judge",
    "Mesh": "base.mesh",
    "ProblemCode": "model.fit_problem",
    "Progress": "fitting.fit",
    "Scene": "scene",
    "Status": "model.result",
    "WornGarment": "model.result",
    "fit": "fitting.fit",
    "judge": "fitting.judge",
    "load_scene": "scene",
}


def __getattr__(name: str) -> Any:
    """Imports a public name on first use: Warp and USD are slow to import, and ``warp-cloth --help`` needs neither."""
    if name == "__version__":
        from warp_cloth.base.version import package_version

        return package_version()
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """The public names, imported or not."""
    return sorted([*__all__, "__version__", "__doc__", "__name__", "__path__", "__file__"])
