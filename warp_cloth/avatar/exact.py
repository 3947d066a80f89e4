"""The exact collider: distances to the avatar's own triangles, for fits and for every report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.depth import DEFAULT_REACH, sampled
from warp_cloth.base.bins import consecutive_bins
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.kernels.avatar import closest as kernels
from warp_cloth.kernels.avatar.nearest_face import Surface, choose_nearest_faces
from warp_cloth.model.result import Penetration

DEFAULT_DEPTH = 0.3  # [m]; deeper than the middle of any trunk
TREE_TRIANGLE = 430  # bytes of a mesh and its BVH for each triangle, measured: 414
DEEPEST = 0.999  # the percentile reported next to the deepest vertex
POINTS_AT_ONCE = 1 << 20  # points of several garments in one launch: as many as fill a GPU
DEPTHS_AT_ONCE = 1 << 22  # the same for depths, where the few points inside take longest


@dataclass(frozen=True, eq=False)
class Closest:
    """Closest points of an avatar."""

    points: Points  # [m], shape [N, 3]
    corners: NDArray[np.int32]  # vertices of the triangles that they lie on, shape [N, 3]
    weights: Points  # of those vertices, shape [N, 3]


@dataclass(frozen=True, eq=False)
class ExactCollider:
    """An exact collider for kernels, and the mesh that it refers to."""

    collider: kernels.MeshCollider
    mesh: wp.Mesh
    avatar: Mesh
    orientation: float = 1.0  # -1 where the avatar was inside out

    @property
    def corners(self) -> Indices:
        """Vertices of the mesh's triangles, shape [F, 3]."""
        return _facing(self.avatar, self.orientation)

    @property
    def device(self) -> wp.Device:
        return self.mesh.device

    @property
    def reach(self) -> float:
        """Distance outside up to which distances are exact [m]."""
        return float(self.collider.reach)

    def local(self, points: Points) -> wp.array:
        """Points [m], shape [N, 3], in the mesh's frame."""
        near = (points - np.array(self.collider.origin)).astype(np.float32)
        return wp.array(near, dtype=wp.vec3f, device=self.device)

    def closest(self, points: Points, *, exact: float = 0.0) -> Closest:
        """The surface nearest to points [m], shape [N, 3], however far; all finite.

        Nearer than ``exact`` [m] it has the same bits on all devices; farther off, between triangles about as near.
        """
        queries = self.local(points)
        rough, unused = wp.empty_like(queries), wp.empty_like(queries)
        found = wp.empty(len(queries), dtype=wp.int32, device=self.device)
        face, weights = wp.empty_like(found), wp.zeros(len(queries), dtype=wp.vec3d, device=self.device)
        find = [self.mesh.id, queries], [rough, found, unused]
        wp.launch(kernels.find_closest, dim=len(queries), inputs=find[0], outputs=find[1], device=self.device)
        corners, places = self.corners, wp.array(points, dtype=wp.vec3d, device=self.device)
        surface = Surface()
        surface.mesh, surface.origin = self.mesh.id, self.collider.origin
        surface.points = wp.array(self.avatar.points, dtype=wp.vec3d, device=self.device)
        surface.corners = wp.array(corners, dtype=wp.vec3i, device=self.device)
        choose = [surface, exact, places, found], [face, weights]
        wp.launch(choose_nearest_faces, dim=len(queries), inputs=choose[0], outputs=choose[1], device=self.device)
        on, corners = weights.numpy(), corners[face.numpy()]
        return Closest(np.einsum("ij,ijk->ik", on, self.avatar.points[corners]), corners, on)

    def within(self, distance: float) -> ExactCollider:
        """The same mesh, with distances up to this one inside and outside [m]."""
        collider = kernels.MeshCollider()
        collider.mesh, collider.origin = self.collider.mesh, self.collider.origin
        collider.depth = collider.reach = distance
        return replace(self, collider=collider)

    def sample(self, points: Points) -> NDArray[np.float32]:
        """Unit normal and signed distance at points [m], shape [N, 3]; shape [N, 4]. Far ones have no normal."""
        return sampled(kernels.sample_mesh, self.collider, points, self.device)


