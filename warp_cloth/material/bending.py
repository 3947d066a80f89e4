"""Hinge stiffness from a fabric and a rest shape: the garment bends like the fabric, whatever its mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import CHUNK_ROWS, map_chunks, map_rows
from warp_cloth.base.mesh import Indices
from warp_cloth.base.row_sums import RowSums
from warp_cloth.base.threads import concatenate
from warp_cloth.base.topology import ragged_rows
from warp_cloth.material.constants import Sheet
from warp_cloth.material.patch_factors import Fit, Patches

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric

Floats = NDArray[np.float64]

# The fold of a sliver can be arbitrarily large; it is limited to this many mean heights.
LARGEST_FOLD = 3.0
THINNEST_FRACTION = 1e-6  # of the median edge
LEAST_FRACTION = 1e-4  # of the other bending: replaces a bending of 0, so that its logarithm is finite
DIRECTIONS = 4  # directions over 180 degrees in which cloth without directions is bent
# Rounds in which neighbouring vertices equilibrate an even bend: enough for that, too few to undo the bend itself.
# The second and third time continue from the last result.
ROUNDS = (24, 8, 8)
MANY, SETTLED = 1_000_000, 1e-4  # more hinges than these stop when a round lowers the energy by less than this fraction
STEP, MOMENTUM = 0.6, 0.5  # of a round: the alternating grid, the stiffest case, converges within ten


@dataclass(frozen=True, eq=False)
class Folds:
    """Fold angles per curvature of N hinges in bent cloth.

    A hinge with its axis from (0, 0) to (L, 0) and wings at (s0, -h0), (s1, h1) on a surface of curvatures Kxx, Kxy,
    Kyy folds by across Kyy + mixed Kxy + along Kxx, with across = (h0 + h1) / 2, mixed = s1 - s0 and
    along = (s1 (s1 - L) / h1 + s0 (s0 - L) / h0) / 2. Displacements w of its vertices off the surface add slopes . w.
    """

    size: Floats  # axis / (mean wing height)^2 [1/m]
    across: Floats  # [m]
    mixed: Floats
    along: Floats
    angle: Floats  # from the warp to y [rad]
    slopes: Floats  # of axis start, axis end and both wings [1/m], shape [N, 4]

    def evenly(self, direction: float | Floats) -> Floats:
        """Fold per curvature [m] of cloth bent evenly in a direction, given by its angle to the warp, shape [N]."""
        return map_rows(_evenly, self.angle - direction, self.across, self.mixed, self.along)


def _evenly(angle: Floats, across: Floats, mixed: Floats, along: Floats) -> Floats:
    """Fold per curvature along a direction, at an angle to it."""
    cosine, sine = np.cos(angle), np.sin(angle)
    folded = cosine**2 * across + cosine * sine * mixed + sine**2 * along
    limit = LARGEST_FOLD * across
    return np.clip(folded, -limit, limit)


def hinge_constants(sheet: Sheet, fabric: Fabric, length: Floats) -> Floats:
    """C of every hinge [N m]: bending * axis / (mean wing height)^2, times a factor (model: bending).

    ``bending`` is warp cos^2 + weft sin^2 of the hinge's direction. The factors are exp(even + lean cos 2 angle), never
    negative, with an even and a lean for the patch round every vertex: such that each patch, bent to a curvature along
    the warp, and along the weft, has the energy bending / 6 curvature^3 per area. One pair for the whole garment would
    not do: where many diagonals happen to run alike, cloth is stiffer across them, and softer elsewhere.
    """
    folds = inner_folds(sheet, length)
    largest = max(fabric.bending_warp, fabric.bending_weft) if sheet.directed else fabric.bending
    if not len(folds.size) or largest == 0.0:
        return np.zeros_like(folds.size)
    wanted, bends, lean, usual = bending_directions(sheet, folds, (fabric.bending_warp, fabric.bending_weft), largest)
    usual = usual * folds.size
    fixed = near_border(sheet)
    patches = Patches(sheet, len(fixed))
    hinges = sheet.topology.hinges
    within = np.asarray(~fixed[hinges].any(axis=1))
    evens = [folds.evenly(bend) for bend in bends]
    cubes = [map_rows(_cubed, even) for even in evens]
    beyond = _beyond(sheet, length, folds, bends, len(fixed))
    scales = [patches.scale((cube, folds.size), own) for cube, own in zip(cubes, beyond, strict=True)]
    displacements = np.zeros((len(bends), len(fixed)))
    bias = _biased(folds) if sheet.directed else None
    if bias is not None:
        scales.append(np.mean(scales, axis=0))
        wanted.append(0.5 * sum(wanted))
    fit, balance = Fit(patches, usual, lean), Balance(sheet, folds, fixed)
    for rounds in ROUNDS:
        energies, ease = [], []
        counted = np.where(within, fit.stiffness, 0.0)
        for even, cube, displacement in zip(evens, cubes, displacements, strict=True):
            balanced = map_rows(_cubed, balance.folded(fit.stiffness, even, displacement, rounds))
            stiff, eased = (float(np.sum(map_rows(np.multiply, own, counted))) for own in (cube, balanced))
            ease.append(eased / stiff if stiff > 0.0 else 1.0)  # too small a garment has no inner hinges
            energies.append(map_rows(partial(within_border, ease[-1]), within, balanced, cube) if stiff > 0.0 else cube)
        if bias is not None:
            energies.append(bias * np.mean(ease))
        fit.improve(energies, scales, wanted)
    return fit.stiffness


def bending_directions(
    sheet: Sheet, folds: Folds, own: tuple[float, float], largest: float
) -> tuple[list[float], list[Floats], Floats, Floats]:
    """Directions in which patches are bent, and what they should resist there.

    Args:
        sheet: the garment.
        folds: of its H hinges.
        own: the fabric's resistance along warp and weft.
        largest: the larger of these, or that of cloth without directions.

    Returns:
        The resistance wanted in every direction; the direction as seen from each hinge [rad], each shape [H]; cos 2
        angle of every hinge, by which the resistance leans; the fabric's resistance in every hinge's direction.
    """
    if sheet.directed:
        wanted = [max(each, LEAST_FRACTION * largest) for each in own]
        bends = [np.zeros_like(folds.angle), np.full_like(folds.angle, 0.5 * np.pi)]
        lean = np.cos(2.0 * folds.angle)
        return wanted, bends, lean, 0.5 * (1.0 + lean) * wanted[0] + 0.5 * (1.0 - lean) * wanted[1]
    bends = [folds.angle + angle for angle in np.arange(DIRECTIONS) * np.pi / DIRECTIONS]
    return [largest] * DIRECTIONS, bends, np.zeros_like(folds.angle), np.full_like(folds.angle, largest)


def within_border(ease: float, within: NDArray[np.bool_], balanced: Floats, cube: Floats) -> Floats:
    """Equilibrated folds of inner hinges; hinges at the border are eased by the average."""
    return np.where(within, balanced, ease * cube)


def _cubed(folded: Floats) -> Floats:
    """|fold|^3; ``**`` takes many times as long."""
    return np.abs(folded * folded * folded)


def _biased(folds: Folds) -> Floats:
    """Mean cube of both biases' folds [m3], not equilibrated, as they have little weight."""
    return np.asarray(0.5 * (_cubed(folds.evenly(0.25 * np.pi)) + _cubed(folds.evenly(0.75 * np.pi))))


