"""From a checked scene to meshes, rest shapes and pins: what is worn, and by whom."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from warp_cloth.errors import InputError
from warp_cloth.grain import Grain
from warp_cloth.loading import check_sizes, load_mesh, load_poses
from warp_cloth.mesh import Mesh, Points
from warp_cloth.model import GarmentPart
from warp_cloth.pins import select_pins
from warp_cloth.rest import build_rest_shape
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


class Rack:
    """Keeps what scenes share: meshes, and garments of the same fabric and pins."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, ...], Any] = {}

    def once(self, make: Callable[[], T], *key: str) -> T:
        """What was made under this key before, or is made now."""
        if key not in self._kept:
            self._kept[key] = make()
        found: T = self._kept[key]
        return found


def open_wardrobe(scene: Scene, rack: Rack | None = None) -> Wardrobe:
    """Loads or generates every mesh of a scene and works out the rest shapes; what a rack has is taken from there.

    Raises:
        InputError: a file, a rest shape or a pin that cannot be used.
    """
    kept = rack or Rack()
    size = worn_size(scene)
    worn_by = scene.avatar.shape if scene.avatar is not None else None
    body = mannequin_measures(worn_by, size=size) if isinstance(worn_by, MannequinShape) else None
    where = str(scene.directory.absolute())
    named = list(zip(scene.garments, scene.garment_keys, strict=True))
    fitted_to = str(body)
    garments = tuple(
        kept.once(partial(_garment_mesh, spec, key, body), "mesh", where, key, fitted_to, _worked(spec, MESH_KEYS))
        for spec, key in named
    )
    avatar = None
    if scene.avatar is not None:
        spec = scene.avatar
        avatar = kept.once(lambda: _avatar_mesh(spec, size), "avatar", where, size, _worked(spec, MESH_KEYS))
    check_sizes(list(zip(scene.garment_keys, garments, strict=True)), avatar)
    parts = tuple(
        kept.once(partial(_part, mesh, spec, key), "part", where, key, fitted_to, _worked(spec, None))
        for mesh, (spec, key) in zip(garments, named, strict=True)
    )
    poses = _poses(scene.avatar, avatar)
    if avatar is not None and poses:
        avatar = replace(avatar, points=poses[-1])
    return Wardrobe(garments, parts, avatar, poses)


def _poses(spec: AvatarSpec | None, avatar: Mesh | None) -> tuple[Points, ...]:
    """Vertices of an avatar that moves, in each of its poses; none where it does not move."""
    if spec is None or avatar is None or spec.mesh is None or not spec.poses:
        return ()
    return (avatar.points, *load_poses(avatar, spec.mesh, spec.poses, prim=spec.prim, units=spec.units))


def _worked(spec: GarmentSpec | AvatarSpec, keys: set[str] | None) -> str:
    """The values that a mesh or a garment is made from, as a text."""
    return spec.model_dump_json(include=keys, exclude={"name"})


def _part(mesh: Mesh, spec: GarmentSpec, key: str) -> GarmentPart:
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
    return GarmentPart(mesh.points, mesh.triangles, rest, pins)


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
