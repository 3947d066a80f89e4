"""The file formats of a fit, each with what writes it, and what is checked of them before the work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING

from warp_cloth.base.arguments import strings
from warp_cloth.base.errors import InputError
from warp_cloth.scene import Scene

if TYPE_CHECKING:
    from warp_cloth.model.result import FitResult

Writer = Callable[["FitResult", Path, str], list[Path]]  # (fit, file, map of its colours or ""): what it wrote


def _stage(fit: FitResult, path: Path, colour: str) -> list[Path]:
    from warp_cloth.export.sources import avatar_asset, patterned
    from warp_cloth.export.stage import StageAvatar, write_stage

    avatar = None if fit.avatar is None else StageAvatar(fit.avatar, avatar_asset(fit.scene), fit.avatar_frames)
    write_stage(
        path,
        garments=fit.garments,
        avatar=avatar,
        name=fit.scene.name,
        ranges=fit.map_ranges,
        colour=colour,
        flat=patterned(fit.scene),
    )
    return [path]


def _glb(fit: FitResult, path: Path, colour: str) -> list[Path]:
    from warp_cloth.export.meshes import write_glb

    write_glb(path, garments=fit.garments, avatar=fit.avatar, ranges=fit.map_ranges, colour=colour)
    return [path]


def _obj(fit: FitResult, path: Path, colour: str) -> list[Path]:
    from warp_cloth.export.meshes import write_obj

    return [write_obj(path, garments=fit.garments), path]


def _point_caches(fit: FitResult, path: Path, colour: str) -> list[Path]:
    from warp_cloth.export.point_cache import BODY, write_point_caches

    moves = {} if fit.avatar_frames is None else {BODY: fit.avatar_frames}
    return write_point_caches(path, garments=fit.garments, others=moves)


FORMATS: dict[str, Writer] = {
    "usdc": _stage,
    "usda": _stage,
    "usdz": _stage,
    "glb": _glb,
    "obj": _obj,
    "pc2": _point_caches,
}


def chosen_formats(text: str | Sequence[str], *, place: str = "--format") -> tuple[str, ...]:
    """Formats from "usdc,glb", or from a list of such names."""
    requested = [name for part in strings(text, place) for name in part.split(",")]
    names = tuple(dict.fromkeys(name.strip().lstrip(".").lower() for name in requested if name.strip()))
    unknown = [name for name in names if name not in FORMATS]
    if unknown or not names:
        raise InputError(
            place, f'"{", ".join(unknown)}" is not a supported format', f"choose from {', '.join(FORMATS)}"
        )
    return names


def check_frames(formats: Sequence[str], *, frames: bool, place: str = "--format", remedy: str) -> None:
    """Refuses a point cache where no intermediate shapes are kept."""
    if "pc2" in formats and not frames:
        raise InputError(place, "pc2 holds intermediate shapes, and there are none", remedy)


def check_inputs_kept(scene: Scene, folder: Path, formats: Sequence[str]) -> None:
    """Refuses a folder in which a file of the scene would be overwritten."""
    written = {folder / f"{scene.name}.{suffix}" for suffix in formats} | {folder / f"{scene.name}_over.usda"}
    places = {realpath(path) for path in written}  # unlike Path.resolve, circular links are no error
    avatar = scene.avatar.mesh if scene.avatar is not None else None
    for file in (*(spec.file for spec in scene.garments), avatar):
        if isinstance(file, Path) and realpath(file) in places:
            raise InputError(
                folder, f"{file.name}, which the scene reads, would be overwritten", "choose another folder"
            )
