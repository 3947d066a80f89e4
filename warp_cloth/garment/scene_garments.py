"""From a checked scene to meshes, rest shapes and pins: what is worn, and by whom."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.part import GarmentPart
from warp_cloth.garment.pins import select_pins
from warp_cloth.garment.rest import RestGeometry, RestShape, build_rest_geometry, rest_in_fabric
from warp_cloth.loading import check_sizes, load_mesh, load_poses
from warp_cloth.scene import AvatarSpec, GarmentSpec, MannequinShape, Scene, TshirtShape
from warp_cloth.scene.predrape import dressing_of
from warp_cloth.shapes import MannequinMeasures, build_avatar, build_garment, mannequin_measures

DEFAULT_SIZE = "M"
FABRIC_KEYS = {"fabric", "pin", "name"}  # of a garment, that its rest lengths do not depend on
MESH_KEYS = {"mesh", "shape", "prim", "units", "up", "rest"}  # of a garment or an avatar, that its mesh depends on

T = TypeVar("T")
Key = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Wardrobe:
    """A scene's meshes in metres and what the model needs of each garment, inner to outer."""

    garments: tuple[Mesh, ...]
    parts: tuple[GarmentPart, ...]
    avatar: Mesh | None  # as it stands when the garments are worn
    poses: tuple[Points, ...] = ()  # vertices of an avatar that moves, from where it starts to where it stands [m]
    dressing: tuple[GarmentPart, ...] = ()  # the garments in the fabric that they are dressed in first, if they are

    @property
    def starting_avatar(self) -> Mesh | None:
        """The avatar round which the garments start."""
        return replace(self.avatar, points=self.poses[0]) if self.avatar is not None and self.poses else self.avatar


@dataclass(frozen=True, eq=False)
class Recipe:
    """How something that scenes share is made, and the key under which a rack keeps it."""

    key: Key
    make: Callable[[Cache], Any]  # in any process, with what is kept there of other shapes


class Rack:
    """Keeps what scenes share: meshes, and garments of the same fabric and pins; ``drafts`` of generated shapes."""

    def __init__(self, drafts: Cache | None = None) -> None:
        self._kept: dict[Key, Any] = {}
        self.drafts = drafts or Cache()

    def __contains__(self, key: Key) -> bool:
        return key in self._kept

    def put(self, made: Mapping[Key, Any]) -> None:
        """Keeps what was made elsewhere, and is not here."""
        self._kept = {**made, **self._kept}

    def some(self, keys: Iterable[Key]) -> dict[Key, Any]:
        """What is here of that."""
        return {key: self._kept[key] for key in keys if key in self._kept}

    def made(self, recipe: Recipe) -> Any:
        """What was made by this recipe before, or is made now."""
        return self.once(partial(recipe.make, self.drafts), *recipe.key)

    def once(self, make: Callable[[], T], *key: str) -> T:
        """What was made under this key before, or is made now."""
        if key not in self._kept:
            self._kept[key] = make()
        found: T = self._kept[key]
        return found

    def without(self, known: Iterable[Key]) -> dict[Key, Any]:
        """What is here but for that."""
        return {key: made for key, made in self._kept.items() if key not in set(known)}

    @property
    def vertex_count(self) -> int:
        """Of all meshes that are kept."""
        return sum(made.vertex_count for made in self._kept.values() if isinstance(made, Mesh))


