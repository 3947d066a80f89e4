"""Reports are honest JSON, maps are written when there is one, and a bad output place is refused at once."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from worn import worn

from warp_cloth.base.errors import InputError
from warp_cloth.export.report import check_writable, write_map, write_report
from warp_cloth.model.result import Status


def test_report_reads_back(tmp_path: Path) -> None:
    report = {
        "status": Status.AT_REST,
        "vertices": 7145,
        "residual": {"rms": 0.123456789, "relative_rms": np.float32(0.1)},
        "seconds": {"relax": 1.0e-9},
        "broken": math.nan,
        "worse": [math.inf, -np.inf, np.float32(np.nan)],
        "folder": Path("some") / "place",
        "curve": np.array([1, 2, 3], dtype=np.int32),
        "flag": np.bool_(True),
        "none": None,
        "sentence": "Größe S",
        "large": 2**53 + 1,
    }
    path = tmp_path / "report.json"
    write_report(path, report)
    read = json.loads(path.read_text(encoding="utf-8"))
    assert read == {
        "status": "at_rest",
        "vertices": 7145,
        "residual": {"rms": 0.123457, "relative_rms": 0.1},
        "seconds": {"relax": 1.0e-9},
        "broken": None,
        "worse": [None, None, None],
        "folder": str(Path("some") / "place"),
        "curve": [1, 2, 3],
        "flag": True,
        "none": None,
        "sentence": "Größe S",
        "large": 2**53 + 1,
    }
    assert list(read) == list(report)
    assert [entry.name for entry in tmp_path.iterdir()] == ["report.json"]


def test_report_without_a_json_form_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_report(path, {"status": "at_rest"})
    with pytest.raises(TypeError, match="set"):
        write_report(path, {"status": {"at_rest"}})
    assert json.loads(path.read_text()) == {"status": "at_rest"}


def test_map_is_written_only_when_loading_changed_something(tmp_path: Path) -> None:
    mesh, path = worn().mesh, tmp_path / "shirt_map.npz"
    changed = replace(mesh, vertex_map=np.arange(5)[::-1], triangle_source=np.arange(3))
    assert write_map(path, changed)
    with np.load(path) as arrays:
        assert sorted(arrays) == ["triangle_source", "vertex_map"]
        assert np.array_equal(arrays["vertex_map"], [4, 3, 2, 1, 0])
    assert not write_map(path, mesh)
    assert list(tmp_path.iterdir()) == []  # the earlier run's map would be taken for this one's


def test_output_folder_is_made(tmp_path: Path) -> None:
    check_writable(tmp_path / "a" / "b", "fit")
    assert (tmp_path / "a" / "b").is_dir()
    assert list((tmp_path / "a" / "b").iterdir()) == []
    check_writable(tmp_path / "a" / "b", "fit")


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("kept")
    for place in (file, file / "below", file / "far" / "below"):
        with pytest.raises(InputError, match="file"):
            check_writable(place, "fit")
        with pytest.raises(InputError, match="file"):
            write_report(place / "report.json", {})
    assert file.read_text() == "kept"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("name", ["x" * 300, "null\0character"])  # longer than any file system takes; never legal
def test_a_refused_folder_leaves_none_of_its_parents(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        check_writable(tmp_path / "made" / "on" / "the" / "way" / name, "fit")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["fit.usdc", "preview.png", "report.html", "report.json"])
def test_a_folder_in_a_files_place_is_refused_before_the_work(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=f"{name}: is a folder"):
        check_writable(tmp_path, "fit")
