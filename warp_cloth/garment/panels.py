"""Panels in texture space: their lengths, and whether these are plausible."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.quantiles import median
from warp_cloth.base.topology import Topology
from warp_cloth.base.units import LENGTH_UNITS, METRES_PER
from warp_cloth.garment.triangles import triangle_areas, triangle_sides
from warp_cloth.loading.raw import counted
from warp_cloth.loading.sizes import PLAUSIBLE, was_guessed

Floats = NDArray[np.float64]
MetresPerUv = float | tuple[float, float]  # of texture space; two: along u and v

# Rest length over length in the mesh, median over the edges. Panels placed round a body are near 1, and a garment
# that starts half or twice its size gets a note; the units that get mixed up are 10 times or more apart.
SCALE_TOLD, SCALE_REFUSED = 2.0, 6.0

# That ratio over the ratio of two units, up to which the mesh is taken to be in the other one.
OTHER_UNIT = 1.15

# Lengths of an edge in the two panels that it joins, one over the other: sleeves are eased in by up to 1.3, and what is
# more is gathered, or drawn in another scale.
EASED = 1.5

# Panels' lengths along one axis over those along the other, each measured by the mesh: placed panels are near 1, UVs
# whose axes were each brought to the unit square are not.
SQUEEZED = 1.5

# Both get a note from SAME times as long, if that is more than chance: SPREADS times as much as they differ from
# place to place, from the 10th to the 90th percentile (placed panels by nothing, worn jersey by 3 %).
SAME, SPREADS = 1.02, 2.0

# Area in texture space over the panels' median triangle below which a triangle was left out of the panels: exporters
# put all its corners at one point. A few (buttons, trims) keep their lengths in the mesh; more, and panels are missing.
LEFT_OUT_AREA = 1.0e-6
MOST_LEFT_OUT = 0.05


def panel_sides(mesh: Mesh, metres_per_uv: MetresPerUv, place: str, key: str) -> tuple[Floats, tuple[str, ...]]:
    """Lengths of each triangle's sides in the panels [m], shape [F, 3], and notes.

    Raises:
        InputError: no usable panels.
    """
    remedy = f'export the panels as UVs, or set {key}.rest = "mesh"'
    if mesh.texcoords is None:
        raise InputError(place, 'rest = "uv" needs texture coordinates on every face, and this mesh lacks them', remedy)
    with np.errstate(over="ignore", invalid="ignore"):
        sides = triangle_sides(mesh.texcoords * np.asarray(metres_per_uv))
        areas = triangle_areas(sides)
    if not np.isfinite(areas).all():
        raise InputError(place, "the texture coordinates are too large for panels", remedy)
    if not areas.any():
        raise InputError(place, "the panels have no area in texture space", remedy)
    left_out = left_out_triangles(areas)
    count = int(left_out.sum())
    if count > MOST_LEFT_OUT * len(areas):
        raise InputError(place, f"{count:,} of {len(areas):,} triangles have no area in texture space", remedy)
    sides[left_out] = triangle_sides(mesh.points[mesh.triangles[left_out]])
    note = f"{count:,} of {len(areas):,} triangles have no area in texture space and keep their lengths in the mesh"
    return sides, (note,) if count else ()


def left_out_triangles(areas: Floats) -> NDArray[np.bool_]:
    """Whether each triangle was left out of the panels, by its area in texture space; shape [F] each."""
    some = areas[areas > 0.0]
    return np.asarray(areas <= LEFT_OUT_AREA * (median(some) if len(some) else 0.0))


def check_scale(
    mesh: Mesh, length: Floats, drawn: Floats, metres_per_uv: float, place: str, key: str
) -> tuple[str, ...]:
    """A note where rest lengths and lengths in the mesh differ much; both [m], shape [E].

    Seams of a garment that is not yet drawn together start far too long, so the median is what counts.

    Raises:
        InputError: they differ so much that the unit must be wrong.
    """
    ratio = float(median(length) / max(median(drawn), np.finfo(float).tiny))
    if 1.0 / SCALE_TOLD <= ratio <= SCALE_TOLD:
        return ()
    problem = (
        f"lengths in texture space are {ratio:.3g} times those in the mesh "
        f"(median edge {1e3 * median(length):.3g} mm against {1e3 * median(drawn):.3g} mm)"
    )
    guessed = _other_unit(mesh, ratio)
    off = {unit: abs(float(np.log(ratio * METRES_PER[unit] / metres_per_uv))) for unit in LENGTH_UNITS}
    likely = min(off, key=off.__getitem__)
    if guessed:
        remedy = f'set {key}.units = "{guessed}", which was guessed'
    elif off[likely] <= np.log(SCALE_TOLD):
        remedy = f'set {key}.uv_units = "{likely}"'
    else:
        remedy = f"set {key}.uv_units to the metres in a unit of texture space, near {metres_per_uv / ratio:.3g}"
    if not 1.0 / SCALE_REFUSED <= ratio <= SCALE_REFUSED:
        raise InputError(place, problem, remedy)
    return (f"{problem}; if that is not meant, {remedy}",)


def _other_unit(mesh: Mesh, ratio: float) -> str:
    """The unit that brings a mesh whose unit was guessed to the size of its panels; empty where none does."""
    if not was_guessed(mesh):
        return ""
    low, high = PLAUSIBLE["garment"]
    extent = float(np.ptp(mesh.points, axis=0).max())
    own = next(metres for unit, metres in METRES_PER.items() if unit == mesh.unit)
    times = {unit: METRES_PER[unit] / own for unit in LENGTH_UNITS if unit != mesh.unit}
    fitting = (unit for unit, factor in times.items() if 1 / OTHER_UNIT <= ratio / factor <= OTHER_UNIT)
    return next((unit for unit in fitting if low <= times[unit] * extent <= high), "")


def check_axes(mesh: Mesh, metres_per_uv: float, key: str) -> tuple[str, ...]:
    """A note where texture space is drawn longer along one of its axes than along the other, or than the mesh is."""
    if mesh.texcoords is None:
        return ()
    drawn = mesh.points[mesh.triangles]
    (a, b), (p, q) = (np.moveaxis(each[:, 1:] - each[:, :1], 1, 0) for each in (mesh.texcoords, drawn))
    whole = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])[:, None]
    flat = (whole != 0.0)[:, 0]
    # by the mesh: what goes into one unit of u, and of v, each times the triangle's doubled area in texture space
    u, v = b[:, 1:] * p - a[:, 1:] * q, a[:, :1] * q - b[:, :1] * p
    along = {axis: np.linalg.norm(each[flat] / whole[flat], axis=1) for axis, each in (("u", u), ("v", v))}
    low, middle, high = np.quantile([along["u"], along["v"]], (0.1, 0.5, 0.9), axis=1)
    if not (middle > 0.0).all():
        return ()
    long, short = ("u", "v") if middle[0] < middle[1] else ("v", "u")
    squeezed = float(middle.max() / middle.min())
    if squeezed > SQUEEZED:
        return (
            f"compared with the mesh, texture space is {squeezed:.3g} times as long along {long} as along {short}; "
            "unless intended, export texture coordinates with the same unit along both axes",
        )
    times = metres_per_uv / middle
    off, spread = np.maximum(times, 1.0 / times), high / np.maximum(low, np.finfo(float).tiny)
    if (off > SCALE_TOLD).any() or (off <= np.maximum(SAME, 1.0 + SPREADS * (spread - 1.0))).all():
        return ()
    return (
        f"panels are {times[0]:.3g} times as long along u and {times[1]:.3g} times along v as the mesh, nearly "
        "everywhere, as if texture coordinates were scaled to the unit square; unless intended, "
        f"set {key}.uv_units to metres per unit of texture space",
    )


def check_seams(sides: Floats, topology: Topology) -> tuple[str, ...]:
    """A note where edges are cut much longer in one panel than in the other; ``sides`` [m], shape [F, 3]."""
    edge, low, high = (
        topology.triangle_edges.ravel(),
        np.full(len(topology.edges), np.inf),
        np.zeros(len(topology.edges)),
    )
    np.minimum.at(low, edge, sides.ravel())
    np.maximum.at(high, edge, sides.ravel())
    apart = high > EASED * low
    if not apart.any():
        return ()
    most = float((high[apart] / np.maximum(low[apart], np.finfo(float).tiny)).max())
    return (
        f"{counted(int(apart.sum()), 'edge')} up to {most:.3g} times as long in one panel as in the one that it is "
        "sewn to, as in gathered cloth; unless intended, check that all panels have the same scale",
    )
