"""The output folder of a batch: every shard's file is whole or absent, and what is there need not be done again.

OUT/plan.json            how the items are cut into shards
OUT/shards/00000.parquet rows of a shard; its presence says that the shard is done
OUT/shards/00000.npz     worn points of a shard, packed (keep = "arrays")
OUT/stages/NAME.usdc     one stage per item (keep = "stages")
OUT/results.parquet      all rows, in the order of the items; results.csv the same
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import io
import itertools
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.batch.jobs import Item, avatar_asked, garments_asked
from warp_cloth.batch.rows import COLUMNS, FAILED, FIGURES, WHOLE_NUMBERS, ItemResult, empty_row
from warp_cloth.export.files import unwritable, whole_file

if TYPE_CHECKING:
    import pyarrow

Keep = Literal["arrays", "stages", "none"]
MORE = 1.25  # times the items of a shard at most
LARGE = 64  # items of a shard of which some are smaller
SMALL = 128  # items of the first of those and the last: with fewer a GPU's cores have little to do
GROWTH = 1.6  # from one to the next at first, which is loaded while that one relaxes,
SHRINKING = 2.0  # and at last, as measuring takes about as long as relaxing half as many
TOGETHER = 4  # avatars that the first garments are met by before others come
LAYOUT = 1  # of the output folder; files of another layout are done again


@dataclass(frozen=True)
class Shard:
    """Items that one task does, and whose results one file holds."""

    number: int
    items: tuple[Item, ...]
    places: tuple[int, ...] = ()  # of the items in the batch

    @property
    def label(self) -> str:
        return f"{self.number:05d}"

    @cached_property
    def asks(self) -> frozenset[str]:
        """Scenes and changes of the items: what shards have in common of these, they may share meshes by."""
        return frozenset(told for item in self.items for told in (item.scene, *item.changes))

    @cached_property
    def digest(self) -> str:
        """A fingerprint of what is asked: the items, and the scene files as they stand."""
        asked = [[item.name, item.scene, list(item.changes), item.problem] for item in self.items]
        scenes = {scene: _file_digest(scene) for scene in dict.fromkeys(item.scene for item in self.items)}
        return hashlib.sha256(json.dumps([LAYOUT, asked, scenes]).encode()).hexdigest()


def cut(items: Sequence[Item], size: int) -> list[Shard]:
    """``size`` items to a shard, or somewhat more; those that meet the same avatar follow one another.

    So a shard needs few avatars, and its worker begins when these are there. Large shards have some garments in all
    their fabrics rather than all in some; they are small at first and grow, and are small again at last: what has to be
    done before a GPU begins, and after it has ended, nothing else hides.
    """
    alike: dict[tuple[str, ...], list[int]] = {}
    for place, item in enumerate(items):
        alike.setdefault(avatar_asked(item), []).append(place)
    if min(size, len(items)) >= LARGE:
        order = _in_halves([_by_garment(items, places) for places in alike.values()])
        counts = _growing(len(items), size)
        ends = itertools.accumulate(counts)
        shards = [order[end - count : end] for end, count in zip(ends, counts, strict=True)]
    else:
        shards = []
        most = int(MORE * size)
        for places in alike.values():
            step = -(-len(places) // -(-len(places) // most))
            for first in range(0, len(places), step):
                some = places[first : first + step]
                if shards and len(shards[-1]) + len(some) <= size:
                    shards[-1] += some
                else:
                    shards.append(some)
    return [Shard(number, tuple(items[at] for at in some), tuple(some)) for number, some in enumerate(shards)]


def _growing(count: int, most: int) -> list[int]:
    """So many items as shards that grow to ``most``, or somewhat more, and shrink again."""
    first = min(SMALL, -(-min(count, most) // 2))
    sizes = {"front": first, "back": first}
    found: dict[str, list[int]] = {"front": [], "back": []}
    while count:
        for end, growth in (("front", GROWTH), ("back", SHRINKING)):
            if not count or (end == "back" and sizes[end] > most):
                continue
            wanted = min(sizes[end], most, count)
            if count - wanted < wanted / 2 and count <= MORE * most:  # no small one is left in the middle
                wanted = count
            found[end].append(wanted)
            count -= wanted
            sizes[end] = int(growth * sizes[end])
    return found["front"] + found["back"][::-1]


def _in_halves(avatars: Sequence[tuple[list[int], list[int]]]) -> list[int]:
    """Places of items on several avatars, in two halves each, in an order in which a batch begins early.

    Constants of garments take the longest to work out, and are the same on all avatars: so the first few avatars meet
    the garments of the first half before those of the second one.
    """
    first, later = avatars[:TOGETHER], avatars[TOGETHER:]
    halves = [*(early for early, _ in first), *(late for _, late in reversed(first)), *itertools.chain(*later)]
    return list(itertools.chain(*halves))


def _by_garment(items: Sequence[Item], places: Sequence[int]) -> tuple[list[int], list[int]]:
    """Places of items, those of the same garment after one another: of every other garment, and of the rest.

    So a half of them has no more work than the other: jobs list garments by their size.
    """
    alike: dict[tuple[str, ...], list[int]] = {}
    for place in places:
        alike.setdefault(garments_asked(items[place]), []).append(place)
    each = list(alike.values())
    even, odd = (list(itertools.chain(*some)) for some in (each[::2], each[1::2]))
    return even, odd


def _file_digest(path: str) -> str:
    try:
        if not Path(path).is_file():  # a shipped scene, one that is not there, a device that never ends
            return ""
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except (OSError, ValueError):
        return ""  # its items will say so


@functools.cache
def _arrow() -> Any:
    """pyarrow, once tables are read or written: processes begin without it."""
    import pyarrow.csv
    import pyarrow.parquet

    return pyarrow


def _table(rows: Sequence[Mapping[str, Any]]) -> pyarrow.Table:
    """Rows, as of ``empty_row``, as a table."""
    arrow = _arrow()
    figures = {name: arrow.int64() if name in WHOLE_NUMBERS else arrow.float64() for name in FIGURES}
    schema = arrow.schema([(name, figures.get(name, arrow.string())) for name in COLUMNS])
    return arrow.Table.from_pylist(rows, schema=schema)


def file_marks(paths: Sequence[Path]) -> dict[str, list[int]]:
    """Size and time of files that results depend on; [] where a file is gone."""
    marks = {}
    for path in sorted({str(path.absolute()) for path in paths}):
        try:
            status = os.stat(path)
            marks[path] = [status.st_size, status.st_mtime_ns]
        except OSError:
            marks[path] = []
    return marks


@dataclass(frozen=True)
class Store:
    """A batch's output folder."""

    folder: Path
    keep: Keep

    @property
    def shards(self) -> Path:
        return self.folder / "shards"

    @property
    def stages(self) -> Path:
        return self.folder / "stages"

    @contextlib.contextmanager
    def common(self) -> Iterator[Path | None]:
        """A folder by which this batch's workers share what they work out, while it runs; None where none can be."""
        try:
            place = tempfile.mkdtemp(prefix=".common-", dir=self.folder)  # which nobody else may write
        except OSError:
            yield None
            return
        try:
            yield Path(place)
        finally:
            shutil.rmtree(place, ignore_errors=True)

    def turn_file(self, device: str) -> Path:
        """The file by which this batch's workers take turns on a device."""
        return self.folder / f".turn_{device.replace(':', '')}"

    def open(self) -> None:
        """Makes the folders, and clears what a killed run left half-written.

        Raises:
            InputError: the folder cannot be written.
        """
        try:
            for place in (self.folder, self.shards, *((self.stages,) if self.keep == "stages" else ())):
                place.mkdir(parents=True, exist_ok=True)
                for left in place.glob(".*-*"):  # of whole_file, and of ``common``
                    shutil.rmtree(left, ignore_errors=True)
        except (OSError, ValueError) as error:
            raise unwritable(self.folder, error) from error

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Keeps another batch out of the folder; the lock ends with the process, however that ends."""
        try:
            with open(self.folder / ".lock", "w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                yield
        except BlockingIOError:
            raise InputError(
                self.folder, "another batch writes there", "wait for it, or choose another folder"
            ) from None

    def get_ready(self) -> None:
        """Imports what tables are put together with, and begins its threads, while others work."""
        arrow, nowhere = _arrow(), io.BytesIO()
        table = _table([empty_row("", FAILED, "")]).take(np.array([0]))
        arrow.parquet.write_table(table, nowhere)
        arrow.concat_tables([arrow.parquet.ParquetFile(nowhere).read(), table])
        arrow.csv.write_csv(table, io.BytesIO())
        np.savez(io.BytesIO(), **packed([]))

    def check_batch(self, items: Sequence[Item]) -> None:
        """Looks whether the folder is free, or holds some of these items, as they are or as they were.

        Raises:
            InputError: it holds results of other items, which would be lost.
        """
        asked = {item.name for item in items}
        others: list[str] = []
        for path in sorted(self.shards.glob("*.parquet")):
            try:
                names = _arrow().parquet.read_table(path, columns=["name"])["name"].to_pylist()
            except (OSError, ValueError, KeyError, _arrow().ArrowException):  # damaged, or of another layout
                continue
            if asked.intersection(names):
                return
            others += names
        if others:
            problem = f'holds the results of another batch ("{others[0]}" and {len(others) - 1:,} more)'
            raise InputError(self.folder, problem, "choose another folder, or remove that one")

    def shard_size(self, wanted: int, asked: bool) -> int:
        """Items to a shard: as the folder's plan says, so that a batch goes on where it stood; else as wanted.

        ``asked`` says that the size was stated, which then holds.
        """
        path = self.folder / "plan.json"
        if not asked:
            with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
                return max(int(json.loads(path.read_text(encoding="utf-8"))["shard_size"]), 1)
        with whole_file(path) as place:
            place.write_text(json.dumps({"layout": LAYOUT, "shard_size": wanted}) + "\n", encoding="utf-8")
        return wanted

    def write(self, shard: Shard, results: Sequence[ItemResult], inputs: Mapping[str, Any]) -> None:
        """Writes a shard's points, then its rows; with the rows the shard is done.

        Raises:
            InputError: a file cannot be written; the shard is then not done.
        """
        if self.keep == "arrays":
            with whole_file(self.shards / f"{shard.label}.npz") as place, place.open("wb") as file:
                np.savez(file, **packed(results))
        table = _table([result.row for result in results])
        marks = {"digest": shard.digest, "keep": self.keep, "inputs": json.dumps(dict(inputs))}
        with whole_file(self.shards / f"{shard.label}.parquet") as place:
            _arrow().parquet.write_table(table.replace_schema_metadata(marks), place)

    def done(self, shard: Shard) -> bool:
        """Whether a shard needs no more work: it is written, and the machine failed none of its items."""
        table = self.rows(shard)
        return table is not None and FAILED not in table["status"].to_pylist()

    def rows(self, shard: Shard) -> pyarrow.Table | None:
        """A shard's rows, if it is written and its items and files are still as they were then."""
        path = self.shards / f"{shard.label}.parquet"
        if not path.exists():
            return None
        try:
            table = _arrow().parquet.ParquetFile(path).read()  # read_table imports what reads many files
            marks = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
            inputs = json.loads(marks.get("inputs", ""))
        except (OSError, ValueError, _arrow().ArrowException):  # damaged
            return None
        if marks.get("digest") != shard.digest or marks.get("keep") != self.keep or len(table) != len(shard.items):
            return None
        if self.keep == "arrays" and not (self.shards / f"{shard.label}.npz").is_file():
            return None
        if file_marks([Path(path) for path in inputs]) != inputs:
            return None
        return table.replace_schema_metadata(None)

    def merge(self, shards: Sequence[Shard], problems: Mapping[int, str]) -> pyarrow.Table:
        """Writes results.parquet and results.csv of all shards, and removes files of none.

        Items of a shard that is not written have failed, for the reason given by its number.
        """
        tables = []
        for shard in shards:
            table = None if shard.number in problems else self.rows(shard)
            if table is None:
                reason = problems.get(shard.number, "not done")
                table = _table([empty_row(item.name, FAILED, reason) for item in shard.items])
            tables.append(table)
        places = np.concatenate([shard.places for shard in shards])
        merged = _arrow().concat_tables(tables).take(np.argsort(places))
        with whole_file(self.folder / "results.parquet") as place:
            _arrow().parquet.write_table(merged, place)
        with whole_file(self.folder / "results.csv") as place:
            _arrow().csv.write_csv(merged, place)
        known = {shard.label for shard in shards}
        for path in self.shards.iterdir():
            if path.suffix in (".parquet", ".npz") and path.stem not in known:
                path.unlink(missing_ok=True)
        return merged


