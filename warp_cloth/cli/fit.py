"""The command that fits garments: ``warp-cloth fit``.

A command has as many parameters as it has options; that is not a function of too many arguments.
"""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from warp_cloth.base.clock import command_clock
from warp_cloth.base.collector import collector_paused
from warp_cloth.base.device import begin_waking
from warp_cloth.base.first_run import FIRST_RUN, is_first_run
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import (
    Changes,
    Colour,
    Device,
    EarlierResult,
    FabricName,
    Formats,
    Frames,
    LetDown,
    Maps,
    On,
)
from warp_cloth.cli.terminal import NOT_WORN, made, one_line_errors, output_folder, say

if TYPE_CHECKING:
    from warp_cloth.base.clock import StageClock
    from warp_cloth.cli.fit_progress import ProgressDisplay
    from warp_cloth.fitting.fit import Fit
    from warp_cloth.scene import Scene

# The first library of USD to be loaded waits for Python's lock while it holds the loader's, and NumPy, which holds the
# first, waits for the second as it divides large arrays: loaded meanwhile it could stop the command for ever.
USD = "pxr.Tf"


def fit(
    scene: Annotated[
        str,
        typer.Argument(
            help="Scene file (TOML), USD stage with a garment and an avatar, or the name of a shipped scene "
            "(see `warp-cloth scenes`); with --on, a garment's mesh or pattern, too."
        ),
    ],
    on: On = None,
    fabric: FabricName = None,
    device: Device = None,
    out: Annotated[
        Path, typer.Option(help="Output folder, for NAME.usdc, report.html, report.json and preview.png.")
    ] = Path("out"),
    changes: Changes = None,
    frames: Frames = 0,
    maps: Maps = "",
    colour: Colour = "",
    formats: Formats = "usdc",
    start: EarlierResult = None,
    band: LetDown = False,
    verbose: Annotated[bool, typer.Option("--verbose", help="Show log messages, Warp's included.")] = False,
) -> None:
    """Fit the garments of a scene; write the draped shapes, a report and a picture.

    \b
    Exit status: 0 all garments are worn; 2 bad input; 3 a garment is not worn:
    files are written, and the report says what is wrong.

    \b
    warp-cloth fit shirt.obj --on body.obj --fabric jersey
    warp-cloth fit tshirt --set garment.shape.size=L --maps all --colour gap
    warp-cloth fit stage.usda --set garment.prim=/shirt --set avatar.prim=/body
    """
    with one_line_errors("on", "fabric", "frames"):
        clock = command_clock()
        if is_first_run(device):
            print(FIRST_RUN, file=sys.stderr, flush=True)  # before what is imported takes its time
        begin_waking(device)  # likewise: its driver takes a fraction of a second, without Python's lock
        with collector_paused():
            from warp_cloth.export.formats import check_frames, check_inputs_kept, chosen_formats
            from warp_cloth.maps.kinds import chosen_colour, chosen_maps
            from warp_cloth.scene import load_scene
        clock.lap("import")
        suffixes = chosen_formats(formats)
        check_frames(suffixes, frames=frames > 0, remedy="add --frames 48")
        map_names = chosen_maps(maps, place="--maps")
        colour_map = chosen_colour(colour, place="--colour")
        map_names = (*map_names, colour_map)
        chosen = load_scene(scene, changes or (), on=on, fabric=fabric)
        check_inputs_kept(chosen, out, suffixes)
        clock.lap("load")
        with output_folder(out, chosen.name), _display() as display:
            with collector_paused():
                import_module("warp")
            clock.lap("import")
            start_warp(verbose)
            clock.lap("warp")
            wanted = {"device": device, "frames": frames, "maps": map_names, "start": start, "band": band}
            worn = _fitted(chosen, wanted, clock, display)
            display.begin("export")
            paths = worn.save(out, colour=colour_map, formats=suffixes)
    say(summary(chosen.name, worn.report, paths))
    if not worn.worn:
        raise typer.Exit(NOT_WORN)


def _fitted(scene: Scene, wanted: Mapping[str, Any], clock: StageClock, show: Callable[[Any], None]) -> Fit:
    """The fit of a scene; its report says what the whole command took, and what was typed."""
    with collector_paused():
        from warp_cloth.fitting.fit import fit as run
    clock.lap("import")
    export = _Meanwhile("warp_cloth.export.save", show)
    worn = run(scene, **wanted, progress=export)
    clock.restart()
    export.wait()
    clock.lap("import")
    clock.add_to(worn.report.setdefault("seconds", {}))
    worn.report["made"] = made()
    return worn


