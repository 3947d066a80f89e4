"""How to read a garment that starts on no limb, or a body beside it: in another unit, another axis up, or turned.

A file of another tool may state neither; round the body it shows, by the limbs that pass through the openings, and by
the garment's cut, which tells its front.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import cast

import numpy as np

from warp_cloth.anatomy.geodesics import nearest_points
from warp_cloth.anatomy.linking import SLEEVED, Wearing
from warp_cloth.anatomy.skeleton import LEFT_LEG, RIGHT_LEG, Skeleton
from warp_cloth.base import mesh_formats
from warp_cloth.base.choice import Choice
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.units import METRES_PER, BodyUp, LengthUnit
from warp_cloth.garment.front import CERTAIN, DOUBTFUL, Front, front_of
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.moulded import faces_ahead, within
from warp_cloth.garment.skin import Skin
from warp_cloth.garment.triangles import triangle_areas, triangle_sides
from warp_cloth.loading import (
    Placement,
    fitting_reading,
    is_of_fitting_size,
    is_usual_size,
    lies,
    was_guessed,
    with_y_up,
)
from warp_cloth.scene import AvatarSpec, GarmentSpec, Scene, TshirtShape

Value = str | tuple[float, float, float]
Change = tuple[dict[str, Value], str]  # keys of a garment, and why

OTHER_UNITS: tuple[LengthUnit, ...] = ("in",)  # that are never guessed from the size alone
ALIKE, LEVEL = (
    0.8,
    0.05,
)  # ratio of girths, and difference of heights over the body's span, of a left and a right opening
APART = 0.12  # of the body's span; that far they are from each other at least
# [degrees] from the body's left, beyond which a garment is turned: a body that was scanned at an angle wears a garment
# twisted that is not, by 15 degrees of 20 and by 22 of 34. Hips and shoulders of who walks differ by less.
TURNED = 12.0
SIDEWAYS = 45.0  # from which on it must start better for it
SQUARE, QUARTER = 5.0, 90.0  # [degrees]; so near to a quarter turn, it is one
NEARER = 0.5  # times as far from the limbs, another reading is the right one
# Of the body's span, that openings of what is stood up are from their limbs at most: 20 random designs begin 0.02 to
# 0.05 from them. A sleeveless shirt that is turned by 90 degrees would be 0.49 off.
NEAR_LIMBS = 0.15
# Of its own extent, that half of a glove, sock or hat is from the skin at most: 0.03 to 0.08, and a cape's 0.14. A
# mitten and a shirt that were read in centimetres instead of inches were 0.22 and 0.25 off.
ON_SKIN = 0.1
MOULDED = 10.0  # the cue of where a garment lies on the skin: sure where it tells
HEAD_UP = 0.85  # cosine of 30 degrees, rounded, between an axis and the trunk, or the trunk and the legs
BESIDE = 0.1  # [m] from the body's middle, from where on a garment may be beside it


@dataclass(frozen=True, eq=False)
class Cloth:
    """A garment as it was read, and its openings on the body; None: it has none there."""

    mesh: Mesh
    garment: Garment
    wearing: Wearing | None
    skin: Skin | None = None  # that it is modelled on; None: it is cut from panels, or the body moves

    @cached_property
    def front_at_start(self) -> Front | None:
        """As ``front``, of the garment as it starts; None: it has no openings on a body."""
        if self.wearing is None:
            return None
        cut = self.front(self.wearing, self.wearing.followed)
        if self.skin is None:
            return cut
        start, middle = self.wearing.start, 0.5 * (self.wearing.start.min(axis=0) + self.wearing.start.max(axis=0))
        axes = np.zeros(3), self.wearing.skeleton.middle, middle
        ahead = faces_ahead(start, [_about_axis(180.0, axis).moved(start) for axis in axes], self.skin)
        return Front(cut.score + MOULDED * ahead, "turned by half it would lie on the skin") if ahead else cut

    def front(self, wearing: Wearing, points: Points) -> Front:
        """Whether its front is before the body, with the garment at ``points`` [m]."""
        corners = self.garment.rest.corners
        corners = self.garment.points[self.garment.triangles] if corners is None else corners
        return front_of(wearing, points, triangle_areas(triangle_sides(corners)), self.mesh)


def cloths_of(
    meshes: Sequence[Mesh], garments: Sequence[Garment], worn: Sequence[Wearing | None], skin: Skin | None
) -> list[Cloth]:
    """The garments of a scene as they were read; ``skin``: of the body as in ``read_again``."""
    each = zip(meshes, garments, worn, strict=True)
    return [Cloth(*own, skin if own[1].is_modelled else None) for own in each]


def read_again(scene: Scene, cloths: Sequence[Cloth], body: Mesh | None) -> tuple[Scene, list[Choice]]:
    """The scene with one thing read otherwise of garments that start badly, and what that is; else the same scene.

    What a garment's author states stays. ``body``: that all start on; None: it moves, or they do not meet it.
    """
    specs, choices = list(scene.garments), []
    for index, (spec, key, cloth) in enumerate(zip(scene.garments, scene.garment_keys, cloths, strict=True)):
        wearing = cloth.wearing
        if spec.mesh is None or is_placed(spec):
            continue
        found = None
        if wearing is None:
            found = None if body is None else _scaled_onto_skin(spec, cloth.mesh, body)
        elif wearing.start_fault:
            found = _scaled_or_stood_up(spec, cloth.mesh, wearing) or _turned(cloth, wearing) or _moved(spec, wearing)
        if found is None and wearing is not None:
            found = _turned_about(cloth, wearing)
        if found is not None:
            changes, reason = found
            specs[index] = spec.model_copy(update=changes)
            choices += [Choice(f"{key}.{name}", value, reason) for name, value in changes.items()]
    return (scene.model_copy(update={"garments": tuple(specs)}) if choices else scene), choices


def with_doubts(scene: Scene, cloths: Sequence[Cloth]) -> tuple[Mesh, ...]:
    """The garments' meshes, with a note where one may be worn back to front."""
    noted = []
    for spec, key, cloth in zip(scene.garments, scene.garment_keys, cloths, strict=True):
        mesh, is_open = cloth.mesh, spec.mesh is not None and "rotate" not in spec.model_fields_set
        front = cloth.front_at_start if is_open else None
        if front is not None and front.score <= -DOUBTFUL:
            note = f"it may be worn back to front, as {front.reason}: {key}.rotate = [0, 180, 0] turns it"
            mesh = replace(mesh, notes=(*mesh.notes, note))
        noted.append(mesh)
    return tuple(noted)


