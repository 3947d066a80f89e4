"""Writes all files of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from warp_cloth.base.clock import StageClock
from warp_cloth.base.threads import one_thread_at_a_time
from warp_cloth.export.formats import FORMATS, check_inputs_kept
from warp_cloth.export.map_picture import ON_PANELS, MapPictures
from warp_cloth.export.override import write_override
from warp_cloth.export.picture_head import Head
from warp_cloth.export.preview import preview_image, save_picture
from warp_cloth.export.report import check_writable, result_paths, write_map, write_report
from warp_cloth.export.report_page import write_report_page
from warp_cloth.export.sources import patterned, staged_garments
from warp_cloth.maps.kinds import MAPS
from warp_cloth.maps.measure import add_girths
from warp_cloth.model.result import FitResult
from warp_cloth.report.shown import ease_lines, shown_verdict

PICTURE_SIZE = (1800, 900)  # [px]


def write_preview(path: Path, fit: FitResult) -> None:
    """Writes a PNG of the garments as placed and as worn."""
    image = preview_image(
        garments=fit.garments,
        avatar=fit.avatar,
        device=fit.device,
        head=head_of(fit),
        problems=[problem for problem in fit.problems if not problem.code.is_note],
        size=PICTURE_SIZE,
        placed=True,
        facing=fit.facing,
    )
    save_picture(image, path)


@one_thread_at_a_time
def save_fit(fit: FitResult, folder: Path, *, colour: str, formats: Sequence[str]) -> list[Path]:
    """Writes the files that ``Fit.save`` lists; the report last."""
    scene = fit.scene
    check_writable(folder, scene.name)
    clock = StageClock(seconds=fit.report["seconds"])
    clock.seconds.update(dict.fromkeys(("export", "picture", "page"), 0.0))  # of an earlier call
    _, picture, page, report = result_paths(folder, scene.name)
    check_inputs_kept(scene, folder, formats)
    add_girths(fit)
    clock.lap("measure")
    report.unlink(missing_ok=True)  # of an earlier run: it would vouch for an incomplete result if this one is killed
    paths = write_meshes(fit, folder, colour=colour, formats=formats)
    clock.lap("export")
    write_preview(picture, fit)
    paths += [picture, report]
    for name in set(MAPS) - set(fit.map_ranges):  # of an earlier run: they would be taken for this one's
        for ending in (".png", f"{ON_PANELS}.png", f"{ON_PANELS}.svg"):
            (folder / f"map_{name}{ending}").unlink(missing_ok=True)
    pictures = {"preview": picture}
    if fit.map_ranges:
        from warp_cloth.export.panel_map import PanelMaps  # and with it the package of patterns, which takes 0.04 s

        drawer = MapPictures(fit.garments, fit.avatar, device=fit.device, facing=fit.facing)
        flat = PanelMaps.of([fit.garments[index] for index in patterned(scene)])
        for name, bounds in fit.map_ranges.items():
            pictures[name] = folder / f"map_{name}.png"
            drawer.write(pictures[name], MAPS[name], bounds)
            paths.append(pictures[name])
            paths += [] if flat is None else flat.write(folder / f"map_{name}{ON_PANELS}", MAPS[name], bounds)
    for worn in fit.garments:
        path = folder / f"{scene.name}_{worn.name}_map.npz"
        paths += [path] if write_map(path, worn.mesh) else []
    clock.lap("picture")
    write_report_page(page, scene.name, fit.report, pictures)
    paths.insert(paths.index(report) + 1, page)
    clock.lap("page")
    write_report(report, fit.report)
    return paths


def head_of(fit: FitResult) -> Head:
    """What the picture of a fit says above it."""
    return Head(fit.scene.name, shown_verdict(fit.report), ease_lines(fit.report), fit.message)


def write_meshes(fit: FitResult, folder: Path, *, colour: str = "", formats: Sequence[str] = ("usdc",)) -> list[Path]:
    """Writes the worn garments in every format, and the layer over the user's stage."""
    check_inputs_kept(fit.scene, folder, formats)
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for suffix in formats:
        paths += FORMATS[suffix](fit, folder / f"{fit.scene.name}.{suffix}", colour)
    staged = staged_garments(fit)
    if staged:
        path = folder / f"{fit.scene.name}_over.usda"
        write_override(path, staged, ranges=fit.map_ranges, colour=colour)
        paths.append(path)
    return paths
