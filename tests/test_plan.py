"""The plan shows what an iteration really launches and takes; what is left out is truly absent."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from typer.testing import CliRunner

from warp_cloth.base.errors import InputError
from warp_cloth.cli.main import app
from warp_cloth.fitting.fit import fit
from warp_cloth.fitting.problem import Problem, load_problem
from warp_cloth.garment.confines import confining_box
from warp_cloth.model.plan import contact_kind, make_plan
from warp_cloth.scene import load_scene
from warp_cloth.study import footprint, planning, savings, timing
from warp_cloth.study.launches import Launch, bytes_of, launches_of

SQUARE = {"kind": "square", "side": 0.5, "vertices_per_side": 7, "plane": "vertical", "height": 1.5}
SPHERE = {"kind": "sphere", "radius": 0.2, "centre": [0.0, 1.2, -0.1], "edge_mm": 80}
PLAIN = {"stretch": 2e4, "shear": "edges", "bending": 1e-6}
WOVEN = {"stretch": 2e4, "shear": 50.0, "bending": 1e-6}
TOP = {"box": [[-1, 1.499, -1], [1, 2, 1]]}


def ready(fabric: object = None, **more: object) -> Problem:
    tree = {
        "garment": {"shape": SQUARE, "fabric": fabric or PLAIN, "pin": TOP},
        "collision": {"pixel_mm": 20, "avatar": "depth"},
        **more,
    }
    if "avatar" not in tree:
        del tree["collision"]
    return load_problem(load_scene(tree), "cpu")


def seen(made: Problem) -> tuple[list[Launch], set[str]]:
    """Launches of an iteration, and the names of the arrays that they are given."""
    launches = launches_of(made.relaxation.iterate)
    return launches, {name for launch in launches for name in launch.arrays()}


def test_an_iteration_launches_the_kernels_that_the_relaxation_names() -> None:
    made = ready(avatar={"shape": SPHERE})
    launches, _ = seen(made)
    assert [launch.kernel for launch in launches] == made.relaxation.kernels()


@pytest.mark.parametrize(
    ("fabric", "gone"), [({**WOVEN, "bending": 0.0}, "hinge_stiffness"), (PLAIN, "yarns"), (PLAIN, "slope")]
)
def test_a_term_without_use_has_no_array(fabric: dict[str, object], gone: str) -> None:
    _, names = seen(ready(WOVEN))
    assert {name for name in names if gone in name}
    _, names = seen(ready(fabric))
    assert not {name for name in names if gone in name}


def test_without_pins_or_steps_of_its_own_a_vertex_keeps_neither() -> None:
    _, names = seen(ready())
    assert {"model.pinned", "state.stiffness"} <= names
    shape = {"kind": "sphere", "radius": 0.2, "centre": [0.0, 1.0, 0.0], "edge_mm": 80}
    tree = {"garment": {"shape": SQUARE, "fabric": PLAIN}, "avatar": {"shape": shape}, "solver": {"method": "direct"}}
    _, names = seen(load_problem(load_scene(tree), "cpu"))
    assert not {"model.pinned", "state.stiffness"} & names


@pytest.mark.parametrize(("more", "less"), [(PLAIN, {**PLAIN, "bending": 0.0}), (WOVEN, {**WOVEN, "bending": 0.0})])
def test_bending_off_launches_less_and_its_memory_is_free(more: dict[str, object], less: dict[str, object]) -> None:
    (launches, _), (fewer, _) = seen(ready(more)), seen(ready(less))
    assert len(fewer) < len(launches)
    sizes = [bytes_of([a for launch in some for a in launch.arrays().values()]) for some in (fewer, launches)]
    assert sizes[0] < sizes[1]


def test_no_avatar_no_collider() -> None:
    _, names = seen(ready())
    assert not {name for name in names if name.startswith("collider")}
    _, names = seen(ready(avatar={"shape": SPHERE}))
    assert {name for name in names if name.startswith("collider")}
    assert "colliders.values" in names  # the field, in a struct in an array


@pytest.mark.parametrize("method", ["accelerated", "direct"])
@pytest.mark.parametrize("avatar", [None, SPHERE])
def test_compulsory_bytes_are_those_of_the_arrays_of_a_launch_each_counted_once(
    method: str, avatar: dict[str, object] | None
) -> None:
    more = {"avatar": {"shape": avatar}} if avatar else {}
    made = ready("cotton", solver={"method": method}, **more)
    launches = launches_of(made.relaxation.iterate)
    for launch in launches:
        arrays = {array.ptr: array for array in launch.arrays().values() if array.ndim == 1}
        assert footprint.compulsory_bytes(launch) == sum(array.capacity for array in arrays.values()) > 0
        before = {name: array.numpy().copy() for name, array in launch.arrays().items()}
        launch.command.launch()
        changed = {name for name, array in launch.arrays().items() if not np.array_equal(before[name], array.numpy())}
        assert all(launch.arrays()[name].ptr in arrays for name in changed)  # what a launch writes counts


def test_memory_that_two_arrays_share_counts_once() -> None:
    whole = wp.zeros(100, dtype=float, device="cpu")
    other = wp.zeros(10, dtype=float, device="cpu")
    assert bytes_of([whole, whole[10:50], other]) == 440


def test_shares_are_of_the_kernels_that_are_launched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "SHORTEST_RUN", 0.01)
    made = ready("cotton", avatar={"shape": SPHERE})
    cost = footprint.footprint_of(made)
    always, seldom = len(made.relaxation.kernels()), len(made.relaxation.seldom_kernels())
    assert always <= cost.launches <= len(cost.kernels) <= always + seldom
    assert sum(cost.fraction(kernel) for kernel in cost.kernels) == pytest.approx(1.0)
    assert sum(kernel.seconds for kernel in cost.kernels) == pytest.approx(cost.seconds)
    assert all(kernel.bytes > 0 and kernel.seconds > 0 and kernel.purpose for kernel in cost.kernels)
    assert cost.memory["avatar"] > 0


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("fabric", [PLAIN, WOVEN], ids=["edges", "woven"])
def test_a_garment_that_cannot_reach_the_avatar_does_not_ask_it_and_one_that_may_does(
    fabric: dict[str, object], side: float
) -> None:
    def scene(away: float) -> dict[str, object]:
        shape = {"kind": "sphere", "radius": 0.4, "centre": [side * away, 1.2, 0.0], "edge_mm": 160}
        garment = {"shape": SQUARE, "fabric": fabric, "pin": TOP}
        return {"garment": garment, "avatar": {"shape": shape}, "collision": {"pixel_mm": 20}}

    kinds = {}
    for away in (0.8, 2.1):
        made = load_scene(scene(away))
        kinds[away] = contact_kind(made, load_problem(made, "cpu").outfit)
    assert kinds == {0.8: "auto", 2.1: "none"}


@pytest.mark.parametrize("fabric", [PLAIN, WOVEN], ids=["edges", "woven"])
def test_a_pinned_garment_stays_within_its_reach_all_the_way(fabric: dict[str, object]) -> None:
    tree = {"garment": {"shape": SQUARE, "fabric": {**fabric, "weight": 5.0}, "pin": {"vertices": [0]}}}
    scene = load_scene(tree, ["solver.iterations=3000"])
    made = load_problem(scene, "cpu")
    box = confining_box(made.outfit.garments[0])
    worn = fit(scene, device="cpu", frames=20)
    shapes = worn.garments[0].frames
    assert shapes is not None
    assert (shapes >= box[0]).all()
    assert (shapes <= box[1]).all()


def test_nothing_is_proved_of_a_garment_that_nothing_holds() -> None:
    made = load_problem(load_scene({"garment": {"shape": SQUARE, "fabric": PLAIN}}), "cpu")
    assert confining_box(made.outfit.garments[0]) is None


def test_every_term_says_why() -> None:
    made = ready("cotton", avatar={"shape": SPHERE, "friction": 0.0})
    scene = load_scene({"garment": {"shape": SQUARE, "fabric": "cotton"}, "avatar": {"shape": SPHERE, "friction": 0}})
    terms = {term.name: term for term in make_plan(scene, made.outfit)}
    assert all(term.reason for term in terms.values())
    assert not terms["avatar friction"].used
    assert terms["weave"].used
    assert not terms["tension"].used


def test_the_command_tells_terms_kernels_and_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "SHORTEST_RUN", 0.01)
    out = tmp_path / "plan.json"
    options = ["--set", "garment.shape.vertices_per_side=9", "--device", "cpu", "--out", str(out)]
    result = CliRunner().invoke(app, ["plan", "hanging", *options])
    assert result.exit_code == 0, result.output
    for words in (
        "Terms:",
        "An iteration",
        "compulsory bytes",
        "Memory:",
        "displace_vertices",
        "the scene has no avatar",
    ):
        assert words in result.stdout
    values = json.loads(out.read_text())
    assert values["vertices"] == 81
    assert sum(kernel["share"] for kernel in values["kernels"]) == pytest.approx(1.0)


def test_a_plan_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, *_: object, **__: object) -> None:
        path.touch()
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    monkeypatch.setattr(planning, "plan_values", lambda *_: {})
    with pytest.raises(InputError, match="No space left on device"):
        planning.write_plan(tmp_path / "new" / "plan.json", (), None)  # type: ignore[arg-type]
    assert not list((tmp_path / "new").iterdir())


def test_savings_are_of_the_terms_in_use_and_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(savings, "SHORTEST_RUN", 0.01)
    scene = load_scene({"garment": {"shape": SQUARE, "fabric": PLAIN, "pin": TOP}})
    made = load_problem(scene, "cpu")
    saved = savings.savings_of(scene, made.outfit, "cpu")
    assert [each.term for each in saved] == ["bending", savings.REST]
    assert sum(each.share for each in saved) == pytest.approx(1.0)
    assert saved[0].share < 1.0


def test_cloth_that_meets_cloth_is_timed_with_its_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "SHORTEST_RUN", 0.01)
    flat = {**SQUARE, "plane": "horizontal"}
    sheets = [{"shape": {**flat, "height": height}, "fabric": PLAIN} for height in (1.45, 1.452)]
    made = load_problem(
        load_scene({"garment": sheets, "avatar": {"shape": SPHERE}, "collision": {"cloth": True}}), "cpu"
    )
    cost = footprint.footprint_of(made)
    assert {"add_contact_forces", "start_search"} <= {kernel.name for kernel in cost.kernels}
    assert cost.iterations[0] < cost.iterations[1]
    assert sum(kernel.seconds for kernel in cost.kernels) == pytest.approx(cost.seconds)


def test_what_a_timer_adds_follows_from_launches_that_run_one_after_another() -> None:
    times = timing.Times(seconds=20.0)
    timing._attribute(times, {("search", 1): [10.0], ("move", 1): [9.0, 11.0]}, 1, serial=24.0)
    assert times.spent == pytest.approx({"search": 20.0 * 8.0 / 24.0, "move": 20.0 * 16.0 / 24.0})


def test_searches_that_overlap_do_so_again_after_they_were_timed_one_after_another() -> None:
    flat = {**SQUARE, "plane": "horizontal"}
    sheets = [{"shape": {**flat, "height": height}, "fabric": PLAIN} for height in (1.45, 1.452)]
    made = load_problem(load_scene({"garment": sheets, "collision": {"cloth": True}}), "cpu")
    cloth_contact = made.relaxation.cloth_contact
    run = timing.TimedFit(made)
    assert not run.overlaps
    cloth_contact.awaken(made.relaxation.contact_state())
    cloth_contact.pair_search.side_stream = object()
    seen = []
    made.relaxation.run = lambda count: seen.append(cloth_contact.pair_search.side_stream)
    made.relaxation.capture = lambda count: None
    assert run.overlaps
    assert run.serial_seconds() > 0.0
    assert set(seen) == {None}
    assert cloth_contact.pair_search.side_stream is not None


def test_the_command_refuses_in_one_line() -> None:
    result = CliRunner().invoke(app, ["plan", "hangin", "--device", "cpu"])
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