def open_wardrobe(scene: Scene, rack: Rack | None = None) -> Wardrobe:
    """Loads or generates every mesh of a scene and works out the rest shapes; what a rack has is taken from there.

    Raises:
        InputError: a file, a rest shape or a pin that cannot be used.
    """
    kept = rack or Rack()
    meshes = [kept.made(recipe) for recipe in mesh_recipes(scene)]
    garments, avatar = tuple(meshes[: len(scene.garments)]), meshes[-1] if scene.avatar is not None else None
    check_sizes(list(zip(scene.garment_keys, garments, strict=True)), avatar)
    parts, dressing = _parts(scene, garments, kept), dressing_of(scene)
    poses: tuple[Points, ...] = ()
    if avatar is not None and scene.avatar is not None and scene.avatar.poses:
        files = () if scene.avatar.poses == "samples" else scene.avatar.poses
        keys = *avatar_recipe(scene)[0].key, _worked(scene.avatar, {"poses"}), _file_mark(*files)
        avatar, poses = kept.once(partial(_posed, scene.avatar, avatar), "posed", *keys)
    return Wardrobe(garments, parts, avatar, poses, () if dressing is None else _parts(dressing, garments, kept))


def _parts(scene: Scene, garments: Sequence[Mesh], rack: Rack) -> tuple[GarmentPart, ...]:
    """What the model needs of each garment."""
    parts = []
    for index, mesh in enumerate(garments):
        keys = garment_keys(scene, index)
        rest, pins = _rest_of(scene, index, keys, rack)
        parts.append(rack.once(partial(GarmentPart, mesh.points, mesh.triangles, rest, pins), "part", *keys[2]))
    return tuple(parts)


def mesh_recipes(scene: Scene) -> list[Recipe]:
    """How to load or generate the meshes of a scene's garments, inner to outer, then of its avatar."""
    body = _body(scene)
    recipes = [
        Recipe(garment_keys(scene, index)[0], partial(_garment_mesh, spec, key, body))
        for index, (spec, key) in enumerate(zip(scene.garments, scene.garment_keys, strict=True))
    ]
    return [*recipes, *avatar_recipe(scene)]


def avatar_recipe(scene: Scene) -> list[Recipe]:
    """How to load or generate a scene's avatar; empty where it has none."""
    if scene.avatar is None:
        return []
    mark = _file_mark(scene.avatar.mesh)
    key = "avatar", _where(scene), generated_body(scene), _worked(scene.avatar, MESH_KEYS), mark
    return [Recipe(key, partial(_avatar_mesh, scene.avatar, worn_size(scene)))]


def garment_keys(scene: Scene, index: int) -> tuple[Key, Key, Key]:
    """Under which a rack keeps a garment's mesh, its rest shape in every fabric, and that in its own, with pins."""
    spec, key = scene.garments[index], scene.garment_keys[index]
    told = _where(scene), key, str(_body(scene))
    mark = _file_mark(spec.mesh, spec.grain_texture)
    return (
        ("mesh", *told, _worked(spec, MESH_KEYS), mark),
        ("geometry", *told, _worked(spec, set(GarmentSpec.model_fields) - FABRIC_KEYS), mark),
        ("rest", *told, _worked(spec, None), mark),
    )


def rest_of(scene: Scene, index: int, rack: Rack) -> tuple[RestShape, Indices]:
    """Rest shape and pins of a scene's garment, inner to outer; what the rack lacks is made and put there.

    Raises:
        InputError: its file, rest shape or pins cannot be used.
    """
    return _rest_of(scene, index, garment_keys(scene, index), rack)


def geometry_of(scene: Scene, index: int, rack: Rack) -> tuple[Mesh, RestGeometry]:
    """Mesh and rest geometry of a scene's garment, likewise."""
    return _geometry_of(scene, index, garment_keys(scene, index), rack)


def _rest_of(scene: Scene, index: int, keys: tuple[Key, Key, Key], rack: Rack) -> tuple[RestShape, Indices]:
    mesh, geometry = _geometry_of(scene, index, keys, rack)
    return rack.once(partial(_rest, mesh, geometry, scene.garments[index], scene.garment_keys[index]), *keys[2])


