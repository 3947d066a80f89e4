"""Safe repairs of a mesh: degenerate and duplicate faces, unwelded seams, winding."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.errors import InputError
from warp_cloth.base.topology import used_ids
from warp_cloth.loading.layered import layers_meet
from warp_cloth.loading.mirrored import half_at
from warp_cloth.loading.polygons import triangulated
from warp_cloth.loading.raw import Floats, Ints, RawMesh, Role, counted
from warp_cloth.loading.slivers import without_slivers
from warp_cloth.loading.split_seams import SplitSeams, split_seams
from warp_cloth.loading.thickness import shell_among
from warp_cloth.loading.trims import trims_among
from warp_cloth.loading.unique_rows import edges_of, unique_rows
from warp_cloth.loading.weld import Weld, weld
from warp_cloth.loading.winding import consistent_winding, outward

RestKind = Literal["mesh", "uv", "physics"]
RestKey = Literal["auto", RestKind]

# Height of a triangle relative to its longest edge, below which it counts as a line: 10 nm at a 10 mm edge,
# which no cloth has and which float32 positions one metre from the origin cannot hold.
THINNEST = 1e-6

TWO_SIDED = 0.9  # fraction of faces that coincide with others: not a pocket or a facing, but the whole garment twice

FARTHEST = 1e12  # texture coordinates beyond this count as none: no panel lies there, in whatever unit

CLOSED = "a closed surface, like a body or cloth modelled with its thickness: a garment is one sheet with openings"


@dataclass(frozen=True, eq=False)
class Trimmings:
    """Loose parts that lie on the cloth, and are none of it."""

    points: Floats  # [m], shape [T, 3]
    triangles: Ints  # shape [K, 3]
    vertex_map: Ints  # vertex of them that each raw vertex became, -1: none


@dataclass(frozen=True, eq=False)
class Repaired:
    """Valid triangles over the vertices that they use."""

    points: Floats  # [m], shape [V, 3]
    triangles: Ints  # shape [F, 3]
    texcoords: Floats | None  # shape [F, 3, 2]
    faces: Ints  # polygon of the raw mesh, shape [F]
    vertex_map: Ints  # new vertex of each raw vertex, -1: dropped
    notes: tuple[str, ...]
    rest: Floats | None = None  # corners at rest, in the file's unit, shape [F, 3, 3]
    turned: NDArray[np.bool_] | None = None  # whether a triangle winds opposite to the file, shape [F]
    trims: Trimmings | None = None  # loose parts that lie on it


@dataclass(frozen=True, eq=False)
class _Work:
    """Triangles under repair: vertices, and the source of each corner and face."""

    triangles: Ints
    corners: Ints
    faces: Ints
    notes: tuple[str, ...] = ()

    def select(self, keep: NDArray[np.bool_], dropped: str, which: str = "") -> _Work:
        """The triangles of ``keep``; ``dropped`` (and ``which``) names the others in a note."""
        gone = int((~keep).sum())
        if not gone:
            return self
        notes = (*self.notes, " ".join([counted(gone, dropped), *which.split(), "dropped"]))
        return _Work(self.triangles[keep], self.corners[keep], self.faces[keep], notes)


def repaired(
    raw: RawMesh, points: Floats, *, role: Role, rest: RestKey, mirrored: Callable[[], Floats] | None = None
) -> Repaired:
    """Valid triangles of a checked mesh; ``points`` are its vertices in metres, shape [V, 3].

    ``mirrored`` makes those of its image at the file's plane x = 0, which half a garment is completed with.

    A triangle without area is dropped, unless the cloth's rest shape lies in texture space and has an area
    there: a garment may start with seams or panels drawn together.
    """
    raw = replace(raw, texcoords=_within_reason(raw.texcoords))
    cut = triangulated(raw)
    work = _Work(raw.corners[cut.corners], cut.corners, cut.faces, cut.notes)
    work = work.select(~_repeats(work.triangles), "triangle", "that repeat a vertex")
    work = work.select(_first_of_each(work.triangles), "duplicate triangle")
    work = work.select(~_without_area(raw, work, points, rest), "triangle", "without area")
    _refuse_empty(raw, work)
    panels = None if raw.texcoords is None or role == "avatar" else _usable(raw.texcoords[work.corners])
    welded = weld(points, work.triangles, panels=panels, copies=role == "garment")
    work = _welded(work, welded, role)
    _refuse_empty(raw, work)
    if role == "garment" and (split := split_seams(points, work.triangles)) is not None:
        welded = replace(welded, vertex=split.vertex[welded.vertex])
        raw, work = _split(raw, work, split)
    if role == "garment" and mirrored is not None and (plane := half_at(raw.points, work.triangles)) is not None:
        points, work = _completed(points, mirrored(), work, plane)
    closed = role == "garment" and _has_no_rim(raw, work, points)
    before = work.triangles
    work = _wound(work, points, role)
    turned = (work.triangles != before).any(axis=1)
    trims = None
    carried, notes, is_thick = np.zeros(0, dtype=bool), work.notes[:0], False
    if role == "garment":
        carried, notes, is_thick = _carried(points, work.triangles)
    if carried.any():
        trims = _trimmings(points, work.triangles[carried], welded.vertex)
        kept = ~carried
        work = _Work(work.triangles[kept], work.corners[kept], work.faces[kept], (*work.notes, *notes))
        turned = turned[kept]
        closed = closed and _has_no_rim(raw, work, points)
    texcoords = None if panels is None else raw.texcoords
    if role == "garment" and raw.rest is None and not is_thick:  # the rims of thick cloth are narrow, and stay
        better = without_slivers(points, work.triangles, work.corners, texcoords)
        if better is not None:
            welded = replace(welded, vertex=better.vertex[welded.vertex])
            faces, notes = work.faces[better.source], (*work.notes, better.note)
            work, turned = _Work(better.triangles, better.corners, faces, notes), turned[better.source]
    used = np.zeros(len(points), dtype=bool)
    used[work.triangles] = True
    number = np.where(used, np.cumsum(used) - 1, -1)
    there = used[welded.vertex] if trims is None else used[welded.vertex] | (trims.vertex_map >= 0)
    isolated = int((~there).sum())
    notes = work.notes
    if isolated:
        notes = (*notes, f"{counted(isolated, 'isolated vertex')} dropped")
    pieces = _pieces(work.triangles, len(points))
    if role == "garment" and pieces > 1:
        notes = (
            *notes,
            f"{pieces:,} separate pieces: weld the vertices of their seams if they should be sewn",
        )
    if closed:
        notes = (*notes, CLOSED)
    if welded.apart and role == "garment":
        notes += _two_sided(points[work.triangles])
    return Repaired(
        points=points[used],
        triangles=number[work.triangles],
        texcoords=None if raw.texcoords is None else _usable(raw.texcoords[work.corners]),
        faces=work.faces,
        vertex_map=number[welded.vertex],
        notes=notes,
        rest=None if raw.rest is None else raw.rest[work.corners],
        turned=turned,
        trims=trims,
    )


def _carried(points: Floats, triangles: Ints) -> tuple[NDArray[np.bool_], tuple[str, ...], bool]:
    """Which triangles the cloth carries along, as they are none of it, shape [F], notes, and whether it is thick."""
    loose, notes = trims_among(points, triangles), []
    if loose.any():
        count = _pieces(triangles[loose], len(points))
        notes.append(f"{counted(count, 'loose part')} (buttons, for example) carried along with the cloth")
    shell = shell_among(points, triangles, ~loose)
    if shell is not None:
        thickness = f"modelled with its thickness ({1e3 * shell.thickness:.2g} mm)"
        notes.append(f"{thickness}: its inner side is the cloth, which carries its outer side along")
        loose = loose | shell.carried
    return loose, tuple(notes), shell is not None


def _trimmings(points: Floats, triangles: Ints, welded: Ints) -> Trimmings:
    """``welded``: the vertex that replaces each."""
    source, corners = np.unique(triangles, return_inverse=True)
    number = np.full(len(points), -1, dtype=np.int64)
    number[source] = np.arange(len(source))
    return Trimmings(points[source], corners.reshape(triangles.shape), number[welded])


def _pieces(triangles: Ints, count: int) -> int:
    """Number of connected components."""
    a, b = triangles[:, [0, 1]].T, triangles[:, [1, 2]].T
    part = connected_components(count, np.concatenate([a[0], b[0]]), np.concatenate([a[1], b[1]]))
    return len(used_ids(part[triangles[:, 0]], count))


def _two_sided(corners: Floats) -> tuple[str, ...]:
    """A note where faces lie on each other throughout, as where each was exported once for either side.

    ``corners`` [m], shape [F, 3, 3].
    """
    place = unique_rows(corners.reshape(-1, 3) + 0.0).number.reshape(-1, 3)
    doubled = int((unique_rows(np.sort(place, axis=1)).count > 1).sum())
    if 2 * doubled < TWO_SIDED * len(corners):
        return ()
    doubles = (
        f"{counted(2 * doubled, 'triangle')} coincide with others, as if every face was exported once for each side"
    )
    return (f"{doubles}: two layers of cloth, twice as heavy and stiff; remove one",)


def _refuse_empty(raw: RawMesh, work: _Work) -> None:
    if not len(work.triangles):
        problem = f"none of its {len(raw.counts):,} faces can be used: {', '.join(work.notes)}"
        raise InputError(raw.file, problem, "export the mesh again; its surface has no area")


def _within_reason(texcoords: Floats | None) -> Floats | None:
    """Texture coordinates, none where they are so large that arithmetic overflows."""
    if texcoords is None:
        return None
    there = np.isfinite(texcoords)
    return np.where(there & (np.abs(np.where(there, texcoords, 0.0)) <= FARTHEST), texcoords, np.nan)


def _usable(texcoords: Floats) -> Floats | None:
    return texcoords if np.isfinite(texcoords).all() else None


def _repeats(triangles: Ints) -> NDArray[np.bool_]:
    repeats: NDArray[np.bool_] = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    return repeats


def _first_of_each(triangles: Ints) -> NDArray[np.bool_]:
    """Whether each triangle is the first over its set of vertices."""
    first = np.zeros(len(triangles), dtype=bool)
    first[unique_rows(np.sort(triangles, axis=1)).first] = True
    return first


def _without_area(raw: RawMesh, work: _Work, points: Floats, rest: RestKey) -> NDArray[np.bool_]:
    flat = _is_line(points[work.triangles])
    if rest in ("auto", "physics") and raw.rest is not None:
        return flat & _is_line(raw.rest[work.corners])
    if rest in ("auto", "uv") and raw.texcoords is not None and flat.any():
        texcoords = raw.texcoords[work.corners]
        placed = np.asarray(np.isfinite(texcoords).all(axis=(1, 2)), dtype=bool)
        if placed[~flat].all():
            flat = flat & ~(placed & ~_is_line(np.where(placed[:, None, None], texcoords, 0.0)))
    return flat


def without_area(points: Floats, triangles: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether triangles have no area in the mesh, shape [F]."""
    return _is_line(points[triangles])


