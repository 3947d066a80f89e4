"""Is the cloth itself as it should be? Of the right scale, its seams closed, and not through itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.base.mesh import Points, face_normals
from warp_cloth.base.quantiles import quantiles
from warp_cloth.loading.raw import counted
from warp_cloth.material.strain import face_strains
from warp_cloth.model.attempt import TORN
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.report.judged import Judged, listed
from warp_cloth.report.tight import TightRing, tight_problems, tight_rings
from warp_cloth.report.where import part_at_height, part_under

WRONG_SCALE = 0.3  # strain of half the edges: the tightest of worn cloth has less
# Largest stretch of a face, which few knits bear and no woven cloth does, and the part of the area that has more. Of 82
# designs worn in the size that they were drafted in, one has 0.12 (21 % narrower than its body's hip), the others 0.08
# at most; those that are stretched so when they are a fifth too small have 0.16 to 0.36.
TIGHT, TIGHT_SHARE = 0.3, 0.1
# Angle of a triangle from which on it does not tell how far cloth is stretched across its longest edge: at 135 degrees
# one that is 3 % shorter there, its other edges as cut, is 16 % higher, at 150 degrees 35 %.
BLUNT = np.radians(135.0)
# Angle between the normals of neighbouring triangles, and the fraction of hinges folded so sharply: of these designs
# 0.06 at most, in a silk skirt of many panels.
SHARP, BUNCHED = np.radians(120.0), 0.1


def cloth_problems(judged: Judged) -> Iterator[FitProblem]:
    """Problems of a garment with its own cloth, and with other garments'."""
    tight = tight_rings(judged)
    found = wrong_scale(judged), too_small(judged), bunched_up(judged), seam_open(judged, tight), crossing(judged)
    yield from (problem for problem in found if problem is not None)
    yield from tight_problems(judged, tight)


def wrong_scale(judged: Judged) -> FitProblem | None:
    """Natural lengths of another scale than the worn shape."""
    (middle,) = quantiles(np.abs(judged.strains), 0.5)
    if not middle > WRONG_SCALE:
        return None
    return FitProblem(
        ProblemCode.WRONG_SCALE,
        f'Half of the edges of "{judged.name}" differ from their natural length by {100 * middle:.0f} % or more.',
        "Check garment.units and garment.uv_units, garment.rest, and the garment's size relative to the body.",
        judged.name,
        {"strain_p50": float(middle), "limit": WRONG_SCALE},
    )


def too_small(judged: Judged) -> FitProblem | None:
    """Much of the cloth stretched far over a body, in whatever direction."""
    body, sheet = judged.of.body, judged.garment.rest.sheet
    if body is None or sheet is None or not np.median(judged.strains) > 0.0:
        return None
    stretch, told = face_strains(judged.points, sheet)["strain"], ~_is_blunt(sheet.flat)
    tight = np.flatnonzero((stretch > TIGHT) & told)
    area = sheet.area if told.all() else float(sheet.areas[told].sum())
    share = float(sheet.areas[tight].sum()) / area if area > 0.0 else 0.0
    if not share > TIGHT_SHARE:
        return None
    corners, strain = sheet.triangles[tight], float(np.median(stretch[tight]))
    (floor, top) = (float(corner[1]) for corner in body.bounds())
    height = (float(np.median(judged.points[corners, 1])) - floor) / (top - floor)
    wearing = judged.of.outfit.wearing[judged.index]
    skeleton = skeleton_of(body) if wearing is None else wearing.skeleton
    where = part_at_height(height) if skeleton is None else part_under(judged.points[np.unique(corners)], skeleton)
    return FitProblem(
        ProblemCode.TOO_SMALL,
        f'"{judged.name}" is too small for the body, most of all at the {where}: {100 * share:.0f} % of its cloth is '
        f"stretched by more than {100 * TIGHT:.0f} %, half of that by {100 * strain:.0f} % or more.",
        "Use a larger size or a softer fabric, or a smaller body.",
        judged.name,
        {"stretched_fraction": share, "strain_p50": strain, "height_fraction": height, "limit": TIGHT_SHARE},
        vertices=listed(corners),
    )


def _is_blunt(flat: Points) -> NDArray[np.bool_]:
    """Which triangles have an angle of more than BLUNT; ``flat``: their corners at rest [m], shape [F, 3, 2]."""
    along = np.roll(flat, -1, axis=1) - flat  # from each corner to the next
    length = np.linalg.norm(along, axis=2)
    cosines = -np.einsum("fci,fci->fc", along, np.roll(along, 1, axis=1))
    blunt: NDArray[np.bool_] = (cosines < np.cos(BLUNT) * length * np.roll(length, 1, axis=1)).any(axis=1)
    return blunt


