"""The knobs of a scene that trade accuracy against time, settings worth trying, and a tighter reference.

Scenes have nothing left to decide here (model/attempt.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from warp_cloth.base.errors import InputError
from warp_cloth.fitting.problem import decided_method, limit_of
from warp_cloth.kernels.base.types import PRECISIONS
from warp_cloth.scene import Scene, SquareShape, TshirtShape
from warp_cloth.solver.step_options import DEFAULT_CAP, Method

Settings = Mapping[str, str]  # scene keys and their values, as --set takes them

# Tolerances of the reference, tighter than a garment is cut, and its limit as a multiple of the scene's iterations.
REFERENCE_MM = 0.2
REFERENCE_RESIDUAL = 2e-3
REFERENCE_ITERATIONS = 2
REFERENCE_PIXEL_MM = 1.0
DRAWN = ("depth", "auto")  # colliders whose accuracy depends on the pixel
COARSENING = (1.4, 2.0)  # factors on the edge length
PIXELS_MM = (1.0, 2.0, 4.0, 8.0)
TOLERANCES = ((0.3, 0.003), (1.0, 0.01), (3.0, 0.03), (10.0, 0.1))  # [mm] of rest error, relative residual rms
BUDGETS = (100, 200, 500, 1000, 2000, 4000)  # iterations; a burst of the loop ends at each
DIRECT_BUDGET = 2000  # iterations of the direct method, which may never come to rest
EXACT_BUDGET = 1000  # iterations with the exact collider, each of which takes as long as five others
LEVELS_BUDGET = 2000  # iterations of the multilevel method, which needs few


@dataclass(frozen=True)
class Trial:
    """Settings that replace the scene's own, and the knob that they belong to."""

    knob: str
    settings: Settings

    @property
    def label(self) -> str:
        """The settings in short: pixel_mm=4."""
        shown = {key.rpartition(".")[2]: value.strip('"') for key, value in self.settings.items()}
        if "tolerance_mm" in shown:
            for key in ("residual", "residual_p99"):
                shown.pop(key, None)
        return " ".join(f"{key}={value}" for key, value in shown.items()) or "as in the scene"

    def overrides(self) -> list[str]:
        """For ``load_scene``."""
        return [f"{key}={value}" for key, value in self.settings.items()]


def reference_of(scene: Scene) -> Trial:
    """The scene in double precision, with fine depth buffers, until nothing visible moves.

    The collider is the scene's: the exact one would take minutes, and penetration is measured against it anyway.
    """
    settings = {
        "solver.method": _tight_method(scene),
        "solver.precision": "float64",
        **_tolerance(REFERENCE_MM, REFERENCE_RESIDUAL),
        "solver.iterations": str(min(max(REFERENCE_ITERATIONS * limit_of(scene), 20_000), 10**7)),
    }
    if scene.collision.avatar in DRAWN and scene.collision.pixel_mm > REFERENCE_PIXEL_MM:
        settings["collision.pixel_mm"] = f"{REFERENCE_PIXEL_MM:g}"
    return Trial("reference", MappingProxyType(settings))


def _tight_method(scene: Scene) -> Method:
    """The scene's own method; the accelerated one in place of the direct rule, which hardly comes to rest."""
    method = decided_method(scene)
    return "accelerated" if method == "direct" else method


def second_reference_of(scene: Scene) -> Trial:
    """As tight as the reference, by steps half as long."""
    cap = scene.solver.cap if scene.solver.cap is not None else DEFAULT_CAP[_tight_method(scene)]
    return Trial("second reference", MappingProxyType({**reference_of(scene).settings, "solver.cap": f"{0.5 * cap:g}"}))


