"""How to read a garment that starts on no limb, or a body beside it: in another unit, another axis up, or turned.

A file of another tool may state neither; round the body it shows, by the limbs that pass through the openings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.base.choice import Choice
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.units import METRES_PER, LengthUnit
from warp_cloth.loading import AXIS_UNKNOWN, Placement, fitting_reading, from_z_up, was_guessed
from warp_cloth.scene import GarmentSpec, Scene

Value = str | tuple[float, float, float]
Change = tuple[dict[str, Value], str]  # keys of a garment, and why

OTHER_UNITS: tuple[LengthUnit, ...] = ("in",)  # that are never guessed from the size alone
ALIKE, LEVEL = (
    0.8,
    0.05,
)  # ratio of girths, and difference of heights over the body's span, of a left and a right opening
APART = 0.12  # of the body's span; that far they are from each other at least
TURNED = 45.0  # [degrees] from the body's left, beyond which a garment is turned
SQUARE, QUARTER = 5.0, 90.0  # [degrees]; so near to a quarter turn, it is one
NEARER = 0.5  # times as far from the limbs, another reading is the right one
BESIDE = 0.1  # [m] from the body's middle, from where on a garment may be beside it
DEEP_NECK = 0.02  # [m]; a neckline that is lower on one side by more is lower in front


def read_again(scene: Scene, meshes: Sequence[Mesh], worn: Sequence[Wearing | None]) -> tuple[Scene, list[Choice]]:
    """The scene with one thing read otherwise of garments that start badly, and what that is; else the same scene.

    What a garment's author states stays.
    """
    garments, choices = list(scene.garments), []
    for index, (spec, key, mesh, wearing) in enumerate(
        zip(scene.garments, scene.garment_keys, meshes, worn, strict=True)
    ):
        if spec.mesh is None or wearing is None or not wearing.start_fault or _is_placed(spec):
            continue
        found = _scaled_or_stood_up(spec, mesh, wearing) or _turned(wearing) or _moved(wearing)
        if found is not None:
            changes, reason = found
            garments[index] = spec.model_copy(update=changes)
            choices += [Choice(f"{key}.{name}", value, reason) for name, value in changes.items()]
    return (scene.model_copy(update={"garments": tuple(garments)}) if choices else scene), choices


def read_body_again(
    scene: Scene, garments: Sequence[tuple[str, Mesh]], avatar: Mesh | None
) -> tuple[Scene, list[Choice]]:
    """The scene with the body in another unit, and standing up, where only so it fits the first garment, and why.

    Else the same scene. What its author states stays.
    """
    spec = scene.avatar
    if spec is None or avatar is None or not was_guessed(avatar) or spec.up is not None:
        return scene, []
    key, garment = garments[0]
    reading = fitting_reading(key, garment, avatar)
    if not reading or not all(name.startswith("avatar.") for name in reading):
        return scene, []
    reason = f"in {avatar.unit}, with y up, it would lie beside the garment"
    changes = {name.removeprefix("avatar."): value for name, value in reading.items()}
    choices = [Choice(name, value, reason) for name, value in reading.items()]
    return scene.model_copy(update={"avatar": spec.model_copy(update=changes)}), choices


def _is_placed(spec: GarmentSpec) -> bool:
    return any(spec.translate) or any(spec.rotate)


def _scaled_or_stood_up(spec: GarmentSpec, mesh: Mesh, wearing: Wearing) -> Change | None:
    """Another unit or up axis, in which openings are round their limbs, or near them, that are not as it was read."""
    may_stand = spec.up is None and spec.mesh is not None and spec.mesh.suffix.lower() in AXIS_UNKNOWN
    readings: list[tuple[dict[str, Value], Points, str]] = []
    if may_stand:
        stood = from_z_up(wearing.start)
        if _off_limbs(wearing, stood) < NEARER * _off_limbs(wearing, wearing.start):
            return {"up": "z"}, "with y up its openings would be far from the limbs"
        readings.append(({"up": "z"}, stood, "with y up"))
    if spec.units is None and was_guessed(mesh):
        metres = next(length for unit, length in METRES_PER.items() if unit == mesh.unit)
        for unit in OTHER_UNITS:
            scaled = wearing.start * (METRES_PER[unit] / metres)
            readings.append(({"units": unit}, scaled, f"in {mesh.unit}"))
            if may_stand:
                readings.append(({"units": unit, "up": "z"}, from_z_up(scaled), f"in {mesh.unit}, or with y up,"))
    now, wrong = _wrong_share(wearing, wearing.start), [_wrong_share(wearing, points) for _, points, _ in readings]
    if not now > 0.5 or not min(wrong, default=1.0) <= 0.5 * now:
        return None
    changes, _, otherwise = readings[wrong.index(min(wrong))]
    return changes, f"{otherwise} few limbs would pass through its openings"


def _wrong_share(wearing: Wearing, points: Points) -> float:
    """The part of the openings of the garment at ``points`` [m] that are not round the limbs that they are for there.

    1 where an opening is for none.
    """
    there = Wearing.of(wearing.openings, points, wearing.triangles, wearing.skeleton)
    return len(there.misplaced_at_start) / len(there.openings) if all(there.limbs) else 1.0


def _off_limbs(wearing: Wearing, points: Points) -> float:
    """How far the openings of the garment at ``points`` [m] are from the limbs that they are for there, on average [m].

    Infinite where an opening is for none.
    """
    there, skeleton = Wearing.of(wearing.openings, points, wearing.triangles, wearing.skeleton), wearing.skeleton
    if not all(there.limbs):
        return np.inf
    middles = [points[opening.loop].mean(axis=0) for opening in there.openings]
    curves = [np.concatenate([skeleton.curves[limb] for limb in limbs]) for limbs in there.limbs]
    pairs = zip(middles, curves, strict=True)
    return float(np.mean([np.linalg.norm(curve - middle, axis=1).min() for middle, curve in pairs]))


def _turned(wearing: Wearing) -> Change | None:
    """The turn about the body that brings a left and a right opening to its left and right; None: they are there."""
    skeleton = wearing.skeleton
    across = _sideways(wearing)
    if across is None:
        return None
    degrees = _angle_about_y(across, skeleton.left)
    degrees -= 180.0 * round(degrees / 180.0)  # left and right look alike
    if abs(degrees) < TURNED:
        return None
    if abs(abs(degrees) - QUARTER) < SQUARE:
        degrees = float(np.copysign(QUARTER, degrees))
    front = _front(wearing)
    if front is not None and _about_y(degrees).moved(front) @ skeleton.forward < 0.0:
        degrees -= float(np.copysign(180.0, degrees))
    middle = skeleton.middle * [1.0, 0.0, 1.0]
    x, y, z = (middle - _about_y(degrees).moved(middle)).tolist()
    turn = replace(_about_y(degrees), translate=(x, y, z))
    there = Wearing.of(wearing.openings, turn.moved(wearing.start), wearing.triangles, skeleton)
    if len(there.misplaced_at_start) >= len(wearing.misplaced_at_start):
        return None
    changes: dict[str, Value] = {"rotate": turn.rotate, "translate": turn.translate}
    return changes, "its openings for left and right lie before and behind the body"


def _moved(wearing: Wearing) -> Change | None:
    """The move onto the body of a garment that starts beside it and could be sewn there; None: it could not."""
    for shift in (wearing.shift, wearing.across):
        there = Wearing.of(wearing.openings, wearing.start + shift, wearing.triangles, wearing.skeleton)
        if float(np.linalg.norm(shift)) > BESIDE and not there.start_fault:
            x, y, z = shift.tolist()
            return {"translate": (x, y, z)}, "it starts beside the body"
    return None


def _sideways(wearing: Wearing) -> Points | None:
    """From one to the other of two openings that seem a left and a right one [m]; None: there are none."""
    skeleton, span = wearing.skeleton, wearing.skeleton.span
    best = None
    for a, b in combinations(wearing.openings, 2):
        between = wearing.start[b.loop].mean(axis=0) - wearing.start[a.loop].mean(axis=0)
        height = float(between @ skeleton.up)
        flat = between - height * skeleton.up
        alike = min(a.girth, b.girth) > ALIKE * max(a.girth, b.girth) and abs(height) < LEVEL * span
        if alike and np.linalg.norm(flat) > max(APART * span, 0.0 if best is None else float(np.linalg.norm(best))):
            best = flat
    return best


def _front(wearing: Wearing) -> Points | None:
    """The horizontal direction in which the highest opening is lowest, as necklines are in front; None: it is level."""
    skeleton = wearing.skeleton
    loops = [wearing.start[opening.loop] for opening in wearing.openings]
    neck = max(loops, key=lambda loop: float((loop @ skeleton.up).mean()))
    height = neck @ skeleton.up
    if np.ptp(height) < DEEP_NECK:
        return None
    towards = neck[height < np.quantile(height, 0.25)].mean(axis=0) - neck.mean(axis=0)
    front: Points = towards - skeleton.up * (towards @ skeleton.up)
    return front


def _about_y(degrees: float) -> Placement:
    return Placement(rotate=(0.0, degrees, 0.0))


def _angle_about_y(before: Points, after: Points) -> float:
    """The angle about the y axis from one horizontal direction to another [degrees]."""
    return float(np.degrees(np.arctan2(after[0], after[2]) - np.arctan2(before[0], before[2])))
