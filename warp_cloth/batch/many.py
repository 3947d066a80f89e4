"""Fits many scenes on one device: loaded once where they share, relaxed together, in groups that fit its memory."""

from __future__ import annotations

import collections
import gc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import warp as wp

from warp_cloth.base.cache import Cache
from warp_cloth.base.clock import StageClock
from warp_cloth.base.device import device_named
from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import one_thread_at_a_time
from warp_cloth.batch.gpu_queue import GpuLease
from warp_cloth.batch.loading import LoadCache
from warp_cloth.batch.memory import MemoryNeed, available_bytes, grouped_by_avatar, memory_need, split_to_fit
from warp_cloth.batch.warm_kernels import load_kernels
from warp_cloth.fitting.attempts import Run, dressed_after, finished_runs, relax_alone, relax_problem, tried_further
from warp_cloth.fitting.finish import finish_fits
from warp_cloth.fitting.fit import Fit
from warp_cloth.fitting.measured_maps import with_maps
from warp_cloth.fitting.placement import measure_starts
from warp_cloth.fitting.predrape import build_predrape, prepare_start, start_predraped
from warp_cloth.fitting.problem import Problem, build_problem, problem_kind
from warp_cloth.garment.outfit import MeshCache, Outfit, load_outfit
from warp_cloth.maps import MAPS, chosen_maps
from warp_cloth.model.plan import contact_kind
from warp_cloth.model.result import LevelRun
from warp_cloth.scene import Scene, load_scene

CACHE_FRACTION = 0.05  # of the memory, for avatars' fields that later scenes may use, too


@one_thread_at_a_time
def fit_many(
    scenes: Sequence[Scene | str | Path | Mapping[str, Any]],
    device: str | None = None,
    *,
    budget: int | None = None,
    together: int | None = None,
    maps: str | Sequence[str] = (),
    load_cache: LoadCache | None = None,
    lease: Path | None = None,
) -> list[Fit | Exception]:
    """Fits scenes on one device; for a scene that cannot be fitted, the list holds the exception.

    Every fit has the same bits as alone.

    Args:
        scenes: loaded scenes, or what ``load_scene`` takes, in any mixture.
        device: "cpu", "cuda" or "cuda:N"; None: a GPU if there is one.
        budget: device memory to use [bytes]; None: most of what is free.
        together: scenes that relax together at most; None: on a GPU as many as fit, on the CPU one at a time, as a
            launch there is a loop and a garment alone stays in the cache.
        maps: fit maps to compute, of every scene those that it can have.
        load_cache: what earlier calls have loaded, and the processes that load for this one.
        lease: a lock file by which processes that share the device relax one after another; None: there are no others.

    Raises:
        InputError: there is no such device or map.
    """
    map_names = chosen_maps(maps)
    if not isinstance(scenes, Sequence) or isinstance(scenes, str):
        raise InputError("scenes", f"must be a list of scenes, not of type {type(scenes).__name__}", "give a list")
    name = device_named(device)
    gpu = wp.get_device(name).is_cuda
    limit = available_bytes(name) if budget is None else budget
    mesh_cache, cache = (MeshCache(), Cache()) if load_cache is None else (load_cache.mesh_cache, load_cache.cache)
    cache.limit = int(CACHE_FRACTION * limit)
    limit -= cache.limit
    results: dict[int, Fit | Exception] = {}
    chosen: dict[int, Scene] = {}
    for number, source in enumerate(scenes):
        try:
            chosen[number] = source if isinstance(source, Scene) else load_scene(source)
        except Exception as error:
            results[number] = error
    if load_cache is not None:
        _load_in_parallel(load_cache, list(chosen.values()), name, gpu)
    loaded: dict[int, Outfit] = {}
    kinds: collections.defaultdict[tuple[Any, ...], list[int]] = collections.defaultdict(list)
    for number, scene in chosen.items():
        try:
            loaded[number] = load_outfit(scene, mesh_cache)
            kinds[problem_kind(scene, loaded[number])].append(number)
        except Exception as error:
            results[number] = error

    def run(numbers: Sequence[int]) -> list[Fit]:
        some, outfits = [chosen[n] for n in numbers], [loaded[n] for n in numbers]
        copies = 0 if load_cache is None else load_cache.spare_cores
        return _fit_together(some, outfits, name, cache, GpuLease(lease), copies, map_names)

    for numbers in kinds.values():
        needs = _memory_needs([chosen[n] for n in numbers], [loaded[n] for n in numbers], gpu)
        order = grouped_by_avatar(needs)
        for group in split_to_fit([needs[at] for at in order], limit, together or (len(scenes) if gpu else 1)):
            _run_or_halve([numbers[order[at]] for at in group], run, results)
    return [results[number] for number in range(len(scenes))]


