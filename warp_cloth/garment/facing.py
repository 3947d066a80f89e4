"""Garments brought to a body that stands elsewhere than they were drafted for, or faces another way."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.base.choice import Choice
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.garment.reading import TURNED, Value, angle_about_y, is_placed
from warp_cloth.loading import Placement, lies_apart
from warp_cloth.scene import GarmentSpec, Scene, TshirtShape

UPRIGHT = 0.7  # cosine between a trunk and y, from which on a body stands or sits
# [m] from where the wearer is drafted, from which on a body stands elsewhere; a nearer one is dressed from there
FAR = 0.5


def brought_to_wearer(scene: Scene, skeleton: Callable[[], Skeleton | None]) -> tuple[Scene, list[Choice]]:
    """The scene with drafted garments turned and moved onto the body, and why; else the same scene.

    Patterns and the T-shirt are drafted round who stands on the origin and faces +z, so that where the body stands is
    all that there is to be known. What is loaded as a mesh may have been modelled where it is. What the author states
    of a garment's place stays.
    """
    if not _may_bring(scene):  # before patterns' files are looked into
        return scene, []
    origins = {index: np.zeros(3) for index, spec in enumerate(scene.garments) if _is_drafted(spec)}
    return _brought(scene, origins, skeleton, FAR)


def brought_from_afar(
    scene: Scene,
    garments: Sequence[tuple[str, Mesh]],
    avatar: Mesh | None,
    skeleton: Callable[[], Skeleton | None],
) -> tuple[Scene, list[Choice]]:
    """The same of meshes of a fitting size that lie too far from the body in any unit: as far as to be of no use."""
    origins: dict[int, Points] = {}
    if avatar is None or not _may_bring(scene):
        return scene, []
    for index, (spec, (key, mesh)) in enumerate(zip(scene.garments, garments, strict=True)):
        is_open = spec.mesh is not None and spec.units is None and not is_placed(spec)  # a unit may be stated wrong
        if is_open and lies_apart(key, mesh, avatar):
            low, high = mesh.bounds()
            origins[index] = 0.5 * (low + high) * [1.0, 0.0, 1.0]
    return _brought(scene, origins, skeleton, 0.0)


def _brought(
    scene: Scene, origins: Mapping[int, Points], skeleton: Callable[[], Skeleton | None], far: float
) -> tuple[Scene, list[Choice]]:
    """Garments with their origins [m], by number, where a body stands that is as ``far`` from there [m], or farther."""
    person = skeleton() if origins else None
    if person is None or person.up[1] < UPRIGHT:
        return scene, []
    degrees = angle_about_y(np.array([1.0, 0.0, 0.0]), person.left)
    degrees -= 360.0 * round(degrees / 360.0)
    turn = Placement(rotate=(0.0, degrees, 0.0)) if abs(degrees) >= TURNED else Placement()
    place = np.array([person.middle[0], person.extremes[:, 1].min(), person.middle[2]])
    specs, choices = list(scene.garments), []
    for index, origin in origins.items():
        changes: dict[str, tuple[Value, str]] = {}
        if any(turn.rotate):
            changes["rotate"] = turn.rotate, "the body faces another way than it was drafted for"
        off = place - origin
        if np.hypot(off[0], off[2]) > far or abs(off[1]) > far:
            x, y, z = (place - turn.moved(origin)).tolist()
            changes["translate"] = (x, y, z), "the body stands elsewhere than it was drafted for"
        key = scene.garment_keys[index]
        specs[index] = specs[index].model_copy(update={name: value for name, (value, _) in changes.items()})
        choices += [Choice(f"{key}.{name}", *change) for name, change in changes.items()]
    return (scene.model_copy(update={"garments": tuple(specs)}) if choices else scene), choices


def _may_bring(scene: Scene) -> bool:
    """Whether the body is one that is not the program's own, and garments need not start where they are placed."""
    return scene.avatar is not None and scene.avatar.mesh is not None and scene.solver.start != "placed"


def _is_drafted(spec: GarmentSpec) -> bool:
    """Whether it is made round a body of the program's own or of a pattern's, and its author does not place it."""
    if is_placed(spec):
        return False
    return isinstance(spec.shape, TshirtShape) or (spec.pattern is not None and not spec.is_laid_round)
