"""The avatar under test: colliders measured against the exact mesh, sample_lines for jumps, told and written."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import warp_cloth
from warp_cloth.avatar.depth import build_depth_buffers
from warp_cloth.avatar.error import NearSurface, near_surface
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.avatar.field import build_contact_field
from warp_cloth.avatar.layers import build_layered_buffers
from warp_cloth.bench.avatar import AvatarBench, named_places, run_avatar_bench, sample_lines, save_avatar_bench, table
from warp_cloth.cli.main import app
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.loading import load_mesh

JUMP = 0.002  # [mm] beyond a walk of 0.0008 mm: slopes of 1.4, as in creases, and float32's rounding
TWIST = 0.5  # [degrees] within 0.0008 mm: the tightest creases turn the normal by 0.2
PIXEL = 0.004  # [m], coarse and quick
MARGIN = 0.1  # [m] of the field round the skin that is sample_lines, half of it never left
ERROR = 1.0  # [mm] of the fields on the test's ball, drawn coarsely
SCENE = {
    "name": "ball",
    "garment": {"shape": {"kind": "square", "side": 0.2, "vertices_per_side": 5, "height": 0.71}},
    "avatar": {"shape": {"kind": "sphere", "radius": 0.1}},
    "collision": {"pixel_mm": 4.0},
}


@pytest.fixture(scope="module")
def bench() -> AvatarBench:
    scene = warp_cloth.load_scene(SCENE)
    return run_avatar_bench(scene, load_outfit(scene), device="cpu")


def test_fields_have_no_jumps_and_the_plain_look_up_has(bench: AvatarBench) -> None:
    found = {finding.kind: finding for finding in bench.findings}
    for kind in ("depth", "auto"):
        assert found[kind].jump_mm < JUMP
        assert found[kind].jump_degrees < TWIST
        assert found[kind].max < ERROR
    assert found["plain"].jump_mm > 100.0 * JUMP
    assert found["plain"].jump_degrees > 10.0 * TWIST
    assert found["mesh"].max == 0.0


@pytest.mark.parametrize(
    "name", ["garmentcode/mean_all", "anny/female_avg_A_pose", "anny/female_avg_T_pose", "anny/female_avg_arms_down"]
)
def test_no_jump_on_any_body_from_crotch_to_shoulders(shared_data: Path, name: str) -> None:
    body = load_mesh(shared_data / f"{name}.obj", role="avatar", key="avatar")
    height = (body.points[:, 1] - body.points[:, 1].min()) / np.ptp(body.points[:, 1])
    skin = body.points[(height > 0.4) & (height < 0.84)]
    lower, upper = skin.min(axis=0) - MARGIN, skin.max(axis=0) + MARGIN
    surface = near_surface(body, build_exact_collider(body, "cpu"), skin, lower + 0.5 * MARGIN, upper - 0.5 * MARGIN)
    for build in (build_depth_buffers, build_layered_buffers):
        field = build_contact_field(build(body.points, body.triangles, lower, upper, PIXEL, "cpu"))
        _, jump, twist = sample_lines(field, surface)
        assert 1e3 * jump < JUMP
        assert np.degrees(twist) < TWIST


def test_table_and_files_tell_every_collider(bench: AvatarBench, tmp_path: Path) -> None:
    lines = table(bench)
    assert [line.split()[0] for line in lines[2:]] == ["depth", "auto", "plain", "mesh"]
    [path] = save_avatar_bench(bench, tmp_path, plots=False)
    told = json.loads(path.read_text(encoding="utf-8"))
    assert [entry["kind"] for entry in told["colliders"]] == ["depth", "auto", "plain", "mesh"]
    assert 0.0 <= told["unseen_by_three_views"] <= 1.0


def test_places_are_found_by_shape() -> None:
    """On a ball: the left, the top; no armpit and no crotch where nothing looks down."""
    way = np.random.default_rng(0).normal(size=(5000, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    way = way[way[:, 1] > -0.5]
    places = named_places(NearSurface(0.1 * way, way, 1.0))
    assert set(places) == {"silhouette", "shoulder"}
    assert places["silhouette"][0][0] > 0.09
    assert places["shoulder"][0][1] > 0.09
    assert named_places(NearSurface(np.zeros((0, 3)), np.zeros((0, 3)), 0.0)) == {}


def test_scene_without_avatar_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["avatar", "hanging", "--colliders", "--device", "cpu", "--no-plots"])
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1].startswith("error: hanging: the scene has no avatar to test")
    assert not (tmp_path / "out").exists()
