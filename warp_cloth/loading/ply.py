"""PLY reader, text and binary.

Own code: trimesh reads no binary file that mixes triangles with quads, as Blender writes them. ``plyfile`` (1.1.5)
takes 160 to 330 ms for a mesh of 20,000 vertices, this 1 ms (binary triangles) to 77 ms (text), and its messages name
neither the line of a text file nor a remedy.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.text import to_utf8
from warp_cloth.loading.decimals import float32_doubt
from warp_cloth.loading.raw import CUT_OFF, EXPORT_AGAIN, Floats, Ints, RawMesh

_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"int64": "i8", "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
_FORMATS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
_FACE_LISTS = ("vertex_indices", "vertex_index")
_VERTEX_TEXCOORDS = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_COUNTS = "correct the header, or export it again"


@dataclass(frozen=True)
class _Property:
    name: str
    type: str  # numpy's name, without byte order
    count_type: str = ""  # of a list's length; empty for a single number


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]


@dataclass(frozen=True, eq=False)
class _Table:
    """Values of one element: a column per single number, lengths and flat values per list."""

    singles: dict[str, Floats]
    lists: dict[str, tuple[Ints, Floats]]


def read_ply(file: str, data: bytes) -> RawMesh:
    """Vertices, polygons and texture coordinates (per corner or per vertex) of a PLY."""
    data = to_utf8(data)
    order, elements, body, header_lines = _header(file, data)
    tables: dict[str, _Table] = {}
    starts: dict[str, int] = {}
    position, row = 0, header_lines
    tokens = data[body:].split() if not order else []
    for element in elements:
        starts[element.name] = row + 1
        if order:
            tables[element.name], position = _binary(file, data[body:], position, element, order)
        else:
            tables[element.name], position = _text(file, tokens, position, element)
        row += element.count
    over = len(data) - body - position if order else len(tokens) - position
    if elements and over >= (_least_size(elements[-1]) if order else 1):
        counted = ", ".join(f"{element.count:,} {element.name} rows" for element in elements)
        what = "bytes" if order else "values"
        raise InputError(file, f"has {over:,} {what} more than its header declares ({counted})", _COUNTS)
    if "vertex" not in tables or not {"x", "y", "z"} <= tables["vertex"].singles.keys():
        raise InputError(file, "the PLY header declares no vertices with x, y and z", EXPORT_AGAIN)
    vertices = tables["vertex"].singles
    points = np.stack([vertices["x"], vertices["y"], vertices["z"]], axis=1)
    counts, corners = _faces(tables.get("face"))
    (declared,) = (element for element in elements if element.name == "vertex")
    single = bool(order) and all(p.type == "f4" for p in declared.properties if p.name in ("x", "y", "z"))
    return RawMesh(
        file=file,
        points=points,
        counts=counts,
        corners=corners,
        texcoords=_texcoords(tables, counts, corners),
        vertex_lines=None if order else starts["vertex"] + np.arange(len(points)),
        face_lines=None if order else starts.get("face", 0) + np.arange(len(counts)),
        doubt=float32_doubt(points) if single else None,
    )


def _header(file: str, data: bytes) -> tuple[str, list[_Element], int, int]:
    """Byte order ("" for text), elements, where the body starts, and lines of the header."""
    if not data.startswith((b"ply\n", b"ply\r")):
        raise InputError(file, "is not a PLY file: it does not start with 'ply'", "check the file's name and content")
    end = data.find(b"end_header")
    body = data.find(b"\n" if b"\n" in data[:5] else b"\r", end) + 1
    if end < 0 or not body:
        raise InputError(file, "the PLY header has no end_header line", CUT_OFF)
    order: str | None = None
    elements: list[_Element] = []
    lines = data[:end].splitlines()
    for number, line in enumerate(lines, start=1):
        tokens = line.split()
        try:
            if tokens[:1] == [b"format"]:
                order = _FORMATS[tokens[1]]
            elif tokens[:1] == [b"element"]:
                elements.append(_Element(tokens[1].decode(), int(tokens[2]), []))
            elif tokens[:1] == [b"property"]:
                elements[-1].properties.append(_property(tokens[1:]))
        except (KeyError, IndexError, ValueError):
            text = line[:40].decode("utf-8", errors="backslashreplace")
            raise InputError(f"{file}:{number}", f"{text!r} is not a PLY header line", EXPORT_AGAIN) from None
    if order is None or any(element.count < 0 for element in elements):
        raise InputError(file, "the PLY header has no format line, or a negative count", EXPORT_AGAIN)
    return order, elements, body, len(lines) + 1


def _least_size(element: _Element) -> int:
    """Bytes of a row whose lists have one entry; fewer at a file's end are padding."""
    sizes = (np.dtype(kind).itemsize for p in element.properties for kind in (p.count_type, p.type) if kind)
    return max(1, sum(sizes))


def _property(tokens: list[bytes]) -> _Property:
    if tokens[0] == b"list":
        return _Property(tokens[3].decode(), _TYPES[tokens[2].decode()], _TYPES[tokens[1].decode()])
    return _Property(tokens[1].decode(), _TYPES[tokens[0].decode()])


