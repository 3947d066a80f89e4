"""A garment whose file says too little is read so that limbs pass through its openings: unit, up axis, turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cloths import tube
from meshfiles import write_obj, write_panels

from warp_cloth.anatomy.openings import ARMS, LEGS, OPEN, limbs_for
from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.units import BodyUp
from warp_cloth.garment.front import CERTAIN, front_of
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.garment.reading import stand_up
from warp_cloth.loading import Placement, with_y_up
from warp_cloth.scene import AvatarSpec, load_scene
from warp_cloth.shapes import SIZE_BODIES, mannequin

INCH = 0.0254
TROUSERS = Path(__file__).parents[1] / "scenes" / "trousers.json"
TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # by 90 degrees about y
Move = Callable[[np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def tshirt() -> Mesh:
    return load_outfit(load_scene("tshirt", ("garment.shape.edge_mm=30",))).meshes[0]


def read(folder: Path, mesh: Mesh, move: Move, scale: float = 1.0, **keys: Any) -> Outfit:
    """The outfit of a scene with the mesh's file, moved, and its panels scaled."""
    path = write_panels(folder / "shirt.obj", move(mesh.points), mesh, scale)
    garment = {"mesh": str(path), **keys}
    return load_outfit(load_scene({"garment": garment, "avatar": {"shape": {"kind": "mannequin"}}}))


def choices(outfit: Outfit) -> dict[str, Any]:
    return {choice.key.removeprefix("garment."): choice.value for choice in outfit.readings}


@pytest.mark.parametrize(
    ("move", "scale", "read_as"),
    [
        (lambda points: points, 1.0, {}),
        (lambda points: 100.0 * points, 100.0, {}),  # centimetres are guessed from the size alone
        (lambda points: points / INCH, 1.0 / INCH, {"units": "in"}),
        (lambda points: points[:, [0, 2, 1]] * [1.0, -1.0, 1.0], 1.0, {"up": "z"}),
        (lambda points: points[:, [0, 2, 1]] * [1.0, -1.0, 1.0] / INCH, 1.0 / INCH, {"units": "in", "up": "z"}),
    ],
)
def test_the_unit_and_the_up_axis_are_those_in_which_limbs_pass_through(
    tmp_path: Path, tshirt: Mesh, move: Move, scale: float, read_as: dict[str, Any]
) -> None:
    outfit = read(tmp_path, tshirt, move, scale)
    assert choices(outfit) == read_as
    assert outfit.meshes[0].points == pytest.approx(tshirt.points, abs=1e-4)
    assert outfit.garments[0].rest.edge_length.sum() == pytest.approx(
        read(tmp_path, tshirt, lambda points: points).garments[0].rest.edge_length.sum(), rel=1e-4
    )


@pytest.mark.parametrize(("scale", "read_as"), [(1.0, {}), (100.0, {}), (1.0 / INCH, {"units": "in"})])
def test_what_has_no_openings_is_read_in_the_unit_in_which_it_lies_on_the_skin(
    tmp_path: Path, scale: float, read_as: dict[str, Any]
) -> None:
    """A mitten of 10 inches was read in centimetres, and worn by a leg."""
    body = mannequin(SIZE_BODIES["M"])
    out = body.points[:, 0]
    hand = (out > out.max() - 0.2)[body.triangles].all(axis=1)
    used, corners = np.unique(body.triangles[hand], return_inverse=True)
    write_obj(tmp_path / "mitten.obj", scale * body.points[used], corners.reshape(-1, 3))
    garment = {"mesh": str(tmp_path / "mitten.obj")}
    outfit = load_outfit(load_scene({"garment": garment, "avatar": {"shape": {"kind": "mannequin"}}}))
    assert outfit.wearing == (None,)
    assert choices(outfit) == read_as
    assert np.ptp(outfit.meshes[0].points[:, 0]) == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize("quarters", [1, 3])
def test_a_garment_that_is_turned_is_turned_back_with_its_front_before(
    tmp_path: Path, tshirt: Mesh, quarters: int
) -> None:
    turn = np.linalg.matrix_power(TURN, quarters)
    outfit = read(tmp_path, tshirt, lambda points: points @ turn.T)
    assert set(choices(outfit)) == {"rotate", "translate"}
    (wearing,) = outfit.wearing
    assert wearing is not None
    assert not wearing.start_fault
    assert outfit.meshes[0].points == pytest.approx(tshirt.points, abs=0.06)  # round the body, not round the origin


