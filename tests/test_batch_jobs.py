"""Job files: tables and products become scenes with changes; what is wrong with a row stays with the row."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.parquet
import pytest
from refusals import refusal

from warp_cloth.base.errors import InputError
from warp_cloth.batch import Item, read_jobs
from warp_cloth.batch.jobs import read_products
from warp_cloth.scene import load_scene

ROWS: list[dict[str, Any]] = [
    {"name": "a", "scene": "hanging", "garment.fabric": "silk", "solver.iterations": 100},
    {"name": "b", "scene": "sphere", "garment.fabric": None, "solver.iterations": 200},
]
ITEMS = [
    Item("a", "hanging", ("garment.fabric=silk", "solver.iterations=100")),
    Item("b", "sphere", ("solver.iterations=200",)),
]


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_csv_parquet_and_toml_give_the_same_items(tmp_path: Path) -> None:
    csv = write(
        tmp_path, "jobs.csv", "name,scene,garment.fabric,solver.iterations\na,hanging,silk,100\n\n, ,,\nb,sphere,,200\n"
    )
    parquet = tmp_path / "jobs.parquet"
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(ROWS), parquet)
    toml = write(
        tmp_path,
        "jobs.toml",
        '[[item]]\nname = "a"\nscene = "hanging"\ngarment.fabric = "silk"\nsolver.iterations = 100\n'
        '[[item]]\nname = "b"\nscene = "sphere"\n"solver.iterations" = 200\n',
    )
    assert read_jobs(csv) == read_jobs(parquet) == read_jobs(toml) == ITEMS


def test_numbers_as_data_frames_write_them_beside_empty_cells(tmp_path: Path) -> None:
    """3.0 for 3, no number for none, and in a column of tables every row with the keys of all."""
    first = {"solver.iterations": 100.0, "garment.fabric": {"weight": 0.3}}
    second = {"solver.iterations": float("nan"), "garment.fabric": {"thickness": Decimal("0.001")}}
    rows = [{"name": n, "scene": "sphere", "__index_level_0__": 7, **row} for n, row in ((1.0, first), (2.0, second))]
    path = tmp_path / "jobs.parquet"
    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), path)
    items = read_jobs(path)
    changes = [("solver.iterations=100", "garment.fabric.weight=0.3"), ("garment.fabric.thickness=0.001",)]
    assert [(item.name, item.changes) for item in items] == [("1", changes[0]), ("2", changes[1])]
    assert load_scene(items[0].scene, items[0].changes).solver.iterations == 100
    table = write(tmp_path, "jobs.csv", "name,scene,solver.iterations,collision.pixel_mm\n1.0,sphere,100.0,2.50\n")
    assert read_jobs(table) == [Item("1.0", "sphere", ("solver.iterations=100", "collision.pixel_mm=2.50"))]


def test_an_item_is_the_scene_that_the_command_line_makes_of_it(tmp_path: Path) -> None:
    toml = write(
        tmp_path,
        "jobs.toml",
        '[[item]]\nname = "a"\nscene = "hanging"\ngarment.shape = {kind = "square", side = 0.5}\n'
        'garment.fabric = {weight = 0.3}\ngarment.pin = [{vertices = [0, 1]}]\nsolver.method = "direct"\n',
    )
    (item,) = read_jobs(toml)
    scene = load_scene(item.scene, item.changes)
    assert scene.garments[0].shape.side == 0.5
    assert scene.garments[0].fabric.weight == 0.3
    assert scene.garments[0].fabric.name == "cotton", "the rest of the fabric is the scene's"
    assert scene.garments[0].pin[0].vertices == (0, 1)
    assert scene.solver.method == "direct"


def test_files_are_found_beside_the_job_file(tmp_path: Path) -> None:
    write(tmp_path, "my.toml", "")
    write(tmp_path, "shirt.obj", "")
    jobs = write(tmp_path, "jobs.csv", "name,scene,garment.mesh\na,my.toml,shirt.obj\nb,my.toml,elsewhere.obj\n")
    a, b = read_jobs(jobs)
    assert a.scene == str(tmp_path / "my.toml")
    assert a.changes == (f"garment.mesh={tmp_path / 'shirt.obj'}",)
    assert b.changes == ("garment.mesh=elsewhere.obj",)


def test_a_product_has_every_combination_once_the_last_axis_fastest(tmp_path: Path) -> None:
    jobs = write(
        tmp_path,
        "jobs.toml",
        'scene = "tshirt"\nsolver.iterations = 50\n[product]\nsizes = ["S", "L"]\n'
        'avatars = [{name = "tall", avatar.shape.stature = 1.9}, {name = "short", avatar.shape.stature = 1.6}]\n'
        'fabrics = ["silk", "denim"]\n',
    )
    items = read_jobs(jobs)
    assert [item.name for item in items] == [
        f"{size}-{body}-{fabric}" for size in "SL" for body in ("tall", "short") for fabric in ("silk", "denim")
    ]
    scene = load_scene(items[-1].scene, items[-1].changes)
    assert (scene.garments[0].shape.size, scene.avatar.shape.stature) == ("L", 1.6)
    assert (scene.garments[0].fabric.name, scene.solver.iterations) == ("denim", 50)


def test_what_a_size_changes_leaves_the_keys_beside_it(tmp_path: Path) -> None:
    jobs = write(
        tmp_path,
        "jobs.toml",
        'scene = "sphere"\ngarment.shape.vertices_per_side = 7\n'
        '[product]\nsizes = [{name = "S", garment.shape.side = 0.5}]\n',
    )
    (item,) = read_jobs(jobs)
    assert item.changes == ("garment.shape.vertices_per_side=7", "garment.shape.side=0.5")


def test_a_catalogue_has_each_garment_by_size_and_no_bodies(tmp_path: Path) -> None:
    product = '[product]\ngarments = ["shirt_{size}.obj", "skirt_{size}.obj"]\nsizes = ["S", "M"]\nfabrics = ["silk"]\n'
    garments, fabrics = read_products(write(tmp_path, "catalogue.toml", f'scene = "tshirt"\n{product}'))
    assert {name: list(sizes) for name, sizes in garments.items()} == {"shirt": ["S", "M"], "skirt": ["S", "M"]}
    assert garments["skirt"]["M"].changes == ("garment.mesh=skirt_M.obj",)
    assert fabrics == ("silk",)
    with pytest.raises(InputError, match="each request brings its body"):
        read_products(write(tmp_path, "bodies.toml", f'scene = "tshirt"\n{product}avatars = ["anna.obj"]\n'))
    swept = f'scene = "tshirt"\n{product}sweep.garment.fabric = ["silk"]\n'
    with pytest.raises(InputError, match=r"product\.sweep is for studies"):
        read_products(write(tmp_path, "swept.toml", swept))
    with pytest.raises(InputError, match="no product with garments"):
        read_products(write(tmp_path, "none.toml", 'scene = "tshirt"\n'))


def test_a_sweep_has_every_value_of_every_key(tmp_path: Path) -> None:
    text = """
        scene = "tshirt"
        [product]
        sizes = ["S", "M"]
        [product.sweep]
        avatar.shape.chest = {from = 0.9, to = 1.1, count = 3}
        garment.fabric = ["silk", "denim"]
    """
    items = read_jobs(write(tmp_path, "jobs.toml", text))
    assert len(items) == 12
    assert [item.name for item in items[:3]] == ["S-0.9-silk", "S-0.9-denim", "S-1.0-silk"]
    assert items[-1].columns == {
        "scene": "tshirt", "garment.shape.size": "M", "avatar.shape.chest": 1.1, "garment.fabric": "denim"
    }  # fmt: skip
    assert not any(item.problem for item in items)


def test_a_product_of_more_than_fits_a_batch_is_refused(tmp_path: Path) -> None:
    names = ", ".join(f'"{number}"' for number in range(1001))
    jobs = write(tmp_path, "jobs.toml", f'scene = "tshirt"\n[product]\nsizes = [{names}]\nfabrics = [{names}]\n')
    with pytest.raises(InputError, match=r"the product has 1,002,001 items; at most 1,000,000 go into one batch"):
        read_jobs(jobs)


def test_a_size_stands_in_the_name_of_a_garments_file(tmp_path: Path) -> None:
    for size in "SM":
        write(tmp_path, f"shirt_{size}.obj", "")
    jobs = write(
        tmp_path, "jobs.toml", 'scene = "tshirt"\n[product]\ngarments = ["shirt_{size}.obj"]\nsizes = ["S", "M"]\n'
    )
    items = read_jobs(jobs)
    assert [item.name for item in items] == ["shirt-S", "shirt-M"]
    assert [item.changes for item in items] == [(f"garment.mesh={tmp_path / f'shirt_{size}.obj'}",) for size in "SM"]


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("a,hanging,silk,extra", "the row has 4 cells, the header 3"),
        ("a,hanging", "the row has 2 cells, the header 3"),
        ("a,,silk", "the row names no scene"),
        ("../a,hanging,silk", 'column name: "../a" cannot be a file name'),
    ],
)
def test_a_bad_row_is_an_item_that_says_why(tmp_path: Path, row: str, problem: str) -> None:
    jobs = write(tmp_path, "jobs.csv", f"name,scene,garment.fabric\n{row}\nb,hanging,silk\n")
    bad, good = read_jobs(jobs)
    assert bad.problem.startswith(problem)
    assert not good.problem


def test_a_row_that_states_its_garment_needs_no_scene(tmp_path: Path) -> None:
    write(tmp_path, "shirt.obj", "")
    jobs = write(tmp_path, "jobs.csv", "name,garment.mesh,garment.fabric\na,shirt.obj,silk\nb,,silk\n")
    stated, bare = read_jobs(jobs)
    assert (stated.source, stated.problem) == ({}, "")
    assert stated.changes == (f"garment.mesh={tmp_path / 'shirt.obj'}", "garment.fabric=silk")
    assert bare.problem.startswith("the row names no scene")


@pytest.mark.parametrize("text", ["name,scene,,\na,hanging,,\n", ",name,scene\n0,a,hanging\n"])
def test_columns_of_spreadsheets_and_data_frames_without_a_name_are_left_out(tmp_path: Path, text: str) -> None:
    """Empty ones at the end of rows, and row numbers as pandas writes them by default."""
    (item,) = read_jobs(write(tmp_path, "jobs.csv", text))
    assert (item.name, item.problem, item.columns) == ("a", "", {"scene": "hanging"})


@pytest.mark.parametrize(
    ("name", "text", "told"),
    [
        ("jobs.csv", "name,scene\na,hanging\na,sphere\n", 'two items have the name "a"'),
        ("jobs.csv", "name,fabric\na,silk\n", 'has no column "scene"'),
        ("jobs.csv", "name,scene,scene\na,b,c\n", 'has the column "scene" twice'),
        ("jobs.csv", "name,scene,\na,hanging,blue\n", "has a column without a name"),
        ("jobs.toml", '[product]\nfabric = ["silk"]\n', "unknown key product.fabric; did you mean product.fabrics?"),
        ("jobs.csv", "name;scene\na;hanging\n", "separates cells by semicolons"),
        ("jobs.csv", "name\tscene\na\thanging\n", "separates cells by tabs"),
        ("jobs.csv", "name,scene\n", "has no items"),
        ("jobs.csv", "", "is empty"),
        ("jobs.csv", 'name,scene\na,hanging\n"b,hanging\nc,hanging\n', "jobs.csv:3: a cell's quotes are not closed"),
        ("jobs.csv", 'name,scene\na,"hang\n"\n"b,hanging\n"c",hanging\n', "jobs.csv:4: a cell's quotes"),
        ("jobs.parquet", "", "is empty"),
        ("jobs.parquet", "garbage", "not Parquet"),
        ("jobs.txt", "name,scene\n", "is not a format of job files"),
        ("jobs.toml", 'scene = "tshirt"\n', "needs either [[item]] tables or one [product]"),
        ("jobs.toml", '[product]\ncolours = ["red"]\n', "unknown key product.colours"),
        ("jobs.toml", "[product]\nsizes = []\n", "product.sizes is not a list of entries"),
        ("jobs.toml", "[product]\nsweep = 5\n", "product.sweep is not a list of values"),
        ("jobs.toml", "[product.sweep]\ngarment.fabric = []\n", "product.sweep.garment.fabric is not a list of values"),
        ("jobs.toml", "[product.sweep]\na.b = {from = 1, to = 2, count = 1}\n", "product.sweep.a.b is not a range"),
        ("jobs.toml", '[product]\nsizes = [{garment.shape.size = "S"}]\n', "has no name"),
    ],
)
def test_a_job_file_that_cannot_be_used_is_refused_in_one_line(tmp_path: Path, name: str, text: str, told: str) -> None:
    message = str(refusal(read_jobs, write(tmp_path, name, text)))
    assert "jobs" in message
    assert told in message


def test_a_missing_job_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such job file"):
        read_jobs(tmp_path / "none.csv")
