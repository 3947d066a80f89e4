"""The commands of the studies: ``warp-cloth plan``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.quiet import start_warp
from warp_cloth.terminal import one_line_errors

SceneName = Annotated[str, typer.Argument(help="Scene file (TOML), or a shipped scene: see `warp-cloth scenes`.")]
Device = Annotated[str | None, typer.Option(help="cpu, cuda or cuda:N.", show_default="a GPU if there is one")]
Changes = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change one scene key. May be repeated.")
]


def plan(
    scene: SceneName,
    device: Device = None,
    changes: Changes = None,
    out: Annotated[Path | None, typer.Option(help="File for the same as JSON.", dir_okay=False)] = None,
) -> None:
    """Say which terms a scene needs and why, which kernels and arrays that means, and what each costs."""
    with one_line_errors():
        from warp_cloth.scene import load_scene

        chosen = load_scene(scene, changes or ())
        start_warp(False)
        from warp_cloth.fitting import device_named, set_up
        from warp_cloth.plan import make_plan
        from warp_cloth.study.footprint import footprint_of
        from warp_cloth.study.planning import plan_lines, write_plan

        made = set_up(chosen, device_named(device))
        terms, cost = make_plan(chosen, made.wardrobe), footprint_of(made)
        lines = plan_lines(chosen.name, terms, cost)
        if out is not None:
            write_plan(out, terms, cost)
            lines.append(f"  wrote {out}")
    _show(lines, typer.echo)


def _show(lines: Sequence[str], say: Callable[[str], None]) -> None:
    for line in lines:
        say(line)
