"""What an iteration costs: kernels, launches, bytes, memory and shares of time, all from the objects that run it."""

from __future__ import annotations

import inspect
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.collide.crossing import search_bytes
from warp_cloth.fitting import SetUp
from warp_cloth.solver.certificate import strain_bytes
from warp_cloth.solver.loop import CHUNK
from warp_cloth.study.caches import cache_bytes, spilled_bytes
from warp_cloth.study.launches import Launch, arrays_in, bytes_of, launches_of
from warp_cloth.study.sectors import moved_bytes
from warp_cloth.study.traffic import Uses, array_uses
from warp_cloth.wardrobe import Wardrobe

# Iterations that are watched: an even number, as every second one goes back to the first one's arrays where forces are
# gathered. Where cloth meets cloth enough of them to hold searches for what is near, which few iterations do.
WATCHED, WATCHED_TOUCHING = 20, 100
WARM_UP = 100  # iterations before the clock runs: cloth that has met the avatar costs more
WAKING = 12  # times as many where cloth meets cloth: that begins when the seams have closed
SHORTEST_RUN = 0.5  # [s] of timing
LONG = 5.0  # [s] that iterations take before the next chunk is left out
MOST_ROUNDS = 1000
LEAST = 0.02  # of what a launch was timed at, that it takes itself: less cannot be told apart from none


@dataclass(frozen=True)
class KernelCost:
    """One kernel's part of an iteration."""

    name: str
    purpose: str
    launches: float  # per iteration
    threads: int
    bytes: float  # to and from memory, per iteration, if no cache holds anything from one launch to the next
    asked: float  # bytes between the last cache and the cores, per iteration
    spilled: int  # bytes of a thread that registers do not hold
    seconds: float  # per iteration, each launch timed by itself


@dataclass(frozen=True)
class Footprint:
    """What one iteration launches, moves and takes, and the memory that stays."""

    device: str
    vertices: int
    kernels: tuple[KernelCost, ...]
    launches: float  # per iteration
    touched: int  # bytes of all that an iteration reads or writes
    cache: int  # bytes that the device's last cache holds; 0 where that is not known
    seconds: float  # of an iteration as a fit runs it, captured
    between: float  # of these, what is no kernel's: looks whether a search is due
    memory: dict[str, int]  # [bytes] by what it is for

    @property
    def from_memory(self) -> bool:
        """Whether an iteration touches more than the cache holds, so that it comes from memory again and again."""
        return self.touched > self.cache

    @property
    def bytes(self) -> float:
        """Of an iteration, at the level that matters: to and from memory, or between the cache and the cores."""
        return sum(self.moved(kernel) for kernel in self.kernels)

    def moved(self, kernel: KernelCost) -> float:
        """A kernel's part of these bytes."""
        return kernel.bytes if self.from_memory else kernel.asked

    def share(self, kernel: KernelCost) -> float:
        """A kernel's share of the time, from its start to the next one's."""
        return kernel.seconds / max(self.between + sum(other.seconds for other in self.kernels), 1e-30)


def footprint_of(made: SetUp) -> Footprint:
    """Watches some iterations, then times them. The cloth moves on by some hundreds of iterations."""
    relaxation, model = made.relaxation, made.model
    chunk = _seconds_of_iteration(made)
    watched = WATCHED if made.course is None else WATCHED_TOUCHING
    launches = launches_of(lambda: relaxation.iterate(watched))
    whole = chunk * watched
    if wp.get_device(model.device).is_cuda:
        whole = min(_seconds_captured(launches, model.device, watched), whole)
    seconds = _seconds_of_launches(launches, model.device, whole)
    uses = {launch.kernel.key: array_uses(launch.kernel) for launch in launches}
    touched = [array for launch in launches for array in _used(launch, uses[launch.kernel.key])]
    kernels = []
    for key in uses:
        own = [(launch, spent) for launch, spent in zip(launches, seconds, strict=True) if launch.kernel.key == key]
        memory, cache = moved_bytes(own[0][0], uses[key])
        kernels.append(
            KernelCost(
                name=key.rpartition("__")[2],
                purpose=(inspect.getdoc(own[0][0].kernel.func) or "").partition("\n")[0],
                launches=len(own) / watched,
                threads=own[0][0].threads,
                bytes=memory * len(own) / watched,
                asked=cache * len(own) / watched,
                spilled=spilled_bytes(own[0][0].command, model.device),
                seconds=sum(spent for _, spent in own) / watched,
            )
        )
    return Footprint(
        device=model.device,
        vertices=model.vertex_count,
        kernels=tuple(kernels),
        launches=len(launches) / watched,
        touched=bytes_of(touched),
        cache=cache_bytes(model.device),
        seconds=chunk,
        between=chunk - whole / watched,
        memory=_memory(made),
    )


