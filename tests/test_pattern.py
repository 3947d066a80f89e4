"""Patterns: curves in closed form, how stitches run, darts, gathers, and the mesh that is sewn from panels."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from warp_cloth import fit
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.batch.jobs import read_jobs
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.pattern.assembly import load_pattern, sewn_mesh
from warp_cloth.pattern.curve import Curve, arc, from_edge_frame
from warp_cloth.pattern.garmentcode import read_specification
from warp_cloth.pattern.mesher import angles_of
from warp_cloth.pattern.sewing import seams_of
from warp_cloth.scene import load_scene

EDGE = 0.015  # [m]
SAME = 1e-9  # relative, of what is exact but for rounding


def panel(corners: list[list[float]], **more: Any) -> dict[str, Any]:
    """A panel of straight edges [cm]."""
    count = len(corners)
    edges = [{"endpoints": [i, (i + 1) % count]} for i in range(count)]
    return {"vertices": corners, "edges": edges, "translation": [0, 0, 0], "rotation": [0, 0, 0]} | more


def square(side: float = 30.0, **more: Any) -> dict[str, Any]:
    """Edges: 0 bottom, 1 right, 2 top, 3 left."""
    return panel([[0, 0], [side, 0], [side, side], [0, side]], **more)


def specification(panels: dict[str, Any], stitches: list[Any], units: float = 100.0) -> bytes:
    pattern = {"panels": panels, "stitches": [stitch_of(stitch) for stitch in stitches]}
    return json.dumps({"pattern": pattern, "properties": {"units_in_meter": units}}).encode()


def stitch_of(stitch: Any) -> list[Any]:
    """("a", 0, "b", 2) or ("a", 0, "b", 2, "right_wrong") as the file has it."""
    one, i, other, j, *side = stitch
    return [{"panel": one, "edge": i}, {"panel": other, "edge": j}, *side]


def sewn(panels: dict[str, Any], stitches: list[Any], edge: float = EDGE) -> Mesh:
    return sewn_mesh(read_specification("spec.json", specification(panels, stitches)), "spec", edge=edge)


def topology(mesh: Mesh) -> tuple[int, int]:
    """Loops of the boundary, and V - E + F; every edge has one or two triangles, which run along it either way."""
    sides = [(int(t[i]), int(t[(i + 1) % 3])) for t in mesh.triangles for i in range(3)]
    either = set(sides)
    assert len(either) == len(sides)
    edges = Counter(tuple(sorted(side)) for side in sides)
    assert max(edges.values()) <= 2
    follow = {b: a for a, b in sides if (b, a) not in either}
    loops = 0
    while follow:
        loops += 1
        at = next(iter(follow))
        while at in follow:
            at = follow.pop(at)
    return loops, mesh.vertex_count - len(edges) + mesh.triangle_count


def area_of(mesh: Mesh) -> float:
    assert mesh.texcoords is not None
    a, b = mesh.texcoords[:, 1] - mesh.texcoords[:, 0], mesh.texcoords[:, 2] - mesh.texcoords[:, 0]
    return float(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


@pytest.mark.parametrize(("large", "turn"), [(False, 2 * math.pi / 3), (True, 4 * math.pi / 3)])
@pytest.mark.parametrize("right", [False, True])
def test_an_arc_has_its_angle_times_its_radius_and_its_sector(large: bool, right: bool, turn: float) -> None:
    radius, ends = 0.2, np.array([[0.0, 0.0], [0.2 * math.sqrt(3), 0.0]])
    curve = arc(ends[0], ends[1], radius, large, right)
    assert curve.length == pytest.approx(radius * turn, rel=SAME)
    sign = 1.0 if right else -1.0
    assert curve.area == pytest.approx(sign * 0.5 * radius**2 * (turn - math.sin(turn)), rel=SAME)
    middle = curve.at(np.array([0.5]))[0]
    height = radius * (1 - math.cos(turn / 2))
    np.testing.assert_allclose(middle, [0.1 * math.sqrt(3), -sign * height], atol=SAME)
    assert np.linalg.norm(curve.bends(np.array([0.3]))) == pytest.approx(1 / radius, rel=SAME)


def test_a_quadratic_is_a_parabola() -> None:
    # y = a x (1 - x): control point at (1/2, a/2); length and area in closed form
    a = 0.7
    curve = Curve(np.array([[0.0, 0.0], [0.5, 0.5 * a], [1.0, 0.0]]))
    assert curve.length == pytest.approx(0.5 * math.sqrt(1 + a * a) + math.asinh(a) / (2 * a), rel=SAME)
    assert curve.area == pytest.approx(-a / 6, rel=SAME)
    np.testing.assert_allclose(curve.at(np.array([0.5])), [[0.5, a / 4]], atol=SAME)
    assert np.linalg.norm(curve.bends(np.array([0.5]))) == pytest.approx(2 * a, rel=SAME)


def test_a_cubic_whose_handles_are_a_quadratics_is_that_quadratic() -> None:
    p, q, r = np.array([0.0, 0.1]), np.array([0.3, 0.5]), np.array([0.9, -0.2])
    low, high = Curve(np.array([p, q, r])), Curve(np.array([p, p + 2 / 3 * (q - p), r + 2 / 3 * (q - r), r]))
    share = np.linspace(0, 1, 11)
    assert high.length == pytest.approx(low.length, rel=SAME)
    assert high.area == pytest.approx(low.area, rel=SAME)
    np.testing.assert_allclose(high.at(share), low.at(share), atol=SAME)


def test_a_cubic_with_a_cusp_has_the_length_of_its_polynomials() -> None:
    # x = t^3, y = t^2 (handles from its coefficients): the semicubical parabola, length in closed form
    curve = Curve(np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 1 / 3], [1.0, 1.0]]))
    assert curve.length == pytest.approx((13**1.5 - 8) / 27, rel=1e-6)  # its speed is 0 at the start


def test_control_points_are_relative_to_the_edge() -> None:
    start, end = np.array([1.0, 1.0]), np.array([1.0, 3.0])  # upwards, so that left is -x
    np.testing.assert_allclose(from_edge_frame(start, end, np.array([[0.5, 0.25]])), [[0.5, 2.0]])


def test_points_at_even_fractions_are_evenly_apart() -> None:
    curve = Curve(np.array([[0.0, 0.0], [0.0, 0.4], [0.1, 0.4], [0.5, 0.4]]))
    steps = np.hypot(*np.diff(curve.at(np.linspace(0, 1, 401)), axis=0).T)
    assert steps.max() / steps.min() < 1.001


def test_a_square_keeps_its_size_and_has_good_triangles() -> None:
    mesh = sewn({"square": square()}, [])
    assert area_of(mesh) == pytest.approx(0.09, rel=SAME)
    assert topology(mesh) == (1, 1)
    assert mesh.texcoords is not None
    assert angles_of(mesh.texcoords.reshape(-1, 2), np.arange(3 * mesh.triangle_count).reshape(-1, 3)).min() > 30


def test_the_same_file_gives_the_same_bits(tmp_path: Path) -> None:
    path = tmp_path / "a_specification.json"
    path.write_bytes(specification({"a": square(), "b": square(translation=[0, 0, 9])}, [("a", 1, "b", 1)]))
    one, other = load_pattern(path, edge=EDGE), load_pattern(path, edge=EDGE)
    assert one.points.tobytes() == other.points.tobytes()
    assert one.triangles.tobytes() == other.triangles.tobytes()


def test_a_disc_keeps_area_and_rim() -> None:
    half = {"type": "circle", "params": [20, 0, 1]}
    disc = panel([[0, 0], [40, 0]])
    for edge in disc["edges"]:
        edge["curvature"] = half
    pattern = read_specification("spec.json", specification({"disc": disc}, []))
    assert pattern.panels[0].area == pytest.approx(math.pi * 0.04, rel=SAME)
    assert area_of(sewn_mesh(pattern, "disc", edge=EDGE)) == pytest.approx(math.pi * 0.04, rel=1e-3)


def test_a_thin_panel_whose_corners_are_opened_keeps_its_area() -> None:
    # a trapezoid less the segment of a circle, whose tangent leaves both corners within a degree of the legs
    chord, inset, half, leg = 0.2, 0.04, math.radians(53), math.radians(54)
    height, radius = inset * math.tan(leg), chord / (2 * math.sin(half))
    thin = panel([[0, 0], [20, 0], [16, 100 * height], [4, 100 * height]])
    thin["edges"][0]["curvature"] = {"type": "circle", "params": [100 * radius, 0, 0]}
    mesh = sewn({"thin": thin}, [])
    area = (chord - inset) * height - radius**2 * (half - 0.5 * math.sin(2 * half))
    assert len(mesh.notes) == 2  # both corners
    assert area_of(mesh) == pytest.approx(area, rel=1e-3)


def test_panels_are_placed_by_euler_angles_about_fixed_axes() -> None:
    mesh = sewn({"a": square(translation=[10, 20, 30], rotation=[90, 0, 90])}, [])
    # about x: (x, y, 0) -> (x, 0, y); about z: -> (0, x, y)
    low, high = mesh.bounds()
    np.testing.assert_allclose(low, [0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(high, [0.1, 0.5, 0.6], atol=1e-12)


FRONT = square(translation=[0, 0, 10])
BACK = panel([[0, 0], [0, 30], [30, 30], [30, 0]], translation=[0, 0, -10])  # clockwise: it faces back


def test_front_and_back_become_a_tube() -> None:
    # BACK's edges: 0 left, upwards; 1 top; 2 right, downwards; 3 bottom
    mesh = sewn({"front": FRONT, "back": BACK}, [("front", 1, "back", 2), ("front", 3, "back", 0)])
    assert topology(mesh) == (2, 0)
    normals = np.cross(*(mesh.points[mesh.triangles[:, i]] - mesh.points[mesh.triangles[:, 0]] for i in (1, 2)))
    inner = np.ptp(mesh.points[mesh.triangles][..., 2], axis=1) == 0
    out = mesh.points[mesh.triangles][inner, 0, 2]
    assert (normals[inner, 2] * out > 0).all()  # both face outwards


def test_the_placement_decides_where_loops_do_not() -> None:
    # a back whose loop runs like the front's: its outer side is turned, and the seams must run along
    back = square(translation=[0, 0, -10])
    mesh = sewn({"front": FRONT, "back": back}, [("front", 1, "back", 1), ("front", 3, "back", 3)])
    assert topology(mesh) == (2, 0)
    pattern = read_specification("s", specification({"f": FRONT, "b": back}, [("f", 1, "b", 1), ("f", 3, "b", 3)]))
    assert [seam.reverse for seam in seams_of(pattern)] == [False, False]


def test_a_stated_side_wins_over_the_placement() -> None:
    stated = specification({"front": FRONT, "back": BACK}, [("front", 1, "back", 2, "right_wrong")])
    assert [seam.reverse for seam in seams_of(read_specification("s", stated))] == [False]


def test_a_band_sewn_to_itself_is_a_tube_and_twisted_it_is_refused() -> None:
    band = panel([[0, 0], [60, 0], [60, 6], [0, 6]])
    assert topology(sewn({"band": band}, [("band", 1, "band", 3)])) == (2, 0)
    with pytest.raises(InputError, match=r"stitch 0: twists the cloth into a one-sided \(Moebius\) band"):
        sewn({"band": band}, [("band", 1, "band", 3, "right_wrong")])


def test_a_band_of_two_panels_twisted_once_is_refused() -> None:
    stitches = [("front", 1, "back", 2), ("front", 3, "back", 0, "right_wrong")]
    with pytest.raises(InputError, match="Moebius"):
        sewn({"front": FRONT, "back": BACK}, stitches)


def test_a_band_twisted_twice_by_its_placement_is_a_tube() -> None:
    # the back is turned half round the vertical axis, so that its left is at the front's right
    back = square(translation=[30, 0, -10], rotation=[0, 180, 0])
    mesh = sewn({"front": FRONT, "back": back}, [("front", 1, "back", 3), ("front", 3, "back", 1)])
    assert topology(mesh) == (2, 0)


def test_a_dart_closes_to_a_cone() -> None:
    dart = panel([[0, 0], [30, 0], [30, 30], [17, 30], [15, 18], [13, 30], [0, 30]])
    mesh = sewn({"dart": dart}, [("dart", 3, "dart", 4)])
    assert topology(mesh) == (1, 1)
    assert area_of(mesh) == pytest.approx(0.09 - 0.5 * 0.04 * 0.12, rel=SAME)


def test_an_edge_sewn_to_itself_folds_in_the_middle() -> None:
    mesh = sewn({"square": square()}, [("square", 2, "square", 2)])
    assert topology(mesh) == (1, 1)


def test_a_cone_of_sewn_neighbours_has_no_triangle_folded_to_a_line() -> None:
    mesh = sewn({"square": square()}, [("square", 1, "square", 2)])  # round the corner between them
    assert topology(mesh) == (1, 1)


def test_two_squares_sewn_all_round_but_one_edge_are_a_bag() -> None:
    stitches = [("front", 1, "back", 2), ("front", 3, "back", 0), ("front", 0, "back", 3)]
    assert topology(sewn({"front": FRONT, "back": BACK}, stitches)) == (1, 1)


def test_four_panels_meet_in_one_vertex() -> None:
    names = {"a": (0, 0), "b": (30, 0), "c": (0, 30), "d": (30, 30)}
    panels = {name: square(translation=[x, y, 0]) for name, (x, y) in names.items()}
    mesh = sewn(panels, [("a", 1, "b", 3), ("c", 1, "d", 3), ("a", 2, "c", 0), ("b", 2, "d", 0)])
    assert topology(mesh) == (1, 1)


def test_gathers_are_spread_evenly() -> None:
    long = panel([[0, 0], [90, 0], [90, 30], [0, 30]], translation=[-30, -40, 0])
    mesh = sewn({"top": square(), "ruffle": long}, [("top", 0, "ruffle", 2)])
    assert topology(mesh) == (1, 1)
    assert mesh.texcoords is not None
    assert mesh.panels is not None
    seam = [set(mesh.triangles[mesh.panels == p].ravel().tolist()) for p in (0, 1)]
    both = sorted(seam[0] & seam[1])
    steps = []
    for p in (0, 1):
        mine = mesh.panels == p
        flat = dict(zip(mesh.triangles[mine].ravel().tolist(), mesh.texcoords[mine].reshape(-1, 2), strict=True))
        steps.append(np.diff(np.sort([flat[vertex][0] for vertex in both])))
    np.testing.assert_allclose(steps[1], 3 * steps[0], rtol=1e-6)


@pytest.mark.parametrize("flipped", [False, True])
def test_one_edge_is_sewn_to_several_that_follow_each_other(flipped: bool) -> None:
    lower = panel([[0, 0], [30, 0], [30, 30], [20, 30], [0, 30]], translation=[0, -40, 0])
    stitches = [("top", 0, "lower", 2), ("top", 0, "lower", 3)]
    mesh = sewn({"top": square(), "lower": lower}, stitches[::-1] if flipped else stitches)
    assert topology(mesh) == (1, 1)
    joined = sewn({"top": square(), "lower": square(translation=[0, -40, 0])}, [("top", 0, "lower", 2)])
    assert area_of(mesh) == pytest.approx(area_of(joined), rel=SAME)
    assert np.ptp(mesh.points[:, 0]) == pytest.approx(0.3, rel=SAME)  # nothing is pulled askew


def wedge(degrees: float) -> list[list[float]]:
    return [[0, 0], [40, 0], [40 * np.cos(np.radians(degrees)), 40 * np.sin(np.radians(degrees))]]


@pytest.mark.parametrize("outline", [*map(wedge, (26, 29, 31, 33, 36)), [[0, 0], [40, 0], [40, 0.5], [0, 0.5]]])
def test_a_corner_of_thirty_degrees_or_a_narrow_strip_has_no_sharper_triangle(outline: list[list[float]]) -> None:
    mesh = sewn({"panel": panel(outline)}, [])
    assert mesh.texcoords is not None
    corners = mesh.texcoords.reshape(-1, 2), np.arange(3 * mesh.triangle_count).reshape(-1, 3)
    assert angles_of(*corners).min() > 25


def test_edges_that_cross_at_their_corner_are_parted_and_told() -> None:
    neck = panel([[0, 0], [34, 0], [34, 31], [17, 50], [5, 55], [0, 23]])
    neck["edges"][4]["curvature"] = {"type": "circle", "params": [16.37, 0, 0]}  # crosses the shoulder by 0.4 mm
    mesh = sewn({"front": neck}, [])
    assert topology(mesh) == (1, 1)
    assert len(mesh.notes) == 1
    assert 'panel "front", edges 3 and 4 touch or cross at their corner: opened by' in mesh.notes[0]


def gore(radius: float) -> dict[str, Any]:
    """A skirt's gore whose hem is cut in by an arc [cm]; its tangent crosses the sides if the radius is under 30.3."""
    cut = panel([[0, 0], [54.5, 0], [30, 50.2], [24.5, 50.2]])
    cut["edges"][0]["curvature"] = {"type": "circle", "params": [radius, 0, 0]}
    return cut


