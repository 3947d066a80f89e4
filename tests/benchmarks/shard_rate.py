"""How many garments a second does a GPU fit once they are set up, together and one by one?

    python tests/benchmarks/shard_rate.py --items 1024 --alone 8 --device cuda:0

The items of batch_rate.py, with dressed starts, as one shard in this process: seconds from where all is set up to the
last certificate, of dressing and relaxing. They are fitted twice, so that kernels and meshes are there; what was
dressed the first time is forgotten. Then some of them likewise one by one: are their shapes the same?
"""

from __future__ import annotations

import functools
import os
import sys
import time
from typing import Any

import batch_rate
import numpy as np
import warp as wp
from measured import Figures, script_parser


class Watch:
    """Seconds of dressing and relaxing of what ``fit_many`` fits next."""

    def __init__(self, many: Any) -> None:
        self.dressing = self.relaxing = 0.0
        many.start_predraped = self._timed(many.start_predraped, "dressing")
        many.relax_problem = self._timed(many.relax_problem, "relaxing")

    def _timed(self, work: Any, name: str) -> Any:
        @functools.wraps(work)
        def timed(*arguments: Any, **named: Any) -> Any:
            wp.synchronize()
            began = time.perf_counter()
            found = work(*arguments, **named)
            wp.synchronize()
            setattr(self, name, getattr(self, name) + time.perf_counter() - began)
            return found

        return timed

    def taken(self) -> tuple[float, float]:
        """Both, to begin with the next."""
        found = self.dressing, self.relaxing
        self.dressing = self.relaxing = 0.0
        return found


def main() -> int:
    parser = script_parser(__doc__, device="cuda:0")
    parser.add_argument("--items", type=int, default=1024)
    parser.add_argument("--alone", type=int, default=8, metavar="N", help="so many of them one by one")
    options = parser.parse_args()
    rows = batch_rate.jobs(options.items, len(batch_rate.GARMENTS), "dressed")
    scenes, load_cache = batch_rate.loaded(rows)
    from warp_cloth.base.cache import Cache
    from warp_cloth.batch import many

    watch = Watch(many)

    def fitted(some: list[Any]) -> tuple[list[Any], float, float]:
        """Fits of scenes whose meshes are there, and the seconds of dressing and relaxing."""
        cache = Cache()
        cache.add_entries(load_cache.cache.portable_entries())  # patches; not what was dressed
        load_cache.cache = cache
        found = many.fit_many(some, options.device, load_cache=load_cache)
        return found, *watch.taken()

    figures = Figures(__file__, options, device=options.device)

    def add(label: str, count: int, dressing: float, relaxing: float) -> None:
        figures.add(f"{label}.dressing", dressing, "s")
        figures.add(f"{label}.relaxing", relaxing, "s")
        figures.add(f"{label}.rate", count / (dressing + relaxing), "items/s")

    for label in ("first_time", str(len(scenes))):
        together, *seconds = fitted(scenes)
        add(label, len(scenes), *seconds)
    statuses = [fit.status.value for fit in together]
    print(f"{100 * statuses.count('at_rest') / len(statuses):.1f} % at rest", flush=True)
    at = list(range(0, len(scenes), max(len(scenes) // options.alone, 1)))[: options.alone]
    fitted([scenes[at[0]]])  # loads the kernels of a lone garment
    dressing, relaxing, same = 0.0, 0.0, 0
    for number in at:
        (alone,), *seconds = fitted([scenes[number]])
        dressing, relaxing = dressing + seconds[0], relaxing + seconds[1]
        same += np.array_equal(alone.garments[0].points, together[number].garments[0].points)
    add("alone", len(at), dressing, relaxing)
    print(f"{same} of {len(at)} the same", flush=True)
    with figures:  # writes them
        return 0 if same == len(at) else 1


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    os._exit(code)  # the loaders end with it
