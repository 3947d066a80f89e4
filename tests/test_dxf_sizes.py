"""The sizes of a DXF pattern in size runs and batches."""

from __future__ import annotations

from pathlib import Path

import pytest
from dxf_patterns import GRADES, Style, tshirt, write

from warp_cloth.base.errors import InputError
from warp_cloth.batch.jobs import read_jobs
from warp_cloth.batch.sizes import fit_sizes
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
