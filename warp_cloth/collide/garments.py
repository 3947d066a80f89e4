"""A scene's garments as they meet themselves and each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warp_cloth.collide.cloth import ClothTouch
from warp_cloth.collide.crossing import find_crossings
from warp_cloth.collide.exact import POINTS_AT_ONCE, build_exact_collider, pieces
from warp_cloth.collide.placing import clear_shift, way_told
from warp_cloth.collide.sheets import SheetKind, sheets_of
from warp_cloth.collide.solid import solid_of
from warp_cloth.garment.part import GarmentPart
from warp_cloth.garment.wardrobe import Wardrobe
from warp_cloth.kept import Kept
from warp_cloth.mesh import Indices, Mesh, Points
from warp_cloth.model import ClothModel
from warp_cloth.scene import Scene
from warp_cloth.solver.course import LAYER_LIFT, Course
from warp_cloth.solver.relax import Relaxation

CROSSING_FIELD = "crossing"  # of a garment where some of it crosses: 1 at the corners of those faces
FAR_AWAY = 1e3  # [m]; farther from its body no garment is asked which way it faces


def placed(scenes: Sequence[Scene], wardrobes: Sequence[Wardrobe], device: str, kept: Kept) -> list[Wardrobe]:
    """The wardrobes with every garment to be sewn clear of its avatar, as far as moving it up or forward does that.

    The panels say what the garment is; where they start does not matter, unless they start on both sides of a limb.
    """

    def shift_of(scene: Scene, wardrobe: Wardrobe, index: int) -> Points | None:
        part, avatar = wardrobe.parts[index], wardrobe.starting_avatar
        if avatar is None or scene.collision.avatar == "none" or scene.garments[index].rest != "uv" or len(part.pins):
            return None
        skin = kept.once("solid", (avatar,), partial(solid_of, avatar)).closing.skin(avatar)
        return kept.once("shift", (part.points, avatar), partial(clear_shift, part.points, skin, device))

    return [
        _shifted(wardrobe, [shift_of(scene, wardrobe, index) for index in range(len(wardrobe.parts))], kept)
        for scene, wardrobe in zip(scenes, wardrobes, strict=True)
    ]


def _shifted(wardrobe: Wardrobe, shifts: Sequence[Points | None], kept: Kept) -> Wardrobe:
    if all(shift is None for shift in shifts):
        return wardrobe
    parts, meshes = list(wardrobe.parts), list(wardrobe.garments)
    for index, shift in enumerate(shifts):
        if shift is not None:
            note = f"some of it started inside the avatar: moved {way_told(shift)} before it was sewn"
            loaded = parts[index].points
            points = kept.once("shifted", (loaded, shift), partial(np.add, loaded, shift))
            parts[index] = replace(parts[index], points=points)
            meshes[index] = replace(meshes[index], notes=(*meshes[index].notes, note))
    return replace(wardrobe, parts=tuple(parts), garments=tuple(meshes))


def cloth_touch(scene: Scene, wardrobe: Wardrobe, model: ClothModel, device: str) -> ClothTouch:
    """Contact between a scene's garments, inner to outer as listed."""
    kinds = [
        SheetKind(spec.fabric.thickness, spec.fabric.friction, layer=layer) for layer, spec in enumerate(scene.garments)
    ]
    avatar = wardrobe.starting_avatar
    body = None if avatar is None else build_exact_collider(avatar, device).within(FAR_AWAY)
    return ClothTouch(model, wardrobe.parts, kinds, body)


def highest_lift(scene: Scene) -> float:
    """How much farther from the avatar than its offset a scene's outermost garment is sewn [m]."""
    return LAYER_LIFT * (len(scene.garments) - 1) if scene.collision.cloth else 0.0


def cloth_course(wardrobe: Wardrobe, relaxation: Relaxation, touch: ClothTouch) -> Course:
    """The way of a scene's garments from where they are loaded."""

    def face() -> None:
        if touch.facing is not None:
            touch.face_from_body()
        else:
            touch.face(signs_from_middle(wardrobe.parts, relaxation.model.points()))

    return Course(relaxation, touch, face)


def signs_from_middle(parts: Sequence[GarmentPart], points: Points) -> list[float]:
    """Whether most of each garment's area faces away from its own middle, 1, or to it, -1, at these points [m]."""
    signs, start = [], 0
    for part in parts:
        own = points[start : start + len(part.points)]
        a, b, c = (own[part.triangles[:, corner]] for corner in range(3))
        away = np.einsum("ij,ij->", np.cross(b - a, c - a), (a + b + c) / 3.0 - own.mean(axis=0))
        signs.append(1.0 if float(away) >= 0.0 else -1.0)
        start += len(own)
    return signs


@dataclass(frozen=True, eq=False)
class GarmentCrossings:
    """Where worn garments pass through themselves and each other."""

    pairs: int  # of triangles that cross
    between: int  # of those, how many belong to two garments
    faces: tuple[Indices, ...]  # of each garment, in order

    @property
    def face_count(self) -> int:
        return sum(len(faces) for faces in self.faces)

    def marked(self, garment: int, mesh: Mesh) -> dict[str, NDArray[np.float32]]:
        """The field that shows where a garment crosses; none where it does not."""
        faces = self.faces[garment]
        if not len(faces):
            return {}
        at = np.zeros(mesh.vertex_count, dtype=np.float32)
        at[mesh.triangles[faces]] = 1.0
        return {CROSSING_FIELD: at}


def worn_crossings(wardrobes: Sequence[Wardrobe], worn: Sequence[Points], device: str) -> list[GarmentCrossings]:
    """What crosses of each scene's garments at these points [m], shape [V, 3], one after another.

    Garments of different scenes do not meet; they are looked through together, which keeps a GPU busy.
    """
    finite = [number for number, points in enumerate(worn) if np.isfinite(points).all()]
    found: dict[int, GarmentCrossings] = {}
    for piece in pieces([len(worn[number]) for number in finite], POINTS_AT_ONCE):
        chosen = [finite[at] for at in piece]
        several = _crossings_together([wardrobes[number] for number in chosen], [worn[n] for n in chosen], device)
        found.update(zip(chosen, several, strict=True))
    none = np.zeros(0, dtype=np.int32)
    return [
        found.get(number) or GarmentCrossings(0, 0, (none,) * len(wardrobe.parts))
        for number, wardrobe in enumerate(wardrobes)
    ]


def _crossings_together(wardrobes: Sequence[Wardrobe], worn: Sequence[Points], device: str) -> list[GarmentCrossings]:
    parts = [part for wardrobe in wardrobes for part in wardrobe.parts]
    items = [item for item, wardrobe in enumerate(wardrobes) for _ in wardrobe.parts]
    sheets = sheets_of(parts)
    pairs = find_crossings(np.concatenate(worn), sheets, device, items=items).pairs
    first = np.concatenate([[0], np.cumsum([len(part.triangles) for part in parts])])
    item = np.asarray(items)[sheets.garment[pairs[:, 0]]]
    found, garment = [], 0
    for number, wardrobe in enumerate(wardrobes):
        own, last = pairs[item == number], garment + len(wardrobe.parts)
        faces, between = np.unique(own), np.diff(sheets.garment[own], axis=1) != 0
        ends = pairwise(first[garment : last + 1])
        listed = tuple(faces[(faces >= a) & (faces < b)] - a for a, b in ends)
        found.append(GarmentCrossings(len(own), int(between.sum()), listed))
        garment = last
    return found
