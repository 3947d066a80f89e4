"""The first run on a machine: it is known as such, and its kernels are compiled by several processes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import warp as wp

import warp_cloth
from warp_cloth.base import first_run
from warp_cloth.base.first_run import FOLDER, is_first_run, kernels_known, note_kernels
from warp_cloth.cli.warm_up import warm_up
from warp_cloth.fitting import warm_up as warming
from warp_cloth.scene import load_scene

FIT = """
import json, os, sys, threading
from warp_cloth.base import compilers
compilers.core_count = lambda: 2
asked = []
for kind in (compilers._Here, compilers._Process):
    def build(*args, own=kind.build, name=kind.__name__, **options):
        done = own(*args, **options)
        asked.append([name, done])
        return done
    kind.build = build
if sys.argv[1] == "broken":
    compilers.sys.executable = "/bin/false"
from warp_cloth.fitting.problem import load_modules
from warp_cloth.kernels.contact import facing, leaf_order, search_trigger
import warp as wp
from warp_cloth.base.device import device_named
device_named("cpu")
modules = [wp.get_module(each.__name__) for each in (facing, leaf_order, search_trigger)]
load_modules(modules, "cpu")
load_modules(modules, "cpu")
print(json.dumps([sorted(asked), [len(module.execs) for module in modules], os.listdir(wp.config.kernel_cache_dir)]))
"""

ONCE = """
import collections, json, os
import warp._src.build as build
compiled, own = collections.Counter(), build.build_cuda
def count(path, *args, **kwargs):
    compiled[os.path.basename(path).rpartition("_")[0]] += 1
    own(path, *args, **kwargs)
build.build_cuda = count
import warp_cloth
warp_cloth.fit("tshirt", device="cuda:0", overrides={"garment.shape.edge_mm": 40, "solver.iterations": 300})
print(json.dumps([sum(compiled.values()), [name for name, times in compiled.items() if times > 1]]))
"""


@pytest.mark.long
@pytest.mark.parametrize("how", ["whole", "broken"])
def test_modules_are_compiled_by_other_processes_or_by_this_one(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path))
    ended = subprocess.run([sys.executable, "-c", FIT, how], capture_output=True, text=True, check=True)
    asked, loaded, folders = json.loads(ended.stdout.splitlines()[-1])
    assert {tuple(each) for each in asked} == {("_Here", True), ("_Process", how == "whole")}
    assert len(asked) == 3
    assert loaded == [1, 1, 1]
    assert len(folders) == 4
    assert len(list((tmp_path / wp.config.version / "headers").rglob("*.pch"))) == 1


@pytest.mark.cuda
@pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device on this machine")
def test_a_gpu_compiles_no_kernel_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path / "kernels"))
    monkeypatch.setenv(FOLDER, str(tmp_path / "cache"))
    ended = subprocess.run([sys.executable, "-c", ONCE], capture_output=True, text=True, check=True)
    count, twice = json.loads(ended.stdout.splitlines()[-1])
    assert count > 30
    assert twice == [], "of one size of block, and launched in another"


def test_a_first_run_is_known_until_its_kernels_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "new" / "cache"))
    kernels = tmp_path / "kernels"
    assert is_first_run("cpu")
    note_kernels("cpu", str(kernels))
    assert is_first_run("cpu"), "the folder is not there"
    (kernels / "wp_one").mkdir(parents=True)
    assert kernels_known("cpu")
    assert not is_first_run("cpu")
    monkeypatch.setattr(first_run, "GPU_FILES", ("/nowhere",))
    assert not is_first_run("cuda:0"), "no device, as the command will say"
    monkeypatch.setattr(first_run, "GPU_FILES", (str(tmp_path),))
    assert is_first_run("cuda:0")
    monkeypatch.setenv("WARP_CACHE_PATH", "elsewhere")
    assert is_first_run("cpu")


@pytest.mark.parametrize("folder", ["off", "file"])
def test_where_nothing_can_be_noted_no_run_is_called_the_first(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(FOLDER, folder if folder == "off" else str(tmp_path / "file"))
    note_kernels("cpu", str(tmp_path))
    assert not kernels_known("cpu")
    assert not is_first_run("cpu")


def test_a_fit_notes_its_kernels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    warp_cloth.fit("hanging", device="cpu", overrides=["garment.shape.vertices_per_side=9", "solver.iterations=20"])
    assert kernels_known("cpu")


@pytest.mark.long
def test_warm_up_leaves_the_kernels_and_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    small = ("garment.shape.vertices_per_side=9",)
    monkeypatch.setattr(warming, "KINDS", (("hanging", small), ("hanging", (*small, "solver.method=multilevel"))))
    warm_up(device="cpu")
    assert kernels_known("cpu")
    written = capsys.readouterr()
    assert written.out.startswith("cpu is ready")
    assert str(tmp_path) in written.out
    assert "multilevel" in written.err


def test_every_usual_kind_can_be_loaded() -> None:
    for scene, changes in warming.KINDS:
        load_scene(scene, (*changes, warming.ITERATIONS))
