"""A body's file that holds its clothes, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from cloths import tube

from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.mesh import Mesh
from warp_cloth.report.notes import notes_of
from warp_cloth.shapes import sphere

SKIRT = tube(0.2, 0.6, 1.1)  # round the waist of the mannequin
THROAT = tube(0.02, 1.2, 1.3)  # within its chest, and open at both ends


def together(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(mesh.vertex_count for mesh in meshes[:-1])])
    triangles = np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=True)])
    return Mesh("body", np.concatenate([mesh.points for mesh in meshes]), triangles.astype(np.int32))


def test_a_skirt_round_a_body_is_worn_by_it(body: Mesh) -> None:
    assert closing_of(together(body, SKIRT)).worn == 1
    assert closing_of(together(SKIRT, body, sphere(radius=0.03, centre=(0.0, 1.6, 0.1)))).worn == 1


def test_what_lies_within_a_body_or_beside_it_is_no_clothes(body: Mesh) -> None:
    beside = replace(SKIRT, points=SKIRT.points + np.array([1.0, 0.0, 0.0]))
    for part in (THROAT, beside):
        assert closing_of(together(body, part)).worn == 0
    assert closing_of(body).worn == 0


def test_a_body_in_pieces_wears_none_of_them(body: Mesh) -> None:
    """Two halves, each open at the neck, and the lower one at the wrists, too."""
    height = body.points[body.triangles, 1].mean(axis=1)
    upper, lower = (replace(body, triangles=body.triangles[part]) for part in (height > 1.45, height <= 1.45))
    assert closing_of(together(upper, lower)).worn == 0


def test_a_report_says_that_a_body_wears_clothes() -> None:
    repairs = {"holes_closed": 2, "lids_m2": 0.4, "sheets_left_out": 0, "worn_parts": 1}
    notes = notes_of({"contact": repairs})
    assert notes[0].startswith("avatar: 1 part of its mesh is worn by the rest, as clothes are")
    assert not any("is part of the body missing" in note for note in notes)
