"""Where a garment's rest shape comes from: as the scene states, or recognised in the mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from warp_cloth.base.choice import Choice
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.units import LENGTH_UNITS, METRES_PER
from warp_cloth.garment.panel_fit import PanelFit, fit_panels
from warp_cloth.garment.panels import MetresPerUv
from warp_cloth.loading.repair import RestKey, RestKind

# Texture coordinates over panels in a unit, up to which they are in that unit: garments are placed a little scaled, or
# worn, but units are 2.5 times or more apart. In the unit square the scale may be any, and must be exactly the unit's.
A_UNIT, EXACTLY = 1.15, 1.005
UNIT_SQUARE, FILLED = 1.001, 0.9  # texture coordinates within it that reach so far were probably scaled to fill it

# Least fractions of an island's area that keep its lengths, of panels: of a scale found by that alone, or of a unit's,
# which itself is evidence. Placed panels have 0.98 to 1 (96 designs), an atlas of a modelled garment far less.
ISOMETRIC, ISOMETRIC_IN_UNIT = 0.9, 0.7
ALIKE = 0.95  # least fraction of area in islands of one scale; islands of an atlas are scaled one by one


@dataclass(frozen=True)
class RestSource:
    """Where a rest shape comes from, and what the program chose of that."""

    kind: RestKind  # never "auto"
    metres_per_uv: MetresPerUv = 1.0
    scale: float = 1.0  # of the garment as loaded, which ``metres_per_uv`` includes
    choices: tuple[Choice, ...] = ()  # empty where the scene states all


AS_MODELLED = RestSource("mesh")


def choose_rest(mesh: Mesh, rest: RestKey, stated: float | None, key: str, scale: float = 1.0) -> RestSource:
    """The source of a rest shape, as stated or as the mesh shows.

    Args:
        mesh: the garment, scaled.
        rest: as the scene states it.
        stated: metres per unit of texture space, before it is scaled; None: the mesh shows it.
        key: the garment's scene table.
        scale: by which the scene scaled the mesh; texture space that is in a unit is scaled likewise.
    """
    stated = None if stated is None else stated * scale
    if rest in ("mesh", "physics"):
        return RestSource(rest, stated or 1.0, scale)
    if rest == "uv":
        if stated is not None:
            return RestSource(rest, stated, scale)
        fit = fit_panels(mesh)
        panels = fit is not None and _why_no_panels(fit, exact=False) == ""
        metres = _unit_of(mesh, fit, scale) if fit is not None and panels else scale
        return RestSource(rest, metres, scale, _unit_choices(metres, key, scale))
    if mesh.rest_corners is not None:
        return _without_panels("physics", "the stage states a rest shape", key)
    fit = fit_panels(mesh)
    if fit is None:
        lack = (
            "there are no texture coordinates"
            if mesh.texcoords is None
            else "many triangles have no area in texture space"
        )
        return _without_panels("mesh", lack, key)
    metres = _unit_of(mesh, fit, scale)
    fault = _why_no_panels(fit, exact=stated is None and metres not in _units(scale))
    if fault:
        return _without_panels("mesh", f"texture coordinates are no panels: {fault}", key)
    if fit.equal and (stated is None or stated == metres):
        return _without_panels("mesh", "the panels in texture space have the mesh's lengths", key)
    reason = f"texture coordinates are panels: {100 * fit.near:.0f} % of their area has the mesh's lengths"
    choices = () if stated is not None else _unit_choices(metres, key, scale)
    chosen = metres if stated is None else stated
    return RestSource("uv", chosen, scale, (Choice(f"{key}.rest", "uv", reason), *choices))


def _without_panels(kind: RestKind, reason: str, key: str) -> RestSource:
    return RestSource(kind, choices=(Choice(f"{key}.rest", kind, reason),))


def _why_no_panels(fit: PanelFit, *, exact: bool) -> str:
    """Why islands of texture space are not panels; empty where they are. ``exact``: no unit speaks for them."""
    part, alike = (fit.close, fit.alike_close) if exact else (fit.near, fit.alike_near)
    if alike < ALIKE:
        return f"{100 * (1.0 - alike):.0f} % of their area is in another scale"
    if part < (ISOMETRIC if exact else ISOMETRIC_IN_UNIT):
        return f"only {100 * part:.0f} % of their area has the mesh's lengths at one scale"
    return ""


def _units(scale: float) -> tuple[float, ...]:
    """Metres per unit of texture space in each common unit, of a garment scaled by this, or scaled to its panels."""
    return tuple(dict.fromkeys((*(metres * scale for metres in METRES_PER.values()), *METRES_PER.values())))


def _unit_of(mesh: Mesh, fit: PanelFit, scale: float) -> MetresPerUv:
    """Metres per unit of texture space: the nearest common unit's where it is near one, else as the mesh shows."""
    u, v = fit.scale
    off = math.log(EXACTLY if _fills_unit_square(mesh) else A_UNIT)
    apart = {metres: max(abs(math.log(u / metres)), abs(math.log(v / metres))) for metres in _units(scale)}
    nearest = min(apart, key=apart.__getitem__)
    if apart[nearest] <= off:
        return nearest
    return u if u == v else (u, v)


def _fills_unit_square(mesh: Mesh) -> bool:
    if mesh.texcoords is None:
        return False
    low, high = mesh.texcoords.min(axis=(0, 1)), mesh.texcoords.max(axis=(0, 1))
    return bool((low >= 1.0 - UNIT_SQUARE).all() and FILLED <= high.max() <= UNIT_SQUARE)


def _unit_choices(metres: MetresPerUv, key: str, scale: float) -> tuple[Choice, ...]:
    """What is said of the unit, as a scene would state it, unless it is the metre."""
    if metres == scale:
        return ()
    unit = next((unit for unit in LENGTH_UNITS if METRES_PER[unit] * scale == metres), None)
    stated: MetresPerUv = metres / scale if isinstance(metres, float) else (metres[0] / scale, metres[1] / scale)
    reason = "the unit in which panels have the mesh's lengths"
    if unit is None:
        per_axis = "" if isinstance(metres, float) else ", each axis by itself"
        reason = f"texture coordinates are in no common unit{per_axis}: metres per unit as the mesh shows"
    return (Choice(f"{key}.uv_units", unit or _rounded(stated), reason),)


def _rounded(scale: MetresPerUv) -> MetresPerUv:
    """To six digits, as people read it."""
    if isinstance(scale, tuple):
        u, v = (float(f"{each:.6g}") for each in scale)
        return u, v
    return float(f"{scale:.6g}")


def mean_scale(metres_per_uv: MetresPerUv) -> float:
    """Metres per unit of texture space, the geometric mean of both axes."""
    return metres_per_uv if isinstance(metres_per_uv, float) else math.sqrt(math.prod(metres_per_uv))


def panel_corners(mesh: Mesh, metres_per_uv: MetresPerUv) -> np.ndarray:
    """Corners of every triangle in its panel [m], shape [F, 3, 2]."""
    if mesh.texcoords is None:
        raise ValueError("the mesh has no texture coordinates")
    return mesh.texcoords * np.asarray(metres_per_uv)