def read_sizes_again(
    scene: Scene, garments: Sequence[tuple[str, Mesh]], avatar: Mesh | None
) -> tuple[Scene, list[Choice]]:
    """The scene with what only so fits in another unit, and standing up, and why: garments, else the body.

    Else the same scene. What its author states stays. The first garment tells the body's unit.
    """
    if scene.avatar is None or avatar is None:
        return scene, []
    specs, choices = list(scene.garments), []
    for index, (spec, (key, garment)) in enumerate(zip(scene.garments, garments, strict=True)):
        if is_of_fitting_size(garment, avatar) or spec.mesh is None:
            continue
        changes = _read_in(key, spec, garment, fitting_reading(key, garment, avatar))
        up = ", with y up," if "up" in changes else ""
        reason = f"in {garment.unit}{up} it would not fit the body, or lie beside it"
        choices += [Choice(f"{key}.{name}", value, reason) for name, value in changes.items()]
        specs[index] = spec.model_copy(update=changes)
    if choices:
        return scene.model_copy(update={"garments": tuple(specs)}), choices
    changes = _read_in("avatar", scene.avatar, avatar, fitting_reading(*garments[0], avatar))
    reason = f"in {avatar.unit}, with y up, it would lie beside the garment"
    choices = [Choice(f"avatar.{name}", value, reason) for name, value in changes.items()]
    return scene.model_copy(update={"avatar": scene.avatar.model_copy(update=changes)}), choices


def _read_in(key: str, spec: GarmentSpec | AvatarSpec, mesh: Mesh, reading: dict[str, str]) -> dict[str, str]:
    """What a reading of units and axes changes in a garment or a body; {}: it is another's, or its author states it."""
    own = {name.removeprefix(f"{key}."): value for name, value in reading.items()}
    is_open = was_guessed(mesh) and spec.up is None
    return own if is_open and all(name.startswith(f"{key}.") for name in reading) else {}


