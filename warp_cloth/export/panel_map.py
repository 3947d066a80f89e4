"""Maps on the flat panels of patterns: each panel as cut, in the map's colours, with a legend; SVG and PNG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from warp_cloth.export.files import whole_file
from warp_cloth.export.flat_panels import FlatPanels, flat_panels
from warp_cloth.export.map_picture import draw_legend, ticks
from warp_cloth.export.pattern_picture import GAP, TEXT, Sheet, laid_out
from warp_cloth.export.surface import cloth_colour
from warp_cloth.maps.colour import colours, shown_value
from warp_cloth.maps.kinds import MapKind
from warp_cloth.model.result import WornGarment

BINS = 48  # colours of the SVG
LEGEND = 160.0  # [mm] room for it, right of the panels
BAR = 22.0  # [mm]
MOST_PIXELS = 3000  # along a side of the PNG; 1 mm is a pixel where that suffices
RIM = "#333333"

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Panel:
    """One panel of one garment on the sheet."""

    name: str
    garment: int
    corners: Floats  # of its triangles on the sheet [mm], shape [F, 3, 2]
    vertices: NDArray[np.int64]  # of the flat mesh, shape [F, 3]
    rim: Floats  # sides of its outline [mm], shape [S, 2, 2]
    label: tuple[float, float]  # where its name stands [mm]


@dataclass(frozen=True, eq=False)
class PanelMaps:
    """Draws the maps of garments on their panels."""

    garments: Sequence[WornGarment]
    flats: Sequence[FlatPanels]
    panels: Sequence[_Panel]
    size: tuple[float, float]  # [mm]

    @classmethod
    def of(cls, garments: Sequence[WornGarment]) -> PanelMaps | None:
        """The panels of all garments on one sheet; None if there are none."""
        pairs = [(worn, flat) for worn in garments if (flat := flat_panels(worn)) is not None]
        parts = [
            (number, index, np.flatnonzero(flat.panels == index))
            for number, (_, flat) in enumerate(pairs)
            for index in np.unique(flat.panels).tolist()
        ]
        if not parts:
            return None
        boxes = []
        for number, _, faces in parts:
            points = pairs[number][1].points[pairs[number][1].triangles[faces]].reshape(-1, 2) * (1e3, -1e3)
            boxes.append((points.min(axis=0), points.max(axis=0)))
        sheet = laid_out(boxes)
        panels = [
            _panel(sheet, place, number, pairs[number][1], index, faces, boxes[place])
            for place, (number, index, faces) in enumerate(parts)
        ]
        worn, flats = zip(*pairs, strict=True)
        return cls(worn, flats, panels, (sheet.size[0] + LEGEND, max(sheet.size[1], 4.0 * GAP)))

    def write(self, path: Path, kind: MapKind, bounds: tuple[float, float]) -> list[Path]:
        """Writes PATH.svg and PATH.png with colours for the range ``bounds``."""
        paths = [path.with_name(path.name + suffix) for suffix in (".svg", ".png")]
        with whole_file(paths[0]) as place:
            place.write_text(self._svg(kind, bounds), encoding="utf-8")
        with whole_file(paths[1]) as place:
            self._save_png(place, kind, bounds)
        return paths

    def _values(self, panel: _Panel, kind: MapKind) -> NDArray[np.float32] | None:
        """The map at the corners of a panel's triangles, shape [F, 3]; None where its garment has no such map."""
        values = self.garments[panel.garment].fields.get(kind.name)
        return None if values is None else self.flats[panel.garment].of_vertices(values)[panel.vertices]

    def _svg(self, kind: MapKind, bounds: tuple[float, float]) -> str:
        width, height = self.size
        lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.2f}mm" height="{height:.2f}mm" '
            f'viewBox="0 0 {width:.2f} {height:.2f}" font-family="sans-serif" font-size="{TEXT:g}">'
        ]
        table = [_hex(colour) for colour in colours(kind, np.linspace(*bounds, BINS), bounds)]
        for panel in self.panels:
            quoted = escape(panel.name, {'"': "&quot;"})
            lines.append(f'<g id="{quoted}" stroke-width="0.4" stroke-linejoin="round">')
            values = self._values(panel, kind)
            if values is None:
                groups = {_hex(np.array(cloth_colour(panel.garment))): panel.corners}
            else:
                share = (values.mean(axis=1) - bounds[0]) / (bounds[1] - bounds[0])
                bins = np.clip(np.round(share * (BINS - 1)), 0, BINS - 1).astype(int)
                groups = {table[each]: panel.corners[bins == each] for each in np.unique(bins).tolist()}
            for colour, corners in groups.items():
                path = "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in three) + "Z" for three in corners.tolist())
                lines.append(f'<path fill="{colour}" stroke="{colour}" d="{path}"/>')
            rim = "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for (a, b), (c, d) in panel.rim.tolist())
            lines.append(f'<path fill="none" stroke="{RIM}" d="{rim}"/>')
            x, y = panel.label
            lines.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{escape(panel.name)}</text></g>')
        return "\n".join([*lines, *self._svg_legend(kind, bounds, table), "</svg>", ""])

    def _svg_legend(self, kind: MapKind, bounds: tuple[float, float], table: Sequence[str]) -> list[str]:
        left, top, tall = self.size[0] - LEGEND + 0.5 * GAP, GAP, min(300.0, self.size[1] - 2 * GAP)
        step = tall / BINS
        lines = [f'<text x="{left:.1f}" y="{top - TEXT:.1f}">{escape(kind.label)}</text>']
        for place, colour in enumerate(table[::-1]):
            y = top + place * step
            lines.append(
                f'<rect x="{left:.1f}" y="{y:.2f}" width="{BAR:g}" height="{1.05 * step:.2f}" fill="{colour}"/>'
            )
        for value in ticks(kind, bounds):
            y = top + (bounds[1] - value) / (bounds[1] - bounds[0]) * tall + 0.35 * TEXT
            lines.append(f'<text x="{left + BAR + 4:.1f}" y="{y:.1f}">{escape(shown_value(kind, value))}</text>')
        return lines

    def _save_png(self, path: Path, kind: MapKind, bounds: tuple[float, float]) -> None:
        from PIL import Image, ImageDraw

        from warp_cloth.export.lettering import font_for, spelt

        scale = min(1.0, MOST_PIXELS / max(self.size))
        width, height = (max(1, round(scale * each)) for each in self.size)
        picture = Image.new("RGB", (width, height), "white")
        pen = ImageDraw.Draw(picture)
        font = font_for(max(8.0, 1.3 * scale * TEXT), *(panel.name for panel in self.panels))
        for panel in self.panels:
            values = self._values(panel, kind)
            corners = scale * panel.corners
            if values is None:
                shown = np.tile(cloth_colour(panel.garment), (len(corners), 1))
            else:
                corners, values = _quartered(corners), _quartered(values[:, :, None])[:, :, 0]
                shown = colours(kind, values.mean(axis=1), bounds)
            for three, colour in zip(corners.reshape(-1, 6).tolist(), _bytes(shown).tolist(), strict=True):
                pen.polygon(three, fill=tuple(colour))
            for side in (scale * panel.rim).reshape(-1, 4).tolist():
                pen.line(side, fill=RIM, width=max(1, round(1.5 * scale)))
            name = spelt(panel.name, font)
            pen.text((scale * panel.label[0], scale * panel.label[1]), name, fill=RIM, font=font, anchor="ms")
        draw_legend(picture, kind, bounds, round(scale * (LEGEND - 0.5 * GAP)))
        picture.save(path, format="PNG")