def _geometry_of(scene: Scene, index: int, keys: tuple[Key, Key, Key], rack: Rack) -> tuple[Mesh, RestGeometry]:
    spec, key = scene.garments[index], scene.garment_keys[index]
    mesh_key, geometry_key, _ = keys
    mesh = rack.once(partial(_garment_mesh, spec, key, _body(scene), rack.drafts), *mesh_key)
    return mesh, rack.once(partial(_geometry, mesh, spec, key), *geometry_key)


def _where(scene: Scene) -> str:
    return str(scene.directory.absolute())


def _body(scene: Scene) -> MannequinMeasures | None:
    """The mannequin that generated garments are placed round."""
    worn_by = scene.avatar.shape if scene.avatar is not None else None
    return mannequin_measures(worn_by, size=worn_size(scene)) if isinstance(worn_by, MannequinShape) else None


def generated_body(scene: Scene) -> str:
    """The mannequin that a scene's generated meshes are made for, told apart from others; empty where there is none."""
    return str(_body(scene) or "")


def _file_mark(*paths: Path | None) -> str:
    """Size and time of the files that something is made from, which may change while a rack is kept."""
    marks = []
    for path in paths:
        with contextlib.suppress(OSError, ValueError):  # what is not there is told when it is read
            status = os.stat(path) if path is not None else None
            marks.append(f"{status.st_size} {status.st_mtime_ns}" if status is not None else "")
    return " ".join(marks)


def _posed(spec: AvatarSpec, avatar: Mesh) -> tuple[Mesh, tuple[Points, ...]]:
    """A loaded avatar that moves in its last pose, and its vertices in each, also in that as loaded [m]."""
    if spec.mesh is None:
        return avatar, ()
    later = load_poses(avatar, spec.mesh, spec.poses, prim=spec.prim, units=spec.units, up=spec.up)
    return replace(avatar, points=later[-1]), (avatar.points, *later)


def _worked(spec: GarmentSpec | AvatarSpec, keys: set[str] | None) -> str:
    """The values that a mesh or a garment is made from, as a text."""
    return spec.model_dump_json(include=keys, exclude={"name"})


def _geometry(mesh: Mesh, spec: GarmentSpec, key: str) -> RestGeometry:
    place = key if spec.mesh is None else str(spec.mesh)
    grain = Grain(spec.grain_degrees, spec.grain_panels, spec.grain_texture)
    return build_rest_geometry(
        mesh,
        rest=spec.rest,
        metres_per_uv=spec.uv_metres,
        grain=grain,
        rest_angles=spec.rest_angles,
        place=place,
        key=key,
    )


def _rest(mesh: Mesh, geometry: RestGeometry, spec: GarmentSpec, key: str) -> tuple[RestShape, Indices]:
    rest = rest_in_fabric(geometry, mesh.vertex_count, spec.fabric)
    pins = select_pins(mesh, spec.pin, f"{key}.pin")
    if len(pins) == mesh.vertex_count:
        raise InputError(f"{key}.pin", "every vertex is pinned, so nothing can move", "pin fewer vertices")
    return rest, pins


def _garment_mesh(spec: GarmentSpec, key: str, body: MannequinMeasures | None, drafts: Cache) -> Mesh:
    if spec.mesh is not None:
        return load_mesh(
            spec.mesh, role="garment", key=key, prim=spec.prim, units=spec.units, up=spec.up, rest=spec.rest
        )
    return build_garment(spec.shape, body=body, cache=drafts)


def _avatar_mesh(spec: AvatarSpec, size: str, drafts: Cache) -> Mesh:
    if spec.mesh is not None:
        return load_mesh(spec.mesh, role="avatar", key="avatar", prim=spec.prim, units=spec.units, up=spec.up)
    return build_avatar(spec.shape, size=size, cache=drafts)


def worn_size(scene: Scene) -> str:
    """The size whose standard body fills in the mannequin's measures: the innermost sized garment's."""
    sizes = [garment.shape.size for garment in scene.garments if isinstance(garment.shape, TshirtShape)]
    return sizes[0] if sizes else DEFAULT_SIZE
