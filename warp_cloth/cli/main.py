"""The command line: ``warp-cloth fit``, ``warp-cloth batch``, ``warp-cloth fabric``, ``warp-cloth scenes``."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.look import compare, view
from warp_cloth.cli.study import plan, tradeoff
from warp_cloth.cli.terminal import BAD_INPUT, INTERRUPTED, keep_interrupts, one_line_errors, output_folder, tell_error

if TYPE_CHECKING:
    from warp_cloth.fitting.fit import Fit
    from warp_cloth.scene import Scene

LARGEST_EASE = 200.0  # [cm]; a tent has less

app = typer.Typer(
    name="warp-cloth",
    help="Garment fitting on NVIDIA Warp: the worn shape of a garment on a body, with a certificate of rest.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command()(plan)
app.command()(tradeoff)


def main() -> None:
    """Entry point of the ``warp-cloth`` command: wrong usage and an interrupt, too, end it with one line."""
    keep_interrupts()
    try:
        code = app(standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        print("interrupted", file=sys.stderr)
        code = INTERRUPTED
    except OSError as error:
        if error.errno is None:
            raise
        tell_error(f"{error.filename or 'output'}: {error.strerror}; make room, or check that it can be written")
        code = BAD_INPUT
    except Exception as error:
        # wrong usage is of a class that typer's versions keep at different places
        if not hasattr(error, "format_message"):
            raise
        code = getattr(error, "exit_code", BAD_INPUT)
        if type(error).__name__ == "NoArgsIsHelpError":
            print(error.format_message(), file=sys.stderr)
        else:
            tell_error(f"{error.format_message().rstrip('.')}; see warp-cloth --help")
    sys.exit(code)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"warp-cloth {version('warp-cloth')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    pass


@app.command()
def fit(
    scene: Annotated[
        str,
        typer.Argument(help="Scene file (TOML), USD stage of a garment and an avatar, or a shipped scene."),
    ],
    device: Annotated[
        str | None, typer.Option(help="cpu, cuda or cuda:N.", show_default="a GPU if there is one")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for NAME.usdc, report.json and preview.png.")] = Path("out"),
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change one scene key, e.g. garment.fabric=denim. May be repeated.",
        ),
    ] = None,
    frames: Annotated[int, typer.Option(help="Shapes on the way to store as time samples in the stage.")] = 0,
    maps: Annotated[
        str, typer.Option(help="Fit maps: strain, pressure, ease, one of their parts, or all; with commas between.")
    ] = "",
    colour: Annotated[str, typer.Option(help="The map that colours the stage's garments.")] = "",
    formats: Annotated[
        str, typer.Option("--format", help="Of the result, with commas between: usdc, usda, usdz, glb, obj.")
    ] = "usdc",
    start: Annotated[
        Path | None,
        typer.Option("--from", metavar="RESULT", help="Start as an earlier result is worn: its .usdc, .obj or .glb."),
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Show what the library and Warp log.")] = False,
) -> None:
    """Fit a scene's garments, and write the stage, the report and a picture.

    \b
    warp-cloth fit tshirt --set garment.shape.size=L --maps all --colour ease
    warp-cloth fit stage.usda --set garment.prim=/World/shirt --set avatar.prim=/World/body
    """
    with one_line_errors():
        from warp_cloth.export.formats import check_inputs_kept, chosen_formats
        from warp_cloth.maps.kinds import chosen_colour, chosen_maps
        from warp_cloth.scene import load_scene

        suffixes = chosen_formats(formats)
        wanted = chosen_maps(maps)
        painted = chosen_colour(colour, place="--colour")
        chosen = load_scene(scene, changes or ())
        check_inputs_kept(chosen, out, suffixes)
        with output_folder(out, chosen.name):
            start_warp(verbose)
            worn = _fit(chosen, device, frames, (*wanted, painted), start)
            paths = worn.save(out, colour=painted, formats=suffixes)
    for line in summary(chosen.name, worn.report, paths):
        typer.echo(line)
    if worn.status.value in ("diverged", "invalid"):
        raise typer.Exit(1)


@app.command()
def fabric(
    fabric: Annotated[str, typer.Argument(help="A shipped fabric, or a fabric file (.toml).")],
    device: Annotated[str, typer.Option(help="cpu, cuda or cuda:N.")] = "cpu",
    out: Annotated[Path, typer.Option(help="Folder for NAME.json, NAME.csv, NAME.png and NAME_drape.png.")] = Path(
        "out"
    ),
    plots: Annotated[bool, typer.Option(help="Draw the curves, with matplotlib.")] = True,
    rings: Annotated[
        int | None,
        typer.Option(help="Of a draped disc, from its middle: 140 are 38,802 vertices.", show_default="30"),
    ] = None,
    discs: Annotated[int | None, typer.Option(help="How many discs are draped.", show_default="6")] = None,
) -> None:
    """Test a fabric as a textile laboratory does, and compare with the values that it states.

    \b
    warp-cloth fabric denim
    warp-cloth fabric my_fabric.toml --out tested --device cuda --rings 140
    """
    with one_line_errors():
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
            from warp_cloth.export.plots import figure_class

            if plots:
                figure_class()
            where = device_named(device)
            bench = run_bench(
                chosen,
                device=where,
                rings=DISC_RINGS if rings is None else rings,
                discs=DISCS if discs is None else discs,
                tell=lambda name: print(f"testing {name}", file=sys.stderr),
            )
            lines = [*table(bench), *unlikely_values(chosen)]
            paths = save_bench(bench, out, where, plots=plots)
    for line in [*lines, *(f"  wrote {path}" for path in paths)]:
        typer.echo(line)


@app.command()
def batch(
    jobs: Annotated[Path, typer.Argument(help="Job file: a table (.csv, .parquet, .toml), or a product (.toml).")],
    out: Annotated[Path, typer.Option(help="Folder for results.parquet, results.csv and the shapes.")] = Path("out"),
    device: Annotated[
        str | None, typer.Option(help="cpu, cuda (all GPUs) or cuda:N.", show_default="all GPUs, or the CPU")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes.", show_default="one a core, four a GPU")] = None,
    ray: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Work on the Ray cluster there.")] = None,
    keep: Annotated[str, typer.Option(help="Shapes: arrays (a file per shard), stages (one per item), none.")] = (
        "arrays"
    ),
    shard: Annotated[int | None, typer.Option(help="Items to a task and its file.", show_default="by device")] = None,
) -> None:
    """Fit many scenes; started again after whatever stopped it, it goes on where it stood.

    \b
    warp-cloth batch jobs.csv --out out
    warp-cloth batch jobs.toml --out out --keep stages --workers 4
    """
    with one_line_errors():
        from warp_cloth.batch.processes import get_ready

        if ray is None:
            get_ready(device)  # while this process imports
        from rich.console import Console

        from warp_cloth.batch import run_batch
        from warp_cloth.batch.progress import BatchDisplay, summary

        with BatchDisplay(Console(stderr=True)) as display:
            report = run_batch(
                jobs,
                out,
                device=device,
                workers=workers,
                ray=ray,
                keep=keep,  # type: ignore[arg-type]
                shard=shard,
                progress=display,
            )
    for line in summary(report):
        typer.echo(line)
    if not report.whole or set(report.statuses) == {"invalid"}:
        raise typer.Exit(1)


@app.command()
def sizes(
    scene: Annotated[str, typer.Argument(help="Scene file (TOML), or a shipped scene; its avatar is the customer.")],
    size: Annotated[
        list[str] | None,
        typer.Option(help="A size, from small to large; may be repeated.", show_default="S, M, L of the T-shirt"),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="As of fit; {size} stands for the size."),
    ] = None,
    ease: Annotated[float, typer.Option(help="Wanted at chest, waist and hip, in cm.")] = 4.0,
    device: Annotated[
        str | None, typer.Option(help="cpu, cuda or cuda:N.", show_default="a GPU if there is one")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for sizes.json and a stage of each size.")] = Path("out"),
) -> None:
    """Fit all sizes of a garment on one body, and say which to take and why.

    \b
    warp-cloth sizes tshirt --set avatar.shape.chest=1.02 --ease 4
    warp-cloth sizes scene.toml --size S --size M --set 'garment.mesh=shirt_{size}.obj'
    """
    with one_line_errors(), output_folder(out, "sizes"):
        if not -LARGEST_EASE <= ease <= LARGEST_EASE:
            raise InputError("--ease", f"must be a length in cm, not {ease:g}", f"give at most {LARGEST_EASE:g}")
        from warp_cloth.batch.sizes import fit_sizes

        start_warp()
        run = fit_sizes(
            scene,
            size or (),
            overrides=changes or (),
            ease=ease / 100,
            device=device,
            progress=lambda name: typer.echo(f"fitting {name}", err=True),
        )
        paths = run.save(out)
    for each in run.sizes:
        levels = [f"{name} {100 * level.ease:+.1f} cm" for name, level in each.levels.items()]
        strain = f"strain p99 {100 * each.strain_p99:.1f} %" if each.strain_p99 is not None else each.message
        lost = [] if each.held else ["slides down"]
        typer.echo(f"{each.size:<4} {each.status:<16} {', '.join([*levels, strain, *lost])}")
    typer.echo(f"take {run.recommended}: {run.reason}" if run.recommended else run.reason)
    typer.echo(f"  wrote        {', '.join(str(path) for path in paths)}")
    if all(each.status == "invalid" for each in run.sizes):
        raise typer.Exit(1)


app.command()(compare)
app.command()(view)


@app.command()
def avatar(
    scene: Annotated[str, typer.Argument(help="Scene file (TOML), or a shipped scene.")],
    device: Annotated[
        str | None, typer.Option(help="cpu, cuda or cuda:N.", show_default="a GPU if there is one")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for NAME_avatar.json and NAME_walks.png.")] = Path("out"),
    changes: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change one scene key. May be repeated.")
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw the fields along lines, with matplotlib.")] = True,
) -> None:
    """Compare every collider of a scene's avatar with its exact mesh, near the garment.

    \b
    warp-cloth avatar scene.toml --out out
    warp-cloth avatar tshirt --set collision.pixel_mm=1 --no-plots
    """
    with one_line_errors():
        from warp_cloth.scene import load_scene

        chosen = load_scene(scene, changes or ())
        with output_folder(out, chosen.name):
            start_warp(False)
            from warp_cloth.base.device import device_named
            from warp_cloth.bench.avatar import run_avatar_bench, save_avatar_bench, table
            from warp_cloth.export.plots import figure_class
            from warp_cloth.garment.outfit import load_outfit

            if plots:
                figure_class()
            where = device_named(device)
            outfit = load_outfit(chosen)
            found = run_avatar_bench(
                chosen, outfit, device=where, tell=lambda kind: print(f"building {kind}", file=sys.stderr)
            )
            lines, paths = table(found), save_avatar_bench(found, out, plots=plots)
    for line in [*lines, *(f"  wrote {path}" for path in paths)]:
        typer.echo(line)


@app.command()
def scenes() -> None:
    """List the shipped scenes and fabrics."""
    with one_line_errors():
        from warp_cloth.material.fabric import shipped_fabrics
        from warp_cloth.scene import describe_scene, shipped_scenes

        typer.echo("Scenes:")
        for name, path in shipped_scenes().items():
            typer.echo(f"  {name:<10} {describe_scene(path)}")
        typer.echo("Fabrics:")
        for name, fabric in shipped_fabrics().items():
            typer.echo(
                f"  {name:<10} {fabric.weight * 1e3:4.0f} g/m2  stretch {fabric.stretch_warp / 1e3:5.1f} and "
                f"{fabric.stretch_weft / 1e3:5.1f} kN/m  bending {fabric.bending_warp:.1e} and "
                f"{fabric.bending_weft:.1e} N m2  thickness {fabric.thickness * 1e3:.2f} mm"
            )


def summary(name: str, report: Mapping[str, Any], paths: list[Path]) -> list[str]:
    """What a fit came to, for people: its status, the certificate's key figures, the files written."""
    residual, strain = report.get("residual") or {}, report.get("strain") or {}
    threads = {way: strain[way]["p99"] for way in ("warp", "weft", "bias") if way in strain}
    penetration, seconds = report.get("penetration_mm") or {}, report.get("seconds") or {}
    lines = [f"{name}: {report.get('status', 'unknown')}. {report.get('message', '')}".rstrip()]
    rows = [
        ("residual", _figures("{} relative rms, {} p99", residual, "relative_rms", "relative_p99")),
        ("rest error", _figures("{} mm", report, "rest_error_mm")),
        ("strain", _figures("{} median, {} p99, {} largest", strain, "p50", "p99", "max")),
        ("threads", _figures("{} warp, {} weft, {} bias p99", threads, "warp", "weft", "bias")),
        ("penetration", _figures("{} mm deepest, {} mm p99.9", penetration, "max", "p999")),
        ("crossings", _figures("{} pairs of faces", report.get("crossings") or {}, "pairs")),
        ("iterations", _figures("{}, {} a second", report, "iterations", "iterations_per_second")),
        ("relaxed in", _figures("{} s on " + str(report.get("device")), seconds, "relax")),
    ]
    from warp_cloth.report.advice import notes_of

    rows += [("note", note) for note in notes_of(report)]
    lines += [f"  {label:<12} {text}" for label, text in rows if text]
    return lines + [f"  wrote        {path}" for path in paths]


def _figures(text: str, values: Mapping[str, Any], *keys: str) -> str:
    """The text with the figures filled in; nothing if none is known."""
    found = [values.get(key) for key in keys]
    found = [None if isinstance(value, float) and not math.isfinite(value) else value for value in found]
    if all(value is None for value in found):
        return ""
    from warp_cloth.report.numbers import short_number

    return text.format(*("?" if v is None else f"{v:,}" if isinstance(v, int) else short_number(v) for v in found))


def _fit(scene: Scene, device: str | None, frames: int, maps: Sequence[str], start: Path | None) -> Fit:
    from rich.console import Console

    from warp_cloth.cli.fit_progress import ProgressDisplay
    from warp_cloth.fitting.fit import fit as run

    with ProgressDisplay(Console(stderr=True)) as display:
        return run(scene, device=device, frames=frames, maps=maps, start=start, progress=display)
