"""From a checked scene to meshes, rest shapes and pins: what is worn, and by whom."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from warp_cloth.errors import InputError
from warp_cloth.grain import Grain
from warp_cloth.loading import check_sizes, load_mesh, load_poses
from warp_cloth.mesh import Indices, Mesh, Points
from warp_cloth.model import GarmentPart
from warp_cloth.pins import select_pins
from warp_cloth.rest import RestShape, build_rest_shape
from warp_cloth.scene import AvatarSpec, GarmentSpec, MannequinShape, Scene, TshirtShape
from warp_cloth.shapes import MannequinMeasures, build_avatar, build_garment, mannequin_measures

DEFAULT_SIZE = "M"
MESH_KEYS = {"mesh", "shape", "prim", "units", "rest"}  # of a garment or an avatar, that its mesh depends on

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Wardrobe:
    """A scene's meshes in metres and what the model needs of each garment, inner to outer."""

    garments: tuple[Mesh, ...]
    parts: tuple[GarmentPart, ...]
    avatar: Mesh | None  # as it stands when the garments are worn
    poses: tuple[Points, ...] = ()  # vertices of an avatar that moves, from where it starts to where it stands [m]

    @property
    def starting_avatar(self) -> Mesh | None:
        """The avatar round which the garments start."""
        return replace(self.avatar, points=self.poses[0]) if self.avatar is not None and self.poses else self.avatar


@dataclass(frozen=True, eq=False)
class Recipe:
    """How something that scenes share is made, and the key under which a rack keeps it."""

    key: tuple[str, ...]
    make: Callable[[], Any]  # in any process


class Rack:
    """Keeps what scenes share: meshes, and garments of the same fabric and pins."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, ...], Any] = {}

    def __contains__(self, key: tuple[str, ...]) -> bool:
        return key in self._kept

    def put(self, key: tuple[str, ...], made: Any) -> None:
        """Keeps what was made elsewhere."""
        self._kept[key] = made

    def made(self, recipe: Recipe) -> Any:
        """What was made by this recipe before, or is made now."""
        return self.once(recipe.make, *recipe.key)

    def once(self, make: Callable[[], T], *key: str) -> T:
        """What was made under this key before, or is made now."""
        if key not in self._kept:
            self._kept[key] = make()
        found: T = self._kept[key]
        return found

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
    parts = []
    for mesh, recipe in zip(garments, rest_recipes(scene, garments), strict=True):
        rest, pins = kept.made(recipe)
        parts.append(kept.once(partial(GarmentPart, mesh.points, mesh.triangles, rest, pins), "part", *recipe.key))
    poses = _poses(scene.avatar, avatar)
    if avatar is not None and poses:
        avatar = replace(avatar, points=poses[-1])
    return Wardrobe(garments, tuple(parts), avatar, poses)


def mesh_recipes(scene: Scene) -> list[Recipe]:
    """How to load or generate the meshes of a scene's garments, inner to outer, then of its avatar."""
    size, body, where = worn_size(scene), _body(scene), _where(scene)
    recipes = [
        Recipe(
            ("mesh", where, key, str(body), _worked(spec, MESH_KEYS), _file_mark(spec)),
            partial(_garment_mesh, spec, key, body),
        )
        for spec, key in zip(scene.garments, scene.garment_keys, strict=True)
    ]
    if scene.avatar is not None:
        key = "avatar", where, size, _worked(scene.avatar, MESH_KEYS), _file_mark(scene.avatar)
        recipes.append(Recipe(key, partial(_avatar_mesh, scene.avatar, size)))
    return recipes


def rest_recipes(scene: Scene, meshes: Sequence[Mesh]) -> list[Recipe]:
    """How to work out rest shape and pins of a scene's garments, which have these meshes."""
    body, where = str(_body(scene)), _where(scene)
    return [
        Recipe(("rest", where, key, body, _worked(spec, None), _file_mark(spec)), partial(_rest, mesh, spec, key))
        for mesh, spec, key in zip(meshes, scene.garments, scene.garment_keys, strict=True)
    ]


def _where(scene: Scene) -> str:
    return str(scene.directory.absolute())


def _body(scene: Scene) -> MannequinMeasures | None:
    """The mannequin that generated garments are placed round."""
    worn_by = scene.avatar.shape if scene.avatar is not None else None
    return mannequin_measures(worn_by, size=worn_size(scene)) if isinstance(worn_by, MannequinShape) else None


def _file_mark(spec: GarmentSpec | AvatarSpec) -> str:
    """Size and time of the files that a mesh or garment is made from, which may change while a rack is kept."""
    marks = []
    for path in (spec.mesh, getattr(spec, "grain_texture", None)):
        with contextlib.suppress(OSError, ValueError):  # what is not there is told when it is read
            status = os.stat(path) if path is not None else None
            marks.append(f"{status.st_size} {status.st_mtime_ns}" if status is not None else "")
    return " ".join(marks)


def _poses(spec: AvatarSpec | None, avatar: Mesh | None) -> tuple[Points, ...]:
    """Vertices of an avatar that moves, in each of its poses; none where it does not move."""
    if spec is None or avatar is None or spec.mesh is None or not spec.poses:
        return ()
    return (avatar.points, *load_poses(avatar, spec.mesh, spec.poses, prim=spec.prim, units=spec.units))


def _worked(spec: GarmentSpec | AvatarSpec, keys: set[str] | None) -> str:
    """The values that a mesh or a garment is made from, as a text."""
    return spec.model_dump_json(include=keys, exclude={"name"})


def _rest(mesh: Mesh, spec: GarmentSpec, key: str) -> tuple[RestShape, Indices]:
    place = key if spec.mesh is None else str(spec.mesh)
    grain = Grain(spec.grain_degrees, spec.grain_panels, spec.grain_texture)
    rest = build_rest_shape(
        mesh,
        spec.fabric,
        rest=spec.rest,
        metres_per_uv=spec.uv_metres,
        grain=grain,
        rest_angles=spec.rest_angles,
        place=place,
        key=key,
    )
    pins = select_pins(mesh, spec.pin, f"{key}.pin")
    if len(pins) == mesh.vertex_count:
        raise InputError(f"{key}.pin", "every vertex is pinned, so nothing can move", "pin fewer vertices")
    return rest, pins


def _garment_mesh(spec: GarmentSpec, key: str, body: MannequinMeasures | None) -> Mesh:
    if spec.mesh is not None:
        return load_mesh(spec.mesh, role="garment", key=key, prim=spec.prim, units=spec.units, rest=spec.rest)
    return build_garment(spec.shape, body=body)


def _avatar_mesh(spec: AvatarSpec, size: str) -> Mesh:
    if spec.mesh is not None:
        return load_mesh(spec.mesh, role="avatar", key="avatar", prim=spec.prim, units=spec.units)
    return build_avatar(spec.shape, size=size)


def worn_size(scene: Scene) -> str:
    """The size whose standard body fills in the mannequin's measures: the innermost sized garment's."""
    sizes = [garment.shape.size for garment in scene.garments if isinstance(garment.shape, TshirtShape)]
    return sizes[0] if sizes else DEFAULT_SIZE
