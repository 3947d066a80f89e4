"""The live page: what its controls do to a fit, and what it hands to a browser."""

from __future__ import annotations

import io
import json
import struct
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from html import unescape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from cloths import grid
from pxr import Usd, UsdGeom

import warp_cloth
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.fitting.warm_start import corresponding_points
from warp_cloth.maps import MAPS
from warp_cloth.report.shown import shown_verdict
from warp_cloth.scene import MannequinShape
from warp_cloth.scene.schema import CollisionSpec
from warp_cloth.shapes import SIZE_BODIES, tshirt
from warp_cloth.view.live import BURST, PLOT_POINTS, History, LiveFit, merged_overrides
from warp_cloth.view.picture import glb_bytes, legend_html
from warp_cloth.view.verdict import saved_note, schema_limits, swatches_html, verdict_html

DRAPED = {
    "garment": {"shape": {"kind": "square", "vertices_per_side": 11, "height": 0.91}, "fabric": "jersey"},
    "avatar": {"shape": {"kind": "sphere", "edge_mm": 60}},
    "collision": {"pixel_mm": 5},
}


@pytest.fixture
def live() -> LiveFit:
    return LiveFit(DRAPED, {}, "cpu")


def test_it_relaxes_to_rest_and_stays(live: LiveFit) -> None:
    for _ in range(800):
        live.advance()
    assert live.at_rest
    assert "At rest" in live.status()
    at = live.iteration
    live.advance()
    assert live.iteration == at
    assert live.history.iteration[-1] == at
    assert live.history.residual[-1] < live.history.residual[0]


def test_a_change_keeps_the_worn_shape_and_a_refused_one_changes_nothing(live: LiveFit) -> None:
    for _ in range(5):
        live.advance()
    worn = live.points.copy()
    live.change({"garment.fabric": "denim"})
    assert live.scene.garments[0].fabric.name == "denim"
    assert np.array_equal(live.problem.model.points(), worn)
    live.change({"collision.offset_mm": "6"})
    assert live.problem.model.vertices.items.numpy()["offset"] == pytest.approx(0.006)
    assert live.scene.garments[0].fabric.name == "denim"
    with pytest.raises(InputError):
        live.change({"collision.offset_mm": "-1"})
    assert live.scene.collision.offset_mm == 6.0
    live.advance()
    assert live.iteration == BURST


def test_a_change_of_fabric_or_offset_draws_no_avatar_anew(live: LiveFit) -> None:
    drawn = live.problem.contact.built
    live.change({"garment.fabric": "denim"})
    assert live.problem.contact.built is drawn
    live.change({"collision.offset_mm": "2"})
    assert live.problem.contact.built is drawn
    fresh = LiveFit(DRAPED, {"garment.fabric": "denim", "collision.offset_mm": "2"}, "cpu")
    for each in (live, fresh):
        each.problem.relaxation.run(60)
    assert np.array_equal(live.problem.model.points(), fresh.problem.model.points())
    live.change({"collision.offset_mm": "6"})  # farther than the field reaches
    assert live.problem.contact.built is not drawn
    drawn = live.problem.contact.built
    live.change({"collision.offset_mm": "7"})
    assert live.problem.contact.built is drawn
    live.change({"collision.pixel_mm": "4"})
    assert live.problem.contact.built is not drawn


def test_reset_goes_back_to_the_start(live: LiveFit) -> None:
    start = live.points.copy()
    live.advance()
    live.reset()
    assert np.array_equal(live.points, start)
    assert live.iteration == 0


def test_maps_are_there_while_it_moves(live: LiveFit) -> None:
    for _ in range(10):
        live.advance()
    for name in ("gap", "pressure", "strain_warp"):
        shown = live.values(name)
        assert len(shown[0][0]) == len(live.points)
    assert live.values("nothing") is None


