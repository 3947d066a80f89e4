"""The output folder of a batch: every shard's file is complete or absent, and complete ones are not done again.

OUT/plan.json            items per shard
OUT/shards/00000.parquet rows of a shard; the shard is done if it exists
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
from warp_cloth.batch.columns import with_columns
from warp_cloth.batch.jobs import Item, avatar_key, garments_key
from warp_cloth.batch.rows import COLUMNS, EASE, FAILED, FIGURES, GIRTH, INTEGERS, ItemResult, empty_row
from warp_cloth.export.files import unwritable, whole_file

if TYPE_CHECKING:
    import pyarrow

Keep = Literal["arrays", "stages", "none"]
MOST_OVER = 1.25  # times the stated size of a shard, at most
LARGE = 16  # items per shard from which shards grow and shrink
FIRST_SHARD = 128  # items of the first shard and the last: fewer do not fill a GPU
GROWTH = 1.6  # from shard to shard at first: the next one loads while one relaxes
SHRINKING = 2.0  # and at the end: measuring a shard takes about as long as relaxing half of it
FIRST_AVATARS = 4  # that the first half of the garments is fitted to before other avatars
LAYOUT = 4  # version of the output folder; files of another version are done again


@dataclass(frozen=True)
class Shard:
    """Items of one task and one results file."""

    number: int
    items: tuple[Item, ...]
    places: tuple[int, ...] = ()  # indices of the items in the batch

    @property
    def label(self) -> str:
        return f"{self.number:05d}"

    @cached_property
    def inputs(self) -> frozenset[str]:
        """Scenes and changes of the items: shards that have some in common may share meshes."""
        return frozenset(text for item in self.items for text in (item.scene, *item.changes))

    @cached_property
    def digest(self) -> str:
        """A hash of the items and the contents of their scene files."""
        items = [[item.name, item.scene, list(item.changes), item.problem] for item in self.items]
        scenes = {scene: _file_digest(scene) for scene in dict.fromkeys(item.scene for item in self.items)}
        return hashlib.sha256(json.dumps([LAYOUT, items, scenes]).encode()).hexdigest()


def split(items: Sequence[Item], size: int) -> list[Shard]:
    """Shards of ``size`` items, or somewhat more; items of the same avatar follow one another.

    So a shard needs few avatars, and its worker can begin when these are loaded. Large shards hold some garments in all
    their fabrics rather than all garments in some. They grow at first and shrink at the end, as nothing hides the time
    of loading the first shard and of measuring the last one.
    """
    by_avatar: dict[tuple[str, ...], list[int]] = {}
    for place, item in enumerate(items):
        by_avatar.setdefault(avatar_key(item), []).append(place)
    if min(size, len(items)) >= LARGE:
        order = _interleaved([_by_garment(items, places) for places in by_avatar.values()])
        counts = _growing_counts(len(items), size)
        ends = itertools.accumulate(counts)
        shards = [order[end - count : end] for end, count in zip(ends, counts, strict=True)]
    else:
        shards = []
        most = int(MOST_OVER * size)
        for places in by_avatar.values():
            step = -(-len(places) // -(-len(places) // most))
            for first in range(0, len(places), step):
                some = places[first : first + step]
                if shards and len(shards[-1]) + len(some) <= size:
                    shards[-1] += some
                else:
                    shards.append(some)
    return [Shard(number, tuple(items[at] for at in some), tuple(some)) for number, some in enumerate(shards)]


def _growing_counts(count: int, most: int) -> list[int]:
    """Item counts of shards that grow to ``most``, or somewhat more, and shrink again; their sum is ``count``."""
    first = min(FIRST_SHARD, -(-min(count, most) // 2))
    sizes = {"front": first, "back": first}
    found: dict[str, list[int]] = {"front": [], "back": []}
    while count:
        for end, growth in (("front", GROWTH), ("back", SHRINKING)):
            if not count or (end == "back" and sizes[end] > most):
                continue
            wanted = min(sizes[end], most, count)
            if count - wanted < wanted / 2 and count <= MOST_OVER * most:  # leaves no small shard in the middle
                wanted = count
            found[end].append(wanted)
            count -= wanted
            sizes[end] = int(growth * sizes[end])
    return found["front"] + found["back"][::-1]


def _interleaved(avatars: Sequence[tuple[list[int], list[int]]]) -> list[int]:
    """Places of items on several avatars, in two halves each, in an order in which a batch can begin early.

    Constants of garments take longest to compute, and are the same on all avatars: so the first half of the garments is
    fitted to the first few avatars before the second half is.
    """
    first, later = avatars[:FIRST_AVATARS], avatars[FIRST_AVATARS:]
    halves = [*(early for early, _ in first), *(late for _, late in reversed(first)), *itertools.chain(*later)]
    return list(itertools.chain(*halves))


def _by_garment(items: Sequence[Item], places: Sequence[int]) -> tuple[list[int], list[int]]:
    """Places of items in two halves of equal work, items of the same garment one after another.

    Every other garment goes into a half, as jobs often list garments by size.
    """
    by_garment: dict[tuple[str, ...], list[int]] = {}
    for place in places:
        by_garment.setdefault(garments_key(items[place]), []).append(place)
    each = list(by_garment.values())
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
    """pyarrow, imported when tables are first read or written, so that processes start without it."""
    import pyarrow.csv
    import pyarrow.parquet

    return pyarrow


def _table(rows: Sequence[Mapping[str, Any]]) -> pyarrow.Table:
    """Rows of the columns COLUMNS as a table."""
    arrow = _arrow()
    types = {name: arrow.int64() if name in INTEGERS else arrow.float64() for name in (*EASE, *GIRTH, *FIGURES)}
    types |= {"worn": arrow.bool_(), "problems": arrow.list_(arrow.string())}
    schema = arrow.schema([(name, types.get(name, arrow.string())) for name in COLUMNS])
    return arrow.Table.from_pylist(rows, schema=schema)


def _plain(table: pyarrow.Table) -> pyarrow.Table:
    """The table with lists as text, as CSV has none: problems by spaces."""
    codes = [" ".join(each or ()) for each in table["problems"].to_pylist()]
    return table.set_column(table.column_names.index("problems"), "problems", [codes])


def file_marks(paths: Sequence[Path]) -> dict[str, list[int]]:
    """Size and modification time of files that results depend on; [] for a missing file."""
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
    ease: bool = True  # whether rows have ease and girths, which take 0.02 s of a core for each item

    @property
    def shards(self) -> Path:
        return self.folder / "shards"

    @property
    def stages(self) -> Path:
        return self.folder / "stages"

    @contextlib.contextmanager
    def shared_folder(self) -> Iterator[Path | None]:
        """A temporary folder of results that this batch's workers share; None where it cannot be made."""
        try:
            place = tempfile.mkdtemp(prefix=".shared-", dir=self.folder)  # writable for this user only
        except OSError:
            yield None
            return
        try:
            yield Path(place)
        finally:
            shutil.rmtree(place, ignore_errors=True)

    def lease_file(self, device: str) -> Path:
        """The lock file of the lease of a device among this batch's workers."""
        return self.folder / f".lease_{device.replace(':', '')}"

    def open(self) -> None:
        """Makes the folders, and removes half-written files of a killed run.

        Raises:
            InputError: the folder cannot be written.
        """
        try:
            for place in (self.folder, self.shards, *((self.stages,) if self.keep == "stages" else ())):
                place.mkdir(parents=True, exist_ok=True)
                for left in place.glob(".*-*"):  # of whole_file and shared_folder
                    shutil.rmtree(left, ignore_errors=True)
        except (OSError, ValueError) as error:
            raise unwritable(self.folder, error) from error

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keeps another batch out of the folder; the lock ends with the process, however that ends."""
        try:
            with open(self.folder / ".lock", "w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                yield
        except BlockingIOError:
            raise InputError(
                self.folder, "another batch writes there", "wait for it, or choose another folder"
            ) from None

    def preload_tables(self) -> None:
        """Imports what writes tables, and starts its threads, while workers fit."""
        arrow, nowhere = _arrow(), io.BytesIO()
        table = _table([empty_row("", FAILED, "")]).take(np.array([0]))
        arrow.parquet.write_table(table, nowhere)
        arrow.concat_tables([arrow.parquet.ParquetFile(nowhere).read(), table])
        arrow.csv.write_csv(_plain(table), io.BytesIO())
        np.savez(io.BytesIO(), **packed([]))

    def check_batch(self, items: Sequence[Item]) -> None:
        """Checks that the folder is empty or holds results of some of these items, whether or not they have changed.

        Raises:
            InputError: it holds results of other items only, which would be lost.
        """
        names_wanted = {item.name for item in items}
        others: list[str] = []
        for path in sorted(self.shards.glob("*.parquet")):
            try:
                names = _arrow().parquet.read_table(path, columns=["name"])["name"].to_pylist()
            except (OSError, ValueError, KeyError, _arrow().ArrowException):  # damaged, or of another layout
                continue
            if names_wanted.intersection(names):
                return
            others += names
        if others:
            problem = f'holds the results of another batch ("{others[0]}" and {len(others) - 1:,} more)'
            raise InputError(self.folder, problem, "choose another folder, or remove that one")

    def shard_size(self, wanted: int, stated: bool) -> int:
        """Items per shard: as in the folder's plan, so that a batch can continue, unless the size was ``stated``."""
        path = self.folder / "plan.json"
        if not stated:
            with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
                return max(int(json.loads(path.read_text(encoding="utf-8"))["shard_size"]), 1)
        with whole_file(path) as place:
            place.write_text(json.dumps({"layout": LAYOUT, "shard_size": wanted}) + "\n", encoding="utf-8")
        return wanted

    def write(self, shard: Shard, results: Sequence[ItemResult], inputs: Mapping[str, Any]) -> None:
        """Writes a shard's points, then its rows, which mark the shard as done.

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
        """Whether a shard is complete: it is written, and none of its items failed for the machine's sake."""
        table = self.rows(shard)
        return table is not None and FAILED not in table["status"].to_pylist()

    def rows(self, shard: Shard) -> pyarrow.Table | None:
        """A shard's rows, if it is written and its items and input files have not changed since."""
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
        """Writes results.parquet and results.csv of all shards, and removes files that belong to no shard.

        Items of a shard that is not written have failed, with its reason in ``problems``.
        """
        tables = []
        for shard in shards:
            table = None if shard.number in problems else self.rows(shard)
            if table is None:
                reason = problems.get(shard.number, "not done")
                table = _table([empty_row(item.name, FAILED, reason) for item in shard.items])
            tables.append(table)
        places = np.argsort(np.concatenate([shard.places for shard in shards]))
        items = [item for shard in shards for item in shard.items]
        merged = with_columns(_arrow().concat_tables(tables).take(places), [items[place] for place in places])
        with whole_file(self.folder / "results.parquet") as place:
            _arrow().parquet.write_table(merged, place)
        with whole_file(self.folder / "results.csv") as place:
            _arrow().csv.write_csv(_plain(merged), place)
        known = {shard.label for shard in shards}
        for path in self.shards.iterdir():
            if path.suffix in (".parquet", ".npz") and path.stem not in known:
                path.unlink(missing_ok=True)
        return merged


