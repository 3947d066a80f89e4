"""What a collider does not know is measured: unseen surface, error near the garment, and what "auto" does about it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from meshfiles import as_mesh

from warp_cloth.avatar import field
from warp_cloth.avatar.contact import AvatarContact, ContactOptions
from warp_cloth.avatar.error import contact_error, near_surface, unseen_share
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh

OFFSET = 0.003  # [m]
SHARE_ERROR = 0.01  # of a share of area told by 10,000 samples
WIDE = np.full(3, 10.0)  # [m]


def box(size: tuple[float, float, float], centre: tuple[float, float, float], cuts: int = 4) -> trimesh.Trimesh:
    shape = trimesh.creation.box(size)
    for _ in range(cuts):
        shape = shape.subdivide()
    return shape.apply_translation(centre)


def around(mesh: Mesh, gap: float = 0.01) -> np.ndarray:
    """Cloth that lies round the whole of a mesh [m]."""
    shape = trimesh.Trimesh(mesh.points, mesh.triangles, process=False)
    return mesh.points + gap * np.asarray(shape.vertex_normals)


def test_of_a_cube_the_three_views_miss_three_sides() -> None:
    """Left, right and bottom."""
    mesh = as_mesh(box((0.2, 0.2, 0.2), (0.0, 0.0, 0.0)))
    exact = build_exact_collider(mesh, "cpu")
    surface = near_surface(mesh, exact, around(mesh), -WIDE, WIDE)
    assert surface.area == pytest.approx(6 * 0.2**2, rel=1e-3)
    bottom = surface.normals[:, 1] < -0.5
    assert bottom.mean() == pytest.approx(1 / 6, abs=SHARE_ERROR)
    assert unseen_share(surface, exact) == pytest.approx(1 / 2, abs=SHARE_ERROR)


def test_only_what_the_garment_can_reach_is_judged() -> None:
    """Cloth over one end of a long bar: nothing is said of the other end."""
    mesh = as_mesh(box((1.0, 0.1, 0.1), (0.0, 0.0, 0.0), 6))
    exact = build_exact_collider(mesh, "cpu")
    cloth = around(mesh)
    surface = near_surface(mesh, exact, cloth[cloth[:, 0] > 0.3], -WIDE, WIDE)
    assert surface.points[:, 0].min() > 0.15
    assert surface.points[:, 0].max() > 0.49


def test_large_triangles_are_judged_where_the_garment_is_and_nowhere_else() -> None:
    cloth = around(as_mesh(box((0.2, 0.1, 0.1), (0.4, 0.0, 0.0), 4)))
    lower, upper = np.array([0.2, -0.2, -0.2]), np.array([0.6, 0.2, 0.04])
    surfaces = []
    for cuts in (0, 6):
        mesh = as_mesh(box((1.0, 0.1, 0.1), (0.0, 0.0, 0.0), cuts))
        surface = near_surface(mesh, build_exact_collider(mesh, "cpu"), cloth, lower, upper)
        assert (surface.points[:, 2] <= 0.045).all()  # small ones reach as far out as they are large
        surfaces.append(surface)
    assert surfaces[0].area == pytest.approx(surfaces[1].area, rel=0.1)  # whole triangles count as near


def test_inner_parts_are_no_surface() -> None:
    mesh = as_mesh(box((0.2, 0.2, 0.2), (0, 0, 0)), box((0.1, 0.1, 0.1), (0.0, 0.0, 0.02)))
    surface = near_surface(mesh, build_exact_collider(mesh, "cpu"), around(mesh), -WIDE, WIDE)
    assert surface.area == pytest.approx(6 * 0.2**2, rel=1e-2)
    assert np.abs(surface.points).max(axis=1).min() > 0.099


def test_error_of_a_collider_that_is_off_by_a_millimetre_is_a_millimetre() -> None:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=5, radius=0.15))
    exact = build_exact_collider(mesh, "cpu")
    thicker = build_exact_collider(Mesh("thicker", mesh.points * (0.151 / 0.15), mesh.triangles), "cpu")
    surface = near_surface(mesh, exact, around(mesh), -WIDE, WIDE)
    error = contact_error(thicker, exact, surface.worn(exact, OFFSET))
    assert error.p50 == pytest.approx(1.0, abs=0.01)
    assert error.max == pytest.approx(1.0, abs=0.01)


def test_gap_too_narrow_for_cloth_is_not_judged() -> None:
    mesh = as_mesh(box((0.2, 0.2, 0.2), (-0.102, 0, 0)), box((0.2, 0.2, 0.2), (0.102, 0, 0)))
    exact = build_exact_collider(mesh, "cpu")
    points = near_surface(mesh, exact, around(mesh), -WIDE, WIDE).worn(exact, OFFSET)
    between = (np.abs(points[:, 1:]) < 0.099).all(axis=1)
    assert np.abs(points[between, 0]).min() > 0.2


def contact(mesh: Mesh, kind: str, error: float = 0.0015, pixel: float = 0.002) -> AvatarContact:
    return AvatarContact(mesh, ContactOptions(kind, pixel, OFFSET, error, "cpu"))


def between_walls() -> Mesh:
    """Two blocks 20 mm apart, covered before, behind and above: no view of the three sees between them."""
    parts = [box((0.06, 0.1, 0.06), (x, 0.0, 0.0)) for x in (-0.04, 0.04)]
    parts += [box((0.16, 0.2, 0.02), (0.0, 0.0, z)) for z in (-0.05, 0.05)]
    return as_mesh(*parts, box((0.16, 0.02, 0.12), (0.0, 0.07, 0.0)))


def test_auto_keeps_the_three_buffers_where_they_do() -> None:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=5, radius=0.1))
    made = contact(mesh, "auto")
    made.collider(around(mesh))
    assert made.report["buffers"] == ["front", "back", "top"]
    assert made.report["error_mm"]["p999"] < 1.5


def test_auto_adds_the_layers_that_a_hidden_gap_needs() -> None:
    mesh = between_walls()
    three, auto = contact(mesh, "depth"), contact(mesh, "auto")
    cloth = around(mesh, 0.003)
    three.collider(cloth)
    auto.collider(cloth)
    assert three.report["error_mm"]["p99"] > 5.0
    assert three.report["unseen_by_three_views"] > 0.1
    assert auto.report["buffers"] == ["4 layers along x", "4 layers along y", "6 layers along z"]
    assert auto.report["error_mm"]["p999"] < 1.5
    assert auto.report["unbalanced_pixels"] == 0


def test_auto_draws_finer_where_all_layers_are_not_enough() -> None:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=4, radius=0.05))
    auto = contact(mesh, "auto", error=1e-6, pixel=0.008)
    auto.collider(around(mesh))
    assert auto.report["pixel_mm"] == pytest.approx(4.0)
    assert auto.report["error_mm"]["p999"] > auto.report["error_sought_mm"]  # and says so


def test_auto_stays_with_the_pixel_whose_grid_can_be_built(monkeypatch: pytest.MonkeyPatch) -> None:
    """A garment may come to reach more of the avatar than a fine grid can cover: it is met all the same."""
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=4, radius=0.05))
    auto = contact(mesh, "auto", error=1e-6, pixel=0.008)
    auto.collider(around(mesh))
    monkeypatch.setattr(field, "MOST_NODES", auto.built.values.size - 1)  # type: ignore[union-attr]
    for audited in (True, False, True):
        auto.builds = 0  # or the region grows, as round a garment that falls
        auto.collider(around(mesh), audited=audited)
        assert auto.report["pixel_mm"] == pytest.approx(8.0)
    monkeypatch.setattr(field, "MOST_NODES", 10)
    with pytest.raises(InputError, match="contact grid would have"):
        auto.collider(around(mesh))


@pytest.mark.parametrize(("does", "pixel"), [(True, 8.0), (False, 4.0)])
def test_what_was_too_coarse_for_a_small_part_is_tried_again_over_a_larger_one(
    monkeypatch: pytest.MonkeyPatch, does: bool, pixel: float
) -> None:
    """A poncho starts round the head, whose ears need the finer layers, and falls over the whole body."""
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=4, radius=0.05))
    auto = contact(mesh, "auto", error=1e-6 * pixel, pixel=0.008)  # fields of one error are kept on disk
    auto.collider(around(mesh))
    assert auto.report["pixel_mm"] == pytest.approx(4.0)
    monkeypatch.setattr(AvatarContact, "_accurate", lambda _: does)
    auto.collider(around(mesh))
    assert auto.report["pixel_mm"] == pytest.approx(pixel)
    assert len(auto.report["buffers"]) == 3
    assert all("layers" in name for name in auto.report["buffers"])


def test_what_an_earlier_attempt_drew_serves_again_where_the_avatar_stands_as_it_did() -> None:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=4, radius=0.05))
    earlier, later = contact(mesh, "auto", pixel=0.008), contact(mesh, "auto", pixel=0.008)
    earlier.collider(around(mesh))
    assert later.reused_from(earlier, around(mesh)) is not None
    assert later.built is earlier.built
    earlier.move(mesh.points + 0.01, around(mesh))
    earlier.collider(around(mesh))
    assert contact(mesh, "auto", pixel=0.008).reused_from(earlier, around(mesh)) is None


def test_a_garment_that_falls_on_and_on_asks_for_no_more_than_what_is_near_the_avatar(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=4, radius=0.05))
    falling = contact(mesh, "depth", pixel=0.008)
    falling.collider(around(mesh))
    nodes = falling.built.values.size  # type: ignore[union-attr]
    monkeypatch.setattr(field, "MOST_NODES", 2 * nodes)
    for audited in (True, False):
        falling.builds = 6
        falling.collider(around(mesh), audited=audited)
        assert falling.built.values.size <= 2 * nodes  # type: ignore[union-attr]
        assert falling.covers(around(mesh))


def test_offset_beyond_the_usual_reach_is_kept() -> None:
    mesh = as_mesh(trimesh.creation.icosphere(subdivisions=5, radius=0.1))
    wide = AvatarContact(mesh, ContactOptions("depth", 0.002, 0.03, 0.001, "cpu"))
    wide.collider(around(mesh))
    assert wide.report["error_mm"]["p99"] < 1.0  # sweeps on 5 mm are of first order