def test_a_hem_that_crosses_both_sides_for_a_hands_breadth_is_parted_and_told() -> None:
    mesh = sewn({"gore": gore(29.0)}, [])  # by 6 degrees, over 6 cm
    assert topology(mesh) == (1, 1)
    assert [note.rpartition("opened by")[2] for note in mesh.notes] == [" up to 2.2 mm", " up to 2.2 mm"]
    area = read_specification("s", specification({"gore": gore(29.0)}, [])).panels[0].area
    assert area_of(mesh) == pytest.approx(area, rel=1e-3)
    with pytest.raises(InputError, match="crosses or touches itself"):
        sewn({"gore": gore(27.6)}, [])  # by 17 degrees


def test_a_scene_takes_a_pattern(tmp_path: Path) -> None:
    (tmp_path / "bag_specification.json").write_bytes(specification({"front": FRONT}, []))
    scene = load_scene({"garment": {"pattern": str(tmp_path / "bag_specification.json")}})
    assert scene.garments[0].name == "bag"
    assert scene.garments[0].edge == EDGE


def test_a_pattern_is_fitted_and_keeps_its_panels(tmp_path: Path) -> None:
    path = tmp_path / "tube_specification.json"
    path.write_bytes(specification({"front": FRONT, "back": BACK}, [("front", 1, "back", 2), ("front", 3, "back", 0)]))
    garment = {"pattern": str(path), "edge_mm": 30, "pin": {"loop": "top"}}
    result = fit({"garment": garment, "solver": {"iterations": 300}}, device="cpu")
    worn = result.garments[0]
    assert worn.name == "tube"
    # hung by its upper edge: its two flat sides, which start 20 cm apart, are drawn together
    free = worn.points[worn.points[:, 1] < 0.1]
    assert np.ptp(free[:, 2]) < 0.19
    paths = result.save(tmp_path / "out")
    stage = Usd.Stage.Open(str(next(each for each in paths if each.suffix == ".usdc")))
    subsets = [prim.GetName() for prim in stage.Traverse() if prim.IsA(UsdGeom.Subset)]
    assert {"front", "back"} <= set(subsets)


