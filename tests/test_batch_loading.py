"""Loader processes make what the worker itself would have made, and nothing is lost without them."""

from __future__ import annotations

import fcntl
import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest

from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.first_run import FOLDER
from warp_cloth.batch import shared_results, warm_kernels
from warp_cloth.batch.arena import Arena
from warp_cloth.batch.loading import LEAST_WORK, LoadCache, Loaders
from warp_cloth.batch.many import fit_many
from warp_cloth.batch.processes import process_context
from warp_cloth.batch.shared_results import SharedCache, get_or_make_shared, read_shared, write_shared
from warp_cloth.fitting.fit import Fit
from warp_cloth.fitting.problem import problem_kind
from warp_cloth.garment.outfit import MeshCache, Recipe, avatar_recipe, load_outfit, mesh_recipes
from warp_cloth.kernels.base.options import SINGLE
from warp_cloth.model.model import build_model
from warp_cloth.model.patches import cutting
from warp_cloth.scene import Scene, load_scene


def scenes() -> list[Scene]:
    """More different meshes than it takes to start loaders, on one avatar, in two fabrics."""
    sides = [4 + number // 2 for number in range(2 * LEAST_WORK)]
    fabrics = ("jersey", "denim")
    common = ["solver.iterations=40", "collision.pixel_mm=10"]
    return [
        load_scene(
            "sphere", [*common, f"garment.shape.vertices_per_side={side}", f"garment.fabric={fabrics[number % 2]}"]
        )
        for number, side in enumerate(sides)
    ]


@pytest.fixture(scope="module")
def loaders() -> Iterator[Loaders]:
    made = Loaders(2)
    yield made
    made.close()


def made_in(folder: Path) -> list[Path]:
    """The files of results that are stored there."""
    return [file for file in folder.iterdir() if file.suffix != ".lock"]


def forbidden(*_: object) -> None:
    raise AssertionError("it is in the cache")


def test_loaders_make_what_the_worker_would_have_made_and_share_it_alike(loaders: Loaders) -> None:
    several, mesh_cache = scenes(), MeshCache()
    loaders.fill(mesh_cache, several)
    for scene in several:
        for recipe in mesh_recipes(scene):
            mesh_cache.make(Recipe(recipe.key, forbidden))
    opened = [load_outfit(scene, mesh_cache) for scene in several]
    for scene, outfit in zip(several, opened, strict=True):
        alone = load_outfit(scene)
        for garment, own in zip(outfit.garments, alone.garments, strict=True):
            assert np.array_equal(garment.points, own.points)
            assert np.array_equal(garment.rest.hinge_stiffness, own.rest.hinge_stiffness)
            assert np.array_equal(garment.pins, own.pins)
    assert len({id(outfit.avatar) for outfit in opened}) == 1
    jersey, denim = opened[:2]
    assert jersey.garments[0].points is denim.garments[0].points, "one mesh in two fabrics meets its avatar alike"


def test_constants_of_a_garment_are_computed_get_or_make_shared_workers(loaders: Loaders, tmp_path: Path) -> None:
    several, mesh_caches = scenes(), [MeshCache(), MeshCache()]
    times = []
    for mesh_cache in mesh_caches:
        loaders.begin(mesh_cache, several, patches=False, shared=tmp_path)
        loaders.fill(mesh_cache, several)
        times.append({file.name: file.stat().st_mtime_ns for file in made_in(tmp_path)})
    assert len(times[0]) == len(several)
    assert times[1] == times[0], "the second one has found them"
    for scene in several:
        garment, other = (load_outfit(scene, mesh_cache).garments[0].rest for mesh_cache in mesh_caches)
        assert np.array_equal(garment.hinge_stiffness, other.hinge_stiffness)
        assert garment.fabric == other.fabric


def test_what_shapes_are_drafted_from_is_computed_once_for_all_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, "off")
    scene = load_scene("tshirt", ["garment.shape.edge_mm=45"])
    (recipe,) = avatar_recipe(scene)
    alone, mesh = MeshCache().make(recipe), load_outfit(scene).meshes[0]
    for _ in range(2):
        mesh_cache = MeshCache(SharedCache(tmp_path))
        assert np.array_equal(mesh_cache.make(recipe).points, alone.points)
        assert np.array_equal(mesh_cache.make(mesh_recipes(scene)[0]).points, mesh.points)
        assert len(made_in(tmp_path)) == 5, "the body, its form, the sleeve, the pattern, where the trunk goes"


