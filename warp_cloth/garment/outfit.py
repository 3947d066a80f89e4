"""The outfit of a scene: meshes, rest shapes and pins of its garments, and the avatar, made from a checked scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeVar

from warp_cloth.anatomy.geodesics import row_lengths
from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import openings_of
from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.anatomy.stored_body import stored_skeleton, stored_yielding
from warp_cloth.base.cache import Cache
from warp_cloth.base.choice import Choice
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.garment.closed_ends import open_ends
from warp_cloth.garment.coarse import divide_coarse
from warp_cloth.garment.facing import brought_from_afar, brought_to_wearer
from warp_cloth.garment.falling import Catcher
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.layering import layers_of, refuse_twins
from warp_cloth.garment.making import (
    MESH_KEYS,
    avatar_mesh,
    file_stamp,
    garment_mesh,
    posed_avatar,
    rest_and_pins,
    rest_geometry,
    values_of,
)
from warp_cloth.garment.mistaken import refuse_bodies
from warp_cloth.garment.reading import cloths_of, read_again, read_sizes_again, stand_up, with_doubts
from warp_cloth.garment.rest import RestGeometry, RestShape
from warp_cloth.garment.skin import Skin
from warp_cloth.loading import check_sizes
from warp_cloth.scene import AvatarSpec, BodyMeasures, GarmentSpec, MannequinShape, Scene
from warp_cloth.scene.predrape import predrape_scene_of
from warp_cloth.shapes import MannequinMeasures, mannequin_measures

FABRIC_KEYS = {"fabric", "pin", "name"}  # keys of a garment that its rest geometry does not depend on

YIELDS = "limbs pass through other skin: both yield there, so that cloth has room"  # a note

T = TypeVar("T")
Key = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Outfit:
    """The garments of a scene, inner to outer, and the avatar that wears them, loaded or generated, in metres."""

    meshes: tuple[Mesh, ...]  # of the garments, as loaded
    garments: tuple[Garment, ...]
    avatar: Mesh | None  # in its last pose
    poses: tuple[Points, ...] = ()  # vertices of a moving avatar, first pose to last [m], each shape [V, 3]
    predrape_garments: tuple[Garment, ...] = ()  # in the fabric of the predrape; empty: garments start as placed
    wearing: tuple[Wearing | None, ...] = ()  # of each garment; None: a sheet, or on what has no limbs, or moves
    readings: tuple[Choice, ...] = ()  # what was read otherwise than it is by default, as garments started badly
    padded: Mesh | None = None  # the avatar as garments meet it, where it would show through their faces otherwise
    layers: tuple[int, ...] = ()  # of each garment, from the inside out; empty: as they are listed

    @cached_property
    def catcher(self) -> Catcher:
        """What can catch the garments: the avatar, and each other."""
        return Catcher(self.garments, self.avatar)

    @property
    def starting_avatar(self) -> Mesh | None:
        """The avatar that the garments meet as they start, in its first pose."""
        if self.padded is not None:
            return self.padded
        return replace(self.avatar, points=self.poses[0]) if self.avatar is not None and self.poses else self.avatar


class GarmentKeys(NamedTuple):
    """Cache keys of one garment of a scene."""

    mesh: Key
    geometry: Key  # the rest geometry, the same in every fabric
    rest: Key  # the rest shape in the garment's own fabric, with its pins


@dataclass(frozen=True, eq=False)
class Recipe:
    """How to make a mesh that scenes can share, and its cache key."""

    key: Key
    make: Callable[[Cache], Any]  # in any process, from that process's cache of drafts


class MeshCache(Cache):
    """Meshes, rest shapes and garments, keyed by the scene values and files that they are made from.

    ``drafts`` caches what generated shapes are made from.
    """

    def __init__(self, drafts: Cache | None = None) -> None:
        super().__init__()
        self.drafts = drafts or Cache()

    def make(self, recipe: Recipe) -> Any:
        """The mesh of a recipe, made at the first call."""
        return self.get(recipe.key, partial(recipe.make, self.drafts))

    def get(self, key: Key, make: Callable[[], T]) -> T:
        """The value of a key, made at the first call."""
        return self.get_or_make(key[0], (), make, *key[1:])

    def subset(self, keys: Iterable[Key]) -> dict[Key, Any]:
        """The entries of those keys that are cached."""
        entries = self.portable_entries()
        return {key: entries[key] for key in keys if key in entries}

    def without(self, known: Iterable[Key]) -> dict[Any, Any]:
        """All entries but those of the known keys."""
        excluded = set(known)
        return {key: made for key, made in self.portable_entries().items() if key not in excluded}

    @property
    def vertex_count(self) -> int:
        """Vertices of all cached meshes together."""
        return sum(made.vertex_count for made in self.portable_entries().values() if isinstance(made, Mesh))


def load_outfit(scene: Scene, mesh_cache: MeshCache | None = None, *, divides: bool = True) -> Outfit:
    """Loads or generates every mesh of a scene and computes rest shapes and pins; cached ones are reused.

    ``divides``: whether faces are divided that a body would show through.

    Raises:
        InputError: a file, a rest shape or a pin cannot be used.
    """
    cache = mesh_cache or MeshCache()
    keys = _all_keys(scene)
    worn = tuple(_mesh_of(scene, index, each, cache) for index, each in enumerate(keys))
    avatar = next((cache.make(recipe) for recipe in avatar_recipe(scene)), None)
    keyed = list(zip(scene.garment_keys, worn, strict=True))
    find_skeleton = partial(wearer_skeleton, scene, avatar, cache)
    brought = _read_as(*brought_to_wearer(scene, find_skeleton), cache, divides)
    if brought is not None:
        return brought
    try:
        check_sizes(keyed, avatar)
    except InputError:
        garments = _garments(scene, worn, keys, cache)
        wearing = _wearing(scene, garments, keys, avatar, cache)
        for read in (
            partial(
                read_again, scene, cloths_of(worn, garments, wearing, None if avatar is None else Skin(avatar)), avatar
            ),
            partial(read_sizes_again, scene, keyed, avatar),
            partial(stand_up, scene, keyed, avatar, find_skeleton),
            partial(brought_from_afar, scene, keyed, avatar, find_skeleton),
        ):
            with suppress(InputError):  # the scene's own error is raised where no reading helps
                outfit = _read_as(*read(), cache, divides)
                if outfit is not None:
                    return outfit
        raise
    standing = _read_as(*stand_up(scene, keyed, avatar, find_skeleton), cache, divides)
    if standing is not None:
        return standing
    refuse_bodies(keyed, avatar, find_skeleton)
    garments, predrape_scene = _garments(scene, worn, keys, cache), predrape_scene_of(scene)
    poses: tuple[Points, ...] = ()
    if avatar is not None and scene.avatar is not None and scene.avatar.poses:
        files = () if scene.avatar.poses == "samples" else scene.avatar.poses
        key = "posed", *avatar_recipe(scene)[0].key, values_of(scene.avatar, {"poses"}), file_stamp(*files)
        avatar, poses = cache.get(key, partial(posed_avatar, scene.avatar, avatar))
    predraped: tuple[Garment, ...] = ()
    if predrape_scene is not None:
        predraped = _garments(predrape_scene, worn, _all_keys(predrape_scene), cache)
    still = avatar if not poses and scene.collision.avatar != "none" else None
    if still is not None:
        avatar = still = _with_room(scene, still, find_skeleton(), cache)
    skin = None if still is None else Skin(still)
    if still is not None:
        opened = _read_as(*open_ends(scene, garments, find_skeleton), cache, divides)
        if opened is not None:
            return opened
    wearing = _wearing(scene, garments, keys, still, cache)
    cloths = cloths_of(worn, garments, wearing, skin)
    otherwise = _read_as(*read_again(scene, cloths, still), cache, divides)
    if otherwise is None and divides:
        otherwise = _read_as(*divide_coarse(scene, garments, wearing), cache, divides)
    if otherwise is not None:
        return otherwise
    refuse_twins(scene, garments)
    layers, order = layers_of(scene, garments, skin)
    meshes = with_doubts(scene, cloths)
    return Outfit(meshes, garments, avatar, poses, predraped, wearing, tuple(order), layers=layers)


def _read_as(again: Scene, readings: Sequence[Choice], mesh_cache: MeshCache, divides: bool) -> Outfit | None:
    """The outfit of a scene in which a file that says too little is read otherwise; None: it is not."""
    if not readings:
        return None
    outfit = load_outfit(again, mesh_cache, divides=divides)
    return replace(outfit, readings=(*readings, *outfit.readings))


def load_avatar(scene: Scene) -> Mesh:
    """The avatar of a scene that has one, loaded or generated, in metres.

    Raises:
        InputError: its file cannot be used.
    """
    (recipe,) = avatar_recipe(scene)
    avatar: Mesh = recipe.make(Cache())
    return avatar


def _worn_by(garment: Garment, skeleton: Skeleton) -> Wearing | None:
    rest = garment.rest
    openings = openings_of(rest.topology, garment.triangles, rest.edge_length, len(garment.points))
    wearing = Wearing.of(openings, garment.points, garment.triangles, skeleton) if openings else None
    return wearing if wearing is not None and any(wearing.limbs) else None


def _wearing(
    scene: Scene, garments: Sequence[Garment], keys: Sequence[GarmentKeys], avatar: Mesh | None, mesh_cache: MeshCache
) -> tuple[Wearing | None, ...]:
    """The openings of each garment on a body that does not move, from the cache where they are known in any fabric."""
    if avatar is None:
        return (None,) * len(garments)
    body, skeleton = avatar_recipe(scene)[0].key[1:], wearer_skeleton(scene, avatar, mesh_cache)
    if skeleton is None:
        return (None,) * len(garments)
    return tuple(
        mesh_cache.get(("wearing", *body, *each.geometry[1:]), partial(_worn_by, garment, skeleton))
        for each, garment in zip(keys, garments, strict=True)
    )


def _with_room(scene: Scene, body: Mesh, skeleton: Skeleton | None, mesh_cache: MeshCache) -> Mesh:
    """A body that does not move, its skin yielding where limbs press on it."""
    if skeleton is None:
        return body

    def make() -> Mesh | None:
        points = stored_yielding(body, skeleton)
        if points is None:
            return None  # most bodies; each would be cached twice
        most = 1e3 * float(row_lengths(points - body.points).max())
        return replace(body, points=points, notes=(*body.notes, f"{YIELDS}, by up to {most:.0f} mm"))

    return mesh_cache.get(("yielding", *avatar_recipe(scene)[0].key[1:]), make) or body


def wearer_skeleton(scene: Scene, avatar: Mesh | None, mesh_cache: MeshCache) -> Skeleton | None:
    """The skeleton of a scene's avatar, from the cache where it is known; None: there is none, or it has no limbs."""
    if avatar is None:
        return None
    make = partial(stored_skeleton, avatar)
    return mesh_cache.get(("skeleton", *avatar_recipe(scene)[0].key[1:]), make)


