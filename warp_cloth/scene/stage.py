"""A USD stage as a scene: its surface deformables are the garments, its other colliders the avatar."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from warp_cloth.base.errors import InputError


def stage_values(path: Path) -> dict[str, Any]:
    """Scene values of a stage whose garments have the surface-deformable physics schema.

    Of a stage without it, garment and avatar name only the file: overrides must add their prims.

    Raises:
        InputError: the stage cannot be opened, or has no avatar because a reference is broken.
    """
    from warp_cloth.loading.usd import opened_stage
    from warp_cloth.loading.usd_physics import collision_meshes, common_ancestor, staged_cloths
    from warp_cloth.loading.usd_units import lost_references

    with opened_stage(str(path)) as stage:
        cloths = staged_cloths(stage)
        if not cloths:
            return {"garment": {"mesh": path.name}, "avatar": {"mesh": path.name}}
        garments = [
            {
                "name": cloth.name,
                "mesh": path.name,
                "prim": cloth.path,
                "rest": "physics" if cloth.has_rest else "mesh",
                "rest_angles": "physics" if cloth.has_folds else "flat",
                "fabric": cloth.fabric or "default",
            }
            for cloth in cloths
        ]
        if len({garment["name"] for garment in garments}) < len(garments):
            for garment in garments:
                garment.pop("name")
        values: dict[str, Any] = {"garment": garments}
        others = collision_meshes(stage, cloths)
        lost = lost_references(stage)
        if lost and not others:
            raise InputError(path, f"there is no avatar: {lost}", "correct the path")
        if others:
            prim = common_ancestor(others, [cloth.path for cloth in cloths], path)
            values["avatar"] = {"mesh": path.name, "prim": prim}
    return values


def has_garments(path: Path) -> bool:
    """Whether a stage has garments, by the surface-deformable physics schema.

    Raises:
        InputError: the stage cannot be opened.
    """
    from warp_cloth.loading.usd import opened_stage
    from warp_cloth.loading.usd_physics import staged_cloths

    with opened_stage(str(path)) as stage:
        return bool(staged_cloths(stage))


def check_prims(values: dict[str, Any], path: Path) -> None:
    """Refuses a stage without the physics schema unless garment and avatar prims are given."""
    garment, avatar = values.get("garment"), values.get("avatar")
    if isinstance(garment, list) or not isinstance(garment, dict):
        return
    lacking = [
        f"override {key}.prim=PATH"
        for key, table in (("garment", garment), ("avatar", avatar))
        if isinstance(table, dict) and table.get("mesh") == path.name and not table.get("prim")
    ]
    if lacking:
        from warp_cloth.loading.usd import mesh_paths_of

        meshes = ", ".join(mesh_paths_of(str(path))[:6])
        problem = f"no mesh of the stage is a surface deformable; its meshes: {meshes or 'none'}"
        raise InputError(path, problem, f"{' and '.join(lacking)}")
