"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

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
    typer.Option(metavar="FABRIC", help="Of all garments: a name (see `warp-cloth scenes`) or a .toml file."),
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
