"""A pattern as a garment mesh: panels meshed, placed and sewn, with the flat panels as its texture coordinates."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading.load import content
from warp_cloth.pattern.crowding import crowded_edges, parted
from warp_cloth.pattern.curve import Curve, Floats
from warp_cloth.pattern.delaunay import Ints, OutlineError
from warp_cloth.pattern.draft_options import DraftOptions
from warp_cloth.pattern.garmentcode import read_specification
from warp_cloth.pattern.grade_table import grade_table_path, read_grade_table
from warp_cloth.pattern.loose import without_loose
from warp_cloth.pattern.mesher import Flat, meshed
from warp_cloth.pattern.outline import SewnOutlines, sewn_outlines
from warp_cloth.pattern.rings import with_rings
from warp_cloth.pattern.seam import Seam
from warp_cloth.pattern.sewing import seams_of
from warp_cloth.pattern.specification import Pattern, short

if TYPE_CHECKING:
    from warp_cloth.pattern.drafted import Draft
    from warp_cloth.pattern.figure import Figure

DRAFTED = ".dxf"
MOST_VERTICES = 2_000_000
PARTING_ROUNDS = 20
_ROTATION = rb'"rotation"\s*:\s*\[([^\]]*)\]'
_DEPTH = rb'"translation"\s*:\s*\[[^\],]*,[^\],]*,\s*([^\]\s]*)\s*\]'
_EIGHTHS = np.linspace(0.0, 1.0, 9)


def load_pattern(path: Path, *, edge: float, options: DraftOptions | None = None, figure: Figure | None = None) -> Mesh:
    """The garment of a pattern file, in metres, its panels meshed, placed and sewn.

    Args:
        path: ``NAME_specification.json`` of GarmentCode, or a .dxf file by AAMA or ASTM.
        edge: edge length of the mesh [m].
        options: what is stated of a DXF file's pieces and seams.
        figure: the body that a DXF file's pieces are laid round; None: a usual one.

    Texture coordinates are the panels as drawn, side by side [m]. The same file gives the same bits.

    Raises:
        InputError: the file cannot be read, or states what cannot be cut or sewn.
    """
    return sewn_mesh(read_pattern(path, options, figure), path.stem, edge=edge)


def read_pattern(path: Path, options: DraftOptions | None = None, figure: Figure | None = None) -> Pattern:
    """The panels and stitches of a pattern file; arguments as of ``load_pattern``.

    Raises:
        InputError: the file cannot be read, or states an impossible panel, edge or stitch.
    """
    if not is_drafted(path):
        pattern = without_loose(read_specification(str(path), content(path, "pattern")))
        if not pattern.is_unplaced:
            return with_rings(pattern)
        from warp_cloth.pattern.laid_out import laid_round

        return laid_round(pattern, figure)
    from warp_cloth.pattern.drafted import drafted_pattern  # thirty modules that a specification does not need

    return drafted_pattern(read_drafted(path, options), figure)


def is_drafted(path: Path) -> bool:
    """Whether a pattern file has pieces alone, without places and seams."""
    return path.suffix.lower() == DRAFTED


def may_be_laid_round(path: Path) -> bool:
    """Whether the body decides where panels start: of a DXF file, or of a specification that places none.

    Of a specification its text decides, without being read: no number of a rotation is other than 0, and no depth of a
    translation differs from another one.
    """
    if is_drafted(path):
        return True
    try:
        text = path.read_bytes()
    except OSError:
        return False
    turned = any(re.search(rb"[1-9]", numbers) for numbers in re.findall(_ROTATION, text))
    return not turned and len(set(re.findall(_DEPTH, text))) < 2


def read_drafted(path: Path, options: DraftOptions | None = None) -> Draft:
    """The pieces of a DXF file, and their seams as stated or proposed; sizes also by a .rul file of the same name.

    Raises:
        InputError: ezdxf is not installed, the file cannot be read, or what is stated does not fit it.
    """
    from warp_cloth.pattern.drafted import read_draft

    rules = grade_table_path(path)
    table = None if rules is None else read_grade_table(str(rules), content(rules, "grade rule"))
    return read_draft(str(path), content(path, "pattern"), options or DraftOptions(), table)


@dataclass(frozen=True, eq=False)
class SewnPattern:
    """A pattern, its panels meshed, and the garment that they are sewn to."""

    pattern: Pattern
    outlines: SewnOutlines
    flat: Flat  # the panels; each one's vertices begin with those of its outline
    triangles: Ints  # of the panels, their outer sides counter-clockwise, shape [F, 3]
    number: Ints  # the garment's vertex that each vertex of the panels became, shape [N]
    mesh: Mesh


def sewn_mesh(pattern: Pattern, name: str, *, edge: float) -> Mesh:
    """The garment of a pattern, as ``load_pattern`` returns it."""
    return sewn_pattern(pattern, name, edge=edge).mesh


def sewn_pattern(pattern: Pattern, name: str, *, edge: float) -> SewnPattern:
    """A pattern meshed and sewn; arguments and errors as of ``load_pattern``."""
    _check_count(pattern, edge)
    seams = seams_of(pattern)
    sewn = sewn_outlines(pattern, seams, edge)
    flat = _meshed(pattern, sewn, edge)
    flat, welded = _sewn(pattern, sewn, flat)
    points = _placed(pattern, flat, welded)
    outward = np.array([panel.area > 0.0 for panel in pattern.panels])
    outward ^= _turned(pattern, seams)
    panel = flat.panel[flat.triangles[:, 0]]
    triangles = np.where(outward[panel][:, None], flat.triangles, flat.triangles[:, ::-1])
    used, inverse = np.unique(welded, return_inverse=True)
    number = inverse.ravel()
    mesh = Mesh(
        name=name,
        points=np.ascontiguousarray(points[used]),
        triangles=np.ascontiguousarray(number[triangles], dtype=np.int32),
        texcoords=np.ascontiguousarray(flat.points[triangles]),
        panels=panel.astype(np.int32),
        panel_names=tuple(each.name for each in pattern.panels),
        notes=(*pattern.notes, *sewn.notes),
    )
    return SewnPattern(pattern, sewn, flat, triangles, number, mesh)


def _check_count(pattern: Pattern, edge: float) -> None:
    """Refuses a mesh beyond all memory before it is made, and panels without area."""
    count = 0.0
    for panel in pattern.panels:
        around = sum(each.curve.length for each in panel.edges)
        if not abs(panel.area) > 1e-6 * around**2:
            pattern.refuse(f'panel "{short(panel.name)}"', "has no area", "correct its outline")
        box = float(np.prod(np.ptp(np.concatenate([_hull(each.curve) for each in panel.edges]), axis=0)))
        count += max(abs(panel.area) / (np.sqrt(0.75) * edge**2), 0.05 * box / edge**2) + around / edge
    if count > MOST_VERTICES:
        problem = f"with edges of {1e3 * edge:g} mm its mesh would have some {count:,.0f} vertices"
        pattern.refuse("", problem, "check units_in_meter, or choose a longer edge_mm")


def _hull(curve: Curve) -> Floats:
    """Points about a curve: its control points, or places on an arc [m], shape [n, 2]."""
    return curve.at(_EIGHTHS) if curve.turn else curve.points


def _meshed(pattern: Pattern, sewn: SewnOutlines, edge: float) -> Flat:
    """The meshed panels; the vertices of outlines keep their order, whichever way they run."""
    ways = [1 if panel.area > 0.0 else -1 for panel in pattern.panels]
    outlines = [outline.points[::way] for outline, way in zip(sewn.outlines, ways, strict=True)]
    spacing = [outline.spacing[::way] for outline, way in zip(sewn.outlines, ways, strict=True)]
    try:
        flat = meshed(outlines, spacing, edge, sewn.holes)
    except OutlineError as error:
        _refuse_outline(pattern, sewn, ways, error.places)
    order = np.arange(len(flat.points))
    start = 0
    for outline, way in zip(outlines, ways, strict=True):
        order[start : start + len(outline)] = start + np.arange(len(outline))[::way]
        start += len(outline)
    return Flat(flat.points[order], order[flat.triangles], flat.panel[order], flat.origins)


def _refuse_outline(pattern: Pattern, sewn: SewnOutlines, ways: Sequence[int], places: Sequence[int]) -> NoReturn:
    outlines = sewn.outlines
    holes = [panel for panel, points, _ in sewn.holes for _ in points]
    starts = np.cumsum([0, *(len(outline.points) for outline in outlines)])
    named: dict[int, set[int]] = {}
    for place in places:
        index = int(np.searchsorted(starts, place, side="right")) - 1
        if index >= len(outlines):
            in_hole = place - int(starts[-1])
            if in_hole < len(holes):
                where = f'panel "{short(pattern.panels[holes[in_hole]].name)}"'
                problem = "a hole or dart in it crosses itself, the outline or another one"
                pattern.refuse(where, problem, "correct it, or remove it")
            continue
        own = place - int(starts[index])
        own = own if ways[index] > 0 else len(outlines[index].points) - 1 - own
        named.setdefault(index, set()).add(pattern.panels[index].edges[outlines[index].edges[own]].number)
    index, numbers = next(iter(named.items()), (0, set()))
    edges = " and ".join(str(number) for number in sorted(numbers))
    where = f'panel "{short(pattern.panels[index].name)}"'
    where += f", edge{'s' * (len(numbers) > 1)} {edges}" if numbers else ""
    pattern.refuse(where, "the outline crosses or touches itself", "correct the outline")


def _turned(pattern: Pattern, seams: Sequence[Seam]) -> NDArray[np.bool_]:
    """Panels whose loop's outer side is the garment's inner side: where right is sewn to wrong, shape [P].

    The outer side of each garment is that of most of its cloth.
    """
    count = len(pattern.panels)
    turned = np.zeros(count, dtype=bool)
    beside: list[list[tuple[int, bool]]] = [[] for _ in range(count)]
    for seam in seams:
        one, other = (piece.side.panel for piece in seam.pieces)
        beside[one].append((other, not seam.reverse))
        beside[other].append((one, not seam.reverse))
    seen = np.zeros(count, dtype=bool)
    for first in range(count):
        if seen[first]:
            continue
        seen[first], group, front = True, [first], [first]
        while front:
            one = front.pop()
            for other, differs in beside[one]:
                if not seen[other]:
                    seen[other], turned[other] = True, turned[one] ^ differs
                    group.append(other)
                    front.append(other)
        area = np.array([abs(pattern.panels[index].area) for index in group])
        if area[turned[group]].sum() > 0.5 * area.sum():
            turned[group] ^= True
    return turned


def _sewn(pattern: Pattern, sewn: SewnOutlines, flat: Flat) -> tuple[Flat, Ints]:
    """The panels with edges parted where sewing would lay them on others, and the vertex that each vertex becomes."""
    starts = np.cumsum([0, *(len(outline.points) for outline in sewn.outlines)])
    none = np.zeros(0, dtype=np.int64)
    one = np.concatenate([none, *(starts[panel] + places for panel, places, _, _ in sewn.seams)])
    other = np.concatenate([none, *(starts[panel] + places for _, _, panel, places in sewn.seams)])
    ends = starts[-1] + np.cumsum([0, *(len(points) for _, points, _ in sewn.holes)])[1:]  # holes run backwards
    one = np.concatenate([one, *(ends[hole] - 1 - places for hole, places, _ in sewn.darts)])
    other = np.concatenate([other, *(ends[hole] - 1 - places for hole, _, places in sewn.darts)])
    layered = _layered(starts, sewn)
    for _ in range(PARTING_ROUNDS):
        welded = connected_components(len(flat.points), one, other)
        crowded = crowded_edges(flat, welded, layered)
        if not len(crowded):
            return flat, welded
        flat = parted(flat, welded, crowded)
    a = int(flat.triangles.ravel()[crowded[0]])
    place = f'panel "{short(pattern.panels[int(flat.panel[a])].name)}"'
    pattern.refuse(place, "is so small or narrow that its seams lie on each other", "choose a shorter edge_mm")


def _layered(starts: Ints, sewn: SewnOutlines) -> Ints:
    """Vertices of outlines on seams of three panels or more."""
    sides = [(starts[panel] + places, starts[other] + there) for panel, places, other, there in sewn.seams]
    keys = [[(min(v[0], v[-1]), max(v[0], v[-1])) for v in pair] for pair in sides]
    count = Counter(key for pair in keys for key in set(pair))
    found = [each for pair, own in zip(sides, keys, strict=True) if max(count[key] for key in own) > 1 for each in pair]
    return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)


def _placed(pattern: Pattern, flat: Flat, welded: Ints) -> Floats:
    """Where vertices start [m], shape [N, 3]: those that are one at their mean."""
    placed = np.empty((len(flat.points), 3))
    for index, panel in enumerate(pattern.panels):
        mine = flat.panel == index
        placed[mine] = panel.placed(flat.points[mine] - flat.origins[index])
    count = np.maximum(np.bincount(welded, minlength=len(welded)), 1)
    return np.column_stack([np.bincount(welded, placed[:, axis], len(welded)) / count for axis in range(3)])
