"""Virtual test bench: a textile laboratory's tests, run on a fabric by the ordinary solver."""

from warp_cloth.bench.bench import Bench, Finding, run_bench

__all__ = ["Bench", "Finding", "run_bench"]
