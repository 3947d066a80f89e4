"""Commands that fit many garments: ``warp-cloth batch`` and ``sizes``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import Device, FabricName, Maps, On
from warp_cloth.cli.terminal import BAD_INPUT, NOT_WORN, made, one_line_errors, output_folder, say
from warp_cloth.report.rows import wrote_rows

LARGEST_EASE = 200.0  # [cm]; a tent has less


def batch(
    jobs: Annotated[
        Path,
        typer.Argument(help="Job file: a table with a row per item (.csv, .parquet, .toml), or a product (.toml)."),
    ],
    out: Annotated[
        Path, typer.Option(help="Output folder, for results.parquet, results.csv and the draped shapes.")
    ] = Path("out"),
    device: Annotated[
        str | None, typer.Option(help="cpu, cuda (all GPUs) or cuda:N.", show_default="all GPUs, or the CPU")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Number of processes.", show_default="one per core, or several per GPU")
    ] = None,
    ray: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Run on the Ray cluster at this address.")] = None,
    keep: Annotated[
        str, typer.Option(help="Draped shapes to keep: arrays (a file per shard), stages (one per item) or none.")
    ] = "arrays",
    shard: Annotated[
        int | None, typer.Option(help="Items per shard (a task, and its file).", show_default="depends on the device")
    ] = None,
    sheet: Annotated[
        int, typer.Option(help="Thumbnails on contact_sheet.html, the worst items first; 0: no such page.")
    ] = 0,
    ease: Annotated[
        bool, typer.Option(help="Measure ease at chest, waist and hip: 0.02 s of a core for each item.")
    ] = True,
) -> None:
    """Fit many scenes. If it is interrupted, the same command continues where it stopped.

    \b
    Exit status: 0 all items are worn; 1 some are not done: the same command
    continues; 2 bad input; 3 some are not worn (columns worn and problems).

    \b
    warp-cloth batch jobs.csv --out out
    warp-cloth batch jobs.toml --out out --keep stages --workers 4
    """
    with one_line_errors():
        from warp_cloth.batch.processes import start_forkserver

        if ray is None:
            start_forkserver(device)  # while this process imports
        from rich.console import Console

        from warp_cloth.batch import run_batch
        from warp_cloth.batch.progress import BatchDisplay
        from warp_cloth.batch.progress import summary as batch_summary

        with BatchDisplay(Console(stderr=True)) as display:
            report = run_batch(
                jobs,
                out,
                device=device,
                workers=workers,
                ray=ray,
                keep=keep,  # type: ignore[arg-type]
                shard=shard,
                sheet=sheet,
                ease=ease,
                progress=display,
            )
    say(batch_summary(report))
    if not report.complete:
        raise typer.Exit(1)
    if set(report.statuses) == {"invalid"}:
        raise typer.Exit(BAD_INPUT)
    if report.worn < report.progress.items:
        raise typer.Exit(NOT_WORN)


def sizes(
    scene: Annotated[
        str,
        typer.Argument(
            help="Scene file (TOML), or the name of a shipped scene; its avatar is the customer. With --on, a "
            "garment's mesh or pattern, such as 'shirt_{size}.obj'."
        ),
    ],
    on: On = None,
    fabric: FabricName = None,
    size: Annotated[
        list[str] | None,
        typer.Option(help="Sizes, smallest first: S,M,L, or one each time.", show_default="all, of T-shirt or DXF"),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Override a scene key; {size} stands for the size. May be repeated."
        ),
    ] = None,
    ease: Annotated[float, typer.Option(help="Desired ease at chest, waist and hip, in cm.")] = 4.0,
    maps: Maps = "",
    device: Device = None,
    out: Annotated[
        Path, typer.Option(help="Output folder, for sizes.html, sizes.png, sizes.json and a folder for each size.")
    ] = Path("out"),
) -> None:
    """Fit every size of a garment on one body, and recommend one.

    \b
    warp-cloth sizes tshirt --set avatar.shape.chest=1.02 --ease 4
    warp-cloth sizes 'shirt_{size}.obj' --on body.obj --size S,M,L
    """
    with one_line_errors("on", "fabric", "maps"), output_folder(out, "sizes"):
        if not -LARGEST_EASE <= ease <= LARGEST_EASE:
            raise InputError("--ease", f"must be a length in cm, not {ease:g}", f"use at most {LARGEST_EASE:g}")
        from warp_cloth.batch.sizes import fit_sizes

        start_warp()
        run = fit_sizes(
            scene,
            [name.strip() for text in size or () for name in text.split(",") if name.strip()],
            on=on,
            fabric=fabric,
            overrides=changes or (),
            ease=ease / 100,
            maps=maps,
            device=device,
            progress=lambda name: typer.echo(f"fitting {name}", err=True),
        )
        paths = run.save(out, made=made())
    rows = [f"{each.size:<4} {each.verdict.words:<16} {each.figures}" for each in run.sizes]
    say([*rows, run.advice, *wrote_rows(paths)])
    if all(each.status == "invalid" for each in run.sizes):
        raise typer.Exit(BAD_INPUT)
