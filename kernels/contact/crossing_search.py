"""Crossing search: which edges pass through which triangles, and which other layer each vertex is nearest to."""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import position_of
from warp_cloth.kernels.base.block import warp_size
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import ON_EDGE, ON_TRIANGLE, ContactData
from warp_cloth.kernels.contact.box_tree import (
    WIDTH,
    BoxWalk,
    leaf_overlaps,
    load_box,
    may_overlap,
    start_walk,
    team_lane,
    team_max,
)
from warp_cloth.kernels.contact.broad_phase import (
    Candidates,
    Query,
    groups_kernel,
    leaves_kernel,
    list_leaves_function,
    query_of,
    search_context_function,
    walk_groups_function,
)
from warp_cloth.kernels.contact.search import SLACK, ContactSearch, least_box_margin, tree_of, vertex_group_box
from warp_cloth.kernels.contact.untangle import Untangling, distance_key, separate_crossing
from warp_cloth.kernels.math.closest_points import nearest_on_triangle

wp.set_module_options({"enable_backward": False, "fuse_fp": False})

# A kind of query besides ON_EDGE (edges that may pass through triangles) and ON_TRIANGLE (vertices near another layer's
# triangles): triangles that edges may pass through.
BY_TRIANGLE = wp.constant(wp.int32(2))


@wp.func
def tangled_leaf(search: ContactSearch, kind: int, leaf: int):
    """Positive where an edge's end, a triangle's corner or a vertex is tangled, by the kind of query that it makes."""
    found = int(0)
    if kind == ON_EDGE:
        ends = search.ends[leaf]
        found = wp.max(search.tangled[ends[0]], search.tangled[ends[1]])
    elif kind == BY_TRIANGLE:
        t = search.corners[leaf]
        found = wp.max(search.tangled[t[0]], wp.max(search.tangled[t[1]], search.tangled[t[2]]))
    else:
        vertex = search.vertex[leaf]
        if vertex >= 0:
            found = search.tangled[vertex]
    return found


@wp.func
def is_tangled(search: ContactSearch, query: Query):
    """Whether anything of a querying group is tangled; for a team."""
    found = int(0)
    local = team_lane()
    while local < WIDTH:
        found = wp.max(found, tangled_leaf(search, query.kind, WIDTH * query.group + local))
        local += warp_size()
    return team_max(found) > 0


@wp.func
def test_crossing(context: Any, querying: int, leaf: int):
    """Separates an edge and a triangle (Candidates.leaf), or keeps the triangle if it is a vertex's nearest."""
    state, search, untangling = context.state, context.search, context.extra
    triangle = search.triangle_tree.leaf[leaf]
    if querying >= 0:
        separate_crossing(state, search, untangling, search.edge_tree.leaf[querying], triangle)
    else:
        vertex = -1 - querying
        t = search.corners[leaf]
        x = position_of(state, vertex)
        a = position_of(state, t[0])
        ab = position_of(state, t[1]) - a
        ac = position_of(state, t[2]) - a
        on = nearest_on_triangle(x - a, ab, ac)
        distance = wp.length(x - a - ab * on[1] - ac * on[2])
        wp.atomic_min(untangling.nearest, vertex, distance_key(float(distance)) + wp.int64(triangle))


list_leaves = list_leaves_function(test_crossing)


@wp.func
def find_crossing(context: Any, query: Query, group: int):
    """Lists the triangles that edges may pass through, or vertices (ON_TRIANGLE) be near, of a query and a group.

    Tangled edges search themselves (ON_EDGE): a query by triangles (BY_TRIANGLE) skips them.
    """
    state, search = context.state, context.search
    triangles = wp.where(query.kind == BY_TRIANGLE, query.group, group)
    others = wp.where(query.kind == BY_TRIANGLE, group, query.group)
    if query.kind == BY_TRIANGLE:
        if is_tangled(search, query_of(ON_EDGE, others)):
            return
    margin = float(context.extra.layer_depth) + SLACK
    wide = wp.vec3f(margin, margin, margin)
    less = least_box_margin(context.contact)
    tree = search.triangle_tree
    local = team_lane()
    while local < WIDTH:
        mask = wp.uint32(0)
        querying = WIDTH * others + local
        if query.kind != ON_TRIANGLE:
            low, high = load_box(search.edge_tree, 0, querying)
            low, high = low + less, high - less
            ends = search.ends[querying]
            may = may_overlap(tree, triangles, low, high)
            mask = leaf_overlaps(tree.bound, search.corners, triangles, low, high, ends[0], ends[1], may)
        else:
            vertex = search.vertex[querying]
            low = wp.vec3f(position_of(state, wp.max(vertex, 0))) - wide
            high = low + wide + wide
            may = wp.where(vertex >= 0, may_overlap(tree, triangles, low, high), 0)
            mask = leaf_overlaps(tree.bound, search.corners, triangles, low, high, vertex, vertex, may)
            querying = -1 - vertex
        list_leaves(context, querying, triangles, mask)
        local += warp_size()


