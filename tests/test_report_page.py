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
from warp_cloth.model.fit_problem import FitProblem, ProblemCode


@pytest.fixture(scope="module")
def report() -> dict[str, Any]:
    scene = {
        "garment": {"shape": {"kind": "square", "vertices_per_side": 9, "side": 0.3, "height": 0.91}},
        "avatar": {"shape": {"kind": "sphere", "edge_mm": 30}},
        "collision": {"pixel_mm": 5},
    }
    return fit(scene, device="cpu", maps="gap,pressure").report


def page_of(report: dict[str, Any], folder: Path, name: str = "square") -> str:
    pictures = {}
    for key in ("preview", "gap", "pressure"):
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
    assert "Problems" not in text
    assert ">worn<" in text
    assert "vertices_per_side" in text


def test_names_cannot_bring_their_own_markup(report: dict[str, Any], tmp_path: Path) -> None:
    assert "<script>" not in page_of(report, tmp_path, name="<script>alert(1)</script>")


def test_certificate_marks_what_is_not_met(report: dict[str, Any]) -> None:
    assert all(row["met"] for row in certificate_rows(report))
    worse = deepcopy(report)
    worse["rest_error_mm"] = float("inf")
    (row,) = (row for row in certificate_rows(worse) if row["name"].startswith("rest error"))
    assert (row["met"], row["value"]) == (False, "unknown")


def test_the_page_lists_problems_with_what_to_change(report: dict[str, Any], tmp_path: Path) -> None:
    entry = FitProblem(ProblemCode.SEAM_OPEN, 'A seam of "square" is <open>.', "Free it.", "square").as_json()
    text = page_of({**deepcopy(report), "worn": False, "problems": [entry]}, tmp_path)
    assert ">not worn<" in text
    for words in ("<b>seam open</b>", "A seam of &#34;square&#34; is &lt;open&gt;.", "Free it."):
        assert words in text
