"""A pattern written as a GarmentCode specification, with our mesh of it: vertices, triangles, edges and seams."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.export.files import whole_file
from warp_cloth.pattern.assembly import SewnPattern
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Curve, Floats, to_edge_frame
from warp_cloth.pattern.specification import Panel, Pattern, Side
from warp_cloth.pattern.stitch_reading import WRONG_SIDE

PER_METRE = 100.0  # units, as GarmentCode's
STEP = 8e-3  # [m] of the straight edges that a polyline is written as
RIGHT_SIDE = "right_right"  # what a stitch states whose direction is known


def save_meshed_specification(sewn: SewnPattern, name: str, folder: Path) -> Path:
    """Writes NAME_meshed_specification.json into a folder.

    Raises:
        InputError: the file cannot be written.
    """
    path = folder / f"{name}_meshed_specification.json"
    with whole_file(path) as place:
        place.write_text(json.dumps(meshed_specification(sewn)) + "\n", encoding="utf-8")
    return path


def meshed_specification(sewn: SewnPattern) -> dict[str, Any]:
    """The specification of a pattern, and under "mesh" what it was meshed and sewn to, in the same unit."""
    pattern = sewn.pattern
    counts = _counts(pattern)
    by_panel = [[counts[Side(p, e)] for e in range(len(panel.edges))] for p, panel in enumerate(pattern.panels)]
    first = [np.cumsum([0, *own]).tolist() for own in by_panel]
    stitches: list[list[Any]] = []
    for stitch in pattern.stitches:
        stated = [] if stitch.right_to_wrong is None else [WRONG_SIDE if stitch.right_to_wrong else RIGHT_SIDE]
        count = counts[stitch.sides[0]]
        for k in range(count):
            ends = zip(stitch.sides, (k, k if stitch.right_to_wrong else count - 1 - k), strict=True)
            sides = [
                {"panel": pattern.panels[side.panel].name, "edge": first[side.panel][side.edge] + at}
                for side, at in ends
            ]
            stitches.append([*sides, *stated])
    for panel, own in zip(pattern.panels, first, strict=True):
        loops = _inner(panel)
        starts = np.cumsum([own[-1], *map(len, loops)]).tolist()
        for start, loop in list(zip(starts[:-1], loops, strict=True))[len(panel.holes) :]:
            pairs = [(start + k, start + len(loop) - 1 - k) for k in range(len(loop) // 2)]
            stitches += [[{"panel": panel.name, "edge": k} for k in pair] for pair in pairs]
    panels = {panel.name: _panel(panel, own) for panel, own in zip(pattern.panels, by_panel, strict=True)}
    return {
        "pattern": {"panels": panels, "stitches": stitches, "panel_order": list(panels)},
        "properties": {"curvature_coords": "relative", "units_in_meter": PER_METRE},
        "mesh": _mesh(sewn),
    }


def _counts(pattern: Pattern) -> dict[Side, int]:
    """The edges that each edge is written as: several straight ones of a polyline, and of what is sewn to one."""
    counts = {}
    for p, panel in enumerate(pattern.panels):
        for e, edge in enumerate(panel.edges):
            bent = isinstance(edge.curve, Chain) and not edge.curve.is_line
            counts[Side(p, e)] = max(2, int(np.ceil(edge.curve.length / STEP))) if bent else 1
    for stitch in pattern.stitches:
        both = max(counts[side] for side in stitch.sides)
        counts |= dict.fromkeys(stitch.sides, both)
    return counts


def _panel(panel: Panel, counts: Sequence[int]) -> dict[str, Any]:
    curves = [part for edge, count in zip(panel.edges, counts, strict=True) for part in _parts(edge.curve, count)]
    vertices = [curve.start for curve in curves]
    edges = [_edge(curve, k, (k + 1) % len(curves)) for k, curve in enumerate(curves)]
    for inner in _inner(panel):
        start = len(vertices)
        vertices += [curve.start for curve in inner]
        edges += [_edge(curve, start + k, start + (k + 1) % len(inner)) for k, curve in enumerate(inner)]
    rotation, translation = _rigid(panel)
    return {
        "translation": (PER_METRE * translation).tolist(),
        "rotation": _angles(rotation).tolist(),
        "vertices": (PER_METRE * np.array(vertices)).tolist(),
        "edges": edges,
    }


def _inner(panel: Panel) -> list[list[Curve]]:
    """The edges of holes and of darts within a panel, those of a dart as many on either side."""
    loops = [[part for curve in hole for part in _parts(curve, _count(curve))] for hole in panel.holes]
    for dart in panel.darts:
        counts = [max(map(_count, pair)) for pair in zip(dart.one, dart.other[::-1], strict=True)]
        both = zip(dart.loop, (*counts, *counts[::-1]), strict=True)
        loops.append([part for curve, count in both for part in _parts(curve, count)])
    return loops


def _count(curve: Curve) -> int:
    return max(2, int(np.ceil(curve.length / STEP)))


def _parts(curve: Curve, count: int) -> list[Curve]:
    """A curve, or straight pieces of even lengths between its points."""
    if count == 1:
        return [curve]
    points = curve.at(np.linspace(0.0, 1.0, count + 1))
    return [Curve(np.stack(ends)) for ends in pairwise(points)]


def _edge(curve: Curve, start: int, end: int) -> dict[str, Any]:
    edge: dict[str, Any] = {"endpoints": [start, end]}
    if curve.turn:
        params = [PER_METRE * curve.radius, int(abs(curve.turn) > np.pi), int(curve.turn > 0.0)]
        edge["curvature"] = {"type": "circle", "params": params}
    elif len(curve.points) > 2 and not isinstance(curve, Chain):
        params = to_edge_frame(curve.start, curve.end, curve.points[1:-1]).tolist()
        edge["curvature"] = {"type": ("quadratic", "cubic")[len(params) - 1], "params": params}
    return edge


def _rigid(panel: Panel) -> tuple[Floats, Floats]:
    """Rotation and translation of a panel; of one that is laid round the body, those that come nearest (Kabsch)."""
    if panel.wrap is None:
        return panel.rotation, panel.translation
    flat = np.concatenate([edge.curve.at(np.linspace(0.0, 1.0, 17)) for edge in panel.edges])
    placed = panel.placed(flat)
    flat = np.column_stack([flat, np.zeros(len(flat))])
    middle, target = flat.mean(axis=0), placed.mean(axis=0)
    u, _, vt = np.linalg.svd((flat - middle).T @ (placed - target))
    rotation = vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    return rotation, target - rotation @ middle


def _angles(rotation: Floats) -> Floats:
    """Euler angles about the fixed axes x, then y, then z [degrees]."""
    y = -np.arcsin(np.clip(rotation[2, 0], -1.0, 1.0))
    if abs(rotation[2, 0]) > 1.0 - 1e-9:  # x and z turn about one axis
        return np.degrees([np.arctan2(-rotation[1, 2], rotation[1, 1]), y, 0.0])
    return np.degrees([np.arctan2(rotation[2, 1], rotation[2, 2]), y, np.arctan2(rotation[1, 0], rotation[0, 0])])


def _mesh(sewn: SewnPattern) -> dict[str, Any]:
    """Vertices of each panel, its triangles, the vertices along each edge; which vertices seams join to one."""
    panels = {}
    local = np.empty(len(sewn.flat.points), dtype=np.int64)
    for p, panel in enumerate(sewn.pattern.panels):
        mine = np.flatnonzero(sewn.flat.panel == p)
        local[mine] = np.arange(len(mine))
        faces = sewn.flat.panel[sewn.triangles[:, 0]] == p
        outline = sewn.outlines.outlines[p]
        edges = np.array(outline.edges)
        panels[panel.name] = {
            "vertices": (PER_METRE * (sewn.flat.points[mine] - sewn.flat.origins[p])).tolist(),
            "triangles": local[sewn.triangles[faces]].tolist(),
            "garment_vertex": sewn.number[mine].tolist(),
            "edges": [[int(v) for v in np.flatnonzero(edges == e)] for e in range(len(panel.edges))],
        }
    seams = [
        {"sides": [{"panel": sewn.pattern.panels[p].name, "vertices": v.tolist()} for p, v in ((a, u), (b, w))]}
        for a, u, b, w in sewn.outlines.seams
    ]
    return {"panels": panels, "seams": seams, "vertices": (PER_METRE * sewn.mesh.points).tolist()}