def test_who_comes_while_another_makes_something_waits_for_it(tmp_path: Path) -> None:
    file, made = tmp_path / "own", []

    def make(number: int) -> int:
        made.append(number)
        time.sleep(0.2)
        return number

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda number: get_or_make_shared(file, partial(make, number)), range(4)))
    assert len(made) == 1
    assert found == 4 * made
    with pytest.raises(ZeroDivisionError):
        get_or_make_shared(tmp_path / "other", lambda: 1 // 0)
    assert get_or_make_shared(tmp_path / "other", lambda: 5) == 5, "who fails gives its lock up"
    assert get_or_make_shared(tmp_path / "none" / "own", lambda: 7) == 7, "where nothing can be kept"


@pytest.mark.parametrize(("nicer", "waits"), [(0, True), (1, False)])
def test_nobody_waits_for_a_process_of_lower_priority(tmp_path: Path, nicer: int, waits: bool) -> None:
    file = tmp_path / "own"
    with open(tmp_path / "own.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        lock.write(str(os.nice(0) + nicer))
        lock.flush()
        with ThreadPoolExecutor(1) as pool:
            coming = pool.submit(get_or_make_shared, file, lambda: "its own")
            time.sleep(0.2)
            assert coming.done() != waits
            write_shared(file, "made here")
            lock.close()
            assert coming.result() == ("made here" if waits else "its own")


def test_what_cannot_be_kept_for_others_or_read_is_computed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "own"
    write_shared(tmp_path / "none" / "own", 1)
    assert read_shared(tmp_path / "none" / "own") is None
    write_shared(file, np.arange(1000))
    assert read_shared(file).sum() == 499_500
    file.write_bytes(file.read_bytes()[:500])
    assert read_shared(file) is None
    file.write_bytes(b"")
    assert read_shared(file) is None
    monkeypatch.setattr(shared_results, "MOST_BYTES", 100)
    for name in "abc":
        write_shared(tmp_path / name, bytes(80))
    assert [read_shared(tmp_path / name) is not None for name in "abc"] == [True, True, False], "the folder is full"


def _forks_loaders(connection: Connection) -> None:
    """As a worker does: says of each scene whether its garment is as alone, and lies in shared memory."""
    load_cache, mesh_cache = LoadCache(2, fork=True), MeshCache()
    load_cache.loaders.fill(mesh_cache, scenes(), Cache())
    alike = []
    for scene in scenes():
        garment, own = load_outfit(scene, mesh_cache).garments[0], load_outfit(scene).garments[0]
        pairs = [(garment.points, own.points), (garment.rest.hinge_stiffness, own.rest.hinge_stiffness)]
        alike.append(all(np.array_equal(one, other) for one, other in pairs) and not garment.points.flags.owndata)
    load_cache.loaders.close()
    connection.send(alike)


def test_loaders_that_are_forked_make_the_same_where_their_worker_reads_it() -> None:
    ours, theirs = process_context().Pipe()
    process = process_context().Process(target=_forks_loaders, args=(theirs,))
    process.start()
    theirs.close()
    assert ours.recv() == [True] * len(scenes())
    process.join()


def _tells_priority(connection: Connection, rank: int) -> None:
    loaders = Loaders(1, fork=True, rank=rank)
    connection.send(loaders._pool.submit(os.nice, 0).result() - os.nice(0))
    loaders.close()


def test_a_workers_loaders_leave_the_cores_to_it_and_to_those_of_earlier_ones() -> None:
    steps = []
    for rank in range(2):
        ours, theirs = process_context().Pipe()
        process = process_context().Process(target=_tells_priority, args=(theirs, rank))
        process.start()
        theirs.close()
        steps.append(ours.recv())
        process.join()
    assert 0 < steps[0] < steps[1]


def test_one_body_is_made_once_for_garments_of_all_sizes() -> None:
    sizes = [load_scene("tshirt", [f"garment.shape.size={size}"]) for size in ("S", "L")]
    bodies = [load_scene("tshirt", [f"avatar.shape.size={size}"]) for size in ("S", "L")]
    recipes = [recipe for scene in (*sizes, *bodies) for recipe in avatar_recipe(scene)]
    assert recipes[0].key == recipes[1].key, "the body is the wearer's, whatever the garment's size"
    assert recipes[2].key != recipes[3].key


def test_what_an_arena_has_no_room_for_is_sent_as_it_is() -> None:
    arena, things = Arena(1 << 12), [{"a": np.arange(400.0), "b": ("text", np.zeros((0, 3)))} for _ in range(2)]
    for thing, stays in zip(things, (True, False), strict=True):
        parcel = arena.put(thing)
        found = arena.take(parcel)
        assert np.array_equal(found["a"], thing["a"])
        assert found["b"][0] == "text"
        assert found["b"][1].shape == (0, 3)
        assert (len(parcel.pickled) < 400) == stays


def test_one_mesh_of_two_grains_has_the_rest_shapes_of_both(loaders: Loaders) -> None:
    changes = ["collision.pixel_mm=10", "garment.fabric=denim", "garment.shape.vertices_per_side=9"]
    several = [load_scene("sphere", [*changes, f"garment.grain_degrees={turn}"]) for turn in (0, 30)]
    mesh_cache = MeshCache()
    loaders.fill(mesh_cache, several)
    for scene in several:
        found, alone = load_outfit(scene, mesh_cache).garments[0].rest, load_outfit(scene).garments[0].rest
        assert np.array_equal(found.yarns.slope, alone.yarns.slope)
        assert np.array_equal(found.hinge_stiffness, alone.hinge_stiffness)
        assert found.topology is found.sheet.topology


@pytest.mark.parametrize("pin", [[], ["garment.pin={loop = 'top'}"]], ids=["free", "pinned"])
def test_the_same_panels_on_two_bodies_have_the_same_constants_computed_once(
    loaders: Loaders, monkeypatch: pytest.MonkeyPatch, pin: list[str]
) -> None:
    several = [
        load_scene(
            "tshirt", ["garment.shape.edge_mm=45", f"garment.fabric={fabric}", f"avatar.shape.chest={girth}", *pin]
        )
        for girth in (0.92, 1.0)
        for fabric in ("silk", "jersey", "denim")
    ]
    mesh_cache, cache = MeshCache(), Cache()
    loaders.fill(mesh_cache, several, cache)
    garments = [load_outfit(scene, mesh_cache).garments[0] for scene in several]
    for scene, garment in zip(several, garments, strict=True):
        own = load_outfit(scene).garments[0]
        assert np.array_equal(garment.points, own.points)
        assert np.array_equal(garment.pins, own.pins)
        assert np.array_equal(garment.rest.hinge_stiffness, own.rest.hinge_stiffness)
        assert garment.rest.fabric == own.rest.fabric
        assert garment.rest.notes == own.rest.notes
    for one, other in zip(garments[:3], garments[3:], strict=True):
        assert one.points is not other.points
        assert (one.rest.hinge_stiffness is other.rest.hinge_stiffness) == (not pin)
    monkeypatch.setattr(cutting, "SMALLEST", SINGLE.vertices)
    monkeypatch.setattr(cutting, "_garment_tables", forbidden)
    build_model(
        garments, device="cpu", precision="mixed", gathers=True, garment_counts=[1] * len(garments), cache=cache
    )


def test_loaders_cut_the_patches_that_a_large_model_needs(loaders: Loaders, monkeypatch: pytest.MonkeyPatch) -> None:
    several, mesh_cache, cache = scenes(), MeshCache(), Cache()
    loaders.fill(mesh_cache, several, cache)
    garments = [load_outfit(scene, mesh_cache).garments[0] for scene in several]
    monkeypatch.setattr(cutting, "SMALLEST", SINGLE.vertices)  # as if there were thousands of garments
    monkeypatch.setattr(cutting, "_garment_tables", forbidden)
    model = build_model(
        garments, device="cpu", precision="mixed", gathers=True, garment_counts=[1] * len(garments), cache=cache
    )
    assert model.patches is not None


def test_what_loaders_cannot_load_is_reported_in_its_place(loaders: Loaders) -> None:
    load_cache = LoadCache(0)
    load_cache.loaders = loaders
    several = [*scenes(), load_scene("hanging", ["garment.mesh=none.obj"])]
    *good, bad = fit_many(several, "cpu", load_cache=load_cache)
    assert all(isinstance(fit, Fit) for fit in good)
    assert isinstance(bad, InputError)


def test_without_its_loaders_a_worker_loads_by_itself(loaders: Loaders) -> None:
    mesh_cache = MeshCache()
    loaders.fill(mesh_cache, scenes())
    for process in loaders._pool._processes.values():
        os.kill(process.pid, signal.SIGKILL)
    more = load_scene("sphere", ["garment.shape.vertices_per_side=30"])
    loaders.fill(mesh_cache, [more])
    assert load_outfit(more, mesh_cache).meshes[0].vertex_count == 900


@pytest.mark.parametrize("fabric", ["jersey", "silk"])
def test_kernels_that_are_warmed_up_are_those_of_the_batch(fabric: str) -> None:
    scene = load_scene("tshirt", [f"garment.fabric={fabric}", "garment.shape.edge_mm=40", "collision.cloth=false"])
    small = warm_kernels._small(scene)
    garments = [load_outfit(small).garments[0]] * warm_kernels.MANY
    model = build_model(garments, device="cpu", precision="mixed", gathers=True, garment_counts=[1] * warm_kernels.MANY)
    assert problem_kind(small, load_outfit(small)) == problem_kind(scene, load_outfit(scene))
    assert not model.patches.few
    assert model.item_count > 1
