"""Warm starts: garments begin as an earlier fit wore them, in another size, fabric, or on another body."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.export.meshes import AVATAR_NODE
from warp_cloth.fitting.problem import Problem
from warp_cloth.kernels.avatar.nearest import find_nearest
from warp_cloth.loading import load_mesh
from warp_cloth.loading.generic import gltf_mesh_names
from warp_cloth.loading.load import GLTF_KINDS, read_raw
from warp_cloth.loading.usd import opened_stage
from warp_cloth.loading.usd_physics import SURFACE, applied
from warp_cloth.loading.usd_units import meshes_of
from warp_cloth.model.result import matched
from warp_cloth.scene.messages import listed
from warp_cloth.scene.stage import USD_SUFFIXES

PANEL_GAP = 10.0  # between panels, which are brought to the unit square
# Of the worn garment's size: how far apart a tenth of the seams' vertices lie where panels are others. Between sizes
# of a T-shirt it is 0.01 at most.
TORN = 0.05

Worn = tuple[Mesh, Points]  # a garment and its worn points [m], shape [V, 3]


def saved_result(path: Path, names: Sequence[str]) -> list[Worn]:
    """The garments ``names`` of a result that a fit has saved, as they are worn there.

    They are told by their names; where these are others, by their order, if the result has as many.

    Raises:
        InputError: the file cannot be read, or it does not tell which of its garments are meant.
    """
    if not path.exists():
        raise InputError(path, "no such file", "name what an earlier fit has written")
    suffix = path.suffix.lower()
    garments: Sequence[tuple[str, str | None]] = [(path.stem, None)]
    if suffix in GLTF_KINDS and path.is_file():
        read_raw(path, role="garment", key="start", prim=None)  # tells what is wrong with it
        nodes = gltf_mesh_names(str(path), path.read_bytes())
        cloths = [name for name in nodes if not name.endswith(AVATAR_NODE)] or nodes
        garments = [(name, name) for name in cloths] or garments
    elif suffix in USD_SUFFIXES and path.is_file():
        garments = _stage_garments(path)
    chosen = chosen_garments([name for name, _ in garments], names, path)
    found = [load_mesh(path, role="garment", key="start", prim=garments[at][1], units="m") for at in chosen]
    return [(mesh, mesh.points) for mesh in found]


def chosen_garments(there: Sequence[str], wanted: Sequence[str], place: str | Path) -> list[int]:
    """Which of an earlier result's garments the scene's are; InputError where names and number do not tell."""
    chosen = matched(there, wanted)
    if chosen is None:
        problem = f"holds {listed(there)}, the scene {listed(wanted)}"
        raise InputError(place, problem, "start from a result of the same garments, or call them so (garment.name)")
    return chosen


def _stage_garments(path: Path) -> list[tuple[str, str | None]]:
    """Name and prim path of each garment of a stage; of each mesh where none is marked as cloth."""
    with opened_stage(str(path)) as stage:
        meshes = meshes_of(stage)
        cloths = [mesh for mesh in meshes if SURFACE in applied(mesh)] or meshes
        parents = [mesh.GetParent() for mesh in cloths]
        called = [parent.GetDisplayName() or parent.GetName() for parent in parents]
        return [(name, str(mesh.GetPath())) for name, mesh in zip(called, cloths, strict=True)]


def start_from(made: Problem, earlier: Sequence[Worn]) -> bool:
    """Puts a lone scene's garments where earlier ones were worn, pins apart; whether any could be.

    What corresponds to nothing starts as it was loaded. The collider goes with the garments.
    """
    taken = [
        carried_over(mesh, worn, new, made.model.device)
        for (mesh, worn), new in zip(earlier, made.outfit.garments, strict=True)
    ]
    if all(points is None for points in taken):
        return False
    loaded = made.model.points()
    points = loaded.copy()
    for (first, last), part, there in zip(
        itertools.pairwise(made.model.vertex_start), made.outfit.parts, taken, strict=True
    ):
        if there is not None:
            points[first:last] = there
        points[first + part.pins] = loaded[first + part.pins]
    made.model.set_points(points)
    if not made.contact.covers(points):
        made.relaxation.meet(0, made.contact.collider(points))
    return True


def carried_over(old: Mesh, worn: Points, new: Mesh, device: str = "cpu") -> Points | None:
    """Where the new garment's vertices lie on the old one as worn [m], shape [V, 3]; None where nothing tells.

    The same triangles keep their vertices. Otherwise a place is told by its panel's name and by where it lies in that
    panel's box: sizes of one pattern correspond like that. Where that tears seams apart, the names are chance.
    """
    if old.vertex_count == new.vertex_count and np.array_equal(old.triangles, new.triangles):
        return worn.copy()
    shared = set(old.panel_names) == set(new.panel_names) and len(old.panel_names) > 0
    if not shared or old.texcoords is None or new.texcoords is None or old.panels is None or new.panels is None:
        return None
    places, wanted = _boxed(old, old.panel_names), _boxed(new, old.panel_names)
    surface = wp.Mesh(
        points=wp.array(places.reshape(-1, 3), dtype=wp.vec3f, device=device),
        indices=wp.array(np.arange(3 * len(places), dtype=np.int32), dtype=wp.int32, device=device),
    )
    asked = wp.array(wanted.reshape(-1, 3), dtype=wp.vec3f, device=device)
    face = wp.empty(len(asked), dtype=wp.int32, device=device)
    weight = wp.zeros(len(asked), dtype=wp.vec3f, device=device)
    wp.launch(find_nearest, dim=len(asked), inputs=[surface.id, asked, face, weight], device=device)
    corners = worn[old.triangles[face.numpy()]]
    found = (corners * weight.numpy()[:, :, None]).sum(axis=1)
    vertex = new.triangles.ravel()
    count = np.bincount(vertex, minlength=new.vertex_count)
    means = np.column_stack([np.bincount(vertex, found[:, axis], new.vertex_count) / count for axis in range(3)])
    return None if _torn(found - means[vertex], wanted.reshape(-1, 3), vertex, worn) else means


def _torn(away: Points, wanted: NDArray[np.float32], vertex: NDArray[np.int32], worn: Points) -> bool:
    """Whether panels that are sewn together would start far apart.

    ``away`` is how far corners lie from the mean of their vertex [m], ``wanted`` where they lie in their panels, both
    shape [3 F, 3]; ``vertex`` is that of each corner; ``worn`` the earlier garment's points [m].
    """
    _, first = np.unique(vertex, return_index=True)
    sewn = (wanted != wanted[first[vertex]]).any(axis=1)
    if not sewn.any():
        return False
    gap = 2 * np.linalg.norm(away[sewn], axis=1)
    return bool(np.quantile(gap, 0.9) > TORN * np.linalg.norm(np.ptp(worn, axis=0)))


def _boxed(mesh: Mesh, names: tuple[str, ...]) -> NDArray[np.float32]:
    """Panel coordinates of every corner, each panel in a unit square of its own; shape [F, 3, 3]."""
    boxed = np.zeros((mesh.triangle_count, 3, 3), dtype=np.float32)
    if mesh.texcoords is None or mesh.panels is None:
        return boxed
    for number, name in enumerate(mesh.panel_names):
        inside = mesh.panels == number
        if inside.any():
            corners = mesh.texcoords[inside]
            low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            boxed[inside, :, :2] = (corners - low) / np.maximum(high - low, 1e-9)
            boxed[inside, :, 2] = PANEL_GAP * names.index(name)
    return boxed