def stand_up(
    scene: Scene, garments: Sequence[tuple[str, Mesh]], avatar: Mesh | None, skeleton: Callable[[], Skeleton | None]
) -> tuple[Scene, list[Choice]]:
    """The scene with a person standing who lies, or is upside down, and garments round it that a z-up file shows so.

    Else the same scene: what its author states stays, and a body lies where a garment round it states its own axis, or
    is a sheet of cloth, or where body and garment lie as no tool's axes are.
    """
    spec = scene.avatar
    has_sheet = any(each.shape is not None and not isinstance(each.shape, TshirtShape) for each in scene.garments)
    if spec is None or avatar is None or has_sheet or not _may_have_z_up(spec):
        return scene, []
    up = _head_of(avatar, skeleton)
    if up == "y":
        return scene, []
    low, high = avatar.points.min(axis=0), avatar.points.max(axis=0)
    reason = "a person would be upside down" if up == "-y" else f"a person would lie along {up[-1]}"
    choices, specs = [Choice("avatar.up", up, reason)], list(scene.garments)
    for index, (worn, (key, mesh)) in enumerate(zip(scene.garments, garments, strict=True)):
        if worn.mesh is None:
            continue
        middle = (mesh.points.min(axis=0) + mesh.points.max(axis=0)) / 2.0
        if not ((low <= middle) & (middle <= high)).all():
            continue
        if up != "z" or not _may_have_z_up(worn) or is_placed(worn):
            return scene, []
        specs[index] = worn.model_copy(update={"up": "z"})
        choices.append(Choice(f"{key}.up", "z", f"{reason} in it"))
    changes = {"avatar": spec.model_copy(update={"up": up}), "garments": tuple(specs)}
    return scene.model_copy(update=changes), choices


def _head_of(avatar: Mesh, skeleton: Callable[[], Skeleton | None]) -> BodyUp:
    """The axis that the head of a person is towards who lies or is upside down; "y": of all others."""
    person = skeleton()
    axis = 1 if person is None else int(np.argmax(np.abs(person.up)))
    if person is None or abs(person.up[axis]) < HEAD_UP:
        return "y"
    up = cast(BodyUp, f"{'-' if person.up[axis] < 0.0 else ''}{'xyz'[axis]}")
    legs = np.mean([person.curves[leg][-1] for leg in (RIGHT_LEG, LEFT_LEG)], axis=0) - person.spine[0]
    is_straight = float(-legs @ person.up) >= HEAD_UP * float(np.linalg.norm(legs))  # else it bends over
    sits = up == "z" and lies(avatar.points, avatar.triangles.astype(np.int64))
    return up if is_straight or sits else "y"


def _may_have_z_up(spec: GarmentSpec | AvatarSpec) -> bool:
    return spec.up is None and spec.mesh is not None and spec.mesh.suffix.lower() in mesh_formats.PLAIN


def is_placed(spec: GarmentSpec) -> bool:
    """Whether its author states where it starts, be it where its file has it."""
    return bool({"rotate", "translate"} & spec.model_fields_set)


def _scaled_or_stood_up(spec: GarmentSpec, mesh: Mesh, wearing: Wearing) -> Change | None:
    """Another unit or up axis, in which openings are round their limbs, or near them, that are not as it was read."""
    may_stand = _may_have_z_up(spec)
    readings: list[tuple[dict[str, Value], Points, str]] = []
    if may_stand:
        stood = with_y_up(wearing.start)
        nearest = min(NEARER * _off_limbs(wearing), NEAR_LIMBS * wearing.skeleton.span)
        if _off_limbs(wearing.started_at(stood)) < nearest:
            return {"up": "z"}, "with y up its openings would be far from the limbs"
        readings.append(({"up": "z"}, stood, "with y up"))
    metres = next((length for unit, length in METRES_PER.items() if unit == mesh.unit), None)
    if spec.units is None and was_guessed(mesh) and metres is not None:  # None: it was scaled to its panels
        for unit in OTHER_UNITS:
            scaled = wearing.start * (METRES_PER[unit] / metres)
            readings.append(({"units": unit}, scaled, f"in {mesh.unit}"))
            if may_stand:
                readings.append(({"units": unit, "up": "z"}, with_y_up(scaled), f"in {mesh.unit}, or with y up,"))
    now, wrong = _wrong_share(wearing, wearing.start), [_wrong_share(wearing, points) for _, points, _ in readings]
    if not now > 0.5 or not min(wrong, default=1.0) <= 0.5 * now:
        return None
    changes, _, otherwise = readings[wrong.index(min(wrong))]
    return changes, f"{otherwise} few limbs would pass through its openings"


