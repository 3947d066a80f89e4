"""Commands that explore what a scene is made of: ``warp-cloth scenes``, ``pattern`` and ``avatar``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from warp_cloth.base import mesh_formats
from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import Changes, Device
from warp_cloth.cli.terminal import NOT_WORN, can_plot, one_line_errors, output_folder, say
from warp_cloth.report.rows import LABEL, note_rows, wrote_rows


def scenes(
    keys: Annotated[
        str | None,
        typer.Option(metavar="WORD", help="List keys of scene files instead: those that contain this word, or all."),
    ] = None,
) -> None:
    """List the shipped scenes and fabrics, or the keys of a scene file.

    \b
    warp-cloth scenes
    warp-cloth scenes --keys garment.shape
    warp-cloth scenes --keys all
    """
    with one_line_errors("keys"):
        if keys is not None:
            _list_keys(keys)
            return
        from warp_cloth.material.fabric import shipped_fabrics
        from warp_cloth.scene import describe_scene, shipped_scenes

        typer.echo("Scenes:")
        for name, path in shipped_scenes().items():
            say([f"  {name:<{LABEL}} {describe_scene(path)}"])
        typer.echo("Fabrics (stretch and bending: along warp and weft):")
        for name, fabric in shipped_fabrics().items():
            line = (
                f"  {name:<{LABEL}} {fabric.weight * 1e3:4.0f} g/m2  stretch {fabric.stretch_warp / 1e3:5.1f} and "
                f"{fabric.stretch_weft / 1e3:5.1f} kN/m  bending {fabric.bending_warp:.1e} and "
                f"{fabric.bending_weft:.1e} N m2  thickness {fabric.thickness * 1e3:.2f} mm"
            )
            say([line])


def _list_keys(wanted: str) -> None:
    """Prints the keys that contain a word; "all": every one."""
    from warp_cloth.scene.reference import key_lines

    lines = key_lines("" if wanted == "all" else wanted)
    if not lines:
        raise InputError("keys", f'no key contains "{wanted}"', "see all of them: --keys all")
    say(lines)


def pattern(
    file: Annotated[Path, typer.Argument(help="Sewing pattern: a GarmentCode *_specification.json, or a .dxf.")],
    out: Annotated[
        Path,
        typer.Option(
            help="Output folder, for NAME_pattern.svg and .png, NAME_meshed_specification.json, NAME_seams.toml."
        ),
    ] = Path("out"),
    edge_mm: Annotated[
        float | None, typer.Option(help="Edge length of the mesh, in mm.", min=2.0, max=60.0, show_default="15")
    ] = None,
    size: Annotated[
        str | None, typer.Option(help="Size of a .dxf with several.", show_default="the sample's, or the middle one")
    ] = None,
    seam_allowance_mm: Annotated[
        float, typer.Option(help="Seam allowance of pieces of a .dxf that have no sew line, in mm.", min=0.0, max=100.0)
    ] = 0.0,
) -> None:
    """Draw a pattern: its panels in millimetres, with numbered edges and the stitches that sew them.

    The specification is written with our mesh of it, for other tools. Of a .dxf, which has no seams, NAME_seams.toml
    proposes them, each with a confidence: a scene to go on from.

    \b
    warp-cloth pattern dress_specification.json --out drawn
    warp-cloth pattern shirt.dxf --size L --out drawn
    """
    with one_line_errors():
        from warp_cloth.loading.raw import counted
        from warp_cloth.scene.paths import file_stem
        from warp_cloth.scene.wearables import PATTERN_EDGE_MM

        if file.suffix.lower() in mesh_formats.MESHES:
            raise InputError(file, "is a mesh, not a sewing pattern", f"fit it: warp-cloth fit {file} --on BODY.obj")
        name = file_stem(file)
        with output_folder(out, f"{name}_pattern"):
            from warp_cloth.pattern import is_drafted

            edge = PATTERN_EDGE_MM if edge_mm is None else edge_mm
            draw = partial(_draw_pieces, size=size, allowance=1e-3 * seam_allowance_mm)
            drawn = (draw if is_drafted(file) else _draw_panels)(file, name, out, 1e-3 * edge)
    vertices = f", {counted(drawn.vertices, 'vertex')} at {edge:g} mm" if drawn.vertices else ""
    typer.echo(f"{name}: {counted(drawn.panels, 'panel')}, {counted(drawn.seams, 'seam')}{vertices}")
    say([*note_rows(drawn.notes), *wrote_rows(drawn.paths)])


class _DrawnPattern(NamedTuple):
    """What was drawn, and the files."""

    panels: int
    seams: int
    vertices: int  # 0: not all is sewn
    notes: Sequence[str]
    paths: Sequence[Path]


def _draw_panels(file: Path, name: str, out: Path, edge: float) -> _DrawnPattern:
    from warp_cloth.export.pattern_json import save_meshed_specification
    from warp_cloth.export.pattern_picture import save_pattern_pictures
    from warp_cloth.pattern import read_pattern, sewn_pattern

    read = read_pattern(file)
    sewn = sewn_pattern(read, name, edge=edge)
    paths = [*save_pattern_pictures(read, name, out), save_meshed_specification(sewn, name, out)]
    return _DrawnPattern(len(read.panels), len(read.stitches), sewn.mesh.vertex_count, sewn.mesh.notes, paths)


def _draw_pieces(file: Path, name: str, out: Path, edge: float, *, size: str | None, allowance: float) -> _DrawnPattern:
    from warp_cloth.export.files import whole_file
    from warp_cloth.export.pattern_json import save_meshed_specification
    from warp_cloth.export.pattern_picture import save_pattern_pictures
    from warp_cloth.pattern import DraftOptions, read_drafted, sewn_pattern
    from warp_cloth.pattern.drafted import drafted_pattern, drawn_pattern, not_joined, unjoined
    from warp_cloth.pattern.seam_table import seam_table

    draft = read_drafted(file, DraftOptions(size, allowance))
    alone = unjoined(draft)
    notes, sewn = [*draft.notes], None
    loose = not_joined(draft)
    if alone:
        notes.append(f'sewn to nothing so far: {", ".join(alone)}; state their seams, or place = "none"')
    elif loose is not None:
        notes.append(f"in parts so far: whether {loose[0]} is sewn to {loose[1]} is not sure; state the seams")
    else:
        sewn = sewn_pattern(drafted_pattern(draft, None), name, edge=edge)
    paths = save_pattern_pictures(drawn_pattern(draft), name, out)
    paths.append(out / f"{name}_seams.toml")
    with whole_file(paths[-1]) as place:
        place.write_text(seam_table(draft, file, out, allowance), encoding="utf-8")
    paths += [] if sewn is None else [save_meshed_specification(sewn, name, out)]
    vertices = 0 if sewn is None else sewn.mesh.vertex_count
    return _DrawnPattern(len(draft.parts), len(draft.joints), vertices, notes, paths)


def avatar(
    body: Annotated[
        str, typer.Argument(help="Mesh of a body, or mannequin, or a scene: its file (TOML), or a shipped one's name.")
    ],
    measures: Annotated[bool, typer.Option("--measures", help="Print a tailor's measures of the body.")] = False,
    colliders: Annotated[
        bool, typer.Option("--colliders", help="Compare every collider of a scene's avatar with its exact mesh.")
    ] = False,
    device: Device = None,
    out: Annotated[
        Path,
        typer.Option(
            help="Output folder, for NAME_body.json and .png; NAME_avatar.json and NAME_walks.png of colliders."
        ),
    ] = Path("out"),
    changes: Changes = None,
    plots: Annotated[bool, typer.Option(help="Plot distances to colliders along lines (needs matplotlib).")] = True,
) -> None:
    """Show what is understood of a body: its limbs, its pose and a tailor's measures.

    \b
    Exit status: 0; 2 bad input; 3 there are no measures, as limbs cannot be identified.

    \b
    warp-cloth avatar body.obj --measures
    warp-cloth avatar tshirt --set avatar.shape.stature=1.9
    warp-cloth avatar scene.toml --colliders --out colliders
    """
    with one_line_errors():
        measured = True
        if colliders:
            lines, paths = _compare_colliders(body, device, out, changes or [], plots)
        else:
            lines, paths, measured = _understand(body, measures, device, out, changes or [])
    say([*lines, *wrote_rows(paths)])
    if measures and not measured:
        raise typer.Exit(NOT_WORN)


def _understand(
    body: str, measures: bool, device: str | None, out: Path, changes: list[str]
) -> tuple[list[str], list[Path], bool]:
    """Lines to print and files written of a body's limbs, pose and measures, and whether there are measures."""
    from warp_cloth.garment.outfit import load_avatar
    from warp_cloth.scene import load_scene
    from warp_cloth.scene.load import scene_of_body

    chosen = scene_of_body(body, changes) or load_scene(body, changes)
    if chosen.avatar is None:
        raise InputError(chosen.name, "the scene has no avatar", "name a scene with one, or the mesh of a body")
    with output_folder(out, chosen.name):
        start_warp(False)
        from warp_cloth.anatomy.person import understand
        from warp_cloth.avatar.solid import closing_of
        from warp_cloth.base.device import device_named
        from warp_cloth.export.body_report import body_lines, save_body

        where = device_named(device)
        loaded = load_avatar(chosen)
        # a scan's holes are closed as for a fit: girths across them are the same
        person = understand(replace(closing_of(loaded).surface(loaded), name=chosen.name))
        return body_lines(person, measures), save_body(person, out, device=where), bool(person.measures)


def _compare_colliders(
    scene: str, device: str | None, out: Path, changes: list[str], plots: bool
) -> tuple[list[str], list[Path]]:
    """Lines to print and files written of a scene's colliders."""
    from warp_cloth.scene import load_scene

    chosen = load_scene(scene, changes)
    with output_folder(out, chosen.name):
        start_warp(False)
        from warp_cloth.base.device import device_named
        from warp_cloth.bench.avatar import run_avatar_bench, save_avatar_bench, table
        from warp_cloth.garment.outfit import load_outfit

        plots = can_plot(plots)
        where = device_named(device)
        found = run_avatar_bench(
            chosen,
            load_outfit(chosen),
            device=where,
            progress=lambda kind: print(f"building {kind}", file=sys.stderr),
        )
        return table(found), save_avatar_bench(found, out, plots=plots)
