"""How to read a garment that starts on no limb: in another unit, with another axis up, or turned.

A file of another tool may state neither; round the body it shows, by the limbs that pass through the openings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.skeleton import HEAD
from warp_cloth.base.choice import Choice
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.units import METRES_PER, LengthUnit
from warp_cloth.loading import AXIS_UNKNOWN, Placement, from_z_up, was_guessed
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
        found = _scaled_or_stood_up(spec, mesh, wearing) or _turned(wearing)
        if found is not None:
            changes, reason = found
            garments[index] = spec.model_copy(update=changes)
            choices += [Choice(f"{key}.{name}", value, reason) for name, value in changes.items()]
    return (scene.model_copy(update={"garments": tuple(garments)}) if choices else scene), choices


def _is_placed(spec: GarmentSpec) -> bool:
    return any(spec.translate) or any(spec.rotate)


def _scaled_or_stood_up(spec: GarmentSpec, mesh: Mesh, wearing: Wearing) -> Change | None:
    """Another unit or up axis, in which every opening is round its limbs, where none is as it was read."""
    beside = {id(each.opening) for each in wearing.misplaced_at_start}
    pairs = zip(wearing.openings, wearing.limbs, strict=True)
    if any(id(opening) not in beside for opening, limbs in pairs if limbs and limbs != (HEAD,)):
        return None
    may_stand = spec.up is None and spec.mesh is not None and spec.mesh.suffix.lower() in AXIS_UNKNOWN
    readings: list[tuple[dict[str, Value], Points, str]] = []
    if may_stand:
        readings.append(({"up": "z"}, from_z_up(wearing.start), "with y up"))
    if spec.units is None and was_guessed(mesh):
        metres = next(length for unit, length in METRES_PER.items() if unit == mesh.unit)
        for unit in OTHER_UNITS:
            scaled = wearing.start * (METRES_PER[unit] / metres)
            readings.append(({"units": unit}, scaled, f"in {mesh.unit}"))
            if may_stand:
                readings.append(({"units": unit, "up": "z"}, from_z_up(scaled), f"in {mesh.unit}, or with y up,"))
    for changes, points, otherwise in readings:
        if _sits(wearing, points):
            return changes, f"{otherwise} no limb would pass through its openings"
    return None


def _sits(wearing: Wearing, points: Points) -> bool:
    """Whether every opening of the garment at ``points`` [m] is round the limbs that it is for there."""
    there = Wearing.of(wearing.openings, points, wearing.triangles, wearing.skeleton)
    return all(there.limbs) and not there.misplaced_at_start


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
