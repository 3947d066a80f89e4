"""Any mesh as a body: limbs, pose and measures, or one clear word; never an error, and the same again."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from warp_cloth.anatomy.measures import DEFINITIONS
from warp_cloth.anatomy.person import Person, understand
from warp_cloth.anatomy.skeleton import TRUNK
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.surface import grid_values, split_quads, surface_nets, without_saddles
from warp_cloth.shapes import mannequin

Floats = NDArray[np.float64]
Bone = tuple[Sequence[float], Sequence[float], float]  # from, to [m], radius [m]

TALLEST = 1e3  # times the body: no measure is longer


def capsules(bones: Sequence[Bone], edge: float = 0.035) -> Mesh:
    """The surface of capsules [m], mirrored at x = 0."""
    ends = [
        (np.array(start, dtype=np.float64), np.array(end, dtype=np.float64), radius) for start, end, radius in bones
    ]

    def value(spots: Floats) -> Floats:
        nearest = np.full(len(spots), np.inf)
        for start, end, radius in ends:
            along = end - start
            share = np.clip((spots - start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
            nearest = np.minimum(nearest, np.linalg.norm(spots - start - share[:, None] * along, axis=1) - radius)
        return nearest

    corners = np.array([point for start, end, _ in ends for point in (start, end)])
    widest = max(radius for *_, radius in ends)
    high = np.maximum(corners.max(axis=0), -corners.min(axis=0)) + widest
    values, origin = grid_values(value, -high, high, edge)
    points, quads = surface_nets(without_saddles(values), origin, edge)
    return Mesh("figure", points, split_quads(points, quads))


def figure(arms: Sequence[float], legs: int, *, head: bool = True) -> list[Bone]:
    """A doll with arms at these angles below the horizontal [degrees], on both sides."""
    bones: list[Bone] = [((0, 0.9, 0), (0, 1.35, 0), 0.15)]
    if head:
        bones += [((0, 1.4, 0), (0, 1.5, 0), 0.055), ((0, 1.58, 0), (0, 1.66, 0), 0.09)]
    for angle in arms:
        reach = 0.6 * np.array([np.cos(np.radians(angle)), -np.sin(np.radians(angle)), 0.0])
        bones.append(((0.17, 1.4, 0), np.array([0.17, 1.4, 0.0]) + reach, 0.045))
    for number in range(legs):
        x = 0.1 + 0.15 * number
        bones += [((x, 0.9, 0), (x, 0.1, 0), 0.075), ((x, 0.08, 0), (x, 0.08, 0.16), 0.04)]
    return bones


LEGGED: list[Bone] = [((0.12, 0.6, z), (0.12, 0.0, z), 0.05) for z in (-0.35, 0.35)]
TORSO: Bone = ((0, 0.65, -0.4), (0, 0.65, 0.4), 0.14)
OTHERS: dict[str, list[Bone]] = {
    "three pairs of limbs": figure((45, -30), 1),
    "four arms": figure((50, 0), 1),
    "three pairs of legs": figure((45,), 2),
    "no arms": figure((), 1),
    "legs alone": figure((), 1, head=False)[1:],
    "dog": [TORSO, *LEGGED, ((0, 0.7, 0.5), (0, 0.8, 0.6), 0.1), ((0, 0.6, -0.5), (0, 0.8, -0.8), 0.035)],
    "dog without tail": [TORSO, *LEGGED, ((0, 0.7, 0.5), (0, 0.9, 0.7), 0.1)],
    "table": [*LEGGED, *(((0, 0.62, z), (0.3, 0.62, z), 0.06) for z in np.linspace(-0.4, 0.4, 9))],
    "post": [((0, 0, 0), (0, 1.7, 0), 0.06)],
    "ball": [((0, 0, 0), (0, 0, 0), 0.5)],
    "star": [((0, 0, 0), (0.8 * np.cos(a), 0.8 * np.sin(a), 0), 0.1) for a in np.radians((90, 18, -54))],
}


@cache
def doll() -> Mesh:
    return capsules(figure((43,), 1))


@cache
def body() -> Mesh:
    return mannequin(edge=0.015)


def check(mesh: Mesh) -> Person:
    """Understands a mesh, and checks that the answer is sound and the same again."""
    with np.errstate(all="raise", under="ignore"):
        person = understand(mesh)
    if person.skeleton is None or person.stance is None:
        assert person.reason
        assert len(person.reason.splitlines()) == 1
        assert person.measures == ()
        return person
    skeleton = person.skeleton
    assert person.reason == ""
    assert person.stance.in_words()
    assert len(skeleton.limb) == len(skeleton.station) == mesh.vertex_count
    assert skeleton.limb.min() >= 0
    assert skeleton.limb.max() <= TRUNK
    for array in (*skeleton.curves, skeleton.spine, skeleton.up, skeleton.forward, skeleton.left, skeleton.station):
        assert np.isfinite(array).all()
    assert tuple(each.name for each in person.measures) == tuple(DEFINITIONS)
    extent = float(np.ptp(mesh.points, axis=0).max())
    for each in person.measures:
        assert (each.value is None) == bool(each.reason)
        assert each.value is None or 0.0 < each.value < TALLEST * extent
        assert np.isfinite(each.line).all()
    assert [each.value for each in understand(mesh).measures] == [each.value for each in person.measures]
    return person


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_no_person_is_not_taken_for_one(name: str) -> None:
    assert check(capsules(OTHERS[name])).skeleton is None


def test_a_doll_of_capsules_is_a_person() -> None:
    person = check(doll())
    assert person.stance.in_words().startswith("stands; arms 4")


def with_legs(*leg: Bone) -> Mesh:
    """The doll with other legs."""
    return capsules([bone for bone in figure((43,), 1) if bone[0][1] >= 1.3 or bone[0][0] == 0] + list(leg), edge=0.025)


def test_who_sits_on_the_floor_with_straight_legs_sits() -> None:
    """Its legs are as long along z as its trunk along y."""
    knee, heel, toes = (0.1, 0.86, 0.4), (0.1, 0.9, 0.8), (0.1, 0.95, 0.94)
    person = check(with_legs(((0.1, 0.9, 0), knee, 0.075), (knee, heel, 0.075), (heel, toes, 0.045)))
    assert person.stance.vertical == pytest.approx([0.0, 1.0, 0.0])
    assert person.stance.in_words().startswith("sits; arms 4")


def test_who_stands_astride_does_not_sit() -> None:
    x, y = 0.1 + 0.8 * np.sin(np.radians(60.0)), 0.9 - 0.8 * np.cos(np.radians(60.0))
    person = check(with_legs(((0.1, 0.9, 0), (x, y, 0), 0.075), ((x, y, 0), (x, y, 0.16), 0.04)))
    assert person.stance.in_words().startswith("stands; arms 4")
    assert "degrees apart" in person.stance.in_words()


def test_a_body_without_a_head_has_limbs() -> None:
    assert check(capsules(figure((43,), 1, head=False))).skeleton is not None


@given(data=st.data())
def test_figures_of_any_bones(data: st.DataObject) -> None:
    length = st.floats(-0.9, 0.9)
    bones = st.tuples(st.tuples(length, length, length), st.tuples(length, length, length), st.floats(0.04, 0.2))
    check(capsules(data.draw(st.lists(bones, min_size=1, max_size=7)), edge=0.05))


DAMAGES = ("drop", "cut", "noise", "collapse", "double", "flip", "dust", "scale", "squash", "turn", "shuffle", "fuse")


def damaged(mesh: Mesh, kind: str, amount: float, rng: np.random.Generator) -> Mesh:
    """A mesh after one kind of damage; ``amount`` is 0 to 1."""
    points, triangles = mesh.points, mesh.triangles
    if kind == "drop":
        triangles = triangles[rng.random(len(triangles)) >= 0.7 * amount]
    elif kind == "cut":
        side = points[triangles].mean(axis=1) @ rng.normal(size=3)
        triangles = triangles[side >= np.quantile(side, 0.9 * amount)] if len(side) else triangles
    elif kind == "noise":
        points = points + rng.normal(size=points.shape) * 0.03 * amount
    elif kind == "collapse":
        triangles = triangles.copy()
        hit = rng.random(len(triangles)) < 0.3 * amount
        triangles[hit, 1] = triangles[hit, 0]
    elif kind == "double":
        points = np.concatenate([points, points + np.array([0.0, 0.0, amount])])
        triangles = np.concatenate([triangles, triangles + mesh.vertex_count])
    elif kind == "flip":
        hit = rng.random(len(triangles)) < amount
        triangles = np.where(hit[:, None], triangles[:, ::-1], triangles)
    elif kind == "dust":
        specks = rng.normal(size=(3 * int(200 * amount), 3)) + points.mean(axis=0)
        triangles = np.concatenate([triangles, len(points) + np.arange(len(specks)).reshape(-1, 3)])
        points = np.concatenate([points, specks])
    elif kind == "scale":
        points = points * 10.0 ** (6.0 * amount - 3.0) + 100.0 * rng.normal(size=3)
    elif kind == "squash":
        points = points * np.where(np.arange(3) == rng.integers(3), amount, 1.0)
    elif kind == "turn":
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        points = points @ turn
    elif kind == "shuffle":
        order = rng.permutation(len(points))
        place = np.argsort(order)
        points, triangles = points[order], place[triangles]
    elif kind == "fuse":
        spacing = 0.005 + 0.1 * amount
        _, first, same = np.unique((points / spacing).round(), axis=0, return_index=True, return_inverse=True)
        points, triangles = points[first], same.reshape(-1)[triangles]
    return Mesh(mesh.name, points, triangles.astype(np.int32))


@cache
def coarse_body() -> Mesh:
    """The body with edges of 25 mm: understood in 0.4 s, not 1.0."""
    return damaged(body(), "fuse", 0.2, np.random.default_rng(0))


@given(
    whole=st.sampled_from((doll, coarse_body)),
    damages=st.lists(st.tuples(st.sampled_from(DAMAGES), st.floats(0.0, 1.0)), min_size=1, max_size=3),
    seed=st.integers(0, 2**32 - 1),
)
def test_broken_bodies(whole: object, damages: list[tuple[str, float]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = whole()  # type: ignore[operator]
    for kind, amount in damages:
        mesh = damaged(mesh, kind, amount, rng)
    if len(mesh.triangles):
        check(mesh)


@pytest.mark.parametrize("degrees", [8.0, 25.0, 45.0])
@pytest.mark.parametrize("axis", range(3))
def test_a_person_is_one_however_it_is_turned(axis: int, degrees: float) -> None:
    """Its measures, too: in axes that it does not stand along."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn = np.roll([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]], axis, axis=(0, 1))
    upright = {each.name: each.value for each in understand(body()).measures}
    turned = check(Mesh("turned", body().points @ turn + [1.0, -2.0, 3.0], body().triangles))
    for each in turned.measures:
        assert each.value == pytest.approx(upright[each.name], rel=0.015)