def _facing(avatar: Mesh, orientation: float) -> Indices:
    """The avatar's triangles, turned over where the orientation is negative, shape [F, 3]."""
    return avatar.triangles if orientation > 0.0 else np.ascontiguousarray(avatar.triangles[:, ::-1])


def closest_faces(
    points: NDArray[np.floating], triangles: Indices, places: NDArray[np.floating], device: str
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.float32]]:
    """Where a mesh is nearest to places, shape [N, 3], in float32: the points, their faces, weights of its corners.

    Shapes [N, 3], [N] and [N, 3]; of the mesh [V, 3] and [F, 3].
    """
    mesh = wp.Mesh(
        points=wp.array(points.astype(np.float32), dtype=wp.vec3f, device=device),
        indices=wp.array(triangles.ravel(), dtype=wp.int32, device=device),
    )
    queries = wp.array(places.astype(np.float32), dtype=wp.vec3f, device=device)
    face, weight = wp.empty(len(queries), dtype=wp.int32, device=device), wp.zeros_like(queries)
    found = wp.empty_like(queries)
    inputs, outputs = [mesh.id, queries], [found, face, weight]
    wp.launch(kernels.find_closest, dim=len(queries), inputs=inputs, outputs=outputs, device=device)
    return found.numpy(), face.numpy(), weight.numpy()


def build_exact_collider(
    avatar: Mesh,
    device: wp.DeviceLike = None,
    reach: float = DEFAULT_REACH,
    *,
    signed: bool = True,
) -> ExactCollider:
    """Builds the BVH of the avatar's triangles; a mesh that is inside out as a whole is flipped.

    ``signed``: False takes half as long, for ``closest`` alone.
    """
    lower, upper = avatar.bounds()
    origin = 0.5 * (lower + upper)
    points, orientation = avatar.points - origin, -1.0 if signed and avatar.inside_out else 1.0
    triangles = _facing(avatar, orientation)
    mesh = wp.Mesh(
        points=wp.array(points.astype(np.float32), dtype=wp.vec3f, device=device),
        indices=wp.array(triangles.reshape(-1), dtype=wp.int32, device=device),
        support_winding_number=signed,
    )
    collider = kernels.MeshCollider()
    collider.mesh, collider.origin = mesh.id, wp.vec3d(*origin)
    collider.depth, collider.reach = DEFAULT_DEPTH, reach
    return ExactCollider(collider, mesh, avatar, orientation)


def tree_bytes(avatar: Mesh) -> int:
    """Upper bound of the device memory of an avatar's mesh and its BVH."""
    return TREE_TRIANGLE * avatar.triangle_count


def exact_colliders(avatars: Sequence[Mesh | None], device: wp.DeviceLike = None) -> list[ExactCollider | None]:
    """The exact collider of each avatar, None without one; equal avatars share one."""
    built: dict[int, ExactCollider] = {}
    for avatar in avatars:
        if avatar is not None and id(avatar) not in built:
            built[id(avatar)] = build_exact_collider(avatar, device)
    return [built[id(avatar)] if avatar is not None else None for avatar in avatars]


def signed_distances(
    points: Points, avatar: Mesh, device: wp.DeviceLike = None, exact: ExactCollider | None = None
) -> NDArray[np.float32]:
    """Signed distance to the avatar's mesh [m], positive outside, shape [N]; NaN where a point is not finite.

    ``exact`` is of that mesh, where there is one already.
    """
    if not len(points) or not avatar.triangle_count:
        return np.full(len(points), np.nan, dtype=np.float32)
    low, high = points.min(axis=0), points.max(axis=0)
    if not np.isfinite([low, high]).all():
        distances = np.full(len(points), np.nan, dtype=np.float32)
        finite = np.isfinite(points).all(axis=1)
        if finite.any():
            distances[finite] = signed_distances(points[finite], avatar, device, exact)
        return distances
    lower, upper = avatar.bounds()
    extents = [np.abs(point - corner) for point in (low, high) for corner in (lower, upper)]
    far = float(np.linalg.norm(np.max(extents, axis=0)))
    reaching = (exact or build_exact_collider(avatar, device)).within(2.0 * far)
    return np.ascontiguousarray(reaching.sample(points)[:, 3])


