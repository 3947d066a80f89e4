"""Warm start: garments start as an earlier fit wore them, in another size, fabric, or on another body."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from warp_cloth.avatar.exact import closest_faces
from warp_cloth.base import mesh_formats
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.export.meshes import AVATAR_NODE, TRIMS_NODE
from warp_cloth.fitting.problem import Problem
from warp_cloth.loading import load_mesh
from warp_cloth.loading.load import read_raw
from warp_cloth.loading.separate import mesh_names
from warp_cloth.loading.usd import opened_stage
from warp_cloth.loading.usd_physics import SURFACE, applied
from warp_cloth.loading.usd_units import meshes_of
from warp_cloth.model.result import FitResult, matched
from warp_cloth.scene import Scene
from warp_cloth.scene.messages import listed

PANEL_GAP = 10.0  # between panels, each scaled to the unit square
# Fraction of the worn garment's size: if a tenth of the seam vertices lie farther apart, the panels do not correspond.
# Between sizes of a T-shirt it is 0.01 at most.
FAR_APART = 0.05

Worn = tuple[Mesh, Points]  # a garment and its worn points [m], shape [V, 3]


def earlier_garments(start: FitResult | str | Path, scene: Scene) -> list[Worn]:
    """The garments of an earlier result, or of its file, in the order of the scene's.

    Raises:
        InputError: it is neither, cannot be read, or its garments cannot be matched.
    """
    names = [spec.name for spec in scene.garments]
    if isinstance(start, str | Path):
        return saved_result(Path(start), names)
    if not isinstance(start, FitResult):
        raise InputError(
            "start", f"{type(start).__name__} is neither a fit nor a file of one", "pass what fit returned"
        )
    worn = [(garment.mesh, garment.points) for garment in start.garments]
    return [worn[index] for index in chosen_garments([garment.name for garment in start.garments], names, "start")]


def saved_result(path: Path, names: Sequence[str]) -> list[Worn]:
    """The garments ``names`` of a saved result, as they are worn there.

    They are matched by name or, where the names differ, by order, if the result has as many garments.

    Raises:
        InputError: the file cannot be read, or its garments cannot be matched.
    """
    if not path.exists():
        raise InputError(path, "no such file", "give a file that an earlier fit has written")
    suffix = path.suffix.lower()
    garments: Sequence[tuple[str, str | None]] = [(path.stem, None)]
    if suffix in (*mesh_formats.OBJ, *mesh_formats.GLTF) and path.is_file():
        read_raw(path, role="garment", key="start", prim=None)  # refuses a file that cannot be read
        nodes = mesh_names(path, path.read_bytes())
        cloths = [name for name in nodes if not name.endswith((AVATAR_NODE, TRIMS_NODE))] or nodes
        if suffix in mesh_formats.GLTF or len(names) > 1 or names[0] in cloths:  # else an OBJ's may be panels
            garments = [(name, name) for name in cloths] or garments
    elif suffix in mesh_formats.USD and path.is_file():
        garments = _stage_garments(path)
    chosen = chosen_garments([name for name, _ in garments], names, path)
    meshes = [load_mesh(path, role="garment", key="start", prim=garments[index][1], units="m") for index in chosen]
    return [(mesh, mesh.points) for mesh in meshes]


def chosen_garments(available: Sequence[str], wanted: Sequence[str], place: str | Path) -> list[int]:
    """Indices of an earlier result's garments that match the scene's; InputError where neither names nor number do."""
    chosen = matched(available, wanted)
    if chosen is None:
        problem = f"has {listed(available)}, but the scene has {listed(wanted)}"
        raise InputError(place, problem, "start from a result of the same garments, or rename them (garment.name)")
    return chosen


def _stage_garments(path: Path) -> list[tuple[str, str | None]]:
    """Name and prim path of each garment of a stage, or of each mesh where none is marked as cloth."""
    with opened_stage(str(path)) as stage:
        meshes = meshes_of(stage)
        cloths = [mesh for mesh in meshes if SURFACE in applied(mesh)] or meshes
        parents = [mesh.GetParent() for mesh in cloths]
        names = [parent.GetDisplayName() or parent.GetName() for parent in parents]
        return [(name, str(mesh.GetPath())) for name, mesh in zip(names, cloths, strict=True)]


def start_from(problem: Problem, earlier: Sequence[Worn]) -> bool:
    """Moves a lone scene's garments to where earlier ones were worn, except for pins; whether any corresponds.

    A garment that corresponds to none starts as it was loaded. The collider is rebuilt where it does not cover them.
    """
    starts = [
        corresponding_points(mesh, worn, new, problem.model.device)
        for (mesh, worn), new in zip(earlier, problem.outfit.meshes, strict=True)
    ]
    if all(points is None for points in starts):
        return False
    loaded = problem.model.points()
    points = loaded.copy()
    for (first, last), garment, start in zip(
        itertools.pairwise(problem.model.vertex_start), problem.outfit.garments, starts, strict=True
    ):
        if start is not None:
            points[first:last] = start
        points[first + garment.pins] = loaded[first + garment.pins]
    problem.place(points)
    return True


def corresponding_points(old: Mesh, worn: Points, new: Mesh, device: str = "cpu") -> Points | None:
    """Positions on the old garment as worn [m] of the new one's vertices, shape [V, 3]; None: they do not correspond.

    Meshes with the same triangles correspond vertex by vertex. Otherwise points correspond that lie at the same place
    in the box of the panel of the same name, as in sizes of one pattern. Where that would tear seams apart, the names
    are alike by chance.
    """
    if old.vertex_count == new.vertex_count and np.array_equal(old.triangles, new.triangles):
        return worn.copy()
    shared = set(old.panel_names) == set(new.panel_names) and len(old.panel_names) > 0
    if not shared or old.texcoords is None or new.texcoords is None or old.panels is None or new.panels is None:
        return None
    old_places, new_places = _panel_places(old, old.panel_names), _panel_places(new, old.panel_names)
    apart = np.arange(3 * len(old_places), dtype=np.int32)  # each triangle has corners of its own
    _, face, weight = closest_faces(old_places.reshape(-1, 3), apart, new_places.reshape(-1, 3), device)
    found = (worn[old.triangles[face]] * weight[:, :, None]).sum(axis=1)
    vertex = new.triangles.ravel()
    count = np.bincount(vertex, minlength=new.vertex_count)
    means = np.column_stack([np.bincount(vertex, found[:, axis], new.vertex_count) / count for axis in range(3)])
    return None if _torn(found - means[vertex], new_places.reshape(-1, 3), vertex, worn) else means


def _torn(offset: Points, places: NDArray[np.float32], vertex: NDArray[np.int32], worn: Points) -> bool:
    """Whether panels that are sewn together would start far apart.

    ``offset`` is that of each corner from the mean of its vertex [m], ``places`` are the corners' positions in their
    panels, both of shape [3 F, 3]; ``vertex`` is that of each corner; ``worn`` are the earlier garment's points [m].
    """
    _, first = np.unique(vertex, return_index=True)
    sewn = (places != places[first[vertex]]).any(axis=1)
    if not sewn.any():
        return False
    gap = 2 * np.linalg.norm(offset[sewn], axis=1)
    return bool(np.quantile(gap, 0.9) > FAR_APART * np.linalg.norm(np.ptp(worn, axis=0)))


def _panel_places(mesh: Mesh, names: tuple[str, ...]) -> NDArray[np.float32]:
    """Coordinates of every corner in its panel, each panel scaled to a unit square of its own; shape [F, 3, 3]."""
    places = np.zeros((mesh.triangle_count, 3, 3), dtype=np.float32)
    if mesh.texcoords is None or mesh.panels is None:
        return places
    for number, name in enumerate(mesh.panel_names):
        inside = mesh.panels == number
        if inside.any():
            corners = mesh.texcoords[inside]
            low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            places[inside, :, :2] = (corners - low) / np.maximum(high - low, 1e-9)
            places[inside, :, 2] = PANEL_GAP * names.index(name)
    return places