walk_groups = walk_groups_function(find_crossing)


@wp.func
def walk_of_edges(context: Any, group: int, all: bool):
    """Over the triangles that a group of edges may pass through, if any is tangled, or ``all``: the walk, the query.

    The query's group is -1 where there is nothing to search for, here and in the other two.
    """
    search, query, walk = context.search, query_of(ON_EDGE, -1), BoxWalk()
    edge = search.edge_tree.leaf[WIDTH * group]
    if edge >= 0 and (all or is_tangled(search, query_of(ON_EDGE, group))):
        less = least_box_margin(context.contact)
        low, high = load_box(search.edge_tree, 1, group)
        walk = start_walk(search.triangle_tree, low + less, high - less, 0, search.triangle_tree.leaf.shape[0])
        query.group = group
    return walk, query


@wp.func
def walk_of_triangles(context: Any, group: int, all: bool):
    """Over the edges that may pass through a group with tangled triangles, unless ``all`` search."""
    search, query, walk = context.search, query_of(BY_TRIANGLE, -1), BoxWalk()
    triangle = search.triangle_tree.leaf[WIDTH * group]
    if triangle >= 0 and not all and is_tangled(search, query_of(BY_TRIANGLE, group)):
        less = least_box_margin(context.contact)
        low, high = load_box(search.triangle_tree, 1, group)
        walk = start_walk(search.edge_tree, low + less, high - less, 0, search.edge_tree.leaf.shape[0])
        query.group = group
    return walk, query


@wp.func
def walk_of_vertices(context: Any, group: int, all: bool, side: int):
    """Over other layers' triangles near a group of vertices, if any is tangled, or ``all``.

    ``side``: those before (0) or after (1) its own layer in the tree.
    """
    search, query, walk = context.search, query_of(ON_TRIANGLE, -1), BoxWalk()
    vertex = search.vertex[WIDTH * group]
    if vertex >= 0 and (all or is_tangled(search, query_of(ON_TRIANGLE, group))):
        margin = float(context.extra.layer_depth) + SLACK
        wide = wp.vec3f(margin, margin, margin)
        own = context.extra.own_leaves[vertex]
        low, high = vertex_group_box(context.state, search, context.contact, group)
        begin = wp.where(side == 0, 0, own[1])
        end = wp.where(side == 0, own[0], search.triangle_tree.leaf.shape[0])
        walk = start_walk(search.triangle_tree, low - wide, high + wide, begin, end)
        query.group = group
    return walk, query


@functools.cache
def crossing_groups_kernel(precision: str) -> wp.Kernel:
    """Kernel ``find_crossing_groups``."""
    State = cloth_types(precision).State
    search_context = search_context_function(precision, ContactSearch, Untangling)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS, grid_stride=False)
    def find_crossing_groups(
        state: State, search: ContactSearch, contact: ContactData, untangling: Untangling, candidates: Candidates
    ):
        """Lists the groups of leaves that each group of edges, of triangles and of vertices may cross: a team each.

        Between two things of which neither was tangled at the last search, which knew all that is near, there is none.
        """
        group = wp.tid() // warp_size()
        edge_groups = search.edge_tree.leaf.shape[0] // WIDTH
        triangle_groups = search.triangle_tree.leaf.shape[0] // WIDTH
        all = search.whole[0] > 0
        context = search_context(state, search, contact, untangling, candidates)
        side, sides = int(0), int(1)
        while side < sides:  # walks at one place, and no for loop: compilers insert all that is called wherever it is
            walk, query = BoxWalk(), query_of(ON_EDGE, -1)
            if group < edge_groups:
                walk, query = walk_of_edges(context, group, all)
            elif group < edge_groups + triangle_groups:
                walk, query = walk_of_triangles(context, group - edge_groups, all)
            else:
                walk, query = walk_of_vertices(context, group - edge_groups - triangle_groups, all, side)
                sides = 2
            if query.group >= 0:
                walk_groups(context, tree_of(search, query.kind != BY_TRIANGLE), walk, query)
            side += 1

    return find_crossing_groups


def crossing_list_kernels(precision: str) -> tuple[wp.Kernel, wp.Kernel]:
    """Kernels that process the lists: of pairs of groups, and of pairs of leaves, which separate what crosses."""
    return (
        groups_kernel(precision, find_crossing, ContactSearch, Untangling),
        leaves_kernel(precision, test_crossing, ContactSearch, Untangling),
    )