def _beyond(sheet: Sheet, length: Floats, folds: Folds, bends: list[Floats], count: int) -> list[Floats]:
    """Half the cubed folds at every vertex, for C = size, as if the cloth continued beyond the border.

    One for each bend [m2], shape [V].
    """
    border, ends = border_folds(sheet, length)
    summed = []
    for bend in bends:
        direction = float(bend[0]) if np.ptp(bend) == 0.0 else border.angle + float((bend - folds.angle)[0])
        half = 0.5 * border.size * _cubed(border.evenly(direction))
        summed.append(np.asarray(np.bincount(ends.ravel(), np.repeat(0.5 * half, 2), count), float))
    return summed


def near_border(sheet: Sheet) -> NDArray[np.bool_]:
    """Vertices of all triangles at the border, where hinges are missing; flags, shape [V]."""
    topology = sheet.topology
    once = np.bincount(topology.triangle_edges.ravel(), minlength=len(topology.edges)) == 1
    border = np.zeros(int(sheet.triangles.max()) + 1, dtype=bool)
    border[topology.edges[once].ravel()] = True
    near = np.zeros_like(border)
    near[sheet.triangles[border[sheet.triangles].any(axis=1)].ravel()] = True
    return near


class Rubbing(NamedTuple):
    """Friction of H hinges, bent to a curvature k [1/m], as ``Balance`` counts it; shape [H] each."""

    moment: Floats  # over k^2 [N m3]
    clinging: Floats  # fold per curvature up to which it grows [m]


