"""Worn garments as GLB and OBJ: vertices in the order of the mesh, for programs without USD."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warp_cloth.base.mesh import Mesh, vertex_normals
from warp_cloth.export.files import whole_file
from warp_cloth.export.surface import AVATAR_COLOUR, cloth_colour, linear, require_sound
from warp_cloth.maps.colour import colours
from warp_cloth.maps.kinds import kind_named
from warp_cloth.model.result import WornGarment

AVATAR_NODE = "_avatar"  # suffix of the name of the avatar's node in a .glb file


def write_glb(
    path: Path,
    *,
    garments: Sequence[WornGarment],
    avatar: Mesh | None,
    ranges: dict[str, tuple[float, float]],
    colour: str = "",
) -> None:
    """Writes all meshes in metres, y up; maps as attributes _NAME, and the map ``colour`` as vertex colours too."""
    import trimesh

    require_sound(garments, avatar)
    scene = trimesh.Scene()
    for index, worn in enumerate(garments):
        mesh = trimesh.Trimesh(
            worn.points,
            worn.mesh.triangles,
            vertex_normals=vertex_normals(worn.points, worn.mesh.triangles),
            process=False,
            validate=False,
            vertex_attributes={f"_{name}": values.astype(np.float32) for name, values in worn.fields.items()},
        )
        kind = kind_named(colour)
        if kind is not None and colour in worn.fields:
            shown = linear(colours(kind, worn.fields[colour], ranges[colour]))  # COLOR_0 is linear light
            mesh.visual = trimesh.visual.ColorVisuals(mesh, vertex_colors=_bytes(shown))
        else:
            base = linear(cloth_colour(index))
            mesh.visual = trimesh.visual.TextureVisuals(material=_material(base))
        scene.add_geometry(mesh, geom_name=worn.name, node_name=worn.name)
    if avatar is not None:
        body = trimesh.Trimesh(avatar.points, avatar.triangles, process=False, validate=False)
        body.visual = trimesh.visual.TextureVisuals(material=_material(linear(AVATAR_COLOUR)))
        scene.add_geometry(body, geom_name=avatar.name, node_name=f"{avatar.name}{AVATAR_NODE}")
    with whole_file(path) as place:
        place.write_bytes(scene.export(file_type="glb"))


def _bytes(colour: np.ndarray) -> np.ndarray:
    return np.round(255.0 * np.column_stack([colour, np.ones(len(colour))])).astype(np.uint8)


def _material(colour: np.ndarray) -> object:
    from trimesh.visual.material import PBRMaterial

    return PBRMaterial(
        baseColorFactor=[*colour.tolist(), 1.0], metallicFactor=0.0, roughnessFactor=0.85, doubleSided=True
    )


def write_obj(path: Path, *, garments: Sequence[WornGarment]) -> None:
    """Writes the garments in metres, y up: an object each, a group for each panel, texture coordinates per corner."""
    require_sound(garments, None)
    lines: list[str] = []
    vertex = texcoord = 1
    for worn in garments:
        mesh = worn.mesh
        lines.append(f"o {_word(worn.name)}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in worn.points.tolist()]
        faces = (mesh.triangles.astype(np.int64) + vertex).astype(str)
        if mesh.texcoords is not None:
            unique, place = np.unique(mesh.texcoords.reshape(-1, 2), axis=0, return_inverse=True)
            lines += [f"vt {u:.9g} {v:.9g}" for u, v in unique.tolist()]
            corners = (place.reshape(-1, 3) + texcoord).astype(str)
            faces = np.char.add(np.char.add(faces, "/"), corners)
            texcoord += len(unique)
        rows = [f"f {a} {b} {c}" for a, b, c in faces.tolist()]
        panel = -1
        for row, of_panel in zip(
            rows, (mesh.panels.tolist() if mesh.panels is not None else [-1] * len(rows)), strict=True
        ):
            if of_panel != panel:
                panel = of_panel
                known = 0 <= panel < len(mesh.panel_names)
                lines.append(f"g {_word(mesh.panel_names[panel]) if known else f'panel_{panel}'}")
            lines.append(row)
        vertex += mesh.vertex_count
    with whole_file(path) as target:
        target.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _word(name: str) -> str:
    """A name without spaces, because OBJ would read several names."""
    return "_".join(name.split()) or "garment"
