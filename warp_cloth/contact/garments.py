"""A scene's garments as they meet themselves and each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.exact import POINTS_AT_ONCE, build_exact_collider
from warp_cloth.avatar.placement import clear_shift, shift_text
from warp_cloth.avatar.solid import solid_of
from warp_cloth.base.bins import consecutive_bins
from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.base.threads import map_in_threads
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.contact.crossing import Sheets, find_crossings, find_pierced, triangle_pairs
from warp_cloth.contact.sheets import SheetKind, sheets_of
from warp_cloth.garment.outfit import Outfit
from warp_cloth.garment.part import GarmentPart
from warp_cloth.model.model import ClothModel
from warp_cloth.scene import Scene
from warp_cloth.solver.contact_schedule import LAYER_LIFT, ContactSchedule
from warp_cloth.solver.relax import Relaxation

CROSSING_FIELD = "crossing"  # of a garment where some of it crosses: 1 at the corners of those faces
FAR_AWAY = 1e3  # [m]; farther from its body no garment is asked which way it faces


def placed(scenes: Sequence[Scene], outfits: Sequence[Outfit], device: str, cache: Cache) -> list[Outfit]:
    """The outfits with every garment to be sewn clear of its avatar, as far as moving it up or forward does that.

    The panels say what the garment is; where they start does not matter, unless they start on both sides of a limb.
    """

    def shift_of(scene: Scene, outfit: Outfit, index: int) -> Points | None:
        part, avatar = outfit.parts[index], outfit.starting_avatar
        if avatar is None or scene.collision.avatar == "none" or scene.garments[index].rest != "uv" or len(part.pins):
            return None
        skin = cache.get_or_make("solid", (avatar,), partial(solid_of, avatar)).closing.surface(avatar)
        return cache.get_or_make("shift", (part.points, avatar), partial(clear_shift, part.points, skin, device))

    return [
        _shifted(outfit, [shift_of(scene, outfit, index) for index in range(len(outfit.parts))], cache)
        for scene, outfit in zip(scenes, outfits, strict=True)
    ]


def _shifted(outfit: Outfit, shifts: Sequence[Points | None], cache: Cache) -> Outfit:
    if all(shift is None for shift in shifts):
        return outfit
    parts, meshes = list(outfit.parts), list(outfit.garments)
    for index, shift in enumerate(shifts):
        if shift is not None:
            note = f"some of it started inside the avatar: moved {shift_text(shift)} before it was sewn"
            loaded = parts[index].points
            points = cache.get_or_make("shifted", (loaded, shift), partial(np.add, loaded, shift))
            parts[index] = replace(parts[index], points=points)
            meshes[index] = replace(meshes[index], notes=(*meshes[index].notes, note))
    return replace(outfit, parts=tuple(parts), garments=tuple(meshes))


def build_cloth_contact(scene: Scene, outfit: Outfit, model: ClothModel, device: str) -> ClothContact:
    """Contact between a scene's garments, inner to outer as listed."""
    kinds = [
        SheetKind(spec.fabric.thickness, spec.fabric.friction, layer=layer) for layer, spec in enumerate(scene.garments)
    ]
    avatar = outfit.starting_avatar
    body = None if avatar is None else build_exact_collider(avatar, device).within(FAR_AWAY)
    return ClothContact(model, outfit.parts, kinds, body)


def highest_lift(scene: Scene) -> float:
    """How much farther from the avatar than its offset a scene's outermost garment is sewn [m]."""
    return LAYER_LIFT * (len(scene.garments) - 1) if scene.collision.cloth else 0.0


def build_contact_schedule(outfit: Outfit, relaxation: Relaxation, cloth_contact: ClothContact) -> ContactSchedule:
    """The way of a scene's garments from where they are loaded."""

    def face() -> None:
        if cloth_contact.facing is not None:
            cloth_contact.face_from_body()
        else:
            cloth_contact.face(signs_from_middle(outfit.parts, relaxation.model.points()))

    return ContactSchedule(relaxation, cloth_contact, face)


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


def worn_crossings(outfits: Sequence[Outfit], worn: Sequence[Points], device: str) -> list[GarmentCrossings]:
    """What crosses of each scene's garments at these points [m], shape [V, 3], one after another.

    Garments of different scenes do not meet. Of points that are not finite nothing is told.
    """

    def told(outfit: Outfit, points: Points) -> GarmentCrossings:
        sheets = sheets_of(outfit.parts)
        return _of_sheets(find_crossings(points, sheets, device).pairs, sheets)

    return [told(outfit, points) for outfit, points in zip(outfits, worn, strict=True)]


def model_crossings(model: ClothModel, outfits: Sequence[Outfit]) -> list[GarmentCrossings]:
    """The same of a model's garments where they lie now, all finite: looked through together, to keep a GPU busy."""
    each = [[part.rest.topology for part in outfit.parts] for outfit in outfits]
    edges = np.cumsum([0, *(sum(len(one.edges) for one in own) for own in each)])
    triangles = np.cumsum([0, *(sum(len(one.triangle_edges) for one in own) for own in each)])
    position = model.state.position
    if position.dtype is not wp.vec3d:
        position = wp.array(model.points(), dtype=wp.vec3d, device=model.device)
    found: list[Indices] = []  # of each scene, by numbers of its own
    for piece in consecutive_bins(np.diff(model.item_start).tolist(), POINTS_AT_ONCE):
        (edge, last_edge), (triangle, last_triangle) = (
            (ends[piece.start], ends[piece.stop]) for ends in (edges, triangles)
        )
        pierced = find_pierced(
            position,
            model.triangles.corners[triangle:last_triangle],
            model.edges.ends[edge:last_edge],
            model.vertices.item,
        )
        first = np.stack([edges, triangles], axis=1)[piece.start : piece.stop]
        ends = np.searchsorted(pierced[:, 0], edges[piece.start + 1 : piece.stop] - edge)
        found += [own - at + first[0] for own, at in zip(np.split(pierced, ends), first, strict=True)]

    def told(item: int) -> GarmentCrossings:
        if not len(found[item]):
            return GarmentCrossings(0, 0, (np.zeros(0, dtype=np.int32),) * len(outfits[item].parts))
        sheets = sheets_of(outfits[item].parts)
        return _of_sheets(triangle_pairs(found[item], sheets), sheets)

    return map_in_threads(told, range(len(outfits)))


def _of_sheets(pairs: Indices, sheets: Sheets) -> GarmentCrossings:
    """What is told of pairs of triangles that cross."""
    faces, between = np.unique(pairs), np.diff(sheets.garment[pairs], axis=1) != 0
    first = np.searchsorted(sheets.garment, np.arange(len(sheets.vertex_start)))
    listed = tuple(faces[(faces >= a) & (faces < b)] - a for a, b in pairwise(first.tolist()))
    return GarmentCrossings(len(pairs), int(between.sum()), listed)
