"""What loading repairs: the mesh that comes out, the maps back to the file, and the note that says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from cloths import tube
from meshfiles import obj_text

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.loading import load_mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
TRIANGLES = "f 1 2 3\nf 1 3 4\n"


def load(tmp_path: Path, text: str, role: str = "garment", **options: object) -> Mesh:
    path = tmp_path / "mesh.obj"
    path.write_text(text)
    return load_mesh(path, role=role, key=role, units="m", **options)  # type: ignore[arg-type]


def grid(count: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """A square metre of count x count vertices."""
    x, y = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1, count))
    index = np.arange(count * count).reshape(count, count)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3)
    return np.stack([x.ravel(), y.ravel(), np.zeros(count * count)], 1), triangles


@pytest.mark.parametrize("layers", [2, 3])
def test_layers_that_share_a_whole_ring_are_read_and_their_rims_found(tmp_path: Path, layers: int) -> None:
    """A tutu, whose three skirts hang from the lower edge of one waistband, was refused."""
    band, around, rows = tube(0.1, 1.0, 1.05, 12, 2), 12, 4
    points, faces = [band.points], [band.triangles]
    for layer in range(layers):
        skirt = tube(0.1, 0.7, 1.0, around, rows)
        low = skirt.points[: (rows - 1) * around] * [1.0 + 0.1 * layer, 1.0, 1.0 + 0.1 * layer]
        first = sum(map(len, points))
        number = np.concatenate([first + np.arange(len(low)), np.arange(around)])  # its top is the band's lower edge
        points.append(low)
        faces.append(number[skirt.triangles])
    mesh = load(tmp_path, obj_text(np.concatenate(points), np.concatenate(faces)))
    topology = build_topology(mesh.triangles, mesh.vertex_count)
    assert edge_use(mesh)[0].max() == 1 + layers
    assert [len(loop) for loop in topology.boundary_loops] == [around] * (1 + layers)


def test_a_fin_is_refused_where_the_sheet_goes_round_its_end(tmp_path: Path) -> None:
    points, faces = grid()
    fin, standing = grid()
    fin = np.concatenate([fin[:, [0, 2, 1]] + [0.0, 0.5, 0.0]])[5:]  # its lowest row is the sheet's middle one
    number = np.concatenate([10 + np.arange(5), len(points) + np.arange(len(fin))])
    both = np.concatenate([points, fin]), np.concatenate([faces, number[standing]])
    assert load(tmp_path, obj_text(*both)).triangle_count == 2 * len(faces)  # across: 3 sheets meet
    part = number[standing][(number[standing] != 14).all(axis=1)]  # ends within it
    with pytest.raises(InputError, match="has 3 faces"):
        load(tmp_path, obj_text(both[0], np.concatenate([faces, part])))


def edge_use(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """How often each edge stands in the triangles: whichever way it runs, and in one direction."""
    edges = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    both = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)[1]
    return both, np.unique(edges, axis=0, return_counts=True)[1]


def noted(mesh: Mesh, *words: str) -> bool:
    return any(all(word in note for word in words) for note in mesh.notes)


def test_sound_mesh_is_left_as_it_is(tmp_path: Path) -> None:
    points, triangles = grid()
    mesh = load(tmp_path, obj_text(points, triangles))
    np.testing.assert_array_equal(mesh.points, points)
    np.testing.assert_array_equal(mesh.triangles, triangles)
    assert mesh.notes == ()
    assert mesh.vertex_map is None
    assert mesh.triangle_source is None


def test_repeated_index_triangle_is_dropped(tmp_path: Path) -> None:
    mesh = load(tmp_path, SQUARE + "f 1 2 3\nf 2 2 3\nf 1 3 4\n")
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.triangle_source.tolist() == [0, 2]
    assert noted(mesh, "1 triangle that repeat")


def test_needle_is_dropped_at_any_scale(tmp_path: Path) -> None:
    for scale in (0.02, 1.0, 10.0):
        corners = ((0, 0), (1, 0), (0.5, 0), (0.5, 1))
        text = "".join(f"v {x * scale} {y * scale} 0\n" for x, y in corners)
        path = tmp_path / "needle.obj"
        path.write_text(text + "f 1 2 3\nf 1 3 4\nf 3 2 4\n")
        mesh = load_mesh(path, role="garment", key="garment", units="m")
        assert mesh.triangle_count == 2
        assert noted(mesh, "1 triangle without area dropped")


def test_triangle_collapsed_in_space_is_kept_for_its_area_in_texture_space(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 2 2\n"
    text += "f 1/1 2/2 4/4\nf 1/1 2/2 3/3\n"
    kept = load(tmp_path, text, rest="uv")
    assert kept.triangle_count == 2
    assert kept.vertex_count == 4
    assert load(tmp_path, text, rest="mesh").triangle_count == 1
    flat = text.replace("vt 1 1", "vt 0.5 0")
    assert load(tmp_path, flat, rest="uv").triangle_count == 1


def test_duplicate_faces_are_dropped_whatever_their_winding(tmp_path: Path) -> None:
    mesh = load(tmp_path, SQUARE + TRIANGLES + "f 2 3 1\nf 4 3 1\n")
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert noted(mesh, "2 duplicate triangles dropped")
    quads = load(tmp_path, SQUARE + "f 1 2 3 4\nf 2 3 4 1\nf 4 3 2 1\n")
    assert quads.triangle_count == 2
    assert noted(quads, "2 duplicate polygons dropped")


def test_flipped_winding_is_made_consistent_with_the_majority(tmp_path: Path) -> None:
    points, triangles = grid(7)
    mixed = triangles.copy()
    flipped = np.random.default_rng(1).permutation(len(mixed))[: len(mixed) // 3]
    mixed[flipped] = mixed[flipped, ::-1]
    mesh = load(tmp_path, obj_text(points, mixed))
    assert edge_use(mesh)[1].max() == 1
    turned = np.cross(points[mesh.triangles[:, 1]] - points[mesh.triangles[:, 0]], [0, 0, 1.0])
    assert (np.einsum("ij,ij->i", turned, points[mesh.triangles[:, 2]] - points[mesh.triangles[:, 0]]) < 0).all()
    assert noted(mesh, f"winding of {len(flipped)} triangles")


def test_flipping_turns_texture_coordinates_with_the_corners(tmp_path: Path) -> None:
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 4/4 3/3 1/1\n"
    mesh = load(tmp_path, text)
    assert mesh.texcoords is not None
    np.testing.assert_array_equal(mesh.texcoords, mesh.points[mesh.triangles][:, :, :2])


def test_moebius_strip_ends_and_says_so(tmp_path: Path) -> None:
    count = 12
    text = "".join(f"v {np.cos(a)} {z} {np.sin(a)}\n" for a in np.arange(count) * 2 * np.pi / count for z in (0, 0.5))
    text += "".join(f"f {2 * i + 1} {2 * i + 2} {2 * i + 4} {2 * i + 3}\n" for i in range(count - 1))
    text += f"f {2 * count - 1} {2 * count} 1 2\n"
    mesh = load(tmp_path, text)
    assert mesh.triangle_count == 2 * count
    assert noted(mesh, "one-sided")


def test_isolated_vertices_are_dropped_with_a_map(tmp_path: Path) -> None:
    mesh = load(tmp_path, "v 9 9 9\n" + SQUARE + "v 5 5 5\nf 2 3 4\nf 2 4 5\n")
    assert mesh.vertex_count == 4
    assert mesh.vertex_map.tolist() == [-1, 0, 1, 2, 3, -1]
    assert noted(mesh, "2 isolated vertices dropped")


@pytest.mark.parametrize(
    ("polygon", "area"),
    [
        ([(0, 0), (1, 0), (1, 1), (0, 1)], 1.0),
        ([(0, 0), (1, 0), (0.2, 0.2), (0, 1)], 0.2),  # an arrowhead: the diagonal 0-2 alone is inside
        ([(1, 0), (0.2, 0.2), (0, 1), (0, 0)], 0.2),  # the same, where 1-3 is
        ([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 3.0),
        ([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], 7.0),
        ([(np.cos(a), np.sin(a)) for a in np.arange(9) * 2 * np.pi / 9], 4.5 * np.sin(2 * np.pi / 9)),
    ],
)
def test_polygon_becomes_triangles_of_the_same_area(tmp_path: Path, polygon: list, area: float) -> None:
    text = "".join(f"v {x} {y} {0.3 * x - 0.2 * y}\n" for x, y in polygon)
    mesh = load(tmp_path, text + "f " + " ".join(str(i + 1) for i in range(len(polygon))) + "\n")
    a, b, c = np.moveaxis(mesh.points[mesh.triangles][:, :, :2], 1, 0)
    signed = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert mesh.triangle_count == len(polygon) - 2
    assert (signed > 0).all()
    assert signed.sum() == pytest.approx(area)
    assert mesh.triangle_source is not None
    assert (mesh.triangle_source == 0).all()
    assert noted(mesh, "cut into triangles")


def test_quad_that_repeats_a_vertex_is_a_triangle(tmp_path: Path) -> None:
    mesh = load(tmp_path, SQUARE + "f 1 2 2 3\nf 1 3 4 1\nf 1 2 1 2\n")
    assert sorted(map(sorted, mesh.triangles.tolist())) == [[0, 1, 2], [0, 2, 3]]
    assert noted(mesh, "polygons that repeat a vertex")


def unwelded(points: np.ndarray, triangles: np.ndarray) -> str:
    return obj_text(points[triangles].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def test_unwelded_mesh_is_welded_with_a_map(tmp_path: Path) -> None:
    points, triangles = grid()
    mesh = load(tmp_path, unwelded(points, triangles))
    assert mesh.vertex_count == len(points)
    assert mesh.triangle_count == len(triangles)
    assert edge_use(mesh)[0].max() == 2
    assert mesh.vertex_map is not None
    np.testing.assert_array_equal(mesh.points[mesh.vertex_map], points[triangles].reshape(-1, 3))
    assert noted(mesh, f"{3 * len(triangles) - len(points)} vertices welded")


def test_mesh_cut_at_a_seam_is_welded_there(tmp_path: Path) -> None:
    points, triangles = grid()
    right = points[triangles][:, :, 0].mean(axis=1) > 0.5
    doubled = np.where(right[:, None], triangles + len(points), triangles)
    mesh = load(tmp_path, obj_text(np.concatenate([points, points]), doubled))
    assert mesh.vertex_count == len(points)
    assert edge_use(mesh)[0].max() == 2
    assert (edge_use(mesh)[0] == 1).sum() == 16


def test_collapsed_triangle_leaves_no_slit(tmp_path: Path) -> None:
    """Two vertices at one place, with a triangle between them: dropping it joins its two long sides."""
    text = "v 0 0 0\nv 1 0 0\nv 0.5 1 0\nv 0.5 1 0\nv 0 2 0\nv 1 2 0\nf 1 2 3\nf 1 3 4\nf 1 4 5\nf 3 2 6\n"
    mesh = load(tmp_path, text)
    assert mesh.triangle_count == 3
    assert (edge_use(mesh)[0] == 2).sum() == 2


@pytest.mark.parametrize(("apart", "joined"), [(1e-6, True), (5e-5, True), (2e-3, False)])
def test_a_seam_that_rounding_opened_is_closed_and_an_open_one_told_of(
    tmp_path: Path, apart: float, joined: bool
) -> None:
    points, triangles = grid(5)
    right = points + np.array([1.0 + apart, 0.0, 0.0])
    both = np.concatenate([triangles, triangles + len(points)])
    mesh = load(tmp_path, obj_text(np.concatenate([points, right]), both))
    assert mesh.vertex_count == 2 * len(points) - (5 if joined else 0)
    assert noted(mesh, "5 vertices welded to others up to" if joined else "2 separate pieces")


def test_facets_of_a_body_that_rounding_parted_are_joined(tmp_path: Path) -> None:
    """A file with few digits: no facet had a neighbour, and the body no limbs."""
    shape = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
    corners = np.round(shape.triangles.reshape(-1, 3) + np.random.default_rng(0).normal(size=3) * 1e-3, 6)
    corners += np.random.default_rng(1).choice([-5e-6, 5e-6], size=corners.shape)
    mesh = load(tmp_path, obj_text(corners, np.arange(len(corners)).reshape(-1, 3)), role="avatar")
    assert mesh.vertex_count == len(shape.vertices)
    assert edge_use(mesh)[0].min() == 2


def test_unwelded_duplicate_facets_are_dropped(tmp_path: Path) -> None:
    points, triangles = grid(4)
    mesh = load(tmp_path, unwelded(points, np.concatenate([triangles, triangles[:5, ::-1]])))
    assert mesh.vertex_count == len(points)
    assert mesh.triangle_count == len(triangles)
    assert noted(mesh, "5 duplicate triangles dropped")


def test_a_sheet_and_its_copy_are_one(tmp_path: Path) -> None:
    """With the winding of its back, its own order of vertices and faces, and whatever seams it has."""
    points, triangles = grid()
    order = np.random.default_rng(3).permutation(len(points))
    back = np.argsort(order)[triangles[::-1, ::-1]] + len(points)
    mesh = load(tmp_path, obj_text(np.concatenate([points, points[order]]), np.concatenate([triangles, back])))
    assert mesh.vertex_count == len(points)
    assert mesh.triangle_count == len(triangles)
    assert mesh.vertex_map is not None
    assert (mesh.points[mesh.vertex_map[len(points) :]] == points[order]).all()
    assert noted(mesh, "25 vertices welded")
    assert noted(mesh, "32 duplicate triangles dropped")


def test_two_panels_at_one_place_are_no_copies(tmp_path: Path) -> None:
    """They differ in texture space, where each has its own place."""
    points, triangles = grid(3)
    count = len(points)
    lines = [f"v {x} {y} {z}" for x, y, z in [*points, *points]]
    lines += [f"vt {x + shift} {y}" for shift in (0.0, 2.0) for x, y, _ in points]
    both = np.concatenate([triangles, triangles + count]) + 1
    lines += ["f " + " ".join(f"{corner}/{corner}" for corner in face) for face in both]
    mesh = load(tmp_path, "\n".join(lines) + "\n")
    assert mesh.triangle_count == 2 * len(triangles)


def test_a_sheet_that_lies_on_part_of_another_stays_a_layer(tmp_path: Path) -> None:
    points, triangles = grid()
    more = np.concatenate([points, points, [[3.0, 5.0, 1.0]]])
    both = np.concatenate([triangles, triangles + len(points), [[len(points), len(points) + 1, len(more) - 1]]])
    mesh = load(tmp_path, obj_text(more, both))
    assert mesh.vertex_count == len(more)
    assert mesh.vertex_map is None
    assert edge_use(mesh)[0].max() == 2
    assert noted(mesh, "25 vertices", "not welded")
    assert noted(mesh, "64 triangles coincide with others", "twice as heavy", "remove one")


def test_parts_that_touch_stay_apart(tmp_path: Path) -> None:
    """At a point; and at an edge that runs through the middle of one of them."""
    points, triangles = grid(3)
    moved = points + np.array([1, 1, 0])
    mesh = load(tmp_path, obj_text(np.concatenate([points, moved]), np.concatenate([triangles, triangles + 9])))
    assert mesh.vertex_count == 18
    upright = points[:, [2, 1, 0]] + np.array([0.5, 0, 0])
    mesh = load(tmp_path, obj_text(np.concatenate([points, upright]), np.concatenate([triangles, triangles + 9])))
    assert mesh.vertex_count == 18
    assert edge_use(mesh)[0].max() == 2


def test_panels_with_a_common_outline_edge_are_sewn(tmp_path: Path) -> None:
    points, triangles = grid(3)
    side = points + np.array([1, 0, 0])
    mesh = load(tmp_path, obj_text(np.concatenate([points, side]), np.concatenate([triangles, triangles + 9])))
    assert mesh.vertex_count == 15


def two_panels(*, sewn: bool, shift: float = 1.03, turn: float = 1.0) -> str:
    """Two panels whose sides coincide all along and, if ``sewn``, share their lower three vertices of five.

    In texture space the second lies at ``shift`` along u; ``turn`` -1 mirrors it.
    """
    points, triangles = grid(5)
    other = triangles + len(points)
    for row in range(3 if sewn else 0):
        other = np.where(other == len(points) + 5 * row, 5 * row + 4, other)
    flat = np.concatenate([points[triangles], points[triangles] * [turn, 1.0, 1.0] + [shift, 0.0, 0.0]])
    both = np.concatenate([points, points + np.eye(3)[0]])
    return obj_text(both, np.concatenate([triangles, other]), flat[:, :, :2])


@pytest.mark.parametrize(("shift", "turn"), [(1.03, 1.0), (1.0, -1.0)])
def test_an_opening_between_panels_that_are_sewn_elsewhere_stays_open(
    tmp_path: Path, shift: float, turn: float
) -> None:
    """As the fronts of a jacket, which meet without being joined; panels apart, or on each other."""
    open_ = load(tmp_path, two_panels(sewn=True, shift=shift, turn=turn))
    assert open_.vertex_count == 47
    assert noted(open_, "2 vertices at the same place as others not welded: openings")
    closed = load(tmp_path, two_panels(sewn=False, shift=shift, turn=turn))
    assert closed.vertex_count == 45
    assert noted(closed, "5 vertices welded")


def test_a_cut_within_one_panel_is_closed(tmp_path: Path) -> None:
    """Its sides meet in texture space, too: the file gives faces vertices of their own for reasons of its own."""
    assert load(tmp_path, two_panels(sewn=True, shift=1.0)).vertex_count == 45


def test_inside_out_avatar_is_turned_outwards(tmp_path: Path) -> None:
    points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    outwards = load(tmp_path, points + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", role="avatar")
    inwards = load(tmp_path, points + "f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n", role="avatar")
    for mesh in (outwards, inwards):
        a, b, c = np.moveaxis(mesh.points[mesh.triangles], 1, 0)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(1 / 6)
    assert noted(inwards, "inside-out closed parts flipped")


def test_texture_coordinates_with_gaps_are_left_out(tmp_path: Path) -> None:
    mesh = load(tmp_path, SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1 3 4\n")
    assert mesh.texcoords is None
    assert noted(mesh, "texture coordinates ignored")
    mesh = load(tmp_path, SQUARE + "vt 0 0\nvt nan 0\nvt 1 1\nf 1/1 2/2 3/3\n")
    assert mesh.texcoords is None


def test_everything_at_once(tmp_path: Path) -> None:
    text = SQUARE + "v 3 3 3\nf 1 2 3 4\nf 1 2 3 4\nf 1 1 2\nv 2 0 0\nv 2 1 0\nf 2 3 7 6\nf 6 7 6\n"
    mesh = load(tmp_path, text)
    assert mesh.triangle_count == 4
    assert mesh.vertex_count == 6
    assert edge_use(mesh)[1].max() == 1
    assert len(mesh.notes) == 5


def test_a_third_layer_on_an_indexed_edge_is_still_refused_after_repairs(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="3 faces"):
        load(tmp_path, SQUARE + "v 0 0 1\n" + TRIANGLES + "f 1 2 2\nf 1 3 5\n")


def test_a_garment_without_opening_is_told_of(tmp_path: Path) -> None:
    faces = ["f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4"]
    points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    closed = points + "\n".join(faces)
    assert noted(load(tmp_path, closed), "a closed surface")
    assert not noted(load(tmp_path, closed, role="avatar"), "a closed surface")
    assert not noted(load(tmp_path, points + "\n".join(faces[1:])), "a closed surface")