def single_trials(scene: Scene) -> list[Trial]:
    """The scene as it is, then every knob changed alone."""
    solver, collision, limit = scene.solver, scene.collision, limit_of(scene)
    found: list[tuple[str, dict[str, str]]] = [("scene", {})]
    found += [("tolerance", _tolerance(mm, residual)) for mm, residual in TOLERANCES if mm != solver.tolerance_mm]
    found += [("precision", {"solver.precision": each}) for each in PRECISIONS if each != solver.precision]
    found += [("collider", settings) for kind, settings in _colliders(scene).items() if kind != collision.avatar]
    if collision.avatar in DRAWN:
        found += [("pixel", {"collision.pixel_mm": f"{mm:g}"}) for mm in PIXELS_MM if mm != collision.pixel_mm]
    found.append(("cloth contact", {"collision.cloth": "false" if collision.cloth else "true"}))
    found += [("mesh", coarse) for factor in COARSENING if (coarse := _coarser(scene, factor))]
    for method, most in (("accelerated", limit), ("multilevel", LEVELS_BUDGET), ("direct", DIRECT_BUDGET)):
        if method != solver.method:
            found.append(("method", {"solver.method": method, "solver.iterations": str(min(limit, most))}))
    trials = [Trial(knob, MappingProxyType(settings)) for knob, settings in found]
    return [trial for trial in trials if _allowed(scene, trial)]


def _colliders(scene: Scene) -> dict[str, dict[str, str]]:
    """Settings of the colliders that the avatar may have, by their names."""
    if scene.collision.avatar == "none":
        return {}
    kinds = ["depth", "auto", "mesh"]
    if all(garment.pin for garment in scene.garments):  # without pins and avatar a garment falls for ever
        kinds.append("none")
    colliders = {kind: {"collision.avatar": kind} for kind in kinds}
    colliders["mesh"]["solver.iterations"] = str(min(limit_of(scene), EXACT_BUDGET))
    return colliders


def budget_trials(scene: Scene, settings: Settings) -> dict[int, Trial]:
    """The settings stopped after each of BUDGETS iterations; none where they limit the iterations themselves."""
    if "solver.iterations" in settings:
        return {}
    return {
        count: Trial("iterations", MappingProxyType({**settings, "solver.iterations": str(count)}))
        for count in BUDGETS
        if count < limit_of(scene)
    }


def nothing_holds(scene: Scene) -> str:
    """The key of a garment that certainly falls for ever; empty where there is none."""
    if scene.avatar is not None and scene.collision.avatar != "none":
        return ""
    free = [key for key, garment in zip(scene.garment_keys, scene.garments, strict=True) if not garment.pin]
    met = scene.collision.cloth and len(free) < len(scene.garments)  # a pinned garment may hold the others
    return free[0] if free and not met else ""


def _tolerance(millimetres: float, residual: float) -> dict[str, str]:
    return {
        "solver.tolerance_mm": f"{millimetres:g}",
        "solver.residual": f"{residual:g}",
        "solver.residual_p99": f"{min(5.0 * residual, 1.0):g}",
    }


def _coarser(scene: Scene, factor: float) -> dict[str, str]:
    """Generated garments and patterns with longer edges; empty where there are none, or pins name vertices."""
    settings = {}
    for key, garment in zip(scene.garment_keys, scene.garments, strict=True):
        if any(pin.vertices is not None for pin in garment.pin):
            return {}
        if isinstance(garment.shape, SquareShape):
            side = round((garment.shape.vertices_per_side - 1) / factor) + 1
            settings[f"{key}.shape.vertices_per_side"] = str(max(side, 3))
        elif isinstance(garment.shape, TshirtShape):
            settings[f"{key}.shape.edge_mm"] = f"{min(garment.shape.edge_mm * factor, 60.0):.3g}"
        elif garment.pattern is not None:
            settings[f"{key}.edge_mm"] = f"{min(1e3 * garment.edge * factor, 60.0):.3g}"
    return settings


def _allowed(scene: Scene, trial: Trial) -> bool:
    """Whether the scene can be loaded with the settings."""
    from warp_cloth.scene import load_scene

    try:
        load_scene(scene.settings(), trial.overrides())
    except InputError:
        return False
    return True
