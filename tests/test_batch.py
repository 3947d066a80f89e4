"""Batches: the same results however they are cut, killed, retried or mixed with bad items."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest

import warp_cloth
from warp_cloth.base.errors import InputError
from warp_cloth.batch import Item, run_batch
from warp_cloth.batch.pool import LocalPool, Lost, best_shared
from warp_cloth.batch.progress import summary
from warp_cloth.batch.rows import FAILED, ItemResult, WornPoints, empty_row
from warp_cloth.batch.run import Batch, BatchProgress
from warp_cloth.batch.store import Keep, Store, packed, split
from warp_cloth.batch.task import Done, Task, do_task
from warp_cloth.export import stage
from warp_cloth.export.files import whole_file

FABRICS = ("silk", "cotton", "denim")
WAIT = 120.0  # [s] at most, for a process that is expected to do something


def tiny(name: str, side: int = 4, fabric: str = "cotton", iterations: int = 60) -> Item:
    """A hanging square of a few vertices."""
    changes = (f"garment.shape.vertices_per_side={side}", f"garment.fabric={fabric}", f"solver.iterations={iterations}")
    return Item(name, "hanging", changes)


def tiny_items(count: int) -> list[Item]:
    return [tiny(f"item-{i}", 4 + i % 3, FABRICS[i % len(FABRICS)], 40 + 20 * (i % 4)) for i in range(count)]


def results(folder: Path) -> dict[str, dict[str, Any]]:
    rows = pyarrow.parquet.read_table(folder / "results.parquet").to_pylist()
    assert len({row["name"] for row in rows}) == len(rows), "none twice"
    return {row.pop("name"): {key: value for key, value in row.items() if key != "file"} for row in rows}


class HerePool:
    """Does tasks in this process; every worker that touches an item called "killer" dies."""

    retries = False
    devices: Sequence[str] = ("cpu",)

    def __init__(self) -> None:
        self.waiting: list[Task] = []
        self.deaths = 0

    def submit(self, task: Task) -> None:
        self.waiting.append(task)

    def finished(self) -> Iterator[Done | Lost]:
        while self.waiting:
            task = self.waiting.pop(0)
            if any(item.name == "killer" for item in task.shard.items):
                self.deaths += 1
                yield Lost(task, "the worker was ended by SIGSEGV")
            else:
                yield do_task(Task(task.store, task.shard, "cpu", task.write))

    def close(self) -> None:
        pass


def drive(out: Path, items: list[Item], size: int, pool: Any = None, keep: Keep = "arrays", ease: bool = True) -> Any:
    store = Store(out, keep, ease=ease)
    store.open()
    return Batch(store, split(items, size), pool or HerePool(), lambda _: None, 0.0).run()


def test_a_packed_garment_says_what_each_vertex_of_its_file_became() -> None:
    points, triangles = np.zeros((3, 3)), np.array([[0, 1, 2]], dtype=np.int32)
    soup = WornPoints("soup", points, triangles, np.array([0, 1, 2, 2, -1]))
    arrays = packed([ItemResult({"name": "a"}, (WornPoints("as in its file", points, triangles), soup))])
    of_each = [arrays["vertex_map"][first:end].tolist() for first, end in pairwise(arrays["map_start"])]
    assert of_each == [[], [0, 1, 2, 2, -1]]


def test_an_item_is_what_a_fit_of_its_own_gives(tmp_path: Path) -> None:
    items = tiny_items(3)
    drive(tmp_path, items, 2)
    found = results(tmp_path)
    with np.load(tmp_path / "shards" / "00000.npz") as packed:
        kept = packed["points"][packed["point_start"][1] : packed["point_start"][2]]
        triangles = packed["triangles"][packed["triangle_start"][packed["mesh"][1]] :]
    for item in items:
        fit = warp_cloth.fit(item.scene, overrides=item.changes, device="cpu")
        assert found[item.name]["message"] == fit.message
        assert found[item.name]["worn"] == fit.worn
        assert found[item.name]["problems"] == [problem.code.value for problem in fit.problems]
        assert found[item.name]["rest_error_mm"] == fit.report["rest_error_mm"]
        if item is items[1]:
            assert np.array_equal(kept, fit.garments[0].points)
            assert np.array_equal(triangles, fit.garments[0].mesh.triangles)


def test_results_have_the_ease_and_girths_of_a_fit_of_its_own_unless_not_wanted(tmp_path: Path) -> None:
    changes = ("garment.shape.edge_mm=60", "collision.pixel_mm=10", "solver.iterations=60")
    items = [Item("shirt", "tshirt", changes), *tiny_items(1)]
    drive(tmp_path / "with", items, 2)
    rows = results(tmp_path / "with")
    fit = warp_cloth.fit("tshirt", overrides=changes, device="cpu")
    ease = fit.ease["tshirt"]
    assert [rows["shirt"][f"ease_{level}_cm"] for level in ("chest", "waist", "hip")] == [
        None if ease.get(level) is None else 100 * ease[level] for level in ("chest", "waist", "hip")
    ]
    assert rows["shirt"]["ease_chest_cm"] is not None
    closed = {row["level"]: row["garment_girth"] for row in fit.report["girths_mm"] if row["closed"]}
    assert [rows["shirt"][f"girth_{level}_cm"] for level in closed] == pytest.approx([0.1 * g for g in closed.values()])
    assert rows[items[1].name]["ease_chest_cm"] is None  # no body
    drive(tmp_path / "without", items, 2, keep="none", ease=False)
    without = results(tmp_path / "without")["shirt"]
    assert without["ease_chest_cm"] is None
    assert without["girth_chest_cm"] is None


def test_the_cut_and_the_order_change_nothing(tmp_path: Path) -> None:
    items = tiny_items(6)
    drive(tmp_path / "one", items, 1)
    drive(tmp_path / "all", items, 6)
    drive(tmp_path / "turned", items[::-1], 4)
    assert results(tmp_path / "one") == results(tmp_path / "all") == results(tmp_path / "turned")


def poisoned(folder: Path) -> list[Item]:
    """Ten items, each bad in a way of its own."""
    texts = {
        "garbage.obj": "\x01\x02 not a mesh",
        "empty.obj": "",
        "nan.obj": "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
        "broken.toml": "[garment\nshape = 1",
        "cut.usdc": "PXR-USDC but no more",
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [
        Item("no-scene", str(folder / "none.toml")),
        Item("broken-scene", str(folder / "broken.toml")),
        Item("no-mesh", "hanging", ("garment.mesh=none.obj",)),
        Item("garbage-mesh", "hanging", (f"garment.mesh={folder / 'garbage.obj'}",)),
        Item("empty-mesh", "hanging", (f"garment.mesh={folder / 'empty.obj'}",)),
        Item("nan-mesh", "hanging", ("garment.scale=2", f"garment.mesh={folder / 'nan.obj'}")),  # wrong in line 2
        Item("cut-mesh", "hanging", (f"garment.mesh={folder / 'cut.usdc'}",)),
        Item("no-fabric", "hanging", ("garment.fabric=cardboard",)),
        Item("bad-value", "hanging", ("solver.iterations=-1",)),
        Item("bad-row", "hanging", (), "the row has 4 cells, the header 3"),
    ]


def test_bad_items_fail_with_their_reason_and_leave_the_others_alone(tmp_path: Path) -> None:
    good, bad = tiny_items(10), poisoned(tmp_path)
    mixed = [item for pair in zip(good, bad, strict=True) for item in pair]
    drive(tmp_path / "good", good, 4)
    drive(tmp_path / "mixed", mixed, 4)
    found, alone = results(tmp_path / "mixed"), results(tmp_path / "good")
    failed = {name: row for name, row in found.items() if row["digest"] is None}
    assert set(failed) == {item.name for item in bad}
    assert all(row["status"] == "invalid" and row["message"] for row in failed.values())
    assert len({row["message"] for row in failed.values()}) == len(bad), "each says its own reason"
    assert all(found[name]["message"].startswith("column garment.mesh: ") for name in ("no-mesh", "nan-mesh"))
    own = ["garment.mesh", "garment.scale"]  # columns of the bad items' job
    assert [{k: v for k, v in found[name].items() if k not in own} for name in alone] == list(alone.values())


def test_an_item_that_ends_its_workers_is_given_up_alone(tmp_path: Path) -> None:
    items = [*tiny_items(3), tiny("killer"), *[tiny(f"late-{i}") for i in range(2)]]
    pool = HerePool()
    report = drive(tmp_path, items, 4, pool)
    found = results(tmp_path)
    assert [name for name, row in found.items() if row["status"] == FAILED] == ["killer"]
    assert found["killer"]["message"] == "the worker was ended by SIGSEGV"
    assert pool.deaths == 4, "the shard twice, then the item twice"
    assert report.complete


def test_what_the_machine_failed_is_done_by_the_next_run(tmp_path: Path) -> None:
    items = tiny_items(3)
    store = Store(tmp_path, "none")
    store.open()
    shard = split(items, 3)[0]
    rows = [ItemResult(empty_row(item.name, FAILED, "out of memory")) for item in items]
    store.write(shard, rows, {})
    assert not store.done(shard)
    drive(tmp_path, items, 3)
    assert FAILED not in {row["status"] for row in results(tmp_path).values()}


def test_a_full_disk_leaves_the_shard_undone_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    items = tiny_items(4)
    write = Store.write

    def full(store: Store, shard: Any, *rest: Any) -> None:
        if shard.number == 1:
            raise InputError(store.folder, "cannot be written (No space left on device)", "make room")
        write(store, shard, *rest)

    monkeypatch.setattr(Store, "write", full)
    report = drive(tmp_path, items, 2)
    assert not report.complete
    assert [row["status"] == FAILED for row in results(tmp_path).values()] == [False, False, True, True]
    monkeypatch.setattr(Store, "write", write)
    assert drive(tmp_path, items, 2).complete


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no device that never ends here")
def test_a_scene_that_is_no_file_is_an_item_that_says_so(tmp_path: Path) -> None:
    drive(tmp_path, [Item("endless", "/dev/zero"), Item("folder", str(tmp_path))], 2)
    assert ["is not a scene file" in row["message"] for row in results(tmp_path).values()] == [True, False]
    assert all(row["status"] == "invalid" for row in results(tmp_path).values())


def test_a_stage_that_cannot_be_written_is_no_fault_of_its_item(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, **_: Any) -> None:
        with whole_file(path):
            raise OSError("USD: Error occurred writing file: No space left on device")

    with monkeypatch.context() as changed:
        changed.setattr(stage, "write_stage", full)
        drive(tmp_path, tiny_items(1), 1, keep="stages")
    (row,) = results(tmp_path).values()
    assert row["status"] == FAILED
    assert "No space left on device" in row["message"]
    drive(tmp_path, tiny_items(1), 1, keep="stages")
    assert FAILED not in {row["status"] for row in results(tmp_path).values()}


def test_a_shard_is_done_again_where_its_items_or_files_changed(tmp_path: Path) -> None:
    mesh = tmp_path / "sheet.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n")
    change = (f"garment.mesh={mesh}", "garment.pin=[{vertices=[2, 3]}]", "solver.iterations=20", "garment.units=m")
    items = [Item("sheet", "hanging", change)]
    drive(tmp_path / "out", items, 1)
    store = Store(tmp_path / "out", "arrays")
    (shard,) = split(items, 1)
    assert store.done(shard)
    assert not store.done(split([Item("sheet", "hanging", (*change, "solver.cap=0.001"))], 1)[0])
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n# changed\n")
    assert not store.done(shard)


def test_a_damaged_checkpoint_is_done_again(tmp_path: Path) -> None:
    items = tiny_items(2)
    drive(tmp_path, items, 1)
    first = results(tmp_path)
    (tmp_path / "shards" / "00001.parquet").write_bytes(b"PAR1 and no more")
    assert [Store(tmp_path, "arrays").done(shard) for shard in split(items, 1)] == [True, False]
    drive(tmp_path, items, 1)
    assert results(tmp_path) == first


def test_a_worker_that_dies_is_replaced_and_its_items_done(tmp_path: Path) -> None:
    killed: list[int] = []

    def kill_one(progress: BatchProgress) -> None:
        if not killed:
            child = multiprocessing.active_children()[0]
            killed.append(child.pid or 0)
            os.kill(killed[0], signal.SIGKILL)

    items = tiny_items(4)
    report = run_batch(items, tmp_path / "killed", device="cpu", workers=1, shard=2, progress=kill_one)
    assert killed
    assert report.complete
    drive(tmp_path / "calm", items, 2)
    assert results(tmp_path / "killed") == results(tmp_path / "calm")


def test_workers_begin_anew_where_the_devices_are_not_those_that_were_thought(tmp_path: Path) -> None:
    items = tiny_items(4)
    with LocalPool(["cpu:none", "cpu:none"], lambda: ["cpu"]) as pool:
        report = drive(tmp_path / "thought", items, 2, pool)
        assert pool.devices == ("cpu",)
    assert report.statuses.get(FAILED, 0) == 0
    drive(tmp_path / "calm", items, 2)
    assert results(tmp_path / "thought") == results(tmp_path / "calm")


def test_workers_that_nothing_was_left_for_begin_again(tmp_path: Path) -> None:
    items = tiny_items(3)
    with LocalPool(["cpu", "cpu"]) as pool:
        for name in ("once", "again"):
            assert drive(tmp_path / name, items, 1, pool).complete
    assert results(tmp_path / "once") == results(tmp_path / "again")


def test_killed_and_started_again_it_ends_with_the_same_results(tmp_path: Path) -> None:
    items = tiny_items(12)
    rows = [f"{item.name},hanging,{','.join(change.split('=')[1] for change in item.changes)}" for item in items]
    header = "name,scene,garment.shape.vertices_per_side,garment.fabric,solver.iterations"
    (tmp_path / "jobs.csv").write_text("\n".join([header, *rows]) + "\n")
    out = tmp_path / "out"
    command = [sys.executable, "-m", "warp_cloth", "batch", str(tmp_path / "jobs.csv"), "--out", str(out)]
    command += ["--device", "cpu", "--workers", "1", "--shard", "2"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + WAIT
    while time.monotonic() < until and not list((out / "shards").glob("*.parquet")):
        time.sleep(0.01)
    running.kill()
    running.wait()
    assert not (out / "results.parquet").exists(), "killed before its end"
    kept = {path: path.stat().st_mtime_ns for path in (out / "shards").glob("*.parquet")}
    assert kept
    done = subprocess.run(command, check=False, capture_output=True, timeout=WAIT)
    assert done.returncode == (0 if all(row["worn"] for row in results(out).values()) else 3), done.stderr
    assert {path: path.stat().st_mtime_ns for path in kept} == kept, "what was done is not done again"
    drive(tmp_path / "calm", items, 2)
    assert results(out) == results(tmp_path / "calm")


def test_two_batches_do_not_share_a_folder(tmp_path: Path) -> None:
    store = Store(tmp_path, "none")
    store.open()
    with store.locked(), pytest.raises(InputError, match="another batch writes there"), store.locked():
        pass


def test_a_folder_with_another_batchs_results_is_left_as_it_is(tmp_path: Path) -> None:
    run_batch(tiny_items(2), tmp_path, device="cpu", workers=1)
    first = results(tmp_path)
    with pytest.raises(InputError, match='holds the results of another batch \\("item-0" and 1 more\\)'):
        run_batch([tiny("else")], tmp_path, device="cpu", workers=1)
    assert results(tmp_path) == first
    report = run_batch([*tiny_items(2), tiny("more")], tmp_path, device="cpu", workers=1)
    assert report.progress.before == 2, "a batch may grow"


def test_the_last_lines_say_why_items_have_no_result(tmp_path: Path) -> None:
    items = [tiny("good"), *poisoned(tmp_path), Item("also", "hanging", ("solver.iterations=-1",))]
    lines = summary(drive(tmp_path / "out", items, 4))
    assert lines[0].startswith("12 items in ")
    assert lines[1] == "  worn         0 of 12; problems: 1 not_at_rest"
    reason = "column solver.iterations: must be an integer from 0 to 10000000, not -1"
    assert lines[2] == f"  no result    bad-value and 1 more: {reason}"
    assert lines[5] == "  and 7 more reasons, in the column message"


def test_results_carry_the_jobs_own_columns(tmp_path: Path) -> None:
    """As given, numbers as numbers; a caller's own column does nothing else, and one like a scene key is an error."""
    rows = ["name,scene,customer,order,stock,solver.iterations,garment.shape.vertices_per_side,fabrik"]
    rows += ["a,hanging,Ann,007,3,10,4,", "b,hanging,,12,4.5,10,4,", "c,hanging,Bo,1,1,10,4,silk"]
    (tmp_path / "jobs.csv").write_text("\n".join(rows), encoding="utf-8")
    run_batch(tmp_path / "jobs.csv", tmp_path / "out", device="cpu", workers=1)
    table = pyarrow.parquet.read_table(tmp_path / "out" / "results.parquet")
    assert table.column_names[:6] == ["name", "scene", "customer", "order", "stock", "solver.iterations"]
    own = table.select(["customer", "order", "stock", "solver.iterations"]).to_pydict()
    assert own == {
        "customer": ["Ann", None, "Bo"],
        "order": ["007", "12", "1"],
        "stock": [3.0, 4.5, 1.0],
        "solver.iterations": [10] * 3,
    }
    assert [status == "invalid" for status in table["status"].to_pylist()] == [False, False, True]
    assert table["message"].to_pylist()[2].startswith("column fabrik: unknown key fabrik; did you mean garment.fabric?")
    assert "Ann,007" in (tmp_path / "out" / "results.csv").read_text().replace('"', "")