def _load_in_parallel(load_cache: LoadCache, scenes: Sequence[Scene], device: str, gpu: bool) -> None:
    """Has loader processes fill the caches, while this process warms up a GPU's kernels."""
    warm_up = partial(load_kernels, scenes[0], device) if gpu and load_cache.fresh and scenes else lambda: None
    cache = load_cache.cache if gpu else None
    load_cache.loaders.fill(load_cache.mesh_cache, scenes, cache, warm_up, load_cache.idle_work)
    if not gc.isenabled():  # a worker that starts: what it has imported and loaded stays
        gc.freeze()
        gc.enable()
    load_cache.fresh = False


def _memory_needs(scenes: Sequence[Scene], outfits: Sequence[Outfit], gpu: bool) -> list[MemoryNeed]:
    """Memory of scenes, computed once for those of the same garments on the same avatar, in whatever fabric."""
    cache = Cache()

    def need(scene: Scene, outfit: Outfit) -> MemoryNeed:
        sources = outfit.avatar, *(of for garment in outfit.garments for of in (garment.points, garment.rest.topology))
        make = partial(memory_need, scene, outfit, gathers=gpu)
        return cache.get_or_make(
            "need", sources, make, contact_kind(scene, outfit), scene.collision, scene.solver.precision
        )

    return [need(scene, outfit) for scene, outfit in zip(scenes, outfits, strict=True)]


def _run_or_halve(
    numbers: Sequence[int], run: Callable[[Sequence[int]], list[Fit]], results: dict[int, Fit | Exception]
) -> None:
    """Runs scenes together; where that fails, for lack of memory or because of one scene, each half by itself."""
    try:
        results.update(zip(numbers, run(numbers), strict=True))
    except Exception as error:
        if len(numbers) == 1:
            results[numbers[0]] = error.with_traceback(None)  # a traceback would keep the memory alive
            return
    else:
        return
    middle = len(numbers) // 2
    _run_or_halve(numbers[:middle], run, results)
    _run_or_halve(numbers[middle:], run, results)


def _fit_together(
    scenes: Sequence[Scene],
    outfits: Sequence[Outfit],
    device: str,
    cache: Cache,
    lease: GpuLease,
    copies: int = 0,
    map_names: Sequence[str] = (),
) -> list[Fit]:
    """Relaxes scenes of one kind together, and measures them in so many copies of this process."""
    clock = StageClock()
    problem = build_problem(scenes, outfits, device, cache=cache, clock=clock)
    # without the lease: a few garments leave a GPU idle most of the time, for the process that has it
    levels = _started(problem, cache, clock)
    for item in range(len(scenes)):
        if not lease.taken():
            break
        problem.contact_report(item)  # measures what the report says of its contact, while there is time
    with lease:
        outcomes = relax_problem(problem, lease.release_early)
    clock.lap("relax")
    measure_starts((*problem.loaded, *problem.outfits))
    firsts = finished_runs(problem, outcomes, levels, copies=copies)
    clock.lap("measure")
    begin = partial(prepare_start, cache=cache, clock=clock)
    seconds = _dressed_together(firsts, device, cache, clock, copies)
    courses = [
        tried_further(first, begin, relax_alone, cache=cache, clock=clock, second=seconds.get(item))
        for item, first in enumerate(firsts)
    ]
    results = finish_fits(courses, clock=clock, copies=copies)
    for item, course in enumerate(courses):
        possible = [name for name in map_names if scenes[item].avatar is not None or not MAPS[name].needs_avatar]
        if possible:
            run = course.best
            results[item] = with_maps(results[item], possible, run.problem, run.item)
    return [Fit.of(result) for result in results]


def _started(problem: Problem, cache: Cache, clock: StageClock) -> Sequence[tuple[LevelRun, ...]]:
    """Brings a problem's garments to where they start; returns the relaxations of each item that this took."""
    predrape = build_predrape(problem, cache, clock)
    clock.lap("build")
    if predrape is None:
        levels: Sequence[tuple[LevelRun, ...]] = [prepare_start(problem, cache, clock)] * len(problem.attempts)
    else:
        levels = start_predraped(problem, predrape)
    clock.lap("dress")
    return levels


def _dressed_together(
    firsts: Sequence[Run], device: str, cache: Cache, clock: StageClock, copies: int
) -> dict[int, Run]:
    """The second trials of those items, by their numbers, that are tried so: relaxed together, as the first were."""
    wanted = {item: found for item, run in enumerate(firsts) if (found := dressed_after(run, cache)) is not None}
    if len(wanted) < 2:
        return {}
    attempts, outfits = zip(*wanted.values(), strict=True)
    problem = build_problem(attempts, outfits, device, cache=cache, clock=clock)
    levels = _started(problem, cache, clock)
    outcomes = relax_problem(problem)
    clock.lap("relax")
    runs = finished_runs(problem, outcomes, levels, copies=copies)
    clock.lap("measure")
    return dict(zip(wanted, runs, strict=True))