def _scaled_onto_skin(spec: GarmentSpec, mesh: Mesh, body: Mesh) -> Change | None:
    """Another unit, in which what has no openings to tell where it belongs lies on the skin, as it does not as read.

    By its distance from the skin in parts of its own size, within it or outside: a mitten in inches, read in
    centimetres, starts through a leg.
    """
    metres = next((length for unit, length in METRES_PER.items() if unit == mesh.unit), None)
    if spec.units is not None or not was_guessed(mesh) or metres is None:
        return None
    scales = {unit: METRES_PER[unit] / metres for unit in OTHER_UNITS}
    extent = float(np.ptp(mesh.points, axis=0).max())
    off = {
        unit: _off_skin(scale * mesh.points, body)
        for unit, scale in scales.items()
        if is_usual_size("garment", scale * extent)
    }
    if not off or not min(off.values()) <= min(ON_SKIN, NEARER * _off_skin(mesh.points, body)):
        return None
    return {"units": min(off, key=lambda unit: off[unit])}, f"in {mesh.unit} it would lie off the body, or through it"


def _off_skin(points: Points, body: Mesh) -> float:
    """How far half of some points [m], shape [N, 3], are from a body's vertices at least, in parts of their extent."""
    nearest = body.points[nearest_points(body.points, points)]
    return float(np.median(np.linalg.norm(points - nearest, axis=1)) / np.ptp(points, axis=0).max())


def _wrong_share(wearing: Wearing, points: Points) -> float:
    """The part of the openings of the garment at ``points`` [m] that are not round the limbs that they are for there.

    1 where an opening is for none.
    """
    there = wearing.started_at(points)
    return len(there.misplaced_at_start) / len(there.openings) if all(there.limbs) else 1.0


def _off_limbs(wearing: Wearing) -> float:
    """How far the openings of the garment as it starts are from the limbs that they are for, on average [m].

    Infinite where an opening is for none.
    """
    skeleton = wearing.skeleton
    if not all(wearing.limbs):
        return np.inf
    middles = [wearing.start[opening.loop].mean(axis=0) for opening in wearing.openings]
    curves = [np.concatenate([skeleton.curves[limb] for limb in limbs]) for limbs in wearing.limbs]
    pairs = zip(middles, curves, strict=True)
    return float(np.mean([np.linalg.norm(curve - middle, axis=1).min() for middle, curve in pairs]))


def _turned(cloth: Cloth, wearing: Wearing) -> Change | None:
    """The turn about the body, or about its file's axis, that brings a left and a right opening to its left and right.

    None: there is none, or it would start worse.
    """
    skeleton = wearing.skeleton
    across = _sideways(wearing)
    if across is None:
        return _turned_a_quarter(cloth, wearing)
    degrees = angle_about_y(across, skeleton.left)
    degrees -= 180.0 * round(degrees / 180.0)  # left and right look alike
    if abs(degrees) < TURNED:
        return None
    is_quarter = abs(abs(degrees) - QUARTER) < SQUARE
    if is_quarter:
        degrees = float(np.copysign(QUARTER, degrees))
    if cloth.front(wearing, _about_axis(degrees, skeleton.middle).moved(wearing.start)).score < 0.0:
        degrees -= float(np.copysign(180.0, degrees))
    turns = [_about_axis(degrees, axis) for axis in (skeleton.middle, np.zeros(3))]
    there = [wearing.started_at(turn.moved(wearing.start)) for turn in turns]
    # by a quarter a garment was turned, about whatever axis; at another angle the body was scanned, about its file's
    wrong = [(len(each.misplaced_at_start), 0.0 if is_quarter else _off_limbs(each)) for each in there]
    best = wrong.index(min(wrong))
    before = len(wearing.misplaced_at_start)
    if wrong[best][0] > before or (wrong[best][0] == before and abs(degrees) >= SIDEWAYS):
        return None
    changes: dict[str, Value] = {"rotate": turns[best].rotate}
    if any(turns[best].translate):
        changes["translate"] = turns[best].translate
    return changes, f"its left and right were {abs(degrees):.0f} degrees off the body's"


