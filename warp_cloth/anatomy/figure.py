"""A body that is measured: its frame, levels and points, found once.

Heights are in a frame that stands as the body does. A tape's girth lies square to the vertical round a trunk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.geodesics import row_lengths
from warp_cloth.anatomy.levels import CHEST_OF_TRUNK, Heights, Level, trunk_level, trunk_levels, under_bust_level, width
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM, RIGHT_ARM, STEP, Skeleton, without_loose_parts
from warp_cloth.anatomy.stance import ASTRIDE, STATURE, UPRIGHT, Stance, stance_of
from warp_cloth.anatomy.tape import Plane, Tape, part_of, shortest, tape_round
from warp_cloth.anatomy.trunk_ends import lacks_head, trunk_ends
from warp_cloth.base.mesh import Mesh, Points

F = TypeVar("F", bound="Figure")

NECK_TILTS = np.radians(np.arange(0.0, 41.0, 5.0))  # of the neck's tape, lower in front
JOINED = 1.1  # times as wide as without arms: arms are part of the section
# Of the trunk, from the crotch to the arms' roots, where arms join its section at the lowest: at 0.87 in the heaviest.
ARMPITS = 0.85
# Of arms that are so far from the trunk [degrees] the armpits are where they join, at ARMPIT in most people; lower than
# that, the head is large or the neck hidden, and the roots are estimated too high: by a fifth in the newborn. What
# joins lower still is cloth, or a hand on the trunk.
APART, ARMPIT, LOWEST_ARMPIT = 25.0, 0.95, 0.6
# Just below their armpits arms are near the trunk, in parts of their width: 0.0 to 0.25. What closes the holes of a
# scan there ends farther out, at 1.2.
NEAR_TRUNK = 0.5
NECKS, NECK_STEP = (0.78, 0.89), 0.005  # of the stature: where the neck's narrowest level section is looked for
NECK_SHIFTS = np.linspace(-0.015, 0.015, 7)  # of the stature, along the neck, from there
# Where a head leans more than this from the trunk's up [degrees], to a side in most, its neck is also sought square to
# its curve, by the curve's points that many before and after its joint: 8 degrees in who stands.
HEAD_LEANS, NECK_STEPS = 30.0, 6
NECK_AROUND = 0.1  # of the stature, round its middle: what the tape may touch
RIM = 0.004  # of the stature: what is so near to a cut through the body is its rim
CROTCH_ROUNDS = 12  # halvings of its height


@dataclass(frozen=True, eq=False)
class Figure:
    """A body that is measured: its levels and points, found once."""

    body: Mesh
    skeleton: Skeleton
    stance: Stance

    @classmethod
    def of(cls: type[F], body: Mesh, skeleton: Skeleton) -> F:
        return cls(*without_loose_parts(body, skeleton), stance_of(skeleton))

    @property
    def _lacks_feet(self) -> bool:
        return {leg.number for leg in self.stance.legs} <= set(self.skeleton.lacks)

    @property
    def _lacks_head(self) -> bool:
        level, tape = self.neck_level, self.neck
        if level is None or tape is None or HEAD in self.skeleton.lacks:
            return HEAD in self.skeleton.lacks
        return lacks_head(self._without_arms, level.height, self.crown, self.stature, tape.length)

    @cached_property
    def frame(self) -> Points:
        """Unit vectors to the left, up and forward, shape [3, 3]; up, along the trunk, is vertical of who stands."""
        if self.stance.trunk_lean <= UPRIGHT:
            return np.stack([self.stance.left, self.stance.vertical, self.stance.forward])
        return np.stack([self.skeleton.left, self.skeleton.up, self.skeleton.forward])

    @cached_property
    def upright(self) -> Points:
        """The body's vertices in the frame [m], shape [V, 3]."""
        return np.asarray(self.body.points @ self.frame.T, dtype=np.float64)

    @cached_property
    def middle(self) -> float:
        """The plane between left and right, in the frame [m]."""
        return float((self.skeleton.spine @ self.frame[0]).mean())

    @cached_property
    def whole(self) -> Mesh:
        """The body in the frame."""
        return Mesh(self.body.name, self.upright, self.body.triangles)

    @cached_property
    def trunk(self) -> Mesh:
        """The body in the frame, without its arms."""
        arm = np.isin(self.skeleton.limb, (RIGHT_ARM, LEFT_ARM))
        kept = self.body.triangles[~arm[self.body.triangles].any(axis=1)]
        return Mesh(self.body.name, self.upright, kept)

    @cached_property
    def stature(self) -> float:
        """Stature [m]: of a body that does not stand, from its legs, trunk and head."""
        if self.stance.stands and self._lacks_feet:
            return self.crown - min(float(leg.curve[0] @ self.frame[1]) for leg in self.stance.legs)
        if self.stance.stands:
            return self.crown - float(self.upright[:, 1].min())
        legs = np.mean([len(leg.curve) for leg in self.stance.legs]) * STEP * self.skeleton.span
        hips = float(self.skeleton.spine[0] @ self.frame[1])
        return float(legs + self.crown - hips) / STATURE

    @cached_property
    def crown(self) -> float:
        """Height of the top of the head, in the frame [m]; hands may be higher."""
        if HEAD in self.skeleton.lacks:
            return float(self.skeleton.curves[HEAD][-1] @ self.frame[1])
        return self._top

    @cached_property
    def _top(self) -> float:
        """Height of the top of the body itself, in the frame, but for its arms [m]."""
        arm = np.isin(self.skeleton.limb, (RIGHT_ARM, LEFT_ARM))
        return float(self.upright[~arm, 1].max())

    @cached_property
    def floor(self) -> float:
        """Height that the feet of the body stand on, or would, in the frame [m]."""
        return self.crown - self.stature

    def limb(self, *numbers: int) -> tuple[Points, NDArray[np.int64]]:
        """The part of the mesh that belongs to these limbs: points [m] and triangles."""
        return part_of(self.body.points, self.body.triangles, np.isin(self.skeleton.limb, numbers))

    @cached_property
    def neck_level(self) -> Level | None:
        """The narrowest section between shoulders and chin."""
        heights = self.floor + self.stature * np.arange(NECKS[0], NECKS[1], NECK_STEP)
        levels = [trunk_level(self.trunk, float(height), self.middle) for height in heights]
        return min((level for level in levels if level is not None), key=lambda level: level.girth, default=None)

    @cached_property
    def neck(self) -> Tape | None:
        """The shortest tape round the neck."""
        return shortest([self._neck_at_level, self._neck_on_head])

    @property
    def _neck_at_level(self) -> Tape | None:
        """That round the narrowest level section."""
        level = self.neck_level
        if level is None:
            return None
        x, z = level.section.ends[level.section.part == level.trunk].mean(axis=(0, 1))
        return self._tape_round_neck(np.array([x, level.height, z]) @ self.frame, self.frame[1])

    @property
    def _neck_on_head(self) -> Tape | None:
        """That round the neck of a head that leans much, whose level sections may cut a shoulder; None: it does not."""
        curve, joint = self.skeleton.curves[HEAD], self.skeleton.joints[HEAD]
        along = curve[min(joint + NECK_STEPS, len(curve) - 1)] - curve[max(joint - NECK_STEPS, 0)]
        along /= np.linalg.norm(along)
        leans = float(along @ self.frame[1]) < np.cos(np.radians(HEAD_LEANS))
        return self._tape_round_neck(self.skeleton.spine[-1], along) if leans else None

    def _tape_round_neck(self, middle: Points, up: Points) -> Tape | None:
        """The shortest tape round a neck that has this middle [m] and direction."""
        near = row_lengths(self.body.points - middle) < NECK_AROUND * self.stature
        points, corners = part_of(self.body.points, self.trunk.triangles, near)
        forward = np.cross(self.frame[0], up)
        alongs = [np.cos(tilt) * up + np.sin(tilt) * forward for tilt in NECK_TILTS]
        shifts = self.stature * NECK_SHIFTS
        tapes = (tape_round(points, corners, middle + shift * up, along) for along in alongs for shift in shifts)
        # one through the lid of a neck that is cut is too short
        below, vertical = self._top - RIM * self.stature, self.frame[1]
        return shortest(tape for tape in tapes if tape is not None and float((tape.line @ vertical).max()) < below)

    @cached_property
    def levels(self) -> dict[str, Level]:
        """Levels of the trunk by name."""
        found = {level.name: level for level in trunk_levels(self.level_at, self._heights, self._arms_join)}
        if self._lacks_armpits:
            found.pop("chest", None)
        elif self._join_low:
            crotch, _ = self.trunk_ends
            heights = self._heights.on_trunk(crotch, crotch + (self._arms_join - crotch) / ARMPIT)
            lower = trunk_levels(self.level_at, heights, self._arms_join)
            found.update((level.name, level) for level in lower if level.name == "chest")
        if "chest" in found and "waist" in found:
            below = under_bust_level(self.level_at, found["chest"], found["waist"])
            if below is not None:
                found["under_bust"] = below
        return found

    def _without_arms(self, height: float) -> Level | None:
        """The level of the trunk, or of the head, at a height in the frame, without arms."""
        return trunk_level(self.trunk, height, self.middle)

    @cached_property
    def trunk_ends(self) -> tuple[float, float]:
        """Heights of the crotch and of the roots of the arms, if they hung, in the frame [m]."""
        at = self._without_arms
        return trunk_ends(self.skeleton, self.stance, at, self.frame[1], self.floor, self.stature, self.crotch)

    @cached_property
    def _heights(self) -> Heights:
        """Where each level is searched for, in the frame."""
        heights = Heights.of_stature(self.floor, self.stature).on_trunk(*self.trunk_ends)
        end, step = float(self.upright[:, 1].min()) + RIM * self.stature, float(heights.hip[1] - heights.hip[0])
        if not self._lacks_feet or self.trunk_ends[0] > end:
            return heights
        # a trunk that ends above its legs may have its widest hips where it ends
        return replace(heights, hip=np.concatenate([np.arange(end, heights.hip[0], step), heights.hip]))

    @cached_property
    def _arms_join(self) -> float:
        """Height in the frame from which arms are part of the trunk's section [m]; infinite: above the chest."""
        crotch, roots = self.trunk_ends
        lower = np.arange(LOWEST_ARMPIT, CHEST_OF_TRUNK[0], CHEST_OF_TRUNK[2]) if self._arms_apart else np.zeros(0)
        heights = np.concatenate([crotch + lower * (roots - crotch), self._heights.chest])
        joined = (float(height) for height in heights if self._joined(float(height)))
        return next(joined, np.inf)

    @property
    def _lacks_armpits(self) -> bool:
        """Whether arms are part of the trunk's section so low that where they leave it cannot be known."""
        shown = self._arms_apart and self._arms_near
        return self._joins_below(LOWEST_ARMPIT + CHEST_OF_TRUNK[2] if shown else ARMPITS)

    @property
    def _arms_apart(self) -> bool:
        """Whether both upper arms lead away from the trunk."""
        return all(-float(arm.upper @ self.frame[1]) < np.cos(np.radians(APART)) for arm in self.stance.arms)

    @cached_property
    def _arms_near(self) -> bool:
        """Whether both arms are near the trunk one step below where they join it."""
        crotch, roots = self.trunk_ends
        level = trunk_level(self.whole, self._arms_join - CHEST_OF_TRUNK[2] * (roots - crotch), self.middle)
        if level is None:
            return False
        parts = [ends[..., 0] for ends in level.section.parts()]  # to the left [m]
        trunk = parts.pop(level.trunk)

        def gap(side: float) -> float:
            beyond = [side * part - (side * trunk).max() for part in parts]
            return min((part.min() / np.ptp(part) for part in beyond if part.min() > 0.0), default=np.inf)

        return max(gap(-1.0), gap(1.0)) < NEAR_TRUNK

    @property
    def _join_low(self) -> bool:
        """Whether arms join the trunk lower than by the estimate of their roots."""
        return self._joins_below(ARMPITS)

    def _joins_below(self, share: float) -> bool:
        crotch, roots = self.trunk_ends
        return self._arms_join < crotch + share * (roots - crotch)

    @property
    def shows_hip(self) -> bool:
        """Whether the hips are as those of who stands."""
        return self.legs_along(ASTRIDE)

    def _joined(self, height: float) -> bool:
        """Whether arms are part of the trunk's section at a height in the frame."""
        whole, bare = (trunk_level(mesh, height, self.middle) for mesh in (self.whole, self.trunk))
        return whole is None or bare is None or width(whole) > JOINED * width(bare)

    def level_at(self, height: float) -> Level | None:
        """The trunk's level at a height in the frame: its own section, or one from which joined arms are taken."""
        mesh = self.trunk if self._joined(height) else self.whole
        return trunk_level(mesh, height, self.middle)

    def tape_at(self, level: Level) -> Tape:
        """The tape round the trunk at one of its levels."""
        plane = Plane(self.frame[1] * level.height, self.frame[[0, 2]], self.frame[1])
        return plane.tape(level.section.ends[level.section.part == level.trunk].reshape(-1, 2))

    @cached_property
    def crotch(self) -> float | None:
        """Height in the frame below which the legs are apart [m]; None where they cannot be told apart."""
        curves = [leg.curve @ self.frame.T for leg in self.stance.legs]

        def joined(height: float) -> bool:
            level = trunk_level(self.trunk, height, self.middle)
            if level is None:
                return False
            across = level.section.ends[level.section.part == level.trunk, :, 0]
            centres = [curve[np.argmin(np.abs(curve[:, 1] - height)), 0] for curve in curves]
            return bool(across.min() < min(centres) and across.max() > max(centres))

        low, high = self.floor + 0.36 * self.stature, self.floor + 0.53 * self.stature
        if joined(low) or not joined(high):
            return None
        for _ in range(CROTCH_ROUNDS):
            half = 0.5 * (low + high)
            low, high = (low, half) if joined(half) else (half, high)
        return high

    def legs_along(self, within: float) -> bool:
        """Whether both legs are straight and in line with the trunk, within an angle [degrees]."""
        return all(self.stance.is_along(leg, self.frame[1], within) for leg in self.stance.legs)
