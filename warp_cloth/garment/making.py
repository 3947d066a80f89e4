"""Meshes, rest shapes and pins, made from the tables of a scene: nothing here knows of caches but for drafts."""

from __future__ import annotations

import contextlib
import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from warp_cloth.base.cache import Cache
from warp_cloth.base.choice import Choice
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.garment.closed_ends import with_open_ends
from warp_cloth.garment.coarse import with_short_sides
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.measured_body import measured_mannequin
from warp_cloth.garment.pins import select_pins
from warp_cloth.garment.rest import RestGeometry, RestOptions, RestShape, build_rest_geometry, rest_in_fabric
from warp_cloth.garment.rest_choice import choose_rest
from warp_cloth.loading import Placement, load_mesh_once, load_poses, without_area
from warp_cloth.scene import AvatarSpec, BodyMeasures, GarmentSpec, TshirtShape
from warp_cloth.shapes import MannequinMeasures, build_avatar, build_garment

if TYPE_CHECKING:
    from warp_cloth.pattern.figure import Figure

# keys of a garment or an avatar that its mesh depends on
MESH_KEYS = {
    *("mesh", "pattern", "edge_mm", "open_ends", "shape", "measures", "prim", "units", "up"),
    *("translate", "rotate", "scale", "rest", "uv_units", "size", "seam_allowance_mm", "seam", "piece"),
}


def file_stamp(*paths: Path | None) -> str:
    """Size and time of source files, which may change during the life of a cache."""
    stamps = []
    for path in paths:
        with contextlib.suppress(OSError, ValueError):  # a missing file is reported when it is read
            status = os.stat(path) if path is not None else None
            stamps.append(f"{status.st_size} {status.st_mtime_ns}" if status is not None else "")
    return " ".join(stamps)


def posed_avatar(spec: AvatarSpec, avatar: Mesh) -> tuple[Mesh, tuple[Points, ...]]:
    """A loaded avatar in its last pose, and its vertices in every pose, the loaded one first [m]."""
    if spec.mesh is None:
        return avatar, ()
    later = load_poses(avatar, spec.mesh, spec.poses, prim=spec.prim, units=spec.units, up=spec.up)
    return replace(avatar, points=later[-1]), (avatar.points, *later)


def values_of(spec: GarmentSpec | AvatarSpec, keys: set[str] | None) -> str:
    """The values of these keys of a scene table (None: all but its name), as JSON."""
    return spec.model_dump_json(include=keys, exclude={"name"})


def rest_geometry(mesh: Mesh, spec: GarmentSpec, key: str) -> RestGeometry:
    """The rest geometry of a loaded garment; ``key`` is its table, for messages."""
    place = key if spec.file is None else str(spec.file)
    grain = Grain(spec.grain_degrees, spec.grain_panels, spec.grain_texture)
    cut = spec.rest == "auto" and isinstance(spec.shape, TshirtShape)  # from panels, however it is placed
    options = RestOptions(
        rest="uv" if cut or spec.pattern is not None else spec.rest,
        metres_per_uv=spec.uv_metres if spec.mesh is not None else spec.uv_metres or 1.0,  # others are in metres
        grain=grain,
        rest_angles=spec.rest_angles,
        is_pattern=spec.pattern is not None,
        scale=spec.scale,
    )
    geometry = build_rest_geometry(mesh, options, place=place, key=key)
    if not cut:
        return geometry
    choices = (Choice(f"{key}.rest", "uv", "the shape is cut from flat panels"),)
    return replace(geometry, source=replace(geometry.source, choices=choices))


def rest_and_pins(mesh: Mesh, geometry: RestGeometry, spec: GarmentSpec, key: str) -> tuple[RestShape, Indices]:
    """Rest shape in the garment's fabric, and its pinned vertices."""
    rest = rest_in_fabric(geometry, mesh.vertex_count, spec.fabric)
    pins = select_pins(mesh, spec.pin, f"{key}.pin")
    if len(pins) == mesh.vertex_count:
        raise InputError(f"{key}.pin", "every vertex is pinned, so that nothing can move", "pin fewer vertices")
    return rest, pins


def garment_mesh(
    spec: GarmentSpec,
    key: str,
    body: MannequinMeasures | BodyMeasures | None,
    laid_round: AvatarSpec | None,
    drafts: Cache,
) -> Mesh:
    """A garment's mesh, loaded or drafted, where its table places it [m].

    ``body`` is the mannequin that it is drafted for, ``laid_round`` the avatar that its panels are laid round.
    """
    placement = Placement(spec.translate, spec.rotate, spec.scale)
    if spec.mesh is None:
        if isinstance(body, BodyMeasures):
            body = measured_mannequin(body, drafts)[0]
        if spec.pattern is not None:
            from warp_cloth.pattern import load_pattern  # fifty modules that few scenes need

            figure = None if laid_round is None else _figure(laid_round, drafts)
            mesh = load_pattern(spec.pattern, edge=spec.edge, options=spec.draft_options, figure=figure)
        else:
            mesh = build_garment(spec.shape, body=body, cache=drafts)
        return replace(mesh, points=placement.moved(mesh.points * spec.scale))
    load = partial(
        load_mesh_once,
        spec.mesh,
        role="garment",
        key=key,
        prim=spec.prim,
        units=spec.units,
        up=spec.up,
        placement=placement,
    )
    mesh = load(rest=spec.rest)
    # triangles without area serve panels alone, and whether there are panels shows only now
    kept = spec.rest == "auto" and bool(without_area(mesh.points, mesh.triangles).any())
    as_modelled = kept and choose_rest(mesh, "auto", spec.uv_metres, key, spec.scale).kind == "mesh"
    mesh = load(rest="mesh") if as_modelled else mesh
    mesh = with_open_ends(mesh) if spec.open_ends else mesh
    if spec.edge_mm is None:
        return mesh
    if spec.rest_angles == "physics":
        problem = "faces cannot be divided between which a stage states rest angles"
        raise InputError(f"{key}.edge_mm", problem, "remove it")
    return with_short_sides(mesh, choose_rest(mesh, spec.rest, spec.uv_metres, key, spec.scale), spec.edge)


def _figure(avatar: AvatarSpec, drafts: Cache) -> Figure:
    """The parts of an avatar that panels are laid round, found once."""
    from warp_cloth.pattern import figure_of

    parameters = values_of(avatar, MESH_KEYS), file_stamp(avatar.mesh)
    return drafts.get_or_make("figure", (), lambda: figure_of(avatar_mesh(avatar, drafts)), *parameters)


def avatar_mesh(spec: AvatarSpec, drafts: Cache) -> Mesh:
    """An avatar's mesh, loaded or generated [m]."""
    if spec.mesh is not None:
        return load_mesh_once(spec.mesh, role="avatar", key="avatar", prim=spec.prim, units=spec.units, up=spec.up)
    if spec.measures is not None:
        return measured_mannequin(spec.measures, drafts)[1]
    return build_avatar(spec.shape, cache=drafts)