class Balance:
    """Equilibrates even bends: moves vertices off the surface until neighbouring hinges balance."""

    def __init__(self, sheet: Sheet, folds: Folds, fixed: NDArray[np.bool_]) -> None:
        self._fixed = fixed  # vertices near the border, so that the bend stays
        hinges, count = sheet.topology.hinges, len(folds.across)
        self._slopes = np.ascontiguousarray(folds.slopes.T)
        self._size = np.abs(self._slopes)
        self._sizes, self._least = self._size.sum(axis=0), 0.02 * folds.across
        self._folded, self._force, self._curve = np.empty(count), np.empty(count), np.empty_like(self._slopes)
        self._half = np.empty((2, min(count, CHUNK_ROWS)))  # reused: allocation costs as much as the work in it
        self._counted, rows = count > MANY, hinges.T.ravel()
        by_hinge = np.arange(0, 4 * count + 1, 4), None
        self._moved = RowSums(by_hinge, hinges.ravel(), count, np.ascontiguousarray(folds.slopes).ravel())
        if self._counted:
            self._sums: Callable[[Floats], Floats] = lambda own: np.asarray(
                np.bincount(rows, own.ravel(), len(fixed)), float
            )
            self._pulls: Callable[[Floats], Floats] = lambda force: self._sums(force * self._slopes)
        else:
            by_vertex = ragged_rows(rows, len(fixed))
            summed = RowSums(by_vertex, np.arange(4 * count), len(fixed))
            self._sums = lambda own: summed(own.ravel())
            self._pulls = RowSums(by_vertex, np.tile(np.arange(count), 4), len(fixed), self._slopes.ravel())

    def folded(
        self, stiffness: Floats, even: Floats, displacement: Floats, rounds: int, rubbing: Rubbing | None = None
    ) -> Floats:
        """Folds per curvature [m] after vertices have moved from the even bend to where hinges balance, shape [H].

        Gradient descent on the sum of C |fold|^3 / 6, and of what ``rubbing`` takes, over the displacements of inner
        vertices, in ``displacement`` [m2], shape [V], which is updated.
        """
        half, curve, folded, force = 0.5 * stiffness, self._curve, self._folded, self._force

        def fold(part: slice, moved: Floats) -> None:
            np.add(even[part], moved, out=folded[part])

        def bend(part: slice, moved: Floats) -> None:
            fold(part, moved)
            size, other = self._half[:, : part.stop - part.start]
            np.abs(folded[part], out=size)
            np.multiply(half[part], folded[part], out=force[part])
            force[part] *= size
            np.add(size, self._least[part], out=other)
            other *= stiffness[part]
            np.multiply(other, self._size[:, part], out=curve[:, part])
            if rubbing is not None:
                secant = rubbing.moment[part] / np.maximum(size, rubbing.clinging[part])
                curve[:, part] += 2.0 * secant * self._size[:, part]
            curve[:, part] *= self._sizes[part]

        last, before = np.zeros(len(displacement)), np.inf
        for _ in range(rounds):
            self._moved.for_each_chunk(displacement, bend)
            if self._counted:
                energy = float(sum(map_chunks(partial(_energy, stiffness, folded), len(even))))
                if abs(before - energy) <= SETTLED * energy:
                    break
                before = energy
            slope = self._pulls(force) if rubbing is None else self._sums(self._rubbed(rubbing))
            bound = self._sums(curve)
            map_chunks(partial(self._advance, displacement, last, slope, bound), len(displacement))
        self._moved.for_each_chunk(displacement, fold)
        return folded

    def _rubbed(self, rubbing: Rubbing) -> Floats:
        """What hinges pull at their vertices, friction included; shape [4, H]."""
        secant = rubbing.moment / np.maximum(np.abs(self._folded), rubbing.clinging)
        return self._force * self._slopes + secant * self._folded * self._slopes

    def _advance(self, displacement: Floats, last: Floats, slope: Floats, bound: Floats, part: slice) -> None:
        """Updates the displacements of a chunk of vertices."""
        own, least = last[part], np.where(bound[part] > 0.0, bound[part], 1.0)
        own[...] = MOMENTUM * own - 2.0 * STEP * slope[part] / least
        own[self._fixed[part]] = 0.0
        displacement[part] += own