def _garments(
    scene: Scene, meshes: Sequence[Mesh], keys: Sequence[GarmentKeys], mesh_cache: MeshCache
) -> tuple[Garment, ...]:
    """A scene's garments, from the cache where they are known."""
    garments = []
    for index, (mesh, each) in enumerate(zip(meshes, keys, strict=True)):
        rest, pins = _rest_of(scene, index, each, mesh_cache)
        make = partial(Garment, mesh.points, mesh.triangles, rest, pins)
        garments.append(mesh_cache.get(("garment", *each.rest), make))
    return tuple(garments)


def mesh_recipes(scene: Scene) -> list[Recipe]:
    """Recipes of the meshes of a scene's garments, inner to outer, then of its avatar, if it has one."""
    garments = [_mesh_recipe(scene, index, keys) for index, keys in enumerate(_all_keys(scene))]
    return [*garments, *avatar_recipe(scene)]


def _mesh_recipe(scene: Scene, index: int, keys: GarmentKeys) -> Recipe:
    spec, key = scene.garments[index], scene.garment_keys[index]
    return Recipe(keys.mesh, partial(garment_mesh, spec, key, _body(scene), _laid_round(scene, spec)))


def _mesh_of(scene: Scene, index: int, keys: GarmentKeys, mesh_cache: MeshCache) -> Mesh:
    mesh: Mesh = mesh_cache.make(_mesh_recipe(scene, index, keys))
    return mesh


