"""Profile of a shard of a batch on a GPU: time of every kernel and copy, stage by stage.

    python tests/benchmarks/shard_profile.py --items 256 --device cuda:0

The items are the first ones of batch_rate.py, with dressed starts, fitted together in this process by
``warp_cloth.batch.fit_many``, twice: with all that a fresh process does, and with what the first time has left.
Kernels in captured graphs are seen by CUDA's own profiler, through PyTorch, which must be installed.
Relaxing is shown in parts: to 500 iterations, to the last twentieth and fiftieth of the vertices, and to the end.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import os
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import batch_rate
import warp as wp

SHOWN = 0.005  # of a stage's time; what takes less is left out
PARTS: tuple[tuple[str, Callable[[int, float], bool]], ...] = (
    ("to 500 iterations", lambda iteration, _: iteration >= 500),
    ("to 5 % of the vertices", lambda _, share: share < 0.05),
    ("to 2 % of the vertices", lambda _, share: share < 0.02),
    ("to the end", lambda *_: False),
)


class Stage:
    """A stage in progress; printed at its end."""

    def __init__(self, name: str) -> None:
        from torch.profiler import ProfilerActivity, profile

        wp.synchronize()
        self._name, self._profile = name, profile(activities=[ProfilerActivity.CUDA])
        self._profile.__enter__()
        self._began = time.perf_counter()

    def end(self) -> None:
        wp.synchronize()
        seconds = time.perf_counter() - self._began
        self._profile.__exit__(None, None, None)
        took, times = Counter[str](), Counter[str]()
        for event in self._profile.profiler.kineto_results.events():
            if "CUDA" in str(event.device_type()):
                took[event.name()[:60]] += event.duration_ns()
                times[event.name()[:60]] += 1
        kernels = sum(span for name, span in took.items() if not name.startswith("Mem"))
        whole = sum(took.values())
        print(
            f"{self._name}: {1e3 * seconds:.0f} ms, kernels {1e-6 * kernels:.1f}, copies {1e-6 * (whole - kernels):.1f}"
        )
        for name, span in took.most_common():
            if span > SHOWN * whole:
                print(
                    f"  {1e-6 * span:8.2f} ms {times[name]:6d} x {1e-3 * span / times[name]:7.1f} us  {name}",
                    flush=True,
                )


def watched(owner: Any, name: str) -> None:
    """Profiles a function as a stage."""
    work = getattr(owner, name)

    @functools.wraps(work)
    def staged(*arguments: Any, **named: Any) -> Any:
        stage = Stage(name)
        try:
            return work(*arguments, **named)
        finally:
            stage.end()

    setattr(owner, name, staged)


def watch_relaxing(owner: Any) -> None:
    """Profiles the parts of relaxing as stages."""
    relax = owner.relax_problem

    def staged(problem: Any, release: Callable[[int, Any], None]) -> Any:
        parts = iter(PARTS)
        name, ends = next(parts)
        stage = Stage(f"relaxing {name}")

        def on_burst(iteration: int, relaxation: Any) -> None:
            nonlocal stage, ends
            release(iteration, relaxation)
            if ends(iteration, relaxation.active_fraction):
                stage.end()
                name, ends = next(parts)
                stage = Stage(f"relaxing from {iteration:,} iterations {name}")

        outcomes = relax(problem, on_burst)
        stage.end()
        shapes = hashlib.sha256(b"".join(outcome.points.tobytes() for outcome in outcomes)).hexdigest()[:12]
        print(f"{sum(outcome.iterations for outcome in outcomes)} iterations, shapes {shapes}")
        return outcomes

    owner.relax_problem = staged


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--items", type=int, default=256)
    options = parser.parse_args()
    rows = batch_rate.jobs(max(options.items, 1024), len(batch_rate.GARMENTS), "dressed")[: options.items]
    scenes, load_cache = batch_rate.loaded(rows)
    from warp_cloth.batch import many

    for name in ("build_problem", "build_predrape", "start_predraped", "finish_fits"):
        watched(many, name)
    watch_relaxing(many)
    for label in ("a fresh process", "again"):
        print(label)
        many.fit_many(scenes, options.device, load_cache=load_cache)
    os._exit(0)  # the loaders end with it


if __name__ == "__main__":
    main()
