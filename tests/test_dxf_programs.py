"""DXF files as programs write them: what each leaves out, repeats or names in its own way is read alike."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from dxf_patterns import GARMENTS, GRADES, TRUE_SEAMS, Style, band, write
from dxf_programs import CM, INCH, MM, PROGRAMS, Pieces, Writer, accumark, clo
from test_dxf import EDGE, EXACT, kinds
from test_fuzz_patterns import holds_its_promise
from test_pattern import area_of, topology

from warp_cloth.base.errors import InputError
from warp_cloth.pattern import DraftOptions, load_pattern, read_drafted
from warp_cloth.pattern.draft import Stated
from warp_cloth.pattern.kinds import named_all

CODES = {"FRONT": "FR", "BACK": "BK", "SLEEVE": "SL1", "NECKBAND": "CO"}


def sized(garment: str, sizes: str = "SML") -> Pieces:
    return {size: GARMENTS[garment](GRADES[size]) for size in sizes}


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_tshirt_is_read_in_every_size_whatever_program_wrote_it(program: str, tmp_path: Path) -> None:
    sizes = "M" if program == "valentina" else "SML"
    path = PROGRAMS[program](tmp_path / "tshirt.dxf", sized("tshirt", sizes))
    for size in sizes:
        draft = read_drafted(path, DraftOptions(size=size))
        assert kinds(draft) == TRUE_SEAMS["tshirt"]
        low, high = draft.parts[0].shape.box
        wanted = 0.7 + 0.015 * GRADES[size]
        assert high[1] - low[1] == pytest.approx(wanted, rel=EXACT)


def test_what_only_the_sample_size_states_goes_for_all(tmp_path: Path) -> None:
    path = accumark(tmp_path / "tee.dxf", sized("tshirt"), "S", lambda name: f"CLASSIC TEE{CODES[name]}")
    assert read_drafted(path).size == "S"  # the sample size, not the middle one
    drafts = [read_drafted(path, DraftOptions(size=size)) for size in "SL"]
    for draft in drafts:
        assert kinds(draft) == TRUE_SEAMS["tshirt"]
        assert [len(part.edges) for part in draft.parts] == [len(part.edges) for part in drafts[0].parts]
        assert [len(part.notches) for part in draft.parts] == [len(part.notches) for part in drafts[0].parts]
    assert sum(len(part.notches) for part in drafts[0].parts) > 8


def test_names_that_are_codes_of_a_style_are_told_apart(tmp_path: Path) -> None:
    path = PROGRAMS["optitex"](tmp_path / "tee.dxf", sized("tshirt", "M"))
    path.write_bytes(path.read_bytes().replace(b"Piece Name:", b"Piece Name:B2204 TEE "))
    for name, code in CODES.items():
        path.write_bytes(path.read_bytes().replace(f"B2204 TEE {name}".encode(), f"B2204 TEE{code}".encode()))
    draft = read_drafted(path)
    assert kinds(draft) == TRUE_SEAMS["tshirt"]


def test_codes_of_several_words_are_what_the_first_says() -> None:
    names = [
        "REGULAR TEEFR",
        "REGULAR TEEBK",
        "REGULAR TEESL FR",
        "REGULAR TEESL BK",
        "REGULAR TEECO",
        "REGULAR TEEPKT",
    ]
    found = [what.kind for what in named_all([(name, "", "") for name in names])]
    assert found == ["front", "back", "sleeve", "sleeve", "collar", "none"]
    named_so = [("FRONT", "", ""), ("SIDE FRONT", "", ""), ("11", "BACK", ""), ("12", "", "Lining")]
    assert [what.kind for what in named_all(named_so)] == ["front", "front", "back", "none"]


@pytest.mark.parametrize("unit", [CM, MM])
def test_metric_is_what_makes_a_garment(unit: float, tmp_path: Path) -> None:
    draft = read_drafted(clo(tmp_path / "tee.dxf", sized("tshirt", "M"), unit))
    assert np.ptp(np.stack(draft.parts[0].shape.box)[:, 1]) == pytest.approx(0.7, rel=EXACT)


def test_a_file_without_a_unit_takes_the_likeliest(tmp_path: Path) -> None:
    for unit in (CM, MM, INCH, 10.0 * MM):
        path = clo(tmp_path / "tee.dxf", sized("tshirt", "M"), unit)
        path.write_text(path.read_text().replace("UNITS: METRIC", "NO UNITS"))
        draft = read_drafted(path)
        assert np.ptp(np.stack(draft.parts[0].shape.box)[:, 1]) == pytest.approx(0.7, rel=EXACT)
        assert any("no unit is stated" in note for note in draft.notes)


def test_a_house_in_millimetres_is_no_garment_in_tenths_of_them(tmp_path: Path) -> None:
    path = clo(tmp_path / "house.dxf", sized("tshirt", "M"), 10.0 * MM)
    path.write_text(path.read_text().replace("UNITS: METRIC", "UNITS: MM"))
    with pytest.raises(InputError, match="no garment's size in any unit"):
        read_drafted(path)
    path.write_text(path.read_text().replace("UNITS: MM", "UNITS: 0.1 MM"))
    assert np.ptp(np.stack(read_drafted(path).parts[0].shape.box)[:, 1]) == pytest.approx(0.7, rel=EXACT)


def test_a_lining_by_its_material_is_left_out(tmp_path: Path) -> None:
    path = PROGRAMS["optitex"](tmp_path / "tee.dxf", sized("tshirt", "M"))
    head, tail = path.read_bytes().split(b"Material:SELF", 1)
    path.write_bytes(head + b"Material:Fusible" + tail)
    draft = read_drafted(path)
    assert "FRONT" not in {part.name for part in draft.parts}
    assert any('piece "FRONT" is left out: by its name or material' in note for note in draft.notes)


def test_pieces_on_one_sheet_are_pieces(tmp_path: Path) -> None:
    document = ezdxf.new("R12")
    sheet = document.blocks.new("SHEET")
    for number, name in enumerate(("FRONT", "BACK")):
        block = document.blocks.new(name)
        block.add_polyline2d([(0, 0), (400, 0), (400, 600), (0, 600), (0, 0)], dxfattribs={"layer": "1"})
        sheet.add_blockref(name, (500.0 * number, 0.0))
    document.modelspace().add_blockref("SHEET", (0, 0))
    document.saveas(tmp_path / "sheet.dxf")
    assert [part.name for part in read_drafted(tmp_path / "sheet.dxf").parts] == ["FRONT", "BACK"]


def test_blocks_without_layers_are_pieces_by_their_largest_loop(tmp_path: Path) -> None:
    document = ezdxf.new("R12")
    block = document.blocks.new("FRONT")
    block.add_polyline2d([(0, 0), (400, 0), (400, 600), (0, 600), (0, 0)], dxfattribs={"layer": "0"})
    block.add_line((100, 100), (100, 500), dxfattribs={"layer": "0"})
    document.saveas(tmp_path / "plain.dxf")
    draft = read_drafted(tmp_path / "plain.dxf")
    assert sum(edge.area for edge in draft.parts[0].edges) == pytest.approx(0.24, rel=EXACT)


def sew_line_but_for_the_fold() -> Writer:
    out = Writer(MM)
    out.add(0, "SECTION", 2, "BLOCKS", 0, "BLOCK", 8, 0, 2, "FRONT", 70, 0, 10, 0, 20, 0)
    out.polyline([(0, 0), (21, 0), (21, 61), (0, 61), (0, 0)], 1)
    out.polyline([(0, 1), (20, 1), (20, 60), (0, 60)], 14)
    out.line((0, 0), (0, 61), 6)
    out.add(0, "ENDBLK", 0, "ENDSEC", 0, "SECTION", 2, "ENTITIES", 0, "ENDSEC", 0, "EOF")
    return out


def test_a_sew_line_may_leave_out_the_fold(tmp_path: Path) -> None:
    draft = read_drafted(sew_line_but_for_the_fold().save(tmp_path / "fold.dxf"))
    assert sum(edge.area for edge in draft.parts[0].edges) == pytest.approx(0.4 * 0.59, rel=EXACT)


def holed(path: Path, layer: str, *loops: list[tuple[float, float]], fold: bool = False) -> Path:
    document = ezdxf.new("R12")
    block = document.blocks.new("FRONT")
    block.add_polyline2d([(0, 0), (400, 0), (400, 600), (0, 600), (0, 0)], dxfattribs={"layer": "1"})
    for loop in loops:
        block.add_polyline2d([*loop, loop[0]], dxfattribs={"layer": layer})
    if fold:
        block.add_line((0, 0), (0, 600), dxfattribs={"layer": "6"})
    document.saveas(path)
    return path


SQUARE = [(100.0, 200.0), (200.0, 200.0), (200.0, 300.0), (100.0, 300.0)]
DISC = [(float(300 + 40 * np.cos(a)), float(450 - 40 * np.sin(a))) for a in np.linspace(0, 2 * np.pi, 60)[:-1]]


@pytest.mark.parametrize("layer", ["11", "1"])
@pytest.mark.parametrize("fold", [False, True])
def test_cut_outs_are_holes_in_the_mesh(layer: str, fold: bool, tmp_path: Path) -> None:
    path = holed(tmp_path / "holed.dxf", layer, SQUARE, DISC, fold=fold)
    mesh = load_pattern(path, edge=EDGE)
    holes_sewn_shut = 4 if fold else 2
    assert topology(mesh) == (1 + holes_sewn_shut, 1 - holes_sewn_shut)
    wanted = (1 + fold) * (0.24 - 0.01 - np.pi * 0.04**2)
    assert area_of(mesh) == pytest.approx(wanted, rel=3e-3)
    holds_its_promise(mesh)


def test_small_outer_and_open_cut_outs_are_left_closed_and_told(tmp_path: Path) -> None:
    eyelet = [(50.0, 50.0), (54.0, 50.0), (54.0, 54.0), (50.0, 54.0)]
    outer = [(390.0, 100.0), (450.0, 100.0), (450.0, 200.0), (390.0, 200.0)]
    mesh = load_pattern(holed(tmp_path / "holed.dxf", "11", eyelet, outer), edge=EDGE)
    assert topology(mesh) == (1, 1)
    assert 'piece "FRONT": a cut-out of 4 mm is left closed' in mesh.notes
    assert 'piece "FRONT": a cut-out of 100 mm does not lie within it: left closed' in mesh.notes


def test_holes_of_a_pair_are_mirrored(tmp_path: Path) -> None:
    path = holed(tmp_path / "holed.dxf", "11", SQUARE)
    draft = read_drafted(path, DraftOptions(pieces={"FRONT": Stated("sleeve", (1, 1))}))
    middles = [np.mean([edge.start for edge in part.holes[0]], axis=0) for part in draft.parts]
    np.testing.assert_allclose(middles, [[0.15, 0.25], [-0.15, 0.25]], atol=1e-9)
    assert all(sum(edge.area for edge in part.holes[0]) > 0 for part in draft.parts)


def test_what_ezdxf_mends_is_not_printed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    read_drafted(clo(tmp_path / "tee.dxf", sized("tshirt", "M")))
    assert capfd.readouterr().err == ""


def test_kinds_are_counted_once(tmp_path: Path) -> None:
    draft = read_drafted(PROGRAMS["lectra"](tmp_path / "tee.dxf", sized("tshirt", "M")))
    assert Counter(part.kind for part in draft.parts) == {"front": 1, "back": 1, "sleeve": 2, "collar": 1}


def test_metric_beside_a_code_that_makes_no_garment_is_millimetres(tmp_path: Path) -> None:
    """A code of metres, as ezdxf writes of itself; before, 24 cm were taken for 2.4 m, as nearer to a usual garment."""
    path = write(tmp_path / "a.dxf", {"M": [band("FRONT", 24.0, 20.0)]}, Style("METRIC", entity="LINE", insunits=6))
    (front,) = read_drafted(path).parts
    assert float(np.ptp(front.edges[0].points, axis=0).max()) < 0.25
