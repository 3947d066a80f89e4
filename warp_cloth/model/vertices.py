"""Model and State of a model's vertices on the device (kernels.base.types): every array of both is made here.

Also in another order of the vertices, as patches own them or as threads of the CPU share them out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.garment.garment import Garment
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.model.upload import upload_concatenated

CONSTANT = ("weight", "pinned", "item")
ITERATED = ("position", "displacement", "stiffness", "compliance", "in_contact", "clearance")


@dataclass(frozen=True)
class AvatarSkin:
    """How an item's avatar meets its cloth."""

    friction: float = 0.0  # Coulomb coefficient
    offset: float = 0.0  # distance that cloth keeps [m]


def build_vertices(
    precision: str,
    garments: Sequence[Garment],
    item_start: Sequence[int],
    avatars: Sequence[AvatarSkin],
    device: str,
) -> Any:
    """What is constant of the vertices of all garments; ``avatars`` of each item."""
    types, count = cloth_types(precision), item_start[-1]
    vertices = types.Model()
    vertices.weight = upload_concatenated(
        [garment.rest.vertex_weight for garment in garments], types.real, device=device
    )
    if any(len(garment.pins) for garment in garments):
        pinned, first = np.zeros(count, dtype=np.uint8), 0
        for garment in garments:
            pinned[garment.pins + first] = 1
            first += len(garment.points)
        vertices.pinned = wp.array(pinned, dtype=wp.uint8, device=device)
    item = np.repeat(np.arange(len(item_start) - 1), np.diff(item_start))
    vertices.item = wp.array(item, dtype=wp.int32, device=device)
    items = np.zeros(len(item_start) - 1, dtype=types.Item.numpy_dtype())
    items["active"] = 1
    items["avatar_friction"] = [each.friction for each in avatars]
    items["offset"] = [each.offset for each in avatars]
    vertices.items = wp.array(items, dtype=types.Item, device=device)
    return vertices


def build_state(precision: str, garments: Sequence[Garment], device: str) -> Any:
    """The vertices of all garments at rest where they are loaded."""
    types = cloth_types(precision)
    state = types.State()
    state.position = upload_concatenated([garment.points for garment in garments], types.point, device=device)
    state.displacement = wp.zeros(len(state.position), dtype=types.vec3, device=device)
    return state


def allocate_steps(
    state: Any, precision: str, *, stiffness: bool, compliance: bool, in_contact: bool, clearance: bool
) -> None:
    """Makes what steps keep of vertices from one to the next, as far as their method does.

    Not with the model: which arrays there are is the method's choice, and several methods may iterate one model in
    turn. Bounds and contact of an earlier method's steps stay as they are.
    """
    types, count, device = cloth_types(precision), len(state.position), state.position.device
    if stiffness and not state.stiffness:
        state.stiffness = wp.zeros(count, dtype=types.real, device=device)
    if in_contact and not state.in_contact:
        state.in_contact = wp.zeros(count, dtype=wp.uint8, device=device)
    if compliance:
        state.compliance = wp.zeros(count, dtype=types.vec6, device=device)
    if clearance:
        state.clearance = wp.zeros(count, dtype=wp.float32, device=device)


def patch_ordered(precision: str, vertices: Any, state: Any, order: wp.array) -> tuple[Any, tuple[Any, Any]]:
    """Model in the order in which patches own vertices, and two States: iterations read one and write the other.

    They share what a thread reads and writes of its own vertex only. Compliance, contact and clearance, which only
    iterations read, lie in the patches' order in the model's own state.
    """
    types, states = cloth_types(precision), []
    stiffness = wp.empty_like(state.stiffness) if state.stiffness else None
    for _ in range(2):
        one = _each(state, ("in_contact", "clearance", "compliance"), lambda array: array)
        one.position = wp.empty_like(state.position)
        one.displacement4 = wp.empty(len(state.position), dtype=types.vec4, device=state.position.device)
        if stiffness is not None:
            one.stiffness = stiffness
        states.append(one)
    ordered = _each(vertices, ("weight", "pinned"), lambda array: array[order].contiguous())
    ordered.item, ordered.items = vertices.item, vertices.items
    return ordered, (states[0], states[1])


def reordered(vertices: Any, state: Any, order: wp.array) -> tuple[Any, Any]:
    """Model with the vertices in another order, and a State with memory of its own, not filled yet."""
    ordered = _each(vertices, CONSTANT, lambda array: array[order].contiguous())
    ordered.items = vertices.items
    return ordered, _each(state, ITERATED, wp.empty_like)


def part_of(vertices: Any, state: Any, span: slice) -> tuple[Any, Any]:
    """Model and State of some vertices, in the same memory."""
    part = _each(vertices, CONSTANT, lambda array: array[span])
    part.items = vertices.items
    return part, _each(state, ITERATED, lambda array: array[span])


def _each(arrays: Any, names: tuple[str, ...], make: Callable[[wp.array], wp.array]) -> Any:
    """A struct of the same kind, with what is made of those arrays that there are."""
    made = arrays._cls()
    for name in names:
        array = getattr(arrays, name)
        if array:
            setattr(made, name, make(array))
    return made
