"""Which files a fit's meshes came from: patterns, and USD stages that its own stage refers to."""

from __future__ import annotations

from pathlib import Path

from warp_cloth.base import mesh_formats
from warp_cloth.export.override import StagedGarment
from warp_cloth.export.reference import AvatarAsset
from warp_cloth.loading.usd import mesh_paths_of
from warp_cloth.model.result import FitResult
from warp_cloth.scene import Scene


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
    return isinstance(file, Path) and file.suffix.lower() in mesh_formats.USD
