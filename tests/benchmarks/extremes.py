"""Fits what no tailor would cut: where does the solver come to rest, and where does it say that it does not?

    python tests/benchmarks/extremes.py --out study
    python tests/benchmarks/extremes.py --only precision

Stiffness from 1 to 1e8 N/m, needles, edges of 1:10,000 in one mesh, seams 50 times too long, garments inside the body
or 900 km away. Every run must come to rest, say that it did not, or be refused; the script fails where one crashed,
hung or lost its numbers. Writes extremes.csv and extremes.png (the stability map).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from extremes_files import extremes_lines, save_extremes, theory_holds
from extremes_study import GROUPS, Outcome, run_extremes
from measured import Figures, script_parser

from warp_cloth.base.device import device_named
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.export.plots import figure_class
from warp_cloth.report.rows import wrote_rows


def add_figures(figures: Figures, found: Sequence[Outcome]) -> None:
    """The rows of the table of measured figures."""
    figures.add("runs", len(found), "runs")
    figures.add("broken", sum(not outcome.kept for outcome in found), "runs")
    below, resting, above, still = theory_holds(found)
    if below:
        figures.add("direct.at_rest_up_to_theory", f"{resting} of {below}", "runs")
        figures.add("direct.at_rest_beyond_theory", f"{still} of {above}", "runs")


def main(arguments: list[str] | None = None) -> int:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--only", action="append", choices=GROUPS, help="may be repeated; default: all groups")
    parser.add_argument("--no-plots", dest="plots", action="store_false")
    options = parser.parse_args(arguments)
    start_warp(False)
    if options.plots:
        figure_class()  # fails now rather than after minutes
    options.out.mkdir(parents=True, exist_ok=True)
    device = device_named(options.device)
    found = run_extremes(device, lambda line: print(line, flush=True), options.only or GROUPS)
    paths = save_extremes(found, options.out, plots=options.plots)
    print("\n".join([*extremes_lines(found), *wrote_rows(paths)]))
    with Figures(__file__, options, device=device) as figures:
        add_figures(figures, found)
    return int(not all(outcome.kept for outcome in found))


if __name__ == "__main__":
    sys.exit(main())
