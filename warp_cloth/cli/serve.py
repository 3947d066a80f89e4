"""The command ``warp-cloth serve``."""

from __future__ import annotations

import importlib.util
import math
from typing import Annotated

import typer

from warp_cloth.base.errors import InputError
from warp_cloth.cli.terminal import one_line_errors

NEEDED = ("fastapi", "uvicorn", "fastapi_offline")  # packages of the extra
LEAST_MB, MOST_MB = 0.001, 10_000.0
MOST_SECONDS = 86_400.0


def serve(
    products: Annotated[
        list[str] | None,
        typer.Argument(
            help="What can be asked for: shipped scenes, scene files, job files (.toml) with a product.",
            show_default="tshirt",
        ),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to serve on; 0.0.0.0 admits other machines.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="Port; 0: any that is free.", min=0, max=65535)] = 8000,
    device: Annotated[
        str | None, typer.Option(help="cpu, cuda (all GPUs) or cuda:N.", show_default="all GPUs, or the CPU")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(help="Number of processes that fit.", min=1, show_default="one per core, or four per GPU"),
    ] = None,
    queue: Annotated[int, typer.Option(help="Requests that wait or are fitted; more are refused.", min=1)] = 256,
    timeout: Annotated[float, typer.Option(help="Seconds that a request may wait and be fitted.")] = 120.0,
    most_mb: Annotated[float, typer.Option("--max-mb", help="Size of a request, in megabytes.")] = 32.0,
) -> None:
    """Answer requests over HTTP: a body and a product in; sizes, fit maps and meshes out. /docs explains it.

    \b
    warp-cloth serve
    warp-cloth serve catalogue.toml --port 8080 --queue 64 --timeout 60
    """
    with one_line_errors("products"):
        if any(importlib.util.find_spec(name) is None for name in NEEDED):
            raise InputError("serve", "needs FastAPI and uvicorn", "pip install 'warp-cloth[serve]'")
        if not (math.isfinite(timeout) and 0 < timeout <= MOST_SECONDS):
            raise InputError("--timeout", f"must be above 0 and at most {MOST_SECONDS:g} s, not {timeout:g}")
        if not (math.isfinite(most_mb) and LEAST_MB <= most_mb <= MOST_MB):
            raise InputError("--max-mb", f"must be from {LEAST_MB:g} to {MOST_MB:g} MB, not {most_mb:g}")
        from warp_cloth.serve.limits import Limits
        from warp_cloth.serve.run import serve as run

        limits = Limits(request_bytes=int(1e6 * most_mb), queue=queue, seconds=timeout)
        run(
            products or ["tshirt"], host=host, port=port, device=device, workers=workers, limits=limits, show=typer.echo
        )
