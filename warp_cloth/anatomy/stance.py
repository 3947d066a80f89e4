"""How a body stands: its vertical, the bones of its limbs, and its pose in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.anatomy.skeleton import LEFT_ARM, LEFT_LEG, LIMBS, RIGHT_ARM, RIGHT_LEG, STEP, Skeleton
from warp_cloth.base.mesh import Points

# Joints as fractions of the span from fingertips or toes, along the skin (measured on bodies of any age and weight).
WRIST, ELBOW = 0.105, 0.20
ANKLE, KNEE = 0.115, 0.275
BEND_WITHIN = 0.05  # of the span: a bent joint lies so near to that fraction
BENT = 0.08  # of a limb's length, between a bent joint and the line from its end to its root: 20 degrees
ROUND = 0.02  # of the span, on either side of a joint, that is no bone's middle
STATURE = 1.066  # the legs along the skin with hips to crown, of the stature: 1.05 to 1.08 in people of any age
UPRIGHT = 30.0  # degrees between trunk and vertical of who stands
ASTRIDE = 15.0  # degrees between a leg and vertical that lower the hips by 1.5 cm
# Degrees from the nearest axis at which trunk and legs in line mean that the body lies oblique in its axes: of people
# who stand, the legs together point down to 3 degrees, and the trunk leans by up to 9 against them.
OBLIQUE, IN_LINE = 5.0, 12.0
UPWARDS = 1.25  # times as far along another axis as along y is still y: of who sits on the floor, legs and trunk differ
RAISED, AHEAD = 40.0, 0.5  # degrees below the horizontal, and the part to the front, of a thigh that is raised
ALIKE = 8.0  # degrees between limbs that one phrase describes


@dataclass(frozen=True, eq=False)
class Bones:
    """A limb: its curve from tip to root, its middle joint, and the joint at its thin end."""

    number: int  # of the limb
    curve: Points  # middles of its girths, from the tip to the root [m], shape [N, 3]
    end: int  # point of the curve at the wrist or ankle
    middle: int  # at the elbow or knee
    margin: int  # points on either side of a joint that are no bone's

    @property
    def joint(self) -> Points:
        joint: Points = self.curve[self.middle]
        return joint

    @property
    def upper(self) -> Points:
        """Unit vector along the upper arm or thigh, away from the trunk, shape [3]."""
        return _direction(self.curve, self.middle + self.margin, len(self.curve) - 1)

    @property
    def lower(self) -> Points:
        """Unit vector along the forearm or shank, away from the trunk, shape [3]."""
        return _direction(self.curve, self.end + self.margin // 2, self.middle - self.margin)

    @property
    def bend(self) -> float:
        """Angle between both bones [degrees]; 0 in a straight limb."""
        return _between(self.upper, self.lower)


@dataclass(frozen=True, eq=False)
class Stance:
    """A body's axes in the world, and its limbs."""

    vertical: Points  # unit vectors, shape [3]
    forward: Points
    left: Points
    arms: tuple[Bones, Bones]  # right, left
    legs: tuple[Bones, Bones]
    trunk_lean: float  # between trunk and vertical [degrees]
    lacks: tuple[int, ...] = ()  # limbs that are not there, or end early

    @property
    def stands(self) -> bool:
        """Whether the trunk and one leg at least are upright."""
        return self.trunk_lean <= UPRIGHT and any(self.is_along(leg, self.vertical, ASTRIDE) for leg in self.legs)

    def is_along(self, leg: Bones, up: Points, within: float) -> bool:
        """Whether both bones of a leg point down, against ``up``, within an angle [degrees]."""
        return all(_between(-bone, up) <= within for bone in (leg.upper, leg.lower))

    def below_horizontal(self, direction: Points) -> float:
        """Angle of a unit vector below the horizontal [degrees]; 90 points down."""
        return 90.0 - _between(-direction, self.vertical)

    def in_words(self) -> str:
        """The pose: "stands; arms 45 degrees below the horizontal"."""
        return "; ".join(
            [self._trunk_in_words(), *self._arms_in_words(), *self._legs_in_words(), *self._lacks_in_words()]
        )

    def _lacks_in_words(self) -> list[str]:
        return [f"{', '.join(LIMBS[limb] for limb in self.lacks)} missing or cut short"] if self.lacks else []

    def _trunk_in_words(self) -> str:
        if all(self._raised()) and self.trunk_lean <= 45.0:
            return "sits"
        if self.trunk_lean > UPRIGHT:
            return f"trunk leans by {self.trunk_lean:.0f} degrees"
        return "stands"

    def _arms_in_words(self) -> list[str]:
        arms = [arm for arm in self.arms if arm.number not in self.lacks]
        angles = [self.below_horizontal(arm.upper) for arm in arms]
        ahead = [self._ahead(arm.upper) for arm in arms]
        bends = [arm.bend for arm in arms]
        phrases = [_arm_phrase(angle, forward, bend) for angle, forward, bend in zip(angles, ahead, bends, strict=True)]
        if (
            len(arms) == 2
            and abs(angles[0] - angles[1]) <= ALIKE
            and ahead[0] == ahead[1]
            and abs(bends[0] - bends[1]) <= 2 * ALIKE
        ):
            return [f"arms {_arm_phrase(*np.mean([angles, ahead, bends], axis=1).tolist())}"]
        return [f"{LIMBS[arm.number]} {phrase}" for arm, phrase in zip(arms, phrases, strict=True)]

    def _ahead(self, direction: Points) -> float:
        """1: an arm points forward, -1: back, 0: to the side or down."""
        along = float(direction @ self.forward)
        return float(np.sign(along)) if abs(along) > 0.5 else 0.0

    def _raised(self) -> list[bool]:
        """Whether each thigh is raised to the front, as of who sits or steps up; to the side legs are only apart."""
        return [
            self.below_horizontal(leg.upper) < RAISED and bool(leg.upper @ self.forward > AHEAD) for leg in self.legs
        ]

    def _legs_in_words(self) -> list[str]:
        said = []
        raised = self._raised()
        for leg, up in zip(self.legs, raised, strict=True):
            if leg.number in self.lacks:
                continue
            side = "right" if leg.number == RIGHT_LEG else "left"
            if up and not all(raised):
                said.append(f"{side} knee up")
            elif leg.bend > 30.0 and not all(raised):
                said.append(f"{side} knee bent by {leg.bend:.0f} degrees")
        apart = _between(self.legs[0].upper, self.legs[1].upper)
        if not any(raised) and apart > 25.0 and not {RIGHT_LEG, LEFT_LEG} & set(self.lacks):
            said.append(f"legs {apart:.0f} degrees apart")
        return said