class _Meanwhile:
    """Imports a module while kernels are loaded and the fit relaxes, mostly without Python; passes its progress on."""

    def __init__(self, module: str, show: Callable[[Any], None]) -> None:
        self._module, self._show = module, show
        self._thread: threading.Thread | None = None

    def __call__(self, step: Any) -> None:
        if step.stage in ("compile", "relax") and self._thread is None:
            import_module(USD)
            self._thread = threading.Thread(target=import_module, args=[self._module], daemon=True)
            self._thread.start()
        self._show(step)

    def wait(self) -> None:
        """Ends with the import."""
        if self._thread is not None:
            self._thread.join()
        import_module(self._module)  # which raises what went wrong there


def _display() -> ProgressDisplay:
    from rich.console import Console

    from warp_cloth.cli.fit_progress import ProgressDisplay

    return ProgressDisplay(Console(stderr=True))


def summary(name: str, report: Mapping[str, Any], paths: list[Path]) -> list[str]:
    """A fit in a few lines: its message, the certificate's main figures, the files written."""
    from warp_cloth.report.notes import notes_of
    from warp_cloth.report.numbers import shown_choice
    from warp_cloth.report.rows import row, wrote_rows
    from warp_cloth.report.shown import ease_lines, fitted_lines, shown_verdict

    residual, strain = report.get("residual") or {}, report.get("strain") or {}
    yarns = {direction: strain[direction]["p99"] for direction in ("warp", "weft", "bias") if direction in strain}
    penetration, seconds = report.get("penetration_mm") or {}, report.get("seconds") or {}
    lines = [f"{name}: {shown_verdict(report).words}. {report.get('message') or report.get('status', 'unknown')}"]
    rows = [("fitted", line) for line in fitted_lines(report)]
    rows += [("ease", line) for line in ease_lines(report)]
    rows += [
        ("residual", _filled("{} relative rms, {} p99", residual, "relative_rms", "relative_p99")),
        ("rest error", _filled("{} mm", report, "rest_error_mm")),
        ("let down", _band(report.get("friction_band"))),
        ("strain", _filled("{} median, {} p99, {} max", _percents(strain), "p50", "p99", "max")),
        ("yarn strain", _filled("{} warp, {} weft, {} bias (p99)", _percents(yarns), "warp", "weft", "bias")),
        ("penetration", _filled("{} mm max, {} mm p99.9", penetration, "max", "p999")),
        ("crossings", _filled("{} pairs of faces", report.get("crossings") or {}, "pairs")),
        ("iterations", _filled("{} ({} per second)", report, "iterations", "iterations_per_second")),
        ("time", _filled("{} s on " + str(report.get("device")), seconds, "relax")),
    ]
    rows += [
        ("problem", f"{each['code']}: {each['message']} {each['remedy']}") for each in report.get("problems") or ()
    ]
    chosen = [f"{choice['key']} = {shown_choice(choice['value'])}" for choice in report.get("choices") or ()]
    rows.append(("chosen", ", ".join(chosen)))
    rows += [("note", note) for note in notes_of(report)]
    return [*lines, *(row(label, text) for label, text in rows if text), *wrote_rows(paths)]


def _band(band: Mapping[str, Any] | None) -> str:
    """Where the garments rest once let down from the hang."""
    if band is None:
        return ""
    ended = band["status"].replace("_", " ")
    apart = _filled("{} mm away (median), {} mm p95, {} mm max", band["apart_mm"], "p50", "p95", "max")
    return f"{ended}, {apart}, rest error {_shown(band['rest_error_mm'])} mm"


def _percents(strains: Mapping[str, Any]) -> dict[str, Any]:
    """Strains in per cent of the length at rest; what is no finite number is not known."""
    from warp_cloth.report.shown import percent

    numbers = {name: value for name, value in strains.items() if isinstance(value, float) and math.isfinite(value)}
    return {name: percent(value) for name, value in numbers.items()}


def _filled(text: str, values: Mapping[str, Any], *keys: str) -> str:
    """The text with these values filled in; empty if none of them is known."""
    found = [values.get(key) for key in keys]
    found = [None if isinstance(value, float) and not math.isfinite(value) else value for value in found]
    if all(value is None for value in found):
        return ""
    return text.format(*map(_shown, found))


def _shown(value: Any) -> str:
    from warp_cloth.report.numbers import short_number

    if value is None:
        return "?"
    return value if isinstance(value, str) else f"{value:,}" if isinstance(value, int) else short_number(value)
