"""The parts of a body that pieces are laid round: trunk, neck, arms and legs, from its skeleton."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.anatomy.raising import raised_limb
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM, LEFT_LEG, RIGHT_ARM, RIGHT_LEG, TRUNK, Skeleton, skeleton_of
from warp_cloth.base.curves import arc_lengths
from warp_cloth.base.mesh import Mesh
from warp_cloth.pattern.curve import Floats

CLEAR = 0.03  # [m] between the trunk and cloth laid round it
UP = np.array([0.0, 1.0, 0.0])
HAND, ANKLE = 0.11, 0.055  # of the span: length of a hand, height of an ankle above the sole
NARROW = 0.05  # of the span: how far from the middle the crotch is looked for
SHOULDER = (0.05, 0.07)  # of the span: how far from the middle shoulders are next to the neck
ARMPIT = 0.7  # of the way from the waist up to where arms leave the trunk
ABOVE_SHOULDER = 0.05  # [m] from there to where the top of a front or back starts; armholes then lie round the arms


@dataclass(frozen=True, eq=False)
class Figure:
    """Where a standing person's parts are [m]; limbs from where they leave the trunk, right before left."""

    left: Floats  # the wearer's, a level unit vector, shape [3]
    forward: Floats
    middle: Floats  # of the trunk at the waist, shape [3]
    neck: Floats  # the middle of the neck where necklines start, shape [3]
    crotch: float  # its height
    front: float  # from the trunk's middle to where cloth in front of it lies
    back: float
    half_width: float  # from the middle to where cloth beside the hips lies
    arms: tuple[Floats, Floats]  # shape [N, 3] each; raised clear of the trunk where they hang
    legs: tuple[Floats, Floats]
    half_head: float
    to_wrist: float  # along an arm
    ankle: float  # a height
    is_nominal: bool = False  # a person of 1.70 m, as no body is known

    def across(self, x: float) -> Floats:
        return self.left * x

    @property
    def armpit(self) -> float:
        """Its height, on the usual way from the waist to where arms leave the trunk."""
        waist = float(self.middle[1])
        return waist + ARMPIT * (float(min(arm[0, 1] for arm in self.arms)) - waist)

    def at_height(self, y: float) -> Floats:
        """The trunk's middle at a height."""
        return np.array([self.middle[0], y, self.middle[2]])


def figure_of(body: Mesh | None) -> Figure:
    """The figure of a body; that of a usual person, standing at the origin, where there is none or it is no person."""
    skeleton = None if body is None else skeleton_of(body)
    if body is None or skeleton is None:
        return _nominal()
    forward = skeleton.forward - UP * (skeleton.forward @ UP)
    length = float(np.linalg.norm(forward))
    forward = forward / length if length > 0.1 else np.array([0.0, 0.0, 1.0])
    left = np.cross(UP, forward)
    middle = skeleton.middle
    trunk = body.points[skeleton.limb == TRUNK]
    depth = (trunk - middle) @ forward
    slim = trunk[np.abs((trunk - middle) @ left) < NARROW * skeleton.span]
    low = trunk[trunk[:, 1] < middle[1]]
    head = body.points[skeleton.limb == HEAD]
    neck = _neckline(skeleton, body.points, middle, left)
    curves = list(skeleton.curves)
    for arm in (RIGHT_ARM, LEFT_ARM):  # cloth before and behind the trunk would lie across arms that hang
        raised = raised_limb(skeleton, arm)
        curves[arm] = curves[arm] if raised is None else raised
    limbs = [curves[n][skeleton.joints[n] :] for n in (RIGHT_ARM, LEFT_ARM, RIGHT_LEG, LEFT_LEG)]
    return Figure(
        left,
        forward,
        middle,
        neck,
        float(slim[:, 1].min() if len(slim) else skeleton.spine[0][1]),
        float(depth.max()) + CLEAR,
        float(-depth.min()) + CLEAR,
        float(np.abs((low - middle) @ left).max(initial=0.0)) + CLEAR,
        (limbs[0], limbs[1]),
        (limbs[2], limbs[3]),
        float(np.abs((head - neck) @ left).max()) if len(head) else 0.08,
        min(float(arc_lengths(arm)[-1]) for arm in limbs[:2]) - HAND * skeleton.span,
        float(skeleton.extremes[:, 1].min()) + ANKLE * skeleton.span,
    )


def _neckline(skeleton: Skeleton, points: Floats, middle: Floats, left: Floats) -> Floats:
    """Where the neck is narrowest, or lower where that is high above the shoulders, shape [3]."""
    neck = skeleton.curves[HEAD][skeleton.joints[HEAD]].copy()
    aside = np.abs((points - middle) @ left) / skeleton.span
    low, high = SHOULDER
    shoulders = points[(skeleton.limb != HEAD) & (low < aside) & (aside < high), 1]
    neck[1] = min(neck[1], float(shoulders.max(initial=middle[1])) + ABOVE_SHOULDER)
    return np.asarray(neck)


def _nominal() -> Figure:
    side = np.array([-1.0, 1.0, 1.0])
    arm = np.array([[0.19, 1.36, 0.0], [0.34, 1.13, 0.0], [0.5, 0.86, 0.05]])
    leg = np.array([[0.09, 0.79, 0.0], [0.11, 0.45, 0.0], [0.12, 0.05, 0.0]])
    return Figure(
        np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.08, 0.0]), np.array([0.0, 1.45, 0.0]),
        0.78, 0.13 + CLEAR, 0.12 + CLEAR, 0.18 + CLEAR, (arm * side, arm), (leg * side, leg), 0.08, 0.5, 0.1, True,
    )  # fmt: skip
