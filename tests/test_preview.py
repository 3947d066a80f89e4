"""The picture shows garments and avatar in front, side and back views, the same bits every time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import ImageFont
from worn import box_avatar, worn

from warp_cloth.base.mesh import Mesh
from warp_cloth.export import lettering
from warp_cloth.export.picture_head import Head, wrapped
from warp_cloth.export.preview import BACKGROUND, PLACED_WIDTH, preview_image
from warp_cloth.export.surface import cloth_colour, linear, srgb, winds_outward
from warp_cloth.model.result import WornGarment
from warp_cloth.report.shown import WORN

SIZE = (360, 200)
# sRGB bytes between the colour of a blue or a red cloth in any light and the avatar's grey
COLOUR_MARGIN = 25


def pictured(*garments: WornGarment, avatar: Mesh | None = None, **options: object) -> np.ndarray:
    """Signed sRGB bytes, shape [height, width, 3]."""
    return np.asarray(preview_image(garments=garments, avatar=avatar, size=SIZE, **options)).astype(np.int32)


def blue(image: np.ndarray) -> np.ndarray:
    return image[..., 2] - image[..., 0] > COLOUR_MARGIN


def red(image: np.ndarray) -> np.ndarray:
    return image[..., 0] - image[..., 2] > COLOUR_MARGIN


def empty(image: np.ndarray) -> np.ndarray:
    return (image == np.round(255.0 * np.array(BACKGROUND)).astype(int)).all(axis=-1)


def thirds(mask: np.ndarray) -> list[np.ndarray]:
    return np.array_split(mask, 3, axis=1)


def test_garment_stands_before_the_avatar_from_the_front_and_behind_from_the_back() -> None:
    # wider than the box behind it: seen from the back it shows left and right of it
    image = pictured(worn(), avatar=box_avatar())
    assert image.shape == (SIZE[1], SIZE[0], 3)
    front, side, back = (int(part.sum()) for part in thirds(blue(image)))
    assert front > 2 * back > 0
    assert 0 < side < back
    assert empty(image)[[0, -1]].all()
    assert empty(image)[:, [0, -1]].all()


def test_every_view_has_its_label() -> None:
    image = pictured(worn(), avatar=box_avatar())
    labels = ~empty(image)[-SIZE[1] // 10 :]
    assert all(part.any() for part in thirds(labels))


def test_title_stands_above() -> None:
    plain = pictured(worn())
    titled = pictured(worn(), head=Head("shirt", WORN, ["chest +2.3 cm"], "At rest. " * 90))
    strip = SIZE[1] // 8
    assert empty(plain)[:strip].all()
    assert (~empty(titled)[:strip]).any()
    assert empty(titled)[:, -2:].all()  # a long sentence is cut, not run off the picture


def test_a_long_sentence_is_wrapped_and_ends_with_an_ellipsis_if_it_is_cut() -> None:
    font = ImageFont.load_default(12)
    lines = wrapped("The cloth passes through itself. " * 9, font, 300.0, 3)
    assert len(lines) == 3
    assert all(font.getlength(line) <= 300.0 for line in lines)
    assert [line.endswith("…") for line in lines] == [False, False, True]
    assert wrapped("At rest.", font, 300.0, 3) == ["At rest."]
    assert wrapped("", font, 300.0, 3) == []


def test_a_title_is_spelt_in_letters_that_the_font_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lettering, "OTHERS", ())
    marked = pictured(worn(), head=Head("Müllers Maß, très chic, 衣", WORN, [], ""))
    plain = pictured(worn(), head=Head("Mullers Mass, tres chic, ?", WORN, [], ""))
    assert np.array_equal(np.asarray(marked), np.asarray(plain))


def test_a_font_of_the_system_that_has_all_letters_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    class Wide:
        """A font that has every letter but one."""

        def getmask(self, letter: str) -> bytes:
            return b"box" if letter == lettering.NO_LETTER else letter.encode()

    wide: Any = Wide()
    monkeypatch.setattr(lettering, "_of_system", lambda name, height: wide if name == lettering.OTHERS[1] else None)
    assert lettering.font_for(12, "Maß 衣") is wide
    assert lettering.font_for(12, "plain") is not wide
    assert lettering.spelt("Maß 衣", wide) == "Maß 衣"


def test_picture_is_the_same_bits_every_time() -> None:
    first, second = (pictured(worn(), worn("coat", toward=0.4), avatar=box_avatar()) for _ in range(2))
    assert np.array_equal(first, second)


def test_two_garments_have_two_colours() -> None:
    image = pictured(worn(height=0.5), worn("skirt", height=1.2))
    assert blue(image).any()
    assert red(image).any()
    rows = np.arange(SIZE[1])[:, None] * np.ones(SIZE[0])
    assert rows[red(image)].mean() < rows[blue(image)].mean()  # the second hangs higher


@pytest.mark.parametrize("facing", [1, 2, 3])
def test_who_faces_another_way_is_seen_from_the_front(facing: int) -> None:
    turn = np.linalg.matrix_power(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]), facing)
    garment, avatar = worn(), box_avatar()
    turned = replace(garment, points=garment.points @ turn.T)
    wearer = replace(avatar, points=avatar.points @ turn.T)
    seen, usual = pictured(turned, avatar=wearer, facing=facing), pictured(garment, avatar=avatar)
    assert (blue(seen) != blue(usual)).mean() < 2e-3
    assert (blue(pictured(turned, avatar=wearer)) != blue(usual)).mean() > 2e-2


def test_cloth_is_seen_from_both_sides_the_inside_darker() -> None:
    dome = worn()
    assert winds_outward(dome.points, dome.mesh.triangles)
    image = pictured(dome)
    front, _, back = thirds(blue(image))
    whole = thirds(image)
    assert abs(int(front.sum()) - int(back.sum())) <= 0.02 * front.sum()
    assert whole[2][back].mean() < 0.9 * whole[0][front].mean()
    # turned inside out the picture stays: what bulges is the outside, however the triangles wind
    turned = replace(dome, mesh=replace(dome.mesh, triangles=dome.mesh.triangles[:, ::-1].copy()))
    again = pictured(turned)
    assert np.array_equal(image, again)


def test_triangles_without_area_leave_no_mark() -> None:
    garment = worn()
    extra = np.array([[0, 0, 1], [0, 1, 2], [5, 5, 5]], dtype=np.int32)  # 0, 1 and 2 are in line
    faces = np.concatenate([garment.mesh.triangles, extra])
    flawed = replace(garment, mesh=replace(garment.mesh, triangles=faces, panels=None, texcoords=None))
    flat = replace(garment, points=garment.points * [1.0, 1.0, 0.0])
    assert np.array_equal(
        blue(pictured(replace(flawed, points=flat.points))),
        blue(pictured(flat)),
    )


def test_a_point_has_a_picture() -> None:
    garment = worn()
    image = pictured(replace(garment, points=0.0 * garment.points))
    assert image.shape == (SIZE[1], SIZE[0], 3)


def test_what_is_not_finite_is_refused() -> None:
    garment = worn("bad shirt")
    garment.points[3, 1] = np.nan
    with pytest.raises(ValueError, match="bad shirt"):
        pictured(garment)


def test_srgb_and_linear_undo_each_other() -> None:
    values = np.linspace(0.0, 1.0, 256)
    assert np.array_equal(np.round(255.0 * srgb(linear(values))), np.arange(256))
    assert cloth_colour(0) == cloth_colour(6)


@pytest.mark.cuda
def test_cuda_draws_the_same_picture() -> None:
    garment, body = worn(), box_avatar()
    on_cpu = pictured(garment, avatar=body)
    on_cuda = pictured(garment, avatar=body, device="cuda:0")
    # rounding moves single samples at edges; the picture as a whole is the same
    assert (np.abs(on_cpu - on_cuda).max(axis=-1) > 2).mean() < 0.01


def test_the_garments_as_placed_stand_beside_the_worn_ones() -> None:
    shirt = worn()
    low = replace(shirt, mesh=replace(shirt.mesh, points=shirt.points - np.array([0.0, 0.6, 0.0])))
    image = pictured(low, avatar=box_avatar(), placed=True)
    left = image[:, : round(PLACED_WIDTH * SIZE[0])]
    rows = [np.flatnonzero(blue(part).any(axis=1)) for part in (left, image[:, left.shape[1] :])]
    assert min(map(len, rows)) > 0
    assert rows[0].mean() > rows[1].mean()  # lower down
