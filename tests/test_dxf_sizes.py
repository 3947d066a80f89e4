"""The sizes of a DXF pattern in size runs and batches."""

from __future__ import annotations

from pathlib import Path

import pytest
from dxf_patterns import GRADES, Style, tshirt, write
from dxf_programs import CM, outline
from dxf_rooms import Blocks

from warp_cloth.base.errors import InputError
from warp_cloth.batch.jobs import read_jobs
from warp_cloth.batch.sizes import fit_sizes
from warp_cloth.pattern import read_drafted
from warp_cloth.scene import load_scene

SCENE = """
garment = {pattern = "shirt.dxf", edge_mm = 40}
avatar.shape.kind = "mannequin"
collision.pixel_mm = 10
solver.iterations = 5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("graded")
    write(place / "shirt.dxf", {size: tshirt(grade) for size, grade in GRADES.items()}, Style())
    (place / "scene.toml").write_text(SCENE)
    return place


def test_a_size_run_takes_every_size_of_the_file_or_those_named(folder: Path) -> None:
    run = fit_sizes(folder / "scene.toml", device="cpu")
    assert [each.size for each in run.sizes] == ["S", "M", "L"]
    areas = [each.fit.garments[0].rest.area for each in run.sizes if each.fit and each.fit.garments[0].rest]
    assert len(areas) == 3
    assert areas == sorted(areas)
    named = fit_sizes(folder / "scene.toml", ["M"], device="cpu")
    assert [each.size for each in named.sizes] == ["M"]
    assert named.sizes[0].fit is not None
    assert named.sizes[0].fit.garments[0].rest.area == pytest.approx(areas[1])  # type: ignore[union-attr]


def test_a_size_that_the_file_has_not_is_told(folder: Path) -> None:
    with pytest.raises(InputError, match="its sizes are S, M, L"):
        fit_sizes(folder / "scene.toml", ["XXL"], device="cpu")


def test_a_mesh_still_has_no_sizes(folder: Path) -> None:
    changes = ["garment.edge_mm=40", "solver.iterations=1"]
    single = write(folder / "one.dxf", {"": tshirt()}, Style())
    with pytest.raises(InputError, match="the garment comes in one size"):
        fit_sizes(folder / "scene.toml", overrides=[*changes, f"garment.pattern={single}"], device="cpu")


@pytest.mark.parametrize("of", ['scene = "scene.toml"\n', 'scene = "tshirt"\ngarment.pattern = "shirt.dxf"\n'])
def test_a_product_takes_the_sizes_of_a_pattern(of: str, folder: Path) -> None:
    jobs = folder / "jobs.toml"
    jobs.write_text(f'{of}[product]\nsizes = ["S", "L"]\nfabrics = ["denim"]\n')
    items = read_jobs(jobs)
    assert [item.name for item in items] == ["S-denim", "L-denim"]
    assert ["garment.size=L" in change for change in items[1].changes].count(True) == 1
    if "scene.toml" in of:
        assert load_scene(items[1].scene, items[1].changes).garments[0].size == "L"


def test_a_product_of_patterns_takes_their_sizes(folder: Path) -> None:
    jobs = folder / "folder.toml"
    jobs.write_text('scene = "tshirt"\n[product]\ngarments = ["*.dxf"]\nsizes = ["M"]\n')
    assert {"garment.size=M" in item.changes for item in read_jobs(jobs)} == {True}


def blocks_of(path: Path, name: str, *, states_names: bool) -> Path:
    """Three sizes in blocks of these names, where nothing else states a size."""
    out = Blocks(CM)
    for size, grade in (("38", -1.0), ("40", 0.0), ("42", 1.0)):
        for piece in tshirt(grade):
            texts = [f"Piece Name: {piece.name}"] if states_names else []
            out.begin(name.format(piece=piece.name, size=size), [*texts, f"Quantity: {piece.quantity}"])
            out.polyline(outline(piece), 1, closed=True)
            out.end_block(piece)
    return out.finish(path)


@pytest.mark.parametrize("states_names", [True, False])
@pytest.mark.parametrize("name", ["{piece}-{size}", "{piece}@{size}", "{size}-{piece}", "{piece} ({size})"])
def test_names_of_blocks_state_sizes(name: str, states_names: bool, tmp_path: Path) -> None:
    """Before, they were numbered 1 to 3 where texts state the names, and not told apart where numbers come first."""
    draft = read_drafted(blocks_of(tmp_path / "shirt.dxf", name, states_names=states_names))
    assert draft.sizes == ("38", "40", "42")
    assert draft.size == "40"
    assert {part.name for part in draft.parts} == {"FRONT", "BACK", "SLEEVE", "SLEEVE mirrored", "NECKBAND"}


def test_left_and_right_in_names_of_blocks_are_no_sizes(tmp_path: Path) -> None:
    out = Blocks(CM)
    for piece in tshirt():
        for side in ("L", "R") if piece.name == "SLEEVE" else ("1",):
            out.begin(f"{piece.name}-{side}", [f"Piece Name: {piece.name}", "Quantity: 1"])
            out.polyline(outline(piece), 1, closed=True)
            out.end_block(piece)
    assert read_drafted(out.finish(tmp_path / "shirt.dxf")).sizes == ()