def test_a_product_takes_a_folder_of_patterns(tmp_path: Path) -> None:
    (tmp_path / "specs").mkdir()
    for name in ("b", "a"):
        (tmp_path / "specs" / f"{name}_specification.json").write_bytes(specification({"front": FRONT}, []))
    jobs = tmp_path / "jobs.toml"
    jobs.write_text('scene = "tshirt"\n[product]\ngarments = ["specs/*.json"]\nfabrics = ["denim"]\n')
    items = read_jobs(jobs)
    assert [item.name for item in items] == ["a-denim", "b-denim"]
    assert f"garment.pattern={tmp_path / 'specs' / 'a_specification.json'}" in items[0].changes
    jobs.write_text('scene = "tshirt"\n[product]\ngarments = ["none/*.json"]\n')
    with pytest.raises(InputError, match='no file fits "none/'):
        read_jobs(jobs)


def test_a_pattern_is_worn_on_a_body(tmp_path: Path) -> None:
    (tmp_path / "bag_specification.json").write_bytes(specification({"front": FRONT}, []))
    scene = load_scene(tmp_path / "bag_specification.json", on="mannequin", fabric="denim")
    assert scene.name == scene.garments[0].name == "bag"
    assert scene.garments[0].pattern == tmp_path / "bag_specification.json"