def _text(file: str, tokens: list[bytes], position: int, element: _Element) -> tuple[_Table, int]:
    """Values of an element of a text file from ``position`` on, and where it ends."""
    properties = element.properties
    columns: dict[str, list[float]] = {p.name: [] for p in properties}
    lengths: dict[str, list[int]] = {p.name: [] for p in properties if p.count_type}
    row = 0
    try:
        if not lengths:
            end = position + element.count * len(properties)
            if end > len(tokens):
                row = (len(tokens) - position) // max(len(properties), 1)
                raise IndexError
            values = np.array([float(token) for token in tokens[position:end]])
            table = values.reshape(element.count, len(properties)) if properties else np.zeros((0, 0))
            return _Table({p.name: table[:, i] for i, p in enumerate(properties)}, {}), end
        while row < element.count:
            for prop in properties:
                size = 1
                if prop.count_type:
                    size = int(tokens[position])
                    position += 1
                    lengths[prop.name].append(size)
                if size < 0 or position + size > len(tokens):
                    raise IndexError
                columns[prop.name].extend(map(float, tokens[position : position + size]))
                position += size
            row += 1
    except IndexError:
        problem = f"ends after {row:,} of {element.count:,} {element.name} rows"
        raise InputError(file, problem, CUT_OFF) from None
    except ValueError as error:
        raise InputError(file, f"a value of element {element.name!r} is not a number ({error})", EXPORT_AGAIN) from None
    singles = {p.name: np.array(columns[p.name]) for p in properties if not p.count_type}
    lists = {n: (np.array(v, dtype=np.int64), np.array(columns[n], dtype=np.float64)) for n, v in lengths.items()}
    return _Table(singles, lists), position


def _binary(file: str, body: bytes, position: int, element: _Element, order: str) -> tuple[_Table, int]:
    """Values of an element of a binary file from ``position`` on, and where it ends."""
    lists = [p for p in element.properties if p.count_type]
    if not element.count:
        return _Table({p.name: np.zeros(0) for p in element.properties if not p.count_type}, {}), position
    first: dict[str, int] = {}
    if lists:
        _, first = _one_row(file, body, position, element, order)
    row = [
        part
        for p in element.properties
        for part in (
            [(f"{p.name} length", order + p.count_type), (p.name, order + p.type, (first.get(p.name, 0),))]
            if p.count_type
            else [(p.name, order + p.type)]
        )
    ]
    layout = np.dtype(row)  # as if every list were as long as in the first row
    size = element.count * layout.itemsize
    if position + size <= len(body) and layout.itemsize:
        table = np.frombuffer(body, dtype=layout, count=element.count, offset=position)
        if all((table[f"{p.name} length"] == first.get(p.name, 0)).all() for p in lists):
            singles = {p.name: table[p.name].astype(np.float64) for p in element.properties if not p.count_type}
            found = {
                p.name: (
                    table[f"{p.name} length"].astype(np.int64),
                    table[p.name].astype(np.float64).reshape(-1),
                )
                for p in lists
            }
            return _Table(singles, found), position + size
    if not lists:
        done = (len(body) - position) // max(layout.itemsize, 1)
        raise InputError(file, f"ends after {done:,} of {element.count:,} {element.name} rows", CUT_OFF)
    return _binary_rows(file, body, position, element, order)


def _binary_rows(file: str, body: bytes, position: int, element: _Element, order: str) -> tuple[_Table, int]:
    """The same, row by row, for lists of different lengths."""
    starts = [position]
    lengths: dict[str, list[int]] = {p.name: [] for p in element.properties if p.count_type}
    for row in range(element.count):
        position, found = _one_row(file, body, position, element, order, row)
        starts.append(position)
        for name, length in found.items():
            lengths[name].append(length)
    columns: dict[str, list[bytes]] = {p.name: [] for p in element.properties}
    for row, (start, _) in enumerate(pairwise(starts)):
        for prop in element.properties:
            start += np.dtype(prop.count_type).itemsize if prop.count_type else 0
            end = start + np.dtype(prop.type).itemsize * (lengths[prop.name][row] if prop.count_type else 1)
            columns[prop.name].append(body[start:end])
            start = end
    values = {
        p.name: np.frombuffer(b"".join(columns[p.name]), dtype=order + p.type).astype(np.float64)
        for p in element.properties
    }
    singles = {p.name: values[p.name] for p in element.properties if not p.count_type}
    return _Table(singles, {n: (np.array(v, dtype=np.int64), values[n]) for n, v in lengths.items()}), position


def _one_row(
    file: str, body: bytes, position: int, element: _Element, order: str, row: int = 0
) -> tuple[int, dict[str, int]]:
    """End of the row that starts at ``position``, and the lengths of its lists."""
    lengths: dict[str, int] = {}
    for prop in element.properties:
        count = 1
        if prop.count_type:
            count_type = np.dtype(order + prop.count_type)
            word = body[position : position + count_type.itemsize]
            count = int(np.frombuffer(word, dtype=count_type)[0]) if len(word) == count_type.itemsize else -1
            lengths[prop.name] = count
            position += count_type.itemsize
        position += count * np.dtype(prop.type).itemsize
        if count < 0 or position > len(body):
            problem = f"ends after {row:,} of {element.count:,} {element.name} rows"
            raise InputError(file, problem, CUT_OFF)
    return position, lengths


def _faces(table: _Table | None) -> tuple[Ints, Ints]:
    name = next((name for name in _FACE_LISTS if table and name in table.lists), None)
    if table is None or name is None:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    counts, corners = table.lists[name]
    return counts, np.clip(np.nan_to_num(corners, nan=-1.0), -1, 2**62).astype(np.int64)


def _texcoords(tables: dict[str, _Table], counts: Ints, corners: Ints) -> Floats | None:
    """Texture coordinates of the corners: the faces' own list, or those of the vertices."""
    lists = tables["face"].lists if "face" in tables else {}
    if "texcoord" in lists and np.array_equal(lists["texcoord"][0], 2 * counts):
        return lists["texcoord"][1].reshape(-1, 2)
    vertices = tables["vertex"].singles
    for u, v in _VERTEX_TEXCOORDS:
        if {u, v} <= vertices.keys() and len(corners) and corners.min() >= 0 and corners.max() < len(vertices[u]):
            found: Floats = np.stack([vertices[u], vertices[v]], axis=1)[corners]
            return found
    return None
