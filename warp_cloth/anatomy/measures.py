"""A tailor's measures of a body, read off its mesh; terms after ISO 8559-1.

A girth is the length of a tape: of the convex hull of the section, since a tape spans hollows. It lies square to the
vertical round a trunk that stands, and to the bone round a limb, so that a body may be measured in any pose.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warp_cloth.anatomy.figure import Figure
from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.anatomy.skeleton import HEAD, STEP, TRUNK, Skeleton
from warp_cloth.anatomy.stance import ASTRIDE, UPRIGHT, Bones
from warp_cloth.anatomy.tape import Plane, Tape, longest, shortest, tape_round
from warp_cloth.base.curves import arc_lengths, curve_point
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.section import convex_hull, first_crossing

# Where a girth is looked for, as fractions of the span from the fingertips or toes.
WRISTS, ANKLES, CALVES = (0.09, 0.125), (0.12, 0.16), (0.17, 0.26)
UPPER_ARM = 0.255
NAPE_BELOW = 0.013  # of the stature, below the back of the neck's tape: where the neck begins, at the 7th vertebra
THIGH_BELOW = 0.012  # of the stature, below the crotch: the tape goes round one leg there
SHOULDER_INWARDS = 0.012  # of the stature, from the root of the arm to the shoulder point
SHOULDER_DEPTH = 0.024  # of the stature, from the shoulder point down to the joint: a hanging arm begins above it
HANGING = (45.0, 75.0)  # degrees below the horizontal; the root of an arm that hangs is nearer to the neck
SHOULDER_AROUND = 0.015  # of the stature, on either side of it
# Of the stature, above the root of the arm: 0.03 to 0.1 in people. Above may be the head, of one who leans to the side.
SHOULDER_ABOVE = 0.13
RAISED = 20.0  # degrees above the horizontal: the arm lies on the shoulder


@dataclass(frozen=True, eq=False)
class Measure:
    """A measure: its value, or why there is none."""

    name: str  # a key of DEFINITIONS
    value: float | None  # [m]
    line: Points  # along the body [m], shape [N, 3]; empty without a value
    reason: str = ""  # why there is no value


# Name: the term and definition of ISO 8559-1 in short, and how it is read off a mesh.
DEFINITIONS: dict[str, str] = {
    "stature": "crown to floor, upright",
    "neck": "smallest girth of the neck, square to it",
    "chest": "bust or chest girth: the largest level girth below the armpits, over the bust points",
    "under_bust": "level girth just below the breasts",
    "waist": "natural waist: the smallest level girth between ribs and hip bones",
    "hip": "the largest level girth over the buttocks",
    "thigh": "girth of the leg just below the crotch, square to the thigh",
    "knee": "girth over the middle of the knee, square to the leg",
    "calf": "largest girth of the lower leg, square to it",
    "ankle": "smallest girth of the lower leg above the ankle bones, square to it",
    "upper_arm": "girth midway between shoulder and elbow, square to the arm",
    "elbow": "girth over the elbow, square to the arm",
    "wrist": "smallest girth above the hand, square to the forearm",
    "shoulder_width": "between the shoulder points, straight",
    "arm_length": "shoulder point over elbow to wrist, as of an arm that hangs",
    "back_length": "nape (7th neck vertebra) to waist along the back",
    "inside_leg_length": "crotch to floor, upright",
}


def measures_of(body: Mesh, skeleton: Skeleton) -> tuple[Measure, ...]:
    """All measures of DEFINITIONS, in its order; of limbs the right one."""
    return _Tailor.of(body, skeleton).measures()


class _Tailor(Figure):
    """Reads a tailor's measures off a figure."""

    def measures(self) -> tuple[Measure, ...]:
        found = {
            "stature": self._stature(),
            "neck": _taped("neck", self.neck, "the neck cannot be told from the head"),
            **self._trunk(),
            **self._leg(self._measured(self.stance.legs)),
            **self._arm(self._measured(self.stance.arms)),
            "shoulder_width": self._shoulder_width(),
            "arm_length": self._arm_length(),
            "back_length": self._back_length(),
            "inside_leg_length": self._inside_leg(),
        }
        return tuple(found[name] for name in DEFINITIONS)

    def _measured(self, pair: tuple[Bones, Bones]) -> Bones:
        """The right limb, or the left one where only that is whole."""
        right, left = pair
        return left if right.number in self.skeleton.lacks and left.number not in self.skeleton.lacks else right

    def _trunk(self) -> dict[str, Measure]:
        found: dict[str, Measure] = {}
        for name in ("chest", "under_bust", "waist", "hip"):
            level = self.levels.get(name)
            if name == "hip" and not self.shows_hip:
                found[name] = _missing(name, "the hips are bent, or the legs apart")
            elif self._lacks_armpits and name in ("chest", "under_bust"):
                found[name] = _missing(name, "the arms are grown together with the trunk where it is to be")
            elif level is None:
                found[name] = _missing(name, f"no section of the trunk is its {name.replace('_', ' ')}")
            else:
                found[name] = _taped(name, self.tape_at(level), "")
        return found

    def _leg(self, leg: Bones) -> dict[str, Measure]:
        shin = self.limb(leg.number)

        def round_at(point: float, normal: Points) -> Tape | None:
            return tape_round(*shin, curve_point(leg.curve, point), normal)

        knee = round_at(leg.middle, leg.upper + leg.lower) if leg.bend < 60.0 else None
        reason = "the knee is bent by more than 60 degrees" if leg.bend >= 60.0 else "the leg is not closed there"
        return {
            "thigh": self._thigh(leg),
            "knee": _taped("knee", knee, reason),
            "calf": _taped("calf", longest(round_at(at, leg.lower) for at in _points(CALVES)), "no lower leg is there"),
            "ankle": _taped("ankle", shortest(round_at(at, leg.lower) for at in _points(ANKLES)), "no ankle is there"),
        }

    def _thigh(self, leg: Bones) -> Measure:
        if not self.legs_along(UPRIGHT):
            return _missing("thigh", "the hips are bent, so that its highest girth lies in a fold")
        crotch = self.crotch
        if crotch is None:
            return _missing("thigh", "the legs cannot be told apart below the crotch")
        heights = [each.curve @ self.frame[1] for each in self.stance.legs]
        height = crotch - THIGH_BELOW * self.stature
        own, other = (
            each.curve[np.argmin(np.abs(h - height))] for each, h in zip(self.stance.legs, heights, strict=True)
        )
        side = np.stack([0.5 * (own + other), own - other])
        part = self.limb(leg.number, TRUNK)
        tape = tape_round(*part, own, leg.upper, side)
        return _taped("thigh", tape, "the leg is not closed there")

    def _inside_leg(self) -> Measure:
        name = "inside_leg_length"
        if self._lacks_feet:
            return _missing(name, "no leg is whole")
        if not self.stance.stands or not self.legs_along(ASTRIDE):
            return _missing(name, "the legs are not straight and upright")
        if self.crotch is None:
            return _missing(name, "the legs cannot be told apart below the crotch")
        ends = np.array([[self.middle, height, self._depth] for height in (self.crotch, self.floor)])
        return Measure(name, self.crotch - self.floor, ends @ self.frame)

    @property
    def _depth(self) -> float:
        """Middle of the body from back to front, in the frame [m]."""
        return float((self.skeleton.spine @ self.frame[2]).mean())

    def _arm(self, arm: Bones) -> dict[str, Measure]:
        part = self.limb(arm.number)

        def round_at(point: float, normal: Points) -> Tape | None:
            return tape_round(*part, curve_point(arm.curve, point), normal)

        upper = round_at(UPPER_ARM / STEP - 0.5, arm.upper)
        elbow = round_at(arm.middle, arm.upper + arm.lower) if arm.bend < 60.0 else None
        wrist = shortest(round_at(at, arm.lower) for at in _points(WRISTS))
        reason = "the elbow is bent by more than 60 degrees" if arm.bend >= 60.0 else "the arm is not closed there"
        return {
            "upper_arm": _taped("upper_arm", upper, "the arm is not closed there"),
            "elbow": _taped("elbow", elbow, reason),
            "wrist": _taped("wrist", wrist, "no wrist is there"),
        }

    @cached_property
    def _shoulder_frame(self) -> Points:
        """The frame with its up turned to the side as the trunk leans, shape [3, 3]: the head leans with it."""
        _, _, forward = self.frame
        up = self.skeleton.up - forward * (self.skeleton.up @ forward)
        up /= np.linalg.norm(up)
        return np.stack([np.cross(up, forward), up, forward])

    def _shoulder_point(self, arm: Bones) -> Points | None:
        """The shoulder point [m]: on top of the shoulder, a little nearer to the neck than the root of the arm."""
        angle = self.stance.below_horizontal(arm.upper)
        if angle < -RAISED or (angle < 45.0 and arm.upper @ self.frame[2] > 0.5):
            return None
        frame = self._shoulder_frame
        skin, (x, y, z) = self.body.points @ frame.T, arm.curve[-1] @ frame.T
        inwards = SHOULDER_INWARDS * np.interp(angle, HANGING, (1.0, 0.0)) * self.stature
        x -= np.sign(x - self.skeleton.shoulders @ frame[0]) * inwards
        near = (np.abs(skin[:, [0, 2]] - [x, z]) < SHOULDER_AROUND * self.stature).all(axis=1)
        near &= (self.skeleton.limb != HEAD) & (skin[:, 1] < y + SHOULDER_ABOVE * self.stature)
        if not near.any():
            return None
        return np.array([x, skin[near, 1].max(), z]) @ frame

    def _shoulder_width(self) -> Measure:
        points = [self._shoulder_point(arm) for arm in self.stance.arms]
        ends = [point for point in points if point is not None]
        if len(ends) < 2:
            return _missing("shoulder_width", "an arm is raised, or forward")
        return Measure("shoulder_width", float(np.linalg.norm(ends[1] - ends[0])), np.stack(ends))

    def _arm_length(self) -> Measure:
        arm = self._measured(self.stance.arms)
        shoulder = self._shoulder_point(arm)
        if arm.number in self.skeleton.lacks:
            return _missing("arm_length", "no arm is whole")
        if shoulder is None:
            return _missing("arm_length", "the arm is raised, or forward")
        inside = shoulder - self.frame[1] * SHOULDER_DEPTH * self.stature  # about which the arm turns
        line = np.stack([shoulder, inside, arm.joint, arm.curve[arm.end]])
        return Measure("arm_length", float(arc_lengths(line)[-1]), line)

    def _back_length(self) -> Measure:
        name = "back_length"
        waist = self.levels.get("waist")
        if self.neck is None or waist is None:
            return _missing(name, f"no {'waist' if waist is None else 'neck'} is there")
        tape = self.neck.line @ self.frame.T
        nape = float(tape[np.argmin(tape[:, 2]), 1]) - NAPE_BELOW * self.stature
        plane = Plane(self.frame[0] * self.middle, self.frame[[2, 1]], self.frame[0])
        section = plane.section(self.body.points, self.body.triangles)
        ends = [first_crossing(section.ends, at) for at in (waist.height, nape)]
        spots = section.ends.reshape(-1, 2)
        spots = spots[(spots[:, 1] >= waist.height) & (spots[:, 1] <= nape)]
        if any(end is None for end in ends):
            return _missing(name, "the back is not closed there")
        behind = np.array([[end, at] for end, at in zip(ends, (waist.height, nape), strict=True)])
        ahead = behind + np.array([1.0, 0.0])  # so that the hull's lower side is the back
        hull = np.array(convex_hull(np.vstack([spots, behind, ahead])))
        back = hull[hull[:, 0] < behind[:, 0].max() + 0.5]
        back = back[np.argsort(back[:, 1], kind="stable")]
        return Measure(name, float(arc_lengths(back)[-1]), plane.in_space(back))

    def _stature(self) -> Measure:
        if self._lacks_head or self._lacks_feet:
            return _missing("stature", "the head or both feet are missing")
        if not self.stance.stands:
            return _missing("stature", "the body does not stand upright")
        ends = np.array([[self.middle, height, self._depth] for height in (self.crown, self.floor)])
        return Measure("stature", self.stature, ends @ self.frame)


def _points(within: tuple[float, float]) -> Floats:
    """Numbers of a limb's points between two fractions of the span from its tip, in half steps."""
    return np.arange(within[0] / STEP - 0.5, within[1] / STEP, 0.5)


def _taped(name: str, tape: Tape | None, reason: str) -> Measure:
    return _missing(name, reason) if tape is None else Measure(name, tape.length, tape.line)


def _missing(name: str, reason: str) -> Measure:
    return Measure(name, None, np.zeros((0, 3)), reason)
