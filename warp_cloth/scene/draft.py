"""The text of a scene file for a garment on a body, with comments, for people to go on from."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warp_cloth.base.toml_file import toml_text

FILES = ("mesh", "pattern")  # keys of files that a table begins with
HEAD = """\
# {name}, fitted on {body}:    warp-cloth fit {file}
# Lengths are in metres, y is up, the body faces +z. `warp-cloth plan {file}` shows what is computed,
# `warp-cloth scenes --keys all` every key. Lines that begin with # are defaults and examples.
"""
GARMENT = """\
# fabric = {name = "jersey", weight = 0.2}  # a fabric of `warp-cloth scenes`, but of 200 g/m2; or "measured.toml"
# rest = "auto"               # "mesh": cut as modelled; "uv": from panels in texture space
# translate = [0, 0, 0]       # by hand: moved by [m],
# rotate = [0, 0, 0]          # turned about x, then y, then z [degrees],
# scale = 1                   # and scaled, its rest shape too
"""
AVATAR = "# friction = 0.5              # of cloth on it: 0.5 on skin\n"
MANNEQUIN = '# shape = {kind = "mannequin", stature = 1.76, chest = 0.98, waist = 0.86, hip = 1.00}\n'
REST = """\
[collision]
# offset_mm = 3               # gap between skin and cloth
# cloth = "auto"              # whether cloth meets cloth; false: faster, but it may pass through itself

[solver]
# tolerance_mm = 1            # no further than this from the true rest shape
# residual = 0.01             # forces balanced to 1 %
"""


def draft_text(values: Mapping[str, Any], file: Path, units: Sequence[str], notes: Sequence[Sequence[str]]) -> str:
    """A scene file in TOML.

    Args:
        values: tables ``garment``, one or a list, and ``avatar``; their files relative to the current folder.
        file: where it will be written; its paths are relative to its folder.
        units: guessed unit of each garment, then of the avatar; empty where the file states it.
        notes: what loading says of each, likewise.
    """
    garments = values["garment"] if isinstance(values["garment"], list) else [values["garment"]]
    avatar = values["avatar"]
    names = ", ".join(dict.fromkeys(Path(each.get("mesh") or each["pattern"]).name for each in garments))
    body = Path(avatar["mesh"]).name if "mesh" in avatar else "the shipped mannequin"
    parts = [HEAD.format(name=names, body=body, file=_plain(shlex.quote(file.name)))]
    head = "[[garment]]" if len(garments) > 1 else "[garment]"
    for table, unit, said in zip(garments, units, notes, strict=False):
        parts.append("\n".join([head, *_lines({"fabric": "default", **table}, file, unit, said)]) + "\n" + GARMENT)
    shaped = MANNEQUIN if "shape" in avatar else ""
    parts.append("\n".join(["[avatar]", *_lines(avatar, file, units[-1], notes[-1])]) + "\n" + shaped + AVATAR)
    return "\n".join([*parts, REST])


def _lines(table: Mapping[str, Any], file: Path, unit: str, notes: Sequence[str]) -> list[str]:
    """A table's values, the file first, each on a line; notes above them."""
    values: dict[str, Any] = {key: table[key] for key in FILES if key in table}
    values |= {"units": unit} if unit else {}
    values |= table
    for key, value in values.items():
        if key in FILES or (key == "fabric" and str(value).lower().endswith(".toml")):
            values[key] = _relative(Path(value), file.parent)
    return [*(f"# {_plain(note)}" for note in notes), *(f"{key} = {toml_text(value)}" for key, value in values.items())]


def _relative(path: Path, folder: Path) -> str:
    """The file as a path from the folder, with /."""
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return path.resolve().as_posix()


def _plain(text: str) -> str:
    """Text that fits in a comment of TOML."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)
