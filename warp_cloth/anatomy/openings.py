"""The openings of a garment from its mesh alone, as rings of cloth, and which limb each is for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from warp_cloth.anatomy.geodesics import EdgeGraph, Floats, LevelLines, level_lines
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM, LEFT_LEG, RIGHT_ARM, RIGHT_LEG, Skeleton
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.base.topology import Topology

NARROWEST = 0.09  # [m]; the girth of a child's cuff. A shorter loop is a buttonhole
RINGS = 4  # of cloth behind an opening, where the cloth is a tube: a hand may end within a sleeve
SLIT = 0.06  # of the body's span: the girth up to which an opening on one side is a slit, which no hand goes through
# Of the girth of the highest opening in the middle, a neckline or a waist: a narrower one below is cut out, as in lace.
# Not of the body's, as a file's unit is found by the limbs.
CUT_OUT = 0.5
LATERAL = 0.045  # of the body's span, from its middle: an opening farther off is for one limb
ACROSS = 0.2  # of an opening's width on the lesser side of the middle: a hem is no leg's, however far it flares
HEM = 0.7  # girth of a hem over a sleeve's, at least; a keyhole is smaller
PAIR = 0.95  # girth over the largest one's, of an opening that is its like on the other side
TALL = 0.5  # of a garment's height, of an opening from its neck to its hem
STRAP = 0.25  # of a neckline's girth, as wide as a halter's strap is at most
STRAP_BELOW = 0.05  # [m] below the shoulders, down to where a halter's strap may start
BESIDE = 0.08  # of the body's span: a garment that is farther to one side is beside the body

LEGS, ARMS = (RIGHT_LEG, LEFT_LEG), (RIGHT_ARM, LEFT_ARM)
Limbs = tuple[int, ...]
OPEN: Limbs = tuple(sorted((HEAD, *LEGS)))  # what an opening from neck to hem is for


@dataclass(frozen=True, eq=False)
class Opening:
    """A boundary loop of a garment that a limb fits through."""

    loop: Indices  # vertices in order, shape [N]
    girth: float  # at rest [m]
    distances: Floats  # of the garment's vertices from it, in the cloth [m], shape [V]
    depth: float  # distance up to which the cloth behind it is a tube [m]

    def rings(self, points: Points, triangles: Indices) -> LevelLines:
        """Rings of cloth at growing distances from the opening, the opening itself first; ``points`` [m]."""
        return level_lines(points, triangles, self.distances, self._levels)

    def rings_inwards(self, points: Points, triangles: Indices) -> Iterator[tuple[Points, Points]]:
        """The same one after another, the ends of their segments [m]: mostly the first one tells."""
        yield level_lines(points, triangles, self.distances, self._levels[:1]).ring(0)
        others = level_lines(points, triangles, self.distances, self._levels[1:])
        yield from (others.ring(level) for level in range(others.count))

    @property
    def _levels(self) -> Floats:
        """Distances of the rings from the opening [m]."""
        return np.concatenate([[1e-4], np.linspace(0.0, 0.95 * max(self.depth, 2e-3), RINGS)[1:]])

    def ring_behind(self, points: Points, triangles: Indices, distance: float) -> LevelLines | None:
        """The ring of cloth that far behind the opening [m]; None where the cloth is no tube there."""
        if not distance < 0.95 * self.depth:
            return None
        return level_lines(points, triangles, self.distances, np.array([distance]))


def openings_of(topology: Topology, triangles: Indices, lengths: Floats, vertex_count: int) -> tuple[Opening, ...]:
    """The openings of a garment with these edge lengths at rest [m], the largest first; a sheet's edge is none."""
    a, b = topology.edges.T
    keys = a.astype(np.int64) * vertex_count + b  # ascending, as edges are sorted
    loops = []
    for loop in topology.boundary_loops:
        here, there = loop.astype(np.int64), np.roll(loop, -1).astype(np.int64)
        sought = np.minimum(here, there) * vertex_count + np.maximum(here, there)
        edge = np.minimum(np.searchsorted(keys, sought), len(keys) - 1)
        girth = sum(lengths[edge[keys[edge] == sought]].tolist())
        if girth > NARROWEST:
            loops.append((loop, girth))
    if len(loops) < 2:
        return ()
    graph = EdgeGraph(topology.edges, lengths, vertex_count)
    distances = np.stack([graph.distances(loop) for loop, _ in loops])
    nearest = distances.argmin(axis=0)
    openings = []
    for number, (loop, girth) in enumerate(loops):
        own = distances[number]
        leaves = (nearest[a] == number) != (nearest[b] == number)
        depth = np.minimum(own[a], own[b])[leaves].min() if leaves.any() else 0.0
        openings.append(Opening(loop, girth, own, float(depth)))
    return tuple(sorted(openings, key=lambda opening: -opening.girth))


