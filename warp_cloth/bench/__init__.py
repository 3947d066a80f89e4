"""Virtual test bench: the tests of a textile laboratory, simulated with the ordinary solver."""

from warp_cloth.bench.bench import Bench, Finding, run_bench

__all__ = ["Bench", "Finding", "run_bench"]
