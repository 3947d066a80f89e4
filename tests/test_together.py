"""Iterations that threads of the CPU share: the bits of one thread, and no waiting for what does not come."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
import warp as wp
from cloths import grid, model_of
from sheets import iterate
from test_clearance import ball, layers
from test_reaction import FRICTION, OFFSET, floor

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.threads import ONE_THREAD
from warp_cloth.fitting.problem import load_problem
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.passes.domains import APART, meet_threads
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import ClothModel, Garment, build_model
from warp_cloth.model.vertices import CONSTANT, ITERATED
from warp_cloth.scene import load_scene
from warp_cloth.solver import parallel_domains as together
from warp_cloth.solver.domains import cut_model
from warp_cloth.solver.parallel_domains import LONGEST_PAUSE, Pause, thread_count
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

WOVEN = Fabric(stretch_warp=2e4, stretch_weft=1e4, shear=100.0, bending_warp=1e-5, bending_weft=1e-5)
EDGES = Fabric(stretch_warp=2e4, stretch_weft=1e4, bending_warp=1e-5, bending_weft=1e-5)
SIDE = 17
USLEEP = ctypes.cast(ctypes.CDLL(None).usleep, ctypes.c_void_p).value


def sheet(mixed: bool = False) -> Mesh:
    """A sheet that slopes down to a floor at one corner; ``mixed``: its vertices in no order."""
    flat = grid(SIDE, 0.4)
    points = flat.points[:, [0, 2, 1]] + np.stack(
        [0.0 * flat.points[:, 0], flat.points.sum(axis=1) / 4, 0.0 * flat.points[:, 0]], 1
    )
    if not mixed:
        return Mesh("sheet", points + np.array([0.0, 5e-3, 0.0]), flat.triangles)
    order = np.random.default_rng(7).permutation(len(points))
    return Mesh(
        "sheet", (points + np.array([0.0, 5e-3, 0.0]))[np.argsort(order)], order[flat.triangles].astype(np.int32)
    )


def relaxed(
    threads: int, fabric: Fabric, *, mixed: bool = False, contact: bool = True, fold: float = 0.0
) -> Relaxation:
    """The sheet after iterations tight, loose and tight again, in bursts of several lengths."""
    mesh = sheet(mixed)
    rest = build_rest_shape(mesh, fabric, rest="mesh")
    rest.fold_angle[...] = fold
    pins = np.array([0, SIDE], dtype=np.int32) if not contact else np.zeros(0, dtype=np.int32)
    model = model_of(mesh, rest, precision="mixed", pins=pins, avatar_friction=FRICTION, offset=OFFSET)
    relaxation = Relaxation(model, floor() if contact else Collider(), StepOptions(threads=threads))
    wp.force_load("cpu", modules=[kernel.module for kernel in relaxation.kernels() + relaxation.seldom_kernels()])
    for residual, bursts in ((1.0, [20, 20, 20]), (0.0, [20, 20, 7, 20, 13]), (1.0, [20, 3])):
        relaxation.update_anisotropy(np.array([residual]))
        for count in bursts:
            relaxation.run(count)
    return relaxation


def state(relaxation: Relaxation) -> list[np.ndarray]:
    """All that the next iteration goes on from."""
    now = relaxation.model.state
    kept = [now.position, now.displacement, now.stiffness, now.compliance, now.in_contact, now.clearance]
    return [array.numpy() for array in kept if array]


@pytest.mark.parametrize(
    "case",
    [
        {"fabric": WOVEN},
        {"fabric": WOVEN, "mixed": True},
        {"fabric": WOVEN, "contact": False},
        {"fabric": EDGES},
        {"fabric": WOVEN, "contact": False, "fold": 0.3},
    ],
    ids=["worn", "in no order", "pinned", "edges", "pressed"],
)
def test_threads_give_the_bits_of_one(case: dict, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(together, "AT_WORK", 0.0)  # whatever else the machine does
    alone = relaxed(1, **case)
    for count in (2, 3):
        shared = relaxed(count, **case)
        assert shared.thread_count == count
        assert all((one == other).all() for one, other in zip(state(alone), state(shared), strict=True))


def test_threads_share_cloth_that_meets_cloth_at_the_bits_of_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(together, "AT_WORK", 0.0)
    field = ball()
    every = [layers(field, threads=count) for count in (1, 2, 3)]
    assert [each.thread_count for each in every] == [1, 2, 3]
    for balanced in (1.0, 0.0, 1.0):
        for each in every:
            each.update_anisotropy(np.array([balanced]))
            iterate(each, 100)
        alone, *others = (state(each) for each in every)
        assert all((one == now).all() for other in others for one, now in zip(alone, other, strict=True))
    contact = every[0].cloth_contact
    assert contact.data.pairs.count.numpy()[0] > 50


def test_threads_that_come_and_go_do_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(together, "AT_WORK", 2.0)  # as on a busy machine
    alone, shared = relaxed(1, WOVEN), relaxed(2, WOVEN)
    assert all((one == other).all() for one, other in zip(state(alone), state(shared), strict=True))


@pytest.mark.parametrize("mixed", [False, True])
def test_every_vertex_is_in_one_domain_with_all_that_acts_on_it(mixed: bool) -> None:
    mesh = sheet(mixed)
    model = model_of(mesh, build_rest_shape(mesh, WOVEN, rest="mesh"), precision="mixed")
    domains = cut_model(model, 3)
    order = np.concatenate([domain.order.numpy() for domain in domains])
    assert (np.sort(order) == np.arange(model.vertex_count)).all()
    for domain in domains:
        own = set(domain.order.numpy().tolist())
        for whole, garment in (
            (model.edges.ends, domain.model.edges.ends),
            (model.triangles.corners, domain.model.triangles.corners),
        ):
            wanted = [row for row in whole.numpy().tolist() if own & set(row)]
            there = [row for row in order[garment.numpy()].tolist() if own & set(row)]
            assert there == wanted  # in the same order, as sums depend on it


def test_domains_have_all_that_a_cloth_has() -> None:
    others = {"items", "displacement4"}  # of all domains, and where forces are gathered
    types = cloth_types("mixed")
    assert {*types.Model.vars, *types.State.vars} == {*ITERATED, *CONSTANT, *others}


def test_domains_are_cut_where_they_double_little() -> None:
    mesh = sheet(mixed=True)
    model = model_of(mesh, build_rest_shape(mesh, WOVEN, rest="mesh"), precision="mixed")
    for domain in cut_model(model, 2):
        assert len(domain.order) <= model.vertex_count // 2 + 1
        assert domain.model.triangle_count <= model.triangle_count // 2 + 5 * SIDE  # three rows of it at the most


def test_a_thread_does_not_wait_for_ever() -> None:
    arrivals = wp.zeros(3 * APART, dtype=wp.int32, device="cpu")

    def meet(number: int, naps: int) -> None:
        wp.launch(meet_threads, dim=1, inputs=[number, USLEEP, naps, arrivals], device="cpu")

    meet(0, 10)
    assert arrivals.numpy()[0] == 1  # the other never came
    meet(1, 10**9)  # and does not wait either when it does


@pytest.mark.parametrize("failing", [1, 2], ids=["one", "both"])
def test_a_thread_that_fails_holds_up_nobody(failing: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(together, "AT_WORK", 0.0)
    shared = relaxed(2, WOVEN)
    launch, calls = wp.capture_launch, []

    def fail(graph: object) -> None:
        calls.append(graph)
        if len(calls) <= failing:
            raise MemoryError
        launch(graph)

    monkeypatch.setattr(wp, "capture_launch", fail)
    with pytest.raises(MemoryError):
        shared.run(20)
    with pytest.raises((MemoryError, RuntimeError)):  # what one of them has left undone is not gone on from
        shared.run(20)


def test_pauses_grow_while_threads_wait_in_vain_and_shrink_when_they_do_not() -> None:
    pause, lengths = Pause(), []
    for _ in range(10):
        length = 0
        while not pause.over():
            length += 1
        lengths.append(length)
        pause.tell(0.5)
    assert lengths == [0, 1, 2, 4, 8, 16, 32, LONGEST_PAUSE, LONGEST_PAUSE, LONGEST_PAUSE]
    while not pause.over():
        pass
    pause.tell(1.0)
    assert pause.over()  # at once


def test_threads_are_as_many_as_cores_are_there_and_work_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(together, "core_count", lambda: 4)
    assert thread_count(None, 1_000_000) == 4
    assert thread_count(2, 1_000_000) == 2
    assert thread_count(16, 1_000_000) == 4
    assert thread_count(None, 3_500) == 2
    assert thread_count(None, 500) == 1
    monkeypatch.undo()
    monkeypatch.setenv(ONE_THREAD, "1")  # of a batch
    assert thread_count(None, 1_000_000) == 1


def model_of_two() -> ClothModel:
    mesh = sheet()
    garment = Garment(mesh.points, mesh.triangles, build_rest_shape(mesh, WOVEN, rest="mesh"), np.zeros(0, np.int32))
    return build_model([garment, garment], device="cpu", precision="mixed", garment_counts=[1, 1])


def test_several_items_take_one_thread() -> None:
    assert Relaxation(model_of_two(), Collider(), StepOptions(threads=2)).thread_count == 1


def test_a_scene_says_how_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(together, "core_count", lambda: 2)
    monkeypatch.setattr(together, "LEAST", 100)
    scene = {"garment": {"shape": {"kind": "square", "vertices_per_side": 20}, "pin": [{"vertices": [0, 19]}]}}
    assert load_problem(load_scene(scene), "cpu").relaxation.thread_count == 2
    assert load_problem(load_scene(scene, ["solver.threads=1"]), "cpu").relaxation.thread_count == 1
    with pytest.raises(InputError, match="threads"):
        load_scene(scene, ["solver.threads=0"])
