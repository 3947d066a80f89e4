"""Size runs: girths against closed forms, one body for all sizes, the recommendation's rule."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from warp_cloth.batch.sizes import SizeFit, fit_sizes, recommendation
from warp_cloth.cli import app
from warp_cloth.errors import InputError
from warp_cloth.fabric import Fabric
from warp_cloth.girth import LevelFit, garment_girths
from warp_cloth.mesh import Mesh
from warp_cloth.rest import build_rest_shape

SIDES = 48
POLYGON = 0.01  # of a girth: chords of 48 against the circle, slanted pieces of a section
QUICK = ["garment.shape.edge_mm=55", "solver.iterations=200", "collision.pixel_mm=10"]


def tube(radius: float, height: float = 0.6, rings: int = 9) -> Mesh:
    """An open tube round the y axis."""
    angle = 2.0 * math.pi * np.arange(SIDES) / SIDES
    rows = [np.stack([radius * np.cos(angle), np.full(SIDES, y), radius * np.sin(angle)], axis=1)
            for y in np.linspace(0.0, height, rings)]  # fmt: skip
    around = np.arange(SIDES)
    beside = (around + 1) % SIDES
    quads = []
    for ring in range(rings - 1):
        low, high = ring * SIDES, (ring + 1) * SIDES
        quads += [np.stack([low + around, low + beside, high + around], axis=1)]
        quads += [np.stack([low + beside, high + beside, high + around], axis=1)]
    return Mesh("tube", np.concatenate(rows), np.concatenate(quads).astype(np.int32))


def test_a_tubes_girth_is_its_circle_as_worn_and_as_cut() -> None:
    mesh = tube(0.15)
    rest = build_rest_shape(mesh, Fabric(), rest="mesh")
    wider = mesh.points * np.array([1.2, 1.0, 1.2])
    for height in (0.1, 0.33):
        worn, cut = garment_girths(wider, mesh.triangles, rest, height) or (0.0, 0.0)
        assert cut == pytest.approx(2.0 * math.pi * 0.15, rel=POLYGON)
        assert worn / cut == pytest.approx(1.2, rel=POLYGON)


def test_there_is_no_girth_beside_the_body_above_the_garment_or_through_an_opening() -> None:
    mesh = tube(0.15)
    rest = build_rest_shape(mesh, Fabric(), rest="mesh")
    assert garment_girths(mesh.points + np.array([0.5, 0.0, 0.0]), mesh.triangles, rest, 0.3) is None
    assert garment_girths(mesh.points, mesh.triangles, rest, 0.7) is None
    slit = mesh.triangles[: -2 * SIDES].tolist()
    cut_open = np.array([t for t in slit if not {0, 1} & {v % SIDES for v in t}], dtype=np.int32)
    opened = Mesh("slit", mesh.points, cut_open)
    assert garment_girths(opened.points, opened.triangles, build_rest_shape(opened, Fabric(), rest="mesh"), 0.3) is None


def sized(size: str, ease: float, strain: float = 0.02, *, status: str = "at_rest") -> SizeFit:
    level = LevelFit(1.2, 1.0, 1.0 + ease, 0.0)
    fit = object() if status != "invalid" else None
    return SizeFit(size, status, "", {"chest": level} if fit else {}, 0.01, strain, fit)  # type: ignore[arg-type]


def test_the_smallest_size_with_ease_enough_is_taken() -> None:
    taken, reason = recommendation([sized("S", 0.01), sized("M", 0.05), sized("L", 0.09)], 0.04)
    assert taken == "M"
    told = "M leaves 5.0 cm at the chest, where it is closest"
    assert reason == f"{told}; S is too tight: 1.0 cm of ease at the chest (wanted 4.0)."


def test_a_size_whose_cloth_is_strained_too_far_is_too_tight() -> None:
    assert recommendation([sized("S", 0.05, strain=0.3), sized("M", 0.08)], 0.04)[0] == "M"


def test_no_size_fits_is_said() -> None:
    taken, reason = recommendation([sized("S", -0.02), sized("M", 0.01)], 0.04)
    assert taken == "M"
    assert reason.startswith("Even the largest size, M, is too tight")
    assert recommendation([sized("S", 0.0, status="invalid")], 0.04)[0] is None


def test_all_sizes_meet_the_same_body_and_larger_ones_leave_more() -> None:
    run = fit_sizes("tshirt", overrides=QUICK, device="cpu")
    assert [each.size for each in run.sizes] == ["S", "M", "L"]
    avatars = [each.fit.avatar.points for each in run.sizes if each.fit and each.fit.avatar]
    assert len(avatars) == 3
    assert all(np.array_equal(points, avatars[0]) for points in avatars)
    hips = [each.levels["hip"] for each in run.sizes if "hip" in each.levels]
    assert len({round(level.body, 6) for level in hips}) == 1
    assert all(a.ease < b.ease for a, b in itertools.pairwise(hips))


def test_the_command_writes_the_table_and_the_stages(tmp_path: Path) -> None:
    changes = [word for change in QUICK for word in ("--set", change)]
    done = CliRunner().invoke(
        app, ["sizes", "tshirt", "--size", "M", *changes, "--device", "cpu", "--out", str(tmp_path)]
    )
    assert done.exit_code == 0, done.output
    assert "take M: " in done.stdout
    assert {path.name for path in tmp_path.iterdir()} == {"tshirt_M.usdc", "sizes.json"}


@pytest.mark.parametrize(
    ("scene", "sizes", "overrides", "told"),
    [
        ("sphere", ["S"], [], "nothing in the scene depends on the size"),
        ("hanging", ["S"], [], "has no avatar"),
        ("tshirt", [], ["garment.mesh=shirt_{size}.obj"], "no sizes are named"),
    ],
)
def test_what_has_no_sizes_is_refused(scene: str, sizes: list[str], overrides: list[str], told: str) -> None:
    with pytest.raises(InputError, match=told):
        fit_sizes(scene, sizes, overrides=overrides)