def _is_line(corners: Floats) -> NDArray[np.bool_]:
    """Whether triangles are degenerate: their height is negligible; shape [F, 3, 2 or 3]."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    size = np.maximum(np.abs(a).max(axis=1), np.abs(b).max(axis=1))[:, None]
    size = np.where(size > 0.0, size, 1.0)  # whose square may be beyond all numbers
    a, b = a / size, b / size
    longest_squared = np.maximum.reduce([(edge * edge).sum(axis=1) for edge in (a, b, b - a)])
    normal = np.cross(a, b) if a.shape[1] == 3 else (a[:, :1] * b[:, 1:] - a[:, 1:] * b[:, :1])
    line: NDArray[np.bool_] = np.linalg.norm(normal, axis=1) <= THINNEST * longest_squared
    return line


def _welded(work: _Work, welded: Weld, role: Role) -> _Work:
    notes = work.notes
    if welded.joined:
        where = f"up to {1e3 * welded.farthest:.2g} mm away" if welded.farthest > 0.0 else "at the same place"
        notes = (*notes, f"{counted(welded.joined, 'vertex')} welded to others {where}")
    if welded.apart and role == "garment":
        what = f"{counted(welded.apart, 'vertex')} at the same place as others"
        notes = (*notes, f"{what} not welded: openings, layers, or parts that only touch")
    if not welded.joined:
        return replace(work, notes=notes)
    work = replace(work, triangles=welded.vertex[work.triangles], notes=notes)
    work = work.select(~_repeats(work.triangles), "triangle", "collapsed by welding")
    return work.select(_first_of_each(work.triangles), "duplicate triangle")


def _split(raw: RawMesh, work: _Work, split: SplitSeams) -> tuple[RawMesh, _Work]:
    """The work with its seams split, and the mesh with what its corners hold at the new corners."""
    first = work.corners[split.source]
    corners = np.take_along_axis(first, split.weights.argmax(axis=2), axis=1)
    new = np.nonzero(split.weights.max(axis=2) < 1.0)

    def with_new(values: Floats | None) -> Floats | None:
        if values is None:
            return None
        return np.concatenate([values, np.einsum("nc,ncd->nd", split.weights[new], values[first[new[0]]])])

    if raw.texcoords is not None or raw.rest is not None:
        corners[new] = len(raw.corners) + np.arange(len(new[0]))
    note = f"{counted(split.joints, 'vertex')} joined with another piece whose rim they lie on, its edges split there"
    work = _Work(split.triangles, corners, work.faces[split.source], (*work.notes, note))
    return replace(raw, texcoords=with_new(raw.texcoords), rest=with_new(raw.rest)), work


def _completed(points: Floats, mirrored: Floats, work: _Work, plane: NDArray[np.bool_]) -> tuple[Floats, _Work]:
    """Half a garment with its mirror image, which shares the vertices at the plane."""
    number = np.where(plane, np.arange(len(points)), len(points) + np.arange(len(points)))
    off = ~plane[work.triangles].all(axis=1)  # a face in the plane is its own image
    note = "half a garment: completed with its mirror image, as all of it is on one side of x = 0"
    work = _Work(
        np.concatenate([work.triangles, number[work.triangles[off, ::-1]]]),
        np.concatenate([work.corners, work.corners[off, ::-1]]),
        np.concatenate([work.faces, work.faces[off]]),
        (*work.notes, note),
    )
    return np.concatenate([points, mirrored]), work


def _has_no_rim(raw: RawMesh, work: _Work, points: Floats) -> bool:
    """Whether every edge has two faces. Refuses one with more, but where layers meet at it, as at a waist."""
    edges = np.sort(edges_of(work.triangles), axis=1)
    found = unique_rows(edges)
    bad = np.flatnonzero(found.count > 2)
    if not len(bad):
        return bool((found.count == 2).all())
    bad = bad[~layers_meet(points, work.triangles, found.number, bad)]
    if not len(bad):
        return False
    touching = np.unique(work.faces[np.flatnonzero(found.number == bad[0]) // 3])
    a, b = (raw.vertex_name(int(vertex)) for vertex in edges[found.first[bad[0]]])
    named = ", ".join(raw.face_name(int(face)) for face in touching[:6])
    more = f" ({len(bad) - 1:,} more such edges)" if len(bad) > 1 else ""
    count = found.count[bad[0]]
    problem = f"the edge between vertices {a} and {b} has {count} faces ({named}){more}; cloth has at most two"
    remedy = "separate the layers or remove the extra faces in the modelling tool"
    raise InputError(raw.face_place(int(touching[0])), problem, remedy)


def _wound(work: _Work, points: Floats, role: Role) -> _Work:
    """Consistently oriented triangles of each component; an avatar's face outwards."""
    flip, twisted = consistent_winding(work.triangles)
    notes = work.notes
    if flip.any():
        notes = (
            *notes,
            f"winding of {counted(int(flip.sum()), 'triangle')} flipped to agree with the neighbours",
        )
    if twisted:
        notes = (*notes, f"{counted(twisted, 'one-sided component')} (Moebius) keep the file's winding")
    triangles = np.where(flip[:, None], work.triangles[:, ::-1], work.triangles)
    if role == "avatar":
        inward = outward(points, triangles)
        if inward.any():
            notes = (
                *notes,
                f"{counted(int(inward.sum()), 'triangle')} of inside-out closed parts flipped",
            )
        triangles = np.where(inward[:, None], triangles[:, ::-1], triangles)
        flip = flip ^ inward
    corners = np.where(flip[:, None], work.corners[:, ::-1], work.corners)
    return replace(work, triangles=triangles, corners=corners, notes=notes)
