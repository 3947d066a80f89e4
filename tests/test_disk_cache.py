"""The cache on disk gives back what was put in, or nothing: whatever others do to its files."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from meshfiles import sheet, write_obj

from warp_cloth.avatar.contact import AvatarContact, ContactOptions
from warp_cloth.base import disk_cache as cache_module
from warp_cloth.base import kernel_hashes
from warp_cloth.base.disk_cache import ENDING, HALF, DiskCache, Entry, disk_cache, key_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.first_run import FOLDER, warp_config
from warp_cloth.base.kernel_hashes import SEARCH, share_hashes
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.stored_mesh import stored_mesh
from warp_cloth.base.threads import ONE_THREAD
from warp_cloth.base.warp_setup import init_warp
from warp_cloth.kernels.base.options import Terms
from warp_cloth.loading import stored
from warp_cloth.shapes import MannequinMeasures, sphere

KEY = "thing-0123456789abcdef"


def entry(number: int, count: int = 1000) -> Entry:
    arrays = {
        "points": np.full((count, 3), float(number)),
        "none": np.zeros((0, 3), dtype=np.int32),
        "flags": np.arange(5) % 2 == 0,
    }
    return Entry(arrays, {"number": number, "third": 1 / 3, "nested": {"a": [1, None, "x"]}})


def same(first: Entry, second: Entry) -> bool:
    arrays = first.arrays.keys() == second.arrays.keys() and all(
        array.dtype == second.arrays[name].dtype and np.array_equal(array, second.arrays[name])
        for name, array in first.arrays.items()
    )
    return arrays and first.values == second.values


def test_an_entry_comes_back_as_it_was(tmp_path: Path) -> None:
    cache = DiskCache(tmp_path / "new" / "folder")
    assert cache.read(KEY) is None
    cache.write(KEY, entry(1))
    found = cache.read(KEY)
    assert same(found, entry(1))
    found.arrays["points"][0] = 7.0  # as what was just derived
    assert same(cache.entry(KEY, lambda: pytest.fail("is there")), entry(1))


@pytest.mark.parametrize("keep", [0, 5, 40, 64, 200, -1])
def test_an_entry_that_is_cut_short_is_derived_again(tmp_path: Path, keep: int) -> None:
    cache, path = DiskCache(tmp_path), tmp_path / f"{KEY}{ENDING}"
    cache.write(KEY, entry(1))
    path.write_bytes(path.read_bytes()[:keep])
    assert cache.read(KEY) is None
    assert same(cache.entry(KEY, lambda: entry(2)), entry(2))
    assert same(cache.entry(KEY, lambda: pytest.fail("is whole again")), entry(2))


def test_no_changed_byte_goes_unseen(tmp_path: Path) -> None:
    cache, path = DiskCache(tmp_path), tmp_path / f"{KEY}{ENDING}"
    cache.write(KEY, entry(1, count=10))
    data = path.read_bytes()
    for place in range(len(data)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 255]) + data[place + 1 :])
        found = cache.read(KEY)
        assert found is None or same(found, entry(1, count=10)), place  # some bytes only fill up


def write_often(folder: Path, number: int) -> None:
    """What one of several processes does."""
    cache = DiskCache(folder, limit=1 << 21)
    for turn in range(40):
        cache.write(f"{KEY}{turn % 4}", entry(number))
        found = cache.read(f"{KEY}{turn % 4}")
        assert found is None or same(found, entry(found.values["number"]))


WRITER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_disk_cache import write_often
write_often(Path(sys.argv[1]), int(sys.argv[3]))
"""


def test_writers_at_one_time_leave_whole_entries(tmp_path: Path) -> None:
    words = [sys.executable, "-c", WRITER, str(tmp_path), str(Path(__file__).parent)]
    writers = [subprocess.Popen([*words, str(number)]) for number in range(3)]
    assert [writer.wait() for writer in writers] == [0, 0, 0]
    assert not list(tmp_path.glob(f"*{HALF}"))
    for turn in range(4):
        found = DiskCache(tmp_path).read(f"{KEY}{turn}")
        assert same(found, entry(found.values["number"]))


KILLED = """
import os, sys
from dataclasses import is_dataclass, replace
from pathlib import Path
from warp_cloth.base import disk_cache
sys.path.insert(0, sys.argv[2])
from test_disk_cache import KEY, entry
os.replace = lambda *_: os._exit(9)  # as if killed just before
disk_cache.DiskCache(Path(sys.argv[1])).write(KEY, entry(1))
"""


