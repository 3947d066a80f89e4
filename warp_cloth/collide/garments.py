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
from warp_cloth.collide.exact import POINTS_AT_ONCE, build_exact_collider, pieces, signed_distances
from warp_cloth.collide.placing import clear_shift, way_told
from warp_cloth.collide.sheets import SheetKind, sheets_of
from warp_cloth.collide.solid import solid_of
from warp_cloth.garment.wardrobe import Wardrobe
from warp_cloth.kept import Kept
from warp_cloth.mesh import Indices, Mesh, Points
from warp_cloth.model import ClothModel
from warp_cloth.scene import Scene
from warp_cloth.solver.course import LAYER_LIFT, Course
from warp_cloth.solver.relax import Relaxation

CROSSING_FIELD = "crossing"  # of a garment where some of it crosses: 1 at the corners of those faces
FEELER = 5e-3  # [m]; how far before and behind the cloth its distance from the body is compared


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


def cloth_touch(scene: Scene, wardrobe: Wardrobe, model: ClothModel) -> ClothTouch:
    """Contact between a scene's garments, inner to outer as listed."""
    kinds = [
        SheetKind(spec.fabric.thickness, spec.fabric.friction, layer=layer) for layer, spec in enumerate(scene.garments)
    ]
    return ClothTouch(model, wardrobe.parts, kinds)


def highest_lift(scene: Scene) -> float:
    """How much farther from the avatar than its offset a scene's outermost garment is sewn [m]."""
    return LAYER_LIFT * (len(scene.garments) - 1) if scene.collision.cloth else 0.0


def cloth_course(wardrobe: Wardrobe, relaxation: Relaxation, touch: ClothTouch, device: str) -> Course:
    """The way of a scene's garments from where they are loaded."""
    lengths = np.concatenate([part.rest.edge_length for part in wardrobe.parts])
    return Course(relaxation, touch, lengths, OutwardSigns(wardrobe, device))


class OutwardSigns:
    """Tells of each garment whether most of its area faces away from the body, 1, or to it, -1."""

    def __init__(self, wardrobe: Wardrobe, device: str) -> None:
        self._parts, avatar = wardrobe.parts, wardrobe.starting_avatar
        self._avatar, self._exact = avatar, None if avatar is None else build_exact_collider(avatar, device)

    def __call__(self, points: Points) -> list[float]:
        """Of garments at these points [m]."""
        first = np.cumsum([0, *(len(part.points) for part in self._parts)])
        corners = [points[start + part.triangles] for start, part in zip(first, self._parts, strict=False)]
        normals = [np.cross(each[:, 1] - each[:, 0], each[:, 2] - each[:, 0]) for each in corners]
        centres = [each.mean(axis=1) for each in corners]
        if self._avatar is None or self._exact is None:  # away from its own middle
            away = [
                np.einsum("ij,ij->", normal, centre - points[start:end].mean(axis=0))
                for normal, centre, (start, end) in zip(normals, centres, pairwise(first), strict=True)
            ]
        else:
            area = [np.linalg.norm(normal, axis=1) for normal in normals]
            step = FEELER * np.concatenate(normals) / np.maximum(np.concatenate(area), np.finfo(float).tiny)[:, None]
            centre = np.concatenate(centres)
            feelers = np.concatenate([centre + step, centre - step])
            distances = signed_distances(feelers, self._avatar, self._exact.device, self._exact)
            before, behind = np.split(distances, 2)
            sides = np.split(np.sign(before - behind), np.cumsum([len(each) for each in centres])[:-1])
            away = [(own * side).sum() for own, side in zip(area, sides, strict=True)]
        return [1.0 if float(each) >= 0.0 else -1.0 for each in away]


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
