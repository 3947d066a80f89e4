"""Which limbs pass through which openings: how often their curves cross a surface that spans each ring of cloth.

By parity, so that neither the surface chosen nor the winding of the mesh matters. A surface that spans the other side
of the body is crossed by all limbs that it did not count, so an opening's limbs are known up to their complement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.crossings import cone_crossings, surface_crossings
from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.anatomy.openings import ARMS, LEGS, Limbs, Opening, limbs_for
from warp_cloth.anatomy.shoulders import Shoulders, height_over_shoulders
from warp_cloth.anatomy.skeleton import HEAD, LIMBS, Skeleton
from warp_cloth.anatomy.standing import moved_from_standing
from warp_cloth.base.curves import arc_lengths
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.topology import triangles_across

SLEEVED = tuple((arm,) for arm in ARMS)  # whom a sleeve is for
SINGLE = tuple((limb,) for limb in (*ARMS, *LEGS))  # whom a sleeve or a leg is for: it hangs empty without
SUNK = 0.07  # of the body's span, that the top of a skirt comes down at most where its waist holds it
# Slope of the top of what hangs from the waist, from side to side and beyond that of its cut, at which it hangs from
# one hip: 24 degrees, from the waist on one side down to the buttock on the other.
LOPSIDED = 0.45
FAR_TRUNK = 0.08  # of the body's span, from the middle of its openings: the trunk is not where its garment is
UNDER_ARMS = 0.045  # of the span, by which a top that hangs from the bust is sewn lower where the arms hold it open
FAR_WAIST = 0.25  # [m] above or below the waist: low trousers and high skirts begin nearer
BUST = 0.4  # of the way from the waist to the shoulders: strapless tops begin at 0.47 and higher, high waists at 0.07
COVERED = 0.03  # [m] of a sleeve beyond the fingertips, or of a leg beyond the toes, that is too long
NECK = 0.08  # [m] above the shoulders: a neckline that starts higher is round the head
LOW = 0.05  # [m] below the shoulders, where what has sleeves stays off them: nothing falls up
TIP = 0.012  # of the span: so much of a limb's end, where its curve meets the skin, may show through a large face
LEVEL = 0.01  # [m] by which the rims of a disc differ in height, where it starts flat
NECK_TO_SLEEVE = 0.2  # [m] from the neckline to the opening of a sleeve, at least; to an armhole it is 0.06 to 0.12
FAR_SHOULDERS = 0.14  # of the span, above or below the shoulders: from nearer, what starts beside them falls onto them


@dataclass(frozen=True, eq=False)
class Misplaced:
    """An opening that other limbs pass through than those it is for."""

    opening: Opening
    wanted: Limbs
    found: Limbs


def misplaced_openings(
    openings: Sequence[Opening], wanted: Sequence[Limbs], points: Points, triangles: Indices, skeleton: Skeleton
) -> list[Misplaced]:
    """The openings of a garment at ``points`` [m], shape [V, 3], that not all and only their limbs pass through."""
    found = []
    for opening, limbs in zip(openings, wanted, strict=True):
        if not limbs or (limbs in SINGLE and limbs[0] in skeleton.lacks):
            continue
        through: Limbs = ()
        for ring in opening.rings_inwards(points, triangles):
            through = limbs_through(*ring, skeleton.curves)
            if _fits(limbs, through, skeleton.lacks):
                break
        else:
            found.append(Misplaced(opening, limbs, through))
    return found


def covered_limbs(
    openings: Sequence[Opening], wanted: Sequence[Limbs], points: Points, triangles: Indices, skeleton: Skeleton
) -> list[tuple[Opening, Limbs]]:
    """The ends of sleeves and legs that their limb does not come out of, but ends in the tube, COVERED behind them."""
    found = []
    for opening, limbs in zip(openings, wanted, strict=True):
        is_tube = len(limbs) == 1 and limbs[0] not in (HEAD, *skeleton.lacks)
        ring = opening.ring_behind(points, triangles, COVERED) if is_tube else None
        if ring is None or _fits(limbs, limbs_through(*ring.ring(0), skeleton.curves)):
            continue
        rings = opening.rings(points, triangles)
        if any(_fits(limbs, limbs_through(*rings.ring(level), skeleton.curves)) for level in range(1, rings.count)):
            found.append((opening, limbs))
    return found


def _fits(wanted: Limbs, found: Limbs, lacks: Limbs = ()) -> bool:
    """Whether these limbs pass, or all others; arms that a body lacks may. A face may stay within its hood."""
    own = set(range(len(LIMBS))) - (set(lacks) & set(ARMS))
    accepted: list[Limbs] = [wanted, ()] if wanted == (HEAD,) else [wanted]
    return any(own & set(found) in (own & set(limbs), own - set(limbs)) for limbs in accepted)


def limbs_through(start: Points, end: Points, curves: Sequence[Points]) -> Limbs:
    """The limbs whose curves cross the cone over a ring of segments, ``start`` to ``end`` [m], an odd number of times.

    ``start``, ``end``: shape [S, 3].
    """
    if len(start) < 3:
        return ()
    return tuple(np.flatnonzero(cone_crossings(start, end, curves) % 2).tolist())


def curve_crossings(points: Points, triangles: Indices, curve: Points) -> int:
    """How often a curve, shape [N, 3], passes through the triangles of a garment [m]."""
    return int(surface_crossings(points, triangles, [curve])[0])


@dataclass(frozen=True, eq=False)
class Wearing:
    """A garment's openings on a body: which limbs they are for."""

    openings: tuple[Opening, ...]
    limbs: tuple[Limbs, ...]
    triangles: Indices
    skeleton: Skeleton
    start: Points  # where the garment starts [m], shape [V, 3]
    followed: Points  # the same, moved with the trunk of a body that does not stand as the garment wants [m]

    @classmethod
    def of(cls, openings: tuple[Opening, ...], points: Points, triangles: Indices, skeleton: Skeleton) -> Wearing:
        """``points`` are those that the garment starts at [m].

        Where that is bad on a body that sits or bows, the garment is taken to be placed for one who stands. So is a
        wide skirt, which would be a cape where it starts, or for one who is taller: on a child an adult's waist is at
        its neck, and its skirt is lowered to the child's waist.
        """
        placed = cls(openings, tuple(limbs_for(openings, points, skeleton)), triangles, skeleton, points, points)
        followed = moved_from_standing(points, skeleton)
        if followed is None and placed.is_wide_cape and placed.start_fault:
            followed = points - max(placed._top_over_waist, 0.0) * skeleton.up
        if followed is None or not (placed.start_fault or placed.is_wide_cape):
            return placed
        return cls(openings, tuple(limbs_for(openings, followed, skeleton)), triangles, skeleton, points, followed)

    def started_at(self, points: Points) -> Wearing:
        """The same garment if it started at ``points`` [m]."""
        return Wearing.of(self.openings, points, self.triangles, self.skeleton)

    def measure_start(self) -> None:
        """Computes now what does not depend on the shape that is asked about, else computed when first asked for."""
        _ = self.onto, self.too_high, self.above_waist, self.above_neck, self.top, self.between_legs
        _ = self.shoulders, self._curves_within

    @cached_property
    def start_fault(self) -> str:
        """Why the garment cannot be sewn where it starts, with a limb through the wrong opening; empty: it can."""
        if pierced := self.pierced(self.start):
            return f"cloth starts on both sides of the {LIMBS[pierced[0]]}"
        if self.misplaced_at_start:
            return f"an opening starts beside the {LIMBS[self.misplaced_at_start[0].wanted[0]]}"
        return "" if self.followed is self.start else "it starts where one who stands, or is taller, would wear it"

    def distances(self) -> dict[Limbs, Floats]:
        """The vertices' distances from each opening, by the limbs that it is for [m], each of shape [V]."""
        found: dict[Limbs, Floats] = {}
        for opening, limbs in zip(self.openings, self.limbs, strict=True):
            own = opening.distances
            found[limbs] = np.where(np.isfinite(own), own, found.get(limbs, own))  # a lining has the same openings
        return found

    @cached_property
    def misplaced_at_start(self) -> list[Misplaced]:
        return self.misplaced(self.followed)

    @property
    def is_wide_cape(self) -> bool:
        """Whether it hangs from the head's opening alone, and that is too wide to lie between the shoulders."""
        right, left = (self.skeleton.curves[arm][self.skeleton.joints[arm]] for arm in ARMS)
        narrowest = min((opening.girth for opening in self.openings), default=0.0)
        return self._is_cape and 0.5 * narrowest > float(np.linalg.norm(left - right))

    @property
    def _is_cape(self) -> bool:
        """Whether it hangs from the head's opening alone."""
        return (HEAD,) in self.limbs and all(limbs in ((HEAD,), ()) for limbs in self.limbs)

    @property
    def hangs_from_waist(self) -> bool:
        """Whether neither the head nor an arm has an opening."""
        return not any(set(limbs) & {HEAD, *ARMS} for limbs in self.limbs)

    @property
    def is_skirt(self) -> bool:
        """Whether it hangs from the waist and has no legs."""
        return self.hangs_from_waist and all(len(limbs) != 1 for limbs in self.limbs)

    @property
    def hangs_from_bust(self) -> bool:
        """Whether it is a skirt or a dress without straps."""
        return self.is_skirt and self._begins_at_bust

    def below_arms(self) -> Wearing:
        """The garment taken to start so much lower that its top is clear of the arms."""
        down = UNDER_ARMS * self.skeleton.span * self.skeleton.up
        return replace(self, followed=self.followed - down)

    @property
    def is_trousers(self) -> bool:
        """Whether it hangs from the waist and has legs."""
        return self.hangs_from_waist and self.has_legs

    @cached_property
    def too_high(self) -> float:
        """How far above the shoulders it is to start [m]; 0: it is not."""
        return max(self.over_shoulders(self.onto), 0.0)

    @cached_property
    def above_waist(self) -> float:
        """How far above the waist is to start what hangs from there [m]; 0: it is not, or it hangs from the bust."""
        return 0.0 if not self.hangs_from_waist or self._begins_at_bust else max(self._top_over_waist, 0.0)

    @property
    def is_held_by_hips(self) -> bool:
        """Whether it is a skirt that begins below the bust, so that the hips hold it."""
        return self.is_skirt and not self._begins_at_bust

    @cached_property
    def above_neck(self) -> float:
        """How far above the neck a cape is to start, which has no sleeves to tell its height [m]; 0: it is not."""
        if not self._is_cape:
            return 0.0
        centre = self.onto[self.top.loop].mean(axis=0)
        return max(float((centre - self.skeleton.shoulders) @ self.skeleton.up) - NECK, 0.0)

    @cached_property
    def top(self) -> Opening:
        """The opening that is to start highest; of a flat disc the inner one."""
        heights = [float(self.onto[opening.loop].mean(axis=0) @ self.skeleton.up) for opening in self.openings]
        if max(heights) - min(heights) < LEVEL:
            return min(self.openings, key=lambda opening: opening.girth)
        return self.openings[int(np.argmax(heights))]

    @property
    def _top_over_waist(self) -> float:
        """How far above the waist it is to start [m]."""
        return float((self.onto[self.top.loop].mean(axis=0) - self.skeleton.waist) @ self.skeleton.up)

    @property
    def _begins_at_bust(self) -> bool:
        waist_to_shoulders = float((self.skeleton.shoulders - self.skeleton.waist) @ self.skeleton.up)
        return self._top_over_waist >= BUST * waist_to_shoulders

    @property
    def is_round_head(self) -> bool:
        """Whether the head, not the neck, would be within the neckline where the garment is to start."""
        return self.too_high > NECK

    def over_shoulders(self, points: Points) -> float:
        """How much higher the garment at ``points`` [m] is than on the shoulders [m]; 0: it has none."""
        return height_over_shoulders(self.limbs, points, self.triangles, self.skeleton)

    @cached_property
    def between_legs(self) -> NDArray[np.intp]:
        """The vertices where the legs of trousers meet, from the waist to the crotch; none of other garments."""
        if not self.has_legs:
            return np.zeros(0, dtype=np.intp)
        return np.unique(triangles_across(self.triangles, self.on_left))

    @property
    def has_legs(self) -> bool:
        """Whether each leg has an opening of its own."""
        return all((leg,) in self.limbs for leg in LEGS)

    @property
    def on_left(self) -> NDArray[np.bool_]:
        """Which vertices are nearer to the opening of the left leg than to that of the right, shape [V]."""
        distances = self.distances()
        right, left = (distances[leg,] for leg in LEGS)
        return left < right

    def rise(self, points: Points, below_crotch: float = 0.0) -> float:
        """How far the garment at ``points`` could be moved up to where its highest opening started [m].

        Trousers no farther than to ``below_crotch`` under the body's crotch; they may lie above it.
        """
        return min(self.drop(points), self._below_crotch(points) - below_crotch)

    def drop(self, points: Points) -> float:
        """How far the opening that starts highest has come down from its place on the body, at ``points`` [m]."""
        return float((self.onto[self.top.loop] - points[self.top.loop]).mean(axis=0) @ self.skeleton.up)

    def sunk(self, points: Points) -> bool:
        """Whether a garment that hangs from the waist has slid down it, or down one side of it, at ``points`` [m]."""
        if not self.hangs_from_waist:
            return False
        sunk = min(self.drop(points) - self.above_waist, self._below_crotch(points))
        return sunk > SUNK * self.skeleton.span or self.hangs_from_one_hip(points)

    def hangs_from_one_hip(self, points: Points) -> bool:
        """Whether the top of a garment that hangs from the waist slopes down to one side, at ``points`` [m]."""
        return self.hangs_from_waist and abs(self.slope(points)) > LOPSIDED

    def slope(self, points: Points) -> float:
        """How much the opening that starts highest rises to the left at ``points`` [m], over where it starts."""
        top, left, up = self.top.loop, self.skeleton.left, self.skeleton.up
        return _slope(points[top] @ left, points[top] @ up) - _slope(self.onto[top] @ left, self.onto[top] @ up)

    def over_end(self, points: Points) -> float:
        """How far the top of what hangs from the waist reaches above the body's end, at ``points`` [m]."""
        top = max(self.openings, key=lambda opening: float((points[opening.loop] @ self.skeleton.up).mean()))
        return float((points[top.loop] @ self.skeleton.up).max()) - self._end

    @cached_property
    def room_above(self) -> float:
        """How far up it may start at most, so that its neckline or waist is not above a body that ends there [m].

        Infinite, where the body does not end; negative, where a waist starts above it, or what lies on the shoulders
        starts above them: falling, a neckline hooks on the stump of a neck.
        """
        if HEAD not in self.skeleton.lacks:
            return float("inf")
        if self.hangs_from_waist:
            return -self.over_end(self.start)
        above = self.over_shoulders(self.start)
        if above > 0.0:
            return -above
        pairs = zip(self.openings, self.limbs, strict=True)
        necklines = [float((self.start[each.loop] @ self.skeleton.up).min()) for each, limbs in pairs if HEAD in limbs]
        return max(self._end - min(necklines), 0.0) if necklines else float("inf")

    @property
    def _end(self) -> float:
        """Height of the body's top, without the limbs that it lacks [m]."""
        return float((self.skeleton.skin[self.skeleton.own] @ self.skeleton.up).max())

    def _below_crotch(self, points: Points) -> float:
        """How far the crotch of trousers at ``points`` is below the body's [m]; infinite: it is none."""
        if not len(self.between_legs):
            return float("inf")
        up = self.skeleton.up
        return float((self.skeleton.spine @ up).min()) - float((points[self.between_legs] @ up).min())

    def misplaced(self, points: Points) -> list[Misplaced]:
        """The openings that the wrong limbs pass through, with the garment at ``points`` [m]."""
        return misplaced_openings(self.openings, self.limbs, points, self.triangles, self.skeleton)

    @cached_property
    def onto(self) -> Points:
        """Where the garment is to start on the body [m], shape [V, 3]."""
        return self.followed + self.shift

    @cached_property
    def shift(self) -> Points:
        """What moves the garment onto the body that it starts beside [m], shape [3]; else 0.

        Across, so that the trunk passes through the middle of its openings, where it does not or is far from there, and
        the neck through the neckline, where cloth is on both sides of the head. Up and down so that it lies on the
        shoulders, where it has any and is far from that, or its neckline would be sewn over the head or below the arms.
        Else only where a waist is far from the body's and not round its trunk, since where trousers begin is their
        designer's choice; or where the body ends below it.
        """
        skeleton, points = self.skeleton, self.followed
        wrong = {id(each.opening) for each in self.misplaced_at_start}
        pairs = zip(self.openings, self.limbs, strict=True)
        sleeves = [points[opening.loop].mean(axis=0) for opening, limbs in pairs if limbs in SLEEVED]
        shift = np.zeros(3)
        is_wrong = any(id(opening) in wrong for opening in self._round_trunk)
        is_moved = self.hangs_from_waist and self.followed is not self.start  # onto who sits
        if is_wrong or is_moved or float(np.linalg.norm(self.across)) > FAR_TRUNK * skeleton.span:
            shift = shift + self.across
        to_neck = self._onto_neck(points + shift)
        if above := self.over_shoulders(points + shift + to_neck):
            is_round_head = above > NECK and self._pierced_by_head(points + shift + to_neck)
            is_under = above < 0.0 and any(HEAD in each.wanted for each in self.misplaced_at_start)
            is_low = above < -LOW and bool(self.start_fault) and self._has_sleeves
            is_over_stump = above > 0.0 and HEAD in skeleton.lacks
            if is_round_head or is_under or is_low or is_over_stump or abs(above) > FAR_SHOULDERS * skeleton.span:
                shift = shift - skeleton.up * above
                to_neck = self._onto_neck(points + shift)  # there; an adult's neckline is above a child's head
            shift = shift + to_neck
        elif sleeves:
            up = float((skeleton.shoulders - np.mean(sleeves, axis=0)) @ skeleton.up)
            shift = shift + skeleton.up * (up if abs(up) > FAR_SHOULDERS * skeleton.span else 0.0)
        elif self.hangs_from_waist and is_wrong:
            middles = [points[opening.loop].mean(axis=0) for opening in self._round_trunk]
            up = -max(float((middle - skeleton.middle) @ skeleton.up) for middle in middles)
            shift = shift + skeleton.up * (up if abs(up) > FAR_WAIST else 0.0)
        if self.hangs_from_waist and HEAD in skeleton.lacks:
            shift = shift - skeleton.up * max(self.over_end(points + shift), 0.0)
        return shift

    @property
    def _has_sleeves(self) -> bool:
        """Whether arms' openings are far from the neckline, as armholes are not."""
        pairs = list(zip(self.openings, self.limbs, strict=True))
        necks = [opening.loop for opening, limbs in pairs if HEAD in limbs]
        arms = [opening for opening, limbs in pairs if limbs in SLEEVED]
        far = [float(arm.distances[neck].min()) > NECK_TO_SLEEVE for arm in arms for neck in necks]
        return bool(far) and all(far)

    def _onto_neck(self, points: Points) -> Points:
        """What moves a neckline that starts before or behind the neck round it, across [m], shape [3].

        0 where the head is within it, or the cloth would be on both sides of the head there, too.
        """
        necklines = [each for each, limbs in zip(self.openings, self.limbs, strict=True) if limbs == (HEAD,)]
        if not necklines or not self._pierced_by_head(points):
            return np.zeros(3)
        up, head = self.skeleton.up, self.skeleton.curves[HEAD]
        centre = points[necklines[0].loop].mean(axis=0)
        height = (head - centre) @ up
        off = head[int(np.abs(height).argmin())] - centre
        across: Points = off - up * (off @ up)
        return np.zeros(3) if self._pierced_by_head(points + across) else across

    def _pierced_by_head(self, points: Points) -> bool:
        return curve_crossings(points, self.triangles, self.skeleton.curves[HEAD]) > 0

    @cached_property
    def _round_trunk(self) -> list[Opening]:
        """The openings that the trunk or the head passes through."""
        pairs = zip(self.openings, self.limbs, strict=True)
        return [opening for opening, limbs in pairs if len(limbs) > 1 or limbs == (HEAD,)]

    @cached_property
    def across(self) -> Points:
        """The horizontal move of the garment that puts the middle of its openings round the trunk [m], shape [3]."""
        skeleton = self.skeleton
        if not self._round_trunk:
            return np.zeros(3)
        centres = np.array([self.followed[opening.loop].mean(axis=0) for opening in self._round_trunk])
        off = (skeleton.spine_at(centres) - centres).mean(axis=0)
        across: Points = off - skeleton.up * (off @ skeleton.up)
        return across

    def covered(self, points: Points) -> list[tuple[Opening, Limbs]]:
        """The ends of sleeves and legs that are too long for their limb, with the garment at ``points`` [m]."""
        return covered_limbs(self.openings, self.limbs, points, self.triangles, self.skeleton)

    @cached_property
    def shoulders(self) -> Shoulders:
        """The shoulders that the garment started over."""
        return Shoulders.of(self.limbs, self.onto, self.triangles, self.skeleton)

    def off_shoulders(self, points: Points) -> Limbs:
        """The arms whose shoulder the garment at ``points`` [m] has slipped off."""
        return self.shoulders.slipped(points, self.triangles)

    def pierced(self, points: Points) -> Limbs:
        """The limbs that the cloth at ``points`` [m] runs through the middle of, not only through their tips."""
        through = np.flatnonzero(surface_crossings(points, self.triangles, self._curves_within)).tolist()
        return tuple(limb for limb in through if limb not in self.skeleton.lacks)

    @cached_property
    def _curves_within(self) -> list[Points]:
        """The limbs' curves without their tips, which lie on the skin."""
        lengths = [arc_lengths(curve) for curve in self.skeleton.curves]
        tip = TIP * self.skeleton.span
        pairs = zip(self.skeleton.curves, lengths, strict=True)
        return [curve[along <= max(along[-1] - tip, 0.0)] for curve, along in pairs]


def _slope(across: Floats, up: Floats) -> float:
    """The slope of the line of least squares through points of a plane [m], each of shape [N]."""
    off = across - across.mean()
    return float(off @ (up - up.mean())) / max(float(off @ off), 1e-12)