def test_what_a_killed_writer_left_is_not_read_and_goes_later(tmp_path: Path) -> None:
    words = [sys.executable, "-c", KILLED, str(tmp_path), str(Path(__file__).parent)]
    assert subprocess.run(words, check=False).returncode == 9
    (half,) = tmp_path.glob(f"*{HALF}")
    cache = DiskCache(tmp_path)
    assert cache.read(KEY) is None
    cache.write(KEY, entry(2))
    assert half.exists(), "it may be another process's, which writes now"
    os.utime(half, (0.0, time.time() - 2 * cache_module.STALE))
    cache.write(KEY, entry(2))
    assert not half.exists()


def test_beyond_the_limit_what_was_used_longest_ago_goes(tmp_path: Path) -> None:
    cache = DiskCache(tmp_path, limit=300_000)  # of about eleven
    cache.write(KEY, entry(0))
    for number in range(1, 30):
        old = time.time() - 100.0 + number
        os.utime(tmp_path / f"{KEY}{ENDING}", (old, old))
        assert cache.read(KEY) is not None, "is read again and again"
        cache.write(f"{KEY}{number}", entry(number))
        written = tmp_path / f"{KEY}{number}{ENDING}"
        os.utime(written, (old, old))
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert 200_000 < sum(sizes) <= 300_000
    assert cache.read(KEY) is not None
    assert cache.read(f"{KEY}1") is None
    assert cache.read(f"{KEY}29") is not None
    cache.write("large", entry(0, count=10_000))
    assert cache.read("large") is None, "no entry takes more than its part"


def test_a_batch_removes_nothing_for_what_it_writes(tmp_path: Path) -> None:
    cache = DiskCache(tmp_path, limit=300_000, share=0.5)
    for number in range(30):
        cache.write(f"{KEY}{number}", entry(number))
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert 100_000 < sum(sizes) <= 150_000
    assert cache.read(f"{KEY}0") is not None
    assert cache.read(f"{KEY}29") is None


def test_what_nobody_uses_goes(tmp_path: Path) -> None:
    cache, long_ago = DiskCache(tmp_path), time.time() - 2 * cache_module.UNUSED
    cache.write(KEY, entry(0))
    os.utime(tmp_path / f"{KEY}{ENDING}", (long_ago, long_ago))
    cache.write("other", entry(1))
    assert cache.read(KEY) is None
    assert cache.read("other") is not None


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", Path("/proc/none"), None):
        cache = DiskCache(folder)
        assert same(cache.entry(KEY, lambda: entry(1)), entry(1))
        assert cache.read(KEY) is None

    def refuse(*_: Any, **__: Any) -> None:
        raise PermissionError(13, "read-only")

    full = DiskCache(tmp_path / "full")
    full.write(KEY, entry(1))
    monkeypatch.setattr(cache_module.tempfile, "mkstemp", refuse)  # root may write anywhere
    monkeypatch.setattr(cache_module.os, "utime", refuse)
    full.write("other", entry(2))
    assert full.read("other") is None
    assert full.read(KEY) is not None


