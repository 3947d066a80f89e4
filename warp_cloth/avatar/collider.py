"""The avatar as the solver meets it: the collider that a scene names, over the region where its garments are."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from copy import copy
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.depth import DEFAULT_REACH, DepthBuffers, build_depth_buffers, contact_bounds
from warp_cloth.avatar.error import NearSurface, Sampled, contact_error, near_surface, unseen_share
from warp_cloth.avatar.exact import ExactCollider, build_exact_collider, tree_bytes
from warp_cloth.avatar.field import FieldBuild, bake_modules, build_contact_field
from warp_cloth.avatar.layers import LayeredBuffers, build_layered_buffers
from warp_cloth.avatar.solid import Closing, Solid, solid_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.kernels.avatar import closest, depth, layers, raster
from warp_cloth.kernels.avatar import visibility as audit
from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.kernels.avatar.depth import DepthSolid, plain_contact
from warp_cloth.kernels.avatar.field import ContactField, field_contact
from warp_cloth.solver.relax import Collider

log = logging.getLogger(__name__)

# Room that the depth buffers leave round the garments [m]: as far as a garment can fall between two looks (20
# iterations at the default cap of 5 mm). One that comes near the edge has the buffers drawn anew.
MARGIN = 0.15
NEAR_EDGE = 0.04  # of that room, what must be left: more than the field's own reach and support
FARTHER = 1.5  # times the reach of a contact that another one outgrew
ROOM_TO_MOVE = 0.007  # [m] beyond the offset that contact must know: what cloth moves by in one iteration, and more
HELD, FREE = 0.02, 0.06  # [m] from a skin that moves: nearer than this cloth goes with it, farther off not at all
FINER = 0.5  # factor on the pixel where all layers at the scene's own are not enough
DRAWN = ("depth", "plain", "auto")  # colliders that are drawn over a region


def avatar_modules(kind: str) -> list[wp.Module]:
    """Kernel modules that building a collider of this kind, and measuring against the exact avatar, launch from."""
    used = [closest, audit]
    if kind in DRAWN:
        used += [depth, raster]
    if kind == "auto":
        used += [layers]
    modules = [wp.get_module(module.__name__) for module in used]
    if kind in ("depth", "auto"):
        modules += bake_modules(DepthBuffers)
    if kind == "auto":
        modules += bake_modules(LayeredBuffers)
    return modules


@dataclass(frozen=True)
class Drawing:
    """How the avatar is drawn: with all layers or the paper's three buffers, and the pixel [m]."""

    layered: bool
    pixel: float


Report = dict[str, Any] | None


class _Later:
    """A report that is made when it is first asked for, and lets go of what it is made of."""

    def __init__(self, make: Callable[[], Report]) -> None:
        self._make: Callable[[], Report] | None = make
        self._made: Report = None

    def told(self) -> Report:
        if self._make is not None:
            self._made, self._make = self._make(), None
        return self._made


