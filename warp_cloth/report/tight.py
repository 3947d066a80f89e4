"""Where a garment's cloth is too tight all the way round: at an opening, or in the tube behind it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import level_lines
from warp_cloth.anatomy.openings import Limbs, Opening
from warp_cloth.anatomy.skeleton import HEAD, LIMBS
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.material.constants import Sheet
from warp_cloth.model.attempt import TORN
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.report.judged import Judged, listed

# Strain of a whole ring of cloth, which no garment of its size has, and how far from it its cloth is drawn along [m].
TIGHT_RING, AROUND = 0.3, 0.12
TIGHT_RIM = 0.1  # the same where nothing but an opening's edge itself looks torn: it is no seam that could be held open
APART = 0.01  # of rings [m]


@dataclass(frozen=True, eq=False)
class TightRing:
    """A ring of cloth that is stretched as a whole."""

    opening: Opening
    limbs: Limbs  # that the opening is for
    first: float  # how far behind the opening it begins, is tightest and ends [m]
    tightest: float
    last: float
    cut: float  # its girth where it is tightest, as cut and as worn [m]
    worn: float

    @property
    def vertices(self) -> Indices:
        """Where it is tightest."""
        if not self.tightest > 0.0:
            return self.opening.loop
        return np.flatnonzero(np.abs(self.opening.distances - self.tightest) <= APART).astype(np.int32)

    def explains(self, edges: Indices) -> NDArray[np.bool_]:
        """Which edges, shape [E, 2], are stretched for this ring's sake."""
        distance = self.opening.distances[edges]
        return (distance.max(axis=1) <= self.last + AROUND) & (distance.min(axis=1) >= self.first - AROUND)


def tight_rings(judged: Judged) -> list[TightRing]:
    """The rings around which edges look torn and are only tight, one an opening at most."""
    wearing, torn = judged.of.outfit.wearing[judged.index], judged.edge_ends[judged.strains > TORN]
    if wearing is None or not len(torn):
        return []
    found = [
        _at_opening(judged, opening, limbs, torn) or _behind(judged, opening, limbs)
        for opening, limbs in zip(wearing.openings, wearing.limbs, strict=True)
    ]
    return [ring for ring in found if ring is not None and ring.explains(torn).any()]


def tight_problems(judged: Judged, rings: Sequence[TightRing]) -> Iterator[FitProblem]:
    """A neckline too narrow for the shoulders slides off them; what else is tight is too small."""
    for ring in rings:
        girths = f"{100 * ring.cut:.0f} cm around, is stretched to {100 * ring.worn:.0f} cm"
        if HEAD in ring.limbs:  # a neck is narrower than any neckline
            code, remedy = ProblemCode.SLID_OFF, "Use a larger size, or a body with its arms further from its sides."
            message = f'"{judged.name}" has slid off the shoulders: its neckline, {girths}.'
        else:
            code, remedy = ProblemCode.TOO_SMALL, "Use a larger size or a softer fabric, or a smaller body."
            body = " and ".join(LIMBS[limb] for limb in ring.limbs) or "body"
            part = f"its cloth {100 * ring.tightest:.0f} cm behind the" if ring.tightest > 0.0 else "its"
            message = f'"{judged.name}" is too small for the body: {part} opening for the {body}, {girths}.'
        figures = {"girth_mm": 1e3 * ring.cut, "worn_girth_mm": 1e3 * ring.worn, "limit": TIGHT_RING}
        yield FitProblem(code, message, remedy, judged.name, figures, vertices=listed(ring.vertices))


def _at_opening(judged: Judged, opening: Opening, limbs: Limbs, torn: Indices) -> TightRing | None:
    loop = judged.points[opening.loop]
    worn = float(np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).sum())
    near = torn[opening.distances[torn].max(axis=1) <= AROUND]
    is_rim = HEAD not in limbs and bool(np.isin(near, opening.loop).all())
    if not len(near) or not worn > (1.0 + (TIGHT_RIM if is_rim else TIGHT_RING)) * opening.girth:
        return None
    return TightRing(opening, limbs, 0.0, 0.0, 0.0, opening.girth, worn)


def _behind(judged: Judged, opening: Opening, limbs: Limbs) -> TightRing | None:
    """A tight part of a sleeve, a leg or a waist, further in than its end."""
    sheet, levels = judged.garment.rest.sheet, np.arange(APART, opening.depth, APART)
    if HEAD in limbs or sheet is None or not len(levels):
        return None
    cut, worn = girths_behind(opening, levels, judged.points, sheet)
    strain = worn / np.maximum(cut, 1e-12) - 1.0
    tight = np.flatnonzero(strain > TIGHT_RING)
    if not len(tight):
        return None
    most = int(strain.argmax())
    first, tightest, last = levels[[tight[0], most, tight[-1]]].tolist()
    return TightRing(opening, limbs, first, tightest, last, float(cut[most]), float(worn[most]))


def girths_behind(
    opening: Opening, levels: NDArray[np.float64], points: Points, sheet: Sheet
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Girths of the rings at these distances behind an opening [m], as cut and as worn [m], shape [levels] each."""
    apart = np.arange(3 * len(sheet.triangles), dtype=np.int32).reshape(-1, 3)  # each triangle lies flat by itself
    flat = np.pad(sheet.flat.reshape(-1, 2), ((0, 0), (0, 1)))
    cut = level_lines(flat, apart, opening.distances[sheet.triangles].ravel(), levels)
    return cut.girths(), level_lines(points, sheet.triangles, opening.distances, levels).girths()
