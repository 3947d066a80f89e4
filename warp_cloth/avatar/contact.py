"""Avatar contact: builds the collider that a scene names, over the region where its garments are."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from copy import copy
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.depth import DEFAULT_REACH, DepthBuffers, build_depth_buffers, contact_bounds
from warp_cloth.avatar.error import NearSurface, Sampled, contact_error, near_surface, unseen_share
from warp_cloth.avatar.exact import ExactCollider, build_exact_collider, tree_bytes
from warp_cloth.avatar.field import FieldBuild, bake_modules, build_contact_field
from warp_cloth.avatar.layers import LayeredBuffers, build_layered_buffers
from warp_cloth.avatar.solid import Closing, Solid, solid_of
from warp_cloth.avatar.stored_field import StoredField, field_key, read_field, write_field
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.kernels.avatar import closest, depth, layers, nearest_face, raster, sweep, visibility
from warp_cloth.kernels.avatar import field as field_kernels
from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.kernels.avatar.depth import DepthSolid, plain_contact
from warp_cloth.kernels.avatar.field import ContactField, field_contact

log = logging.getLogger(__name__)

# Width of the depth buffers' border around the garments [m]: as far as a garment can fall between two checks (20
# iterations at the default cap of 5 mm). When one comes near the edge, the buffers are drawn again.
MARGIN = 0.15
NEAR_EDGE = 0.04  # what must be left of that border [m]: more than the field's own reach and support
FARTHER = 1.5  # factor on the reach of a contact that another scene's outgrew
ROOM_TO_MOVE = 0.007  # [m] beyond the offset that contact must cover: more than cloth moves in one iteration
# Distances [m] from a moving surface: nearer than the first, cloth moves with it; beyond the second, not at all.
FOLLOWS, STAYS = 0.02, 0.06
FINER = 0.5  # factor on the pixel where all layers at the scene's own pixel are not accurate enough
DRAWN = ("depth", "plain", "auto")  # colliders drawn over a region


def avatar_modules(kind: str) -> list[wp.Module]:
    """Kernel modules needed to build a collider of this kind and to measure against the exact avatar."""
    used = [closest, nearest_face, visibility]
    if kind in DRAWN:
        used += [depth, raster]
    if kind in ("depth", "auto"):
        used += [field_kernels, sweep]
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


@dataclass(frozen=True)
class ContactOptions:
    """Which collider is built, and how accurate it is."""

    kind: str  # "depth", "plain", "auto", "mesh" or "none"
    pixel: float  # of the depth buffers [m]
    offset: float  # contact offset [m]
    error: float  # that "auto" stays within at 99.9 % of the surface that the garment can reach [m]
    device: str
    reach: float = DEFAULT_REACH  # that contact covers at least; what exceeds the default is for lifted cloth [m]


Report = dict[str, Any] | None


class _LazyReport:
    """A report that is computed on first use; then what it was computed from is released."""

    def __init__(self, compute: Callable[[], Report]) -> None:
        self._compute: Callable[[], Report] | None = compute
        self._report: Report = None

    def get(self) -> Report:
        if self._compute is not None:
            self._report, self._compute = self._compute(), None
        return self._report


def followed(exact: ExactCollider, surface: Points, cloth: Points) -> Points:
    """Where cloth at these positions [m] goes as the collider's vertices move to ``surface`` [m], shape [V, 3].

    It follows the surface near it, and less the farther it is off.
    """
    near = exact.closest(cloth, exact=STAYS)
    away = np.linalg.norm(cloth - near.points, axis=1)
    fraction = np.clip((STAYS - away) / (STAYS - FOLLOWS), 0.0, 1.0)
    displacement = np.einsum("ij,ijk->ik", near.weights, (surface - exact.avatar.points)[near.corners])
    moved: Points = cloth + fraction[:, None] * displacement
    return moved


def _same_points(one: Mesh | None, other: Mesh | None) -> bool:
    return one is not None and other is not None and np.array_equal(one.points, other.points)


class AvatarContact:
    """Builds the collider of a scene, and rebuilds it when a garment leaves the region that it covers."""

    def __init__(
        self,
        avatar: Mesh | None,
        options: ContactOptions,
        *,
        solid: Solid | None = None,
        place: str = "avatar",
    ) -> None:
        """Prepares the avatar's surface.

        Args:
            avatar: None: there is none, as with kind "none".
            options: the collider's.
            solid: the avatar's, where it is already known.
            place: the avatar's key in the scene, for errors.

        Raises:
            InputError: where a collider that is drawn would have to draw a surface that encloses nothing.
        """
        self._loaded = avatar
        self._closing: Closing | None = None
        self._avatar: Mesh | None = None
        if avatar is not None and options.kind != "none":
            self._avatar = self._enclosed(solid or solid_of(avatar), options.kind, place)
        self._options = options
        self._reach = max(options.reach, options.offset + ROOM_TO_MOVE)
        self._lift = max(options.reach - DEFAULT_REACH, 0.0)
        self._built: Any = None  # owns the arrays that the collider points to
        self._box = self._avatar.bounds() if self._avatar is not None else (np.zeros(3), np.zeros(3))
        self._lower = self._upper = np.zeros(3)
        pixel = options.pixel
        drawings = [Drawing(False, pixel), Drawing(True, pixel), Drawing(True, FINER * pixel)]
        self._drawings = drawings if options.kind == "auto" else drawings[:1]  # the first is in use; coarse to fine
        self._rejected: list[Drawing] = []  # those that were not accurate enough
        self.builds = 0
        self._report = _LazyReport(lambda: None)

    @property
    def report(self) -> Report:
        """What the last audited build was, and its error; measured on first use, or by "auto" to choose."""
        return self._report.get()

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
        if self._options.kind == "mesh":
            return self._exact_collider(self._avatar)
        margin = MARGIN * 2.0 ** max(self.builds - 1, 0)  # a garment that fell out of it once is still falling
        # over a larger part of the avatar coarser layers may do, but what three views do not see stays hidden
        if audited and self.builds > 1 and self._rejected and self._rejected[-1].layered:
            self._drawings, self._rejected = [self._rejected[-1], *self._drawings], self._rejected[:-1]
        lower, upper = contact_bounds(points, self._avatar.points, margin)
        self._lower, self._upper = points.min(axis=0) - margin, points.max(axis=0) + margin
        self._built = None  # frees its memory for the next
        if not audited:
            self._report.get()  # or it would keep the old arrays alive
            while True:
                try:
                    return self._drawn_within(self._avatar, lower, upper)
                except InputError:
                    self._draw_coarser()
        if self._options.kind != "auto" or not wp.get_device(self._options.device).is_cpu:  # a GPU draws in no time
            return self._audited_collider(self._avatar, points, lower, upper)
        return self._stored_collider(self._avatar, points, lower, upper)

    def _exact_collider(self, avatar: Mesh) -> Collider:
        """The collider of kind "mesh"."""
        exact = build_exact_collider(avatar, self._options.device, reach=self._reach)
        self._built = exact
        report: dict[str, Any] = {"buffers": [], "triangles": avatar.triangle_count, **self._repairs()}
        self._report = _LazyReport(lambda: report)
        return Collider(mesh_contact, exact.collider, MeshCollider)

    def _stored_collider(self, avatar: Mesh, points: Points, lower: Points, upper: Points) -> Collider:
        """The audited collider of kind "auto", from the disk where it has been built before."""
        region = (avatar.points, avatar.triangles, points, lower, upper, self._reach)
        key = field_key(*region, self._options, self._repairs(), len(self._rejected))
        stored = read_field(key, self._options.device)
        if stored is None:
            collider = self._audited_collider(avatar, points, lower, upper)
            write_field(key, StoredField(self._built[1], len(self._rejected), self.report or {}))
            return collider
        report, drawings = stored.report, [*self._rejected, *self._drawings]
        self._rejected, self._drawings = drawings[: stored.rejected], drawings[stored.rejected :]
        self._built = (None, stored.field)
        self._report = _LazyReport(lambda: report)
        return self._limited(stored.field)

    def _limited(self, field: FieldBuild) -> Collider:
        """The collider that looks up a field, as far as contact needs it."""
        return Collider(field_contact, field.limited_to(self._options.offset, self._lift), ContactField)

    def _audited_collider(self, avatar: Mesh, points: Points, lower: Points, upper: Points) -> Collider:
        """Draws over a box [m], for "auto" finer and finer until the error is small enough, or a grid too large."""
        self._report = _LazyReport(lambda: None)
        exact = build_exact_collider(avatar, self._options.device, reach=self._reach)
        surface = functools.cache(
            functools.partial(near_surface, avatar, exact, points, lower + NEAR_EDGE, upper - NEAR_EDGE)
        )
        found = None
        while True:
            try:
                found = self._drawn_within(avatar, lower, upper)
            except InputError:
                self._draw_coarser()
                if found is not None:
                    return found
                continue
            buffers, sampled = self._built
            self._report = _LazyReport(functools.partial(self._audit, buffers, sampled, exact, surface))
            if len(self._drawings) == 1 or self._accurate():
                return found
            self._drawings, self._rejected = self._drawings[1:], [*self._rejected, self._drawings[0]]

    def _accurate(self) -> bool:
        """Whether the current drawing is within the required error."""
        report = self.report
        return report is not None and bool(report["error_mm"]["p999"] <= 1e3 * self._options.error)

    def _draw_coarser(self) -> None:
        """In an exception's handler: returns to the previous drawing where this one is too fine for the region."""
        if not self._rejected:
            raise
        log.info("a pixel of %.2g mm is too fine for the region", 1e3 * self._drawings[0].pixel)
        self._drawings, self._rejected = [self._rejected[-1], *self._drawings], self._rejected[:-1]

    def reused_from(self, earlier: AvatarContact, points: Points) -> Collider | None:
        """The collider that another scene's contact has built, where it also serves garments at these positions [m].

        That is a field of the same avatar, drawn the same way, that reaches as far; the offset is this one's.
        """
        field = earlier._built[1] if isinstance(earlier._built, tuple) else None
        mine, other = self._options, earlier._options
        same = (
            earlier._loaded is self._loaded
            and (other.kind, other.error, other.device) == (mine.kind, mine.error, mine.device)
            and (earlier._drawings[-1], earlier._lift) == (self._drawings[-1], self._lift)
            and _same_points(earlier._avatar, self._avatar)
        )
        if same and earlier._reach < self._reach:  # an offset that grew once may grow again
            self._reach, same = max(self._reach, FARTHER * earlier._reach), False
        if not same or not isinstance(field, FieldBuild) or not earlier.covers(points):
            return None
        self._built, self._drawings, self.builds = earlier._built, earlier._drawings, earlier.builds
        self._rejected = earlier._rejected
        self._lower, self._upper, self._report = earlier._lower, earlier._upper, earlier._report
        return self._limited(field)

    def move(self, avatar: Points, cloth: Points) -> Points:
        """Moves the avatar's vertices to these positions [m]; the next collider is built from them.

        Returns where cloth at these positions [m] follows: with the surface near it, less and less farther off.
        """
        if self._avatar is None:
            return cloth
        if self._closing is not None:
            avatar = self._closing.points(avatar)
        exact = build_exact_collider(self._avatar, self._options.device, signed=False)
        moved = followed(exact, avatar, cloth)
        self._avatar = replace(self._avatar, points=avatar)
        self._box = self._avatar.bounds()
        self.builds = 0
        return moved

    @property
    def built(self) -> Sampled:
        """The last collider built, for sampling on the host."""
        return self._built if isinstance(self._built, ExactCollider) else self._built[1]

    @property
    def bytes(self) -> int:
        """Device memory of what is built, approximately."""
        if self._built is None or self._avatar is None:
            return 0
        if isinstance(self._built, ExactCollider):
            return tree_bytes(self._avatar)
        owners = [owner for owner in self._built if owner is not None]
        arrays = [array for owner in owners for array in vars(owner).values() if isinstance(array, wp.array)]
        return sum(array.capacity for array in arrays)

    def surface(self, avatar: Mesh) -> Mesh:
        """The avatar's surface in its current pose, without the holes that are closed and the sheets left out."""
        return avatar if self._closing is None else self._closing.surface(avatar)

    def alike(self) -> AvatarContact:
        """The same contact for another scene: what is built so far is shared, what is built later is its own."""
        return copy(self)

    def covers(self, points: Points) -> bool:
        """Whether the collider is valid wherever garments at these positions [m] may reach the avatar."""
        return self.covers_box(points.min(axis=0), points.max(axis=0))

    def covers_box(self, low: Points, high: Points) -> bool:
        """The same for garments within a box [m]."""
        lower, upper = self.region()
        return bool((low >= lower).all() and (high <= upper).all())

    def region(self) -> tuple[Points, Points]:
        """The box [m] that garments may not leave without a new collider; infinite where they may."""
        if self._avatar is None or self._options.kind == "mesh":
            return np.full(3, -np.inf), np.full(3, np.inf)
        lower, upper = self._lower + NEAR_EDGE, self._upper - NEAR_EDGE
        # beyond the avatar's own box there is nothing to collide with
        return (
            np.where(self._box[0] >= lower, -np.inf, lower),
            np.where(self._box[1] <= upper, np.inf, upper),
        )

    def _drawn_within(self, avatar: Mesh, lower: Points, upper: Points) -> Collider:
        """The collider over a box [m]; where that is too large, over the part of it that is near the avatar.

        The box of a garment that keeps falling grows beyond the avatar's.
        """
        try:
            return self._drawn(avatar, lower, upper)
        except InputError:
            if self._rejected:  # a coarser drawing is tried first
                raise
            low, high = self._box
            return self._drawn(avatar, np.maximum(lower, low - MARGIN), np.minimum(upper, high + MARGIN))

    def _drawn(self, avatar: Mesh, lower: Points, upper: Points) -> Collider:
        """Draws the avatar over a box [m], and bakes the drawing into a field unless kind is "plain"."""
        drawing = self._drawings[0]
        region = (avatar.points, avatar.triangles, lower, upper, drawing.pixel, self._options.device)
        buffers = build_layered_buffers(*region) if drawing.layered else build_depth_buffers(*region)
        if self._options.kind == "plain" and isinstance(buffers, DepthBuffers):
            plain = buffers.plain(self._reach)
            self._built = (buffers, plain)
            return Collider(plain_contact, plain.solid, DepthSolid)
        field = build_contact_field(buffers, reach=self._reach)
        self._built = (buffers, field)
        log.info("contact field of %s nodes", " x ".join(str(count) for count in field.values.shape))
        return self._limited(field)

    def _repairs(self) -> dict[str, Any]:
        """What was done to the avatar's surface, for the report."""
        closing = self._closing
        if closing is None:
            return {"holes_closed": 0, "lids_m2": 0.0, "sheets_left_out": 0}
        made = {"holes_closed": closing.holes, "lids_m2": closing.lid_area, "sheets_left_out": closing.sheets}
        return {**made, "worn_parts": closing.worn} if closing.worn else made

    def _audit(
        self, buffers: Any, sampled: Any, exact: ExactCollider, near: Callable[[], NearSurface]
    ) -> dict[str, Any]:
        """The error of what was drawn, for the report; ``near`` is the surface that garments may reach."""
        surface = near()
        error = contact_error(sampled, exact, *surface.worn_and_true(exact, self._options.offset))
        return {
            "buffers": buffers.names,
            "pixel_mm": 1e3 * buffers.pixel,
            "spacing_mm": 1e3 * sampled.spacing if isinstance(sampled, FieldBuild) else None,
            "megabytes": 1e-6 * sampled.bytes,
            **self._repairs(),
            "near_area_m2": surface.area,
            "unseen_by_three_views": unseen_share(surface, exact),
            "unbalanced_pixels": getattr(buffers, "unbalanced", None),
            "error_mm": asdict(error),
            "error_sought_mm": 1e3 * self._options.error if self._options.kind == "auto" else None,
        }
