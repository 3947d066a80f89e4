"""Fronts and backs cut across are sewn one below another: colour blocks, midriffs, yokes of skirts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from dxf_patterns import TRUE_SEAMS, Drafted, Point, band, half_body, line, tshirt, write
from test_dxf import kinds

from warp_cloth.pattern import read_drafted


def on_fold(name: str, *path: Point) -> Drafted:
    """Half a piece of straight lines, from its hem's middle round to its top's, which are on the fold."""
    edges = [line(a, b) for a, b in zip(path, [*path[1:], path[0]], strict=True)]
    return Drafted(name, edges, "1", (path[-1], path[0]))


def blocks(*levels: float) -> list[Drafted]:
    """The T-shirt cut across at these heights [cm], from above; with a band at its hem if it is cut twice."""
    front, back, *rest = tshirt()
    pieces = []
    for half in (front, back):
        width, high = half.edges[1][0][0], levels[0]
        upper = [line((0.0, high), (width, high)), line((width, high), half.edges[1][1]), *half.edges[2:5]]
        fold = (half.edges[4][-1], (0.0, high))
        pieces.append(Drafted(f"UPPER {half.name}", [*upper, line(*fold)], "1", fold))
        for top, bottom in zip(levels, [*levels[1:], 0.0], strict=True):
            path = [(0.0, bottom), (width, bottom), (width, top), (0.0, top)]
            pieces.append(on_fold(f"{'MIDDLE' if bottom else 'LOWER'} {half.name}", *path))
    return [*pieces, *rest]


def skirt(yoke: float, waist: float, faces: tuple[str, ...] = ("FRONT", "BACK")) -> list[Drafted]:
    """A waistband, yokes this wide at their hems, and skirts this wide above [cm, half of each]."""
    pieces = [band("WAISTBAND", 75.0, 4.0)]
    for face in faces:
        pieces.append(on_fold(f"{face} YOKE", (0.0, 0.0), (yoke, 0.0), (19.0, 14.0), (0.0, 14.0)))
        pieces.append(on_fold(f"{face} SKIRT", (0.0, 0.0), (34.0, 0.0), (waist, 45.0), (0.0, 45.0)))
    return pieces


def dress() -> list[Drafted]:
    """Bodices, midriffs that are narrower below, and skirts."""
    pieces = []
    for face, depth in (("FRONT", 12.0), ("BACK", 3.0)):
        half = half_body(f"{face} BODICE", 24.0, 38.0, 8.5, depth, 18.0)
        edges = [line((0.0, 0.0), (21.0, 0.0)), line((21.0, 0.0), half.edges[1][1]), *half.edges[2:]]
        pieces.append(replace(half, edges=edges))
        pieces.append(on_fold(f"{face} MIDRIFF", (0.0, 0.0), (20.0, 0.0), (21.0, 7.0), (0.0, 7.0)))
        pieces.append(on_fold(f"{face} SKIRT", (0.0, 0.0), (32.0, 0.0), (20.0, 70.0), (0.0, 70.0)))
    return pieces


STACKED = {
    "a T-shirt": (blocks(35.0), {**TRUE_SEAMS["tshirt"], "side": 4, "waist": 2}),
    "a skirt": (skirt(24.0, 24.0), {"side": 4, "waistband": 1, "waistband ends": 1, "tier": 2}),
    "a gathered skirt": (skirt(24.0, 34.0), {"side": 4, "waistband": 1, "waistband ends": 1, "tier": 2}),
    "a dress": (dress(), {"shoulder": 2, "side": 6, "waist": 2, "tier": 2}),
}


@pytest.mark.parametrize("name", STACKED)
def test_all_seams_of_what_is_cut_across_are_found_and_no_others(name: str, tmp_path: Path) -> None:
    pieces, true = STACKED[name]
    for order in (pieces, pieces[::-1]):
        assert kinds(read_drafted(write(tmp_path / "a.dxf", {"M": order}))) == true


@pytest.mark.parametrize("pieces", [skirt(24.0, 21.0), skirt(24.0, 24.0, ("FRONT",))], ids=["narrower", "front only"])
def test_what_does_not_fit_is_not_sewn(pieces: list[Drafted], tmp_path: Path) -> None:
    assert not kinds(read_drafted(write(tmp_path / "a.dxf", {"M": pieces})))["tier"]


WORDS = ("UPPER", "MIDDLE", "LOWER")


def numbered(pieces: list[Drafted]) -> list[Drafted]:
    """The pieces, their fronts and backs told apart by numbers that do not say which is above."""
    for number, word in enumerate(WORDS, start=1):
        pieces = [replace(each, name=each.name.replace(word, f"PART {number}")) for each in pieces]
    return pieces


def test_names_tell_which_of_blocks_as_wide_is_the_lower_one(tmp_path: Path) -> None:
    pieces = [*blocks(38.0, 20.0), band("HEM BAND", 95.0, 6.0)]
    true = {**TRUE_SEAMS["tshirt"], "side": 6, "waist": 2, "tier": 2, "hem band": 1, "hem_band ends": 1}
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert kinds(draft) == true
    hem = next(joint for joint in draft.joints if joint.reason.startswith("hem band"))
    assert {draft.parts[side.panel].name for side in hem.other} == {"LOWER FRONT", "LOWER BACK"}


def test_no_band_goes_round_one_of_several_fronts(tmp_path: Path) -> None:
    """Of two blocks as wide it is not told which is the lower one; the band was sewn to the uppermost."""
    pieces = numbered([*blocks(38.0, 20.0), band("HEM BAND", 95.0, 6.0)])
    found = kinds(read_drafted(write(tmp_path / "a.dxf", {"M": pieces})))
    assert not found["hem band"]
    assert not found["tier"]


def layered(words: str, height: float) -> list[Drafted]:
    """The T-shirt without its neckband, and a front and back cut below the arms, named so, this high [cm]."""
    width = tshirt()[0].edges[0][1][0]
    path = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    return [*tshirt()[:3], *(on_fold(f"{face} {words}", *path) for face in ("FRONT", "BACK"))]


@pytest.mark.parametrize("words", ["INNER", "UNDERLAYER", "SLIP", "2", "MESH"])
@pytest.mark.parametrize("height", [46.0, 25.0])
def test_a_layer_as_wide_as_the_hem_is_no_lower_block(words: str, height: float, tmp_path: Path) -> None:
    """It was sewn to the hem, of confidence 0.87."""
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": layered(words, height)}))
    assert not {"waist", "tier"} & {*kinds(draft)}
    is_named = words not in ("2", "MESH")
    assert any("a second layer" in note for note in draft.notes) == is_named
    assert any(part.name == f"FRONT {words}" for part in draft.parts) != is_named


def test_inner_fronts_without_outer_ones_are_kept(tmp_path: Path) -> None:
    pieces = [replace(each, name=f"INNER {each.name}") for each in tshirt()]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert {"INNER FRONT", "INNER BACK"} <= {part.name for part in draft.parts}