class AvatarContact:
    """Builds the collider of a scene, and builds it anew when a garment leaves the region that it covers.

    ``kind`` is "depth", "plain", "auto", "mesh" or "none"; lengths in metres. ``error`` is the distance error that
    "auto" stays within at 99.9 % of the surface that the garment can reach. ``reach``: how far from the avatar
    contact answers at least; what it exceeds the default by, cloth may be lifted beyond the offset. ``solid`` is the
    avatar's, where that is known already.
    """

    def __init__(
        self,
        avatar: Mesh | None,
        kind: str,
        *,
        pixel: float,
        offset: float,
        friction: float,
        error: float,
        device: str,
        reach: float = DEFAULT_REACH,
        solid: Solid | None = None,
        place: str = "avatar",
    ) -> None:
        self._given = avatar
        self._closing: Closing | None = None
        self._avatar = (
            self._enclosed(solid or solid_of(avatar), kind, place) if avatar is not None and kind != "none" else None
        )
        self._kind = kind
        self._offset = offset
        self._reach = max(reach, offset + ROOM_TO_MOVE)
        self._lift = max(reach - DEFAULT_REACH, 0.0)
        self._friction = friction
        self._error = error
        self._device = device
        self._kept: Any = None  # owns the arrays that the collider points to
        self._box = self._avatar.bounds() if self._avatar is not None else (np.zeros(3), np.zeros(3))
        self._lower = self._upper = np.zeros(3)
        drawings = [Drawing(False, pixel), Drawing(True, pixel), Drawing(True, FINER * pixel)]
        self._drawings = drawings if kind == "auto" else drawings[:1]  # those not found wanting yet
        self._wanting: list[Drawing] = []  # the others
        self.builds = 0
        self._report = _Later(lambda: None)

    @property
    def report(self) -> Report:
        """What the last audited build was, and how good; measured when it is first asked for, or to choose."""
        return self._report.told()

    def _enclosed(self, solid: Solid, kind: str, place: str) -> Mesh:
        if solid.closing.encloses:
            self._closing = solid.closing
        elif kind in DRAWN:
            problem = "its surface encloses nothing, or only a sheet"
            raise InputError(place, problem, 'close it, or use collision.avatar = "mesh"')
        return solid.mesh

    def collider(self, points: Points, *, audited: bool = True) -> Collider:
        """The collider for garments at these positions [m], shape [V, 3].

        ``audited`` lets the report measure it against the exact mesh, and "auto" choose.
        """
        if self._avatar is None:
            return Collider()
        self.builds += audited
        if self._kind == "mesh":
            exact = build_exact_collider(self._avatar, self._device, reach=self._reach)
            self._kept = exact
            drawn: dict[str, Any] = {"buffers": [], "triangles": self._avatar.triangle_count, **self._mended()}
            self._report = _Later(lambda: drawn)
            return self._collider(mesh_contact, exact.collider, MeshCollider)
        margin = MARGIN * 2.0 ** max(self.builds - 1, 0)  # a garment that fell out of it once is still falling
        lower, upper = contact_bounds(points, self._avatar.points, margin)
        self._lower, self._upper = points.min(axis=0) - margin, points.max(axis=0) + margin
        self._kept = None  # its memory serves the next
        if not audited:
            self._report.told()  # which holds on to it
            while True:
                try:
                    return self._drawn_within(self._avatar, lower, upper)
                except InputError:
                    self._draw_coarser()
        self._report = _Later(lambda: None)
        exact = build_exact_collider(self._avatar, self._device, reach=self._reach)
        surface = functools.cache(
            functools.partial(near_surface, self._avatar, exact, points, lower + NEAR_EDGE, upper - NEAR_EDGE)
        )
        found = None
        while True:
            try:
                found = self._drawn_within(self._avatar, lower, upper)
            except InputError:
                self._draw_coarser()
                if found is not None:
                    return found
                continue
            buffers, sampled = self._kept
            self._report = _Later(functools.partial(self._audit, buffers, sampled, exact, surface))
            if len(self._drawings) == 1 or self._close_enough():
                return found
            self._drawings, self._wanting = self._drawings[1:], [*self._wanting, self._drawings[0]]

    def _close_enough(self) -> bool:
        """Whether what is drawn stays within the error that is sought."""
        report = self.report
        return report is not None and bool(report["error_mm"]["p999"] <= 1e3 * self._error)

    def _draw_coarser(self) -> None:
        """Goes back, in an exception's handler, to the drawing before, where one is too fine for the region."""
        if not self._wanting:
            raise
        log.info("a pixel of %.2g mm is too fine for the region", 1e3 * self._drawings[0].pixel)
        self._drawings, self._wanting = [self._wanting[-1], *self._drawings], self._wanting[:-1]

    def taken_over(self, earlier: AvatarContact, points: Points) -> Collider | None:
        """The collider that another scene's contact has built, where it serves garments at these positions [m], too.

        That is a field of the same avatar, drawn the same way, that reaches as far; offset and friction are this one's.
        """
        field = earlier._kept[1] if isinstance(earlier._kept, tuple) else None
        same = (
            earlier._given is self._given
            and (earlier._kind, earlier._error, earlier._device) == (self._kind, self._error, self._device)
            and (earlier._drawings[-1], earlier._lift) == (self._drawings[-1], self._lift)
        )
        if same and earlier._reach < self._reach:  # offsets that grow once may grow on
            self._reach, same = max(self._reach, FARTHER * earlier._reach), False
        if not same or not isinstance(field, FieldBuild) or not earlier.covers(points):
            return None
        self._kept, self._drawings, self.builds = earlier._kept, earlier._drawings, earlier.builds
        self._wanting = earlier._wanting
        self._lower, self._upper, self._report = earlier._lower, earlier._upper, earlier._report
        return self._collider(field_contact, field.touching(self._offset, self._lift), ContactField)

    def move(self, avatar: Points, cloth: Points) -> Points:
        """Goes on with the avatar's vertices at these positions [m]; the next collider is of them.

        Returns where cloth at these positions [m] goes along: on the skin all its way, farther off less of it.
        """
        if self._avatar is None:
            return cloth
        if self._closing is not None:
            avatar = self._closing.points(avatar)
        exact = build_exact_collider(self._avatar, self._device)
        near = exact.closest(cloth)
        away = np.linalg.norm(cloth - near.points, axis=1)
        share = np.clip((FREE - away) / (FREE - HELD), 0.0, 1.0)
        way = np.einsum("ij,ijk->ik", near.weights, (avatar - self._avatar.points)[near.corners])
        self._avatar = replace(self._avatar, points=avatar)
        self._box = self._avatar.bounds()
        self.builds = 0
        return cloth + share[:, None] * way

    @property
    def kept(self) -> Sampled:
        """What the last collider built answers on the host."""
        return self._kept if isinstance(self._kept, ExactCollider) else self._kept[1]

    @property
    def bytes(self) -> int:
        """What is built holds of the device's memory, about."""
        if self._kept is None or self._avatar is None:
            return 0
        if isinstance(self._kept, ExactCollider):
            return tree_bytes(self._avatar)
        held = [array for owner in self._kept for array in vars(owner).values() if isinstance(array, wp.array)]
        return sum(array.capacity for array in held)

    def skin(self, avatar: Mesh) -> Mesh:
        """The avatar, as it stands by now, without the holes that contact closes and the sheets that it leaves out."""
        return avatar if self._closing is None else self._closing.skin(avatar)

    def alike(self, friction: float) -> AvatarContact:
        """The same contact for another scene: what is built so far is shared, what is built later is its own."""
        other = copy(self)
        other._friction = friction
        return other

    def covers(self, points: Points) -> bool:
        """Whether the collider still answers wherever garments at these positions [m] may touch the avatar."""
        return self.covers_box(points.min(axis=0), points.max(axis=0))

    def covers_box(self, low: Points, high: Points) -> bool:
        """Likewise, of garments within a box [m]."""
        lower, upper = self.room()
        return bool((low >= lower).all() and (high <= upper).all())

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

    def _drawn_within(self, avatar: Mesh, lower: Points, upper: Points) -> Collider:
        """The collider over a box [m]; where that is too large, over what of it is near the avatar.

        The box of a garment that falls on and on grows beyond the avatar's.
        """
        try:
            return self._drawn(avatar, lower, upper)
        except InputError:
            if self._wanting:  # a coarser drawing is tried first
                raise
            low, high = self._box
            return self._drawn(avatar, np.maximum(lower, low - MARGIN), np.minimum(upper, high + MARGIN))

    def _drawn(self, avatar: Mesh, lower: Points, upper: Points) -> Collider:
        """Draws the avatar over a box [m], and fuses what is drawn unless the plain look-up is wanted."""
        drawing = self._drawings[0]
        region = (avatar.points, avatar.triangles, lower, upper, drawing.pixel, self._device)
        buffers = build_layered_buffers(*region) if drawing.layered else build_depth_buffers(*region)
        if self._kind == "plain" and isinstance(buffers, DepthBuffers):
            plain = buffers.plain(self._reach)
            self._kept = (buffers, plain)
            return self._collider(plain_contact, plain.solid, DepthSolid)
        field = build_contact_field(buffers, reach=self._reach)
        self._kept = (buffers, field)
        log.info("contact field of %s nodes", " x ".join(str(count) for count in field.values.shape))
        return self._collider(field_contact, field.touching(self._offset, self._lift), ContactField)

    def _collider(self, contact: wp.Function, data: Any, data_type: Any) -> Collider:
        return Collider(contact, data, data_type, self._offset, self._friction)

    def _mended(self) -> dict[str, Any]:
        """What was done to the avatar's surface, for the report."""
        closing = self._closing
        if closing is None:
            return {"holes_closed": 0, "lids_m2": 0.0, "sheets_left_out": 0}
        return {"holes_closed": closing.holes, "lids_m2": closing.lid_area, "sheets_left_out": closing.sheets}

    def _audit(
        self, buffers: Any, sampled: Any, exact: ExactCollider, near: Callable[[], NearSurface]
    ) -> dict[str, Any]:
        """How good what was drawn is, for the report; ``near`` is the surface that garments may meet."""
        surface = near()
        error = contact_error(sampled, exact, *surface.worn_and_true(exact, self._offset))
        return {
            "buffers": buffers.names,
            "pixel_mm": 1e3 * buffers.pixel,
            "spacing_mm": 1e3 * sampled.spacing if isinstance(sampled, FieldBuild) else None,
            "megabytes": 1e-6 * sampled.bytes,
            **self._mended(),
            "near_area_m2": surface.area,
            "unseen_by_three_views": unseen_share(surface, exact),
            "unbalanced_pixels": getattr(buffers, "unbalanced", None),
            "error_mm": asdict(error),
            "error_sought_mm": 1e3 * self._error if self._kind == "auto" else None,
        }