def test_the_saved_stage_is_what_is_shown(live: LiveFit, tmp_path: Path) -> None:
    live.advance()
    stage = Usd.Stage.Open(str(live.saved(tmp_path, "gap")))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/square/square_mesh"))
    assert np.allclose(mesh.GetPointsAttr().Get(), live.points, atol=1e-6)
    assert UsdGeom.PrimvarsAPI(mesh).GetPrimvar("gap").HasValue()
    assert mesh.GetDisplayColorPrimvar().HasValue()


def test_a_worn_shape_is_taken_over_by_another_size() -> None:
    body = SIZE_BODIES["M"]
    small, large = (tshirt(size=size, edge=0.04, body=body) for size in ("S", "L"))
    lifted = small.points + np.array((0.0, 5.0, 0.0))
    taken = corresponding_points(small, lifted, large)
    assert taken.shape == large.points.shape
    # where the other size's own vertex starts, once lifted as well, but for half of what a size is wider or longer
    away = np.linalg.norm(taken - (large.points + np.array((0.0, 5.0, 0.0))), axis=1)
    assert np.median(away) < 0.04


@pytest.mark.parametrize("order", [(1, 0, 2, 3), (2, 3, 0, 1), (0, 1, 3, 2)])
def test_panels_that_have_the_names_of_others_are_not_taken_over(order: tuple[int, ...]) -> None:
    small, large = (tshirt(size=size, edge=0.04) for size in ("S", "L"))
    renamed = replace(small, panel_names=tuple(small.panel_names[panel] for panel in order))
    assert corresponding_points(renamed, small.points, large) is None


def test_the_same_mesh_keeps_its_vertices_and_a_stranger_starts_anew() -> None:
    mesh = grid(4, 1.0)
    worn = mesh.points + 1.0
    assert np.array_equal(corresponding_points(mesh, worn, grid(4, 2.0)), worn)
    assert corresponding_points(mesh, worn, grid(5, 1.0)) is None


def test_history_keeps_its_ends_and_stays_short() -> None:
    history = History()
    for index in range(5 * PLOT_POINTS):
        history.add(index, 1.0 / (1 + index), 100.0)
    assert len(history.iteration) <= PLOT_POINTS
    assert (history.iteration[0], history.iteration[-1]) == (0.0, 5.0 * PLOT_POINTS - 1)


def test_the_browsers_mesh_is_sound_gltf() -> None:
    mesh: Mesh = grid(5, 1.0)
    shown = np.linspace(0, 1, 75).reshape(25, 3)
    data = glb_bytes(mesh.points, mesh.triangles, shown)
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size = struct.unpack("<I", data[12:16])[0]
    assert json.loads(data[20 : 20 + size])["asset"]["version"] == "2.0"
    back = trimesh.load(io.BytesIO(data), file_type="glb", process=False).to_geometry()
    assert np.allclose(back.vertices, mesh.points)
    assert np.array_equal(back.faces, mesh.triangles)


def test_legend_names_the_map_and_its_ends() -> None:
    html = legend_html(MAPS["pressure"], (0.0, 2.0))
    assert "pressure on the body" in html
    assert "<span>0 kPa</span><span>1 kPa</span><span>2 kPa</span>" in html
    assert "#440154" in html


@pytest.fixture
def page_of() -> Iterator[Callable[[LiveFit], Any]]:
    """Makes a page, and ends it after the test."""
    pytest.importorskip("viser")
    from warp_cloth.view.page import Page

    made: list[Page] = []
    yield lambda live: made.append(Page(live, port=0)) or made[-1]
    for page in made:
        page.stop()
        page.run()


@pytest.fixture
def page(live: LiveFit, page_of: Callable[[LiveFit], Any]) -> Iterator[Any]:
    page = page_of(live)
    page._is_watched = lambda: True
    thread = threading.Thread(target=page.run)
    thread.start()
    yield page
    page.stop()
    thread.join(timeout=30)
    assert not thread.is_alive()


