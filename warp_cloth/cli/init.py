"""The command that writes a scene file: ``warp-cloth init``."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import FabricName
from warp_cloth.cli.terminal import one_line_errors


def init(
    garment: Annotated[Path, typer.Argument(help="The garment's mesh or pattern.")],
    on: Annotated[str, typer.Option(metavar="BODY", help="Body's mesh file, or mannequin.")],
    fabric: FabricName = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Scene file to write.", show_default="GARMENT.toml, here")
    ] = None,
) -> None:
    """Write a scene file for a garment on a body, with comments, to go on from.

    \b
    warp-cloth init shirt.obj --on body.obj --fabric jersey
    """
    with one_line_errors("on", "fabric"):
        from warp_cloth.garment.outfit import load_outfit
        from warp_cloth.loading.sizes import was_guessed
        from warp_cloth.scene import load_scene
        from warp_cloth.scene.draft import draft_text
        from warp_cloth.scene.worn_on import worn_on

        start_warp()
        file = out or Path(f"{garment.stem}.toml")
        _check_free(file)
        scene = load_scene(garment, on=on, fabric=fabric)
        outfit = load_outfit(scene)
        values, _ = worn_on(garment, on, fabric)
        meshes = [mesh for mesh in (*outfit.meshes, outfit.avatar) if mesh is not None]
        units = [mesh.unit if was_guessed(mesh) else "" for mesh in meshes]
        text = draft_text(values, file, units, [mesh.notes for mesh in meshes])
        try:
            with file.open("x", encoding="utf-8") as written:
                written.write(text)
        except FileExistsError:
            _check_free(file)
    typer.echo(f"wrote {file}; fit it: warp-cloth fit {shlex.quote(str(file))}")


def _check_free(file: Path) -> None:
    """Refuses a file that is there, or whose name or folder cannot be a scene file's."""
    if file.suffix.lower() != ".toml":
        raise InputError("out", f"{file} is not the name of a scene file", "let it end in .toml")
    if file.exists() or file.is_symlink():
        raise InputError(file, "is there already", "remove it, or write another one: --out OTHER.toml")
    if not file.parent.is_dir():
        raise InputError(file, "its folder does not exist", "make it first")
