"""The command that makes a machine ready: ``warp-cloth warm-up``."""

from __future__ import annotations

import time

import typer

from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import Device
from warp_cloth.cli.terminal import one_line_errors


def warm_up(device: Device = None) -> None:
    """Compile the kernels of usual fits, for the CPU and for a GPU, if there is one: so the first fit starts at once.

    For images of containers and new machines. A fit of another kind compiles what it still lacks.

    \b
    warp-cloth warm-up
    warp-cloth warm-up --device cpu
    """
    with one_line_errors():
        start_warp()
        import warp as wp

        from warp_cloth.base.device import device_named

        chosen = [] if device is None else [device_named(device)]
        typer.echo("compiling kernels: about a minute", err=True)  # before what is imported takes its time
        from warp_cloth.base.first_run import cache_folder
        from warp_cloth.fitting.warm_up import warm_up as warm

        first_gpu = ["cuda:0"] if wp.get_cuda_device_count() else []
        for name in chosen or ["cpu", *first_gpu]:
            began = time.perf_counter()
            warm(name, lambda kind, name=name: typer.echo(f"{name}: {kind}", err=True))  # type: ignore[misc]
            typer.echo(f"{name} is ready after {time.perf_counter() - began:.0f} s")
        typer.echo(f"  kernels      {wp.config.kernel_cache_dir}")
        typer.echo(f"  bodies       {cache_folder() or 'not kept: WARP_CLOTH_CACHE is off'}")
