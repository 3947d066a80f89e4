"""The broad phase of cloth contact: the solver's own box tree against ``wp.Bvh``, over the same worn garments.

    python tests/benchmarks/broad_phase.py --device cuda:0 --vertices 4000 16000 64000

One T-shirt that hangs by its neck, front on back, and one over another on a mannequin. The solver sews them; then every
search starts from the same positions: it updates the boxes of all triangles and edges, widened by the search margin,
tests vertices against triangles and edges against edges, and lists what passes the exact distance test.

- ``box_tree``: the solver's own launches;
- ``bvh_refit``: ``wp.Bvh.refit`` and a thread for each vertex and edge (``wp.bvh_query_aabb``);
- ``bvh_rebuild``: the same with ``wp.Bvh.rebuild``;
- ``bvh_tiled``: refit, and a block of 32 threads for each vertex and edge (``wp.tile_bvh_query_aabb``); a GPU's.

All boxes are the same to the bit, and so must the lists be; the script exits with 1 where they are not. On CUDA each
search is one captured graph, timed by events in rounds that take turns; ratios are of medians of one run.
"""

import argparse
import functools
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import warp as wp
from measured import Figures, add_write_option
from numpy.typing import NDArray
from wearing import NEVER, Tree, mannequin, shirt

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.contact.cloth import ClothContact
from warp_cloth.fitting.problem import Problem, collider_updates, load_problem
from warp_cloth.kernels.base.access import position_of
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.contact.arrays import ContactData
from warp_cloth.kernels.contact.crossing import has_vertex
from warp_cloth.kernels.contact.pairs import near_test_function
from warp_cloth.kernels.contact.search import ContactSearch, box_margin, edge_box, triangle_box
from warp_cloth.kernels.contact.stick_memory import StickMemory, begin_search
from warp_cloth.scene import load_scene
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_to_rest

TILE = 32  # threads of a tiled query
EDGE_MM, VERTICES_THERE = 12.0, 6200  # the edge length at which a T-shirt has about so many vertices
Search = Callable[[], None]


@wp.struct
class Boxes:
    """What ``wp.Bvh`` is built over: F triangles and E edges, in the order of the box tree's leaves."""

    triangle_leaf: wp.array(dtype=wp.int32)  # which leaf of the box tree each is, shape [F]
    triangle_lower: wp.array(dtype=wp.vec3f)  # [m], shape [F]; above the upper corner where the box is empty
    triangle_upper: wp.array(dtype=wp.vec3f)
    edge_leaf: wp.array(dtype=wp.int32)  # shape [E]
    edge_lower: wp.array(dtype=wp.vec3f)  # [m], shape [E]
    edge_upper: wp.array(dtype=wp.vec3f)


@functools.cache
def boxes_kernel(precision: str) -> wp.Kernel:
    """Kernel ``update_boxes``."""
    State = cloth_types(precision).State

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def update_boxes(state: State, search: ContactSearch, contact: ContactData, memory: StickMemory, boxes: Boxes):
        """Stores the box of a triangle or an edge, as search.refit_kernel does, and empties the pair list."""
        thread = wp.tid()
        if thread == 0:
            contact.pairs.count[0] = 0
            begin_search(memory)
        row = thread - boxes.triangle_leaf.shape[0]
        if row < 0:
            lower, upper = triangle_box(state, search, contact, boxes.triangle_leaf[thread])
            boxes.triangle_lower[thread] = lower
            boxes.triangle_upper[thread] = upper
        else:
            edge_lower, edge_upper = edge_box(state, search, contact, boxes.edge_leaf[row])
            boxes.edge_lower[row] = edge_lower
            boxes.edge_upper[row] = edge_upper

    return update_boxes


@functools.cache
def near_functions(precision: str) -> tuple[wp.Function, wp.Function]:
    """Functions that test a vertex against a triangle, and two edges, whose boxes meet, and list them where near."""
    State = cloth_types(precision).State
    test_near = near_test_function(precision)

    @wp.func
    def test_triangle(
        state: State, search: ContactSearch, contact: ContactData, memory: StickMemory, vertex: int, leaf: int
    ):
        """Lists a vertex and a triangle without it, if they are near each other."""
        if not has_vertex(search.corners[leaf], vertex):
            test_near(state, search, contact, memory, -1 - vertex, leaf)

    @wp.func
    def test_edge(
        state: State, search: ContactSearch, contact: ContactData, memory: StickMemory, leaf: int, other: int
    ):
        """Lists two edges without a common end, if they are near each other."""
        ends, others = search.ends[leaf], search.ends[other]
        if ends[0] != others[0] and ends[0] != others[1] and ends[1] != others[0] and ends[1] != others[1]:
            test_near(state, search, contact, memory, leaf, other)

    return test_triangle, test_edge


