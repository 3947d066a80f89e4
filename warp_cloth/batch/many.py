"""Many scenes on one device: loaded once where they share, relaxed together, cut so that they fit its memory."""

from __future__ import annotations

import collections
import gc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import warp as wp

from warp_cloth.base.cache import Cache
from warp_cloth.base.device import device_named
from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import one_thread_at_a_time
from warp_cloth.batch.gpu_queue import Turn
from warp_cloth.batch.loading import Shelf
from warp_cloth.batch.memory import Need, available_bytes, cut_to_fit, need_of, side_by_side
from warp_cloth.batch.warm_kernels import load_kernels
from warp_cloth.fitting.clock import StageClock
from warp_cloth.fitting.finish import finish_fits
from warp_cloth.fitting.fit import Fit
from warp_cloth.fitting.predrape import build_predrape, start_predraped
from warp_cloth.fitting.problem import build_problem, collider_updates, problem_kind, start_coarse, tolerance_of
from warp_cloth.garment.outfit import MeshCache, Outfit, load_outfit
from warp_cloth.model.plan import contact_kind
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.loop import Goal, relax_items

KEPT_SHARE = 0.05  # of the memory, for avatars' fields that the next scenes may meet, too


@one_thread_at_a_time
def fit_many(
    scenes: Sequence[Scene | str | Path | Mapping[str, Any]],
    device: str | None = None,
    *,
    budget: int | None = None,
    together: int | None = None,
    shelf: Shelf | None = None,
    turn: Path | None = None,
) -> list[Fit | Exception]:
    """Fits scenes on one device; where one cannot be fitted, the reason stands in its place.

    Every fit has the bits that it has alone.

    Args:
        scenes: loaded scenes, or what ``load_scene`` takes, in any mixture.
        device: "cpu", "cuda" or "cuda:N"; None: a GPU if there is one.
        budget: memory [bytes] that may be used there; None: most of what is free.
        together: scenes that relax together at most; None: on a GPU as many as fit, on the CPU one at a time, as a
            launch there is a loop and a garment alone stays in the cache.
        shelf: what earlier batches have loaded, and who loads for this one.
        turn: a file by which processes on one device take turns to relax; None: there are no others.

    Raises:
        InputError: there is no such device.
    """
    if not isinstance(scenes, Sequence) or isinstance(scenes, str):
        raise InputError("scenes", f"must be a list of scenes, not of type {type(scenes).__name__}", "give a list")
    where = device_named(device)
    gpu = wp.get_device(where).is_cuda
    most = together or (len(scenes) if gpu else 1)
    limit = available_bytes(where) if budget is None else budget
    mesh_cache, cache = (MeshCache(), Cache()) if shelf is None else (shelf.mesh_cache, shelf.cache)
    cache.limit = int(KEPT_SHARE * limit)
    limit -= cache.limit
    results: dict[int, Fit | Exception] = {}
    chosen: dict[int, Scene] = {}
    for number, source in enumerate(scenes):
        try:
            chosen[number] = source if isinstance(source, Scene) else load_scene(source)
        except Exception as error:
            results[number] = error
    if shelf is not None:
        every = list(chosen.values())
        ahead = partial(load_kernels, every[0], where) if gpu and shelf.fresh and every else lambda: None
        shelf.loaders.fill(mesh_cache, every, cache if gpu else None, ahead, shelf.spare)
        if not gc.isenabled():  # as in a worker that begins: what it has imported and loaded stays
            gc.freeze()
            gc.enable()
        shelf.fresh = False
    loaded: dict[int, Outfit] = {}
    groups: collections.defaultdict[tuple[Any, ...], list[int]] = collections.defaultdict(list)
    for number, scene in chosen.items():
        try:
            loaded[number] = load_outfit(scene, mesh_cache)
            groups[problem_kind(scene, loaded[number])].append(number)
        except Exception as error:
            results[number] = error

    def run(numbers: Sequence[int]) -> list[Fit]:
        return _together([chosen[n] for n in numbers], [loaded[n] for n in numbers], where, cache, Turn(turn))

    for numbers in groups.values():
        needs = _needs([chosen[n] for n in numbers], [loaded[n] for n in numbers], gpu)
        order = side_by_side(needs)
        for piece in cut_to_fit([needs[at] for at in order], limit, most):
            _halving([numbers[order[at]] for at in piece], run, results)
    return [results[number] for number in range(len(scenes))]


def _needs(scenes: Sequence[Scene], outfits: Sequence[Outfit], gpu: bool) -> list[Need]:
    """What scenes need, worked out once for those of the same garments on the same avatar, in whatever fabric."""
    cache = Cache()

    def need(scene: Scene, outfit: Outfit) -> Need:
        alike = outfit.avatar, *(of for part in outfit.parts for of in (part.points, part.rest.topology))
        make = partial(need_of, scene, outfit, gathers=gpu)
        return cache.get_or_make(
            "need", alike, make, contact_kind(scene, outfit), scene.collision, scene.solver.precision
        )

    return [need(scene, outfit) for scene, outfit in zip(scenes, outfits, strict=True)]


def _halving(
    numbers: Sequence[int], run: Callable[[Sequence[int]], list[Fit]], results: dict[int, Fit | Exception]
) -> None:
    """Runs scenes together; where that fails, for lack of memory or by one that is bad, each half by itself."""
    try:
        results.update(zip(numbers, run(numbers), strict=True))
    except Exception as error:
        if len(numbers) == 1:
            results[numbers[0]] = error.with_traceback(None)  # which holds on to the memory
            return
    else:
        return
    middle = len(numbers) // 2
    _halving(numbers[:middle], run, results)
    _halving(numbers[middle:], run, results)


def _together(scenes: Sequence[Scene], outfits: Sequence[Outfit], device: str, cache: Cache, turn: Turn) -> list[Fit]:
    """Relaxes scenes of one kind together."""
    clock = StageClock()
    made = build_problem(scenes, outfits, device, cache=cache, clock=clock)
    dressing = build_predrape(made, cache)
    clock.lap("build")
    goals = [Goal(tolerance_of(scene), scene.solver.iterations) for scene in scenes]
    # a few garments leave a GPU idle most of the time, for those whose turn it is
    levels = [start_coarse(made)] * len(scenes) if dressing is None else start_predraped(made, dressing)
    for item in range(len(scenes)):
        if not turn.taken():
            break
        made.contact_report(item)  # measures what the report tells of its contact, for which there is time now
    with turn:
        outcomes = relax_items(
            made.relaxation,
            made.certifier,
            goals,
            follow=collider_updates(made),
            schedule=made.schedule,
            on_chunk=turn.offer,
        )
    clock.lap("relax")
    results = finish_fits(made, outcomes, levels=levels, clock=clock)
    return [Fit.of(result) for result in results]