def _panel(
    sheet: Sheet,
    place: int,
    garment: int,
    flat: FlatPanels,
    index: int,
    faces: NDArray[np.int64],
    box: tuple[Floats, Floats],
) -> _Panel:
    triangles = flat.triangles[faces].astype(np.int64)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    count = len(flat.points)
    key = np.minimum(start, end) * count + np.maximum(start, end)
    _, first, times = np.unique(key, return_index=True, return_counts=True)
    once = first[times == 1]
    sides = np.stack([flat.points[start[once]], flat.points[end[once]]], axis=1)
    low, high = box
    shift = sheet.shifts[place]
    return _Panel(
        flat.names[index] if 0 <= index < len(flat.names) else f"panel {index}",
        garment,
        sheet.placed(place, flat.points[triangles].reshape(-1, 2)).reshape(-1, 3, 2),
        triangles,
        sheet.placed(place, sides.reshape(-1, 2)).reshape(-1, 2, 2),
        (float(low[0] + high[0]) / 2 + shift[0], float(high[1] + shift[1]) + 1.5 * TEXT),
    )


def _quartered(corners: NDArray[Any]) -> NDArray[Any]:
    """Triangles, shape [F, 3, n], each in four by the middles of its sides."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    return np.concatenate([np.stack(three, axis=1) for three in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])


def _bytes(shown: Floats) -> NDArray[np.uint8]:
    return np.round(255.0 * np.clip(shown, 0.0, 1.0)).astype(np.uint8)


def _hex(colour: Floats) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in _bytes(np.asarray(colour)).tolist())
