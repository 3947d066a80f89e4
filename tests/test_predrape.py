"""Predrape: fits in all fabrics start from the rest shape of one fabric, with the same bits alone and in a batch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from devices import DEVICES

import warp_cloth
from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.batch.loading import LoadCache
from warp_cloth.batch.many import fit_many
from warp_cloth.batch.memory import memory_need
from warp_cloth.contact.garments import model_crossings
from warp_cloth.fitting import predrape
from warp_cloth.fitting.fit import Fit
from warp_cloth.fitting.predrape import build_predrape, start_predraped
from warp_cloth.fitting.problem import load_problem
from warp_cloth.garment.outfit import MeshCache, load_outfit
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene, load_scene
from warp_cloth.scene.predrape import FABRIC_NAME, FRICTION, ITERATIONS, predrape_scene_of
from warp_cloth.solver.loop import relax_items

CLOTH = ["garment.shape.vertices_per_side=9", "collision.pixel_mm=10", "collision.cloth=false", "solver.iterations=400"]


def draped(*changes: str) -> Scene:
    """Cloth over a sphere that is dressed first."""
    return load_scene("sphere", [*CLOTH, "solver.start=dressed", *changes])


def mixture() -> list[Scene]:
    """Three fits that are dressed alike, one on another sphere, one of another precision, one as it is placed."""
    return [
        draped("garment.fabric=silk"),
        draped("garment.fabric=denim", "avatar.friction=0.1"),
        draped("garment.fabric=wool", "solver.iterations=300"),
        draped("garment.fabric=silk", "avatar.shape.radius=0.2"),
        draped("garment.fabric=silk", "solver.precision=float64"),
        load_scene("sphere", [*CLOTH, "garment.fabric=silk"]),
    ]


def test_what_is_dressed_alike_differs_in_fabric_friction_and_goals_only() -> None:
    one, other = predrape_scene_of(draped("garment.fabric=silk")), predrape_scene_of(draped("avatar.friction=0.1"))
    assert one == other
    assert one.garments[0].fabric.name == FABRIC_NAME
    assert one.avatar.friction == FRICTION
    assert (one.solver.start, one.solver.iterations) == ("placed", ITERATIONS)
    assert predrape_scene_of(load_scene("sphere", CLOTH)) is None


def test_a_dressed_garment_shares_its_mesh_with_the_one_that_it_is_dressed_in() -> None:
    mesh_cache = MeshCache()
    one, other = (load_outfit(draped(f"garment.fabric={fabric}"), mesh_cache) for fabric in ("silk", "denim"))
    assert one.predrape_garments[0] is other.predrape_garments[0]
    assert one.predrape_garments[0].points is one.garments[0].points
    assert one.predrape_garments[0].rest.fabric != one.garments[0].rest.fabric
    assert not load_outfit(load_scene("sphere", CLOTH), mesh_cache).predrape_garments


@pytest.mark.parametrize("device", DEVICES)
def test_dressed_fits_have_the_same_bits_alone_in_company_and_in_any_order(device: str) -> None:
    scenes = mixture()
    alone = [warp_cloth.fit(scene, device=device) for scene in scenes]
    load_cache = LoadCache(0)
    for order, together in ([*range(6)], 6), ([5, 4, 3, 2, 1, 0], 6), ([2, 0, 1, 5, 3, 4], 1):
        fits = fit_many([scenes[at] for at in order], device, together=together, load_cache=load_cache)
        for fit, at in zip(fits, order, strict=True):
            assert isinstance(fit, Fit), fit
            assert np.array_equal(fit.garments[0].points, alone[at].garments[0].points)
            for told in ("status", "iterations", "levels", "residual", "rest_error_mm"):
                assert fit.report[told] == alone[at].report[told]
    assert not np.array_equal(alone[0].garments[0].points, alone[5].garments[0].points)


def test_what_is_dressed_alike_is_dressed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    counts = []

    def counted(certifier, *rest, **more):  # type: ignore[no-untyped-def]
        counts.append(certifier.relaxation.model.item_count)
        return relax_items(certifier, *rest, **more)

    monkeypatch.setattr(predrape, "relax_items", counted)
    load_cache = LoadCache(0)
    fit_many(mixture()[:4], "cpu", together=4, load_cache=load_cache)
    assert counts == [2], "on two spheres"
    fit_many(mixture()[:4], "cpu", together=1, load_cache=load_cache)
    assert counts == [2], "and then never again"


def test_the_report_tells_what_dressing_took_and_the_iterations_are_the_fits_own() -> None:
    fit = warp_cloth.fit(draped("garment.fabric=silk"), device="cpu")
    (level,) = fit.report["levels"]
    assert level["vertices"] == fit.report["vertices"]
    assert 0 < level["iterations"] <= ITERATIONS
    assert fit.report["iterations"] <= 400


def test_dressed_cloth_rests_in_fewer_iterations() -> None:
    more = (
        "solver.iterations=20000",
        "collision.cloth=auto",
        "garment.fabric=silk",
        "garment.shape.vertices_per_side=17",
    )
    placed = warp_cloth.fit(load_scene("sphere", [*CLOTH, *more]), device="cpu")
    dressed = warp_cloth.fit(draped(*more), device="cpu")
    assert placed.status is dressed.status is Status.AT_REST
    assert dressed.report["iterations"] < placed.report["iterations"]


def test_what_crosses_as_it_is_dressed_is_untangled_there_unless_cloth_is_to_pass_through_cloth() -> None:
    crossings = {}
    for cloth in ("auto", "false"):
        scene = draped(f"collision.cloth={cloth}", "avatar.shape.radius=0.12")
        problem = load_problem(scene, "cpu")
        dressing = build_predrape(problem, Cache())
        assert dressing is not None
        (levels,) = start_predraped(problem, dressing)
        crossings[cloth] = len(levels), model_crossings(problem.model, problem.outfits)[0].pairs > 0
    assert crossings == {"auto": (2, False), "false": (1, True)}


def test_what_loses_itself_while_it_is_dressed_starts_as_it_is_placed(monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(*given, **more):  # type: ignore[no-untyped-def]
        return [replace(outcome, status=Status.DIVERGED) for outcome in relax_items(*given, **more)]

    monkeypatch.setattr(predrape, "relax_items", lost)
    fit = warp_cloth.fit(draped("garment.fabric=silk"), device="cpu")
    placed = warp_cloth.fit(load_scene("sphere", [*CLOTH, "garment.fabric=silk"]), device="cpu")
    assert fit.report["levels"][0]["status"] == "diverged"
    assert np.array_equal(fit.garments[0].points, placed.garments[0].points)


def test_an_earlier_result_is_a_start_of_its_own() -> None:
    worn = warp_cloth.fit(load_scene("sphere", CLOTH), device="cpu")
    fit = warp_cloth.fit(draped(), device="cpu", start=worn)
    assert fit.report["levels"] == []


def test_a_dressed_garment_needs_the_memory_of_two_and_one_more_in_another_fabric_its_own() -> None:
    one, two = load_scene("sphere", CLOTH), draped()
    needs = [memory_need(scene, load_outfit(scene), gathers=True) for scene in (one, two)]
    assert needs[1].own == needs[0].own
    assert needs[1].shared == needs[0].shared + needs[0].own


@pytest.mark.parametrize(
    ("change", "way"),
    [
        ("solver.method=multilevel", 'solver.method = "accelerated"'),
        ("solver.method=direct", 'solver.method = "accelerated"'),
        ("collision.cloth=true", "collision.cloth = false"),
        ('avatar={mesh="body.obj", poses=["bent.obj"]}', "no avatar.poses"),
    ],
)
def test_what_has_a_way_of_its_own_cannot_be_dressed(change: str, way: str) -> None:
    with pytest.raises(InputError, match=r"solver\.start") as refused:
        draped(change)
    assert f'"dressed" needs {way}; use "placed"' in str(refused.value)
