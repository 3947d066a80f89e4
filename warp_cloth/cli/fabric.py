"""The command ``warp-cloth fabric``: a laboratory's tests of a fabric, a fabric of its drape, two side by side."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.drape_options import DrapeTest
from warp_cloth.cli.options import with_options_of
from warp_cloth.cli.terminal import can_plot, one_line_errors, output_folder, say
from warp_cloth.report.rows import wrote_rows

Lines = tuple[list[str], list[Path]]  # to print, and the files written

Names = Annotated[
    list[str] | None,
    typer.Argument(
        help="Name of a shipped fabric, or a fabric file (TOML); or compare and two of them; after --from-drape, "
        "further photographs."
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        help="Output folder, for NAME.json, NAME.csv, NAME.png and NAME_drape.png; of a fabric that is made, its "
        "file, NAME.toml.",
        show_default="out, made.toml",
    ),
]
Rings = Annotated[
    int | None,
    typer.Option(help="Rings of vertices in a draped disc; 140 make 46,471 vertices.", show_default="30"),
]
Discs = Annotated[int | None, typer.Option(help="Number of discs to drape.", show_default="6")]


@with_options_of(DrapeTest)
def fabric(
    fabric: Names = None,
    device: Annotated[str, typer.Option(help="cpu, cuda or cuda:N.")] = "cpu",
    out: Out = None,
    plots: Annotated[bool, typer.Option(help="Plot the curves (needs matplotlib).")] = True,
    rings: Rings = None,
    discs: Discs = None,
    *,
    drape: DrapeTest,
) -> None:
    """Test a fabric the way a textile laboratory does; or make one from photographs or figures of its drape.

    \b
    warp-cloth fabric denim
    warp-cloth fabric my_fabric.toml --out tested --device cuda --rings 140
    warp-cloth fabric compare denim my_fabric.toml
    warp-cloth fabric --from-drape first.jpg second.jpg --weight-gsm 160 --base cotton --out mine.toml
    warp-cloth fabric --drape-coefficient 47 --folds 8 --weight-gsm 59
    """
    names = fabric or []
    with one_line_errors():
        from warp_cloth.cli.made_fabric import comparison, make_fabric

        if drape.makes_fabric:
            lines, paths = make_fabric(drape, names, out or Path("made.toml"), device)
        elif names[:1] == ["compare"]:
            lines, paths = comparison(names[1:]), []
        elif len(names) != 1:
            problem = "needs one fabric" if not names else f"takes one fabric, not {len(names)}"
            raise InputError("fabric", problem, "or compare and two of them; or --from-drape, or --drape-coefficient")
        else:
            lines, paths = _tested(names[0], device, out or Path("out"), plots, rings, discs)
    say([*lines, *wrote_rows(paths)])


def _tested(fabric: str, device: str, out: Path, plots: bool, rings: int | None, discs: int | None) -> Lines:
    """A fabric's laboratory tests."""
    from warp_cloth.material.fabric import resolve_fabric, unlikely_values

    try:
        chosen = resolve_fabric(fabric)
    except InputError as error:
        raise InputError(error.place or "fabric", error.problem, error.remedy) from None
    with output_folder(out, chosen.name):
        start_warp(False)
        from warp_cloth.base.device import device_named
        from warp_cloth.bench import run_bench
        from warp_cloth.bench.bench import DISC_RINGS, DISCS
        from warp_cloth.bench.save import save_bench, table

        plots = can_plot(plots)
        where = device_named(device)
        bench = run_bench(
            chosen,
            device=where,
            rings=DISC_RINGS if rings is None else rings,
            discs=DISCS if discs is None else discs,
            progress=lambda name: print(f"testing {name}", file=sys.stderr),
        )
        return [*table(bench), *unlikely_values(chosen)], save_bench(bench, out, where, plots=plots)
