"""Patterns in DXF: pieces as drafted, however a program writes them; seams proposed; pieces laid round the body."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import ezdxf
import numpy as np
import pytest
from dxf_patterns import GARMENTS, GRADES, STYLES, TRUE_SEAMS, Style, band, length, middle, raglan, tshirt, write
from fuzzing import damaged, kept
from hypothesis import given
from test_fuzz_patterns import holds_its_promise

from warp_cloth.base.connected import connected_components
from warp_cloth.base.errors import InputError
from warp_cloth.base.topology import build_topology
from warp_cloth.pattern import DraftOptions, load_pattern, read_drafted
from warp_cloth.pattern.draft import Stated
from warp_cloth.pattern.drafted import Draft, drafted_pattern
from warp_cloth.pattern.joints import StatedSeam, side_text
from warp_cloth.pattern.proposal import SEWN_FROM
from warp_cloth.scene import load_scene

EDGE = 0.03  # [m]; coarse, for speed
EXACT = 1e-3  # relative: what outlines may differ by from what was drafted


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("dxf")


def drafted(folder: Path, garment: str, style: Style | None = None, size: str = "M", **options: object) -> Draft:
    style = style or STYLES[garment]
    path = write(folder / f"{garment}.dxf", {size: GARMENTS[garment](GRADES[size])}, style)
    return read_drafted(path, DraftOptions(**options))  # type: ignore[arg-type]


def kinds(draft: Draft) -> Counter[str]:
    return Counter(joint.reason.split(",")[0] for joint in draft.joints)


@pytest.mark.parametrize("garment", GARMENTS)
def test_all_true_seams_are_found_and_no_others(folder: Path, garment: str) -> None:
    for size in GRADES:
        draft = drafted(folder, garment, size=size)
        assert kinds(draft) == TRUE_SEAMS[garment]
        assert min(joint.confidence for joint in draft.joints) >= SEWN_FROM
        assert not draft.unsewn


STYLES_TRIED = {
    "plain": Style(),
    "inches": replace(STYLES["trousers"], allowance=0.0),
    "turned": Style(turned=90.0),
    "upside_down": Style(turned=180.0, entity="LWPOLYLINE"),
    "no_unit": Style("", insunits=6, marks=False),
    "lines": Style(entity="LINE", inserted=False),
    "sew_line": Style(allowance=1.0),
}


@pytest.mark.parametrize("style", STYLES_TRIED)
def test_pieces_are_as_drafted_whatever_wrote_them(folder: Path, style: str) -> None:
    draft = drafted(folder, "tshirt", STYLES_TRIED[style])
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    front, _, sleeve, _ = tshirt()
    part = next(part for part in draft.parts if part.name == "FRONT")
    outline = np.array([point for edge in front.edges for point in edge[:-1]]) * 0.01
    x, y = outline.T
    half = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    assert sum(edge.area for edge in part.edges) == pytest.approx(2.0 * half, rel=EXACT)
    assert np.ptp(part.shape.box[1][1] - part.shape.box[0][1]) == pytest.approx(0.0)
    assert float(part.shape.box[1][1] - part.shape.box[0][1]) == pytest.approx(0.70, rel=EXACT)  # the warp is upright
    drawn = sorted(0.01 * length(edge) for edge in front.edges[:-1] for _ in range(2))
    assert sorted(edge.length for edge in part.edges) == pytest.approx(drawn, rel=EXACT)
    caps = [part.shape.length(part.roles["cap"]) for part in draft.parts if part.kind == "sleeve"]
    assert caps == pytest.approx([0.01 * length(sleeve.edges[2])] * 2, rel=EXACT)


def test_a_stated_allowance_is_taken_off(folder: Path) -> None:
    whole = drafted(folder, "tshirt", Style())
    less = drafted(folder, "tshirt", Style(), seam_allowance=0.005)
    area = [sum(edge.area for edge in draft.parts[2].edges) for draft in (whole, less)]
    around = [sum(edge.length for edge in draft.parts[2].edges) for draft in (whole, less)]
    assert area[0] - area[1] == pytest.approx(0.005 * 0.5 * sum(around), rel=2e-3)  # of a strip 5 mm wide


def test_left_and_right_sleeves_meet_the_fronts_they_belong_to(folder: Path) -> None:
    """The sleeve is drafted as a left one, seen from outside, with its front at -x; front +x is the wearer's left."""
    draft = drafted(folder, "tshirt")
    caps = {
        draft.parts[joint.one[0].panel].name: side_text(draft.parts, joint.other)
        for joint in draft.joints
        if joint.reason.startswith("sleeve cap")
    }
    assert caps == {"SLEEVE": "BACK 7 + FRONT 2", "SLEEVE mirrored": "FRONT 7 + BACK 2"}


