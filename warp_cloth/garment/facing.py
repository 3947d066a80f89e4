"""Drafted garments brought to a body that stands elsewhere than they were drafted for, or faces another way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.base.choice import Choice
from warp_cloth.garment.reading import TURNED, Value, angle_about_y, is_placed
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
    drafted = [index for index, spec in enumerate(scene.garments) if _is_drafted(spec)]
    if scene.avatar is None or scene.avatar.mesh is None or scene.solver.start == "placed" or not drafted:
        return scene, []
    person = skeleton()
    if person is None or person.up[1] < UPRIGHT:
        return scene, []
    degrees = angle_about_y(np.array([1.0, 0.0, 0.0]), person.left)
    degrees -= 360.0 * round(degrees / 360.0)
    x, _, z = person.middle.tolist()
    floor = float(person.skin[:, 1].min())
    changes: dict[str, tuple[Value, str]] = {}
    if abs(degrees) >= TURNED:
        changes["rotate"] = (0.0, degrees, 0.0), "the body faces another way than it was drafted for"
    if np.hypot(x, z) > FAR or abs(floor) > FAR:
        changes["translate"] = (x, floor, z), "the body stands elsewhere than it was drafted for"
    if not changes:
        return scene, []
    specs, choices = list(scene.garments), []
    for index in drafted:
        key = scene.garment_keys[index]
        specs[index] = specs[index].model_copy(update={name: value for name, (value, _) in changes.items()})
        choices += [Choice(f"{key}.{name}", *change) for name, change in changes.items()]
    return scene.model_copy(update={"garments": tuple(specs)}), choices


def _is_drafted(spec: GarmentSpec) -> bool:
    """Whether it is made round a body of the program's own or of a pattern's, and its author does not place it."""
    stated = bool({"rotate", "translate"} & spec.model_fields_set) or is_placed(spec)
    is_pattern = spec.pattern is not None and not spec.is_laid_round
    return not stated and (is_pattern or isinstance(spec.shape, TshirtShape))
