"""Garments modelled one over the other are layered as they lie, however a scene lists them; none is listed twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import ball, write_obj

from warp_cloth.base.errors import InputError
from warp_cloth.contact.garments import build_cloth_contact
from warp_cloth.fitting.problem import load_problem
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.scene import load_scene

RADIUS, HEIGHT = 0.25, 1.25


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_obj(tmp_path / "body.obj", *ball(RADIUS, HEIGHT))
    for name, height, low, high in [
        ("shirt", 0.004, -0.5, 0.5),
        ("coat", 0.02, -0.6, 0.4),
        ("collar", 0.02, 0.52, 0.8),
        ("close", 0.003, -0.5, 0.4),
    ]:
        points, faces = ball(RADIUS + height, HEIGHT)
        level = (points[:, 1] - HEIGHT) / RADIUS
        kept = ((level > low) & (level < high))[np.asarray(faces)].all(axis=1)
        used, own = np.unique(np.asarray(faces)[kept], return_inverse=True)
        write_obj(tmp_path / f"{name}.obj", points[used], own.reshape(-1, 3))
    return tmp_path


def outfit_of(folder: Path, *names: str, **options: Any) -> Outfit:
    return load_outfit(load_scene(values_of(folder, *names, **options)))


def values_of(folder: Path, *names: str, **options: Any) -> dict[str, Any]:
    garments = [{"mesh": str(folder / f"{name}.obj"), "units": "m"} for name in names]
    return {"garment": garments, "avatar": {"mesh": str(folder / "body.obj"), "units": "m"}, **options}


@pytest.mark.parametrize("names", [("shirt", "coat"), ("coat", "collar"), ("shirt", "close"), ("coat",)])
def test_as_listed_where_nothing_tells_otherwise(folder: Path, names: tuple[str, ...]) -> None:
    outfit = outfit_of(folder, *names)
    assert (outfit.layers, outfit.readings) == ((), ())


def test_what_lies_within_is_the_inner_layer(folder: Path) -> None:
    outfit = outfit_of(folder, "coat", "collar", "shirt")
    assert outfit.layers == (2, 0, 1)
    (choice,) = outfit.readings
    assert (choice.key, choice.value) == ("garment", "garment[1], garment[2], garment[0]")
    assert choice.reason == "inner to outer, as garment[2] lies within garment[0]"


def test_contact_keeps_the_layers(folder: Path) -> None:
    scene = load_scene(values_of(folder, "coat", "shirt"))
    problem = load_problem(scene, "cpu")
    contact = build_cloth_contact(scene, problem.outfit, problem.model, "cpu")
    layers = contact.untangling.layer.numpy()
    coat = len(problem.outfit.garments[0].points)
    assert (sorted({*layers[:coat]}), sorted({*layers[coat:]})) == ([1], [0])


def test_one_mesh_in_one_place_twice_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match=r"^garment\[1\]: is the same mesh in the same place as garment\[0\]; remove"):
        outfit_of(folder, "shirt", "shirt")
    assert outfit_of(folder, "shirt", "shirt", collision={"cloth": False}).layers == ()
    apart = values_of(folder, "shirt", "shirt")
    apart["garment"][1]["translate"] = [0.0, 0.05, 0.0]
    assert len(load_outfit(load_scene(apart)).garments) == 2
