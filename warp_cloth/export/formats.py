"""File formats of a fit, and a check that no input would be overwritten; both before the work."""

from __future__ import annotations

from collections.abc import Sequence
from os.path import realpath
from pathlib import Path

from warp_cloth.base.arguments import strings
from warp_cloth.base.errors import InputError
from warp_cloth.scene import Scene

FORMATS = ("usdc", "usda", "usdz", "glb", "obj", "pc2")


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
