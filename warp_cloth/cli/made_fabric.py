"""``warp-cloth fabric --from-drape``, ``--drape-coefficient`` and ``compare``: fabrics made and set side by side."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.drape_options import DrapeTest
from warp_cloth.cli.terminal import output_folder
from warp_cloth.material.fabric import Fabric, resolve_fabric
from warp_cloth.material.laboratory import (
    KES_BENDING,
    KES_FORCE,
    KES_SHEAR,
    MATCHED_SHEAR_ANGLE,
    bending_length,
    rigidity_of_bending,
)
from warp_cloth.report.rows import note_rows

MOST_PHOTOGRAPHS = 100


def make_fabric(test: DrapeTest, further: Sequence[str], out: Path, device: str) -> tuple[list[str], list[Path]]:
    """Lines to print and files written of a fabric that is made from a drape test; ``further`` photographs of it.

    Raises:
        InputError: an option or a photograph is wrong.
    """
    photographs = [] if test.from_drape is None else [test.from_drape, *map(Path, further)]
    _check(test, photographs, out)
    known = _known(test.base)
    fabric = replace(known, name=out.stem, weight=1e-3 * (test.weight_gsm or 0.0))
    with output_folder(out.parent, out.stem):
        start_warp(False)
        from warp_cloth.base.device import device_named
        from warp_cloth.drape.made import fabric_of_numbers, fabric_of_readings, rigidities
        from warp_cloth.drape.reading import Setting, read_drape
        from warp_cloth.drape.save import save_fabric
        from warp_cloth.drape.table import KNOWN_CLASS, UNKNOWN_CLASS, drapes_of_ratio

        scale = None if test.mm_per_pixel is None else 1e-3 * test.mm_per_pixel
        camera = None if test.camera_mm is None else 1e-3 * test.camera_mm
        setting = Setting(5e-4 * test.support_mm, 5e-4 * test.disc_mm, test.warp_degrees, scale, camera)
        drapes_of_ratio(setting.ratio)
        rest_error = UNKNOWN_CLASS if test.base is None else KNOWN_CLASS
        where, lines = device_named(device), []

        def progress(text: str) -> None:
            print(text, file=sys.stderr)

        readings = [read_drape(path, setting) for path in photographs]
        if readings:
            made = fabric_of_readings(readings, fabric, setting, device=where, rest_error=rest_error, progress=progress)
        else:
            made = fabric_of_numbers(
                test.drape_coefficient or 0.0,
                test.folds,
                fabric,
                setting,
                device=where,
                rest_error=rest_error,
                progress=progress,
            )
        for reading in readings:
            shape = reading.outline
            depths = [1e3 * setting.support * depth for depth in shape.depths] or [0.0]
            lines.append(
                f"{reading.photograph.path.name}: drape coefficient {reading.coefficient:.1f} +- "
                f"{reading.error:.1f} %, "
                f"{shape.folds} folds, {min(depths):.0f} to {max(depths):.0f} mm deep, "
                f"elongation along the warp {shape.elongation:+.3f}"
            )
            lines += note_rows(reading.notes)
        warp, weft = rigidities(made.fabric, made.estimate, setting.support)
        mean_error, error = (100.0 * value for value in made.rigidity_errors)
        lines.append(
            f"{out.stem}: bending B {warp:.3g} along the warp, {weft:.3g} along the weft [gf cm2/cm], "
            f"+- {error:.0f} % each, +- {mean_error:.0f} % in the mean"
        )
        lines += note_rows(
            [
                f"real fabrics draped again differ by {made.again:.1f} points (typical standard deviation), which is "
                f"{100.0 * made.again_error:.0f} % of B more; several photographs of fresh drapes tell it better"
            ]
        )
        if test.base is None:
            lines += note_rows(["stretch and shear are the generic fabric's; --base NAME takes those of a like cloth"])
        lines += note_rows(made.notes)
        return lines, save_fabric(made, readings, setting, _source(test, photographs, known), out)


def _source(test: DrapeTest, photographs: Sequence[Path], base: Fabric) -> str:
    seen = ", ".join(path.name for path in photographs) or f"drape coefficient {test.drape_coefficient:g} %"
    return f"warp-cloth fabric from {seen}; stretch, shear, thickness and friction of {base.name}"


def _known(name: str | None) -> Fabric:
    try:
        return resolve_fabric("default" if name is None else name)
    except InputError as error:
        raise InputError(error.place or "--base", error.problem, error.remedy) from None


def _check(test: DrapeTest, photographs: Sequence[Path], out: Path) -> None:
    test.check()
    if len(photographs) > MOST_PHOTOGRAPHS:
        raise InputError("--from-drape", f"takes at most {MOST_PHOTOGRAPHS} photographs", "leave some out")
    if out.suffix.lower() != ".toml":
        raise InputError("--out", f"must be a fabric file, NAME.toml, not {out.name!r}", "for instance mine.toml")


def comparison(names: list[str]) -> list[str]:
    """Lines of a table of two fabrics in laboratory units.

    Raises:
        InputError: there are not two of them, or one is unknown.
    """
    if len(names) != 2:
        raise InputError("fabric compare", f"takes two fabrics, not {len(names)}", "for instance compare denim silk")
    first, second = (_known(name) for name in names)
    rows = [("", "unit", first.name, second.name, "ratio")]
    for (name, unit, a), (_, _, b) in zip(_figures(first), _figures(second), strict=True):
        left, right = (("edges" if value is None else f"{value:.3g}") for value in (a, b))
        rows.append((name, unit, left, right, f"{b / a:.2f}" if a and b is not None else ""))
    widths = [max(len(row[column]) for row in rows) for column in range(5)]
    return [
        "  ".join(
            [row[0].ljust(widths[0]), row[1].ljust(widths[1]), *(row[i].rjust(widths[i]) for i in (2, 3, 4))]
        ).rstrip()
        for row in rows
    ]


def _figures(fabric: Fabric) -> list[tuple[str, str, float | None]]:
    warp, weft = (rigidity_of_bending(each, fabric.weight) for each in (fabric.bending_warp, fabric.bending_weft))
    shear = None if fabric.shear is None else fabric.shear * MATCHED_SHEAR_ANGLE / KES_SHEAR
    return [
        ("weight", "g/m2", 1e3 * fabric.weight),
        ("EMT warp", "%", 100.0 * (KES_FORCE / fabric.stretch_warp) ** 0.5),
        ("EMT weft", "%", 100.0 * (KES_FORCE / fabric.stretch_weft) ** 0.5),
        ("G", "gf/(cm deg)", shear),
        ("B warp", "gf cm2/cm", warp / KES_BENDING),
        ("B weft", "gf cm2/cm", weft / KES_BENDING),
        ("bending length warp", "mm", 1e3 * bending_length(warp, fabric.weight)),
        ("bending length weft", "mm", 1e3 * bending_length(weft, fabric.weight)),
        ("thickness", "mm", 1e3 * fabric.thickness),
        ("friction", "", fabric.friction),
    ]
