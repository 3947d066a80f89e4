"""Device memory of a batch, planned before anything is allocated."""

from __future__ import annotations

import os
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_cloth.avatar.contact import MARGIN
from warp_cloth.avatar.exact import tree_bytes
from warp_cloth.avatar.field import GRIDS_AT_ONCE, LEAST_SPACING, PIXELS_PER_SPACING
from warp_cloth.fitting.problem import contact_key
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.plan import contact_kind
from warp_cloth.scene import Scene

# Bytes for each vertex, edge, triangle and hinge of model, iterations, certificate and the shapes that it keeps, in
# the "mixed" precision; measured by adding up the arrays, and rounded up.
PER_VERTEX, PER_EDGE, PER_TRIANGLE, PER_HINGE = 704, 96, 192, 64
SCATTERED = 0.5  # factor where forces are scattered: nothing is stored, and there is one set of positions
DOUBLE = 2.0  # factor where everything is float64
GRID_NODE = 4  # bytes of one of a field's grids, while it is built
FIELD_NODE = 8  # of the field's four bytes and the depth buffers'
SHARE = 0.8  # of the free memory that a batch takes: the allocator and the kernels want some
CPU_SHARE = 0.4  # likewise: other workers are there, too


@dataclass(frozen=True)
class Need:
    """Bound of the device memory of one scene [bytes]."""

    own: int  # of its garments
    shared: int  # of its avatar and of dressing its garments, held once for all scenes of the same ``key``
    key: Hashable
    passing: int = 0  # of building that, for a while, one avatar after another


def need_of(scene: Scene, outfit: Outfit, *, gathers: bool) -> Need:
    """What a scene needs whose forces are gathered (on GPUs) or scattered."""
    total = 0.0
    for part in outfit.parts:
        topology = part.rest.topology
        total += PER_VERTEX * len(part.points) + PER_EDGE * len(topology.edges)
        total += PER_TRIANGLE * len(part.triangles) + PER_HINGE * len(topology.hinges)
    if not gathers:
        total *= SCATTERED
    if scene.solver.precision == "float64":
        total *= DOUBLE
    held, passing = collider_bytes(scene, outfit)
    if scene.solver.start == "dressed":  # in one fabric for all
        held += int(total)
    return Need(int(total), held, contact_key(scene, outfit), passing)


def collider_bytes(scene: Scene, outfit: Outfit) -> tuple[int, int]:
    """Bound of the memory of an avatar as a scene meets it, and of what building it takes for a while [bytes]."""
    avatar = outfit.avatar
    kind = contact_kind(scene, outfit)
    if avatar is None or kind == "none":
        return 0, 0
    mesh = tree_bytes(avatar)
    if kind == "mesh":
        return mesh, 0
    points = np.concatenate([part.points for part in outfit.parts])
    lower, upper = avatar.bounds()
    low, high = np.maximum(points.min(axis=0), lower) - MARGIN, np.minimum(points.max(axis=0), upper) + MARGIN
    spacing = max(PIXELS_PER_SPACING * scene.collision.pixel, LEAST_SPACING)
    nodes = float(np.prod(np.maximum(high - low, 0.0) / spacing + 4.0))
    return mesh + int(FIELD_NODE * nodes), int(GRIDS_AT_ONCE * GRID_NODE * nodes)


def available_bytes(device: str, share: float = 1.0) -> int:
    """Memory that a batch may take [bytes], where others have the device, too, no more than its share of a GPU's."""
    where = wp.get_device(device)
    if where.is_cuda:
        return int(SHARE * min(where.free_memory, share * where.total_memory))
    return int(CPU_SHARE * os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))


def side_by_side(needs: Sequence[Need]) -> list[int]:
    """An order in which scenes that meet their avatar alike follow one another: a GPU's cache holds few fields."""
    ranks: dict[Hashable, int] = {}
    return sorted(range(len(needs)), key=lambda at: ranks.setdefault(needs[at].key, len(ranks)))


def cut_to_fit(needs: Sequence[Need], budget: int, most: int) -> list[range]:
    """Consecutive items that together stay within the budget [bytes], ``most`` of them at most.

    An item that alone needs more makes a piece of its own: it may fit all the same.
    """
    pieces, first, total, passing = [], 0, 0, 0
    held: set[Hashable] = set()
    for at, need in enumerate(needs):
        more = need.own + (0 if need.key in held else need.shared)
        if at > first and (total + more + max(passing, need.passing) > budget or at - first >= most):
            pieces.append(range(first, at))
            first, total, passing, more = at, 0, 0, need.own + need.shared
            held.clear()
        total += more
        passing = max(passing, need.passing)
        held.add(need.key)
    return [*pieces, range(first, len(needs))] if needs else []