@functools.cache
def query_kernel(precision: str) -> wp.Kernel:
    """Kernel ``query_bvh``."""
    State = cloth_types(precision).State
    test_triangle, test_edge = near_functions(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def query_bvh(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        memory: StickMemory,
        boxes: Boxes,
        triangles: wp.uint64,  # wp.Bvh of the triangles' boxes
        edges: wp.uint64,
    ):
        """Lists what is near an edge, or a vertex: a thread for each."""
        row = wp.tid()
        vertex_row = row - boxes.edge_leaf.shape[0]
        other = wp.int32(0)
        if vertex_row < 0:
            query = wp.bvh_query_aabb(edges, boxes.edge_lower[row], boxes.edge_upper[row])
            while wp.bvh_query_next(query, other):
                if other > row:
                    test_edge(state, search, contact, memory, boxes.edge_leaf[row], boxes.edge_leaf[other])
        else:
            vertex = search.vertex[vertex_row]
            if vertex >= 0:
                x = wp.vec3f(position_of(state, vertex))
                wide = box_margin(contact, contact.trigger.skin[vertex])
                query = wp.bvh_query_aabb(triangles, x - wide, x + wide)
                while wp.bvh_query_next(query, other):
                    test_triangle(state, search, contact, memory, vertex, boxes.triangle_leaf[other])

    return query_bvh


@functools.cache
def tiled_kernel(precision: str) -> wp.Kernel:
    """Kernel ``query_bvh_tiled``."""
    State = cloth_types(precision).State
    test_triangle, test_edge = near_functions(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def query_bvh_tiled(
        state: State,
        search: ContactSearch,
        contact: ContactData,
        memory: StickMemory,
        boxes: Boxes,
        triangles: wp.uint64,  # as of query_bvh
        edges: wp.uint64,
    ):
        """Lists what is near an edge, or a vertex: a block of TILE threads for each."""
        row = wp.tid()
        vertex_row = row - boxes.edge_leaf.shape[0]
        if vertex_row < 0:
            query = wp.tile_bvh_query_aabb(edges, boxes.edge_lower[row], boxes.edge_upper[row])
            while wp.tile_query_valid(query):
                other = wp.untile(wp.tile_bvh_query_next(query))
                if other > row:  # and there is one
                    test_edge(state, search, contact, memory, boxes.edge_leaf[row], boxes.edge_leaf[other])
        else:
            vertex = search.vertex[vertex_row]
            if vertex >= 0:
                x = wp.vec3f(position_of(state, vertex))
                wide = box_margin(contact, contact.trigger.skin[vertex])
                query = wp.tile_bvh_query_aabb(triangles, x - wide, x + wide)
                while wp.tile_query_valid(query):
                    other = wp.untile(wp.tile_bvh_query_next(query))
                    if other >= 0:
                        test_triangle(state, search, contact, memory, vertex, boxes.triangle_leaf[other])

    return query_bvh_tiled


class BvhSearch:
    """The same search by ``wp.Bvh``."""

    def __init__(self, cloth_contact: ClothContact, state: Any, precision: str) -> None:
        self._precision, self._search, self._device = (
            precision,
            cloth_contact.pair_search.geometry,
            cloth_contact.data.trigger.skin.device,
        )
        self._inputs = [state, cloth_contact.pair_search.geometry, cloth_contact.data, cloth_contact.pair_search.memory]
        self._boxes = boxes = Boxes()
        with wp.ScopedDevice(self._device):
            for name, tree in (("triangle", self._search.triangle_tree), ("edge", self._search.edge_tree)):
                leaves = np.flatnonzero(tree.leaf.numpy() >= 0).astype(np.int32)
                setattr(boxes, f"{name}_leaf", wp.array(leaves, dtype=wp.int32))
                for corner in ("lower", "upper"):
                    setattr(boxes, f"{name}_{corner}", wp.zeros(len(leaves), dtype=wp.vec3f))
            self._update()
            self._triangles = wp.Bvh(boxes.triangle_lower, boxes.triangle_upper)
            self._edges = wp.Bvh(boxes.edge_lower, boxes.edge_upper)

    def _update(self) -> None:
        count = len(self._boxes.triangle_leaf) + len(self._boxes.edge_leaf)
        wp.launch(boxes_kernel(self._precision), count, [*self._inputs, self._boxes], device=self._device)

    def run(self, *, rebuild: bool = False, tiled: bool = False) -> None:
        """One search."""
        self._update()
        for tree in (self._triangles, self._edges):
            tree.rebuild() if rebuild else tree.refit()
        queries = len(self._boxes.edge_leaf) + self._search.vertex.size
        inputs = [*self._inputs, self._boxes, self._triangles.id, self._edges.id]
        if tiled:
            kernel = tiled_kernel(self._precision)
            wp.launch_tiled(kernel, dim=[queries], inputs=inputs, device=self._device, block_dim=TILE)
        else:
            wp.launch(query_kernel(self._precision), queries, inputs, device=self._device)


def worn(layers: int, vertices: int, iterations: int, device: str) -> Problem:
    """T-shirts over each other of so many vertices together, after so many iterations."""
    edge = EDGE_MM * (VERTICES_THERE * layers / vertices) ** 0.5
    if layers == 1:  # on a body it hardly meets itself
        scene: Tree = {"garment": {**shirt("M", edge), "pin": {"loop": "top"}}}
    else:
        scene = {"garment": [shirt("M", edge), shirt("L", edge, "denim")], "avatar": mannequin("M")}
    problem = load_problem(load_scene({**scene, "collision": {"cloth": True}}), device)
    relax_to_rest(
        problem.relaxation,
        problem.certifier,
        Goal(NEVER, iterations),
        follow=collider_updates(problem),
        schedule=problem.schedule,
    )
    return problem


def listed(contact: Any) -> NDArray[np.int32]:
    """The pairs found, in an order of their own, shape [N, 5]."""
    count = int(contact.pairs.count.numpy()[0])
    assert count <= len(contact.pairs.corners), "no room for all pairs"
    rows = np.column_stack([contact.pairs.kind.numpy()[:count], contact.pairs.corners.numpy()[:count]])
    return rows[np.lexsort(rows.T)]


def timed(searches: dict[str, Search], rounds: int, device: wp.Device) -> dict[str, float]:
    """Median seconds of each search; they take turns."""
    graphs: dict[str, Any] = {}
    if device.is_cuda:
        for name, search in searches.items():
            with wp.ScopedCapture(device=device) as capture:
                search()
            graphs[name] = capture.graph
    seconds: dict[str, list[float]] = {name: [] for name in searches}
    for _ in range(rounds + 1):  # the first is not counted
        for name, search in searches.items():
            if device.is_cuda:
                begin, end = (wp.Event(device, enable_timing=True) for _ in range(2))
                wp.record_event(begin)
                wp.capture_launch(graphs[name])
                wp.record_event(end)
                seconds[name].append(1e-3 * wp.get_event_elapsed_time(begin, end))
            else:
                began = time.perf_counter()
                search()
                seconds[name].append(time.perf_counter() - began)
    return {name: float(np.median(spent[1:])) for name, spent in seconds.items()}


def compare(figures: Figures, name: str, problem: Problem, rounds: int, *, tiled: bool) -> bool:
    """Adds the time of each search of a scene; returns whether all found the same pairs."""
    cloth_contact, device = problem.relaxation.cloth_contact, wp.get_device(problem.model.device)
    assert cloth_contact is not None
    state = problem.relaxation.contact_state()
    if not cloth_contact.awake:
        cloth_contact.awaken(state)
    cloth_contact.search(state)
    while cloth_contact.grow():
        cloth_contact.search(state)
    bvh = BvhSearch(cloth_contact, state, problem.model.precision)

    def box_tree() -> None:
        # without start_search, which would change the skins; it also empties the candidate lists
        cloth_contact.pair_search.near_candidates.count.zero_()
        cloth_contact.pair_search.refit(state, cloth_contact.data)
        cloth_contact.pair_search.list_near(state, cloth_contact.data)

    searches: dict[str, Search] = {
        "box_tree": box_tree,
        "bvh_refit": bvh.run,
        "bvh_rebuild": functools.partial(bvh.run, rebuild=True),
    }
    if tiled:
        searches["bvh_tiled"] = functools.partial(bvh.run, tiled=True)
    found = {}
    for search, run in searches.items():
        run()
        found[search] = listed(cloth_contact.data)
    figures.add(f"{name}.vertices", problem.model.vertex_count, "vertices")
    figures.add(f"{name}.pairs", len(found["box_tree"]), "pairs")
    same = {search: bool(np.array_equal(rows, found["box_tree"])) for search, rows in found.items()}
    seconds = timed(searches, rounds, device)
    for search, spent in seconds.items():
        figures.add(f"{name}.{search}", 1e6 * spent, "us")
        if search != "box_tree":
            figures.add(f"{name}.{search}_ratio", spent / seconds["box_tree"], "times box_tree")
        if not same[search]:
            print(f"{search} lists other pairs than box_tree: {len(found[search])} pairs", file=sys.stderr)
    return all(same.values())


def main(given: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--vertices", type=int, nargs="+", default=[4000], help="of all garments of a scene")
    parser.add_argument("--layers", type=int, nargs="+", choices=(1, 2), default=[1, 2], help="T-shirts")
    parser.add_argument("--iterations", type=int, default=6000, help="before the searches are timed")
    parser.add_argument("--rounds", type=int, default=50, help="searches of each kind")
    parser.add_argument("--tiled", action="store_true", help="run the tiled query on a CPU, too")
    add_write_option(parser)
    options = parser.parse_args(given)
    agree = True
    tiled = options.tiled or wp.get_device(options.device).is_cuda
    with Figures(__file__, options, device=options.device, cores=1) as figures:
        for layers in options.layers:
            for vertices in options.vertices:
                problem = worn(layers, vertices, options.iterations, options.device)
                name = f"{('one_shirt', 'two_layers')[layers - 1]}.{round(vertices / 1000)}k"
                agree &= compare(figures, name, problem, options.rounds, tiled=tiled)
    return 0 if agree else 1


if __name__ == "__main__":
    start_warp()
    sys.exit(main())