def _energy(stiffness: Floats, folded: Floats, part: slice) -> float:
    """Six times the energy of a chunk of hinges."""
    return float(np.sum(stiffness[part] * _cubed(folded[part])))


def _wing(sheet: Sheet, triangle: Any, side: Any, floor: float) -> tuple[Floats, ...]:
    """A triangle seen from one side: foot and height of its tip [m], direction and handedness of the side.

    The direction is a complex number, angle 0 along the warp; the handedness is 1 if the tip is to its left.
    """
    corners = sheet.flat[triangle, :, 1] + 1j * sheet.flat[triangle, :, 0]
    row = np.arange(len(corners))
    start, end, tip = (corners[row, (side + step) % 3] for step in range(3))
    direction = (end - start) / np.maximum(np.abs(end - start), floor)
    arm = (tip - start) * np.conj(direction)
    return arm.real, np.maximum(np.abs(arm.imag), floor), direction, np.where(arm.imag > 0.0, 1.0, -1.0)


def inner_folds(sheet: Sheet, length: Floats) -> Folds:
    """Folds of the garment's hinges."""
    topology, floor = sheet.topology, THINNEST_FRACTION * float(np.median(length))

    def some(part: slice) -> Folds:
        edge, pair = topology.hinge_edges[part], topology.hinge_triangles[part]
        axis = length[edge]
        side = np.argmax(topology.triangle_edges[pair] == edge[:, None, None], axis=2)
        s0, h0, direction, hand = _wing(sheet, pair[:, 0], side[:, 0], floor)
        foot, h1, _, _ = _wing(sheet, pair[:, 1], side[:, 1], floor)
        s1 = axis - foot  # the second triangle's side runs in the other direction
        return _folds_of(axis, (s0, h0), (s1, h1), direction, hand)

    parts = map_chunks(some, len(topology.hinge_edges))
    return Folds(*(concatenate([getattr(part, field.name) for part in parts]) for field in fields(Folds)))


def border_folds(sheet: Sheet, length: Floats) -> tuple[Folds, Indices]:
    """Folds of the border's edges if each had the mirror image of its triangle beyond it, and these edges."""
    topology = sheet.topology
    once = np.bincount(topology.triangle_edges.ravel(), minlength=len(length)) == 1
    triangle, side = np.nonzero(once[topology.triangle_edges])
    edge = topology.triangle_edges[triangle, side]
    axis, floor = length[edge], THINNEST_FRACTION * float(np.median(length))
    foot, height, direction, hand = _wing(sheet, triangle, side, floor)
    return _folds_of(axis, (foot, height), (axis - foot, height), direction, hand), topology.edges[edge]


def _folds_of(
    axis: Floats, first: tuple[Floats, Floats], second: tuple[Floats, Floats], direction: Floats, hand: Floats
) -> Folds:
    """Folds of hinges from feet and heights of their wings."""
    (s0, h0), (s1, h1) = first, second
    across = 0.5 * (h0 + h1)
    along = 0.5 * (s1 * (s1 - axis) / h1 + s0 * (s0 - axis) / h0)
    fraction_0, fraction_1 = s0 / axis, s1 / axis
    start = -((1.0 - fraction_0) / h0 + (1.0 - fraction_1) / h1)
    slopes = np.stack([start, -(fraction_0 / h0 + fraction_1 / h1), 1.0 / h0, 1.0 / h1], axis=1)
    # y is the side rotated by 90 degrees, away from the first tip; x is the side: n . x = -hand sin(angle)
    return Folds(axis / across**2, across, -hand * (s1 - s0), along, np.angle(-1j * hand * direction), slopes)