def boundary_loops(path: Path, options: DraftOptions) -> int:
    mesh = load_pattern(path, edge=EDGE, options=options)
    holds_its_promise(mesh)
    start, end = mesh.triangles.ravel(), np.roll(mesh.triangles, -1, axis=1).ravel()
    drawn = set(zip(start.tolist(), end.tolist(), strict=True))
    bare = np.array([(a, b) for a, b in drawn if (b, a) not in drawn])
    used, number = np.unique(bare, return_inverse=True)
    number = number.reshape(-1, 2)
    return len(np.unique(connected_components(len(used), number[:, 0], number[:, 1])))


OPENINGS = [("tshirt", 4), ("trousers", 3), ("hooded", 4), ("leggings", 3), ("raglan", 4)]


@pytest.mark.parametrize(("garment", "loops"), OPENINGS)
def test_the_sewn_garment_has_its_openings(folder: Path, garment: str, loops: int) -> None:
    path = write(folder / f"sewn_{garment}.dxf", {"M": GARMENTS[garment](0.0)}, STYLES[garment])
    assert boundary_loops(path, DraftOptions()) == loops


def test_sizes_of_a_nest(folder: Path) -> None:
    path = write(folder / "nest.dxf", {size: tshirt(grade) for size, grade in GRADES.items()})
    assert read_drafted(path).size == "M"
    widths = []
    for size in ("S", "M", "L"):
        draft = read_drafted(path, DraftOptions(size=size.lower()))
        assert draft.sizes == ("S", "M", "L")
        assert [part.name for part in draft.parts] == ["FRONT", "BACK", "SLEEVE", "SLEEVE mirrored", "NECKBAND"]
        widths.append(float(draft.parts[0].shape.width(0.3)))
    assert np.diff(widths) == pytest.approx([0.02, 0.02], abs=1e-3)
    with pytest.raises(InputError, match="its sizes are S, M, L"):
        read_drafted(path, DraftOptions(size="XL"))


def test_stated_seams_are_sewn_as_the_proposed_ones(folder: Path) -> None:
    proposed = drafted(folder, "tshirt")
    seams = tuple(
        StatedSeam((side_text(proposed.parts, joint.one), side_text(proposed.parts, joint.other)))
        for joint in proposed.joints
    )
    stated = drafted(folder, "tshirt", seams=seams)
    sides = [{(*joint.one, *joint.other) for joint in draft.joints} for draft in (proposed, stated)]
    assert sides[0] == sides[1]
    figures = [drafted_pattern(draft, None).stitches for draft in (proposed, stated)]
    assert figures[0] == figures[1]


