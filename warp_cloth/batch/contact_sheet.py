"""The contact sheet of a batch: a page of thumbnails with verdicts, what is worst first."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.batch.jobs import Item
from warp_cloth.batch.rows import COLUMNS, EASE
from warp_cloth.export.files import whole_file
from warp_cloth.export.preview import preview_image
from warp_cloth.garment.outfit import MeshCache, avatar_recipe, wearer_skeleton
from warp_cloth.model.fit_problem import ProblemCode
from warp_cloth.model.result import WornGarment
from warp_cloth.report.shown import NOT_WORN, ShownVerdict, shown_verdict
from warp_cloth.scene import load_scene

SIZE = (600, 360)  # of a thumbnail [px]
QUALITY = 80  # of its JPEG
NO_RESULT = ShownVerdict("no result", NOT_WORN.colour)


@dataclass(frozen=True)
class Card:
    """One item on the page."""

    name: str
    words: str
    colour: str
    own: str  # the job's own columns, ease and strain
    message: str
    picture: str  # data URL; empty where there is no shape
    page: str = ""  # address of its report; empty: it has none


def write_contact_sheet(folder: Path, items: Sequence[Item], rows: Sequence[Mapping[str, Any]], count: int) -> Path:
    """Writes contact_sheet.html with the ``count`` worst of a finished batch's items.

    Args:
        folder: of the batch; its shapes are in shards/*.npz.
        items: of the batch.
        rows: their results, in the same order.
        count: of thumbnails.
    """
    order = sorted(range(len(rows)), key=lambda place: (_badness(rows[place]), place))[:count]
    drawer = _Drawer(folder)
    cards = [_card(items[place], rows[place], drawer) for place in order]
    worn = sum(bool(row["worn"]) for row in rows)
    title = f"{worn:,} of {len(rows):,} worn; {len(cards):,} shown, the worst first"
    path = folder / "contact_sheet.html"
    write_cards(path, title, cards)
    return path


def write_cards(path: Path, title: str, cards: Sequence[Card]) -> None:
    """Writes a page of cards, which needs no other file."""
    from jinja2 import Environment, StrictUndefined

    text = (files("warp_cloth.export") / "contact_sheet.html.j2").read_text(encoding="utf-8")
    template = Environment(autoescape=True, trim_blocks=True, undefined=StrictUndefined).from_string(text)
    with whole_file(path) as place:
        place.write_text(template.render(title=title, cards=cards), encoding="utf-8")


def thumbnail(garments: Sequence[WornGarment], avatar: Mesh | None, facing: int = 0) -> str:
    """A small picture as a data URL; empty of a shape that is not finite; ``facing`` as for ``preview_image``."""
    try:
        image = preview_image(garments=garments, avatar=avatar, size=SIZE, facing=facing)
    except ValueError:
        return ""
    data = io.BytesIO()
    image.save(data, format="JPEG", quality=QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(data.getvalue()).decode("ascii")


def _badness(row: Mapping[str, Any]) -> tuple[float, ...]:
    """Order of the page: no result, then the likeliest cause of not being worn, then notes, then strain."""
    if row["digest"] is None:
        return (0.0,)
    ranks = [ProblemCode(code).rank for code in row["problems"] or ()]
    strain = row["strain_p99"]
    strained = -strain if strain is not None and math.isfinite(strain) else -math.inf
    return (1.0 if not row["worn"] else 2.0, min(ranks, default=len(ProblemCode)), strained)


def _card(item: Item, row: Mapping[str, Any], drawer: _Drawer) -> Card:
    verdict = NO_RESULT if row["digest"] is None else shown_verdict(row)
    own = ", ".join(f"{key} = {value}" for key, value in item.columns.items() if key not in COLUMNS)
    picture = "" if row["digest"] is None else drawer.picture(item, str(row["file"]))
    told = "; ".join(filter(None, (own, _figures(row))))
    return Card(item.name, verdict.words, verdict.colour, told, str(row["message"]), picture)


def _figures(row: Mapping[str, Any]) -> str:
    """Ease where it was measured, and strain: what the order of worn items depends on."""
    eases = [(level, row.get(column)) for column, level in EASE.items()]
    told = ", ".join(f"{level} {ease:+.1f} cm" for level, ease in eases if ease is not None)
    strain = row["strain_p99"]
    is_known = strain is not None and math.isfinite(strain)
    figures = f"ease: {told}" if told else "", f"strain {100 * strain:.1f} % (99th percentile)" if is_known else ""
    return "; ".join(filter(None, figures))


class _Drawer:
    """Draws items from the batch's packed shapes; bodies are loaded once."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._meshes = folder, MeshCache()
        self._packed: tuple[str, Mapping[str, Any]] = ("", {})  # the shard that was read last

    def picture(self, item: Item, file: str) -> str:
        """The item as a data URL; empty where its shape cannot be drawn."""
        try:
            scene = load_scene(item.source, item.changes)
            avatar = self._meshes.make(avatar_recipe(scene)[0]) if scene.avatar is not None else None
            skeleton = wearer_skeleton(scene, avatar, self._meshes)
            return thumbnail(self._garments(item.name, file), avatar, 0 if skeleton is None else skeleton.facing)
        except (InputError, OSError):  # a file that is gone since
            return ""

    def _garments(self, name: str, file: str) -> list[WornGarment]:
        if self._packed[0] != file:
            with np.load(self._folder / file) as packed:
                self._packed = file, {key: packed[key] for key in packed.files}
        packed = self._packed[1]
        worn = []
        for number in np.flatnonzero(packed["item"] == name).tolist():
            points = packed["points"][slice(*packed["point_start"][number : number + 2])]
            triangles = packed["triangles"][slice(*packed["triangle_start"][packed["mesh"][number] :][:2])]
            garment = str(packed["garment"][number])
            worn.append(WornGarment(garment, Mesh(garment, points, triangles), points, thickness=0.0))
        return worn
