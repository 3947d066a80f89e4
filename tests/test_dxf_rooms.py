"""DXF files as pattern rooms have them: sizes, quantities, notches and sew lines are found in whatever way."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import GRADES, TRUE_SEAMS, tshirt
from dxf_programs import INCH, outline
from dxf_rooms import ROOMS, SIZES, graded
from hypothesis import given
from hypothesis import strategies as st
from test_dxf import EXACT, kinds

from warp_cloth.base.errors import InputError
from warp_cloth.pattern import DraftOptions, read_drafted
from warp_cloth.pattern.drafted import Draft
from warp_cloth.pattern.dxf_drawn import CUT, NOTCH, Drawn
from warp_cloth.pattern.grade_table import GradeTable, read_grade_table
from warp_cloth.pattern.grading import graded as by_rules
from warp_cloth.pattern.labels import copies_of, name_of
from warp_cloth.pattern.loops import area_of
from warp_cloth.pattern.notched import unnotched


def areas(draft: Draft) -> list[float]:
    """Of a front, a back, a sleeve and a neckband [m^2]."""
    found = [part for part in draft.parts if not part.name.endswith(" mirrored")]
    return [abs(sum(edge.area for edge in part.edges)) for part in found]


def drafted_areas(size: str) -> list[float]:
    return [
        1e-4 * area_of(np.array(outline(piece))) * (1.0 if piece.fold is None else 2.0)
        for piece in tshirt(GRADES[size])
    ]


@pytest.mark.parametrize("room", ROOMS)
def test_a_tshirt_is_read_in_its_middle_size_whatever_the_habits(room: str, tmp_path: Path) -> None:
    draft = read_drafted(ROOMS[room](tmp_path / "tee.dxf"))
    assert kinds(draft) == TRUE_SEAMS["tshirt"]
    assert areas(draft) == pytest.approx(drafted_areas("M"), rel=EXACT)


@pytest.mark.parametrize("room", ["shadows", "counted_blocks", "nested_outlines"])
def test_sizes_are_from_small_to_large(room: str, tmp_path: Path) -> None:
    path = ROOMS[room](tmp_path / "tee.dxf")
    sizes = read_drafted(path).sizes
    assert len(sizes) == len(SIZES)
    for size, wanted in zip(sizes, SIZES, strict=True):
        draft = read_drafted(path, DraftOptions(size=size))
        assert areas(draft) == pytest.approx(drafted_areas(wanted), rel=EXACT)
        assert kinds(draft) == TRUE_SEAMS["tshirt"]


WAYS = {
    "stated": {"packed": True},
    "counted": {"texts": False},
    "inches": {"unit": INCH},
    "across": {"unit": INCH, "across": True, "packed": True},
}


@pytest.mark.parametrize("way", WAYS)
def test_a_grade_rule_table_makes_sizes(way: str, tmp_path: Path) -> None:
    path = graded(tmp_path / "tee.dxf", **WAYS[way])  # type: ignore[arg-type]
    assert read_drafted(path).size == "M"
    for size in SIZES:
        draft = read_drafted(path, DraftOptions(size=size))
        assert draft.sizes == tuple(SIZES)
        assert areas(draft) == pytest.approx(drafted_areas(size), rel=EXACT)
        assert kinds(draft) == TRUE_SEAMS["tshirt"]


def test_points_between_rules_move_in_proportion() -> None:
    """Upper corners move by (10, 20), the lower ones not: half-way up the sides points move by half of it."""
    loop = np.array([(0.0, 0.0), (300.0, 0.0), (300.0, 150.0), (300.0, 300.0), (0.0, 300.0), (0.0, 150.0), (0.0, 0.0)])
    rules = [(loop[0], 1), (loop[1], 1), (loop[3], 2), (loop[4], 2)]
    piece = Drawn("P", lines={CUT: [loop]}, points={NOTCH: [np.array([300.0, 151.0])]}, rules=rules)
    table = GradeTable(("S", "M"), "S", True, {1: np.zeros((2, 2)), 2: np.array([(0.0, 0.0), (10.0, 20.0)])})
    (small, large), _ = by_rules([piece], table, 1e-3)
    assert small.lines[CUT][0] is loop
    moved = large.lines[CUT][0] - loop
    np.testing.assert_allclose(moved[:, 0], [0, 0, 5, 10, 10, 5, 0])
    np.testing.assert_allclose(moved[:, 1], 2 * moved[:, 0])
    np.testing.assert_allclose(large.points[NOTCH], [(305.0, 161.0)])


def test_a_table_of_another_file_is_told(tmp_path: Path) -> None:
    path = graded(tmp_path / "tee.dxf", texts=False)
    path.with_suffix(".RUL").write_text("SIZE LIST: S M L\nSAMPLE SIZE: M\nRULE: DELTA 1\n1,0 0,0 2,0\n")
    draft = read_drafted(path)
    assert any("no point of a piece has a rule" in note for note in draft.notes)
    path.with_suffix(".RUL").unlink()
    assert any("grade rule table tee" in note for note in read_drafted(path).notes)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "lists no sizes"),
        ("SIZE LIST: S S\n", "lists no sizes, or one of them twice"),
        ("SIZE LIST: S M\nRULE: DELTA 1\n1,0\n", "has 1 pairs of numbers for 2 sizes"),
        ("SIZE LIST: S\nRULE: DELTA 1\n1e300,0\n", "a number is not usable"),
    ],
)
def test_a_damaged_table_is_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_grade_table("x.rul", text.encode())


@given(st.binary(max_size=300))
def test_any_bytes_are_a_table_or_refused(data: bytes) -> None:
    with contextlib.suppress(InputError):
        read_grade_table("x.rul", b"SIZE LIST: S M\nSAMPLE SIZE: M\nRULE: DELTA 1\n" + data)


@pytest.mark.parametrize("kind", ["v", "slit", "u", "outward"])
def test_notches_are_closed_and_darts_are_kept(kind: str) -> None:
    shapes = {
        "v": [(0.2, 0.0), (0.203, 0.006), (0.206, 0.0)],
        "slit": [(0.2, 0.0), (0.2005, 0.006), (0.2006, 0.0)],
        "u": [(0.2, 0.0), (0.2, 0.006), (0.206, 0.006), (0.206, 0.0)],
        "outward": [(0.2, 0.0), (0.203, -0.006), (0.206, 0.0)],
    }
    around = [(0.5, 0.0), (0.5, 0.6), (0.0, 0.6)]
    loop, notches = unnotched(np.array([(0.0, 0.0), *shapes[kind], *around]))
    assert area_of(loop) == pytest.approx(0.3, abs=1e-9)
    assert notches == pytest.approx(np.array([np.mean([shapes[kind][0], shapes[kind][-1]], axis=0)]))
    dart = np.array([(0.0, 0.0), (0.2, 0.0), (0.21, 0.09), (0.22, 0.0), *around])
    assert len(unnotched(dart)[0]) == len(dart)


@pytest.mark.parametrize(
    ("text", "copies"),
    [
        ("Quantity: 1,1", (1, 1)),
        ("Cut: 2", (1, 1)),
        ("Annotation: SHELL*2", (1, 1)),
        ("Annotation: IL(L*1-R*0)", (1, 0)),
        ("ANNOTATION: 1XFABRIC", (1, 0)),
        ("Cut 2 on fold", (1, 1)),
        ("cut 1 pair", (1, 1)),
        ("Cut 1+1 shell", (1, 1)),
        ("Cut 2, 1 cm seam allowance", (1, 1)),
        ("Cut 2 + 3/8 in allowance", (1, 1)),
        ("Cut 2, 1 lining", (1, 1)),
        ("Cut 4, 2 pairs", (4, 4)),
        ("Rib 1x1", None),
        ("Grösse 40 x 60", None),
    ],
)
def test_how_often_a_piece_is_cut(text: str, copies: tuple[int, int] | None) -> None:
    drawn = Drawn("X")
    drawn.state(text)
    assert copies_of(drawn, drawn.texts) == copies


def test_a_label_names_a_piece() -> None:
    drawn = Drawn("", remarks=["12", "Cut 2 on fold", "Summer dress", "Left sleeve"])
    assert name_of(drawn) == "Left sleeve"
    assert name_of(Drawn("", remarks=["Cut 2"])) == "piece"
    assert name_of(Drawn("BACK YOKEX1-35")) == "BACK YOKE"
