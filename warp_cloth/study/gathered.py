"""What threads for triangles, edges or vertices are led to in other arrays, by what meshes say lies where."""

from __future__ import annotations

import numpy as np

from warp_cloth.kernels.contact.box_tree import LEAVES, WIDTH
from warp_cloth.study.asked import STORED, THREADS, Arrays, Numbers, Part, integers, joined
from warp_cloth.study.launches import Launch
from warp_cloth.study.traffic import Uses

TRIANGLE = 2**32 - 1  # the part of kernels.contact.untangle's ``beyond`` that names one
PLACED = (
    "cloth.position",
    "cloth.move",
    "cloth.moved",
)  # of vertices, whichever is asked for


def gathered_work(launch: Launch, arrays: Arrays, uses: Uses) -> dict[str, Part]:
    """What a launch asks for beyond what is its threads' own; as of ``STORED``, what its threads store one by one.

    Of leeway, of what measures normals, boxes cloth, or keeps what is tangled from being pressed and layers in
    their order.
    """
    if "patches.patch" in arrays:
        return {}
    threads = launch.threads
    if "rows.triangle" in arrays and threads == len(arrays["rows.triangle_start"]) - 1:
        return _rows_work(arrays)
    if "edges.beside" in arrays and threads == len(arrays["edges.ends"]):
        return _edges_work(arrays)
    if "triangles.corners" in arrays and threads == len(arrays["triangles.corners"]):
        of_triangles = _corners(arrays, np.arange(threads) // THREADS, np.arange(threads))
        return dict.fromkeys(PLACED, of_triangles)
    if "search.sides" in uses.read:
        return _boxes_work(arrays)
    if "untangling.rim" in uses.read:
        return _layers_work(arrays, launch.arguments["untangling"].layer_reach)
    if "search.tangled" in uses.read and "contact.corners" in uses.read:
        pair = np.arange(min(int(arrays["contact.count"].numpy()[0]), len(arrays["contact.corners"])))
        corners = integers(arrays["contact.corners"])[pair]
        return {"search.tangled": (np.repeat(pair // THREADS, corners.shape[1]), corners.ravel())}
    return {}


def _boxes_work(arrays: Arrays) -> dict[str, Part]:
    """Of blocks that box so many LEAVES each, edges first, and then the groups of these and of those."""
    edge, triangle = (integers(arrays[f"search.{tree}_tree.leaf"]) for tree in ("edge", "triangle"))
    edges, triangles = np.flatnonzero(edge >= 0), np.flatnonzero(triangle >= 0)
    of_edges, of_triangles = edges // int(LEAVES), (len(edge) + triangles) // int(LEAVES)
    ends, corners = integers(arrays["search.ends"])[edges], integers(arrays["search.corners"])[triangles]
    sides = integers(arrays["search.sides"])[triangle[triangles]]
    vertices = joined((np.repeat(of_edges, 2), ends.ravel()), (np.repeat(of_triangles, 3), corners.ravel()))
    found = dict.fromkeys(("cloth.position", "contact.skin"), vertices)
    found["search.sides"] = of_triangles, triangle[triangles]
    found["search.longest"] = joined((of_edges, edge[edges]), (np.repeat(of_triangles, 3), sides.ravel()))
    for tree, leaf in (("edge", edge), ("triangle", triangle)):
        found[f"{STORED}search.{tree}_tree.bound"] = _put_boxes(leaf, integers(arrays[f"search.{tree}_tree.first"]))
    return found


def _put_boxes(leaf: Numbers, first: Numbers) -> Part:
    """Instructions, and the numbers of a tree's boxes: of leaves side by side, of both levels above one by one."""
    numbers = np.arange(6 * len(leaf))
    above = []
    for level, size in ((1, int(WIDTH)), (2, int(LEAVES))):
        box = np.arange(len(leaf) // size)
        at = 6 * int(WIDTH) * (first[level] + box // int(WIDTH)) + box % int(WIDTH)
        above.append((at[:, None] + int(WIDTH) * np.arange(6)).ravel())
    one_by_one = np.concatenate(above)
    return joined((numbers // len(numbers), numbers), (1 + np.arange(len(one_by_one)), one_by_one))


def _layers_work(arrays: Arrays, reach: float) -> dict[str, Part]:
    """Of vertices that have another layer's triangle near them; of those that are shifted only the number is known.

    Each shifts four vertices, number by number.
    """
    beyond = integers(arrays["untangling.beyond"])
    vertex = np.flatnonzero(beyond < int(np.float32(reach).view(np.int32)) << 32)
    triangle = beyond[vertex] & TRIANGLE
    block, corners = vertex // THREADS, integers(arrays["search.triangles"])[triangle]
    others = np.repeat(block, 3), corners.ravel()
    count = min(int(arrays["untangling.count"].numpy()[1]), len(vertex))
    shifted = np.arange(count) * len(vertex) // max(count, 1)
    four = np.column_stack([vertex, corners])[shifted]
    instruction = (vertex[shifted, None] // int(WIDTH) * 4 + np.arange(4)).ravel()
    return {
        "cloth.position": joined((block, vertex), others),
        "search.triangles": (block, triangle),
        "untangling.rim": others,
        "untangling.layer": joined((block, vertex), (block, corners[:, 0])),
        "untangling.outward": (block, corners[:, 0]),
        "contact.thickness": (block[shifted], vertex[shifted]),
        STORED + "untangling.sum": (
            (4 * instruction[:, None] + np.arange(4)).ravel(),
            np.repeat(four.ravel(), 4),
        ),
        STORED + "untangling.crosses": (instruction, four.ravel()),
    }


def _rows_work(arrays: Arrays) -> dict[str, Part]:
    """Of vertices, each of which goes through the triangles that it is a corner of."""
    start = integers(arrays["rows.triangle_start"])
    block = np.repeat(np.arange(len(start) - 1), np.diff(start)) // THREADS
    triangle = integers(arrays["rows.triangle"]) // 3
    found = dict.fromkeys(PLACED, _corners(arrays, block, triangle))
    of_triangles = ("triangles.corners", "triangles.edges", "triangles.slope", "triangles.threads")
    found |= dict.fromkeys(of_triangles, (block, triangle))
    if "triangles.edges" in arrays:
        edges = integers(arrays["triangles.edges"])[triangle]
        found["bound"] = np.repeat(block, 3), np.where(edges < 0, -1 - edges, edges).ravel()
    return found


def _edges_work(arrays: Arrays) -> dict[str, Part]:
    """Of edges, each of which looks at its ends and the triangles beside it."""
    ends, beside = (integers(arrays[f"edges.{name}"]) for name in ("ends", "beside"))
    block = np.repeat(np.arange(len(ends)) // THREADS, 2)
    inner = beside.ravel() >= 0
    found = dict.fromkeys(PLACED, (block, ends.ravel()))
    return found | {"normal": (block[inner], beside.ravel()[inner])}


def _corners(arrays: Arrays, block: Numbers, triangle: Numbers) -> Part:
    """Blocks, and the corners of triangles."""
    return np.repeat(block, 3), integers(arrays["triangles.corners"])[triangle].ravel()
