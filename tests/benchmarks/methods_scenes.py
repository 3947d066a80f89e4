"""Scenes on which the methods are compared: pieces of cloth at every stiffness and size, discs, worn T-shirts."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from extreme_meshes import Drawn, sheet

sys.path.insert(0, str(Path(__file__).parents[1]))
from meshfiles import write_obj

from warp_cloth.base.mesh import Mesh
from warp_cloth.bench.trials import DISC_RADIUS, SUPPORT_RADIUS

STIFFNESS = (2e3, 2e4, 2e5)  # [N/m]
SIZES = (1_000, 4_000, 16_000, 66_000)  # vertices, about
GROUPS = ("methods", "sizes", "truth")
KINDS = ("hanging", "strip", "ball")
SIDE = 1.0  # of the square [m]
STRIP = (0.1, 0.3)  # width and length [m]
CLAMP = 0.02  # of its length [m]
BULGE = 1e-3  # [m]; cloth that hangs dead flat cannot choose a side to fold to
HELD = 0.04  # [m] round the middle; cloth pinned at one vertex could spin for ever on a ball without friction
RING_SIDES = 6  # vertices that a ring has more than the next inner one
WAVES = (2, 3, 4, 5, 6, 7)  # of a disc's rim

# The rest error's constants were chosen on sheets of other sizes than these, and on none of these discs and T-shirts.
TRUE_SIZES = (3_000, 6_000)
TRUE_FABRICS = ("jersey", "cotton", "wool", "denim")
TRUE_EDGE = 14.0  # of T-shirts [mm]
TRUE_SHIRTS = (("linen", "M", 14, 0.0), ("jersey", "M", 18, 0.0), ("jersey", "M", 10, 0.0), ("cotton", "M", 14, 1.06),
               ("jersey", "S", 14, 1.06))  # fabric, size, edge [mm], chest [m]  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One scene."""

    kind: str  # of KINDS, "disc", or "tshirt"
    vertices: int = 0  # wanted, about; a T-shirt has those of its edges
    stretch: float = 0.0  # [N/m]; zero: of the fabric
    friction: float = 0.5
    fabric: str = "jersey"  # of discs and T-shirts
    size: str = "M"  # of T-shirts, as all below
    edge_mm: float = 12.0
    chest: float = 0.0  # of the body [m]; zero: the size's

    @property
    def name(self) -> str:
        """A name that no other case has."""
        if self.kind == "disc":
            return f"disc {self.vertices} {self.fabric}"
        if self.kind == "tshirt":
            body = f" on {self.chest:g} m" if self.chest else ""
            return f"tshirt {self.size} {self.fabric} {self.edge_mm:g} mm{body}"
        return f"{self.kind} {self.vertices} {self.stretch:g} {self.friction:g}"


def all_cases() -> list[tuple[str, Case, tuple[str, ...]]]:
    """What is run: group, scene, methods."""
    side = [Case("hanging", 4_000, 2e4), Case("strip", 4_000, 2e4), Case("ball", 4_000, 2e4), Case("tshirt")]
    found: list[tuple[str, Case, tuple[str, ...]]]
    found = [("methods", case, ("direct", "momentum", "accelerated", "multilevel")) for case in side]
    both = ("accelerated", "multilevel")
    for size in SIZES:
        for kind in KINDS:
            for stretch in STIFFNESS:
                found.append(("sizes", Case(kind, size, stretch), both if size < SIZES[2] else both[1:]))
    return found + [("truth", case, both) for case in true_cases()]


def true_cases() -> list[Case]:
    """Scenes on which the rest error is held against the true distance."""
    sheets = [
        Case(kind, size, stretch, friction)
        for size in TRUE_SIZES
        for kind, friction in [*((kind, 0.5) for kind in KINDS), ("ball", 0.0)]
        for stretch in STIFFNESS
    ]
    discs = [Case("disc", TRUE_SIZES[0], fabric=fabric) for fabric in TRUE_FABRICS]
    shirts = [Case("tshirt", fabric=a, size=size, edge_mm=TRUE_EDGE) for a in TRUE_FABRICS for size in "SML"]
    shirts += [Case("tshirt", fabric=a, size=b, edge_mm=c, chest=d) for a, b, c, d in TRUE_SHIRTS]
    return sheets + discs + shirts


def case_tree(case: Case, folder: Path, more: Mapping[str, float] | None = None) -> dict[str, Any]:
    """The case as a scene, its mesh written into the folder; ``more``: values that go over those of its fabric."""
    named: Any = {"base": case.fabric, **more} if more else case.fabric
    if case.kind == "tshirt":
        body = {"kind": "mannequin", "size": case.size} | ({"chest": case.chest} if case.chest else {})
        shirt = {"kind": "tshirt", "size": case.size, "edge_mm": case.edge_mm}
        return {"garment": {"shape": shirt, "rest": "uv", "fabric": named},
                "avatar": {"shape": body, "friction": case.friction}}  # fmt: skip
    path = folder / "garment.obj"
    fabric = {"stretch": case.stretch, "weight": 0.2, "bending": 1e-7, **(more or {})} if case.stretch else named
    garment: dict[str, Any] = {"mesh": str(path), "units": "m", "rest": "uv", "fabric": fabric}
    tree: dict[str, Any] = {"garment": garment}
    if case.kind == "disc":
        drawn, held = _disc(case)
        garment["pin"] = [{"vertices": held}]
    else:
        drawn = _sheet(case, garment)
    if case.kind == "ball":
        shape = {"kind": "sphere", "radius": 0.3, "centre": [0.0, 0.6, 0.0]}
        tree["avatar"] = {"shape": shape, "friction": case.friction}
    write_obj(path, *drawn)
    return tree


