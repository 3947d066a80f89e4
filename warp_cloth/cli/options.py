"""Options that several commands share, and options that a command takes together."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

SceneName = Annotated[
    str,
    typer.Argument(
        help="Scene file (TOML), or the name of a shipped scene (see `warp-cloth scenes`); with --on, a garment's mesh "
        "or pattern, too."
    ),
]
On = Annotated[
    str | None,
    typer.Option(
        metavar="BODY",
        help="What wears the garments: a body's mesh file, or mannequin; in place of the scene's avatar.",
    ),
]
FabricName = Annotated[
    str | None,
    typer.Option(
        "--fabric", metavar="FABRIC", help="Of all garments: a name (see `warp-cloth scenes`) or a .toml file."
    ),
]
Device = Annotated[str | None, typer.Option(help="cpu, cuda or cuda:N.", show_default="a GPU if there is one")]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Override a scene key, such as garment.fabric=denim. May be repeated."
    ),
]
Maps = Annotated[
    str, typer.Option(help="Fit maps, separated by commas: strain, pressure, gap, a single one (strain_warp), or all.")
]
Frames = Annotated[int, typer.Option(help="Intermediate shapes to store as time samples of the stage.")]
Colour = Annotated[str, typer.Option(help="The map that colours the garments in the stage.")]
Formats = Annotated[
    str, typer.Option("--format", help="File formats, separated by commas: usdc, usda, usdz, glb, obj, pc2.")
]
EarlierResult = Annotated[
    Path | None,
    typer.Option("--from", metavar="RESULT", help="Start from an earlier result: its .usdc, .obj or .glb file."),
]
LetDown = Annotated[
    bool,
    typer.Option(
        "--band", help="Fit twice, the second time let down from above: friction can hold cloth anywhere between."
    ),
]


def with_options_of(group: type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Makes an option of each field of a dataclass, which a command takes as its last argument."""
    fields = inspect.signature(group, eval_str=True).parameters

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        *own, taken = inspect.signature(command, eval_str=True).parameters.values()

        @functools.wraps(command)
        def run(**options: Any) -> None:
            together = group(**{name: options.pop(name) for name in fields})
            command(**options, **{taken.name: together})

        parameters = [*own, *fields.values()]
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return decorate
