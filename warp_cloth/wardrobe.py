"""From a checked scene to meshes, rest shapes and pins: what is worn, and by whom."""

from __future__ import annotations

from dataclasses import dataclass

from warp_cloth.errors import InputError
from warp_cloth.loading import check_sizes, load_mesh
from warp_cloth.mesh import Mesh
from warp_cloth.model import GarmentPart
from warp_cloth.pins import select_pins
from warp_cloth.rest import build_rest_shape
from warp_cloth.scene import (
    AvatarSpec,
    GarmentSpec,
    MannequinShape,
    Scene,
    SphereShape,
    SquareShape,
    TshirtShape,
)
from warp_cloth.shapes.mannequin import mannequin
from warp_cloth.shapes.measures import SIZE_BODIES, MannequinMeasures
from warp_cloth.shapes.simple import sphere, square
from warp_cloth.shapes.tshirt import tshirt

DEFAULT_SIZE = "M"


@dataclass(frozen=True, eq=False)
class Wardrobe:
    """A scene's meshes in metres and what the model needs of each garment, inner to outer."""

    garments: tuple[Mesh, ...]
    parts: tuple[GarmentPart, ...]
    avatar: Mesh | None


def open_wardrobe(scene: Scene) -> Wardrobe:
    """Loads or generates every mesh of a scene and works out the rest shapes.

    Raises:
        InputError: a file, a rest shape or a pin that cannot be used.
    """
    body = _body_measures(scene)
    garments = tuple(
        _garment_mesh(spec, key, body) for spec, key in zip(scene.garments, scene.garment_keys, strict=True)
    )
    avatar = _avatar_mesh(scene.avatar, body) if scene.avatar is not None else None
    check_sizes(list(zip(scene.garment_keys, garments, strict=True)), avatar)
    parts = tuple(
        _part(mesh, spec, key) for mesh, spec, key in zip(garments, scene.garments, scene.garment_keys, strict=True)
    )
    return Wardrobe(garments, parts, avatar)


def _part(mesh: Mesh, spec: GarmentSpec, key: str) -> GarmentPart:
    rest = build_rest_shape(mesh, spec.fabric, rest=spec.rest, metres_per_uv=spec.uv_metres, place=key)
    pins = select_pins(mesh, spec.pin, f"{key}.pin")
    if len(pins) == mesh.vertex_count:
        raise InputError(f"{key}.pin", "every vertex is pinned, so nothing can move", "pin fewer vertices")
    return GarmentPart(mesh.points, mesh.triangles, rest, pins)


def _garment_mesh(spec: GarmentSpec, key: str, body: MannequinMeasures | None) -> Mesh:
    if spec.mesh is not None:
        return load_mesh(spec.mesh, role="garment", key=key, prim=spec.prim, units=spec.units, rest=spec.rest)
    shape = spec.shape
    if isinstance(shape, TshirtShape):
        return tshirt(size=shape.size, edge=shape.edge_mm * 1e-3, body=body)
    if isinstance(shape, SquareShape):
        return square(
            side=shape.side,
            vertices_per_side=shape.vertices_per_side,
            height=shape.height,
            plane=shape.plane,
        )
    raise TypeError(f"no generator for {shape!r}")


def _avatar_mesh(spec: AvatarSpec, body: MannequinMeasures | None) -> Mesh:
    if spec.mesh is not None:
        return load_mesh(spec.mesh, role="avatar", key="avatar", prim=spec.prim, units=spec.units)
    shape = spec.shape
    if isinstance(shape, SphereShape):
        return sphere(radius=shape.radius, centre=shape.centre, edge=shape.edge_mm * 1e-3)
    if isinstance(shape, MannequinShape):
        return mannequin(body)
    raise TypeError(f"no generator for {shape!r}")


def _body_measures(scene: Scene) -> MannequinMeasures | None:
    """The mannequin's measures; what is left out is that of the worn size's standard body. None: no mannequin."""
    shape = scene.avatar.shape if scene.avatar is not None else None
    if not isinstance(shape, MannequinShape):
        return None
    sizes = [garment.shape.size for garment in scene.garments if isinstance(garment.shape, TshirtShape)]
    standard = SIZE_BODIES[sizes[0] if sizes else DEFAULT_SIZE]
    return MannequinMeasures(
        stature=standard.stature if shape.stature is None else shape.stature,
        chest=standard.chest if shape.chest is None else shape.chest,
        waist=standard.waist if shape.waist is None else shape.waist,
        hip=standard.hip if shape.hip is None else shape.hip,
        arm_angle=shape.arm_angle_degrees,
    )
