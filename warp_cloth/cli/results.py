"""Commands that show fits: ``warp-cloth compare`` and ``view``."""

from __future__ import annotations

import importlib.util
import socket
from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import Changes, Device, FabricName, On
from warp_cloth.cli.terminal import one_line_errors, output_folder, say
from warp_cloth.report.rows import note_rows, wrote_rows


def compare(
    first: Annotated[Path, typer.Argument(help="A fit: its stage, or its folder; made with --maps, for pictures.")],
    second: Annotated[Path, typer.Argument(help="The fit to compare with it.")],
    out: Annotated[Path, typer.Option(help="Output folder, for compare.usdc, compare.json and pictures.")] = Path(
        "out"
    ),
) -> None:
    """Compare two fits, A and B, of one garment in two sizes, fabrics or bodies: each figure of both, and the change.

    \b
    warp-cloth compare out_M out_L --out difference
    """
    with one_line_errors():
        from warp_cloth.maps.read import read_fit

        fits = read_fit(first), read_fit(second)
        with output_folder(out, "compare"):
            start_warp(False)
            from warp_cloth.export.comparison import comparison_lines, save_comparison
            from warp_cloth.maps.compare import compare_fits

            found = compare_fits(*fits)
            paths = save_comparison(found, fits, out)
    say([*comparison_lines(found, fits), *note_rows(found.notes), *wrote_rows(paths)])


def view(
    scene: Annotated[
        str,
        typer.Argument(
            help="Scene file (TOML), USD stage (also one that a fit wrote), or shipped scene; with --on, a garment's "
            "mesh or pattern, too."
        ),
    ],
    on: On = None,
    fabric: FabricName = None,
    changes: Changes = None,
    device: Device = None,
    host: Annotated[str, typer.Option(help="Address to serve on; 0.0.0.0 admits other machines.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port; if it is in use, the next free one.", min=1, max=65535)] = 8080,
    opened: Annotated[bool, typer.Option("--open", help="Open the page in this machine's browser.")] = False,
) -> None:
    """Watch a garment drape in a web page, while you change size, fabric and body; it waits for your browser.

    \b
    warp-cloth view tshirt --open
    warp-cloth view shirt.obj --on body.obj --open
    warp-cloth view scene.toml --set garment.fabric=denim --port 8090
    """
    with one_line_errors("on", "fabric"):
        if importlib.util.find_spec("viser") is None:
            raise InputError("view", "needs the package viser", "pip install 'warp-cloth[view]'")
        for text in changes or ():
            if "=" not in text:
                raise InputError(f"--set {text}", "has no value", "write KEY=VALUE")
        _check_host(host)
        start_warp(False)
        from warp_cloth.view.live import LiveFit
        from warp_cloth.view.page import serve

        pairs = dict(text.split("=", 1) for text in changes or ())
        live = LiveFit(scene, pairs, device, _show_stage, on, fabric)
        serve(live, host=host, port=port, show=typer.echo, opened=opened)


def _check_host(host: str) -> None:
    """Refuses an address on which this machine cannot serve."""
    try:
        with socket.socket() as probe:
            probe.bind((host, 0))
    except OSError as error:
        raise InputError("--host", f'"{host}" is not an address of this machine', "use 127.0.0.1 or 0.0.0.0") from error


def _show_stage(stage: str) -> None:
    """Explains the wait before the page opens, where the garment goes through the avatar's poses first."""
    if stage == "carry":
        typer.echo("moving the garment through avatar.poses first; this may take a minute", err=True)
