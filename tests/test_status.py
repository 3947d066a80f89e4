"""The status sentence of a fit names what is wrong, and what to change."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from meshfiles import sheet, write_obj

from warp_cloth.fitting.fit import fit
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.result import Strain
from warp_cloth.report.advice import advice, notes_of
from warp_cloth.report.faults import crossing_faces, detached_pieces, slid_off, unseen_avatar, wrong_size
from warp_cloth.scene import load_scene


def contact(p99: float) -> dict[str, Any]:
    return {"error_mm": {"p50": 0.0, "p99": p99, "p999": 50.0, "max": 60.0}}


@pytest.mark.parametrize(("kind", "remedy"), [("depth", '"auto"'), ("auto", '"mesh"'), ("plain", ""), ("mesh", "")])
def test_an_avatar_that_is_not_seen_names_the_collider_that_does(kind: str, remedy: str) -> None:
    sentence = unseen_avatar(contact(12.0), kind)
    assert remedy in sentence
    assert bool(sentence) == bool(remedy)
    assert unseen_avatar(contact(1.0), kind) == unseen_avatar(None, kind) == ""


def test_cloth_that_passes_through_itself_is_told_how_not_to() -> None:
    sentence = crossing_faces(0.104, cloth_contact=False)
    assert sentence.startswith("10 % of the faces pass through others: set collision.cloth = true")
    assert crossing_faces(0.03, cloth_contact=False) == crossing_faces(0.104, cloth_contact=True) == ""


def test_a_folded_sheet_says_in_its_sentence_that_it_passes_through_itself(tmp_path: Path) -> None:
    points, faces = sheet(count=9)
    crossing = np.concatenate([points, points[:, [2, 1, 0]] + np.array([-0.3, 0.0, 0.3])])
    write_obj(tmp_path / "cross.obj", crossing, np.concatenate([faces, faces + len(points)]))
    top = {"box": [[-1, 1.49, -1], [1, 2, 1]]}
    worn = fit({"garment": {"mesh": str(tmp_path / "cross.obj"), "units": "m", "pin": top}}, device="cpu")
    assert "of the faces pass through others: set collision.cloth = true" in worn.message
    assert any("pass through others" in line for line in advice(worn.report))


@pytest.mark.parametrize(
    ("garment", "told"),
    [
        ({"shape": {"kind": "tshirt"}}, "panels as they are placed"),
        ({"shape": {"kind": "tshirt"}, "rest": "uv"}, ""),
        ({"shape": {"kind": "square"}, "uv_units": "cm"}, "uv_units is not used"),
        ({"shape": {"kind": "square"}}, ""),
    ],
)
def test_panels_that_are_not_taken_though_something_speaks_for_them_are_told_of(
    garment: dict[str, Any], told: str
) -> None:
    notes = notes_of({"settings": load_scene({"garment": garment}).settings()})
    assert len(notes) == bool(told)
    assert told in "".join(notes)


def test_cloth_far_from_its_natural_size_is_told_of() -> None:
    assert wrong_size(Strain(p50=0.05, p99=0.9, max=2.0, min=-0.5)) == ""
    assert "64 %" in wrong_size(Strain(p50=0.64, p99=0.9, max=2.0, min=-0.5))


@pytest.mark.parametrize(
    ("height", "down", "top", "pins", "told"),
    [
        (0.2, 0.2, 0.0, 0, False),
        (0.2, 0.25, 0.0, 0, True),
        (-0.3, 0.1, 0.0, 0, False),
        (0.2, 0.25, 0.45, 0, False),
        (0.2, 0.25, 0.0, 1, False),
    ],
)
def test_a_garment_that_has_slid_to_the_feet_is_told_of(
    height: float, down: float, top: float, pins: int, told: bool
) -> None:
    """But not one that hangs below a bust from the start, whose top is still worn, or that is pinned."""
    square = {"kind": "square", "vertices_per_side": 5, "side": 0.2, "height": height}
    scene = load_scene({"garment": {"shape": square}, "avatar": {"shape": {"kind": "sphere", "edge_mm": 100}}})
    outfit = load_outfit(scene)
    floor = outfit.avatar.points[:, 1].min() if outfit.avatar is not None else 0.0
    (garment,) = outfit.garments
    began, down_by = garment.points + np.array([0.0, floor, 0.0]), np.array([0.0, down, 0.0])
    outfit = replace(outfit, garments=(replace(garment, points=began, pins=np.arange(pins)),))
    worn = began - down_by
    worn[0, 1] += top
    sentence = slid_off(scene, outfit, [worn])
    assert ('"square" has slid down to the avatar\'s feet' in sentence) == told


def test_a_button_that_falls_off_is_told_of(tmp_path: Path) -> None:
    points, faces = sheet()
    button = np.array([[0.0, 1.2, 0.31], [0.02, 1.2, 0.31], [0.0, 1.22, 0.31]])
    write_obj(tmp_path / "coat.obj", np.concatenate([points, button]), np.concatenate([faces, [[25, 26, 27]]]))
    scene = load_scene({"garment": {"mesh": str(tmp_path / "coat.obj"), "units": "m"}})
    outfit = load_outfit(scene)
    worn = outfit.garments[0].points - np.array([0.0, 0.3, 0.0])  # all of it came down, the button not farther
    assert detached_pieces(scene, outfit, [worn]) == ""
    worn[25:] -= [0.0, 0.2, 0.0]
    assert detached_pieces(scene, outfit, [worn]).startswith('1 of the 2 pieces of "coat" fall off')


def test_a_gap_that_no_view_shows_is_told_of_until_all_layers_are_drawn(tmp_path: Path) -> None:
    boxes = [((0.6, 0.6, 0.1), (0, 1.2, 0.12)), ((0.6, 0.6, 0.1), (0, 1.2, -0.12)), ((0.6, 0.1, 0.4), (0, 1.6, 0))]
    parts = [trimesh.creation.box(size, trimesh.transformations.translation_matrix(at)) for size, at in boxes]
    trimesh.util.concatenate(parts).export(tmp_path / "niche.obj")  # open to the sides only
    write_obj(tmp_path / "sheet.obj", *sheet(height=1.0, toward=0.0))
    scene = {
        "garment": {"mesh": str(tmp_path / "sheet.obj"), "units": "m"},
        "avatar": {"mesh": str(tmp_path / "niche.obj"), "units": "m"},
        "collision": {"pixel_mm": 5},
        "solver": {"iterations": 20},
    }
    drawn, layered = (
        fit(scene, device="cpu"),
        fit({**scene, "collision": {"avatar": "auto", "pixel_mm": 5}}, device="cpu"),
    )
    assert 'use collision.avatar = "auto"' in drawn.message
    assert any('collision.avatar = "auto"' in line for line in advice(drawn.report))
    assert "collision.avatar" not in layered.message
