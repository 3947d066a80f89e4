"""Wavefront OBJ reader. Own code: trimesh loses texture coordinates per corner, groups, and the lines of errors."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.text import to_utf8
from warp_cloth.loading.raw import EXPORT_AGAIN, LISTED, Floats, Ints, RawMesh

# Statements of the format (and "vc", which some tools add for colours) that say nothing about faces.
_IGNORED = frozenset(
    b"vn vp vc s mtllib l p mg deg bmat step cstype curv curv2 surf parm trim hole scrv sp end con bevel "
    b"c_interp d_interp lod shadow_obj trace_obj ctech stech usemap maplib call csh bsp bzp cdc cdp "
    b"res".split()
)
_FLOAT = rb"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d{1,3})?"
_INDEX = rb"\d{1,9}"
WIDEST = 64  # numbers in a row that are looked for by one expression: those with more take long to build
_REMARK = re.compile(rb"(?:^|\s)#")  # within a word "#" belongs to a name
_GROUPINGS = (b"g", b"o", b"usemtl")  # what may stand for panels, best first
_NAMING = (b"o ", b"o\t", b"g ", b"g\t")  # one of them is in every file that names objects; numbers have no letters


@dataclass
class _Statements:
    """Lines of an OBJ, sorted by kind."""

    vertices: list[bytes] = field(default_factory=list)
    vertex_lines: list[int] = field(default_factory=list)
    texcoords: list[bytes] = field(default_factory=list)
    texcoord_lines: list[int] = field(default_factory=list)
    faces: list[bytes] = field(default_factory=list)
    face_lines: list[int] = field(default_factory=list)
    seen: list[tuple[int, int]] = field(default_factory=list)  # vertices and texcoords before each face
    groups: dict[bytes, list[tuple[int, str]]] = field(default_factory=dict)  # (first face, name) by statement


def read_obj(file: str, data: bytes, *, key: str = "", name: str | None = None) -> RawMesh:
    """Polygons of an OBJ. Negative indices, continued lines, and faces of any size are understood.

    ``name``: only those of that object; see ``obj_mesh_names``.
    """
    data = to_utf8(data)
    if b"\0" in data:
        raise InputError(file, "is not an OBJ file: it holds binary data", "check the file's name and content")
    statements = _sorted_lines(file, data)
    points = _numbers(file, statements.vertices, statements.vertex_lines, need=3, keep=3, what="v (vertex)")
    texcoords = _numbers(
        file, statements.texcoords, statements.texcoord_lines, need=1, keep=2, what="vt (texture coordinate)"
    )
    counts, corners, corner_texcoords = _corners(file, statements)
    panels, names = _panels(statements)
    materials, material_names = _named(statements, b"usemtl")
    if len(material_names) < 2:
        materials, material_names = None, ()
    raw = RawMesh(
        file=file,
        points=points,
        counts=counts,
        corners=corners,
        texcoords=_at_corners(texcoords, corner_texcoords),
        panels=panels,
        panel_names=names,
        materials=materials,
        material_names=material_names,
        vertex_lines=np.array(statements.vertex_lines, dtype=np.int64),
        face_lines=np.array(statements.face_lines, dtype=np.int64),
        first_index=1,
    )
    return raw if name is None else _object_of(raw, name, *_objects(statements), key)


def obj_mesh_names(file: str, data: bytes) -> list[str]:
    """Names of the objects of an OBJ by ``o``, else ``g``, as ``read_obj`` takes them, in the file's order."""
    data = to_utf8(data)
    if not any(statement in data for statement in _NAMING):
        return []  # as most files, which need not be read for that
    return list(_objects(_sorted_lines(file, data))[1])


def _objects(statements: _Statements) -> tuple[Ints | None, tuple[str, ...]]:
    """The object of each face, and their names: by ``g``, which may be panels, only where no object is named."""
    return _named(statements, b"o" if b"o" in statements.groups else b"g")


def _object_of(raw: RawMesh, name: str, objects: Ints | None, names: tuple[str, ...], key: str) -> RawMesh:
    """The faces of one object, with the vertices from the first to the last that it uses."""
    if objects is None or name not in names:
        known = ", ".join(names[:LISTED])
        remedy = f"{key}.prim may be {known}" if known else f"it names none: remove {key}.prim"
        raise InputError(raw.file, f'holds no object "{name}"', remedy)
    chosen = objects == names.index(name)
    of_corner = np.repeat(chosen, raw.counts)
    corners = raw.corners[of_corner]
    panels, panel_names = _used(raw.panels, raw.panel_names, chosen)
    materials, material_names = _used(raw.materials, raw.material_names, chosen)
    if len(material_names) < 2:
        materials, material_names = None, ()
    first, last = int(corners.min(initial=len(raw.points))), int(corners.max(initial=-1)) + 1
    return replace(
        raw,
        points=raw.points[first:last],
        counts=raw.counts[chosen],
        corners=corners - first,
        texcoords=None if raw.texcoords is None else raw.texcoords[of_corner],
        vertex_lines=None if raw.vertex_lines is None else raw.vertex_lines[first:last],
        face_lines=None if raw.face_lines is None else raw.face_lines[chosen],
        panels=panels,
        panel_names=panel_names,
        materials=materials,
        material_names=material_names,
        first_index=raw.first_index + first,
    )