def limbs_for(openings: Sequence[Opening], points: Points, skeleton: Skeleton) -> list[Limbs]:
    """Which limbs each opening is for, by where it lies on the body; ``points``: the garment's as it starts [m].

    Of openings on one side the lower of two is for the leg, but above a hem the farther out is for the arm, and no limb
    is for the other, which is cut out, nor for a slit; a single one is for the leg if nothing opens below it in
    the middle, nor are there a neckline and a hem, as sleeves hang lower than a short one. In the middle, the highest
    opening above sleeves is for the head; others are for both legs, but for what is cut out, and a cape, which opens
    above the shoulders and has no sleeves, hangs from the head's opening alone. A halter's strap has the head on one
    side and both arms on the other. What is open in front has one opening in the middle, from neck to hem, next to
    those of its sleeves.

    Each separate piece is read by itself, as a lining within its shirt. One whose openings are all on one side, such as
    a glove or a leg warmer, does not show which limb it is for.
    """
    pieces = _pieces(openings)
    if len(pieces) == 1:
        return _limbs_of_piece(openings, points, points, skeleton)
    found: list[Limbs] = [()] * len(openings)
    for piece in pieces:
        own = [openings[number] for number in piece]
        across = [float((points[each.loop].mean(axis=0) - skeleton.middle) @ skeleton.left) for each in own]
        if len(own) < 2 or min(across) > LATERAL * skeleton.span or max(across) < -LATERAL * skeleton.span:
            continue
        cloth = points[np.isfinite(own[0].distances)]
        for number, limbs in zip(piece, _limbs_of_piece(own, points, cloth, skeleton), strict=True):
            found[number] = limbs
    return found


def _pieces(openings: Sequence[Opening]) -> list[list[int]]:
    """The numbers of the openings of each separate piece of cloth, the largest first."""
    pieces: list[list[int]] = []
    for number, opening in enumerate(openings):
        joined = (piece for piece in pieces if np.isfinite(openings[piece[0]].distances[opening.loop[0]]))
        piece = next(joined, None)
        if piece is None:
            pieces.append(piece := [])
        piece.append(number)
    return pieces


