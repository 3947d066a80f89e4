"""Writes all files of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from warp_cloth.base.clock import StageClock
from warp_cloth.base.threads import one_thread_at_a_time
from warp_cloth.export import stage
from warp_cloth.export.formats import check_inputs_kept
from warp_cloth.export.map_picture import ON_PANELS, MapPictures
from warp_cloth.export.override import StagedGarment, write_override
from warp_cloth.export.picture_head import Head
from warp_cloth.export.preview import preview_image, save_picture
from warp_cloth.export.reference import AvatarAsset
from warp_cloth.export.report import check_writable, result_paths, write_map, write_report
from warp_cloth.export.report_page import write_report_page
from warp_cloth.loading.usd import mesh_paths_of
from warp_cloth.maps.kinds import MAPS
from warp_cloth.maps.measure import add_girths
from warp_cloth.model.result import FitResult
from warp_cloth.report.shown import ease_lines, shown_verdict
from warp_cloth.scene import Scene
from warp_cloth.scene.stage import USD_SUFFIXES

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
    ranges = fit.maps.ranges if fit.maps is not None else {}
    paths = write_meshes(fit, folder, colour=colour, formats=formats)
    clock.lap("export")
    write_preview(picture, fit)
    paths += [picture, report]
    for name in set(MAPS) - set(ranges):  # of an earlier run: they would be taken for this one's
        for ending in (".png", f"{ON_PANELS}.png", f"{ON_PANELS}.svg"):
            (folder / f"map_{name}{ending}").unlink(missing_ok=True)
    pictures = {"preview": picture}
    if ranges:
        from warp_cloth.export.panel_map import PanelMaps  # and with it the package of patterns, which takes 0.04 s

        drawer = MapPictures(fit.garments, fit.avatar, device=fit.device)
        flat = PanelMaps.of([fit.garments[index] for index in patterned(scene)])
        for name, bounds in ranges.items():
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
    from warp_cloth.export.meshes import write_glb, write_obj
    from warp_cloth.export.point_cache import BODY, write_point_caches

    check_inputs_kept(fit.scene, folder, formats)
    ranges = fit.maps.ranges if fit.maps is not None else {}
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for suffix in formats:
        path = folder / f"{fit.scene.name}.{suffix}"
        if suffix == "glb":
            write_glb(path, garments=fit.garments, avatar=fit.avatar, ranges=ranges, colour=colour)
        elif suffix == "obj":
            paths.append(write_obj(path, garments=fit.garments))
        elif suffix == "pc2":
            moves = {BODY: fit.avatar_frames} if fit.avatar_frames is not None else {}
            paths += write_point_caches(path, garments=fit.garments, others=moves)
            continue
        else:
            stage.write_stage(
                path,
                garments=fit.garments,
                avatar=fit.avatar and stage.StageAvatar(fit.avatar, avatar_asset(fit.scene), fit.avatar_frames),
                name=fit.scene.name,
                ranges=ranges,
                colour=colour,
                flat=patterned(fit.scene),
            )
        paths.append(path)
    staged = staged_garments(fit)
    if staged:
        path = folder / f"{fit.scene.name}_over.usda"
        write_override(path, staged, ranges=ranges, colour=colour)
        paths.append(path)
    return paths


def patterned(scene: Scene) -> tuple[int, ...]:
    """The garments that are sewn from a pattern, by their place in the scene."""
    return tuple(index for index, spec in enumerate(scene.garments) if spec.pattern is not None)


def avatar_asset(scene: Scene) -> AvatarAsset | None:
    """The USD file that the avatar came from; None if it came from none."""
    avatar = scene.avatar
    if avatar is None or not _is_stage(avatar.mesh):
        return None
    file = Path(str(avatar.mesh))
    worn = [
        path
        for garment in scene.garments
        if _is_stage(garment.mesh) and Path(str(garment.mesh)).resolve() == file.resolve()
        for path in mesh_paths_of(str(file), garment.prim, "garment")
    ]
    meshes = mesh_paths_of(str(file), avatar.prim, "avatar")
    return AvatarAsset(file, tuple(meshes), tuple(worn), avatar.units)


def staged_garments(fit: FitResult) -> list[StagedGarment]:
    """The garments that came from the same USD file as the first; none if it came from no USD file."""
    specs = fit.scene.garments
    if not _is_stage(specs[0].mesh):
        return []
    file = Path(str(specs[0].mesh))
    return [
        StagedGarment(worn, file, tuple(mesh_paths_of(str(file), spec.prim, "garment")), spec.units)
        for spec, worn in zip(specs, fit.garments, strict=True)
        if spec.mesh is not None and spec.mesh.resolve() == file.resolve()
    ]


def _is_stage(file: object) -> bool:
    return isinstance(file, Path) and file.suffix.lower() in USD_SUFFIXES
