"""Darts drawn as inner lines of a DXF file's pieces: found however they are drawn, cut out and sewn; others left."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_darted import BUST, EYE, MOUTH, TRUE_DARTED_SEAMS, darted
from dxf_patterns import Drafted, Point, Style, tshirt, write
from test_pattern import area_of, topology

from warp_cloth.pattern import DraftOptions, load_pattern, read_drafted
from warp_cloth.pattern.draft import Stated
from warp_cloth.pattern.drafted import Draft, drafted_pattern
from warp_cloth.pattern.drawn_darts import Cut, with_darts
from warp_cloth.pattern.dxf_drawn import INTERNAL, layer_number
from warp_cloth.pattern.proposal import SEWN_FROM

EDGE = 0.03  # [m]; coarse, for speed
STYLES = [Style(), Style("ENGLISH", turned=90.0, entity="LWPOLYLINE", allowance=1.0)]
SQUARE = np.array([(0.0, 0.0), (0.4, 0.0), (0.4, 0.4), (0.0, 0.4)])
TIP, MOUTHS = (0.3, 0.2), [(0.4, 0.18), (0.4, 0.22)]


def drafted(
    folder: Path, pieces: list[Drafted], style: Style = STYLES[0], stated: dict[str, Stated] | None = None
) -> Draft:
    return read_drafted(write(folder / "darted.dxf", {"M": pieces}, style), DraftOptions(pieces=stated or {}))


def undarted(pieces: list[Drafted]) -> list[Drafted]:
    return [replace(piece, inner=[]) for piece in pieces]


def cut(*lines: list[Point]) -> Cut:
    return with_darts(SQUARE, [np.array(line) for line in lines])


def area(points: np.ndarray) -> float:
    (x, y), (a, b) = points.T, np.roll(points, -1, axis=0).T
    return 0.5 * float((x * b - y * a).sum())


@pytest.mark.parametrize("style", STYLES, ids=["plain", "with allowance"])
def test_darts_are_found_with_all_other_seams(style: Style, tmp_path: Path) -> None:
    draft = drafted(tmp_path, darted(), style)
    sewn = Counter(joint.reason.split(",")[0] for joint in draft.joints)
    assert sewn == TRUE_DARTED_SEAMS
    assert min(joint.confidence for joint in draft.joints) > 0.9 > SEWN_FROM
    assert [len(part.darts) for part in draft.parts if part.name in ("FRONT", "BACK")] == [0, 2]


def test_darts_take_their_area_and_close(tmp_path: Path) -> None:
    draft = drafted(tmp_path, darted())
    whole = drafted_pattern(drafted(tmp_path, undarted(darted())), None)
    areas = [abs(panel.area) for panel in drafted_pattern(draft, None).panels]
    lacking = np.array([abs(panel.area) for panel in whole.panels]) - areas
    front, back = 2 * 0.5e-4 * MOUTH * BUST, 2 * 2e-4 * EYE[0] * EYE[1]
    np.testing.assert_allclose(lacking, [front, back, *np.zeros(len(areas) - 2)], atol=1e-8)
    mesh = load_pattern(write(tmp_path / "d.dxf", {"M": darted()}), edge=EDGE)
    plain = load_pattern(write(tmp_path / "p.dxf", {"M": undarted(darted())}), edge=EDGE)
    assert topology(mesh) == topology(plain)
    assert area_of(mesh) == pytest.approx(area_of(plain) - front - back, rel=1e-3)


def test_darts_are_left_where_the_scene_says_so(tmp_path: Path) -> None:
    stated = {name: Stated(darts=False) for name in ("FRONT", "BACK")}
    draft = drafted(tmp_path, darted(), stated=stated)
    assert not any(joint.reason.startswith("dart") for joint in draft.joints)
    assert not any(part.darts for part in draft.parts)


@pytest.mark.parametrize(
    "lines",
    [
        [[MOUTHS[0], TIP, MOUTHS[1]]],
        [[MOUTHS[0], TIP], [MOUTHS[1], TIP]],
        [[TIP, MOUTHS[0]], [TIP, MOUTHS[1]], [TIP, (0.4, 0.2)]],  # with the fold between them
        [[(0.41, 0.178), TIP, (0.41, 0.222)]],  # up to the cut line
        [[(0.397, 0.1806), TIP, (0.397, 0.2194)]],  # not quite to the outline
    ],
    ids=["one line", "two", "with a fold", "beyond", "short"],
)
def test_a_v_is_cut_out_of_the_outline(lines: list[list[Point]]) -> None:
    made = cut(*lines)
    assert area(made.outline) == pytest.approx(0.16 - 0.5 * 0.04 * 0.1, rel=1e-4)
    assert len(made.outline) == 7
    np.testing.assert_allclose(made.corners, [MOUTHS[0], TIP, MOUTHS[1]], atol=1e-4)


def test_a_v_at_the_outlines_first_point_is_cut_out() -> None:
    made = with_darts(
        np.roll(np.insert(SQUARE, 2, (0.4, 0.2), axis=0), -2, axis=0), [np.array([MOUTHS[0], TIP, MOUTHS[1]])]
    )
    assert area(made.outline) == pytest.approx(0.16 - 0.5 * 0.04 * 0.1)


def test_two_vs_on_one_edge_are_cut_out() -> None:
    other = [(0.1, 0.4), (0.12, 0.25), (0.14, 0.4)]
    made = cut([MOUTHS[0], TIP, MOUTHS[1]], other, [(0.26, 0.4), (0.28, 0.25), (0.3, 0.4)])
    assert area(made.outline) == pytest.approx(0.16 - 0.5 * 0.04 * (0.1 + 2 * 0.15))
    assert len(made.removed) == 3


EYE_POINTS = [(0.2, 0.3), (0.22, 0.2), (0.2, 0.1), (0.18, 0.2)]


@pytest.mark.parametrize(
    "lines",
    [
        [[*EYE_POINTS, EYE_POINTS[0]]],
        [[*EYE_POINTS[1:], *EYE_POINTS[:2]]],  # from its waist on
        [EYE_POINTS[:3], [EYE_POINTS[2], EYE_POINTS[3], EYE_POINTS[0]]],
        [[a, b] for a, b in zip(EYE_POINTS, [*EYE_POINTS[1:], EYE_POINTS[0]], strict=True)],
        [[*EYE_POINTS, EYE_POINTS[0]], [EYE_POINTS[0], EYE_POINTS[2]]],  # with the fold between them
    ],
    ids=["closed", "from the waist", "two lines", "four", "with a fold"],
)
def test_a_diamond_is_a_dart_within(lines: list[list[Point]]) -> None:
    made = cut(*lines)
    assert made.outline is SQUARE or np.array_equal(made.outline, SQUARE)
    (dart,) = made.inner
    assert sum(leg.area for leg in dart.loop) == pytest.approx(0.5 * 0.04 * 0.2)
    assert len(dart.one) == len(dart.other) == 2
    tips = {tuple(np.round(dart.one[0].start, 9)), tuple(np.round(dart.other[0].start, 9))}
    assert tips == {EYE_POINTS[0], EYE_POINTS[2]}


@pytest.mark.parametrize(
    "line",
    [
        [(0.1, 0.1), (0.25, 0.1), (0.25, 0.25), (0.1, 0.25), (0.1, 0.1)],  # a pocket
        [(0.1, 0.1), (0.24, 0.1), (0.24, 0.115), (0.1, 0.115), (0.1, 0.1)],  # a welt
        [(0.4, 0.05), (0.1, 0.2), (0.4, 0.35)],  # a yoke's line, too wide
        [(0.4, 0.15), (0.3, 0.2), (0.3, 0.1), (0.4, 0.12)],  # no V
        [(0.35, 0.18), (0.2, 0.2), (0.35, 0.22)],  # a V that ends within
        [(0.4, 0.18), (0.3, 0.2), (0.32, 0.21)],  # of legs that differ
        [(0.1, 0.1), (0.3, 0.3)],
        [(0.4, 0.2), (0.3, 0.2), (0.4, 0.2)],  # there and back
        [(0.2, 0.3), (0.201, 0.2), (0.2, 0.1), (0.199, 0.2), (0.2, 0.3)],  # as good as a line
    ],
)
def test_other_inner_lines_are_left(line: list[Point]) -> None:
    made = cut(line)
    assert np.array_equal(made.outline, SQUARE)
    assert not made.inner


def test_lines_that_cross_are_no_darts() -> None:
    made = cut([MOUTHS[0], TIP, MOUTHS[1]], [(0.34, 0.4), (0.36, 0.1), (0.38, 0.4)])
    assert np.array_equal(made.outline, SQUARE)
    (dart,) = cut([*EYE_POINTS, EYE_POINTS[0]], [(x + 0.01, y) for x, y in [*EYE_POINTS, EYE_POINTS[0]]]).inner
    assert sum(leg.area for leg in dart.loop) == pytest.approx(0.5 * 0.04 * 0.2)


def test_a_round_dart_keeps_its_legs() -> None:
    t = np.linspace(0.0, math.pi, 33)
    right = np.column_stack([0.2 + 0.02 * np.sin(t) ** 2, 0.3 - 0.2 * t / math.pi])
    left = np.column_stack([0.4 - right[:, 0], right[:, 1]])[::-1]
    (dart,) = with_darts(SQUARE, [np.concatenate([right, left[1:]])]).inner
    assert dart.one[0].length == pytest.approx(dart.other[0].length)


def test_a_dart_that_opens_at_the_fold_line_is_left_as_drawn(tmp_path: Path) -> None:
    front, *others = tshirt()
    folded = replace(front, inner=[[(0.0, 45.0), (10.0, 43.5), (0.0, 42.0)]])
    draft = drafted(tmp_path, [folded, *others])
    (left,) = [note for note in draft.notes if "dart opens at its fold line" in note]
    assert left.startswith('piece "FRONT"')
    whole = drafted(tmp_path, [front, *others])
    assert [len(panel.edges) for panel in drafted_pattern(draft, None).panels] == [
        len(panel.edges) for panel in drafted_pattern(whole, None).panels
    ]


@pytest.mark.parametrize(
    ("name", "number"), [("Darts", INTERNAL), ("pinces poitrine", INTERNAL), ("Front dart bodice", None)]
)
def test_layers_of_darts_begin_with_the_word(name: str, number: int | None) -> None:
    assert layer_number(name) == number
