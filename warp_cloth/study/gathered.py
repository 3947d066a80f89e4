"""What threads for triangles, edges or vertices are led to in other arrays, by what meshes say lies where."""

from __future__ import annotations

import numpy as np

from warp_cloth.study.asked import THREADS, Arrays, Numbers, Part, integers


def gathered_work(arrays: Arrays, threads: int) -> dict[str, Part]:
    """What a launch of kernels.leeway, or one that measures normals, asks for beyond what is its threads' own."""
    if "patches.patch" in arrays:
        return {}
    if "rows.triangle" in arrays and threads == len(arrays["rows.triangle_start"]) - 1:
        return _rows_work(arrays)
    if "edges.beside" in arrays and threads == len(arrays["edges.ends"]):
        return _edges_work(arrays)
    if "triangles.corners" in arrays and threads == len(arrays["triangles.corners"]):
        corners = _corners(arrays, np.arange(threads) // THREADS, np.arange(threads))
        return dict.fromkeys(("cloth.position", "cloth.move"), corners)
    return {}


def _rows_work(arrays: Arrays) -> dict[str, Part]:
    """Of vertices, each of which goes through the triangles that it is a corner of."""
    start = integers(arrays["rows.triangle_start"])
    block = np.repeat(np.arange(len(start) - 1), np.diff(start)) // THREADS
    triangle = integers(arrays["rows.triangle"]) // 3
    found = dict.fromkeys(("cloth.position", "cloth.move"), _corners(arrays, block, triangle))
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
    found = dict.fromkeys(("cloth.position", "cloth.move"), (block, ends.ravel()))
    return found | {"normal": (block[inner], beside.ravel()[inner])}


def _corners(arrays: Arrays, block: Numbers, triangle: Numbers) -> Part:
    """Blocks, and the corners of triangles."""
    return np.repeat(block, 3), integers(arrays["triangles.corners"])[triangle].ravel()