@pytest.mark.parametrize(("key", "table"), [("offset_mm", CollisionSpec), ("chest", MannequinShape)])
def test_sliders_end_where_the_schema_does(key: str, table: type) -> None:
    low, high = schema_limits(table, key)
    valid = {"kind": "mannequin"} if table is MannequinShape else {}
    for end in (low, high):
        table.model_validate({**valid, key: end})
    with pytest.raises(ValueError, match=key):
        table.model_validate({**valid, key: high * 1.01})


def test_it_waits_for_a_browser(live: LiveFit, page_of: Callable[[LiveFit], Any]) -> None:
    page = page_of(live)
    page._step()
    assert live.iteration == 0
    page._is_watched = lambda: True
    page._step()
    assert live.iteration > 0


def test_a_shape_at_rest_is_judged_and_a_fit_is_that_of_the_library(live: LiveFit) -> None:
    assert live.judged() is None
    for _ in range(800):
        live.advance()
    judged = live.judged()
    assert judged.report["girths_mm"] == []  # a ball has no waist
    html = verdict_html(judged, "as shown")
    assert shown_verdict(judged.report).words in html
    assert all(problem.remedy in unescape(html) for problem in judged.problems)
    live.change({"garment.fabric": "denim"})
    assert live.judged() is None
    fit = live.fit()
    alone = warp_cloth.fit(DRAPED, device="cpu", overrides=["garment.fabric=denim"])
    assert np.array_equal(fit.garments[0].points, alone.garments[0].points)
    assert np.array_equal(live.points, alone.garments[0].points)
    assert live.judged() is fit
    assert live.status() == alone.message
    live.change({"collision.offset_mm": "4"})
    assert live.fitted is None


def test_what_is_saved_is_said() -> None:
    said = saved_note("tshirt.usdz", 900_000, {"garment": "tshirt", "size": "L", "fabric": "denim"}, "At rest", "gap")
    assert said == (
        "tshirt.usdz (0.9 MB, in your browser's downloads): "
        "garment tshirt, size L, fabric denim, coloured by gap; At rest"
    )


def test_plain_colours_are_named() -> None:
    html = swatches_html(["shirt (silk)", "coat <x>"], with_body=True)
    assert html.count("background:#") == 3
    assert "shirt (silk)" in html
    assert "coat &lt;x&gt;" in html


def test_a_change_takes_the_place_of_what_is_below_it_and_none_of_that_at_first() -> None:
    first = {"garment.fabric.weight": "0.3", "garment.fabrics": "x", "collision.offset_mm": "2"}
    now = merged_overrides(first, {"garment.fabric": "silk", "collision.offset_mm": "4"}, first)
    assert now == {"garment.fabrics": "x", "garment.fabric": "silk", "collision.offset_mm": "4"}
    assert merged_overrides(now, {"garment.fabric": None}, first) == {**first, "collision.offset_mm": "4"}
    assert merged_overrides(now, {"garment.fabric": None}, {}) == {"garment.fabrics": "x", "collision.offset_mm": "4"}


@pytest.mark.parametrize(("change", "offered"), [({}, "jersey"), ({"garment.fabric.weight": "0.3"}, "jersey (from")])
def test_a_fabric_of_the_scenes_own_is_offered_and_can_be_gone_back_to(
    change: dict[str, str], offered: str, page_of: Callable[[LiveFit], Any]
) -> None:
    live = LiveFit(DRAPED, change, "cpu")
    page = page_of(live)
    chosen = page._fabric
    own = chosen.value
    assert own.startswith(offered)
    weight = live.scene.garments[0].fabric.weight
    chosen.value = "denim"
    page._step()
    assert live.scene.garments[0].fabric.name == "denim"
    chosen.value = own
    page._step()
    assert live.scene.garments[0].fabric.weight == weight


