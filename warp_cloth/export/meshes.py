"""Worn garments as GLB and OBJ: vertices in the order of the mesh, for programs without USD."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Mesh, vertex_normals
from warp_cloth.base.trims import TRIMS
from warp_cloth.export.files import whole_file
from warp_cloth.export.surface import AVATAR_COLOUR, cloth_colour, linear, material_name, require_sound, trim_colour
from warp_cloth.maps.colour import colours
from warp_cloth.maps.kinds import kind_named
from warp_cloth.model.result import WornGarment

AVATAR_NODE = "_avatar"  # suffix of the name of the avatar's node in a .glb file
TRIMS_NODE = f"_{TRIMS}"  # and of that of a garment's buttons and other trims
PANEL_ATTRIBUTE = "_panel_"  # and its name: 1 at the vertices of that panel, those of its seams included
ROUGHNESS = 0.85
WHITE = np.ones(3)


def write_glb(
    path: Path,
    *,
    garments: Sequence[WornGarment],
    avatar: Mesh | None,
    ranges: dict[str, tuple[float, float]],
    colour: str = "",
) -> None:
    """Writes all meshes in metres, y up, with smooth normals and materials named by garment and fabric.

    Maps are attributes _NAME, panels _panel_NAME; the map ``colour`` also becomes vertex colours.
    """
    import trimesh

    require_sound(garments, avatar)
    scene = trimesh.Scene()
    for index, worn in enumerate(garments):
        attributes = {f"_{name}": values.astype(np.float32) for name, values in worn.fields.items()}
        for name, faces in _panel_faces(worn.mesh):
            attributes[f"{PANEL_ATTRIBUTE}{name}"] = _touched(worn.mesh, faces)
        mesh = _smooth(worn.points, worn.mesh, attributes)
        kind, base = kind_named(colour), linear(cloth_colour(index))
        painted = kind is not None and colour in worn.fields
        mesh.visual = trimesh.visual.TextureVisuals(material=_material(material_name(worn), WHITE if painted else base))
        if kind is not None and painted:
            shown = linear(colours(kind, worn.fields[colour], ranges[colour]))  # COLOR_0 is linear light
            mesh.visual.vertex_attributes["color"] = _bytes(shown)
        scene.add_geometry(mesh, geom_name=worn.name, node_name=worn.name)
        if worn.trims is not None:
            name, look = f"{worn.name}{TRIMS_NODE}", f"{material_name(worn)}{TRIMS_NODE}"
            trims = _smooth(worn.trims.at(worn.points), worn.trims.mesh, {})
            trims.visual = trimesh.visual.TextureVisuals(material=_material(look, linear(trim_colour(index))))
            scene.add_geometry(trims, geom_name=name, node_name=name)
    if avatar is not None:
        body = _smooth(avatar.points, avatar, {})
        body.visual = trimesh.visual.TextureVisuals(material=_material(_word(avatar.name), linear(AVATAR_COLOUR)))
        scene.add_geometry(body, geom_name=avatar.name, node_name=f"{avatar.name}{AVATAR_NODE}")
    with whole_file(path) as place:
        place.write_bytes(scene.export(file_type="glb"))


def _smooth(points: NDArray[np.float64], mesh: Mesh, attributes: dict[str, NDArray[np.float32]]) -> Any:
    """A trimesh with a normal at each vertex."""
    import trimesh

    return trimesh.Trimesh(
        points,
        mesh.triangles,
        vertex_normals=vertex_normals(points, mesh.triangles),
        process=False,
        validate=False,
        vertex_attributes=attributes,
    )


def _panel_faces(mesh: Mesh) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """Each panel's name, in one word that no other panel has, and its triangles."""
    taken: set[str] = set()
    for panel in np.unique(mesh.panels).tolist() if mesh.panels is not None else ():
        known = 0 <= panel < len(mesh.panel_names)
        name = _word(mesh.panel_names[panel]) if known else f"panel_{panel}"
        while name in taken:
            name += "_"
        taken.add(name)
        yield name, np.flatnonzero(mesh.panels == panel)


def _touched(mesh: Mesh, faces: NDArray[np.int64]) -> NDArray[np.float32]:
    """1 at the vertices of these faces, 0 at the others; shape [V]."""
    weights = np.zeros(mesh.vertex_count, dtype=np.float32)
    weights[mesh.triangles[faces]] = 1.0
    return weights