def _turned_a_quarter(cloth: Cloth, wearing: Wearing) -> Change | None:
    """The quarter turn about the body where a garment starts on every limb, as one sleeve has none to be compared with.

    None: there it starts badly, too, or it has no sleeve, and a skirt may lie over the arms either way.
    """
    turns = [_about_axis(degrees, wearing.skeleton.middle) for degrees in (QUARTER, -QUARTER)]
    good = []
    for turn in turns:
        there = wearing.started_at(turn.moved(wearing.start))
        if not there.start_fault and any(limbs in SLEEVED for limbs in there.limbs):
            good.append((cloth.front(there, there.start).score, turn))
    if not good:
        return None
    _, turn = max(good, key=lambda scored: scored[0])
    return {"rotate": turn.rotate, "translate": turn.translate}, "a quarter turned, it starts on every limb"


def _turned_about(cloth: Cloth, wearing: Wearing) -> Change | None:
    """The half turn of a garment whose back is before the body, about the axis of its file or of the body.

    None: its front is there, or it is not sure enough, or could not be sewn there.
    """
    front = cloth.front_at_start
    # garments mostly face +z in their files: on who faces -z the likelier side decides, the right one for 29 of 32
    faces_away = bool(wearing.skeleton.left[0] < 0.0)
    if front is None or front.score >= (0.0 if faces_away else -CERTAIN):
        return None
    turns = [_about_axis(180.0, axis) for axis in (np.zeros(3), wearing.skeleton.middle)]
    if (skin := cloth.skin) is not None:
        turns.sort(key=lambda turn: within(turn.moved(wearing.start), skin))
    for turn in turns:
        there = wearing.started_at(turn.moved(wearing.start))
        is_clear = faces_away or not there.pierced(there.start) or bool(wearing.pierced(wearing.start))
        if is_clear and len(there.misplaced_at_start) <= len(wearing.misplaced_at_start):
            changes: dict[str, Value] = {"rotate": turn.rotate}
            if any(turn.translate):
                changes["translate"] = turn.translate
            return changes, f"it would be worn back to front: {front.reason}"
    return None


def _moved(spec: GarmentSpec, wearing: Wearing) -> Change | None:
    """The move onto the body of a garment that starts beside it, and may have z up; None: it cannot be sewn there."""
    found = _move_of(wearing)
    if found is None and _may_have_z_up(spec):
        found = _move_of(wearing.started_at(with_y_up(wearing.start)))
        if found is not None:
            return {"up": "z", "translate": found}, "it starts beside the body, and no limb would be in its openings"
    return None if found is None else ({"translate": found}, "it starts beside the body")


def _move_of(wearing: Wearing) -> tuple[float, float, float] | None:
    """What moves a garment onto the body that it starts beside, where it could be sewn [m]; None: it could not."""
    for shift in (wearing.shift, wearing.across):
        there = wearing.started_at(wearing.start + shift)
        if float(np.linalg.norm(shift)) > BESIDE and not there.start_fault:
            x, y, z = shift.tolist()
            return x, y, z
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


def _about_axis(degrees: float, place: Points) -> Placement:
    """A turn about the vertical through a place [m], shape [3]."""
    flat = place * [1.0, 0.0, 1.0]
    x, y, z = (flat - _about_y(degrees).moved(flat)).tolist()
    return replace(_about_y(degrees), translate=(x, y, z))


def _about_y(degrees: float) -> Placement:
    return Placement(rotate=(0.0, degrees, 0.0))


def angle_about_y(before: Points, after: Points) -> float:
    """The angle about the y axis from one horizontal direction to another [degrees]."""
    return float(np.degrees(np.arctan2(after[0], after[2]) - np.arctan2(before[0], before[2])))