def test_a_browser_opens_the_page_where_that_is_asked(live: LiveFit, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser")
    from warp_cloth.view import page

    opened: list[str] = []
    run = page.Page.run

    def stopped(self: page.Page) -> None:
        self.stop()
        run(self)

    monkeypatch.setattr(page.Page, "run", stopped)
    monkeypatch.setattr("webbrowser.open", opened.append)
    for asked in (False, True):
        page.serve(live, host="127.0.0.1", port=0, show=lambda _: None, opened=asked)
    (address,) = opened
    assert address.startswith("http://127.0.0.1:")


def test_the_innermost_of_several_garments_takes_the_size(page_of: Callable[[LiveFit], Any]) -> None:
    shirts = [{"shape": {"kind": "tshirt", "size": size, "edge_mm": 60}, "rest": "uv"} for size in "SL"]
    live = LiveFit({"garment": shirts, "avatar": {"shape": {"kind": "mannequin"}}}, {}, "cpu")
    page = page_of(live)
    page._request_size("M")
    page._step()
    assert [garment.shape.size for garment in live.scene.garments] == ["M", "L"]


def test_the_page_is_served_on_this_machine_only_and_shows_pictures(page: object) -> None:
    import time
    import urllib.request

    with urllib.request.urlopen(f"http://127.0.0.1:{page.port}/", timeout=20) as answer:
        assert answer.status == 200
    assert page._server.get_host() == "127.0.0.1"
    for _ in range(600):
        if page.pictures > 3:
            break
        time.sleep(0.05)
    assert page.pictures > 3


def test_a_map_is_shown_once_it_has_been_read_and_taken_away_with_its_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("viser")
    import viser

    from warp_cloth.view import surfaces as shown

    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        surfaces, mesh = shown.Surfaces(server), grid(4, 1.0)
        colours = np.zeros((len(mesh.points), 3))
        surfaces.plain("cloth", mesh.points, mesh.triangles, (0.2, 0.4, 0.6))
        node = surfaces._surfaces["cloth"]

        def visible() -> list[bool]:
            return [node.plain.visible, *(file.visible for file in node.files)]

        clock = [1000.0]  # that stands still but for what is said below
        monkeypatch.setattr(shown, "time", SimpleNamespace(perf_counter=lambda: clock[0]))

        def later(seconds: float) -> None:
            clock[0] += 1.01 * seconds

        surfaces.coloured("cloth", mesh.points, mesh.triangles, colours)
        surfaces.coloured("cloth", mesh.points, mesh.triangles, colours)  # too soon: it waits
        assert visible() == [True, False]
        later(shown.FILE_SECONDS)
        surfaces.coloured("cloth", mesh.points, mesh.triangles, colours)
        assert visible() == [False, True, False]
        later(shown.FILE_SECONDS)
        surfaces.coloured("cloth", mesh.points, mesh.triangles, colours)
        assert visible() == [False, True, True, False]  # the older one stays until the younger has been read
        later(shown.FILE_SECONDS)
        surfaces.coloured("cloth", mesh.points, mesh.triangles, colours)
        assert visible() == [False, False, True, True]
        surfaces.coloured("cloth", mesh.points + 1.0, mesh.triangles, colours)
        assert not surfaces.settle()
        later(shown.FILE_SECONDS)
        assert not surfaces.settle()  # what waited is written now
        assert node.waiting is None
        later(2 * shown.READING_SECONDS)
        assert surfaces.settle()
        assert visible() == [False, False, True, False]
        lifted = mesh.points + 1.0
        surfaces.plain("cloth", lifted, mesh.triangles, (0.2, 0.4, 0.6))
        assert visible() == [True, False, False, False]
        assert np.array_equal(node.plain.vertices, lifted.astype(np.float32))
        surfaces.coloured("cloth", mesh.points, mesh.triangles, colours)
        later(shown.FILE_SECONDS)
        surfaces.coloured("cloth", mesh.points, mesh.triangles, colours)
        assert visible() == [False, False, False, True]  # and no file from before
        # another size has other triangles
        larger = grid(5, 1.0)
        surfaces.plain("cloth", larger.points, larger.triangles, (0.2, 0.4, 0.6))
        assert len(node.plain.vertices) == 25
    finally:
        server.stop()
