"""A mannequin made for stated measures has them when it is measured."""

from __future__ import annotations

import numpy as np
import pytest

from warp_cloth.anatomy.person import understand
from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.garment.measured_body import NAMES, likeliest, measured_mannequin
from warp_cloth.garment.outfit import load_avatar, load_outfit
from warp_cloth.scene import BodyMeasures, load_scene

GIRTH = 0.005  # [m] a tailor's tape is read to this
SQUARE = {"shape": {"kind": "square"}, "fabric": "cotton"}


def stated(seed: int) -> dict[str, float]:
    """Four measures of a random grown-up [m]."""
    rng = np.random.default_rng(seed)
    size = rng.normal()
    spread = {"stature": (1.7, 0.0, 0.09), "chest": (0.98, 0.09, 0.03), "waist": (0.86, 0.1, 0.04)}
    spread["hip"] = (1.02, 0.08, 0.03)
    return {name: mean + slope * size + rng.normal(0, own) for name, (mean, slope, own) in spread.items()}


BELLY = {"stature": 1.74, "chest": 1.09, "waist": 0.99, "hip": 0.93}  # [m]; it is measured with the hips


@pytest.mark.parametrize("wanted", [*map(stated, range(2)), BELLY])
def test_stated_measures_are_read_again(wanted: dict[str, float]) -> None:
    person = understand(load_avatar(load_scene({"avatar": {"measures": wanted}, "garment": SQUARE})))
    found = {each.name: each.value for each in person.measures}
    for name in NAMES:
        assert found[name] == pytest.approx(wanted[name], abs=GIRTH)


def test_what_is_not_stated_is_likeliest() -> None:
    size_l = likeliest(BodyMeasures(chest=1.06, waist=0.94))
    assert (size_l.stature, size_l.hip) == pytest.approx((1.82, 1.06))
    tall = likeliest(BodyMeasures(stature=1.76))
    assert (tall.chest, tall.waist, tall.hip) == pytest.approx((0.98, 0.86, 1.0))
    wide = likeliest(BodyMeasures(waist=1.3))
    assert wide.stature == pytest.approx(1.82)
    assert wide.chest > 1.3


def test_a_shirt_is_made_for_the_measured_body() -> None:
    tree = {
        "garment": {"shape": {"kind": "tshirt", "size": "L"}, "fabric": "jersey"},
        "avatar": {"measures": {"stature": 1.8, "chest": 1.0}},
    }
    outfit = load_outfit(load_scene(tree))
    assert outfit.wearing[0].start_fault == ""


def test_what_no_mannequin_has_is_refused_in_one_line() -> None:
    for measures in ({"chest": 0.8, "waist": 0.5, "hip": 1.5}, {"waist": 1.5, "chest": 0.7}):
        with pytest.raises(InputError):
            measured_mannequin(BodyMeasures(**measures), Cache())


@pytest.mark.parametrize(
    ("avatar", "said"),
    [
        ({"measures": {}}, "no measure is stated"),
        ({"measures": {"chest": 98}}, "chest"),
        ({"measures": {"neck": 0.4}}, "neck"),
        ({"measures": {"chest": 1.0}, "shape": {"kind": "mannequin"}}, "both given"),
        ({"measures": {"chest": 1.0}, "mesh": "body.obj"}, "both given"),
        ({"measures": {"chest": 1.0}, "poses": ["later.obj"]}, "poses"),
    ],
)
def test_bad_measures_are_refused(avatar: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene({"avatar": avatar, "garment": SQUARE})
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
