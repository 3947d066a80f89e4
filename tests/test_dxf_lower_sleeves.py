"""Sleeves cut across are sewn together: the lower piece to the hem of the upper one, cuffs to the lower."""

from __future__ import annotations

from pathlib import Path

import pytest
from dxf_patterns import TRUE_SEAMS, Drafted, band, length, line, middle, sleeve, tshirt, write
from test_dxf import kinds

from warp_cloth.pattern import read_drafted
from warp_cloth.pattern.drafted import drafted_pattern

TRUE = {**TRUE_SEAMS["tshirt"], "underarm": 4, "lower sleeve": 2}


def cut_across(share: float, names: tuple[str, str], wider: float = 0.0) -> list[Drafted]:
    """A long-sleeved T-shirt, its sleeves cut at this share of the underarm; ``wider``: the lower piece's top [cm]."""
    front, back, _, neckband = tshirt()
    whole = sleeve("SLEEVE", 18.0, 56.0, 13.0, length(front.edges[2]), length(back.edges[2]))
    hem, right, cap, left = whole.edges
    (x, y), low = middle(right, share), hem[1][0]
    upper = [line((-x, y), (x, y)), line((x, y), right[-1]), cap, line(left[0], (-x, y))]
    out = x + wider
    lower = [hem, line((low, 0.0), (out, y)), line((out, y), (-out, y)), line((-out, y), (-low, 0.0))]
    return [front, back, Drafted(names[0], upper, "2"), Drafted(names[1], lower, "2"), neckband]


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("names", [("UPPER SLEEVE", "LOWER SLEEVE"), ("Oberärmel", "Unterärmel")])
def test_a_lower_sleeve_is_sewn_to_the_upper_one(names: tuple[str, str], share: float, tmp_path: Path) -> None:
    """It was sewn to nothing but itself, and started round the upper arm."""
    pieces = cut_across(share, names)
    for order in (pieces, pieces[::-1]):
        draft = read_drafted(write(tmp_path / "a.dxf", {"M": order}))
        assert kinds(draft) == TRUE
        for joint in draft.joints:
            if joint.reason.startswith("lower sleeve"):
                assert (
                    len({draft.parts[side.panel].name.endswith("mirrored") for side in (*joint.one, *joint.other)}) == 1
                )
        panels = {panel.name: panel for panel in drafted_pattern(draft, None).panels}
        upper, lower = (panels[name].placed(panels[name].edges[0].curve.at([0.5])) for name in names)
        assert lower[0, 1] < upper[0, 1] - 0.1  # its hem farther down the arm


def test_a_cuff_goes_round_the_lower_sleeve(tmp_path: Path) -> None:
    pieces = [*cut_across(0.4, ("UPPER SLEEVE", "LOWER SLEEVE")), band("CUFF", 20.0, 6.0, "2")]
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": pieces}))
    assert kinds(draft) == {**TRUE, "cuff": 2, "cuff ends": 2}
    cuffs = [joint for joint in draft.joints if joint.reason.startswith("cuff,")]
    assert {draft.parts[side.panel].kind for joint in cuffs for side in joint.other} == {"lower_sleeve"}


@pytest.mark.parametrize(("names", "wider"), [(("SLEEVE", "SLEEVE 2"), 0.0), (("SLEEVE", "LOWER SLEEVE"), 2.0)])
def test_what_is_not_named_so_or_does_not_fit_is_not_sewn(names: tuple[str, str], wider: float, tmp_path: Path) -> None:
    draft = read_drafted(write(tmp_path / "a.dxf", {"M": cut_across(0.5, names, wider)}))
    assert not kinds(draft)["lower sleeve"]
