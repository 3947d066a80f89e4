"""The products of a service: read and checked before it starts."""

from __future__ import annotations

from pathlib import Path

import pytest
from dxf_patterns import GRADES, Style, tshirt, write
from meshfiles import sheet, write_obj

from warp_cloth.base.errors import InputError
from warp_cloth.serve.catalogue import ONE_SIZE, read_catalogue

OF_A_MESH = 'avatar.shape.kind = "mannequin"\n[product]\n'


def catalogue(folder: Path, text: str) -> str:
    path = folder / "catalogue.toml"
    path.write_text(text)
    return str(path)


def test_a_product_needs_no_scene(tmp_path: Path) -> None:
    """Before: ".: is a folder, not a scene file"."""
    write_obj(tmp_path / "cape.obj", *sheet())
    source = catalogue(tmp_path, f'{OF_A_MESH}garments = ["cape.obj"]\nfabrics = ["jersey", "denim"]\n')
    cape = read_catalogue([source])["cape"]
    assert list(cape.sizes) == [ONE_SIZE]
    assert cape.fabrics == {"jersey": "jersey", "denim": "denim"}


def test_a_graded_pattern_comes_in_its_sizes(tmp_path: Path) -> None:
    write(tmp_path / "shirt.dxf", {size: tshirt(grade) for size, grade in GRADES.items()}, Style())
    of_job = catalogue(tmp_path, f'{OF_A_MESH}garments = ["shirt.dxf"]\n')
    offers = read_catalogue([of_job])["shirt"].sizes
    assert [*offers] == ["S", "M", "L"]
    assert offers["L"].changes[-1] == 'garment.size="L"'
    (tmp_path / "scene.toml").write_text('garment.pattern = "shirt.dxf"\navatar.shape.kind = "mannequin"\n')
    assert [*read_catalogue([str(tmp_path / "scene.toml")])["scene"].sizes] == ["S", "M", "L"]
    stated = catalogue(tmp_path, f'garment.size = "M"\n{OF_A_MESH}garments = ["shirt.dxf"]\n')
    assert [*read_catalogue([stated])["shirt"].sizes] == [ONE_SIZE]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f'{OF_A_MESH}garments = ["none.obj"]\n', "none.obj: no such file"),
        ('scene = "tshirt"\n[product]\ngarments = [{name = "tee"}]\nfabrics = ["jersy"]\n', 'did you mean "jersey"?'),
        (
            'scene = "tshirt"\n[product]\ngarments = [{name = "tee", garment.shape.size = "XXL"}]\n',
            'catalogue.toml: garment.shape.size: must be one of "S", "M", "L", not "XXL"',
        ),
    ],
)
def test_what_cannot_be_served_is_refused_at_the_start(tmp_path: Path, text: str, told: str) -> None:
    """Before, files and fabrics that are not there were found by the first customer who asked for them."""
    with pytest.raises(InputError) as refused:
        read_catalogue([catalogue(tmp_path, text)])
    assert told in str(refused.value)
