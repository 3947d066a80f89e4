"""Commands that look at fits: ``warp-cloth compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.quiet import start_warp
from warp_cloth.terminal import one_line_errors, output_folder


def compare(
    first: Annotated[Path, typer.Argument(help="A fit's stage, or its folder; made with --maps.")],
    second: Annotated[Path, typer.Argument(help="The fit to compare it with.")],
    out: Annotated[Path, typer.Option(help="Folder for compare.usdc, compare.json and pictures.")] = Path("out"),
) -> None:
    """Show the difference between two fits, of sizes, fabrics or bodies: the second less the first."""
    with one_line_errors():
        from warp_cloth.loading.result import read_fit

        fits = read_fit(first), read_fit(second)
        with output_folder(out, "compare"):
            start_warp(False)
            from warp_cloth.export.comparison import girth_lines, save_comparison
            from warp_cloth.maps.compare import compare_fits

            found = compare_fits(*fits)
            paths = save_comparison(found, fits, out)
    for line in [*girth_lines(found), *(f"  wrote {path}" for path in paths)]:
        typer.echo(line)
