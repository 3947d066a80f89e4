"""The methods on the same cloth: how fast each comes to rest, at every stiffness and resolution, and is it true?

    python tests/benchmarks/methods.py --device cuda:0 --out study
    python tests/benchmarks/methods.py --only sizes --processes 8

Keeps every run in methods.jsonl, from which an interrupted command continues, and draws methods.png and rest_error.png.
Groups: "methods" (four scenes by every method), "sizes" (three scenes by size and stiffness), "truth" (certificates
against where the run ended).
"""

from __future__ import annotations

from pathlib import Path

from measured import Figures, script_parser
from methods_files import methods_lines, save_plots, side_by_side, truth_of
from methods_scenes import GROUPS
from methods_study import LEVELS, Measurement, MethodStudy, Run

from warp_cloth.base.device import device_named
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.export.plots import figure_class
from warp_cloth.report.rows import wrote_rows


def add_figures(figures: Figures, runs: list[Run]) -> None:
    """The rows of the table of measured figures."""
    for row in side_by_side(runs):
        for run in row:
            ends = [(f"{100 * level:g}%", run.first(level)) for level in LEVELS] + [("rest", run.certified())]
            for name, look in ends:
                figures.add(f"{run.case.kind}.{run.method}.{name}", _shown(run, look), "iterations")
    truth = truth_of(runs)
    if truth.certificates:
        figures.add("truth.certificates", truth.certificates, "certificates")
        figures.add("truth.certificates_held", truth.held, "certificates")
        figures.add("truth.scenes", truth.scenes, "scenes")
        figures.add("truth.checks", truth.checks, "checks")
        figures.add("truth.checks_held", 100.0 * truth.checks_share, "%")


def _shown(run: Run, look: Measurement | None) -> str:
    return "not reached" if look is None else f"{run.coarse + look.iteration:,.0f} in {look.seconds:.3g} s"


def main(arguments: list[str] | None = None) -> None:
    parser = script_parser(__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--device", help="default: a GPU if there is one")
    parser.add_argument("--only", action="append", choices=GROUPS, help="may be repeated; default: all groups")
    parser.add_argument("--no-plots", dest="plots", action="store_false")
    parser.add_argument("--processes", type=int, default=1, help="runs at a time of those that are not timed")
    options = parser.parse_args(arguments)
    start_warp(False)
    if options.plots:
        figure_class()  # fails now rather than after hours
    options.out.mkdir(parents=True, exist_ok=True)
    device = device_named(options.device)
    study = MethodStudy(options.out / "methods.jsonl", device, lambda line: print(line, flush=True), options.processes)
    runs = study.run(options.only or GROUPS)
    paths = save_plots(runs, options.out) if options.plots else []
    print("\n".join([*methods_lines(runs), *wrote_rows(paths)]))
    with Figures(__file__, options, device=device) as figures:
        add_figures(figures, runs)


if __name__ == "__main__":
    main()