def test_the_contact_sheet_shows_the_worst_first(tmp_path: Path) -> None:
    items = [tiny("hangs"), Item("<b>bad</b>", "hanging", ("garment.fabric=cardboard",)), tiny("too")]
    report = run_batch(items, tmp_path, device="cpu", workers=1, sheet=2)
    assert report.sheet == tmp_path / "contact_sheet.html"
    page = report.sheet.read_text(encoding="utf-8")
    assert "% (99th percentile)" in page
    assert "0 of 3 worn; 2 shown" in page
    assert page.index("&lt;b&gt;bad&lt;/b&gt;") < page.index("<b>hangs</b>")
    assert "<b>too</b>" not in page
    assert (page.count("data:image/jpeg;base64,"), page.count("no result")) == (1, 1)
    assert "contact_sheet.html" in summary(report)[-1]
    for wrong in (-1, 2.5):
        with pytest.raises(InputError, match=r"^sheet: "):
            run_batch(items, tmp_path, device="cpu", workers=1, sheet=wrong)  # type: ignore[arg-type]


def test_one_stage_per_item_where_stages_are_kept(tmp_path: Path) -> None:
    run_batch(tiny_items(2), tmp_path, device="cpu", workers=1, keep="stages")
    assert sorted(path.name for path in (tmp_path / "stages").iterdir()) == ["item-0.usdc", "item-1.usdc"]


def test_wrong_options_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="workers"):
        run_batch(tiny_items(1), tmp_path, workers=0)
    with pytest.raises(InputError, match="keep"):
        run_batch(tiny_items(1), tmp_path, keep="all")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="there is no device"):
        run_batch(tiny_items(1), tmp_path, device="cuda:99")


def test_a_worker_goes_on_with_what_shares_its_meshes_and_leaves_to_others_what_shares_theirs() -> None:
    meshes = ("dress.obj", "dress.obj", "shirt.obj", "shirt.obj")
    changes = [(f"garment.mesh={mesh}", f"garment.fabric={number}") for number, mesh in enumerate(meshes)]
    shards = split([Item(str(number), "scene.toml", change) for number, change in enumerate(changes)], 1)
    waiting = [shard.inputs for shard in shards]
    assert best_shared(waiting, frozenset(), []) == 0
    assert best_shared(waiting[1:], frozenset(), [waiting[0]]) == 1, "another worker has the dress"
    assert best_shared(waiting[1:], waiting[0], [waiting[2]]) == 0, "this one has it"
