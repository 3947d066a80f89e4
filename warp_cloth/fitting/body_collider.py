"""Colliders of a body that moves within a garment."""

from __future__ import annotations

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.depth import DEFAULT_REACH, contact_bounds
from warp_cloth.avatar.field import FieldBuild, build_contact_field
from warp_cloth.avatar.layers import build_layered_buffers
from warp_cloth.base.mesh import Indices, Points
from warp_cloth.kernels.avatar.field import ContactField, field_contact

PIXEL = 0.006  # [m] of the body's layers; with 4 mm a start takes twice as long
MARGIN = 0.06  # [m] around the garment, within which the body is drawn


class BodyCollider:
    """Colliders of a body that moves, drawn in layers since limbs lie before each other; the last one is kept."""

    def __init__(self, triangles: Indices, device: str, offset: float) -> None:
        self._triangles, self._device, self._offset = triangles, device, offset
        self._built: list[FieldBuild] = []

    def of(self, surface: Points, cloth: Points) -> Collider:
        """The collider of a body with these vertices, near cloth at these points [m]."""
        bounds = contact_bounds(cloth, surface, MARGIN)
        buffers = build_layered_buffers(surface, self._triangles, *bounds, PIXEL, self._device)
        field = build_contact_field(buffers, reach=DEFAULT_REACH)
        self._built = [*self._built[-1:], field]  # the one before is in use until the new one is set
        return Collider(field_contact, field.limited_to(self._offset, 0.0), ContactField)
