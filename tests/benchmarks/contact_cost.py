"""What cloth on cloth costs a fit: T-shirts, one or several over each other, with and without contact.

    python tests/benchmarks/contact_cost.py --device cuda:0 L7.8:jersey shared1:jersey,shared1.1:denim

A garment is a size, the length of its edges [mm] and a fabric, or the shared T-shirt, so many times as large, and a
fabric; those of a scene go inner to outer. A fit with contact runs to rest, and one whose cloth passes through itself
as many iterations: the difference is what contact costs, the latter is everything else. Both are told by the clock,
from the first iteration to the last check, with and without the time in which graphs were captured, and by the device:
of iterations only, between events. Then come the phases of the way, what each launch takes when it is timed by itself
(which adds some microseconds to each), and whether anything crosses at rest.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp
from wearing import BODIES, SHARED_SHIRT, Tree, shirt

from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Points
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.contact.crossing import find_crossings
from warp_cloth.fitting.problem import Problem, build_problem, collider_updates, limit_of, tolerance_of
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.scene import Scene, load_scene
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items

NEVER = Tolerance(0.0, 0.0, 0.0)
PHASES = ("sewing", "untangling", "falling", "worn")  # asleep, till nothing crosses, till forces balance, from then on
SHOWN = 12  # kernels of a phase


@dataclass
class Spent:
    """Of a fit, or of a phase."""

    iterations: int = 0
    seconds: float = 0.0  # by the device
    kernels: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))  # seconds of each launch


@dataclass
class Ended:
    """How a fit ended, and what it took."""

    iterations: int
    seconds: float  # by the clock
    captured: float  # of these, until graphs were captured and launched for the first time
    status: str
    points: Points
    phases: dict[str, Spent]

    @property
    def on_device(self) -> float:
        """Seconds of its iterations by the device."""
        return sum(spent.seconds for spent in self.phases.values())


def scene_of(garments: str, iterations: int) -> Scene:
    """The scene of garments as the command line has them."""
    worn: list[Tree] = []
    for number, garment in enumerate(garments.split(",")):
        found = re.fullmatch(r"([SML]|shared)([0-9.]+):(\w+)", garment)
        if found is None:
            raise SystemExit(f"{garment!r}: write a garment as L7.8:jersey or shared1.1:denim")
        of, size, fabric = found.groups()
        if of == "shared":
            worn.append({**SHARED_SHIRT, "name": f"shirt {number}", "fabric": fabric, "uv_units": float(size)})
        else:
            worn.append(shirt(of, float(size), fabric))
    shared = any("mesh" in garment for garment in worn)
    return load_scene(
        {
            "garment": worn,
            "avatar": BODIES["mean_all"] if shared else {"shape": {"kind": "mannequin"}},
            "collision": {"cloth": True},
            "solver": {"iterations": iterations},
        }
    )


class Fits:
    """Fits of one scene; what they share is worked out once."""

    def __init__(self, garments: str, device: str, iterations: int) -> None:
        self.scene = scene_of(garments, iterations)
        self._device, self._cache = device, Cache()
        self._outfit: Outfit = load_outfit(self.scene)

    def made(self, *, contact: bool) -> Problem:
        """The scene, ready to relax; ``contact``: of cloth with cloth."""
        scene = self.scene.model_copy(update={"collision": self.scene.collision.model_copy(update={"cloth": contact})})
        return build_problem([scene], [self._outfit], self._device, cache=self._cache)

    def rest(self, made: Problem, iterations: int | None = None, *, by_kernel: bool = False) -> Ended:
        """Lets it come to rest, or runs so many iterations."""
        watch = Watch(made, by_kernel=by_kernel)
        tolerance = tolerance_of(self.scene) if iterations is None else NEVER
        limit = iterations or limit_of(self.scene)
        wp.synchronize_device(self._device)
        began = time.perf_counter()
        (out,) = relax_items(
            made.certifier,
            [Goal(tolerance, limit)],
            follow=collider_updates(made),
            schedule=made.schedule,
        )
        wp.synchronize_device(self._device)
        seconds = time.perf_counter() - began
        return Ended(out.iterations, seconds, watch.captured, out.status.value, out.points, watch.phases())


class Watch:
    """Sees a relaxation's bursts: in which phase each is, and what it takes the device, or what its launches do."""

    def __init__(self, made: Problem, *, by_kernel: bool) -> None:
        self._made, self._run = made, made.relaxation.run
        self._device = wp.get_device(made.model.device)
        self.captured = 0.0  # seconds in which graphs were captured, and launched for the first time
        self._launched_before: list[Any] = []
        self._bursts: list[tuple[str, int, Callable[[], float]]] = []
        self._kernels: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
        made.relaxation.run = self._launched if by_kernel else self._timed  # type: ignore[method-assign]

    def _phase(self) -> str:
        cloth_contact = self._made.relaxation.cloth_contact
        if cloth_contact is None or not cloth_contact.awake:
            return PHASES[0] if cloth_contact is not None else PHASES[3]
        return PHASES[1] if cloth_contact.untangles else PHASES[3] if cloth_contact.settled else PHASES[2]

    def _timed(self, iterations: int, **how: bool) -> None:
        if not self._device.is_cuda:
            began = time.perf_counter()
            self._run(iterations, **how)
            seconds = time.perf_counter() - began
            self._bursts.append((self._phase(), iterations, lambda: seconds))
            return
        began = time.perf_counter()
        graph = self._made.relaxation.capture(iterations, **how)
        known = any(graph is other for other in self._launched_before)
        begin, end = (wp.Event(self._device, enable_timing=True) for _ in range(2))
        wp.record_event(begin)
        self._run(iterations, **how)
        wp.record_event(end)
        if not known:
            self._launched_before.append(graph)
            self.captured += time.perf_counter() - began
        self._bursts.append((self._phase(), iterations, lambda: 1e-3 * wp.get_event_elapsed_time(begin, end)))

    def _launched(self, iterations: int, **_: bool) -> None:
        wp.timing_begin(cuda_filter=wp.TIMING_KERNEL)
        self._made.relaxation.iterate(iterations)
        results: list[Any] = wp.timing_end()
        of_phase = self._kernels[self._phase()]
        for result in results:
            name = re.sub(r"^forward kernel |_[0-9a-f]{8}(_.*)?$", "", result.name)
            of_phase[name].append(1e-3 * result.elapsed)
        total = 1e-3 * sum(result.elapsed for result in results)
        self._bursts.append((self._phase(), iterations, lambda: total))

    def phases(self) -> dict[str, Spent]:
        """What the bursts took, by phase."""
        found: dict[str, Spent] = {}
        for phase, iterations, seconds in self._bursts:
            spent = found.setdefault(phase, Spent())
            spent.iterations += iterations
            spent.seconds += seconds()
        for phase, kernels in self._kernels.items():
            found[phase].kernels = kernels
        return found


