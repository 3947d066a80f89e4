"""Is the cloth itself as it should be? Of the right scale, its seams closed, and not through itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warp_cloth.base.quantiles import quantiles
from warp_cloth.loading.raw import counted
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.report.judged import Judged, listed

WRONG_SCALE = 0.3  # strain of half the edges: the tightest of worn cloth has less
OPEN = 0.5  # strain of an edge: twice what any worn knit reaches, so it is a seam that did not close
# Fraction of faces that may pass through others where contact of cloth with cloth is switched off; of a T-shirt's,
# creased at the armpits, 0.03 do. With contact any crossing pair counts.
CROSSED_WITHOUT_CONTACT = 0.05


def cloth_problems(judged: Judged) -> Iterator[FitProblem]:
    """Problems of a garment with its own cloth, and with other garments'."""
    found = wrong_scale(judged), seam_open(judged), crossing(judged)
    yield from (problem for problem in found if problem is not None)


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


def seam_open(judged: Judged) -> FitProblem | None:
    """Edges still far longer than they are cut."""
    strains = judged.strains
    edges = np.flatnonzero(strains > OPEN)
    if not len(edges):
        return None
    ends, most = judged.edge_ends[edges], float(strains[edges].max())
    points = judged.points
    gap = 1e3 * float(np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1).max())
    verb = "is" if len(edges) == 1 else "are"
    return FitProblem(
        ProblemCode.SEAM_OPEN,
        f'{counted(len(edges), "edge")} of "{judged.name}" {verb} still stretched by more than {100 * OPEN:.0f} %, up '
        f"to {100 * most:.0f} %: a seam is held open, or the cloth is torn.",
        "Free what holds the two sides apart: pins on both, a limb between them, or a body larger than the garment.",
        judged.name,
        {"edges": len(edges), "strain_max": most, "limit": OPEN, "longest_mm": gap},
        vertices=listed(ends),
    )


def crossing(judged: Judged) -> FitProblem | None:
    """Faces that pass through others, of this garment or another."""
    crossings, collision = judged.of.measured.crossings, judged.of.scene.collision
    faces, count = crossings.faces[judged.index], len(judged.garment.triangles)
    limit = CROSSED_WITHOUT_CONTACT if collision.cloth is False else 0.0
    if not len(faces) > limit * count:
        return None
    remedy = "Let cloth collide: leave collision.cloth out."
    if collision.cloth is not False:
        remedy = "Place panels so that they do not start inside one another, and list garments from the inside out."
    share = len(faces) / count
    return FitProblem(
        ProblemCode.CROSSING,
        f'{counted(len(faces), "face")} of "{judged.name}" ({100 * share:.2g} %) '
        f"{'passes' if len(faces) == 1 else 'pass'} through other cloth.",
        remedy,
        judged.name,
        {"faces": len(faces), "fraction": share, "limit": limit},
        faces=listed(faces),
    )