def _sheet(case: Case, garment: dict[str, Any]) -> Drawn:
    """A rectangle of cloth, where it starts; says in the garment what is pinned."""
    ticks, other = _ticks(case)
    points, triangles, flat = sheet(ticks, other)
    corner = 1e-4
    if case.kind == "hanging":
        points[:, 1] += 1.0
        points[:, 2] = BULGE * np.sin(14.0 * points[:, 0]) * np.sin(10.0 * points[:, 1])
        ends = [(x * SIDE, 1.0 + SIDE) for x in (0.0, 1.0)]
        garment["pin"] = [{"box": [[x - corner, y - corner, -1.0], [x + corner, y + corner, 1.0]]} for x, y in ends]
    else:
        points = np.stack([points[:, 0] - 0.5 * ticks[-1], np.zeros(len(points)), -points[:, 1]], axis=1)
        points[:, 1] += 1.0
    if case.kind == "strip":
        garment["pin"] = [{"box": [[-1.0, 0.0, -CLAMP - corner], [1.0, 2.0, 1.0]]}]
    if case.kind == "ball":
        points[:, 2] += 0.5 * SIDE
        points[:, 1] -= 0.09
        if not case.friction:
            held = np.flatnonzero(np.hypot(points[:, 0], points[:, 2]) < HELD)
            garment["pin"] = [{"vertices": [int(vertex) for vertex in held]}]
    return points, triangles, flat


def _disc(case: Case) -> tuple[Drawn, list[int]]:
    """Cusick's disc, its free ring slightly waved, and what its support holds."""
    rings = 5 * round(math.sqrt(case.vertices / 1.92) / 5)  # one of them lies on the support's edge
    mesh = _ringed(DISC_RADIUS, SUPPORT_RADIUS * (1.0 - 2.0 / rings), rings)
    points, flat = mesh.points.copy(), mesh.points[:, [0, 2]] * [1.0, -1.0]
    radius, angle = np.hypot(flat[:, 0], flat[:, 1]) / SUPPORT_RADIUS, np.arctan2(flat[:, 1], flat[:, 0])
    held = radius < 1.0 + 1e-6
    waves = sum(np.cos(count * angle + count**2) for count in WAVES)
    points[:, 1] += 1.0 + BULGE * np.where(held, 0.0, waves * (radius - 1.0) ** 2)
    return (points, mesh.triangles.astype(np.int64), flat), [int(vertex) for vertex in np.flatnonzero(held)]


def _ringed(radius: float, hole: float, rings: int) -> Mesh:
    """A disc of concentric rings, without those inside ``hole`` [m]; a ring lies on the hole's edge or close to it."""
    step = radius / rings
    first = max(round(rings * hole / radius), 1)
    starts = {ring: RING_SIDES * (ring * (ring - 1) - first * (first - 1)) // 2 for ring in range(first, rings + 1)}
    circles = []
    for ring in range(first, rings + 1):
        angle = np.arange(RING_SIDES * ring) * 2.0 * np.pi / (RING_SIDES * ring)
        circles.append((radius - step * (rings - ring)) * np.column_stack([np.cos(angle), np.sin(angle)]))
    flat = np.concatenate(circles)
    triangles = np.concatenate([_between(ring, starts[ring], starts[ring + 1]) for ring in range(first, rings)])
    points = np.column_stack([flat[:, 0], np.zeros(len(flat)), -flat[:, 1]])
    return Mesh("disc", points, triangles.astype(np.int32), texcoords=flat[triangles])


def _between(ring: int, inner: int, outer: int) -> np.ndarray:
    """Triangles between a ring and the next, whose first vertices are ``inner`` and ``outer``."""
    side, step = (indices.ravel() for indices in np.meshgrid(np.arange(RING_SIDES), np.arange(ring + 1), indexing="ij"))
    here = inner + (side * ring + step) % (RING_SIDES * ring)
    there = outer + side * (ring + 1) + step
    beyond = outer + (side * (ring + 1) + step + 1) % (RING_SIDES * (ring + 1))
    after = inner + (side * ring + step + 1) % (RING_SIDES * ring)
    pointing = np.column_stack([here, there, beyond])
    filling = np.column_stack([here, beyond, after])[step < ring]
    return np.concatenate([pointing, filling])


def _ticks(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Places of the vertices across and along [m]."""
    if case.kind == "strip":
        width, length = STRIP
        across = max(round(math.sqrt(case.vertices * width / length)), 3)
        return np.linspace(0.0, width, across), np.linspace(0.0, length, round(length / width * (across - 1)) + 1)
    count = round(math.sqrt(case.vertices))
    count += 1 - count % 2
    return np.linspace(0.0, SIDE, count), np.linspace(0.0, SIDE, count)
