"""Reading a GarmentCode specification: a pattern's panels with their curves and placement, and its stitches.

The format is pygarment's (``NAME_specification.json``): ``pattern.panels`` by name, each with ``vertices``, ``edges``
in the order of its outline, ``translation`` and ``rotation``; ``pattern.stitches``, pairs of ``{"panel", "edge"}``,
with a third entry "right_wrong" where the right side of one cloth is sewn to the wrong side of the other; and
``properties.units_in_meter``. What programs and models that write it leave out or write otherwise is read, too.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.curve import Curve, Floats, arc, from_edge_frame
from warp_cloth.pattern.edge_loops import Ends, loops_of
from warp_cloth.pattern.short_edges import without_short_edges
from warp_cloth.pattern.specification import (
    LARGEST,
    MOST_EDGES,
    MOST_PANELS,
    NO_LENGTH,
    SMALLEST,
    Dart,
    Edge,
    Panel,
    Pattern,
    euler_xyz,
    short,
)
from warp_cloth.pattern.specification_unit import unit_by_size
from warp_cloth.pattern.stitch_reading import HolePlace, Legs, StitchReader, labels_of

EXPORT_AGAIN = "export the specification again"
Place = int | HolePlace | None  # of an edge of the file in its panel; None: it has no length and is left out
UNITS = (1e-3, 1e5)  # per metre: kilometres to hundredths of a millimetre
FARTHEST = 1e3  # [m] from the origin
STRAIGHT = ("", "line", "straight", "linear", "none")  # types of curvature that are none


def read_specification(file: str, data: bytes) -> Pattern:
    """The pattern that the bytes of a specification file state.

    Raises:
        InputError: it cannot be read, or states an impossible panel, edge or stitch.
    """
    try:
        values = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_without_repeats)
    except UnicodeDecodeError:
        raise InputError(file, "is not a text file in UTF-8", EXPORT_AGAIN) from None
    except json.JSONDecodeError as error:
        raise InputError(f"{file}:{error.lineno}", f"is not JSON: {error.msg}", EXPORT_AGAIN) from None
    except _RepeatError as error:
        raise InputError(file, f'"{short(str(error))}" is stated twice in one table', "rename or remove one") from None
    except (RecursionError, ValueError):  # nested without end, or a number of thousands of digits
        raise InputError(file, "cannot be read as JSON", EXPORT_AGAIN) from None
    return _Reader(file).pattern(values)


class _RepeatError(Exception):
    """A key that a table states twice."""


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        names = [name for name, _ in pairs]
        raise _RepeatError(next(name for name in names if names.count(name) > 1))
    return table


class _Reader:
    """Walks the values of one file; every refusal names the place in it."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.notes: list[str] = []

    def _by_name(self, panels: Any) -> Any:
        """Panels by name; of a list, by the names that they state."""
        if not isinstance(panels, list):
            return panels
        names = [panel.get("name", panel.get("id")) if isinstance(panel, Mapping) else None for panel in panels]
        named = [name if isinstance(name, str) else f"panel_{number}" for number, name in enumerate(names)]
        if len(set(named)) < len(named):
            twice = next(name for name in named if named.count(name) > 1)
            self.refuse("pattern.panels", f'"{short(twice)}" is stated twice', "rename or remove one")
        return dict(zip(named, panels, strict=True))

    def refuse(self, place: str, problem: str, remedy: str = EXPORT_AGAIN) -> NoReturn:
        raise InputError(f"{self.file}: {place}" if place else self.file, problem, remedy)

    def pattern(self, values: Any) -> Pattern:
        values = self._alone(values)
        pattern = values.get("pattern", values) if isinstance(values, Mapping) else None
        if not isinstance(pattern, Mapping) or (pattern is values and "panels" not in pattern):
            self.refuse("", 'is not a GarmentCode specification: it has no "pattern"', "name a *_specification.json")
        properties = values.get("properties", {})
        properties = properties if isinstance(properties, Mapping) else {}
        relative = self._relative(properties)
        drawn = self._drawn(self._by_name(pattern.get("panels")))
        metres = self._unit(properties, drawn)
        panels, edge_places, labels = [], [], []
        for name, panel in drawn.items():
            made, places = self._panel(name, panel, metres, relative)
            panels.append(made)
            edge_places.append(places)
            labels.append(labels_of(panel))
        reader = StitchReader(self, panels, edge_places, labels)
        stitches = reader.stitches(pattern.get("stitches"))
        read = Pattern(self.file, tuple(self._with_darts(panels, reader.legs)), stitches, tuple(self.notes))
        return without_short_edges(read)

    def _alone(self, values: Any) -> Any:
        """The values, or the one specification that they list."""
        if not isinstance(values, list) or not any(isinstance(each, Mapping) for each in values):
            return values
        if len(values) > 1:
            self.refuse("", f"is a list of {len(values):,} tables, not one specification", "write a file for each")
        self.notes.append("is a list of one specification: that one is read")
        return values[0]

    def _drawn(self, panels: Any) -> Mapping[str, Any]:
        """The panels by name, without those of which nothing is drawn."""
        drawn = dict(panels) if isinstance(panels, Mapping) else {}
        if len(drawn) > MOST_PANELS:
            problem = f"{len(drawn):,} panels are more than the {MOST_PANELS:,} that a garment may have"
            self.refuse("pattern.panels", problem, "split the garment")
        for name, panel in [*drawn.items()]:
            states = panel if isinstance(panel, Mapping) else {"edges": panel is not None}
            if not any(states.get(key) for key in ("vertices", "edges")):
                self.notes.append(f'panel "{short(name)}" is empty: left out')
                del drawn[name]
        if not drawn:
            self.refuse("pattern.panels", "there are no panels")
        return drawn

    def _with_darts(self, panels: Sequence[Panel], legs: Sequence[Legs]) -> list[Panel]:
        """The panels, their holes darts where stitches fold them about two of their corners."""
        sewn: dict[tuple[int, int], list[Legs]] = {}
        for pair in legs:
            sewn.setdefault((pair.panel, pair.hole), []).append(pair)
        out = list(panels)
        for (index, number), pairs in sewn.items():
            hole = panels[index].holes[number]
            dart = dart_of(hole, [pair.edges for pair in pairs])
            if dart is None:
                place = ", ".join(str(pair.stitch) for pair in pairs[:6])
                place = f"stitch{'es' * (len(pairs) > 1)} {place}"
                problem = f'the hole in panel "{short(panels[index].name)}" is not sewn up from one corner to another'
                self.refuse(place, problem, "sew each edge of it to the one opposite, as a dart's legs, or none")
            out[index] = replace(out[index], darts=(*out[index].darts, dart))
        left = [[h for n, h in enumerate(p.holes) if (index, n) not in sewn] for index, p in enumerate(panels)]
        for panel, holes in zip(panels, left, strict=True):
            if holes:
                self.notes.append(f'panel "{short(panel.name)}": {len(holes)} of its loops are holes in it')
        return [replace(panel, holes=tuple(holes)) for panel, holes in zip(out, left, strict=True)]

    def _unit(self, properties: Mapping[str, Any], drawn: Mapping[str, Any]) -> float:
        """Metres in a unit of the file."""
        if properties.get("units_in_meter") is None:
            tables = ((f'panel "{short(name)}"', panel) for name, panel in drawn.items() if isinstance(panel, Mapping))
            corners = [self._corners(panel.get("vertices"), f"{place}: vertices") for place, panel in tables]
            metres, note = unit_by_size(corners)
            self.notes.append(note)
            return metres
        per_metre = self._number(properties["units_in_meter"], "properties.units_in_meter")
        if not UNITS[0] <= per_metre <= UNITS[1]:
            self.refuse("properties.units_in_meter", f"{per_metre:g} is not a unit of length", "100 means centimetres")
        return 1.0 / per_metre

    def _relative(self, properties: Mapping[str, Any]) -> bool:
        """Whether control points are relative to their edge."""
        kind = properties.get("curvature_coords", "relative")
        if kind not in ("relative", "absolute"):
            self.refuse(
                "properties.curvature_coords", f"{short(repr(kind))} is unknown", 'use "relative" or "absolute"'
            )
        return bool(kind == "relative")

    def _panel(self, name: str, panel: Any, metres: float, relative: bool) -> tuple[Panel, list[Place]]:
        """A panel, and the place in it of each edge of the file."""
        place = f'panel "{short(name)}"'
        if not isinstance(panel, Mapping):
            self.refuse(place, "is not a table")
        if not name.strip() or any(0xD800 <= ord(letter) < 0xE000 for letter in name):  # halves of letters
            self.refuse(place, "its name is empty or no valid text", "rename it")
        corners = self._corners(panel.get("vertices"), f"{place}: vertices") * metres
        listed = panel.get("edges")
        if not isinstance(listed, list) or not 2 <= len(listed) <= MOST_EDGES:
            count = f"{len(listed):,} edges" if isinstance(listed, list) else "no list of edges"
            self.refuse(place, f"has {count}; an outline has 2 to {MOST_EDGES:,}")
        ends = [self._ends(edge, f"{place}, edge {i}", len(corners)) for i, edge in enumerate(listed)]
        loops = self._loops(ends, corners, place)
        self._check_size(corners[[a for a, _ in ends]], metres, place)
        moves = [panel.get(key) or [0.0, 0.0, 0.0] for key in ("translation", "rotation")]
        if not panel.get("translation"):
            self.notes.append(f"{place} has no translation and starts at the origin")
        translation, angles = (
            self._numbers(value, f"{place}: {key}", 3)
            for key, value in zip(("translation", "rotation"), moves, strict=True)
        )
        if np.abs(translation * metres).max() > FARTHEST:
            self.refuse(f"{place}: translation", f"is over {FARTHEST:g} m away", "check units_in_meter")
        places: list[Place] = [None] * len(listed)
        outline: list[Edge] = []
        holes: list[tuple[Curve, ...]] = []
        for loop in loops:
            edges: list[Edge] = []
            for number, turned in loop:
                a, b = ends[number]
                curve = self._curve(listed[number], corners[a], corners[b], f"{place}, edge {number}", metres, relative)
                if curve is not None:
                    edges.append(Edge(number, curve.reversed if turned else curve))
            if loop is loops[0]:
                outline = edges
                for k, edge in enumerate(edges):
                    places[edge.number] = k
            elif len(edges) > 1:
                hole = _hole(_closed(edges))
                for k, edge in enumerate(hole):
                    places[edge.number] = HolePlace(len(holes), k)
                holes.append(tuple(edge.curve for edge in hole))
        if len(outline) < 2:
            self.refuse(place, "has fewer than two edges that have a length")
        return Panel(name, _closed(outline), euler_xyz(angles), translation * metres, holes=tuple(holes)), places

    def _check_size(self, corners: Floats, metres: float, place: str) -> None:
        extent = float(np.ptp(corners, axis=0).max())
        if extent > LARGEST or extent < SMALLEST:
            size = f"{extent:.4g} m" if extent > 1 else f"{1e3 * extent:.4g} mm"
            problem = f"is {size} across, as units_in_meter = {1 / metres:g}"
            self.refuse(place, problem, f"a panel is {1e3 * SMALLEST:g} mm to {LARGEST:g} m; 100 means centimetres")

    def _ends(self, edge: Any, place: str, count: int) -> tuple[int, int]:
        ends = edge.get("endpoints") if isinstance(edge, Mapping) else edge
        if not isinstance(ends, list) or len(ends) != 2:
            self.refuse(place, "endpoints are not two vertex numbers")
        ends = [int(end) if type(end) is float and end.is_integer() else end for end in ends]
        if any(type(end) is not int for end in ends):
            self.refuse(place, "endpoints are not two vertex numbers")
        for end in ends:
            if not 0 <= end < count:
                self.refuse(place, f"ends at vertex {short(str(end))}, but the panel has {count:,} vertices, from 0")
        return ends[0], ends[1]

    def _loops(self, ends: Ends, corners: Floats, place: str) -> list[list[tuple[int, bool]]]:
        """The loops of a panel, the outline first: the number of each edge, and whether it runs against the loop."""
        numbers = [number for number, (start, end) in enumerate(ends) if start != end]
        for number in sorted({*range(len(ends))} - {*numbers}):
            self.notes.append(f"{place}, edge {number} starts and ends at one vertex: dropped")
        found, mended = loops_of([ends[number] for number in numbers], corners)
        loops = [[(numbers[k], turned) for k, turned in loop] for loop in found]
        if not loops:
            self._refuse_loop(ends, place)
        if mended:
            self.notes.append(f"{place}: its edges are not listed round the outline: put in order")
        return loops

    def _refuse_loop(self, ends: Ends, place: str) -> NoReturn:
        """Says where edges do not follow each other."""
        for number, (start, _) in enumerate(ends):
            before = (number - 1) % len(ends)
            if ends[before][1] != start:
                problem = f"starts at vertex {start}, but edge {before} ends at vertex {ends[before][1]}"
                self.refuse(f"{place}, edge {number}", problem, "list the edges round the outline, in one direction")
        starts = [start for start, _ in ends]
        number = next((n for n, start in enumerate(starts) if start in starts[:n]), 0)
        problem = f"starts at vertex {starts[number]}, where edge {starts.index(starts[number])} starts, too"
        self.refuse(f"{place}, edge {number}", problem, "an outline comes to each vertex once")

    def _curve(self, edge: Any, start: Floats, end: Floats, place: str, metres: float, relative: bool) -> Curve | None:
        """The curve of an edge [m]; None, and a note, where it has no length."""
        chord = float(np.hypot(*(end - start)))
        if chord <= NO_LENGTH:
            self.notes.append(f"{place} has no length (under {1e3 * NO_LENGTH:g} mm): dropped")
            return None
        bend = edge.get("curvature") if isinstance(edge, Mapping) else None
        kind: Any = ""
        params: Any = bend
        if isinstance(bend, Mapping):
            kind, params = bend.get("type") or "", bend.get("params")
        elif isinstance(bend, list) and bend:  # older files state control points alone, one or two
            kind = "cubic" if len(bend) > 1 and isinstance(bend[0], list) else "quadratic"
        elif bend:
            kind = bend
        kind = kind.lower() if isinstance(kind, str) else kind
        if kind in STRAIGHT:
            return Curve(np.array([start, end]))
        if kind in ("circle", "arc"):
            return self._arc(params, start, end, place, metres)
        wanted = {"quadratic": 1, "cubic": 2}.get(kind if isinstance(kind, str) else "")
        if wanted is None:
            problem = f"curvature of type {short(repr(kind))} is unknown"
            self.refuse(place, problem, 'use "circle", "quadratic" or "cubic"')
        params = [_as_list(point) for point in params] if isinstance(params, list) else params
        if isinstance(params, list) and len(params) == 2 * wanted and not any(isinstance(p, list) for p in params):
            params = [params[:2], params[2:]][:wanted]  # all numbers in one list
        controls = self._points(params, f"{place}: curvature", 2)
        if len(controls) != wanted:
            self.refuse(place, f"a {kind} curve has {wanted} control point(s), not {len(controls)}")
        controls = from_edge_frame(start, end, controls) if relative else controls * metres
        if np.abs(controls).max() > LARGEST * 10:
            self.refuse(place, "has control points far from the panel", "check units and curvature_coords")
        return Curve(np.vstack([start, controls, end]))

    def _arc(self, params: Any, start: Floats, end: Floats, place: str, metres: float) -> Curve:
        if not isinstance(params, list) or len(params) != 3:
            self.refuse(place, "a circle's params are not [radius, large_arc, right]")
        radius = self._number(params[0], f"{place}: radius") * metres
        if any(not isinstance(flag, bool) and flag not in (0, 1) for flag in params[1:]):
            self.refuse(place, "large_arc and right of a circle are not true or false")
        half = 0.5 * float(np.hypot(*(end - start)))
        if not 1e-9 < radius < 1e9:
            self.refuse(place, f"a circle's radius of {1e3 * radius:.4g} mm is impossible")
        if radius < 0.999 * half:
            told = f"its radius of {1e3 * radius:.4g} mm is less than half the distance of its ends"
            self.notes.append(f"{place}: {told}: half a circle instead")
        elif radius > 1e4 * half and not params[1]:
            return Curve(np.array([start, end]))  # straight to within 1e-5 of its length
        return arc(start, end, radius, bool(params[1]), bool(params[2]))

    def _corners(self, value: Any, place: str) -> Floats:
        """Vertices of a panel; a third coordinate must be 0."""
        value = [_as_list(point) for point in value] if isinstance(value, list) else value
        if isinstance(value, list) and value and all(isinstance(point, list) and len(point) == 3 for point in value):
            points = self._points(value, place, 3)
            if np.abs(points[:, 2]).max() > 1e-6 * max(1.0, float(np.abs(points).max())):
                self.refuse(place, "are not in the plane of the panel", "state x and y alone")
            return points[:, :2]
        return self._points(value, place, 2)

    def _points(self, value: Any, place: str, width: int) -> Floats:
        if not isinstance(value, list) or not value:
            self.refuse(place, "is not a list of points")
        return np.array([self._numbers(point, place, width) for point in value])

    def _numbers(self, value: Any, place: str, count: int) -> Floats:
        value = _as_list(value)
        if not isinstance(value, list) or len(value) != count:
            self.refuse(place, f"{short(repr(value))} is not a list of {count} numbers")
        return np.array([self._number(entry, place) for entry in value])

    def _number(self, value: Any, place: str) -> float:
        if isinstance(value, str):  # "100", as some writers have it
            with contextlib.suppress(ValueError):
                value = float(value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(place, f"{short(repr(value))} is not a number")
        if isinstance(value, int):
            value = float(value) if abs(value) < 10**300 else math.inf
        if not math.isfinite(value) or abs(value) > 1e12:
            self.refuse(place, f"{value:g} is not a usable number")
        return float(value)


def _as_list(point: Any) -> Any:
    """The coordinates of a point that states them by name, ``{"x": 1, "y": 2}``; what else it is, as it is."""
    if not isinstance(point, Mapping):
        return point
    named = {key.lower(): value for key, value in point.items() if isinstance(key, str)}
    axes = next((axes for axes in ("xy", "xyz") if {*named} == {*axes}), "")
    return [named[axis] for axis in axes] if axes and len(named) == len(point) else point


def _hole(edges: Sequence[Edge]) -> tuple[Edge, ...]:
    """The loop of a hole, counter-clockwise."""
    if sum(edge.curve.area for edge in edges) >= 0.0:
        return tuple(edges)
    return tuple(Edge(edge.number, edge.curve.reversed) for edge in edges[::-1])


def dart_of(hole: Sequence[Curve], legs: Sequence[tuple[int, int]]) -> Dart | None:
    """A hole as a dart, by the pairs of its edges that are sewn together: folded about the corner between two of them.

    None: they do not fold it so, or not all of it.
    """
    count = len(hole)
    mirrored = {(one + other) % count for one, other in legs}
    if len(mirrored) != 1 or {edge for pair in legs for edge in pair} != set(range(count)) or 2 * len(legs) != count:
        return None
    tip = (mirrored.pop() - 1) // 2 + 1  # the corner at which an edge and the one that it is sewn to meet
    order = [hole[(tip + k) % count] for k in range(count)]
    return Dart(tuple(order[: count // 2]), tuple(order[count // 2 :]))


def _closed(edges: Sequence[Edge]) -> tuple[Edge, ...]:
    """The edges with each start moved to the end of the one before, where one without length was dropped between."""
    closed = []
    for edge, before in zip(edges, [edges[-1], *edges[:-1]], strict=True):
        points = edge.curve.points.copy()
        points[0] = before.curve.points[-1]
        closed.append(Edge(edge.number, Curve(points, edge.curve.turn)))
    return tuple(closed)
