"""Reading a GarmentCode specification: a pattern's panels with their curves and placement, and its stitches, in metres.

The format is pygarment's (``NAME_specification.json``): ``pattern.panels`` by name, each with ``vertices``, ``edges``
in the order of its outline, ``translation`` and ``rotation``; ``pattern.stitches``, pairs of ``{"panel", "edge"}``,
with a third entry "right_wrong" where the right side of one cloth is sewn to the wrong side of the other; and
``properties.units_in_meter``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.curve import Curve, Floats, arc, from_edge_frame
from warp_cloth.pattern.wrap import Wrap

EXPORT_AGAIN = "export the specification again"
UNITS = (1e-3, 1e5)  # per metre: kilometres to hundredths of a millimetre
MOST_PANELS, MOST_EDGES, MOST_STITCHES = 1_000, 1_000, 20_000  # a gown with ruffles has tens of each
LARGEST, SMALLEST = 20.0, 0.005  # [m] extent of a panel: beyond it, the unit is wrong
NO_LENGTH = 1e-5  # [m]; edges up to this are dropped: no cutter resolves them, and meshes of cloth need not
FARTHEST = 1e3  # [m] from the origin
WRONG_SIDE = "right_wrong"


@dataclass(frozen=True, eq=False)
class Edge:
    """One edge of a panel's outline, by its number in the specification."""

    number: int
    curve: Curve


@dataclass(frozen=True, eq=False)
class Panel:
    """A flat panel: its outline as a closed loop, and where it is placed.

    Its outer side is the one from which the loop runs counter-clockwise. A point (x, y) of the panel starts at
    ``rotation @ (x, y, 0) + translation`` [m].
    """

    name: str
    edges: tuple[Edge, ...]
    rotation: Floats  # shape [3, 3]
    translation: Floats  # [m], shape [3]
    wrap: Wrap | None = None  # instead of both, where it is laid round the body
    notches: Floats | None = None  # [m], shape [N, 2]; drawn only
    lines: tuple[Floats, ...] = ()  # inner lines [m], shape [n, 2] each; drawn only
    holes: tuple[tuple[Curve, ...], ...] = ()  # cut out of it: closed loops of edges, counter-clockwise

    def placed(self, points: Floats) -> Floats:
        """Points of the panel [m], shape [N, 2], where they start, shape [N, 3]."""
        if self.wrap is not None:
            return self.wrap.placed(points)
        return np.asarray(points @ self.rotation[:, :2].T + self.translation)

    @property
    def area(self) -> float:
        """Area in closed form [m^2], negative where the loop runs clockwise."""
        around = sum(edge.curve.area for edge in self.edges)
        return around - math.copysign(sum(curve.area for hole in self.holes for curve in hole), around)


@dataclass(frozen=True)
class Side:
    """An edge that is sewn: the panel's place in the pattern, and the edge's place in the panel."""

    panel: int
    edge: int


@dataclass(frozen=True)
class Stitch:
    """Two edges that are sewn together, by the stitch's number in the specification."""

    number: int
    sides: tuple[Side, Side]
    right_to_wrong: bool | None  # None: not stated


@dataclass(frozen=True, eq=False)
class Pattern:
    """Panels and stitches, as the file states them but for what ``notes`` tells."""

    file: str
    panels: tuple[Panel, ...]
    stitches: tuple[Stitch, ...]
    notes: tuple[str, ...] = ()

    def refuse(self, place: str, problem: str, remedy: str) -> NoReturn:
        """Raises InputError with the file, and the panel and edge within it."""
        raise InputError(f"{self.file}: {place}" if place else self.file, problem, remedy)

    def edge_name(self, side: Side) -> str:
        panel = self.panels[side.panel]
        return f'panel "{short(panel.name)}", edge {panel.edges[side.edge].number}'


