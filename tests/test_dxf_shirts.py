"""Shirts: a stand on the neckline, a fall on the stand, fronts left open, and nothing sewn that is not to be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import band
from dxf_shirts import FACING, OVERLAP, SHIRT_SEAMS, SHIRTS, camp_shirt, fall, shirt, stand, write_shirt
from test_dxf import kinds

from warp_cloth.base.errors import InputError
from warp_cloth.pattern import DraftOptions, read_drafted, read_pattern
from warp_cloth.pattern.draft import Part, Stated
from warp_cloth.pattern.drafted import Draft
from warp_cloth.pattern.joints import StatedSeam, side_text
from warp_cloth.pattern.parting import marks_along, parted
from warp_cloth.pattern.proposal import SEWN_FROM

NEAR = 3e-3  # [m] of what is parted at a mark that is looked for at 257 places


def of_kind(draft: Draft, kind: str) -> Part:
    return next(part for part in draft.parts if part.kind == kind)


@pytest.mark.parametrize("name", SHIRTS)
def test_a_shirts_stand_and_fall_are_sewn_and_its_front_is_left_open(tmp_path: Path, name: str) -> None:
    draft = read_drafted(write_shirt(SHIRTS[name](), tmp_path / "shirt.dxf"))
    assert kinds(draft) == SHIRT_SEAMS | {"stand": 1, "fall": 1}
    assert [joint.reason.split(",")[0] for joint in draft.unsewn] == ["centre front"]
    assert any("the front is left open" in note for note in draft.notes)


def test_what_is_sewn_of_a_shirts_collar_ends_at_its_marks(tmp_path: Path) -> None:
    draft = read_drafted(write_shirt(shirt(), tmp_path / "shirt.dxf"))
    front, whole = of_kind(draft, "front"), of_kind(draft, "stand")
    assert front.shape.length(front.roles["facing"]) == pytest.approx(0.01 * FACING, abs=NEAR)
    bottom, top = (whole.shape.length(whole.roles[role]) for role in ("neck", "top"))
    fallen = of_kind(draft, "fall")
    assert top == pytest.approx(fallen.shape.length(fallen.roles["neck"]), abs=2 * NEAR)
    assert bottom > top + 0.01 * OVERLAP


def test_a_fall_starts_turned_down_outside_its_stand(tmp_path: Path) -> None:
    """Its outer edge below the seam, and above the neckline of the fronts."""
    placed = {
        panel.name: panel.placed(np.concatenate([edge.curve.at(np.linspace(0.0, 1.0, 9)) for edge in panel.edges]))
        for panel in read_pattern(write_shirt(shirt(), tmp_path / "shirt.dxf")).panels
    }
    height = {name: points[:, 1] for name, points in placed.items()}
    assert height["COLLAR"].max() == pytest.approx(height["STAND"].max(), abs=0.01)
    assert height["FRONT"].max() < height["COLLAR"].min() < height["COLLAR"].max() - 0.03
    axis = placed["STAND"][:, [0, 2]].mean(axis=0)
    out = {name: np.hypot(*(points[:, [0, 2]] - axis).T).max() for name, points in placed.items()}
    assert out["COLLAR"] > out["STAND"]


def test_the_written_table_of_a_shirt_sews_the_same(tmp_path: Path) -> None:
    path = write_shirt(shirt(), tmp_path / "shirt.dxf")
    draft = read_drafted(path)
    seams = tuple(
        StatedSeam((side_text(draft.parts, joint.one), side_text(draft.parts, joint.other))) for joint in draft.joints
    )
    places = {"STAND": Stated("stand"), "COLLAR": Stated("fall")}
    again = read_drafted(path, DraftOptions(seams=seams, pieces=places))
    both = [{frozenset((*joint.one, *joint.other)) for joint in each.joints} for each in (draft, again)]
    assert both[0] == both[1]


def test_a_collar_of_one_piece_ends_at_the_centre_of_an_open_front(tmp_path: Path) -> None:
    draft = read_drafted(write_shirt(camp_shirt(), tmp_path / "camp.dxf"))
    (joint,) = (joint for joint in draft.joints if joint.reason.startswith("collar"))
    assert joint.confidence >= SEWN_FROM
    kinds_met = [draft.parts[side.panel].kind for side in joint.other]
    assert kinds_met[0] == kinds_met[-1] == "front"
    assert "collar ends" not in kinds(draft)


def test_a_facing_without_a_mark_leaves_the_collar_to_the_user(tmp_path: Path) -> None:
    """Lengths alone do not tell where the neckline ends; the fall is sewn to its stand all the same."""
    draft = read_drafted(write_shirt(shirt(notched=False), tmp_path / "shirt.dxf"))
    assert kinds(draft) == SHIRT_SEAMS | {"fall": 1}
    with pytest.raises(InputError, match="is not sure"):
        read_pattern(tmp_path / "shirt.dxf")


def test_a_stand_of_another_shirt_is_not_sewn(tmp_path: Path) -> None:
    pieces = [piece for piece in shirt() if piece.name not in ("STAND", "COLLAR")]
    draft = read_drafted(write_shirt([*pieces, stand("STAND", 30.0), fall("COLLAR", 26.0)], tmp_path / "other.dxf"))
    assert kinds(draft) == SHIRT_SEAMS | {"fall": 1}


def test_two_bands_that_may_both_be_the_stand_are_not_sewn(tmp_path: Path) -> None:
    pieces = shirt(facing=0.0)
    long = 46.0
    bands = [replace(band(f"COLLAR {name}", long, wide), quantity="1") for name, wide in (("A", 3.0), ("B", 5.0))]
    draft = read_drafted(write_shirt([*pieces[:-2], *bands], tmp_path / "bands.dxf"))
    assert not {"stand", "collar", "fall"} & set(kinds(draft))


def test_an_edge_is_parted_where_it_is_asked_for(tmp_path: Path) -> None:
    draft = read_drafted(write_shirt(shirt(), tmp_path / "shirt.dxf"))
    yoke = of_kind(draft, "yoke")
    run = yoke.roles["neck"]
    total = yoke.shape.length(run)
    made, pieces = parted(yoke, run, [0.2 * total, 0.5 * total, 0.9 * total])
    lengths = [made.shape.length(piece) for piece in pieces]
    assert lengths == pytest.approx([0.2 * total, 0.3 * total, 0.4 * total, 0.1 * total], rel=1e-3)
    assert made.roles["neck"] == tuple(edge for piece in pieces for edge in piece)
    assert sum(edge.length for edge in made.edges) == pytest.approx(sum(edge.length for edge in yoke.edges))
    assert marks_along(yoke, run)[0] == pytest.approx(0.5 * total)  # the corner in the middle
