"""The commands of the studies: ``warp-cloth plan`` and ``warp-cloth tradeoff``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import Changes, Device, FabricName, On, SceneName
from warp_cloth.cli.terminal import INTERRUPTED, can_plot, one_line_errors, output_folder, say
from warp_cloth.report.rows import wrote_rows


def plan(
    scene: SceneName,
    on: On = None,
    fabric: FabricName = None,
    device: Device = None,
    changes: Changes = None,
    savings: Annotated[
        bool, typer.Option("--savings", help="Also run the scene without each term, and print the time that saves.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Also write the plan to this JSON file.", dir_okay=False)] = None,
) -> None:
    """Show which terms a scene uses and why, and the kernels, memory and time of an iteration.

    \b
    warp-cloth plan tshirt --savings
    warp-cloth plan scene.toml --set collision.cloth=true
    """
    with one_line_errors("on", "fabric"):
        from warp_cloth.scene import load_scene

        chosen = load_scene(scene, changes or (), on=on, fabric=fabric)
        start_warp(False)
        from warp_cloth.base.device import device_named
        from warp_cloth.fitting.problem import load_problem
        from warp_cloth.model.plan import make_plan
        from warp_cloth.study.footprint import footprint_of
        from warp_cloth.study.planning import plan_lines, write_plan
        from warp_cloth.study.savings import savings_of

        problem = load_problem(chosen, device_named(device))
        (decided,) = problem.scenes
        terms, cost = make_plan(decided, problem.outfit), footprint_of(problem)
        saved = savings_of(decided, problem.outfit, problem.model.device) if savings else ()
        lines = plan_lines(chosen.name, terms, cost, saved)
        if out is not None:
            write_plan(out, terms, cost, saved)
            lines += wrote_rows([out])
    say(lines)


def tradeoff(
    scene: SceneName,
    on: On = None,
    fabric: FabricName = None,
    within: Annotated[str, typer.Option(help="Wanted accuracy: rms distance from the reference.")] = "2mm",
    out: Annotated[Path, typer.Option(help="Folder for NAME_tradeoff.json, .csv, .toml and .png.")] = Path("out"),
    device: Device = None,
    changes: Changes = None,
    plots: Annotated[bool, typer.Option(help="Draw the plot, with matplotlib.")] = True,
) -> None:
    """Find the cheapest settings of a scene that are accurate enough, against a tight reference.

    Results are stored at once: if interrupted, run the same command again to continue.

    \b
    warp-cloth tradeoff scene.toml --within 2mm --out study
    """
    with one_line_errors("on", "fabric"):
        from warp_cloth.scene import load_scene
        from warp_cloth.study.tradeoff import TradeStudy, millimetres
        from warp_cloth.study.tradeoff_files import save_trade, trade_lines

        wanted, chosen = millimetres(within), load_scene(scene, changes or (), on=on, fabric=fabric)
        with output_folder(out, f"{chosen.name}_tradeoff"):
            start_warp(False)
            from warp_cloth.base.device import device_named

            plots = can_plot(plots)
            study = TradeStudy(
                chosen,
                device=device_named(device),
                within_mm=wanted,
                folder=out,
                log=lambda line: print(line, file=sys.stderr),
            )
            try:
                trade = study.run()
            except KeyboardInterrupt:
                known = study.trade()
                if known.measured:
                    save_trade(known, out, plots=plots)
                remedy = ": run the same command again to continue" if known.measured else ""
                print(f"interrupted{remedy}", file=sys.stderr)
                raise typer.Exit(INTERRUPTED) from None
            paths = save_trade(trade, out, plots=plots)
    say([*trade_lines(trade), *wrote_rows(paths)])