def avatar_recipe(scene: Scene) -> list[Recipe]:
    """The recipe of a scene's avatar mesh; empty without an avatar."""
    if scene.avatar is None:
        return []
    stamp = file_stamp(scene.avatar.mesh)
    key = "avatar", _directory(scene), generated_body(scene), values_of(scene.avatar, MESH_KEYS), stamp
    return [Recipe(key, partial(avatar_mesh, scene.avatar))]


def _laid_round(scene: Scene, spec: GarmentSpec) -> AvatarSpec | None:
    """The avatar whose shape decides where a garment's panels start; None: it does not."""
    return scene.avatar if spec.is_laid_round else None


def _all_keys(scene: Scene) -> list[GarmentKeys]:
    return [garment_keys(scene, index) for index in range(len(scene.garments))]


def garment_keys(scene: Scene, index: int) -> GarmentKeys:
    """Cache keys of a scene's garment."""
    spec, key = scene.garments[index], scene.garment_keys[index]
    common: Key = (_directory(scene), key, str(_body(scene)))
    if _laid_round(scene, spec) is not None:
        common = *common, *avatar_recipe(scene)[0].key[1:]
    stamp = file_stamp(spec.file, spec.grade_table, spec.grain_texture)
    return GarmentKeys(
        ("mesh", *common, values_of(spec, MESH_KEYS), stamp),
        ("geometry", *common, values_of(spec, set(GarmentSpec.model_fields) - FABRIC_KEYS), stamp),
        ("rest", *common, values_of(spec, None), stamp),
    )


