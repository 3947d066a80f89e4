"""Parts of dressing by themselves: armholes on a body's curves, and wide skirts closed before they are sewn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS, LEGS, Limbs
from warp_cloth.anatomy.raising import LEGS_AWAY, raised_limb, standing_leg
from warp_cloth.anatomy.skeleton import HEAD, LEFT_ARM
from warp_cloth.base.curves import arc_lengths, resampled
from warp_cloth.dressing.catching_up import MOST, catch_up
from warp_cloth.dressing.loose_cloth import met
from warp_cloth.dressing.panels import CLOSED, legs_parted, skirt_closed
from warp_cloth.dressing.posing import STATIONS, PosedBody
from warp_cloth.dressing.routes import Route, _is_armhole, _turned_up, curves_of
from warp_cloth.fitting import dresser, posed_start


@dataclass(frozen=True)
class Lone:
    """An outfit of one garment, as far as dressing sews it."""

    wearing: tuple[Any, ...]


SHOULDER = np.array([0.2, 1.4, 0.0])


def skeleton() -> Any:
    """An arm from the middle over the shoulder and down, straight on."""
    arm = np.array([[0.0, 1.4, 0.0], SHOULDER, [0.2, 0.8, 0.0]])
    return SimpleNamespace(
        left=np.array([1.0, 0.0, 0.0]), up=np.array([0.0, 1.0, 0.0]), curves=[arm] * 5, joints=[1] * 5
    )


def ring(centre: tuple[float, float, float], radius: float = 0.08) -> Any:
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    return np.array(centre) + radius * np.stack([0.0 * angles, np.cos(angles), np.sin(angles)], axis=1)


@pytest.mark.parametrize(
    ("centre", "is_one"),
    [((0.18, 1.32, 0.0), True), ((0.3, 1.32, 0.0), False), ((0.2, 0.9, 0.0), False)],
    ids=["armhole", "short sleeve", "long sleeve, hanging"],
)
def test_an_armhole_is_told_from_a_sleeve(centre: tuple[float, float, float], is_one: bool) -> None:
    assert _is_armhole(ring(centre), LEFT_ARM, skeleton()) is is_one


def test_an_armhole_is_where_the_shoulder_is_at_home() -> None:
    """However long the way to it is: else the cloth on the shoulder goes out with the arm."""
    way = np.array([[0.0, 1.4, 0.0], [0.1, 1.2, 0.0], [0.2, 1.3, 0.0], [0.9, 1.3, 0.0]])
    to_armhole = float(arc_lengths(way)[2])
    routes: list[Route | None] = [None] * 5
    routes[LEFT_ARM] = Route(way, 0.0, to_armhole)
    count = 81
    curve = curves_of(routes, skeleton(), count)[LEFT_ARM]
    at_shoulder = 0.2 / 0.8 * (count - 1)  # of the curve at home
    np.testing.assert_allclose(curve[round(at_shoulder)], way[2], atol=1e-9)
    np.testing.assert_allclose(curve[[0, -1]], way[[0, -1]])


def test_an_arm_is_not_turned_beyond_the_vertical() -> None:
    """Though it would be clearer there: it would cross its own strap."""
    space = SimpleNamespace(
        between_layers=lambda along, _: np.zeros(len(along), dtype=bool),
        clearances=lambda along: np.maximum(-along[:, 0], 0.0),  # the more, the farther on the other side
    )
    body = skeleton()
    body.forward = np.array([0.0, 0.0, 1.0])
    direction, turned = _turned_up(np.zeros(3), body.left, 0.5, LEFT_ARM, body, space)  # type: ignore[arg-type]
    assert direction @ body.left >= -1e-12
    assert turned <= 90.0


def test_raised_arms_are_lowered_to_the_shoulders() -> None:
    """Turned as they are raised, while all else is at home."""
    body = object.__new__(PosedBody)
    body._skeleton = skeleton()
    body.home = [resampled(curve, STATIONS) for curve in [*skeleton().curves, skeleton().curves[0]]]
    up = np.array([[0.0, 1.4, 0.0], [0.2, 1.6, 0.0], [0.6, 2.0, 0.0]])
    posed = [resampled(up, STATIONS)] * len(body.home)
    low = body.at_shoulders(posed, body.home)
    shoulder = round(0.2 / 0.8 * (STATIONS - 1))
    np.testing.assert_allclose(low[LEFT_ARM][: shoulder + 1], body.home[LEFT_ARM][: shoulder + 1], atol=1e-12)
    turned, raised = (np.diff(curves[LEFT_ARM][shoulder:], axis=0) for curves in (low, posed))
    np.testing.assert_allclose(turned, raised, atol=1e-12)
    assert low[LEGS[0]] is body.home[LEGS[0]]


FAN, WAIST = slice(0, 6 * 41), slice(0, 41)


def dress(half_angle: float) -> tuple[Any, Any]:
    """A fan of cloth round the origin, to ``half_angle`` from down on both sides, a bodice's rim, and an arm's cuff."""
    angles, radii = np.meshgrid(np.linspace(-half_angle, half_angle, 41), np.linspace(0.1, 0.6, 6))
    fan = np.stack([radii * np.sin(angles), -radii * np.cos(angles), 0.0 * radii], axis=2).reshape(-1, 3)
    rim = np.stack([np.linspace(-0.2, 0.2, 41), np.full(41, 0.8), np.zeros(41)], axis=1)
    points = np.vstack([fan, ring((0.5, 0.4, 0.0)), rim])
    hem, cuff, first_of_rim = np.arange(5 * 41, 6 * 41), np.arange(len(fan), len(points) - 41), len(points) - 41
    to_hem = np.concatenate([0.6 - radii.ravel(), np.full(len(cuff), 1.5), np.full(41, 0.6)])
    to_cuff = np.concatenate([np.full(len(fan), 1.0), np.zeros(len(cuff)), np.full(41, 0.7)])
    along = np.arange(40)
    rows = (41 * np.arange(5)[:, None] + along).ravel()
    cloth = np.stack([rows, rows + 1, rows + 41], axis=1), np.stack([rows + 1, rows + 42, rows + 41], axis=1)
    seam = np.stack([along, along + 1, along + first_of_rim], axis=1)
    openings = [SimpleNamespace(loop=hem), SimpleNamespace(loop=cuff)]
    limbs = [LEGS, (ARMS[1],)]
    distances = {LEGS: to_hem, (ARMS[1],): to_cuff}
    wearing = SimpleNamespace(
        openings=openings,
        limbs=limbs,
        triangles=np.concatenate([*cloth, seam]),
        skeleton=skeleton(),
        distances=lambda: distances,
    )
    return wearing, points


def test_a_wide_skirt_is_closed_below_its_waist() -> None:
    wearing, points = dress(np.radians(170.0))
    closed = skirt_closed(wearing, points)
    assert points[FAN, 1].max() > 0.5
    assert closed[WAIST, 1].mean() == pytest.approx(points[WAIST, 1].mean())  # else it would pull the bodice down
    lengths = [arc_lengths(each[WAIST])[-1] for each in (points, closed)]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.01)  # else the legs within it would be wider apart than it is
    across = closed[FAN].reshape(6, 41, 3)
    np.testing.assert_allclose(np.linalg.norm(np.diff(across, axis=0), axis=2), 0.1, atol=1e-9)
    aside = across[-1, -1] - across[0, -1]
    assert np.arctan2(aside[0], -aside[1]) == pytest.approx(CLOSED)
    np.testing.assert_array_equal(closed[6 * 41 :], points[6 * 41 :])


def test_a_narrow_skirt_is_left_as_it_is() -> None:
    wearing, points = dress(np.radians(60.0))
    assert skirt_closed(wearing, points) is points


def trousers(spread: float) -> tuple[Any, Any]:
    """Two legs of one layer, 0.8 m long below a crotch at the origin, that reach ``spread`` over the middle there."""
    rows, columns = np.linspace(0.2, -0.8, 21), np.linspace(0.0, 1.0, 6)
    inner = np.where(rows < 0.0, -spread * rows / -0.8, 0.0)
    legs = [
        np.stack([side * (0.3 * columns + inner[:, None] * (1.0 - columns)), np.tile(rows[:, None], 6)], axis=2)
        for side in (-1.0, 1.0)
    ]
    points = np.concatenate([np.pad(leg.reshape(-1, 2), ((0, 0), (0, 1))) for leg in legs])
    step = np.arange(20)[:, None] * 6 + np.arange(5)
    one = np.stack([step, step + 1, step + 6], axis=2).reshape(-1, 3)
    joined = np.stack([6 * np.arange(4), 6 * np.arange(4) + 126, 6 * np.arange(1, 5)], axis=1)  # above the crotch
    height = points[:, 1] + 0.8
    is_left = np.arange(len(points)) >= 126
    distances = {(LEGS[0],): height + is_left, (LEGS[1],): height + ~is_left, LEGS: 1.0 - height}
    triangles = np.concatenate([one, one + 126, joined])
    openings = tuple(SimpleNamespace(distances=each, loop=np.flatnonzero(each == 0.0)) for each in distances.values())
    wearing = Wearing(openings, tuple(distances), triangles, skeleton(), points, points)  # type: ignore[arg-type]
    return wearing, points


def test_wide_legs_are_parted_at_the_crotch() -> None:
    wearing, points = trousers(0.15)
    moved = legs_parted(wearing, points)
    right, left = moved[:126], moved[126:]
    below = points[:126, 1] < -0.05
    assert points[:126][below, 0].max() > 0.1
    assert right[below, 0].max() < 0.02  # as much as at the crotch
    assert left[below, 0].min() > -0.02
    above = points[:, 1] >= 0.0
    np.testing.assert_array_equal(moved[above], points[above])


def test_narrow_legs_are_left_as_they_are() -> None:
    wearing, points = trousers(0.0)
    assert legs_parted(wearing, points) is points


def test_trousers_are_pulled_up_no_farther_than_their_crotch() -> None:
    wearing, points = trousers(0.0)
    vars(wearing)["onto"] = points
    wearing.skeleton.spine = np.array([[0.0, 0.05, 0.0], [0.0, 0.6, 0.0]])
    lowered = points - [0.0, 0.2, 0.0]
    assert wearing.drop(lowered) == pytest.approx(0.2)
    assert wearing.rise(lowered) == pytest.approx(0.2)
    wearing.skeleton.spine = np.array([[0.0, -0.1, 0.0], [0.0, 0.6, 0.0]])
    assert wearing.rise(lowered) == pytest.approx(0.1)
    assert wearing.rise(points) == pytest.approx(-0.1)


def test_legs_are_spread_to_their_own_sides() -> None:
    hanging = skeleton()
    hanging.curves[LEGS[0]] = hanging.curves[LEGS[0]] * [-1.0, 1.0, 1.0]
    right, left = (raised_limb(hanging, leg) for leg in LEGS)
    assert right is not None
    assert left is not None
    np.testing.assert_allclose(right, left * [-1.0, 1.0, 1.0], atol=1e-12)
    way = left[-1] - left[1]
    assert np.arctan2(way[0], -way[1]) == pytest.approx(LEGS_AWAY)


def test_legs_that_sit_stand_up_as_far_out_as_they_are_spread() -> None:
    """The thigh to the front, the shin down; a leg that hangs stands as it is."""
    sitting = skeleton()
    assert standing_leg(sitting, LEGS[1]) is None
    leg = np.array([[0.0, 1.4, 0.0], SHOULDER, [0.2, 1.4, 0.4], [0.2, 1.4, 0.5], [0.2, 1.0, 0.5]])
    sitting.curves[LEGS[1]] = leg
    standing = standing_leg(sitting, LEGS[1])
    assert standing is not None
    np.testing.assert_array_equal(standing[:2], leg[:2])
    assert arc_lengths(standing)[-1] == pytest.approx(arc_lengths(leg)[-1])
    way = standing[-1] - standing[1]
    assert np.arctan2(way[0], -way[1]) == pytest.approx(LEGS_AWAY)
    assert way[2] == 0.0


def test_an_arm_comes_upon_cloth_that_is_near_where_it_moves() -> None:
    """By how far its points near the cloth move; a hand that is not near it does not count."""
    arm = np.linspace([0.0, 1.4, 0.0], [0.7, 1.4, 0.0], 8)
    lowered = arm - [0.0, 0.15, 0.0] * arm[:, :1] / 0.7
    none = np.zeros(0, dtype=np.int32)
    cloth = np.array([[0.3, 1.3, 0.0], [0.3, 1.3, 0.1], [0.3, 1.2, 0.0], [9.0, 0.0, 0.0]])
    before, after = [arm] * 5, [arm, arm, lowered, arm, arm]
    loose = [none, none, np.array([0, 1, 2]), none, none]
    found = met(loose, cloth, before, after)
    assert 0.05 < found < 0.12  # the hand moves by 0.15
    assert met([none] * 5, cloth, before, after) == 0.0
    assert met(loose, cloth, before, before) == 0.0


@pytest.mark.parametrize(
    ("counts", "bursts"),
    [([0], 0), ([40, 10, 0], 2), ([40, 20, 20], 2), ([40, 41], 1), ([2**n for n in range(20, 0, -1)], MOST)],
    ids=["nothing is pulled", "it comes after", "the rest is tight", "all is tight", "it takes long"],
)
def test_cloth_is_relaxed_while_it_comes_after_a_limb(counts: list[int], bursts: int) -> None:
    left, relaxed = iter(counts), []
    catch_up(lambda: next(left), lambda: relaxed.append(None))
    assert len(relaxed) == bursts


@pytest.mark.parametrize(("girth", "is_so"), [(0.9, True), (0.7, False)])
def test_a_wide_skirt_at_the_shoulders_is_no_cape(girth: float, is_so: bool) -> None:
    arms = skeleton()
    arms.curves[ARMS[0]] = arms.curves[ARMS[0]] * [-1.0, 1.0, 1.0]
    none: Any = np.zeros((0, 3))
    openings: Any = SimpleNamespace(girth=5.0), SimpleNamespace(girth=girth)
    assert Wearing(openings, ((HEAD,), (HEAD,)), none, arms, none, none).is_wide_cape is is_so
    assert not Wearing(openings, (LEGS, (HEAD,)), none, arms, none, none).is_wide_cape


def test_a_neckline_that_starts_behind_the_neck_is_moved_round_it() -> None:
    """A tube round a head that is held forward: cloth on both sides of it, until the tube is moved across."""
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rows = [
        ring_at + 0.1 * np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], 1)
        for ring_at in ([0, 1.4, 0.0], [0, 1.5, 0.0])
    ]
    points = np.concatenate(rows)
    step = np.arange(24)
    after = (step + 1) % 24
    triangles = np.concatenate([np.stack([step, after, step + 24], 1), np.stack([after, after + 24, step + 24], 1)])
    leaning = np.array([[0.0, 1.3, 0.0], [0.0, 1.43, 0.07], [0.0, 1.5, 0.15], [0.0, 1.7, 0.15]])
    away = np.array([[5.0, 0.0, 0.0], [5.0, 1.0, 0.0]])
    body = SimpleNamespace(up=np.array([0.0, 1.0, 0.0]), curves=[leaning, away, away, away, away], span=1.7, lacks=())
    opening = SimpleNamespace(loop=step + 24)
    wearing = Wearing((opening,), ((HEAD,),), triangles, body, points, points)  # type: ignore[arg-type]
    assert wearing.pierced(points) == (HEAD,)
    moved = wearing._onto_neck(points)
    np.testing.assert_allclose(moved, [0.0, 0.0, 0.15], atol=1e-12)
    assert wearing.pierced(points + moved) == ()
    np.testing.assert_array_equal(wearing._onto_neck(points + moved), np.zeros(3))


@pytest.mark.parametrize(("along", "limbs"), [(0.395, ()), (0.305, (0,))])
def test_a_face_that_a_fingertip_shows_through_does_not_run_through_the_arm(along: float, limbs: Limbs) -> None:
    arm = np.stack([np.linspace(0.0, 0.4, 41), np.zeros(41), np.zeros(41)], axis=1)
    body: Any = SimpleNamespace(curves=[arm], span=1.7, lacks=())
    across = np.array([[along, -0.01, -0.01], [along, 0.02, -0.01], [along, 0.0, 0.02]])
    wearing = Wearing((), (), np.array([[0, 1, 2]]), body, across, across)
    assert wearing.pierced(across) == limbs


@pytest.mark.parametrize(("above", "is_so"), [(0.2, True), (0.05, False)])
def test_the_head_is_in_a_neckline_that_starts_high(above: float, is_so: bool) -> None:
    neckline: Any = SimpleNamespace(girth=1.3)
    none: Any = np.zeros((0, 3))
    wearing = Wearing((neckline,), ((HEAD,),), none, skeleton(), none, none)
    vars(wearing)["too_high"] = above
    assert wearing.is_round_head is is_so


def test_what_has_legs_and_a_neckline_is_no_trousers() -> None:
    wearing, _ = trousers(0.0)
    assert wearing.is_trousers
    jumpsuit = replace(wearing, openings=(*wearing.openings, wearing.openings[0]), limbs=(*wearing.limbs, (HEAD,)))
    assert jumpsuit.has_legs
    assert not jumpsuit.is_trousers


@pytest.mark.parametrize("crosses", [False, True])
def test_what_crosses_on_a_body_that_has_grown_again_is_pressed_out_from_where_it_lay_thin(
    monkeypatch: pytest.MonkeyPatch, crosses: bool
) -> None:
    """Two sheets that a growing crease has drawn through each other: the first way is undone, not gone on with."""
    thin, done = np.zeros((3, 3)), []

    class Growing:
        def __init__(self, *_given: object, **_more: object) -> None:
            self.points, self.crosses = thin, crosses

        def __getattr__(self, name: str) -> Callable[..., None]:
            return lambda *given, **_more: done.append((name, *given))

    monkeypatch.setattr(posed_start, "Dresser", Growing)
    posed_start._untangled(posed_start._Lone(*([None] * 5)), thin)  # type: ignore[arg-type]
    names = [name for name, *_ in done]
    assert names == ["untangle", "grow", "come_home", *(["press_out"] if crosses else []), "ended"]
    assert not crosses or done[-2][1] is thin


@pytest.mark.parametrize(
    ("torn", "kept"),
    [([0, 0, 0], 2), ([3, 2, 2], 2), ([0, 5, 0], 2), ([0, 0, 5], 1), ([0, 5, 6], 0), ([30], 0)],
    ids=["whole", "torn before", "what tears closes again", "the last tears", "all tear", "taut"],
)
def test_straps_are_tugged_until_they_lie_well_but_not_torn(
    monkeypatch: pytest.MonkeyPatch, torn: list[int], kept: int
) -> None:
    """``torn``: edges before the first tug and after each."""
    shirt: Any = SimpleNamespace(
        points=np.zeros(1),
        wearing=SimpleNamespace(shoulders=None, triangles=None),
        _relax=lambda count: None,
        _problem=SimpleNamespace(model=SimpleNamespace(edge_count=10_000)),
    )
    shirt._stretched = lambda strain: torn[int(shirt.points[0])]
    shirt._put = lambda points: setattr(shirt, "points", points)
    monkeypatch.setattr(
        dresser, "tugged", lambda shoulders, points, triangles: points + 1 if points[0] + 1 < len(torn) else None
    )
    dresser.Dresser.lay_straps(shirt)
    assert shirt.points[0] == kept


@pytest.mark.parametrize("rise", [0.05, 0.3], ids=["below the arms", "into the arms"])
def test_a_skirt_that_would_be_lifted_into_the_arms_hangs_from_its_top_first(rise: float) -> None:
    """A vertical sheet from the floor up to 0.2 m below an arm that is held out."""
    arm = np.array([[0.2, 1.4, -0.5], [0.2, 1.4, 0.5]])
    done: list[Any] = []
    skirt: Any = SimpleNamespace(
        points=np.array([[-1.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.2, 1.2, 0.0]]),
        wearing=SimpleNamespace(
            triangles=np.array([[0, 1, 2]], dtype=np.int32), rise=lambda points: rise, skeleton=skeleton()
        ),
        _posed=[arm] * 6,
        _hold_top=None,
        _set_weight=done.append,
        _has_fallen=lambda after: done.append("fallen"),
    )
    dresser.Dresser.hang(skirt)
    assert done == ([dresser.HEAVY, "fallen", 1.0] if rise > 0.2 else [])


@pytest.mark.parametrize(("tangled", "is_strapless"), [(0, True), (1, True), (2, True), (2, False)])
def test_a_top_that_the_arms_hold_open_is_sewn_below_them(tangled: int, is_strapless: bool) -> None:
    """``tangled``: how many ways of sewing leave it so."""
    wearing: Any = SimpleNamespace(hangs_from_bust=is_strapless, below_arms=lambda: "lower")
    made: list[tuple[Any, ...]] = []

    def make(scene: None, outfit: Any, *_given: None) -> Any:
        way = len(made)
        own = SimpleNamespace(
            is_tangled=way < tangled, sew=lambda *momentum: made.append((outfit.wearing[0], *momentum))
        )
        return own

    lone = posed_start._Lone(None, Lone((wearing,)), None, None, None)  # type: ignore[arg-type]
    posed_start._sewn(lone, make)
    ways = [(wearing,), (wearing, posed_start.SLOW_MOMENTUM), ("lower",)]
    assert made == ways[: min(tangled, 1 + is_strapless) + 1]


def test_a_strapless_dress_below_the_arms_starts_lower_all_of_it() -> None:
    points = np.array([[0.0, 1.2, 0.0], [0.1, 0.3, 0.0]])
    body: Any = SimpleNamespace(span=1.6, up=np.array([0.0, 1.0, 0.0]))
    dress = Wearing((), (), np.zeros((0, 3), np.int32), body, points, points).below_arms()
    assert dress.start is points
    np.testing.assert_allclose(points - dress.followed, [[0.0, 0.072, 0.0]] * 2)
