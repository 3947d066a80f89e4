"""Garments of a scene in contact: their placement, their cloth contact, and where they cross."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, starmap

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
from warp_cloth.contact.sheets import LAYER_LIFT, SheetKind, sheets_of
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.model import ClothModel
from warp_cloth.scene import Scene

CROSSING_FIELD = "crossing"  # field of a garment: 1 at the corners of faces that cross
FAR_AWAY = 1e3  # [m]; reach of the body's distance by which garments are oriented


def placed(scenes: Sequence[Scene], outfits: Sequence[Outfit], device: str, cache: Cache) -> list[Outfit]:
    """The outfits with every garment that is to be sewn moved up or forward, clear of its avatar as far as possible.

    Panels define a garment by their shape; where they start does not matter, unless it is on both sides of a limb.
    """

    def shift_of(scene: Scene, outfit: Outfit, index: int) -> Points | None:
        garment, avatar, wearing = outfit.garments[index], outfit.starting_avatar, outfit.wearing[index]
        if avatar is None or scene.collision.avatar == "none" or garment.rest.source.kind != "uv" or len(garment.pins):
            return None
        surface = cache.get_or_make("solid", (avatar,), partial(solid_of, avatar)).closing.surface(avatar)
        elsewhere = not outfit.poses and wearing is None
        highest = np.inf if wearing is None else wearing.room_above
        down = np.zeros(3) if wearing is None else min(highest, 0.0) * wearing.skeleton.up
        make = partial(clear_shift, garment.points + down, surface, device, may_be_elsewhere=elsewhere, highest=highest)
        shift: Points | None = cache.get_or_make("shift", (garment.points, avatar), make, elsewhere, highest)
        return shift if not down.any() else down if shift is None else down + shift

    return [
        _shifted(outfit, [shift_of(scene, outfit, index) for index in range(len(outfit.garments))], cache)
        for scene, outfit in zip(scenes, outfits, strict=True)
    ]


def _shifted(outfit: Outfit, shifts: Sequence[Points | None], cache: Cache) -> Outfit:
    if all(shift is None for shift in shifts):
        return outfit
    garments, meshes = list(outfit.garments), list(outfit.meshes)
    for index, shift in enumerate(shifts):
        if shift is not None:
            wearing = outfit.wearing[index]
            is_above = wearing is not None and wearing.room_above < 0.0
            why = "it started above the avatar's end" if is_above else "some of it started inside the avatar"
            note = f"{why}: moved {shift_text(shift)} before it was sewn"
            loaded = garments[index].points
            points = cache.get_or_make("shifted", (loaded, shift), partial(np.add, loaded, shift))
            garments[index] = replace(garments[index], points=points)
            meshes[index] = replace(meshes[index], notes=(*meshes[index].notes, note))
    return replace(outfit, meshes=tuple(meshes), garments=tuple(garments))


def build_cloth_contact(scene: Scene, outfit: Outfit, model: ClothModel, device: str) -> ClothContact:
    """Contact of a scene's garments, which are listed from the inside out, but where the outfit says otherwise."""
    layers = outfit.layers or range(len(scene.garments))
    kinds = [
        SheetKind(spec.fabric.thickness, spec.fabric.friction, layer=layer)
        for layer, spec in zip(layers, scene.garments, strict=True)
    ]
    avatar = outfit.starting_avatar
    body = None if avatar is None else build_exact_collider(avatar, device).within(FAR_AWAY)
    return ClothContact(model, outfit.garments, kinds, body)


def highest_lift(scene: Scene) -> float:
    """How much farther from the avatar than its offset a scene's outermost garment is sewn [m]."""
    return LAYER_LIFT * (len(scene.garments) - 1) if scene.collision.cloth else 0.0


@dataclass(frozen=True, eq=False)
class GarmentCrossings:
    """Where worn garments pass through themselves and each other."""

    pairs: int  # of triangles that cross
    between: int  # those of two different garments
    faces: tuple[Indices, ...]  # crossing faces of each garment, in order

    @property
    def face_count(self) -> int:
        return sum(len(faces) for faces in self.faces)

    def marked(self, garment: int, mesh: Mesh) -> dict[str, NDArray[np.float32]]:
        """The field that marks where a garment crosses; none if it does not."""
        faces = self.faces[garment]
        if not len(faces):
            return {}
        at = np.zeros(mesh.vertex_count, dtype=np.float32)
        at[mesh.triangles[faces]] = 1.0
        return {CROSSING_FIELD: at}


def worn_crossings(outfits: Sequence[Outfit], worn: Sequence[Points], device: str) -> list[GarmentCrossings]:
    """Crossings of each scene's garments at these points [m], shape [V, 3].

    Garments of different scenes do not collide. For points that are not finite there are none.
    """

    def crossings_of(outfit: Outfit, points: Points) -> GarmentCrossings:
        sheets = sheets_of(outfit.garments)
        return _of_sheets(find_crossings(points, sheets, device).pairs, sheets)

    return [crossings_of(outfit, points) for outfit, points in zip(outfits, worn, strict=True)]


def modelled_crossings(outfit: Outfit, device: str) -> tuple[GarmentCrossings, ...]:
    """Where each garment passes through its own cloth in its file; nowhere if it is cut from panels.

    Panels may lie anyhow: they are sewn before they are worn.
    """

    def crossings_of(garment: Garment, mesh: Mesh) -> GarmentCrossings:
        if garment.rest.source.kind == "uv":
            return GarmentCrossings(0, 0, (np.zeros(0, dtype=np.int32),))
        sheets = sheets_of([garment])
        return _of_sheets(find_crossings(mesh.points, sheets, device).pairs, sheets)

    return tuple(starmap(crossings_of, zip(outfit.garments, outfit.meshes, strict=True)))


def model_crossings(model: ClothModel, outfits: Sequence[Outfit]) -> list[GarmentCrossings]:
    """The same for a model's garments in their current state, all finite: searched together, to keep a GPU busy."""
    each = [[garment.rest.topology for garment in outfit.garments] for outfit in outfits]
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

    def crossings_of(item: int) -> GarmentCrossings:
        if not len(found[item]):
            return GarmentCrossings(0, 0, (np.zeros(0, dtype=np.int32),) * len(outfits[item].garments))
        sheets = sheets_of(outfits[item].garments)
        return _of_sheets(triangle_pairs(found[item], sheets), sheets)

    return map_in_threads(crossings_of, range(len(outfits)))


def _of_sheets(pairs: Indices, sheets: Sheets) -> GarmentCrossings:
    """The crossings of garments, from pairs of triangles that cross."""
    faces, between = np.unique(pairs), np.diff(sheets.garment[pairs], axis=1) != 0
    first = np.searchsorted(sheets.garment, np.arange(len(sheets.vertex_start)))
    listed = tuple(faces[(faces >= a) & (faces < b)] - a for a, b in pairwise(first.tolist()))
    return GarmentCrossings(len(pairs), int(between.sum()), listed)