def rest_of(scene: Scene, index: int, mesh_cache: MeshCache) -> tuple[RestShape, Indices]:
    """Rest shape and pinned vertices of a scene's garment, from the cache or made and cached.

    Raises:
        InputError: its file, rest shape or pins cannot be used.
    """
    return _rest_of(scene, index, garment_keys(scene, index), mesh_cache)


def geometry_of(scene: Scene, index: int, mesh_cache: MeshCache) -> tuple[Mesh, RestGeometry]:
    """Mesh and rest geometry of a scene's garment, from the cache or made and cached.

    Raises:
        InputError: its file or rest shape cannot be used.
    """
    return _geometry_of(scene, index, garment_keys(scene, index), mesh_cache)


def _rest_of(scene: Scene, index: int, keys: GarmentKeys, mesh_cache: MeshCache) -> tuple[RestShape, Indices]:
    mesh, geometry = _geometry_of(scene, index, keys, mesh_cache)
    spec, key = scene.garments[index], scene.garment_keys[index]
    return mesh_cache.get(keys.rest, partial(rest_and_pins, mesh, geometry, spec, key))


def _geometry_of(scene: Scene, index: int, keys: GarmentKeys, mesh_cache: MeshCache) -> tuple[Mesh, RestGeometry]:
    mesh, spec, key = _mesh_of(scene, index, keys, mesh_cache), scene.garments[index], scene.garment_keys[index]
    return mesh, mesh_cache.get(keys.geometry, partial(rest_geometry, mesh, spec, key))


def _directory(scene: Scene) -> str:
    return str(scene.directory.absolute())


def _body(scene: Scene) -> MannequinMeasures | BodyMeasures | None:
    """The mannequin that generated garments are placed round, or the measures that one is made to have."""
    if scene.avatar is not None and scene.avatar.measures is not None:
        return scene.avatar.measures
    worn_by = scene.avatar.shape if scene.avatar is not None else None
    return mannequin_measures(worn_by) if isinstance(worn_by, MannequinShape) else None


def generated_body(scene: Scene) -> str:
    """A key of the mannequin that a scene's generated meshes are made for; empty without one."""
    return str(_body(scene) or "")
