"""The report page stands alone and says what to try next."""

from __future__ import annotations

import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from warp_cloth.export.report_page import certificate_rows, write_report_page
from warp_cloth.fitting.fit import fit
from warp_cloth.report.advice import advice


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    scene = {
        "garment": {"shape": {"kind": "square", "vertices_per_side": 9, "side": 0.6, "height": 0.91}},
        "avatar": {"shape": {"kind": "sphere", "edge_mm": 60}},
        "collision": {"pixel_mm": 5},
    }
    return fit(scene, device="cpu", maps="ease,pressure").report


def page_of(report: dict[str, Any], folder: Path, name: str = "square") -> str:
    pictures = {}
    for key in ("preview", "ease", "pressure"):
        pictures[key] = folder / f"{key}.png"
        Image.new("RGB", (4, 4)).save(pictures[key])
    write_report_page(folder / "report.html", name, report, pictures)
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_needs_no_other_file(report: dict[str, Any], tmp_path: Path) -> None:
    text = page_of(report, tmp_path)
    sources = re.findall(r'(?:src|href)="([^"]*)"', text)
    assert len(sources) == 3
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "distance to the skin" in text
    assert "What to try next" not in text
    assert "vertices_per_side" in text


def test_names_cannot_bring_their_own_markup(report: dict[str, Any], tmp_path: Path) -> None:
    assert "<script>" not in page_of(report, tmp_path, name="<script>alert(1)</script>")


def test_certificate_marks_what_is_not_met(report: dict[str, Any]) -> None:
    assert all(row["met"] for row in certificate_rows(report))
    worse = deepcopy(report)
    worse["rest_error_mm"] = float("inf")
    (row,) = (row for row in certificate_rows(worse) if row["name"].startswith("rest error"))
    assert (row["met"], row["value"]) == (False, "unknown")


def test_advice_names_the_likeliest_cause_first(report: dict[str, Any], tmp_path: Path) -> None:
    assert advice(report) == []
    stuck = deepcopy(report)
    stuck["status"] = "iteration_limit"
    assert advice(stuck)[0].startswith("Raise solver.iterations")
    assert not any("multilevel" in line for line in advice(stuck))
    assert 'solver.method = "multilevel"' in advice({**stuck, "vertices": 50_000})[0]
    stuck["strain"]["p99"] = 3.0
    stuck["penetration_mm"]["max"] = 40.0
    first, second, *_ = advice(stuck)
    assert "garment.uv_units" in first
    assert 'collision.avatar = "mesh"' in second
    assert "What to try next" in page_of(stuck, tmp_path)
    lost = {**deepcopy(report), "status": "diverged"}
    assert "float64" in advice(lost)[0]
    stuck["unheld"] = "nothing holds it"
    assert advice(stuck)[0] == "Nothing holds it."
    assert not any("solver.iterations" in line for line in advice(stuck))


def test_cloth_that_passes_through_itself_is_advised_of_contact(report: dict[str, Any]) -> None:
    tangled = deepcopy(report)
    tangled["crossings"]["faces"] = tangled["faces"] // 10
    assert "collision.cloth = true" in advice(tangled)[0]
    tangled["settings"]["collision"]["cloth"] = True
    assert advice(tangled) == []