def iteration_bytes(launches: Sequence[Launch]) -> int:
    """Bytes that launches must read and write at least once, each launch by itself."""
    kernels = {launch.kernel: launch for launch in launches}
    once = {kernel: moved_bytes(launch, array_uses(kernel))[0] for kernel, launch in kernels.items()}
    return sum(once[launch.kernel] for launch in launches)


def _used(launch: Launch, uses: Uses) -> list[wp.array]:
    """The arrays that a launch reads or writes; tables that are looked up by place left out."""
    return [array for name, array in launch.arrays().items() if name in uses.read | uses.written and array.ndim == 1]


def _memory(made: SetUp) -> dict[str, int]:
    """Bytes of the arrays that a scene holds on its device: of the avatar, of the cloth, more for the checks.

    The report's are taken at the end, besides the others; shapes on the way are as many as can be.
    """
    avatar = arrays_in(made.contacts)
    cloth = arrays_in([getattr(made, part.name) for part in fields(made) if part.name != "certifier"])
    whole = bytes_of(arrays_in(made))
    now, most = made.certifier.kept_bytes
    return {
        "cloth": bytes_of(cloth) - bytes_of(avatar),
        "avatar": bytes_of(avatar),
        "checks": whole - bytes_of(cloth) - now + most,
        "report": max(strain_bytes(made.model), *(_crossing_bytes(wardrobe) for wardrobe in made.wardrobes)),
    }


def _crossing_bytes(wardrobe: Wardrobe) -> int:
    parts = wardrobe.parts
    sizes = [(len(part.points), len(part.rest.topology.edges), len(part.triangles)) for part in parts]
    return search_bytes(*(sum(column) for column in zip(*sizes, strict=True)))


def _seconds_of_iteration(made: SetUp) -> float:
    """Seconds of an iteration, run in the chunks in which a fit runs them."""
    for count in range(WAKING if made.course is not None else 1):
        _iterate(made)
        if made.course is not None:
            made.course.advance((count + 1) * WARM_UP, made.model.points())
    done, began = 0, time.perf_counter()
    while time.perf_counter() - began < SHORTEST_RUN and done < MOST_ROUNDS * WARM_UP:
        done += _iterate(made)
    return (time.perf_counter() - began) / done


def _iterate(made: SetUp) -> int:
    """Runs as many iterations as lie between two checks of a fit, or fewer where they take long; tells how many."""
    done, began = 0, time.perf_counter()
    while done < WARM_UP and time.perf_counter() - began <= LONG:
        made.relaxation.run(CHUNK)
        done += CHUNK
    wp.synchronize_device(made.model.device)
    return done


def _seconds_of_launches(launches: Sequence[Launch], device: str, whole: float) -> list[float]:
    """Seconds of each launch, in the order and with the data of the loop: the mean of many rounds.

    A clock round every launch, and launching from here, add the same to each: what all of them take beyond ``whole``,
    their time captured.
    """
    timed = _cuda_seconds(launches, device) if wp.get_device(device).is_cuda else _host_seconds(launches)
    added = max(sum(timed) - whole, 0.0) / len(timed)
    return [max(spent - added, LEAST * spent) for spent in timed]


def _seconds_captured(launches: Sequence[Launch], device: str, watched: int) -> float:
    """Seconds of the launches of so many iterations, captured, waited for as seldom as ``_iterate`` waits."""
    with wp.ScopedCapture(device=device) as capture:
        for launch in launches:
            launch.command.launch()
    spent: list[float] = []
    while len(spent) < 2 or (sum(spent) < SHORTEST_RUN / 5 and len(spent) < MOST_ROUNDS):
        wp.synchronize_device(device)
        began = time.perf_counter()
        for _ in range(WARM_UP // watched):
            wp.capture_launch(capture.graph)
        wp.synchronize_device(device)
        spent.append(time.perf_counter() - began)
    return float(np.median(spent)) * watched / WARM_UP


def _host_seconds(launches: Sequence[Launch]) -> list[float]:
    totals = [0.0] * len(launches)
    rounds, began = 0, time.perf_counter()
    while rounds < MOST_ROUNDS and (rounds == 0 or time.perf_counter() - began < SHORTEST_RUN):
        for index, launch in enumerate(launches):
            start = time.perf_counter()
            launch.command.launch()
            totals[index] += time.perf_counter() - start
        rounds += 1
    return [total / rounds for total in totals]


def _cuda_seconds(launches: Sequence[Launch], device: str) -> list[float]:
    rounds = 50
    with wp.ScopedDevice(device):
        wp.timing_begin(cuda_filter=wp.TIMING_KERNEL)
        for _ in range(rounds):
            for launch in launches:
                launch.command.launch()
        results: list[Any] = wp.timing_end()
    return [
        1e-3 * sum(result.elapsed for result in results[index :: len(launches)]) / rounds
        for index in range(len(launches))
    ]