def _used(numbers: Ints | None, names: tuple[str, ...], chosen: np.ndarray) -> tuple[Ints | None, tuple[str, ...]]:
    """What ``_named`` returns of the chosen faces alone, in the order of the names."""
    if numbers is None:
        return None, ()
    used, own = np.unique(numbers[chosen], return_inverse=True)
    return own.astype(np.int64), tuple(names[each] for each in used.tolist())


def _lines(data: bytes) -> list[bytes]:
    """Lines of a file; one that ends in a backslash takes in the next, which stays as an empty line."""
    lines = data.splitlines()
    if b"\\\n" in data or b"\\\r" in data:
        for index in range(len(lines) - 2, -1, -1):
            if lines[index].endswith(b"\\"):
                lines[index] = lines[index][:-1] + b" " + lines[index + 1]
                lines[index + 1] = b""
    return lines


def _sorted_lines(file: str, data: bytes) -> _Statements:
    found = _Statements()
    for number, line in enumerate(_lines(data), start=1):
        parts = line.split(None, 1)
        if not parts or parts[0].startswith(b"#"):
            continue
        keyword, rest = parts[0], parts[1] if len(parts) > 1 else b""
        if b"#" in rest:
            rest = _REMARK.split(rest, maxsplit=1)[0]
        if keyword == b"v":
            found.vertices.append(rest)
            found.vertex_lines.append(number)
        elif keyword in (b"f", b"fo"):
            found.faces.append(rest)
            found.face_lines.append(number)
            found.seen.append((len(found.vertices), len(found.texcoords)))
        elif keyword == b"vt":
            found.texcoords.append(rest)
            found.texcoord_lines.append(number)
        elif keyword in _GROUPINGS:
            name = rest.strip().decode("utf-8", errors="replace")
            found.groups.setdefault(keyword, []).append((len(found.faces), name))
        elif keyword not in _IGNORED:
            word = keyword[:20].decode("utf-8", errors="backslashreplace")
            raise InputError(f"{file}:{number}", f"{word!r} is not an OBJ statement", "check the file's content")
    return found


def _numbers(file: str, rows: list[bytes], lines: list[int], *, need: int, keep: int, what: str) -> Floats:
    """First ``keep`` numbers of each row, zero where it has ``need`` but not as many; shape [rows, keep]."""
    plain = _plain_table(rows, _FLOAT, len(rows[0].split()) if rows else 0)
    if plain is not None and plain.shape[1] >= keep:
        return np.ascontiguousarray(plain[:, :keep])
    split = [row.split() for row in rows]
    try:
        if min(map(len, split), default=keep) >= keep:
            flat = [float(token) for tokens in split for token in tokens[:keep]]
            return np.array(flat, dtype=np.float64).reshape(-1, keep)
    except ValueError:
        pass  # the loop below finds the line
    table = np.zeros((len(rows), keep))
    for index, tokens in enumerate(split):
        place = f"{file}:{lines[index]}"
        if len(tokens) < need:
            problem = f"{what} needs {need} number{'s' if need > 1 else ''}, found {len(tokens)}"
            raise InputError(place, problem, "the file may be cut off: export it again")
        for column, token in enumerate(tokens[:keep]):
            try:
                table[index, column] = float(token)
            except ValueError:
                word = token[:20].decode("utf-8", errors="backslashreplace")
                remedy = "write numbers with a decimal point" if b"," in token else EXPORT_AGAIN
                raise InputError(place, f"{word!r} in a {what} is not a number", remedy) from None
    return table


def _plain_table(rows: list[bytes], number: bytes, count: int) -> Floats | None:
    """Rows of so many numbers, all written plainly, shape [rows, count]; None where any is not."""
    if not 0 < count <= WIDEST:
        return None
    row = re.compile(rb"\s*" + rb"\s+".join([number] * count) + rb"\s*")
    if not all(map(row.fullmatch, rows)):
        return None
    return np.fromstring(b" ".join(rows).replace(b"/", b" "), sep=" ").reshape(len(rows), -1)


