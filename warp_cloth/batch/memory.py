"""Device memory of a batch, estimated before anything is allocated."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_cloth.avatar.contact import MARGIN
from warp_cloth.avatar.exact import tree_bytes
from warp_cloth.avatar.field import GRIDS_AT_ONCE, LEAST_SPACING, PIXELS_PER_SPACING
from warp_cloth.fitting.avatar_contacts import contact_key
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.plan import contact_kind
from warp_cloth.scene import Scene

# Bytes per vertex, edge, triangle and hinge of the model, the solver, the certificate and its stored shapes, in "mixed"
# precision; measured by adding up the arrays, and rounded up.
PER_VERTEX, PER_EDGE, PER_TRIANGLE, PER_HINGE = 704, 96, 192, 64
SCATTERED = 0.5  # factor where forces are scattered: nothing is stored, and there is one set of positions
DOUBLE = 2.0  # factor where everything is float64
GRID_NODE = 4  # bytes of one of a field's grids, while it is built
FIELD_NODE = 8  # of the field's four bytes and the depth buffers'
GPU_FRACTION = 0.8  # of the free memory: the allocator and the kernels need some
CPU_FRACTION = 0.4  # likewise: there are other workers, too


@dataclass(frozen=True)
class MemoryNeed:
    """Upper bound of the device memory of one scene [bytes]."""

    own: int  # of its garments
    shared: int  # of its avatar and of the predrape, allocated once for all scenes of the same ``key``
    key: Hashable
    transient: int = 0  # while the avatar is built, one avatar after another


def memory_need(scene: Scene, outfit: Outfit, *, gathers: bool) -> MemoryNeed:
    """Memory of a scene whose forces are gathered (on GPUs) or scattered (on CPUs)."""
    total = 0.0
    for garment in outfit.garments:
        topology = garment.rest.topology
        total += PER_VERTEX * len(garment.points) + PER_EDGE * len(topology.edges)
        total += PER_TRIANGLE * len(garment.triangles) + PER_HINGE * len(topology.hinges)
    if not gathers:
        total *= SCATTERED
    if scene.solver.precision == "float64":
        total *= DOUBLE
    shared, transient = collider_bytes(scene, outfit)
    if scene.solver.start == "dressed":  # in one fabric for all
        shared += int(total)
    return MemoryNeed(int(total), shared, contact_key(scene, outfit), transient)


def collider_bytes(scene: Scene, outfit: Outfit) -> tuple[int, int]:
    """Upper bound of the memory of a scene's collider, and of what building it takes besides [bytes]."""
    avatar = outfit.avatar
    kind = contact_kind(scene, outfit)
    if avatar is None or kind == "none":
        return 0, 0
    mesh = tree_bytes(avatar)
    if kind == "mesh":
        return mesh, 0
    points = np.concatenate([garment.points for garment in outfit.garments])
    lower, upper = avatar.bounds()
    low, high = np.maximum(points.min(axis=0), lower) - MARGIN, np.minimum(points.max(axis=0), upper) + MARGIN
    spacing = max(PIXELS_PER_SPACING * scene.collision.pixel, LEAST_SPACING)
    nodes = float(np.prod(np.maximum(high - low, 0.0) / spacing + 4.0))
    return mesh + int(FIELD_NODE * nodes), int(GRIDS_AT_ONCE * GRID_NODE * nodes)


def available_bytes(device: str, fraction: float = 1.0) -> int:
    """Memory that a batch may use [bytes]; where workers share a GPU no more than its fraction of the total."""
    where = wp.get_device(device)
    if where.is_cuda:
        return int(GPU_FRACTION * min(where.free_memory, fraction * where.total_memory))
    return int(CPU_FRACTION * os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))


def grouped_by_avatar(needs: Sequence[MemoryNeed]) -> list[int]:
    """An order in which scenes of the same collider follow one another: a GPU's cache holds few fields."""
    ranks: dict[Hashable, int] = {}
    return sorted(range(len(needs)), key=lambda at: ranks.setdefault(needs[at].key, len(ranks)))


def split_to_fit(needs: Sequence[MemoryNeed], budget: int, most: int) -> list[range]:
    """Ranges of consecutive items that together stay within the budget [bytes], ``most`` of them at most.

    An item that alone needs more has a range of its own: it may fit all the same.
    """
    ranges, first, total, transient = [], 0, 0, 0
    allocated: set[Hashable] = set()
    for at, need in enumerate(needs):
        more = need.own + (0 if need.key in allocated else need.shared)
        if at > first and (total + more + max(transient, need.transient) > budget or at - first >= most):
            ranges.append(range(first, at))
            first, total, transient, more = at, 0, 0, need.own + need.shared
            allocated.clear()
        total += more
        transient = max(transient, need.transient)
        allocated.add(need.key)
    return [*ranges, range(first, len(needs))] if needs else []