def test_the_folder_is_the_users_or_the_named_one_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(FOLDER, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert disk_cache().folder == tmp_path / "warp_cloth"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # which the standard says to ignore
    assert disk_cache().folder is None
    monkeypatch.setenv(FOLDER, str(tmp_path / "own"))
    assert disk_cache() == DiskCache(tmp_path / "own")
    monkeypatch.setenv(ONE_THREAD, "1")
    assert disk_cache().share < 1.0
    monkeypatch.setenv(FOLDER, "OFF")
    assert disk_cache().folder is None


def test_keys_differ_where_anything_differs() -> None:
    zeros = np.zeros(4)
    parts: list[tuple[Any, ...]] = [
        (),
        (zeros,),
        (zeros.astype(np.float32),),
        (zeros.reshape(2, 2),),
        (zeros, 1),
        (zeros, 1.0),
        (zeros, "1"),
        (zeros, None),
        (("a", "b"), "c"),
        ("a", ("b", "c")),
        (MannequinMeasures(),),
        (MannequinMeasures(waist=0.87),),
    ]
    keys = {key_of(name, packages, *part) for name in "xy" for packages in (("base",), ("shapes",)) for part in parts}
    assert len(keys) == 4 * len(parts)
    assert key_of("x", ("base",), np.arange(6).reshape(2, 3).T) == key_of(
        "x", ("base",), np.arange(6).reshape(2, 3).T.copy()
    )


def test_keys_know_warps_version(monkeypatch: pytest.MonkeyPatch) -> None:
    assert f'version: str = "{wp.config.version}"'.encode() in warp_config()
    here = cache_module.code_version.__wrapped__(("base",))
    monkeypatch.setattr(cache_module, "warp_config", lambda: b"another")
    assert cache_module.code_version.__wrapped__(("base",)) != here


def test_a_stored_mesh_is_the_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    points, triangles = np.eye(3), np.array([[0, 1, 2]], dtype=np.int32)
    mesh = Mesh("m", points, triangles, np.ones((1, 3, 2)), np.zeros(1, np.int32), ("a",), ("told", "too"), "cm")
    stored_mesh("m", ("base",), lambda: mesh, 1)
    again = stored_mesh("m", ("base",), lambda: pytest.fail("is there"), 1)
    for name, value in vars(mesh).items():
        found = getattr(again, name)
        assert type(found) is type(value)
        assert np.array_equal(found, value) if isinstance(value, np.ndarray) else found == value


def test_a_file_is_loaded_again_only_where_it_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "cache"))
    monkeypatch.setattr(stored, "SMALLEST", 1)
    loads = list[Path]()
    load = stored.load_mesh
    monkeypatch.setattr(stored, "load_mesh", lambda path, **named: loads.append(path) or load(path, **named))
    file = tmp_path / "sheet.obj"
    write_obj(file, *sheet())
    how: dict[str, Any] = {"role": "garment", "key": "garment", "units": "m"}
    first, again = (stored.load_mesh_once(file, **how) for _ in range(2))
    assert len(loads) == 1
    assert np.array_equal(first.points, again.points)
    assert first.notes == again.notes
    stored.load_mesh_once(file, **{**how, "rest": "auto"})
    points, *rest = sheet()
    write_obj(file, 1.5 * np.asarray(points), *rest)
    assert np.allclose(stored.load_mesh_once(file, **how).points, 1.5 * first.points)
    assert len(loads) == 3
    file.write_text("nonsense")
    for _ in range(2):
        with pytest.raises(InputError):
            stored.load_mesh_once(file, **how)


def test_a_stored_field_pushes_as_the_built_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = sphere(radius=0.2, edge=0.03)
    garment = sphere(radius=0.22, edge=0.03).points
    options = ContactOptions("auto", 0.004, 0.003, 0.0015, "cpu")

    def built() -> AvatarContact:
        contact = AvatarContact(body, options)
        contact.collider(garment)
        return contact

    built_first = built()
    monkeypatch.setenv(FOLDER, str(tmp_path))
    written, read = built(), built()
    assert len(list(tmp_path.glob(f"field-*{ENDING}"))) == 1
    for contact in (written, read):
        assert contact.report == built_first.report
        assert contact.builds == built_first.builds
        assert contact._drawings == built_first._drawings
        assert np.array_equal(contact.built.sample(garment), built_first.built.sample(garment))
    read.collider(garment + 0.1)  # elsewhere
    assert len(list(tmp_path.glob(f"field-*{ENDING}"))) == 2


def test_shared_hashes_are_warps_own(monkeypatch: pytest.MonkeyPatch) -> None:
    init_warp()
    share_hashes()  # twice does no harm
    from warp._src import codegen, context

    from warp_cloth.kernels.base.options import Accumulate
    from warp_cloth.kernels.passes.scatter import edges_kernel, triangles_kernel

    terms = Terms(True, True, True)
    kernels = [
        edges_kernel("mixed", Accumulate.STIFFNESS, terms, 8),
        triangles_kernel("mixed", Accumulate.MAGNITUDE, terms, 8),
    ]
    base = context.ModuleHasher.__mro__[1]
    assert base.__name__ == "ModuleHasher"
    search = getattr(codegen, SEARCH)
    for kernel in kernels:
        options = kernel.module.resolve_options(context.warp.config)
        monkeypatch.setattr(codegen, SEARCH, search.__wrapped__)
        own = base([kernel], options).get_hash()
        monkeypatch.setattr(codegen, SEARCH, search)
        for _ in range(2):
            assert context.ModuleHasher([kernel], options).get_hash() == own
        assert context.ModuleHasher.shared[kernel.adj]


def test_functions_among_a_calls_arguments_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    from warp._src import codegen

    init_warp()
    monkeypatch.setattr(kernel_hashes, "KERNELS", __name__)  # the functions below are as one of the package's

    @wp.func
    def doubled(x: float):
        return 2.0 * x

    @wp.func
    def applied(function: wp.Function, x: float):
        return function(x)

    @wp.func
    def caller(x: float):
        return applied(doubled, doubled(x))

    calls = [node for node in caller.adj.reference_nodes() if isinstance(node, ast.Call)]
    search = getattr(codegen, SEARCH)
    found = {
        node.func.id: list(search(caller.adj, func, node)) for node, func in zip(calls, (applied, doubled), strict=True)
    }
    assert found == {"applied": [doubled], "doubled": []}
