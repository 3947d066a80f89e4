"""Fits together: the same bits alone, in company, in any order, and however the company fares."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
import pytest

import warp_cloth
from warp_cloth.avatar.contact import AvatarContact
from warp_cloth.avatar.exact import penetration, penetrations
from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import ONE_THREAD
from warp_cloth.batch import many
from warp_cloth.batch.loading import LoadCache
from warp_cloth.batch.many import fit_many
from warp_cloth.batch.memory import MemoryNeed, grouped_by_avatar, memory_need, split_to_fit
from warp_cloth.contact import garments
from warp_cloth.contact.garments import model_crossings, worn_crossings
from warp_cloth.fitting import avatar_contacts, problem
from warp_cloth.fitting.fit import Fit
from warp_cloth.fitting.problem import Problem, tolerance_of
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.kernels.base.active_set import GROUP
from warp_cloth.model.model import build_model
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.active_set import ActiveSet
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items
from warp_cloth.study.launches import arrays_in, bytes_of

ON_SPHERE = ["collision.cloth=false", "solver.iterations=330", "collision.pixel_mm=10"]
HANGING = ["garment.shape.vertices_per_side=6", "solver.iterations=250"]
SQUARE = {"shape": {"kind": "square", "vertices_per_side": 6}, "pin": {"vertices": [0]}}
SHORT = {"iterations": 50}
CUDA = pytest.param("cuda:0", True, marks=pytest.mark.cuda)


def mixture() -> list[Scene]:
    """Garments, avatars, fabrics, frictions, caps, limits and colliders of many kinds."""
    return [
        load_scene("sphere", [*ON_SPHERE, "garment.shape.vertices_per_side=9"]),
        load_scene("sphere", [*ON_SPHERE, "garment.shape.vertices_per_side=9", "avatar.friction=0.1"]),
        load_scene("sphere", [*ON_SPHERE, "garment.shape.vertices_per_side=12", "garment.fabric=silk"]),
        load_scene("sphere", [*ON_SPHERE, "garment.shape.vertices_per_side=9", "avatar.shape.radius=0.2"]),
        load_scene("sphere", [*ON_SPHERE, "garment.shape.vertices_per_side=7", "collision.avatar=mesh"]),
        load_scene("sphere", [*ON_SPHERE, "garment.shape.vertices_per_side=7", "collision.offset_mm=8"]),
        load_scene("hanging", HANGING),
        load_scene("hanging", [*HANGING, "garment.fabric=denim", "solver.cap=0.002", "solver.iterations=27"]),
        load_scene("hanging", [*HANGING, "solver.precision=float64"]),
        load_scene("hanging", [*HANGING, "solver.method=direct"]),
        load_scene("hanging", [*HANGING, "garment.fabric=silk", "solver.iterations=2000"]),
        load_scene("hanging", [*HANGING, "solver.iterations=0"]),
    ]


def test_maps_are_those_of_the_fit_alone() -> None:
    scenes = [mixture()[index] for index in (0, 3, 6)]
    together = fit_many(scenes, "cpu", together=3, maps="gap,pressure")
    for scene, fit in zip(scenes[:2], together, strict=False):
        alone = warp_cloth.fit(scene, device="cpu", maps="gap,pressure")
        assert fit.report["maps"] == alone.report["maps"]
        for name in ("gap", "pressure"):
            assert np.array_equal(fit.garments[0].fields[name], alone.garments[0].fields[name])
    assert together[2].maps is None  # it hangs: there is no body


def figures(fit: Fit) -> dict[str, Any]:
    """Everything that a fit tells, but for how long it took."""
    timed = ("seconds", "iterations_per_second")
    return {key: value for key, value in fit.report.items() if key not in timed}


def assert_same(fit: Fit | Exception, alone: Fit) -> None:
    assert isinstance(fit, Fit), fit
    for garment, other in zip(fit.garments, alone.garments, strict=True):
        assert np.array_equal(garment.points, other.points)
    assert figures(fit) == figures(alone)


def test_copies_of_the_process_measure_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    fabrics = ("cotton", "denim", "silk", "jersey")
    size, drawn = "garment.shape.vertices_per_side=9", "collision.pixel_mm=20"
    short = (size, drawn, "solver.iterations=20", "collision.cloth=false")
    scenes = [
        load_scene("sphere", [*short, f"garment.fabric={fabric}", f"avatar.friction={friction}"])
        for fabric in fabrics
        for friction in (0.1, 0.3)
    ]
    here = fit_many(scenes, "cpu", together=len(scenes))
    monkeypatch.setattr(LoadCache, "spare_cores", 2)
    for fit, alone in zip(fit_many(scenes, "cpu", together=len(scenes), load_cache=LoadCache(0)), here, strict=True):
        assert isinstance(alone, Fit)
        assert_same(fit, alone)


@pytest.mark.parametrize(("device", "gathers"), [("cpu", False), ("cpu", True), CUDA])
def test_an_item_has_the_same_bits_alone_in_company_and_in_any_order(
    device: str, gathers: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(problem, "build_model", partial(build_model, gathers=gathers))
    scenes = mixture()
    alone = [warp_cloth.fit(scene, device=device) for scene in scenes]
    assert len({fit.report["iterations"] for fit in alone}) >= 4, "they end at different times"
    together = fit_many(scenes, device, together=len(scenes))
    for fit, own in zip(together, alone, strict=True):
        assert_same(fit, own)
    order = np.random.default_rng(1).permutation(len(scenes)).tolist()
    shuffled = fit_many([scenes[at] for at in order], device, together=5)
    for fit, at in zip(shuffled, order, strict=True):
        assert_same(fit, alone[at])


def test_those_left_have_the_same_bits_where_the_others_are_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(problem, "build_model", partial(build_model, gathers=True))
    chosen: list[int] = []
    choose = ActiveSet.choose

    def told(self: ActiveSet, items: np.ndarray) -> None:
        choose(self, items)
        chosen.append(self.vertices.size)

    monkeypatch.setattr(ActiveSet, "choose", told)
    ends = [(9, 900), (17, 200), (24, 300), (13, 1300), (20, 400)]
    common = ["collision.cloth=false", "collision.pixel_mm=10"]
    scenes = [
        load_scene("sphere", [*common, f"garment.shape.vertices_per_side={n}", f"solver.iterations={k}"])
        for n, k in ends
    ]
    alone = [warp_cloth.fit(scene, device="cpu") for scene in scenes]
    assert not chosen
    for fit, own in zip(fit_many(scenes, "cpu", together=len(scenes)), alone, strict=True):
        assert_same(fit, own)
    *some, every = chosen
    assert every == sum(n * n for n, _ in ends), "to be measured at last"
    assert some == sorted(some, reverse=True)
    assert {size % GROUP for size in some} == {0}
    assert some[-1] <= 2 * GROUP, "one is left"


@pytest.mark.parametrize("gathers", [False, True])
def test_what_a_batch_takes_over_of_earlier_ones_changes_no_bit(gathers: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(problem, "build_model", partial(build_model, gathers=gathers))
    built = []
    monkeypatch.setattr(
        avatar_contacts, "AvatarContact", lambda *given, **named: built.append(1) or AvatarContact(*given, **named)
    )
    load_cache = LoadCache(0)
    scenes = mixture()[:7]
    alone = [warp_cloth.fit(scene, device="cpu") for scene in scenes]
    built.clear()
    for together in (1, len(scenes)):
        for fit, own in zip(fit_many(scenes, "cpu", together=together, load_cache=load_cache), alone, strict=True):
            assert_same(fit, own)
        assert len(built) == 6, "two scenes differ by friction only"


@pytest.mark.cuda
def test_a_batch_has_the_same_bits_on_both_devices() -> None:
    # the exact mesh is searched by Warp's own trees, whose rounding differs
    scenes = [scene for scene in mixture() if scene.collision.avatar != "mesh"]
    for gpu, cpu in zip(fit_many(scenes, "cuda:0"), fit_many(scenes, "cpu"), strict=True):
        assert np.array_equal(gpu.garments[0].points, cpu.garments[0].points)


def test_crossings_and_depths_of_many_are_those_of_each(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(garments, "POINTS_AT_ONCE", 300)
    rng = np.random.default_rng(2)
    outfits = [load_outfit(scene) for scene in mixture()[:5]]
    worn_garments = [garment for outfit in outfits for garment in outfit.garments]
    model = build_model(worn_garments, device="cpu", precision="mixed", garment_counts=[1] * 5)
    worn = [garment.points + rng.normal(scale=0.1, size=garment.points.shape) for garment in worn_garments]
    worn[2] = worn_garments[2].points
    for item, points in enumerate(worn):
        model.set_points(points, item)
    together, alone = model_crossings(model, outfits), worn_crossings(outfits, worn, "cpu")
    assert [found.pairs > 0 for found in together] == [True, True, False, True, True]
    for one, other in zip(together, alone, strict=True):
        assert (one.pairs, one.between) == (other.pairs, other.between)
        assert [faces.tolist() for faces in one.faces] == [faces.tolist() for faces in other.faces]
    worn[3][0, 0] = np.nan
    assert worn_crossings(outfits, worn, "cpu")[3].pairs == 0, "it is lost"
    avatars = [outfit.avatar for outfit in outfits]
    for avatar, points, depth in zip(avatars, worn, penetrations(worn, avatars, "cpu"), strict=True):
        assert avatar is not None
        assert depth is not None
        np.testing.assert_equal(asdict(depth), asdict(penetration(points, avatar, "cpu")))


def test_one_whose_numbers_are_lost_leaves_the_others_their_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes = [load_scene("hanging", [*HANGING, f"solver.iterations={240 + n}"]) for n in range(3)]
    alone = [warp_cloth.fit(scene, device="cpu") for scene in scenes]
    build = many.build_problem

    def with_a_hole(*given: Any, **options: Any) -> Problem:
        made = build(*given, **options)
        weight = made.model.vertices.weight.numpy().copy()
        weight[made.model.item_start[1] + 3] = np.nan
        made.model.vertices.weight.assign(weight)
        return made

    monkeypatch.setattr(many, "build_problem", with_a_hole)
    first, lost, third = fit_many(scenes, "cpu", together=3)
    assert_same(first, alone[0])
    assert_same(third, alone[2])
    assert lost.status is Status.DIVERGED
    assert np.isfinite(lost.garments[0].points).all()


def test_what_cannot_be_loaded_is_told_in_its_place() -> None:
    scenes = [load_scene("hanging", HANGING), load_scene("hanging", [*HANGING, "garment.mesh=none.obj"])]
    good, bad = fit_many(scenes, "cpu", together=2)
    assert isinstance(good, Fit)
    assert isinstance(bad, InputError)


def test_scenes_are_taken_as_a_fit_takes_them() -> None:
    bad, good, lost = fit_many([{"garment": {"shape": "cube"}}, {"garment": SQUARE, "solver": SHORT}, "nowhere.toml"])
    assert isinstance(good, Fit)
    assert isinstance(bad, InputError)
    assert isinstance(lost, InputError)
    assert "garment" in str(bad)
    with pytest.raises(InputError, match="no device"):
        fit_many([], "abacus")


def test_too_many_for_the_memory_are_halved_until_they_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes = [load_scene("hanging", [*HANGING, f"solver.iterations={20 + n}"]) for n in range(7)]
    alone = [warp_cloth.fit(scene, device="cpu") for scene in scenes]
    run, sizes = many._fit_together, []

    def narrow(some: list[Scene], *rest: Any) -> list[Fit]:
        sizes.append(len(some))
        if len(some) > 2:
            raise RuntimeError("Failed to allocate 123456789 bytes on device 'cuda:0'")
        return run(some, *rest)

    monkeypatch.setattr(many, "_fit_together", narrow)
    for fit, own in zip(fit_many(scenes, "cpu", together=7), alone, strict=True):
        assert_same(fit, own)
    assert sizes == [7, 3, 1, 2, 4, 2, 2]


def test_pieces_stay_within_the_budget_and_hold_every_item_once() -> None:
    needs = [MemoryNeed(size, 0, None) for size in (30, 50, 10, 200, 40, 40, 40)]
    pieces = split_to_fit(needs, 100, most=2)
    assert [list(piece) for piece in pieces] == [[0, 1], [2], [3], [4, 5], [6]]
    on_two_bodies = [MemoryNeed(20, 50, body) for body in "AAABBA"]
    assert [list(piece) for piece in split_to_fit(on_two_bodies, 100, most=9)] == [[0, 1], [2], [3, 4], [5]]
    assert grouped_by_avatar(on_two_bodies) == [0, 1, 2, 5, 3, 4]
    while_built = [
        MemoryNeed(30, 0, None),
        MemoryNeed(30, 0, None, transient=50),
        MemoryNeed(30, 0, None, transient=20),
        MemoryNeed(30, 0, None),
    ]
    assert [list(piece) for piece in split_to_fit(while_built, 110, most=9)] == [[0, 1], [2, 3]]
    assert split_to_fit([], 100, most=2) == []


@pytest.mark.parametrize("gathers", [False, True])
@pytest.mark.parametrize("fabric", ["cotton", "jersey", "default"])
def test_the_planned_memory_bounds_what_is_held(gathers: bool, fabric: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(problem, "build_model", partial(build_model, gathers=gathers))
    monkeypatch.setenv(ONE_THREAD, "1")  # as processes of a batch are
    changes = ["garment.shape.vertices_per_side=60", f"garment.fabric={fabric}", "solver.iterations=4000"]
    scene = load_scene("sphere", [*changes, "collision.pixel_mm=10", "collision.cloth=false"])
    outfit = load_outfit(scene)
    made = problem.build_problem([scene], [outfit], "cpu")
    relax_items(made.certifier, [Goal(tolerance_of(scene), 1500)])
    used = bytes_of(arrays_in([made.model, made.relaxation, made.certifier, made.contacts]))
    need = memory_need(scene, outfit, gathers=gathers)
    planned = need.own + need.shared
    assert used <= planned <= 2.5 * used
