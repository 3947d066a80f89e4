"""What a pattern is: panels with their curves and placement, and stitches, in metres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NoReturn

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.curve import Curve, Floats
from warp_cloth.pattern.wrap import Laid, Ring

MOST_PANELS, MOST_EDGES, MOST_STITCHES = 1_000, 1_000, 20_000  # a gown with ruffles has tens of each
LARGEST, SMALLEST = 20.0, 0.005  # [m] extent of a panel: beyond it, the unit is wrong
NO_LENGTH = 1e-5  # [m]; edges up to this are dropped: no cutter resolves them, and meshes of cloth need not


@dataclass(frozen=True, eq=False)
class Edge:
    """One edge of a panel's outline, by its number in the specification."""

    number: int
    curve: Curve


@dataclass(frozen=True, eq=False)
class Dart:
    """A dart within a panel: cut out from one tip to the other, its legs sewn together.

    Curves of ``one`` lead from the first tip to the second, those of ``other`` back, counter-clockwise together; the
    first of one is sewn to the last of the other.
    """

    one: tuple[Curve, ...]
    other: tuple[Curve, ...]  # as many

    @property
    def loop(self) -> tuple[Curve, ...]:
        return (*self.one, *self.other)


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
    wrap: Laid | Ring | None = None  # instead of both, where it is laid round the body, or on another panel
    notches: Floats | None = None  # [m], shape [N, 2]; drawn only
    lines: tuple[Floats, ...] = ()  # inner lines [m], shape [n, 2] each; drawn only
    holes: tuple[tuple[Curve, ...], ...] = ()  # cut out of it: closed loops of edges, counter-clockwise
    darts: tuple[Dart, ...] = ()  # within it; others are edges of the outline

    def placed(self, points: Floats) -> Floats:
        """Points of the panel [m], shape [N, 2], where they start, shape [N, 3]."""
        if self.wrap is not None:
            return self.wrap.placed(points)
        return np.asarray(points @ self.rotation[:, :2].T + self.translation)

    @cached_property
    def area(self) -> float:
        """Area in closed form [m^2], negative where the loop runs clockwise."""
        around = sum(edge.curve.area for edge in self.edges)
        return around - math.copysign(sum(curve.area for loop in self.cut_out for curve in loop), around)

    @property
    def cut_out(self) -> tuple[tuple[Curve, ...], ...]:
        """The loops of its holes and of the darts within it, counter-clockwise."""
        return (*self.holes, *(dart.loop for dart in self.darts))


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
    is_layer: bool = False  # stated with others as layers of one seam, wherever they are placed


@dataclass(frozen=True, eq=False)
class Pattern:
    """Panels and stitches, as the file states them but for what ``notes`` tells."""

    file: str
    panels: tuple[Panel, ...]
    stitches: tuple[Stitch, ...]
    notes: tuple[str, ...] = ()

    @property
    def is_unplaced(self) -> bool:
        """Whether it has several panels, all in the plane in which they are drawn, and so is not placed."""
        depths = [panel.translation[2] for panel in self.panels]
        drawn = all(panel.wrap is None and np.array_equal(panel.rotation, np.eye(3)) for panel in self.panels)
        return len(self.panels) > 1 and drawn and len(set(depths)) == 1

    def refuse(self, place: str, problem: str, remedy: str) -> NoReturn:
        """Raises InputError with the file, and the panel and edge within it."""
        raise InputError(f"{self.file}: {place}" if place else self.file, problem, remedy)

    def edge_name(self, side: Side) -> str:
        panel = self.panels[side.panel]
        return f'panel "{short(panel.name)}", edge {panel.edges[side.edge].number}'


def short(text: str) -> str:
    """A name as messages show it."""
    shown = text if text.isprintable() else "".join(c if c.isprintable() else "?" for c in text)
    return shown if len(shown) <= 40 else shown[:37] + "..."


def euler_xyz(degrees: Floats) -> Floats:
    """The rotation by these angles about the fixed axes x, then y, then z, as GarmentCode's; shape [3, 3]."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1.0]])
    return about_z @ about_y @ about_x