def bunched_up(judged: Judged) -> FitProblem | None:
    """Cloth crumpled into sharp folds, as where it has gathered at a limb."""
    topology, points, triangles = judged.garment.rest.topology, judged.points, judged.garment.triangles
    if not len(topology.hinges):
        return None
    normals = face_normals(points[triangles])
    first, second = (normals[topology.hinge_triangles[:, side]] for side in (0, 1))
    # sizes of the normals by products, which are faster than norms
    product = np.einsum("hi,hi->h", first, second)
    size = np.sqrt(np.einsum("hi,hi->h", first, first) * np.einsum("hi,hi->h", second, second))
    sharp = np.flatnonzero(product < np.cos(SHARP) * size)
    share = len(sharp) / len(product)
    if not share > BUNCHED:
        return None
    return FitProblem(
        ProblemCode.BUNCHED_UP,
        f'"{judged.name}" is bunched up: {100 * share:.0f} % of its folds are sharper than '
        f"{np.degrees(SHARP):.0f} degrees (limit {100 * BUNCHED:.0f} %).",
        "Place it around the body as it is to be worn, so that it need not fall or be gathered.",
        judged.name,
        {"sharp_fraction": share, "limit": BUNCHED, "angle_degrees": float(np.degrees(SHARP))},
        vertices=listed(topology.hinges[sharp, :2]),
    )


def seam_open(judged: Judged, tight: Sequence[TightRing] = ()) -> FitProblem | None:
    """Edges still far longer than they are cut, but for those around rings that are too tight."""
    strains = judged.strains
    edges = np.flatnonzero(strains > TORN)
    for ring in tight:
        edges = edges[~ring.explains(judged.edge_ends[edges])]
    if not len(edges):
        return None
    ends, most = judged.edge_ends[edges], float(strains[edges].max())
    points = judged.points
    gap = 1e3 * float(np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1).max())
    verb = "is" if len(edges) == 1 else "are"
    return FitProblem(
        ProblemCode.SEAM_OPEN,
        f'{counted(len(edges), "edge")} of "{judged.name}" {verb} still stretched by more than {100 * TORN:.0f} %, up '
        f"to {100 * most:.0f} %: a seam is held open, or the cloth is torn.",
        "Free what holds the two sides apart: pins on both, a limb between them, or a body larger than the garment.",
        judged.name,
        {"edges": len(edges), "strain_max": most, "limit": TORN, "longest_mm": gap},
        vertices=listed(ends),
    )


def crossing(judged: Judged) -> FitProblem | None:
    """Faces that pass through others, of this garment or another, and those that do so in its file already."""
    measured, collision = judged.of.measured, judged.of.scene.collision
    faces, count = measured.crossings.faces[judged.index], len(judged.garment.triangles)
    if not len(faces):
        return None
    modelled = measured.modelled[judged.index].faces[0] if measured.modelled else faces[:0]
    remedy, told = "Let cloth collide: leave collision.cloth out.", ""
    is_off = collision.cloth is False and all(choice.key != "collision.cloth" for choice in measured.choices)
    if not is_off:
        remedy = "Place panels so that they do not start inside one another, and list garments from the inside out."
    if len(modelled):
        verb = "crosses" if len(modelled) == 1 else "cross"
        corners = np.unique(judged.garment.triangles[modelled])
        where = _part_under(judged, judged.of.outfit.meshes[judged.index].points[corners])
        told = f"; {counted(len(modelled), 'face')} {verb} in its file already{where}"
        mend = "Mend the mesh where it passes through itself: cloth that starts so may stay locked together."
        remedy = f"{mend} {remedy}" if is_off else mend
    share = len(faces) / count
    return FitProblem(
        ProblemCode.CROSSING,
        f'{counted(len(faces), "face")} of "{judged.name}" ({100 * share:.2g} %) '
        f"{'passes' if len(faces) == 1 else 'pass'} through other cloth{told}.",
        remedy,
        judged.name,
        {"faces": len(faces), "fraction": share, "faces_in_file": len(modelled)},
        faces=listed(faces),
    )


def _part_under(judged: Judged, points: Points) -> str:
    """Where on the body points [m], shape [N, 3], mostly are, as the end of a clause; empty: it has no limbs."""
    wearing, body = judged.of.outfit.wearing[judged.index], judged.of.body
    skeleton = None if body is None else skeleton_of(body) if wearing is None else wearing.skeleton
    return "" if skeleton is None else f", most of them at the {part_under(points, skeleton)}"
