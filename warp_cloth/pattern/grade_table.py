"""Grade rule tables (.rul) of AAMA-292 and ASTM D6673: how far each numbered rule moves a point in each size.

    UNITS: METRIC
    SIZE LIST: S M L
    SAMPLE SIZE: M
    RULE: DELTA 1
        -10.0, 5.0    0.0, 0.0    10.0, -5.0

Movements are from the sample size's point, one pair (x, y) for each size of the list, on one line or several.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.dxf_unit import INCH
from warp_cloth.pattern.specification import short

SUFFIX = ".rul"
EXPORT_AGAIN = "export the table again, or move it away: the file is then read in its own size"
LARGEST_FILE = 50_000_000  # bytes
MOST_SIZES, MOST_RULES = 200, 100_000
LARGEST = 1e5  # in any unit
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_PAIR = re.compile(rf"({_NUMBER})\s*,\s*({_NUMBER})")
_HEADER = re.compile(r"^\s*([A-Za-z][A-Za-z /]*?)\s*:\s*(.*?)\s*$")
_RULE = re.compile(r"^\s*RULE\s*:\s*(?:DELTA)?\s*(\S+)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class GradeTable:
    """Sizes, from first to last as the table has them, and the movements of each rule in the table's unit."""

    sizes: tuple[str, ...]
    sample: str
    metric: bool
    rules: dict[int, Floats]  # shape [S, 2] each

    def unit(self, metres: float) -> float:
        """Metres in its unit; ``metres``: those in the unit of its DXF file, which it shares if both are metric."""
        if not self.metric:
            return INCH
        return 1e-3 if metres == INCH else metres


def grade_table_path(pattern: Path) -> Path | None:
    """The grade rule table that lies next to a DXF file, under the same name; None: there is none."""
    try:
        found = sorted(path for path in pattern.parent.iterdir() if path.suffix.lower() == SUFFIX)
    except OSError:
        return None
    return next((path for path in found if path.stem.lower() == pattern.stem.lower() and path.is_file()), None)


def read_grade_table(file: str, data: bytes) -> GradeTable:
    """A grade rule table.

    Raises:
        InputError: it lists no sizes, or a rule is of other ones.
    """
    if len(data) > LARGEST_FILE:
        raise InputError(file, "is too large for a grade rule table", EXPORT_AGAIN)
    lines = data.decode("utf-8", "replace").replace("\r", "\n").split("\n")
    stated: dict[str, str] = {}
    texts: dict[str, list[str]] = {}
    rule = ""
    for line in lines:
        found = _RULE.match(line)
        header = _HEADER.match(line)
        if found is not None:
            rule = found[1]
            texts[rule] = []
        elif line.strip().upper() == "END":
            break
        elif rule:
            texts[rule].append(line.split("#")[0])
        elif header is not None:
            stated[header[1].upper()] = header[2]
    sizes = _sizes(file, stated)
    rules: dict[int, Floats] = {}
    for name, found_lines in texts.items():
        place = f'{file}: rule "{short(name)}"'
        moved = np.array(_PAIR.findall(" ".join(found_lines)), dtype=float).reshape(-1, 2)
        if len(moved) != len(sizes):
            raise InputError(place, f"has {len(moved)} pairs of numbers for {len(sizes)} sizes", EXPORT_AGAIN)
        if not float(np.abs(moved).max(initial=0.0)) < LARGEST:
            raise InputError(place, "a number is not usable", EXPORT_AGAIN)
        if name.isdigit() and len(name) < 7 and len(rules) < MOST_RULES:
            rules[int(name)] = moved
    sample = stated.get("SAMPLE SIZE") or stated.get("BASE SIZE", "")
    found_size = next((size for size in sizes if size.lower() == sample.strip().lower()), None)
    still = np.all([np.abs(moved).max(axis=1) < 1e-9 for moved in rules.values()], axis=0) if rules else []
    if found_size is None:  # the one in which nothing moves
        found_size = sizes[int(np.argmax(still))] if np.any(still) else sizes[len(sizes) // 2]
    metric = not re.search(r"english|imperial|inch", stated.get("UNITS", "").lower())
    return GradeTable(sizes, found_size, metric, rules)


def _sizes(file: str, stated: dict[str, str]) -> tuple[str, ...]:
    text = stated.get("SIZE LIST") or stated.get("SIZES", "")
    count = int(re.sub(r"\D", "", stated.get("NUMBER OF SIZES", ""))[:6] or 0)
    ways = (r"\s+", r"\s*,\s*", r"\s{2,}", r"\s*;\s*")
    lists = [[size for size in re.split(way, text.strip()) if size] for way in ways]
    sizes = next((each for each in lists if len(each) == count), lists[0])
    if not sizes or len(sizes) > MOST_SIZES or len(set(sizes)) < len(sizes):
        raise InputError(file, "lists no sizes, or one of them twice", EXPORT_AGAIN)
    return tuple(sizes)