def penetration(points: Points, avatar: Mesh, device: wp.DeviceLike = None) -> Penetration:
    """How deep points lie under the avatar's surface; NaN where a point is not finite."""
    (depths,) = depths_under(points, [len(points)], [build_exact_collider(avatar, device)])
    return depth_summary(depths)


def penetrations(
    worn: Sequence[Points], avatars: Sequence[Mesh | None], device: wp.DeviceLike = None
) -> list[Penetration | None]:
    """``penetration`` of garments in their own avatars, None without one; measured together."""
    counts = [len(points) for points in worn]
    found = depths_under(np.concatenate(worn), counts, exact_colliders(avatars, device))
    return [None if avatar is None else depth_summary(own) for avatar, own in zip(avatars, found, strict=True)]


def depths_under(
    points: Points | wp.array, counts: Sequence[int], exact_of: Sequence[ExactCollider | None]
) -> list[NDArray[np.float32]]:
    """How deep points lie under an avatar's surface [m], 0 outside; NaN where one is not finite.

    Args:
        points: of several garments one after another [m], shape [N, 3]; or on the avatars' device.
        counts: how many of them each garment has.
        exact_of: each garment's avatar; None: depths are 0.
    """
    avatars = list({id(exact): exact for exact in exact_of if exact is not None}.values())
    ends = np.cumsum([0, *counts])
    if not avatars:
        return [np.zeros(count, dtype=np.float32) for count in counts]
    device = avatars[0].device
    number = {id(exact): at for at, exact in enumerate(avatars)}
    of = np.array([number.get(id(exact), -1) for exact in exact_of], dtype=np.int32)
    colliders = wp.array(
        [exact.within(float(kernels.FARTHEST)).collider for exact in avatars], dtype=kernels.MeshCollider, device=device
    )
    closed = wp.array([exact.avatar.closed for exact in avatars], dtype=wp.uint8, device=device)
    found: list[NDArray[np.float32]] = []
    for piece in consecutive_bins(counts, DEPTHS_AT_ONCE):
        here = ends[piece.start : piece.stop + 1]
        some = points[here[0] : here[-1]]
        given = some if isinstance(some, wp.array) else wp.array(some, dtype=wp.vec3d, device=device)
        grouped = here - here[0], of[piece.start : piece.stop]
        groups = [wp.array(each, dtype=wp.int32, device=device) for each in grouped]
        size, inputs = len(given), [given, *groups, colliders]
        depth, listed = (wp.empty(size, dtype=kind, device=device) for kind in (wp.float32, wp.int32))
        count = wp.zeros(1, dtype=wp.int32, device=device)
        wp.launch(kernels.find_covered, size, [*inputs, closed], [depth, count, listed], device=device)
        wp.launch(kernels.measure_depths, size, [*inputs, count, listed], [depth], device=device)
        found += np.split(depth.numpy(), grouped[0][1:-1])
    return found


def depth_summary(depths: NDArray[np.float32]) -> Penetration:
    """A report's figures on the depths of a garment's vertices [m]."""
    if not np.isfinite(depths).all():
        return Penetration(*(float("nan"),) * 3)
    inside, depth = np.count_nonzero(depths), 1000.0 * depths.astype(np.float64)
    few = inside < len(depths) - 1 - math.ceil(DEEPEST * (len(depths) - 1))  # so few that the percentile is 0
    p999 = 0.0 if few else float(np.percentile(depth, 100.0 * DEEPEST))
    return Penetration(max=float(depth.max()), p999=p999, fraction=inside / len(depths))