def stance_of(skeleton: Skeleton) -> Stance:
    """The stance of a body.

    Vertical is the world axis that trunk and legs are nearest to, y where two are nearly as near, or along the legs
    where both are far from all.
    """
    arms = _bones(skeleton, RIGHT_ARM, WRIST, ELBOW), _bones(skeleton, LEFT_ARM, WRIST, ELBOW)
    both_legs = _bones(skeleton, RIGHT_LEG, ANKLE, KNEE), _bones(skeleton, LEFT_LEG, ANKLE, KNEE)
    down = [bone for leg in both_legs for bone in (leg.upper, leg.lower)]
    upwards = 2.0 * skeleton.up - 0.5 * np.sum(down, axis=0)
    axis = int(np.argmax(np.abs(upwards) * [1.0, UPWARDS, 1.0]))
    vertical = np.zeros(3)
    vertical[axis] = np.sign(upwards[axis])
    legs = -np.sum(down, axis=0)
    legs /= max(float(np.linalg.norm(legs)), 1e-12)
    off = min(_between(skeleton.up, vertical), _between(legs, vertical))
    if off > OBLIQUE and _between(skeleton.up, legs) < IN_LINE:
        vertical = legs
    forward = skeleton.forward - vertical * (skeleton.forward @ vertical)
    if np.linalg.norm(forward) < 0.5:  # lies on a slope, or bends over
        forward = np.cross(skeleton.left, vertical)
    forward /= np.linalg.norm(forward)
    left = np.cross(vertical, forward)
    return Stance(vertical, forward, left, arms, both_legs, _between(skeleton.up, vertical), skeleton.lacks)


def _bones(skeleton: Skeleton, limb: int, end: float, middle: float) -> Bones:
    """The bones of a limb, whose joints lie at these fractions of the span from its tip, or where it is bent."""
    curve = skeleton.curves[limb][skeleton.joints[limb] :][::-1]
    first = min(round(end / STEP), len(curve) - 3)
    expected = min(round(middle / STEP), len(curve) - 2)
    chord = curve[-1] - curve[first]
    length = float(np.linalg.norm(chord))
    off = curve - curve[first]
    off = np.linalg.norm(off - np.outer(off @ chord, chord) / length**2, axis=1)
    low = max(round((middle - BEND_WITHIN) / STEP), first + 1)
    high = min(round((middle + BEND_WITHIN) / STEP), len(curve) - 2)
    sharpest = low + int(np.argmax(off[low : high + 1])) if low < high else expected
    joint = sharpest if off[sharpest] > BENT * length else expected
    return Bones(limb, curve, first, joint, round(ROUND / STEP))


def _direction(curve: Points, first: int, last: int) -> Points:
    """Unit vector against the run of a curve between two of its points, moved apart where too near, shape [3]."""
    first = min(first, len(curve) - 3)
    along = curve[first] - curve[max(last, first + 2)]
    length = float(np.linalg.norm(along))
    return np.asarray(along / length if length > 0.0 else along, dtype=np.float64)


def _between(a: Points, b: Points) -> float:
    """Angle between two unit vectors [degrees]."""
    return float(np.degrees(np.arccos(np.clip(a @ b, -1.0, 1.0))))


def _arm_phrase(angle: float, ahead: float, bend: float) -> str:
    if abs(angle) < 5.0:
        where = "horizontal"
    else:
        where = f"{abs(angle):.0f} degrees {'below' if angle > 0.0 else 'above'} the horizontal"
    forward = ", forward" if ahead > 0.0 else ", back" if ahead < 0.0 else ""
    elbow = f", elbow bent by {bend:.0f} degrees" if bend > 25.0 else ""
    return ("hanging" if angle > 65.0 else where) + forward + elbow
