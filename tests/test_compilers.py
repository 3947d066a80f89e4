"""What compiles kernels for the CPU: headers are compiled once, and so is a file that two threads need."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import pytest

from warp_cloth.base import compilers
from warp_cloth.base.compiler import with_stored_header
from warp_cloth.base.compilers import Compilers

HEADER = "builtin.pch"


def compile_like_warp(output: str, *, pch_dir: str, **_: Any) -> None:
    """Makes the header where it lacks, or removes one that does not fit, as Warp's compiler does."""
    header = Path(pch_dir, HEADER)
    if not header.exists():
        header.write_text("made")
    elif header.read_text() != "made":
        header.unlink()


def header_after(own: Path, stored: Path) -> str | None:
    """What is stored after one process has compiled a file."""
    own.mkdir()
    with_stored_header(compile_like_warp, str(stored), "one.o", pch_dir=str(own), use_precompiled_headers=True)
    return (stored / HEADER).read_text() if (stored / HEADER).exists() else None


def test_a_header_is_compiled_once_for_all_processes(tmp_path: Path) -> None:
    stored = tmp_path / "stored"
    assert header_after(tmp_path / "first", stored) == "made"
    assert header_after(tmp_path / "second", stored) == "made"
    assert (tmp_path / "second" / HEADER).is_symlink()
    assert os.listdir(stored) == [HEADER]


def test_a_header_that_the_compiler_refuses_is_made_again(tmp_path: Path) -> None:
    stored = tmp_path / "stored"
    stored.mkdir()
    (stored / HEADER).write_text("of another system")
    assert header_after(tmp_path / "first", stored) is None
    assert header_after(tmp_path / "second", stored) == "made"


def test_where_headers_cannot_be_stored_files_are_compiled_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "stored").write_text("a file")
    own = tmp_path / "own"
    own.mkdir()
    options = {"pch_dir": str(own), "use_precompiled_headers": True}
    with_stored_header(compile_like_warp, str(tmp_path / "stored"), "one.o", **options)
    assert os.listdir(own) == [HEADER]


@pytest.mark.parametrize("moved", [False, True])
def test_a_file_that_two_threads_need_is_compiled_once(moved: bool, tmp_path: Path) -> None:
    count, begun, compiled = 0, threading.Event(), threading.Event()
    folders = tmp_path / "wp_one_p1_t1", tmp_path / "wp_one_p1_t2"
    for folder in folders:
        folder.mkdir()

    def compile_slowly(output: str) -> None:
        nonlocal count
        count += 1
        begun.set()
        assert compiled.wait(10.0)
        Path(output).write_text("object")
        if moved:
            folders[0].rename(tmp_path / "wp_one")

    both = Compilers(1)
    threads = [
        threading.Thread(target=both.build, args=(compile_slowly, str(folder / "wp_one.o"))) for folder in folders
    ]
    threads[0].start()
    assert begun.wait(10.0)
    threads[1].start()
    compiled.set()
    for thread in threads:
        thread.join(10.0)
    assert count == 1
    assert len([path for path in tmp_path.rglob("wp_one.o") if path.read_text() == "object"]) == 2


def test_what_could_not_be_compiled_is_tried_again(tmp_path: Path) -> None:
    one, output = Compilers(1), str(tmp_path / "wp_one.o")

    def fail(output: str) -> None:
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space left"):
        one.build(fail, output)
    one.build(lambda output: Path(output).write_text("object"), output)
    assert Path(output).read_text() == "object"


def test_warp_compiles_by_one_function_however_often_it_is_started() -> None:
    from warp._src import build

    compilers.share_compilers()
    shared = build.build_cpu
    compilers.share_compilers()
    assert build.build_cpu is shared