@pytest.mark.parametrize("quarters", [1, 3])
def test_a_sleeveless_garment_that_is_turned_is_not_stood_up(tmp_path: Path, tshirt: Mesh, quarters: int) -> None:
    """As read an opening is for no limb; lying about its wearer's feet each would be for one."""
    is_trunk = np.isin(tshirt.panels, [0, 1])
    used, corners = np.unique(tshirt.triangles[is_trunk], return_inverse=True)
    turn, texcoords = np.linalg.matrix_power(TURN, quarters), tshirt.texcoords[is_trunk]
    vest = replace(
        tshirt,
        points=tshirt.points[used],
        triangles=corners.reshape(-1, 3).astype(np.int32),
        texcoords=texcoords,
        panels=tshirt.panels[is_trunk],
    )
    outfit = read(tmp_path, vest, lambda points: points @ turn.T)
    assert set(choices(outfit)) == {"rotate", "translate"}
    assert outfit.meshes[0].points == pytest.approx(vest.points, abs=0.06)


@pytest.mark.parametrize("degrees", [34.0, -50.0])
def test_a_garment_askew_is_turned_about_the_axis_of_its_file(tmp_path: Path, tshirt: Mesh, degrees: float) -> None:
    """As a body may have been scanned."""
    outfit = read(tmp_path, tshirt, Placement(rotate=(0.0, degrees, 0.0)).moved)
    assert set(choices(outfit)) == {"rotate"}
    (wearing,) = outfit.wearing
    assert wearing is not None
    assert not wearing.start_fault
    assert outfit.meshes[0].points == pytest.approx(tshirt.points, abs=0.01)


@pytest.mark.parametrize(
    "garment", [{"shape": {"kind": "tshirt", "edge_mm": 30}}, {"pattern": str(TROUSERS), "edge_mm": 30}]
)
def test_a_drafted_garment_is_brought_to_a_body_that_stands_elsewhere(tmp_path: Path, garment: dict[str, Any]) -> None:
    """As it is to one that stands where it was drafted."""
    body = mannequin(SIZE_BODIES["M"])

    def outfit_on(turn: Placement, **stated: Any) -> Outfit:
        write_obj(tmp_path / "body.obj", turn.moved(body.points), body.triangles)
        avatar = {"mesh": str(tmp_path / "body.obj")}
        return load_outfit(load_scene({"garment": {**garment, **stated}, "avatar": avatar}))

    here, turn = outfit_on(Placement()), Placement(rotate=(0.0, 130.0, 0.0), translate=(3.0, 0.7, -2.0))
    there = outfit_on(turn)
    assert not here.readings
    assert set(choices(there)) == {"rotate", "translate"}
    assert there.meshes[0].points == pytest.approx(turn.moved(here.meshes[0].points), abs=0.03)
    assert not outfit_on(Placement(rotate=(0.0, 130.0, 0.0)), rotate=[0.0, 0.0, 0.0]).readings


def test_a_mesh_too_far_from_its_body_is_brought_to_it(tmp_path: Path, tshirt: Mesh) -> None:
    """Where no unit brings it there; one whose place is stated is refused."""
    body, turn = mannequin(SIZE_BODIES["M"]), Placement(rotate=(0.0, 130.0, 0.0), translate=(8.0, 0.7, -2.0))
    write_obj(tmp_path / "body.obj", turn.moved(body.points), body.triangles)
    path = write_panels(tmp_path / "shirt.obj", tshirt.points + np.array([0.4, 0.0, 0.7]), tshirt, 1.0)
    outfit = load_outfit(load_scene(path, on=tmp_path / "body.obj"))
    assert set(choices(outfit)) == {"rotate", "translate"}
    assert outfit.meshes[0].points == pytest.approx(turn.moved(tshirt.points), abs=0.05)
    with pytest.raises(InputError, match="away from the avatar"):
        load_outfit(load_scene(path, {"garment.translate": [0.0, 0.0, 0.01]}, on=tmp_path / "body.obj"))