def test_a_pattern_is_placed_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "bag_specification.json"
    path.write_bytes(specification({"front": FRONT}, []))
    plain, moved = (
        load_outfit(load_scene({"garment": {"pattern": str(path), **more}}))
        for more in ({}, {"translate": [1, 0, 0], "scale": 2})
    )
    np.testing.assert_allclose(moved.meshes[0].points, 2 * plain.meshes[0].points + [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(moved.garments[0].rest.edge_length, 2 * plain.garments[0].rest.edge_length)


def test_set_of_a_pattern_replaces_mesh_or_shape_and_the_reverse() -> None:
    for garment in ({"shape": {"kind": "tshirt"}}, {"mesh": "a.obj", "units": "cm"}):
        scene = load_scene({"garment": garment}, ["garment.pattern=b.json", "garment.edge_mm=10"])
        assert str(scene.garments[0].file) == "b.json"
        assert scene.garments[0].edge == pytest.approx(0.01)
    assert (
        load_scene({"garment": {"pattern": "b.json", "edge_mm": 9}}, ["garment.mesh=a.obj"]).garments[0].edge_mm is None
    )


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"mesh": "a.obj", "pattern": "b.json"}, "mesh and pattern are both given"),
        ({"pattern": "b.json", "units": "cm"}, "units is for a mesh file, but a pattern is given"),
        ({"shape": {"kind": "square"}, "edge_mm": 12}, "edge_mm is for a mesh or a pattern"),
        ({"pattern": "b.json", "rest": "mesh"}, "a pattern is its own rest shape"),
        ({}, "neither mesh nor pattern nor shape is given"),
    ],
)
def test_keys_that_do_not_go_together_are_refused(keys: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_scene({"garment": keys})
