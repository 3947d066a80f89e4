"""What an iteration costs: kernels, launches, bytes, memory and shares of time, all from the objects that run it."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from statistics import mean

import numpy as np
import warp as wp

from warp_cloth.contact.crossing import search_bytes
from warp_cloth.fitting.fit import Problem
from warp_cloth.garment.scene_garments import Wardrobe
from warp_cloth.solver.certificate.strains import strain_bytes
from warp_cloth.study.caches import cache_bytes, spilled_bytes
from warp_cloth.study.launches import Launch, arrays_in, bytes_of, launches_of
from warp_cloth.study.pressed import presses
from warp_cloth.study.sectors import moved_bytes
from warp_cloth.study.timing import Times, times_of
from warp_cloth.study.traffic import Uses, array_uses

Bytes = tuple[float, float]  # to and from memory, and between the last cache and the cores
LOOK = "search_if_due"  # what no kernel of ours does: a branch in the captured graph


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
    seconds: float  # per iteration, from its start to the next one's


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
    threads: int  # of the host that share it
    iterations: tuple[int, int]  # between which that was timed
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
        """A kernel's share of the time."""
        return kernel.seconds / max(sum(other.seconds for other in self.kernels), 1e-30)


def footprint_of(made: Problem) -> Footprint:
    """Watches and times some hundreds or thousands of iterations from the start; the cloth has moved on then."""
    model, moved = made.model, Moved(made)
    times = times_of(made, moved.see)
    launches = {launch.kernel.key: launch for launch in times.launches}
    touched = [array for launch in times.launches for array in _used(launch, moved.uses(launch))]
    counted = moved.of(launches.values(), times.end)
    kernels = [_cost(launch, counted[key], times) for key, launch in launches.items()]
    if times.look:
        purpose = "Decides whether cloth near cloth is to be looked for anew."
        kernels.append(KernelCost(LOOK, purpose, times.looks, 1, 0.0, 0.0, 0, times.look))
    return Footprint(
        device=model.device,
        vertices=model.vertex_count,
        kernels=tuple(kernels),
        launches=sum(kernel.launches for kernel in kernels),
        touched=bytes_of(touched),
        cache=cache_bytes(model.device),
        seconds=times.seconds,
        threads=made.relaxation.thread_count,
        iterations=(times.begin, times.end),
        memory=memory_of(made),
    )


class Moved:
    """What launches move, on the way and at its end.

    Which pairs of cloth are pressed changes on the way, and what a search lists the next look for crossings puts
    others in place of: pressing is counted several times, and a search while it goes on.
    """

    def __init__(self, made: Problem) -> None:
        self._touch = made.relaxation.touch
        self._uses: dict[str, Uses] = {}
        self._seen: dict[str, list[tuple[int, Bytes]]] = {}  # after how many iterations

    def uses(self, launch: Launch) -> Uses:
        """What a launch's kernel uses."""
        key = launch.kernel.key
        if key not in self._uses:
            self._uses[key] = array_uses(launch.kernel)
        return self._uses[key]

    def see(self, launches: Sequence[Launch], iteration: int) -> None:
        """Counts what is pressed, by the last of some launches, after so many iterations."""
        pressing = {launch.kernel.key: launch for launch in launches if presses(self.uses(launch))}
        for launch in pressing.values():
            self._count(launch, iteration)

    def of(self, launches: Iterable[Launch], iteration: int) -> dict[str, Bytes]:
        """Bytes of each kernel, the mean over the iterations, to and from memory and beyond the cores.

        ``launches``: the last ones, after so many iterations.
        """
        last, touch = {launch.kernel.key: launch for launch in launches}, self._touch
        if touch is not None and touch.awake:
            self.see(list(last.values()), iteration)
            cloth = touch.cloth_now()
            if touch.untangles:  # the first search after a look at crossings looks everywhere; most others do not
                touch.search(cloth)
            launches_of(lambda: touch.search(cloth), see=lambda launch: self._count(launch, iteration))
        for key, launch in last.items():
            if key not in self._seen:
                self._count(launch, iteration)
        return {key: (_mean_of(seen, 0), _mean_of(seen, 1)) for key, seen in self._seen.items()}

    def _count(self, launch: Launch, iteration: int) -> None:
        self._seen.setdefault(launch.kernel.key, []).append((iteration, moved_bytes(launch, self.uses(launch))))


def _mean_of(seen: Sequence[tuple[int, Bytes]], which: int) -> float:
    """The mean over iterations of what was counted after some, one of the two, as if it changed evenly between them."""
    iterations, counted = [at for at, _ in seen], [moved[which] for _, moved in seen]
    if iterations[-1] == iterations[0]:
        return mean(counted)
    return float(np.trapezoid(counted, iterations)) / (iterations[-1] - iterations[0])


def _cost(launch: Launch, moved: Bytes, times: Times) -> KernelCost:
    key = launch.kernel.key
    often = times.count[key]
    return KernelCost(
        name=key.rpartition("__")[2],
        purpose=(inspect.getdoc(launch.kernel.func) or "").partition("\n")[0],
        launches=often,
        threads=launch.threads,
        bytes=moved[0] * often,
        asked=moved[1] * often,
        spilled=spilled_bytes(launch.command, launch.command.device.alias),
        seconds=times.spent[key],
    )


def iteration_bytes(launches: Sequence[Launch]) -> int:
    """Bytes that launches must read and write at least once, each launch by itself."""
    kernels = {launch.kernel: launch for launch in launches}
    once = {kernel: moved_bytes(launch, array_uses(kernel))[0] for kernel, launch in kernels.items()}
    return sum(once[launch.kernel] for launch in launches)


def _used(launch: Launch, uses: Uses) -> list[wp.array]:
    """The arrays that a launch reads or writes; tables that are looked up by place left out."""
    return [array for name, array in launch.arrays().items() if name in uses.read | uses.written and array.ndim == 1]


def memory_of(made: Problem) -> dict[str, int]:
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
