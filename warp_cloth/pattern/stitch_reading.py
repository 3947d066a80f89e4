"""The stitches of a GarmentCode specification, as single edges that are sewn together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, NoReturn, Protocol

from warp_cloth.pattern.specification import MOST_STITCHES, Panel, Side, Stitch, short

MOST_LAYERS = 8  # of cloth at one seam
WRONG_SIDE = "right_wrong"


class HolePlace(NamedTuple):
    """Where an edge of a hole is, instead of its place in the outline."""

    hole: int  # of the panel's, as listed
    edge: int  # of its loop, as listed


class Legs(NamedTuple):
    """Two edges of a hole that a stitch sews together: of a dart within a panel."""

    panel: int
    hole: int
    edges: tuple[int, int]
    stitch: int  # its number in the file


class Refusing(Protocol):
    """What reads a file: it refuses, and collects notes."""

    notes: list[str]

    def refuse(self, place: str, problem: str, remedy: str = ...) -> NoReturn: ...


def labels_of(panel: Mapping[str, Any]) -> dict[str, list[int]]:
    """The edges of a panel that have a label, by that."""
    found: dict[str, list[int]] = {}
    for number, edge in enumerate(panel["edges"]):
        label = edge.get("label") if isinstance(edge, Mapping) else None
        if isinstance(label, str) and label:
            found.setdefault(label, []).append(number)
    return found


class _InHole(NamedTuple):
    """An edge of a hole that a stitch names."""

    panel: int
    at: HolePlace
    name: str  # for messages


_Named = Side | _InHole | str  # an edge that a stitch names; the name of one that was dropped


class StitchReader:
    """Reads stitches of panels that are read; ``places``: of each edge of the file, None where it was dropped."""

    def __init__(
        self,
        reader: Refusing,
        panels: list[Panel],
        places: list[list[int | HolePlace | None]],
        labels: list[dict[str, list[int]]],
    ) -> None:
        self.refuse = reader.refuse
        self.notes = reader.notes
        self.named = {panel.name: index for index, panel in enumerate(panels)}
        self.places = places
        self.labels = labels
        self.legs: list[Legs] = []  # of darts within panels

    def stitches(self, listed: Any) -> tuple[Stitch, ...]:
        """The stitches that a file lists, as single edges; those of edges of holes become ``legs``."""
        listed = list(listed.values()) if isinstance(listed, Mapping) else [] if listed is None else listed
        if not isinstance(listed, list):
            self.refuse("pattern.stitches", "is not a list")
        if len(listed) > MOST_STITCHES:
            self.refuse("pattern.stitches", f"{len(listed):,} stitches are more than {MOST_STITCHES:,}")
        stitches: dict[frozenset[Side], Stitch] = {}
        for number, stitch in enumerate(listed):
            place = f"stitch {number}"
            stated_sides, stated = self._stated(stitch, place)
            pairs = [pair for other in stated_sides[1:] for pair in self._paired([stated_sides[0], other], place)]
            for pair_of_sides in pairs:
                if any(isinstance(side, _InHole) for side in pair_of_sides):
                    self._add_legs(self._legs(number, place, *pair_of_sides))
                    continue
                present = [side for side in pair_of_sides if isinstance(side, Side)]
                if len(present) == 1:
                    gone = next(str(side) for side in pair_of_sides if not isinstance(side, Side))
                    self.refuse(
                        place, f"sews {gone}, which has no length, to an edge that has one", "remove the stitch"
                    )
                pair = frozenset(present)
                if pair in stitches:
                    self.notes.append(f"{place} sews the same edges as stitch {stitches[pair].number}: dropped")
                elif present:
                    stitches[pair] = Stitch(number, (present[0], present[1]), stated)
        return tuple(stitches.values())

    def _stated(self, stitch: Any, place: str) -> tuple[list[Any], bool | None]:
        """The sides of a stitch, two or more layers, and whether right is sewn to wrong; None: not stated."""
        entries = list(stitch.values()) if isinstance(stitch, Mapping) else stitch
        if not isinstance(entries, list):
            self.refuse(place, "is not a pair of edges")
        if len(entries) == 1 and isinstance(entries[0], list):
            entries = entries[0]
        sides = [
            entry for entry in entries if isinstance(entry, list) or (isinstance(entry, Mapping) and "panel" in entry)
        ]
        rest = [entry for entry in entries if not any(entry is side for side in sides)]
        if not 2 <= len(sides) <= MOST_LAYERS or len(rest) > 2:
            self.refuse(place, "is not a pair of edges")
        stated: bool | None = None
        for entry in rest:
            flags = entry if isinstance(entry, Mapping) else {WRONG_SIDE: entry}
            for key, value in flags.items():
                if value is not None and not isinstance(value, str | bool):
                    self.refuse(place, "its third entry is not a text", f'it states "{WRONG_SIDE}", or nothing')
                if key == WRONG_SIDE and value is not None:
                    stated = value if isinstance(value, bool) else value == WRONG_SIDE
        return sides, stated

    def _add_legs(self, legs: Legs) -> None:
        """Takes a dart's legs, each pair once."""
        same = (each for each in self.legs if (each.panel, each.hole) == (legs.panel, legs.hole))
        before = next((each for each in same if set(each.edges) == set(legs.edges)), None)
        if before is None:
            self.legs.append(legs)
        else:
            self.notes.append(f"stitch {legs.stitch} sews the same edges as stitch {before.stitch}: dropped")

    def _legs(self, number: int, place: str, one: _Named, other: _Named) -> Legs:
        """The legs of a dart: edges of one hole."""
        rims = [side for side in (one, other) if isinstance(side, _InHole)]
        if len(rims) == 2 and len({(side.panel, side.at.hole) for side in rims}) == 1:
            return Legs(rims[0].panel, rims[0].at.hole, (rims[0].at.edge, rims[1].at.edge), number)
        name = rims[0].name
        self.refuse(place, f"sews {name}, the rim of a hole", "remove the stitch; a hole is sewn to itself alone")

    def _paired(self, stated: list[Any], place: str) -> list[tuple[_Named, _Named]]:
        """The single edges that a stitch sews together; a side may name several edges of its panel."""
        one, other = (self._sides(side, place) for side in stated)
        if len(one) == len(other):
            return list(zip(one, other, strict=True))
        if 1 not in (len(one), len(other)):
            self.refuse(place, f"sews {len(one)} edges to {len(other)}", "name as many edges on either side, or one")
        return [(a, b) for a in one for b in other]

    def _sides(self, side: Any, place: str) -> list[_Named]:
        """The edges that a side of a stitch names; the names of those that were dropped."""
        if isinstance(side, list) and len(side) == 2:
            side = {"panel": side[0], "edge": side[1]}
        name, edges = (
            (side.get("panel"), side.get("edge", side.get("edges"))) if isinstance(side, Mapping) else (None, None)
        )
        if not isinstance(name, str):
            self.refuse(place, 'a side is not {"panel": NAME, "edge": NUMBER}')
        if name not in self.named:
            self.refuse(place, f'panel "{short(name)}" is not in the pattern', "add the panel, or remove the stitch")
        panel = self.named[name]
        numbers: list[int] = []
        for edge in edges if isinstance(edges, list) else [edges]:
            edge = int(edge) if isinstance(edge, str) and edge.isdecimal() and len(edge) < 6 else edge
            edge = int(edge) if type(edge) is float and edge.is_integer() else edge
            if isinstance(edge, str) and edge in self.labels[panel]:
                numbers += self.labels[panel][edge]
            elif type(edge) is int:
                numbers.append(edge)
            else:
                self.refuse(place, 'a side is not {"panel": NAME, "edge": NUMBER}')
        return [self._side(name, number, place) for number in numbers]

    def _side(self, name: str, number: int, place: str) -> _Named:
        panel = self.named[name]
        places = self.places[panel]
        if not 0 <= number < len(places):
            problem = f'panel "{short(name)}" has no edge {short(str(number))}; its edges are 0 to {len(places) - 1}'
            self.refuse(place, problem, "correct the stitch, or remove it")
        edge = places[number]
        told = f'panel "{short(name)}", edge {number}'
        if isinstance(edge, HolePlace):
            return _InHole(panel, edge, told)
        return told if edge is None else Side(panel, edge)