def tell(garments: str, fits: Fits, rounds: int, *, by_kernel: bool) -> None:
    """Prints what a scene costs."""
    ways = [fits.rest(fits.made(contact=True)) for _ in range(rounds)]
    one = ways[0]
    bare = [fits.rest(fits.made(contact=False), one.iterations) for _ in range(rounds)]
    made = fits.made(contact=True)
    crossing = len(find_crossings(one.points, made.relaxation.cloth_contact.sheets, "cpu").pairs)  # type: ignore[union-attr]
    hashes = {hashlib.sha1(np.ascontiguousarray(way.points).tobytes()).hexdigest()[:10] for way in ways}
    print(f"{garments}: {made.model.vertex_count} vertices, {one.status} after {one.iterations} iterations,")
    print(f"  {crossing} pairs cross, hash {' '.join(sorted(hashes))}")
    for name, value in (
        ("clock", lambda way: way.seconds),
        ("clock, all captured", lambda way: way.seconds - way.captured),
        ("device", lambda way: way.on_device),
    ):
        with_it, without = (float(np.median([value(way) for way in some])) for some in (ways, bare))
        print(
            f"  by the {name}: {1e3 * with_it:.1f} ms, without contact {1e3 * without:.1f}: "
            f"contact costs {1e3 * (with_it - without):.1f}, {with_it / without - 1.0:.2f} times everything else"
        )
    for phase in PHASES:
        found = [way.phases[phase] for way in ways if phase in way.phases]
        if found:
            seconds, count = float(np.median([spent.seconds for spent in found])), found[0].iterations
            print(f"  {phase}: {count} iterations, {1e3 * seconds:.1f} ms, {1e6 * seconds / count:.1f} us each")
    print(f"  without: {1e6 * bare[0].on_device / bare[0].iterations:.1f} us each", flush=True)
    if not by_kernel:
        return
    for phase, spent in fits.rest(made, by_kernel=True).phases.items():
        print(f"  {phase}, launch by launch ({spent.iterations} iterations):")
        by_time = sorted(spent.kernels.items(), key=lambda item: -sum(item[1]))
        for name, seconds in by_time[:SHOWN]:
            print(
                f"    {name:30s} {len(seconds):6d} times, {1e6 * float(np.median(seconds)):7.1f} us in the median, "
                f"{1e3 * sum(seconds):7.1f} ms",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", help="garments of a scene, separated by commas, inner to outer")
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--rounds", type=int, default=3, help="fits of each kind, whose median is told")
    parser.add_argument("--iterations", type=int, default=20_000, help="the limit of a fit")
    parser.add_argument("--kernels", action="store_true", help="time launches, too")
    asked = parser.parse_args()
    start_warp()
    for garments in asked.scenes:
        fits = Fits(garments, asked.device, asked.iterations)
        tell(garments, fits, asked.rounds, by_kernel=asked.kernels)


if __name__ == "__main__":
    main()
