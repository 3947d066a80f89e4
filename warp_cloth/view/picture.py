"""Coloured meshes as glTF bytes, and the legend of a map as HTML."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points
from warp_cloth.export.surface import linear
from warp_cloth.maps.colour import colours, shown_value
from warp_cloth.maps.kinds import MapKind

FLOAT, BYTE, SHORT, UNSIGNED = 5126, 5121, 5123, 5125  # glTF's codes of number types
VERTICES, ELEMENTS = 34962, 34963  # and of buffers
LEGEND_STEPS = 24
SHORT_COUNT = 65535  # vertices that a 16-bit index can name; glTF reserves one value


def glb_bytes(points: Points, triangles: Indices, shown: NDArray[np.float64]) -> bytes:
    """A glTF file of one double-sided mesh with vertex colours (linear light, shape [V, 3]).

    Written by hand, because a general exporter is too slow for ten times a second. Normals are declared and left at
    zero: the page computes them itself, but shades every triangle flat if there are none.
    """
    written = np.ascontiguousarray(points, dtype="<f4")
    colours = np.full((len(written), 4), 255, dtype=np.uint8)
    colours[:, :3] = np.rint(255.0 * np.clip(shown, 0.0, 1.0))
    small = len(written) <= SHORT_COUNT
    arrays = [
        (written, "VEC3", FLOAT, VERTICES),
        (colours, "VEC4", BYTE, VERTICES),
        (triangles.ravel().astype("<u2" if small else "<u4"), "SCALAR", SHORT if small else UNSIGNED, ELEMENTS),
    ]
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    start = 0
    for array, shape, kind, target in arrays:
        views.append({"buffer": 0, "byteOffset": start, "byteLength": array.nbytes, "target": target})
        entry = {"bufferView": len(accessors), "componentType": kind, "count": len(array), "type": shape}
        accessors.append(entry)
        start += array.nbytes
    accessors[0] |= {"min": written.min(axis=0).tolist(), "max": written.max(axis=0).tolist()}
    accessors[1]["normalized"] = True
    accessors.append({"componentType": FLOAT, "count": len(written), "type": "VEC3"})
    attributes = {"POSITION": 0, "COLOR_0": 1, "NORMAL": 3}
    surface = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}, "doubleSided": True}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 2, "material": 0}]}],
        "materials": [surface],
        "buffers": [{"byteLength": start}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(array.tobytes() for array, *_ in arrays)
    data += b"\0" * (-len(data) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


def map_colours(kind: MapKind, values: NDArray[np.float32], bounds: tuple[float, float]) -> NDArray[np.float64]:
    """Colours of a map's values in linear light, shape [V, 3]."""
    return linear(colours(kind, values, bounds))


def legend_html(kind: MapKind, bounds: tuple[float, float]) -> str:
    """A bar of the map's colours with the values at its ends and middle."""
    values = np.linspace(*bounds, LEGEND_STEPS)
    rows = np.round(255 * colours(kind, values, bounds)).astype(np.uint8)
    stops = ",".join(f"#{row.tobytes().hex()}" for row in rows)
    ends = [shown_value(kind, value) for value in (bounds[0], 0.5 * (bounds[0] + bounds[1]), bounds[1])]
    numbers = "".join(f"<span>{end}</span>" for end in ends)
    return (
        f'<div style="padding:0 1em 0.5em;font-size:0.8em" id="map-legend"><div>{kind.label}</div>'
        f'<div style="height:0.9em;border-radius:2px;background:linear-gradient(to right,{stops})"></div>'
        f'<div style="display:flex;justify-content:space-between">{numbers}</div></div>'
    )