def packed(results: Sequence[ItemResult]) -> dict[str, Any]:
    """Arrays of all worn garments of a shard, concatenated; equal triangles are stored once.

    ``item``, ``garment`` name each garment; its points are ``points[point_start[g] : point_start[g + 1]]`` and its
    triangles, counted from its own first point, ``triangles[triangle_start[m] : triangle_start[m + 1]]``, m = mesh[g].
    Which of its points each vertex of its file became is ``vertex_map[map_start[g] : map_start[g + 1]]``, -1: it is
    left out; empty where they are the file's vertices.
    """
    names = [(result.row["name"], worn) for result in results for worn in result.worn]
    meshes: dict[bytes, int] = {}
    hashes: dict[int, bytes] = {}  # of arrays that several garments share
    triangles, mesh = [], []
    for _, worn in names:
        key = hashes.get(id(worn.triangles)) or hashlib.sha256(np.ascontiguousarray(worn.triangles).tobytes()).digest()
        hashes[id(worn.triangles)] = key
        if key not in meshes:
            meshes[key] = len(meshes)
            triangles.append(worn.triangles)
        mesh.append(meshes[key])
    points = [worn.points for _, worn in names]
    maps = [np.zeros(0, np.int64) if worn.vertex_map is None else worn.vertex_map for _, worn in names]
    return {
        "item": np.array([name for name, _ in names], dtype=np.str_),
        "garment": np.array([worn.garment for _, worn in names], dtype=np.str_),
        "points": np.concatenate(points) if points else np.zeros((0, 3)),
        "point_start": np.cumsum([0, *(len(each) for each in points)]),
        "triangles": np.concatenate(triangles) if triangles else np.zeros((0, 3), dtype=np.int32),
        "triangle_start": np.cumsum([0, *(len(each) for each in triangles)]),
        "mesh": np.array(mesh, dtype=np.int32),
        "vertex_map": np.concatenate(maps) if maps else np.zeros(0, np.int64),
        "map_start": np.cumsum([0, *(len(each) for each in maps)]),
    }
