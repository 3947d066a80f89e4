"""The avatar as the solver meets it: the collider that a scene names, over the region where its garments are."""

from __future__ import annotations

import logging
from copy import copy
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.collide.depth import DEFAULT_REACH, build_depth_buffers, contact_bounds
from warp_cloth.collide.exact import build_exact_collider
from warp_cloth.collide.field import build_contact_field
from warp_cloth.kernels import bake, closest, depth, raster
from warp_cloth.kernels.closest import MeshCollider, mesh_contact
from warp_cloth.kernels.field import ContactField, field_contact
from warp_cloth.mesh import Mesh, Points
from warp_cloth.solver.relax import Collider

log = logging.getLogger(__name__)

# Room that the depth buffers leave round the garments [m]: as far as a garment can fall between two looks (20
# iterations at the default cap of 5 mm). One that comes near the edge has the buffers drawn anew.
MARGIN = 0.15
NEAR_EDGE = 0.04  # of that room, what must be left: more than the field's own reach and support


def avatar_modules(kind: str) -> list[wp.Module]:
    """Kernel modules that building a collider of this kind, and measuring against the exact avatar, launch from."""
    used = (bake, depth, raster, closest) if kind == "depth" else (closest,)
    return [wp.get_module(module.__name__) for module in used]


class AvatarContact:
    """Builds the collider of a scene, and builds it anew when a garment leaves the region that it covers.

    ``kind`` is "depth", "mesh" or "none"; lengths in metres. ``reach``: how far from the avatar contact still answers.
    """

    def __init__(
        self,
        avatar: Mesh | None,
        kind: str,
        *,
        pixel: float,
        offset: float,
        friction: float,
        device: str,
        reach: float = DEFAULT_REACH,
    ) -> None:
        self._avatar = avatar if kind != "none" else None
        self._kind = kind
        self._pixel = pixel
        self._offset = offset
        self._friction = friction
        self._reach = reach
        self._device = device
        self._kept: Any = None  # owns the arrays that the collider points to
        self._box = self._avatar.bounds() if self._avatar is not None else (np.zeros(3), np.zeros(3))
        self._lower = self._upper = np.zeros(3)
        self.builds = 0

    def collider(self, points: Points) -> Collider:
        """The collider for garments at these positions [m], shape [V, 3]."""
        if self._avatar is None:
            return Collider()
        self.builds += 1
        if self._kind == "mesh":
            exact = build_exact_collider(self._avatar, self._device, reach=self._reach)
            self._kept = exact
            return Collider(mesh_contact, exact.collider, MeshCollider, self._offset, self._friction)
        margin = MARGIN * 2.0 ** (self.builds - 1)  # a garment that fell out of it once is still falling
        lower, upper = contact_bounds(points, self._avatar.points, margin)
        self._lower, self._upper = points.min(axis=0) - margin, points.max(axis=0) + margin
        buffers = build_depth_buffers(
            self._avatar.points, self._avatar.triangles, lower, upper, self._pixel, self._device
        )
        field = build_contact_field(buffers, reach=self._reach)
        self._kept = (buffers, field)
        log.info("contact field of %s nodes", " x ".join(str(count) for count in field.values.shape))
        return Collider(field_contact, field.field, ContactField, self._offset, self._friction)

    def alike(self, friction: float) -> AvatarContact:
        """The same contact for another scene: what is built so far is shared, what is built later is its own."""
        other = copy(self)
        other._friction = friction
        return other

    def covers(self, points: Points) -> bool:
        """Whether the collider still answers wherever garments at these positions [m] may touch the avatar."""
        lower, upper = self.room()
        return bool((points.min(axis=0) >= lower).all() and (points.max(axis=0) <= upper).all())

    def room(self) -> tuple[Points, Points]:
        """The box [m] that garments may not leave without a new collider; infinite where they may."""
        if self._avatar is None or self._kind == "mesh":
            return np.full(3, -np.inf), np.full(3, np.inf)
        lower, upper = self._lower + NEAR_EDGE, self._upper - NEAR_EDGE
        # beyond the avatar's own box there is nothing to meet
        return (
            np.where(self._box[0] >= lower, -np.inf, lower),
            np.where(self._box[1] <= upper, np.inf, upper),
        )