@pytest.mark.parametrize("away", [1.0, 3.0])
def test_a_garment_with_z_up_beside_the_body_is_stood_up_and_brought_to_it(
    tmp_path: Path, tshirt: Mesh, away: float
) -> None:
    outfit = read(
        tmp_path, tshirt, lambda points: (points + np.array([away, 0.0, 0.0]))[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    )
    assert set(choices(outfit)) == {"up", "translate"}
    assert outfit.meshes[0].points == pytest.approx(tshirt.points, abs=0.05)


@pytest.mark.parametrize("faces_away", [False, True])
def test_a_garment_on_who_faces_away_is_turned_unless_its_front_is_there(
    tmp_path: Path, tshirt: Mesh, faces_away: bool
) -> None:
    body, half = mannequin(SIZE_BODIES["M"]), np.array([-1.0, 1.0, -1.0])
    write_obj(tmp_path / "body.obj", body.points * half, body.triangles)
    path = write_panels(tmp_path / "shirt.obj", tshirt.points * (half if faces_away else 1.0), tshirt, 1.0)
    outfit = load_outfit(load_scene(path, on=tmp_path / "body.obj"))
    assert choices(outfit) == ({} if faces_away else {"rotate": (0.0, 180.0, 0.0)})


def test_a_garment_is_turned_about_the_body_where_that_stands_apart(tmp_path: Path, tshirt: Mesh) -> None:
    body, aside = mannequin(SIZE_BODIES["M"]), np.array([0.5, 0.0, 0.3])
    write_obj(tmp_path / "body.obj", body.points + aside, body.triangles)
    turned = Placement(rotate=(0.0, 34.0, 0.0)).moved(tshirt.points) + aside
    path = write_panels(tmp_path / "shirt.obj", turned, tshirt, 1.0)
    outfit = load_outfit(load_scene(path, on=tmp_path / "body.obj"))
    assert set(choices(outfit)) == {"rotate", "translate"}
    assert outfit.meshes[0].points == pytest.approx(tshirt.points + aside, abs=0.05)


def test_a_top_with_one_sleeve_is_turned_onto_every_limb(tmp_path: Path, tshirt: Mesh) -> None:
    middles = tshirt.points[tshirt.triangles].mean(axis=1)
    kept = middles[:, 0] < 0.22  # without the left sleeve
    cut = replace(tshirt, triangles=tshirt.triangles[kept], texcoords=tshirt.texcoords[kept])  # type: ignore[index]
    assert not choices(read(tmp_path, cut, lambda points: points))
    outfit = read(tmp_path, cut, lambda points: points @ TURN.T)
    assert set(choices(outfit)) == {"rotate", "translate"}
    (wearing,) = outfit.wearing
    assert wearing is not None
    assert not wearing.start_fault


@pytest.mark.parametrize(("cut", "turns"), [(1.0, True), (0.0, False)])
def test_a_garment_that_is_back_to_front_is_turned_where_its_cut_tells(
    tmp_path: Path, tshirt: Mesh, cut: float, turns: bool
) -> None:
    """With a low neckline, and wider in front at the waist; as the T-shirt is, that is only doubted."""
    half = np.array([-1.0, 1.0, -1.0])
    front = tshirt.points[:, 2] > tshirt.points[:, 2].mean()
    assert tshirt.texcoords is not None
    points, texcoords = tshirt.points.copy(), tshirt.texcoords.copy()
    low = front & (np.abs(points[:, 0]) < 0.12) & (points[:, 1] > points[:, 1].max() - 0.2)
    points[low, 1] -= 0.15 * cut
    texcoords[front[tshirt.triangles].all(axis=1), :, 0] *= 1.0 + 0.3 * cut
    outfit = read(tmp_path, replace(tshirt, points=points, texcoords=texcoords), lambda points: points * half)
    assert choices(outfit) == ({"rotate": (0.0, 180.0, 0.0)} if turns else {})
    assert outfit.meshes[0].points == pytest.approx(points * (1.0 if turns else half), abs=1e-6)
    assert any("back to front" in note for note in outfit.meshes[0].notes) == (not turns)


def test_a_jacket_that_is_open_in_front_is_not_thought_back_to_front(tmp_path: Path, tshirt: Mesh) -> None:
    """Its one opening runs from neck to hem, and on average far lower behind, where it is the hem alone."""
    middles = tshirt.points[tshirt.triangles].mean(axis=1)
    kept = (np.abs(middles[:, 0]) > 0.03) | (middles[:, 2] < tshirt.points[:, 2].mean())
    assert tshirt.texcoords is not None
    jacket = replace(tshirt, triangles=tshirt.triangles[kept], texcoords=tshirt.texcoords[kept])
    outfit = read(tmp_path, jacket, lambda points: points)
    (wearing,) = outfit.wearing
    assert wearing is not None
    assert OPEN in wearing.limbs
    assert not choices(outfit)
    assert not any("back to front" in note for note in outfit.meshes[0].notes)


def test_panels_names_tell_the_front(tmp_path: Path, tshirt: Mesh) -> None:
    half = np.array([-1.0, 1.0, -1.0])
    named = replace(tshirt, points=tshirt.points * half)
    outfit = read(tmp_path, named, lambda points: points)
    (wearing,) = outfit.wearing
    assert wearing is not None
    areas = np.ones(len(named.triangles))
    assert front_of(wearing, wearing.start, areas, named).score < -CERTAIN
    assert front_of(wearing, wearing.start * half, areas, named).score > CERTAIN


def test_what_is_stated_stays(tmp_path: Path, tshirt: Mesh) -> None:
    with pytest.raises(InputError, match="away from the avatar"):
        read(tmp_path, tshirt, lambda points: points[:, [0, 2, 1]] * [1.0, -1.0, 1.0], up="y")
    for there in ([0.0, 0.01, 0.0], [0.0, 0.0, 0.0]):
        assert not read(tmp_path, tshirt, lambda points: points @ TURN.T, translate=there).readings


def test_a_garment_aside_the_body_keeps_the_roles_of_its_openings(tmp_path: Path, tshirt: Mesh) -> None:
    there, aside = read(tmp_path, tshirt, lambda p: p), read(tmp_path, tshirt, lambda p: p + np.array([0.3, 0.0, 0.0]))
    (first,), (second,) = there.wearing, aside.wearing
    assert first is not None
    assert second is not None
    assert second.limbs == first.limbs


@pytest.mark.parametrize("move", [(0.3, 0.0, 0.0), (0.0, 0.0, -0.3)])
def test_a_garment_aside_the_body_is_moved_onto_it(
    tmp_path: Path, tshirt: Mesh, move: tuple[float, float, float]
) -> None:
    outfit = read(tmp_path, tshirt, lambda points: points + np.array(move))
    assert choices(outfit)["translate"] == pytest.approx([-part for part in move], abs=0.06)
    (wearing,) = outfit.wearing
    assert wearing is not None
    assert not wearing.start_fault


def test_one_sleeve_does_not_move_the_middle_of_a_garment(tshirt: Mesh, tmp_path: Path) -> None:
    (wearing,) = read(tmp_path, tshirt, lambda points: points).wearing
    assert wearing is not None
    longer = wearing.start.copy()
    left = longer @ wearing.skeleton.left
    longer[left > 0.2] += 0.5 * wearing.skeleton.left
    assert limbs_for(wearing.openings, longer, wearing.skeleton) == list(wearing.limbs)
    assert {(ARMS[0],), (ARMS[1],), LEGS} <= set(wearing.limbs)


def test_a_hem_that_flares_to_one_side_is_for_both_legs(tshirt: Mesh, tmp_path: Path) -> None:
    (wearing,) = read(tmp_path, tshirt, lambda points: points).wearing
    assert wearing is not None
    flared, skeleton = wearing.start.copy(), wearing.skeleton
    hem = next(opening.loop for opening, limbs in zip(wearing.openings, wearing.limbs, strict=True) if limbs == LEGS)
    aside = (flared[hem] - skeleton.middle) @ skeleton.left
    flared[hem] += 2.2 * np.maximum(aside, 0.0)[:, None] * skeleton.left
    assert limbs_for(wearing.openings, flared, skeleton) == list(wearing.limbs)


@pytest.mark.parametrize(("scene", "girth"), [("tshirt", 0.3), ("tshirt", 0.1), ("trousers", 0.1)])
def test_a_hole_in_the_side_is_for_no_limb(scene: str, girth: float) -> None:
    """Cut out above a hem, or a slit such as a pocket's."""
    (wearing,) = load_outfit(load_scene(scene)).wearing
    assert wearing is not None
    start, skeleton = wearing.start, wearing.skeleton
    up, left = start @ skeleton.up, start @ skeleton.left
    high, low = (float(skeleton.waist @ skeleton.up), float(skeleton.spine[0] @ skeleton.up))
    at_side = np.flatnonzero((up > low) & (up < high) & (left > 0.0))
    loop = at_side[np.argsort(-left[at_side])[:6]].astype(np.int32)
    hole = replace(wearing.openings[0], loop=loop, girth=girth)
    found = limbs_for([*wearing.openings, hole], start, skeleton)
    assert found == [*wearing.limbs, ()]


@pytest.mark.parametrize(("scene", "girth"), [("tshirt", 0.15), ("tshirt", 0.2), ("trousers", 0.15), ("skirt", 0.3)])
def test_a_hole_in_the_middle_is_for_no_limb(scene: str, girth: float) -> None:
    """Cut out of the front, as in lace: it was for both legs, and the garment not worn."""
    (wearing,) = load_outfit(load_scene(scene)).wearing
    assert wearing is not None
    start, skeleton = wearing.start, wearing.skeleton
    middle = 0.5 * (start.min(axis=0) + start.max(axis=0)) @ skeleton.up
    away = np.abs((start - skeleton.middle) @ skeleton.left) + np.abs(start @ skeleton.up - middle)
    hole = replace(wearing.openings[0], loop=np.argsort(away)[:6].astype(np.int32), girth=girth)
    assert limbs_for([*wearing.openings, hole], start, skeleton) == [*wearing.limbs, ()]


def test_a_body_in_inches_that_lies_down_stands_up_round_its_garment(tmp_path: Path, tshirt: Mesh) -> None:
    body = mannequin(SIZE_BODIES["M"])
    write_obj(tmp_path / "body.obj", body.points[:, [0, 2, 1]] * [1.0, -1.0, 1.0] / INCH, body.triangles)
    garment = write_panels(tmp_path / "shirt.obj", tshirt.points, tshirt)
    outfit = load_outfit(load_scene(garment, on=tmp_path / "body.obj"))
    assert {choice.key: choice.value for choice in outfit.readings} == {"avatar.units": "in", "avatar.up": "z"}
    assert outfit.avatar is not None
    assert outfit.avatar.points == pytest.approx(body.points, abs=1e-4)
    with pytest.raises(InputError, match="away from the avatar"):  # what is stated stays
        load_outfit(load_scene(garment, {"avatar.up": "y"}, on=tmp_path / "body.obj"))


@pytest.mark.parametrize("z_up", [False, True])
def test_a_small_garment_in_millimetres_is_read_so(tmp_path: Path, z_up: bool) -> None:
    """Of 18 cm, it would be 1.8 m in centimetres, a usual size, but beside the body."""
    body = mannequin(SIZE_BODIES["M"])
    write_obj(tmp_path / "body.obj", body.points, body.triangles)
    gaiter = tube(0.09, 1.3, 1.45)
    in_file = 1000.0 * (gaiter.points[:, [0, 2, 1]] * [1.0, -1.0, 1.0] if z_up else gaiter.points)
    write_obj(tmp_path / "gaiter.obj", in_file, gaiter.triangles)
    outfit = load_outfit(load_scene(tmp_path / "gaiter.obj", on=tmp_path / "body.obj"))
    wanted = {"garment.units": "mm", **({"garment.up": "z"} if z_up else {})}
    assert {choice.key: choice.value for choice in outfit.readings} == wanted
    assert outfit.meshes[0].points == pytest.approx(gaiter.points, abs=1e-4)
    with pytest.raises(InputError, match="away from the avatar"):  # what is stated stays
        load_outfit(load_scene(tmp_path / "gaiter.obj", {"garment.units": "cm"}, on=tmp_path / "body.obj"))


def test_a_body_and_its_garment_from_a_tool_with_z_up_both_stand(tmp_path: Path, tshirt: Mesh) -> None:
    body = mannequin(SIZE_BODIES["M"])
    z_up = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    write_obj(tmp_path / "body.obj", 100.0 * body.points @ z_up, body.triangles)
    garment = write_panels(tmp_path / "shirt.obj", 100.0 * tshirt.points @ z_up, tshirt, 100.0)

    def outfit(scene: Any, **changes: Any) -> Outfit:
        return load_outfit(load_scene(scene, changes, on=tmp_path / "body.obj"))

    stood = outfit(garment)
    assert [choice.key for choice in stood.readings] == ["avatar.up", "garment.up"]
    assert stood.avatar is not None
    assert stood.avatar.points == pytest.approx(body.points, abs=1e-4)
    assert stood.meshes[0].points == pytest.approx(tshirt.points, abs=1e-4)
    assert [choice.key for choice in outfit("tshirt").readings] == ["avatar.up"]  # it is made for one who stands
    assert not outfit(garment, **{"avatar.up": "y"}).readings  # what is stated stays
    sheet = {"garment": {"shape": {"kind": "square", "height": 0.5}}}
    assert not outfit(sheet).readings  # over a body that lies


@pytest.mark.parametrize("up", ["-z", "x", "-x", "-y"])
def test_a_body_that_lies_or_is_upside_down_stands_up(tmp_path: Path, tshirt: Mesh, up: BodyUp) -> None:
    body = mannequin(SIZE_BODIES["M"])
    frame = np.array([with_y_up(axis[None], up)[0] for axis in np.eye(3)])
    assert np.linalg.det(frame) == pytest.approx(1.0)  # a turn, no mirror image
    laid = body.points @ frame.T
    write_obj(tmp_path / "body.obj", laid, body.triangles)

    def outfit(garment: Any, **changes: Any) -> Outfit:
        return load_outfit(load_scene(garment, changes, on=tmp_path / "body.obj"))

    stood = outfit("tshirt")
    assert {choice.key: choice.value for choice in stood.readings} == {"avatar.up": up}
    assert stood.avatar is not None
    assert stood.avatar.points == pytest.approx(body.points, abs=1e-6)
    garment = write_panels(tmp_path / "shirt.obj", tshirt.points @ frame.T, tshirt)
    assert "avatar.up" not in [choice.key for choice in outfit(garment).readings]  # it lies as its garment does


def test_who_is_upside_down_is_turned_but_not_who_bends_over(tshirt: Mesh) -> None:
    """Trunk and head may point down or level, where the legs stand."""
    scene = load_scene("tshirt").model_copy(update={"avatar": AvatarSpec(mesh=Path("body.obj"))})
    body = mannequin(SIZE_BODIES["M"])
    skeleton = skeleton_of(body)
    assert skeleton is not None
    worn = [("garment", tshirt)]
    hanging = replace(skeleton, up=-skeleton.up, curves=tuple(curve * [1.0, -1.0, 1.0] for curve in skeleton.curves))
    hanging = replace(hanging, spine=skeleton.spine * [1.0, -1.0, 1.0])
    assert [choice.value for choice in stand_up(scene, worn, body, lambda: hanging)[1]] == ["-y"]
    stated = scene.model_copy(update={"avatar": AvatarSpec(mesh=Path("body.obj"), up="y")})
    assert stand_up(stated, worn, body, lambda: hanging) == (stated, [])
    for up in ([0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]):
        bent = replace(skeleton, up=np.array(up))
        assert stand_up(scene, worn, body, lambda bent=bent: bent) == (scene, [])


@pytest.mark.parametrize(("lift", "moved_to"), [(-0.15, 0.0), (0.0, 0.0), (0.15, 0.15), (0.4, 0.0)])
def test_a_garment_for_another_stature_is_measured_from_the_shoulders(
    tshirt: Mesh, tmp_path: Path, lift: float, moved_to: float
) -> None:
    """It is moved onto them from far above, and from where its neckline would be sewn below the arms."""
    (wearing,) = read(tmp_path, tshirt, lambda points: points + np.array([0.0, lift, 0.0])).wearing
    assert wearing is not None
    left = float((wearing.onto - tshirt.points)[:, 1].mean())  # of the lift, as it is read and moved
    assert left == pytest.approx(moved_to, abs=0.05)
    assert wearing.too_high == pytest.approx(max(left, 0.0), abs=0.05)
    assert wearing.drop(wearing.onto) == 0.0