def _bytes(colour: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.round(255.0 * np.column_stack([colour, np.ones(len(colour))])).astype(np.uint8)


def _material(name: str, colour: NDArray[np.float64]) -> object:
    from trimesh.visual.material import PBRMaterial

    return PBRMaterial(
        name=name,
        baseColorFactor=[*colour.tolist(), 1.0],
        metallicFactor=0.0,
        roughnessFactor=ROUGHNESS,
        doubleSided=True,
    )


def write_obj(path: Path, *, garments: Sequence[WornGarment]) -> Path:
    """Writes the garments in metres, y up, and their materials; returns the path of the materials' file.

    An object each, one more for its trims, a group for each panel, normals per vertex, texture coordinates per corner.
    Where a garment's file has several materials, its faces keep theirs by name; a name that a garment of another file
    has, too, is followed by the garment's.
    """
    require_sound(garments, None)
    materials = material_file(path)
    lines = [f"mtllib {_word(materials.name)}"]
    looks: list[str] = []
    file_of: dict[str, str] = {}  # that each material is of
    vertex = texcoord = 1
    for index, worn in enumerate(garments):
        mesh, material = worn.mesh, material_name(worn)
        red, green, blue = linear(cloth_colour(index)).tolist()
        names = [_word(name) for name in mesh.material_names] if mesh.materials is not None else [material]
        names = [name if file_of.get(name, mesh.name) == mesh.name else f"{name}_{_word(worn.name)}" for name in names]
        used = names if mesh.materials is None else [names[each] for each in np.unique(mesh.materials)]
        for name in dict.fromkeys(used):
            if name in file_of:
                continue  # an inner garment's, of the same file
            file_of[name] = mesh.name
            looks += [f"newmtl {name}", f"Kd {red:.4g} {green:.4g} {blue:.4g}", f"Pr {ROUGHNESS:g}", "illum 1"]
        lines.append(f"o {_word(worn.name)}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in worn.points.tolist()]
        lines += [f"vn {x:.5g} {y:.5g} {z:.5g}" for x, y, z in vertex_normals(worn.points, mesh.triangles).tolist()]
        points = (mesh.triangles.astype(np.int64) + vertex).astype(str)
        corners = np.char.add(points, "/")
        if mesh.texcoords is not None:
            unique, place = np.unique(mesh.texcoords.reshape(-1, 2), axis=0, return_inverse=True)
            lines += [f"vt {u:.9g} {v:.9g}" for u, v in unique.tolist()]
            corners = np.char.add(corners, (place.reshape(-1, 3) + texcoord).astype(str))
            texcoord += len(unique)
        rows = np.char.add(np.char.add(corners, "/"), points).tolist()
        lines += _grouped([f"f {a} {b} {c}" for a, b, c in rows], mesh, names)
        vertex += mesh.vertex_count
        if worn.trims is not None:
            carried, faces = worn.trims.at(worn.points), worn.trims.triangles.astype(np.int64) + vertex
            looks += [f"newmtl {material}{TRIMS_NODE}", "Kd {:.4g} {:.4g} {:.4g}".format(*linear(trim_colour(index)))]
            lines += [f"o {_word(worn.name)}{TRIMS_NODE}", f"usemtl {material}{TRIMS_NODE}"]
            lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in carried.tolist()]
            lines += [f"f {a} {b} {c}" for a, b, c in faces.tolist()]
            vertex += len(carried)
    for target, text in ((materials, looks), (path, lines)):
        with whole_file(target) as file:
            file.write_text("\n".join(text) + "\n", encoding="utf-8")
    return materials


def material_file(path: Path) -> Path:
    """The file of an OBJ's materials; a name with spaces would be several in ``mtllib``."""
    return path.with_name(f"{_word(path.stem)}.mtl")


def _grouped(rows: Sequence[str], mesh: Mesh, materials: Sequence[str]) -> Iterator[str]:
    """Rows of faces in their order, a material's and a group's name where another one, or another panel, begins."""
    names = dict.fromkeys(range(len(rows)), "")
    for name, faces in _panel_faces(mesh):
        names.update(dict.fromkeys(faces.tolist(), name))
    of_face = [0] * len(rows) if mesh.materials is None else mesh.materials.tolist()
    group = ""
    material = None
    for face, row in enumerate(rows):
        if of_face[face] != material:
            material = of_face[face]
            yield f"usemtl {materials[material]}"
        if names[face] != group:
            group = names[face]
            yield f"g {group}"
        yield row


def _word(name: str) -> str:
    """A name without spaces, because OBJ would read several names."""
    return "_".join(name.split()) or "garment"