def packed(results: Sequence[ItemResult]) -> dict[str, Any]:
    """Arrays of all worn garments of a shard, one after another; equal triangles are kept once.

    ``item``, ``garment`` name each garment; its points are ``points[point_start[g] : point_start[g + 1]]`` and its
    triangles, counted from its own first point, ``triangles[triangle_start[m] : triangle_start[m + 1]]``, m = mesh[g].
    """
    names = [(result.row["name"], worn) for result in results for worn in result.worn]
    meshes: dict[bytes, int] = {}
    told: dict[int, bytes] = {}  # of arrays that several have
    triangles, mesh = [], []
    for _, worn in names:
        key = told.get(id(worn.triangles)) or hashlib.sha256(np.ascontiguousarray(worn.triangles).tobytes()).digest()
        told[id(worn.triangles)] = key
        if key not in meshes:
            meshes[key] = len(meshes)
            triangles.append(worn.triangles)
        mesh.append(meshes[key])
    points = [worn.points for _, worn in names]
    return {
        "item": np.array([name for name, _ in names], dtype=np.str_),
        "garment": np.array([worn.garment for _, worn in names], dtype=np.str_),
        "points": np.concatenate(points) if points else np.zeros((0, 3)),
        "point_start": np.cumsum([0, *(len(each) for each in points)]),
        "triangles": np.concatenate(triangles) if triangles else np.zeros((0, 3), dtype=np.int32),
        "triangle_start": np.cumsum([0, *(len(each) for each in triangles)]),
        "mesh": np.array(mesh, dtype=np.int32),
    }