def short(text: str) -> str:
    """A name as messages show it."""
    shown = "".join(c if c.isprintable() else "?" for c in text)
    return shown if len(shown) <= 40 else shown[:37] + "..."


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

    def refuse(self, place: str, problem: str, remedy: str = EXPORT_AGAIN) -> NoReturn:
        raise InputError(f"{self.file}: {place}" if place else self.file, problem, remedy)

    def pattern(self, values: Any) -> Pattern:
        if not isinstance(values, Mapping) or not isinstance(values.get("pattern"), Mapping):
            self.refuse("", 'is not a GarmentCode specification: it has no "pattern"', "name a *_specification.json")
        pattern = values["pattern"]
        properties = values.get("properties", {})
        properties = properties if isinstance(properties, Mapping) else {}
        metres = self._unit(properties)
        relative = self._relative(properties)
        drawn = pattern.get("panels")
        if not isinstance(drawn, Mapping) or not drawn:
            self.refuse("pattern.panels", "there are no panels")
        if len(drawn) > MOST_PANELS:
            problem = f"{len(drawn):,} panels are more than the {MOST_PANELS:,} that a garment may have"
            self.refuse("pattern.panels", problem, "split the garment")
        panels, edge_places = [], []
        for name, panel in drawn.items():
            made, places = self._panel(name, panel, metres, relative)
            panels.append(made)
            edge_places.append(places)
        stitches = self._stitches(pattern.get("stitches", []), panels, edge_places)
        return Pattern(self.file, tuple(panels), stitches, tuple(self.notes))

    def _unit(self, properties: Mapping[str, Any]) -> float:
        """Metres in a unit of the file."""
        if "units_in_meter" not in properties:
            self.notes.append("units_in_meter not stated: centimetres assumed, as GarmentCode's")
            return 0.01
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

    def _panel(self, name: str, panel: Any, metres: float, relative: bool) -> tuple[Panel, list[int | None]]:
        """A panel, and the place in it of each edge of the file; None: it has no length and is left out."""
        place = f'panel "{short(name)}"'
        if not isinstance(panel, Mapping):
            self.refuse(place, "is not a table")
        if not name.strip() or any(0xD800 <= ord(letter) < 0xE000 for letter in name):  # halves of letters
            self.refuse(place, "its name is empty or no valid text", "rename it")
        corners = self._points(panel.get("vertices"), f"{place}: vertices", 2) * metres
        listed = panel.get("edges")
        if not isinstance(listed, list) or not 2 <= len(listed) <= MOST_EDGES:
            count = f"{len(listed):,} edges" if isinstance(listed, list) else "no list of edges"
            self.refuse(place, f"has {count}; an outline has 2 to {MOST_EDGES:,}")
        ends = [self._ends(edge, f"{place}, edge {i}", len(corners)) for i, edge in enumerate(listed)]
        self._check_loop(ends, place)
        self._check_size(corners[[a for a, _ in ends]], metres, place)
        moves = [panel.get(key, [0.0, 0.0, 0.0]) for key in ("translation", "rotation")]
        if "translation" not in panel:
            self.notes.append(f"{place} has no translation and starts at the origin")
        translation, angles = (
            self._numbers(value, f"{place}: {key}", 3)
            for key, value in zip(("translation", "rotation"), moves, strict=True)
        )
        if np.abs(translation * metres).max() > FARTHEST:
            self.refuse(f"{place}: translation", f"is over {FARTHEST:g} m away", "check units_in_meter")
        edges: list[Edge] = []
        places: list[int | None] = []
        for number, ((a, b), edge) in enumerate(zip(ends, listed, strict=True)):
            curve = self._curve(edge, corners[a], corners[b], f"{place}, edge {number}", metres, relative)
            places.append(None if curve is None else len(edges))
            if curve is not None:
                edges.append(Edge(number, curve))
        if len(edges) < 2:
            self.refuse(place, "has fewer than two edges that have a length")
        return Panel(name, _closed(edges), euler_xyz(angles), translation * metres), places

    def _check_size(self, corners: Floats, metres: float, place: str) -> None:
        extent = float(np.ptp(corners, axis=0).max())
        if extent > LARGEST or extent < SMALLEST:
            size = f"{extent:.4g} m" if extent > 1 else f"{1e3 * extent:.4g} mm"
            problem = f"is {size} across, as units_in_meter = {1 / metres:g}"
            self.refuse(place, problem, f"a panel is {1e3 * SMALLEST:g} mm to {LARGEST:g} m; 100 means centimetres")

    def _ends(self, edge: Any, place: str, count: int) -> tuple[int, int]:
        ends = edge.get("endpoints") if isinstance(edge, Mapping) else None
        if not isinstance(ends, list) or len(ends) != 2 or any(type(end) is not int for end in ends):
            self.refuse(place, "endpoints are not two vertex numbers")
        for end in ends:
            if not 0 <= end < count:
                self.refuse(place, f"ends at vertex {short(str(end))}, but the panel has {count:,} vertices, from 0")
        return ends[0], ends[1]

    def _check_loop(self, ends: Sequence[tuple[int, int]], place: str) -> None:
        """Each edge must start where the one before it ends, and none may come back to a vertex before the last."""
        for number, (start, _) in enumerate(ends):
            before = (number - 1) % len(ends)
            if ends[before][1] != start:
                problem = f"starts at vertex {start}, but edge {before} ends at vertex {ends[before][1]}"
                self.refuse(f"{place}, edge {number}", problem, "list the edges round the outline, in one direction")
        seen: dict[int, int] = {}
        for number, (start, _) in enumerate(ends):
            if start in seen:
                problem = f"starts at vertex {start}, where edge {seen[start]} starts, too"
                self.refuse(f"{place}, edge {number}", problem, "an outline is one loop, without holes")
            seen[start] = number

    def _curve(self, edge: Any, start: Floats, end: Floats, place: str, metres: float, relative: bool) -> Curve | None:
        """The curve of an edge [m]; None, and a note, where it has no length."""
        chord = float(np.hypot(*(end - start)))
        if chord <= NO_LENGTH:
            self.notes.append(f"{place} has no length (under {1e3 * NO_LENGTH:g} mm): dropped")
            return None
        bend = edge.get("curvature")
        if bend is None:
            return Curve(np.array([start, end]))
        kind: Any = "quadratic"
        params: Any = [bend]  # the form of older files: one control point
        if isinstance(bend, Mapping):
            kind, params = bend.get("type", ""), bend.get("params")
        if kind == "circle":
            return self._arc(params, start, end, place, metres)
        wanted = {"quadratic": 1, "cubic": 2}.get(kind if isinstance(kind, str) else "")
        if wanted is None:
            problem = f"curvature of type {short(repr(kind))} is unknown"
            self.refuse(place, problem, 'use "circle", "quadratic" or "cubic"')
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

    def _stitches(self, listed: Any, panels: list[Panel], places: list[list[int | None]]) -> tuple[Stitch, ...]:
        if not isinstance(listed, list):
            self.refuse("pattern.stitches", "is not a list")
        if len(listed) > MOST_STITCHES:
            self.refuse("pattern.stitches", f"{len(listed):,} stitches are more than {MOST_STITCHES:,}")
        named = {panel.name: index for index, panel in enumerate(panels)}
        stitches: dict[frozenset[Side], Stitch] = {}
        for number, stitch in enumerate(listed):
            place = f"stitch {number}"
            if not isinstance(stitch, list) or len(stitch) not in (2, 3):
                self.refuse(place, "is not a pair of edges")
            if len(stitch) == 3 and not isinstance(stitch[2], str):
                self.refuse(place, "its third entry is not a text", f'it states "{WRONG_SIDE}", or nothing')
            sides = [self._side(side, place, named, places) for side in stitch[:2]]
            present = [side for side in sides if isinstance(side, Side)]
            if len(present) == 1:
                gone = next(str(side) for side in sides if not isinstance(side, Side))
                self.refuse(place, f"sews {gone}, which has no length, to an edge that has one", "remove the stitch")
            pair = frozenset(present)
            if pair in stitches:
                self.notes.append(f"{place} sews the same edges as stitch {stitches[pair].number}: dropped")
            elif present:
                stated = stitch[2] == WRONG_SIDE if len(stitch) == 3 else None
                stitches[pair] = Stitch(number, (present[0], present[1]), stated)
        return tuple(stitches.values())

    def _side(self, side: Any, place: str, named: dict[str, int], places: list[list[int | None]]) -> Side | str:
        """The edge that a stitch names; its name where it was dropped."""
        name, number = (side.get("panel"), side.get("edge")) if isinstance(side, Mapping) else (None, None)
        if not isinstance(name, str) or type(number) is not int:
            self.refuse(place, 'a side is not {"panel": NAME, "edge": NUMBER}')
        if name not in named:
            self.refuse(place, f'panel "{short(name)}" is not in the pattern', "add the panel, or remove the stitch")
        panel = named[name]
        if not 0 <= number < len(places[panel]):
            problem = (
                f'panel "{short(name)}" has no edge {short(str(number))}; its edges are 0 to {len(places[panel]) - 1}'
            )
            self.refuse(place, problem, "correct the stitch, or remove it")
        edge = places[panel][number]
        return f'panel "{short(name)}", edge {number}' if edge is None else Side(panel, edge)

    def _points(self, value: Any, place: str, width: int) -> Floats:
        if not isinstance(value, list) or not value:
            self.refuse(place, "is not a list of points")
        return np.array([self._numbers(point, place, width) for point in value])

    def _numbers(self, value: Any, place: str, count: int) -> Floats:
        if not isinstance(value, list) or len(value) != count:
            self.refuse(place, f"{short(repr(value))} is not a list of {count} numbers")
        return np.array([self._number(entry, place) for entry in value])

    def _number(self, value: Any, place: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(place, f"{short(repr(value))} is not a number")
        if isinstance(value, int):
            value = float(value) if abs(value) < 10**300 else math.inf
        if not math.isfinite(value) or abs(value) > 1e12:
            self.refuse(place, f"{value:g} is not a usable number")
        return float(value)


def _closed(edges: Sequence[Edge]) -> tuple[Edge, ...]:
    """The edges with each start moved to the end of the one before, where one without length was dropped between."""
    closed = []
    for edge, before in zip(edges, [edges[-1], *edges[:-1]], strict=True):
        points = edge.curve.points.copy()
        points[0] = before.curve.points[-1]
        closed.append(Edge(edge.number, Curve(points, edge.curve.turn)))
    return tuple(closed)


def euler_xyz(degrees: Floats) -> Floats:
    """The rotation by these angles about the fixed axes x, then y, then z, as GarmentCode's; shape [3, 3]."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1.0]])
    return about_z @ about_y @ about_x