def _limbs_of_piece(openings: Sequence[Opening], points: Points, cloth: Points, skeleton: Skeleton) -> list[Limbs]:
    """The same of openings in one piece, whose own vertices are at ``cloth`` [m], shape [N, 3]."""
    centres = np.array([points[opening.loop].mean(axis=0) for opening in openings]) - skeleton.middle
    across, up = centres @ skeleton.left, centres @ skeleton.up
    sideways = (points - skeleton.middle) @ skeleton.left
    ends = (cloth - skeleton.middle) @ skeleton.left
    middle = 0.5 * float(ends.min() + ends.max())
    alike = len(openings) > 1 and openings[1].girth > PAIR * openings[0].girth  # both legs
    largest = float(across[:2].mean() if alike else across[0])
    # by both: one sleeve moves the middle, and a wide leg may be the largest opening
    aside = float(np.clip(middle, min(largest, 0.0), max(largest, 0.0)))
    if abs(aside) > BESIDE * skeleton.span:
        across, sideways = across - aside, sideways - aside

    def is_hem(number: int) -> bool:
        """Whether an opening is the lowest one, round both legs, and has no like, as a wide trouser leg has."""
        own = openings[number]
        left, right = float(sideways[own.loop].max()), -float(sideways[own.loop].min())
        has_like = any(PAIR * own.girth < other.girth < own.girth / PAIR for other in openings if other is not own)
        return up[number] == up.min() and min(left, right) > ACROSS * (left + right) and not has_like

    def side_of(number: int) -> int:
        """The side of the middle on which all of an opening is; 0: it is on both."""
        own = sideways[openings[number].loop]
        return int(own.min() > 0.0) - int(own.max() < 0.0)

    def is_of_pair(number: int) -> bool:
        """Whether all of an opening is on one side, and all of its like on the other, as those of briefs are."""
        girth = openings[number].girth
        mates = (n for n, each in enumerate(openings) if PAIR * girth < each.girth < girth / PAIR)
        return any(side_of(number) * side_of(n) < 0 for n in mates)

    near = [n for n in range(len(openings)) if abs(across[n]) <= LATERAL * skeleton.span and not is_of_pair(n)]
    in_middle = [n for n in range(len(openings)) if n in near or is_hem(n)]
    if _is_open_in_front(openings, points, cloth, skeleton, in_middle):
        return [OPEN if n in in_middle else ARMS[int(across[n] > 0.0) :][:1] for n in range(len(openings))]
    found: dict[int, Limbs] = {}
    for side, arm, leg in ((-1.0, RIGHT_ARM, RIGHT_LEG), (1.0, LEFT_ARM, LEFT_LEG)):
        aside_only = [n for n in range(len(openings)) if n not in in_middle and side * across[n] > 0.0]
        beside = [n for n in aside_only if openings[n].girth > SLIT * skeleton.span] or aside_only
        beside.sort(key=lambda n: -up[n])
        if len(beside) > 1 and any(up[n] < up[beside[-1]] for n in in_middle):  # a hem, and holes in its sides
            found[max(beside, key=lambda n: side * across[n])] = (arm,)
        elif len(beside) > 1:
            found |= {beside[0]: (arm,), beside[-1]: (leg,)}
        elif beside:
            below = any(up[n] < up[beside[0]] for n in in_middle)
            wide = [n for n in in_middle if openings[n].girth > HEM * openings[beside[0]].girth]
            found[beside[0]] = (arm,) if below or len(wide) > 1 else (leg,)
    sleeves = {limbs[0] for limbs in found.values()} & set(ARMS)
    in_middle.sort(key=lambda n: -up[n])
    shoulders = float((skeleton.shoulders - skeleton.middle) @ skeleton.up)
    if not found and _is_halter([openings[n] for n in in_middle], points @ skeleton.up, skeleton):
        return [((HEAD,), ARMS, LEGS)[in_middle.index(n)] for n in range(len(openings))]
    is_cape = not found and len(in_middle) > 0 and up[in_middle[0]] > shoulders
    for place, number in enumerate(in_middle):
        for_head = place == 0 and sleeves
        narrow = openings[number].girth < CUT_OUT * openings[in_middle[0]].girth
        is_cut_out = place > 0 and narrow and not is_hem(number)
        for_trunk: Limbs = () if is_cut_out else LEGS
        found[number] = (HEAD,) if is_cape else (HEAD, *sorted(set(ARMS) - sleeves)) if for_head else for_trunk
    return [found.get(number, ()) for number in range(len(openings))]


def _is_halter(openings: Sequence[Opening], up: Floats, skeleton: Skeleton) -> bool:
    """Whether the upper two of three openings, from the highest on, are either side of a strap behind the neck."""
    if len(openings) != 3:
        return False
    neck, arms, _ = openings
    at_shoulders = float(skeleton.shoulders @ skeleton.up) - STRAP_BELOW
    meets = float(neck.distances[arms.loop].min()) < STRAP * neck.girth
    return meets and all(float(up[each.loop].max()) > at_shoulders for each in (neck, arms))


def _is_open_in_front(
    openings: Sequence[Opening], points: Points, cloth: Points, skeleton: Skeleton, in_middle: Sequence[int]
) -> bool:
    """Whether a garment has no opening but one in the middle, tall and the largest, and one on either side at most."""
    if len(in_middle) != 1 or not 2 <= len(openings) <= 3:
        return False
    up = points @ skeleton.up
    centres = [points[openings[n].loop].mean(axis=0) for n in range(len(openings)) if n not in in_middle]
    sides = {bool((centre - cloth.mean(axis=0)) @ skeleton.left > 0.0) for centre in centres}
    is_tall = float(np.ptp(up[openings[in_middle[0]].loop])) > TALL * float(np.ptp(cloth @ skeleton.up))
    return is_tall and in_middle[0] == 0 and len(sides) == len(centres)
