"""Pages in a real browser, headless: pictures load, nothing is wider than the window, links lead somewhere."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from warp_cloth.batch.contact_sheet import Card, write_cards
from warp_cloth.export.report_page import write_report_page
from warp_cloth.fitting.fit import fit

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
WIDTHS = (500, 1280)  # of a window [px]; a headless Chromium has no narrower one
WAIT = 120.0  # [s] for a page
SEEN = """
<script>addEventListener("load", () => { document.title = "seen" + JSON.stringify({
  wide: document.documentElement.scrollWidth, window: innerWidth,
  images: [...document.images].map(each => each.naturalWidth), text: document.body.innerText}); });</script>
"""


@pytest.fixture(scope="module")
def see(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path, int], dict[str, Any]]:
    """What a browser makes of a page in a window so wide."""
    browser = os.environ.get("WARP_CLOTH_BROWSER") or next(filter(shutil.which, BROWSERS), None)
    if browser is None:
        pytest.skip(f"no browser here: install one of {', '.join(BROWSERS)}, or set WARP_CLOTH_BROWSER")
    profile = tmp_path_factory.mktemp("profile")

    def seen(page: Path, width: int) -> dict[str, Any]:
        watched = page.with_name(f"watched_{page.name}")
        watched.write_text(page.read_text(encoding="utf-8") + SEEN, encoding="utf-8")
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
        command = [browser, *flags, f"--window-size={width},900", "--virtual-time-budget=5000", "--dump-dom"]
        done = subprocess.run(
            [*command, watched.as_uri()], capture_output=True, text=True, timeout=WAIT, check=True, encoding="utf-8"
        )
        found = re.search(r"<title>seen(.*?)</title>", done.stdout, flags=re.DOTALL)
        assert found is not None, done.stderr[-2000:]
        return json.loads(unescape(found[1]))  # type: ignore[no-any-return]

    return seen


@pytest.fixture(scope="module")
def report_page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    scene = {
        "garment": {"shape": {"kind": "square", "vertices_per_side": 9, "side": 0.3, "height": 0.91}},
        "avatar": {"shape": {"kind": "sphere", "edge_mm": 30}},
        "collision": {"pixel_mm": 5},
    }
    fitted = fit(scene, device="cpu", maps="gap")
    Image.new("RGB", (1800, 900)).save(folder / "preview.png")
    pictures = {"preview": folder / "preview.png", "gap": folder / "preview.png"}
    write_report_page(folder / "report.html", "square", fitted.report, pictures)
    return folder / "report.html"


@pytest.mark.parametrize("width", WIDTHS)
def test_a_report(see: Callable[[Path, int], dict[str, Any]], report_page: Path, width: int) -> None:
    seen = see(report_page, width)
    assert seen["images"] == [1800, 1800]
    assert seen["wide"] <= seen["window"]
    assert "worn" in seen["text"]
    assert "square, in the default fabric of" in seen["text"]
    assert "relative residual" not in seen["text"]  # folded away


@pytest.mark.parametrize("width", WIDTHS)
def test_a_contact_sheet(see: Callable[[Path, int], dict[str, Any]], tmp_path: Path, width: int) -> None:
    Image.new("RGB", (600, 360)).save(tmp_path / "small.jpg")
    cards = [
        Card("a" * 80, "worn", "#3c7d4b", "", "At rest.", "small.jpg", "S/report.html"),
        Card("b", "no result", "#a83a32", "", "x" * 300, ""),
    ]
    write_cards(tmp_path / "sizes.html", "two sizes", cards)
    seen = see(tmp_path / "sizes.html", width)
    assert seen["images"] == [600]
    assert seen["wide"] <= seen["window"]