def test_a_third_panel_is_sewn_into_a_seam_as_a_layer(folder: Path) -> None:
    """Whatever edges it has there: the others are cut where it has a corner."""
    pieces = tshirt()
    side = length(pieces[0].edges[1])
    path = write(folder / "layer.dxf", {"M": [*pieces, band("WING", side, 5.0)]})
    draft = read_drafted(path)
    sides = [(side_text(draft.parts, joint.one), side_text(draft.parts, joint.other)) for joint in draft.joints]
    seams = tuple(StatedSeam((*two, "WING 0 + WING 1") if two[0] == "FRONT 1" else two) for two in sides)
    mesh = load_pattern(path, edge=EDGE, options=DraftOptions(seams=seams))
    joined = build_topology(mesh.triangles, mesh.vertex_count)
    count = np.bincount(joined.triangle_edges.ravel())
    assert count.max() == 3
    assert mesh.texcoords is not None
    drawn = np.linalg.norm(np.roll(mesh.texcoords, -1, axis=1) - mesh.texcoords, axis=2)
    in_seam = count[joined.triangle_edges] == 3
    assert drawn[in_seam].sum() == pytest.approx(3 * 0.01 * side, rel=EXACT)  # the whole of it
    assert joined.rims is not None
    assert len(joined.rims) == 1  # the shirt's openings; the wing's free edges are none
    wing = mesh.points[mesh.triangles[mesh.panels == mesh.panel_names.index("WING")]]
    assert np.linalg.norm(wing - np.roll(wing, 1, axis=1), axis=2).max() < 3.0 * EDGE  # it starts at its seam


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seams": (StatedSeam(("SLEEVE 99", "FRONT 1")),)}, "has no edge 99"),
        ({"seams": (StatedSeam(("ARM 1", "FRONT 1")),)}, 'no piece "ARM"'),
        ({"seams": (StatedSeam(("FRONT", "BACK 1")),)}, "names no edge"),
        ({"seams": (StatedSeam(("FRONT 1", "BACK 1")), StatedSeam(("FRONT 1", "BACK 2")))}, "sewn by seam 0, too"),
        ({"pieces": {"ARM": Stated("sleeve")}}, 'no piece "ARM"'),
        ({"seam_allowance": 0.09}, "too narrow for a seam allowance"),
    ],
)
def test_what_does_not_fit_the_file_is_refused(folder: Path, options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        drafted(folder, "tshirt", **options)


@pytest.mark.parametrize("sides", [[], ["FRONT 1"], ["FRONT 1"] * 9])
def test_a_seam_has_two_to_eight_sides(sides: list[str]) -> None:
    with pytest.raises(InputError, match=f"a seam has 2 to 8 sides, not {len(sides)}"):
        load_scene({"garment": {"pattern": "x.dxf", "seam": [{"sew": sides}]}})


def test_a_piece_that_is_sewn_to_nothing_is_named(folder: Path) -> None:
    draft = drafted(folder, "tshirt", seams=(StatedSeam(("FRONT 1", "BACK 8")),))
    with pytest.raises(InputError, match='pieces "SLEEVE", "SLEEVE mirrored", "NECKBAND": are sewn to nothing'):
        drafted_pattern(draft, None)
    left_out = {name: Stated("none") for name in ("SLEEVE", "NECKBAND")}
    vest = drafted(folder, "tshirt", pieces=left_out)
    assert [part.name for part in vest.parts] == ["FRONT", "BACK"]
    assert len(drafted_pattern(vest, None).stitches) == 4


def test_pairs_and_sides_without_quantities_and_sizes(folder: Path) -> None:
    legs = [replace(piece, quantity="none") for piece in GARMENTS["trousers"](0.0)]
    assert kinds(read_drafted(write(folder / "legs.dxf", {"": legs}))) == TRUE_SEAMS["trousers"]
    front, back, sleeve, neck = tshirt()
    other = [[(-x, y) for x, y in edge[::-1]] for edge in sleeve.edges[::-1]]
    sleeves = [
        replace(sleeve, name="SLEEVE L", quantity="1"),
        replace(sleeve, name="SLEEVE R", quantity="1", edges=other, notches=[(-x, y) for x, y in sleeve.notches]),
    ]
    draft = read_drafted(write(folder / "sided.dxf", {"": [front, back, *sleeves, neck]}))
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    assert not draft.sizes


def test_unknown_names_are_never_sewn_by_length_alone(folder: Path) -> None:
    pieces = [replace(piece, name=f"P{number}") for number, piece in enumerate(raglan())]
    path = write(folder / "unknown.dxf", {"M": pieces})
    draft = read_drafted(path)
    assert not draft.joints
    assert all(joint.confidence < SEWN_FROM for joint in draft.unsewn)
    with pytest.raises(InputError, match="sewn to nothing"):
        drafted_pattern(draft, None)
    named = {"P0": Stated("front"), "P1": Stated("back"), "P2": Stated("left_sleeve"), "P3": Stated("collar")}
    assert kinds(read_drafted(path, DraftOptions(pieces=named))) == TRUE_SEAMS["raglan"]


def test_sleeves_and_legs_start_clear_of_each_other(folder: Path) -> None:
    path = write(folder / "clear.dxf", {"M": GARMENTS["trousers"](0.0)})
    mesh = load_pattern(path, edge=EDGE)
    beside = mesh.points[mesh.points[:, 1] < 0.7]  # below the crotch of the usual figure
    assert np.abs(beside[:, 0]).min() > 0.005
    path = write(folder / "clear.dxf", {"M": GARMENTS["tshirt"](0.0)})
    mesh = load_pattern(path, edge=EDGE)
    assert mesh.panels is not None
    low = [mesh.points[mesh.triangles[mesh.panels == panel]].reshape(-1, 3)[:, 0] for panel in (2, 3)]
    assert np.sort([low[0].mean(), low[1].mean()]) == pytest.approx([-np.abs(low[0].mean()), low[0].mean()], abs=1e-3)
    assert low[0].mean() > 0.2  # the left sleeve is at the wearer's left


def test_whole_legs_start_round_the_legs_and_half_of_the_trunk(folder: Path) -> None:
    path = write(folder / "legs.dxf", {"M": GARMENTS["leggings"](0.0)})
    mesh = load_pattern(path, edge=EDGE)
    assert mesh.panels is not None
    left = mesh.points[np.unique(mesh.triangles[mesh.panels == 0])]
    assert left[:, 0].min() > -0.01  # the left leg keeps to the wearer's left, above the crotch, too
    assert np.abs(mesh.points[mesh.points[:, 1] < 0.7][:, 0]).min() > 0.003
    low, high = left[left[:, 1] > 0.95][:, 2].min(), left[left[:, 1] > 0.95][:, 2].max()
    assert low < -0.1 < 0.1 < high  # from the middle of the back to that of the front


def test_a_raglan_is_no_set_in_sleeve(folder: Path) -> None:
    draft = drafted(folder, "raglan")
    seams = {side_text(draft.parts, joint.one): side_text(draft.parts, joint.other) for joint in draft.joints}
    raglans = {one: other for one, other in seams.items() if one.startswith("SLEEVE") and "BACK" in other}
    assert set(raglans) == {"SLEEVE 2", "SLEEVE mirrored 2"}  # as drafted, the back of a left sleeve
    assert min(joint.confidence for joint in draft.joints) > 0.96


def test_bulges_are_arcs_and_open_outlines_are_closed(folder: Path) -> None:
    document = ezdxf.new("R2000")
    block = document.blocks.new("DISC")
    block.add_lwpolyline([(0, 0, 1.0), (400, 0, 1.0)], format="xyb", close=True, dxfattribs={"layer": "1"})
    document.saveas(folder / "disc.dxf")
    (part,) = read_drafted(folder / "disc.dxf").parts
    assert sum(edge.area for edge in part.edges) == pytest.approx(np.pi * 0.04, rel=EXACT)
    document = ezdxf.new("R2000")
    document.modelspace().add_lwpolyline([(0, 0), (400, 0), (400, 600), (0, 600), (0, 5)], dxfattribs={"layer": "1"})
    document.saveas(folder / "open.dxf")
    draft = read_drafted(folder / "open.dxf")
    assert sum(edge.area for edge in draft.parts[0].edges) == pytest.approx(0.24, rel=EXACT)
    assert any("was open by 5 mm" in note for note in draft.notes)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"AC1015 and so on", "is a DWG file"),
        (b"not a drawing", "cannot be read as DXF|has no pieces"),
        (b"  0\nSECTION\n  2\nENTITIES\n  0\nENDSEC\n  0\nEOF\n", "has no pieces"),
    ],
)
def test_files_that_hold_no_pattern(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "bad.dxf").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_drafted(tmp_path / "bad.dxf")


@pytest.mark.parametrize("share", [0.2, 0.6, 0.9])
def test_a_file_that_is_cut_short_says_so(tmp_path: Path, share: float) -> None:
    """Before, it was said to have nothing on layer 1."""
    (tmp_path / "cut.dxf").write_bytes(SOUND[: int(share * len(SOUND))])
    with pytest.raises(InputError, match="is cut short"):
        read_drafted(tmp_path / "cut.dxf")


with TemporaryDirectory() as _place:
    SOUND = write(
        Path(_place) / "fuzz.dxf", {"M": [piece for piece in tshirt() if piece.name != "SLEEVE"]}
    ).read_bytes()


@given(damaged(SOUND))
def test_a_damaged_file_is_sound_or_refused_in_one_line(content: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "any.dxf"
        path.write_bytes(content)
        mesh = kept(lambda: load_pattern(path, edge=0.06))
    if mesh is not None:
        holds_its_promise(mesh)


def test_notches_lie_on_the_outline(folder: Path) -> None:
    draft = drafted(folder, "trousers")
    wanted = np.array(middle(GARMENTS["trousers"](0.0)[0].edges[1], 0.45)) * 0.01
    assert np.hypot(*(draft.parts[0].notches - wanted).T).min() < 2e-3