def _plain_corners(statements: _Statements) -> tuple[Ints, Ints, Ints] | None:
    """What ``_corners`` returns, of faces of one size, all written alike, with indices in range; None of others."""
    first = statements.faces[0].split() if statements.faces else []
    parts = first[0].count(b"/") + 1 if first else 0
    if len(first) < 3 or parts > 3:
        return None
    plain = _plain_table(statements.faces, b"/".join([_INDEX] * parts), len(first))
    if plain is None:
        return None
    table = plain.astype(np.int64).reshape(-1, parts) - 1
    known = (len(statements.vertices), len(statements.texcoords))
    if any(bool(((column < 0) | (column >= limit)).any()) for column, limit in zip(table.T, known, strict=False)):
        return None
    texcoords = table[:, 1] if parts > 1 else np.full(len(table), -1, dtype=np.int64)
    return np.full(len(plain), len(first), dtype=np.int64), table[:, 0], texcoords


def _corners(file: str, statements: _Statements) -> tuple[Ints, Ints, Ints]:
    """Corner counts of the faces, then vertex and texture coordinate (-1: none) of every corner."""
    plain = _plain_corners(statements)
    if plain is not None:
        return plain
    counts: list[int] = []
    vertices: list[int] = []
    texcoords: list[int] = []
    limits = len(statements.vertices), len(statements.texcoords)
    for row, line, seen in zip(statements.faces, statements.face_lines, statements.seen, strict=True):
        tokens = row.split()
        if len(tokens) < 3:
            problem = f"a face needs at least 3 corners, found {len(tokens)}"
            raise InputError(f"{file}:{line}", problem, "the file may be cut off: export it again")
        counts.append(len(tokens))
        for token in tokens:
            vertex, _, rest = token.partition(b"/")
            texcoord = rest.partition(b"/")[0] if rest else b""
            try:
                v = int(vertex)
                t = int(texcoord) if texcoord else 0
            except ValueError:
                word = token[:20].decode("utf-8", errors="backslashreplace")
                raise InputError(f"{file}:{line}", f"face corner {word!r} is not an index", EXPORT_AGAIN) from None
            v_index = v - 1 if v > 0 else v + seen[0]
            if v == 0 or not 0 <= v_index < limits[0]:
                raise _out_of_range(f"{file}:{line}", "vertex", v, limits[0])
            t_index = t - 1 if t >= 0 else t + seen[1]
            if texcoord and (t == 0 or not 0 <= t_index < limits[1]):
                raise _out_of_range(f"{file}:{line}", "texture coordinate", t, limits[1])
            vertices.append(v_index)
            texcoords.append(t_index)
    return (
        np.array(counts, dtype=np.int64),
        np.array(vertices, dtype=np.int64),
        np.array(texcoords, dtype=np.int64),
    )


def _out_of_range(place: str, what: str, index: int, count: int) -> InputError:
    plural = "vertices" if what == "vertex" else f"{what}s"
    problem = f"a face refers to {what} {index}, but the file has {count:,} {plural} (numbered from 1)"
    return InputError(place, problem, f"{EXPORT_AGAIN}: the file may be cut off or edited")


def _at_corners(texcoords: Floats, corner_texcoords: Ints) -> Floats | None:
    if not len(texcoords) or not (corner_texcoords >= 0).any():
        return None
    values = texcoords[corner_texcoords]
    values[corner_texcoords < 0] = np.nan
    return values


def _panels(statements: _Statements) -> tuple[Ints | None, tuple[str, ...]]:
    """Panel of each face by ``g``, else ``o``, else ``usemtl``: the first of them that distinguishes faces."""
    only: tuple[Ints | None, tuple[str, ...]] = (None, ())
    for keyword in _GROUPINGS:
        panels, names = _named(statements, keyword)
        if len(names) > 1:
            return panels, names
        if only[0] is None and names:
            only = panels, names
    return only


def _named(statements: _Statements, keyword: bytes) -> tuple[Ints | None, tuple[str, ...]]:
    """The number of the name that a statement gives each face, shape [faces], and the names; None: it gives none."""
    starts = statements.groups.get(keyword)
    if not starts:
        return None, ()
    names: dict[str, int] = {}
    numbers = np.empty(len(statements.faces), dtype=np.int64)
    bounds = [(0, "default"), *starts, (len(statements.faces), "")]
    for (first, name), (end, _) in pairwise(bounds):
        if end > first:
            numbers[first:end] = names.setdefault(name or "default", len(names))
    return numbers, tuple(names)
