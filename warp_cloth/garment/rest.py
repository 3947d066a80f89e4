"""Rest shape of a garment: lengths, areas and the constants of its edges and hinges, in float64 on the host."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.chunks import map_chunks
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Indices, Mesh, face_normals
from warp_cloth.base.quantiles import median
from warp_cloth.base.threads import concatenate
from warp_cloth.base.topology import Topology, build_topology
from warp_cloth.garment.folds import hinge_angles
from warp_cloth.garment.grain import Grain
from warp_cloth.garment.panels import check_axes, check_scale, check_seams, panel_sides
from warp_cloth.garment.rest_choice import AS_MODELLED, RestSource, choose_rest, mean_scale, panel_corners
from warp_cloth.garment.stored_hinges import constants_of_hinges
from warp_cloth.garment.triangles import triangle_areas, triangle_sides
from warp_cloth.kernels.base.options import SliderField
from warp_cloth.loading.repair import RestKey
from warp_cloth.material.constants import Sheet, YarnConstants, edge_constants, lay_flat, yarn_constants
from warp_cloth.material.fabric import Fabric, unlikely_values
from warp_cloth.material.laboratory import GRAVITY
from warp_cloth.scene.wearables import RestAngles

Floats = NDArray[np.float64]


# Edges far shorter than their neighbours would get constants without bound (k ~ 1 / L^3), and strains over nothing:
# below this fraction of the garment's median edge they count as that long.
SHORTEST_EDGE = 1.0e-3

COMMON = ("topology", "edge_length", "sheet", "area", "hinge_angle", "corners", "source")  # to a garment's every fabric


ALONG_V = Grain()


@dataclass(frozen=True)
class RestOptions:
    """What a scene says of a garment's rest shape."""

    rest: RestKey  # where it comes from; with "auto" the mesh shows it
    metres_per_uv: float | None = 1.0  # length of one unit of texture space [m]; None: the mesh shows it
    grain: Grain = ALONG_V  # direction of the warp in the panels
    rest_angles: RestAngles = "flat"  # of folds: flat, as in the mesh (pressed pleats), or as a stage states them
    is_pattern: bool = False  # whether panels and mesh were made from one pattern, so that their scale is beyond doubt
    scale: float = 1.0  # by which the scene scaled the mesh as loaded, and scales texture space likewise


@dataclass(frozen=True, eq=False)
class RestShape:
    """Constants of one garment (SI). E edges, H hinges, V vertices."""

    topology: Topology
    edge_length: Floats  # L [m], shape [E]
    edge_pull: Floats  # k [N/m2] of f = k (r - L)^2, shape [E]
    edge_push: Floats  # c k [N/m2], shape [E]
    hinge_stiffness: Floats  # C [N m], shape [H]
    vertex_weight: Floats  # [N], shape [V]
    area: float  # of the cloth [m2]
    notes: tuple[str, ...] = ()  # what was guessed or mended, for the report
    yarns: YarnConstants | None = None  # of a woven fabric, whose edges do not pull
    hinge_angle: Floats | None = None  # at rest [rad], shape [H]; None: flat
    sheet: Sheet | None = None  # the rest shape triangle by triangle, for maps
    hinge_slider: Floats | None = None  # friction of every hinge: moment [N m] and 1 / fold, shape [H, 2]; None: none
    hinge_laid: Floats | None = None  # angle that every hinge was laid into [rad], shape [H]; None: as at rest
    corners: Floats | None = None  # of every triangle in the panels or the mesh as loaded [m], shape [F, 3, 2 or 3]
    fabric: Fabric | None = None  # what the constants are of
    source: RestSource = AS_MODELLED

    @property
    def fold_angle(self) -> Floats:
        """Rest angle of every hinge [rad], shape [H]."""
        return np.zeros(len(self.hinge_stiffness)) if self.hinge_angle is None else self.hinge_angle

    @property
    def hinge_hysteresis(self) -> Floats:
        """Friction of every hinge as kernels read it, by SliderField, shape [H, 4]."""
        laid = self.fold_angle if self.hinge_laid is None else self.hinge_laid
        hysteresis = np.zeros((len(laid), len(SliderField)))
        if self.hinge_slider is not None:
            hysteresis[:, SliderField.MOMENT], hysteresis[:, SliderField.STEEPNESS] = self.hinge_slider.T
        hysteresis[:, SliderField.COSINE], hysteresis[:, SliderField.SINE] = np.cos(laid), np.sin(laid)
        return hysteresis


def _stated_sides(mesh: Mesh, place: str, key: str) -> Floats:
    """Lengths of each triangle's sides in the rest shape that the stage states [m], shape [F, 3]."""
    if mesh.rest_corners is None:
        problem = 'rest = "physics" needs a mesh with physics:restShapePoints in a USD file'
        raise InputError(place, problem, f'set {key}.rest = "mesh" or "uv"')
    return triangle_sides(mesh.rest_corners)


def _places(mesh: Mesh, source: RestSource) -> Floats:
    """Corners of every triangle where the rest shape has them, shape [F, 3, 2 or 3]."""
    if source.kind != "uv":
        return np.asarray(mesh.points[mesh.triangles])
    return panel_corners(mesh, source.metres_per_uv)


FLATNESS = 1e-3  # of a normal's components; a mesh that is flatter lies in a plane


def _drawn_flat(mesh: Mesh, grain: Grain, key: str, source: RestSource) -> Floats | None:
    """Corners of every triangle, x along weft and y along warp, shape [F, 3, 2]; None where the warp is unknown.

    The warp is +y of a stated rest shape in the xy plane, the panels' +v, or, of a flat mesh without panels, what is
    up in it: +y, or -z where it lies.
    """
    stated = mesh.rest_corners if source.kind == "physics" else None
    if stated is not None and np.ptp(stated[..., 2]) <= FLATNESS * np.ptp(stated):
        drawn = stated[..., 0] + 1j * stated[..., 1]
    elif mesh.texcoords is not None:
        u, v = source.metres_per_uv if isinstance(source.metres_per_uv, tuple) else (1.0, 1.0)  # only angles matter
        drawn = u * mesh.texcoords[..., 0] + 1j * (v * mesh.texcoords[..., 1])
    else:
        corners = mesh.points[mesh.triangles]
        normals = face_normals(corners)
        total = normals.sum(axis=0)
        normal = total / max(float(np.linalg.norm(total)), np.finfo(float).tiny)
        if (np.linalg.norm(np.cross(normals, normal), axis=1) > FLATNESS * np.linalg.norm(normals, axis=1)).any():
            if grain != Grain():
                problem = "the mesh has no texture coordinates, whose v axis grain refers to"
                raise InputError(f"{key}.grain_degrees", problem, f"export them, or remove {key}.grain_...")
            return None
        up = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < np.sqrt(0.5) else np.array([0.0, 0.0, -1.0])
        warp = up - normal * (up @ normal)
        warp /= np.linalg.norm(warp)
        drawn = corners @ np.cross(warp, normal) + 1j * (corners @ warp)
    turned = drawn * np.exp(-1j * grain.of_triangles(mesh, key))[:, None]
    return np.stack([turned.real, turned.imag], axis=2)


@dataclass(frozen=True, eq=False)
class RestGeometry:
    """What a garment's rest shape is in every fabric."""

    length: Floats  # of every edge [m], shape [E]
    sheet: Sheet
    area: float  # of the cloth [m2]
    hinge_angle: Floats | None = None  # at rest [rad], shape [H]; None: flat
    corners: Floats | None = None  # as in RestShape
    notes: tuple[str, ...] = ()
    source: RestSource = AS_MODELLED


def own_constants(rest: RestShape) -> dict[str, Any]:
    """What a garment's rest shape has of its fabric alone, by name; ``in_geometry`` puts it together again."""
    return {each.name: getattr(rest, each.name) for each in fields(rest) if each.name not in COMMON}


def sheet_digest(geometry: RestGeometry, vertex_count: int) -> bytes:
    """A fingerprint of all that constants in a fabric depend on: panels' lengths, wherever a body has them placed."""
    sheet, digest = geometry.sheet, hashlib.sha256()
    for numbers in (geometry.length, sheet.triangles, sheet.flat, sheet.areas):
        digest.update(np.ascontiguousarray(numbers).tobytes())
    digest.update(repr((vertex_count, geometry.area, sheet.directed, geometry.notes)).encode())
    return digest.digest()


def in_geometry(own: dict[str, Any], geometry: RestGeometry) -> RestShape:
    """The rest shape of these constants."""
    return RestShape(
        topology=geometry.sheet.topology,
        edge_length=geometry.length,
        sheet=geometry.sheet,
        area=geometry.area,
        hinge_angle=geometry.hinge_angle,
        corners=geometry.corners,
        source=geometry.source,
        **own,
    )


def build_rest_shape(
    mesh: Mesh,
    fabric: Fabric,
    *,
    rest: RestKey,
    metres_per_uv: float | None = 1.0,
    grain: Grain = ALONG_V,
    rest_angles: RestAngles = "flat",
) -> RestShape:
    """Rest lengths and constants of a garment of this fabric; other arguments as in ``RestOptions``."""
    geometry = build_rest_geometry(mesh, RestOptions(rest, metres_per_uv, grain, rest_angles))
    return rest_in_fabric(geometry, mesh.vertex_count, fabric)


def rest_in_fabric(geometry: RestGeometry, vertex_count: int, fabric: Fabric) -> RestShape:
    """The rest shape of a garment of this fabric (see warp_cloth.material.constants).

    Gravity: total weight / V on every vertex (the paper, section 2.3).
    """
    weight = fabric.weight * geometry.area * GRAVITY / vertex_count
    shape = _constants(geometry, np.full(vertex_count, weight), fabric)
    directed = geometry.sheet.directed
    notes = unlikely_values(fabric) + _check_directions(fabric, directed) + _check_shear_friction(fabric, directed)
    return replace(shape, notes=geometry.notes + notes)


def in_another_fabric(rest: RestShape, vertex_count: int, fabric: Fabric) -> RestShape:
    """The same garment's rest shape in this fabric."""
    if rest.sheet is None:
        raise ValueError("a garment whose panels are not known has no other fabric")
    geometry = RestGeometry(rest.edge_length, rest.sheet, rest.area, rest.hinge_angle, rest.corners, source=rest.source)
    return rest_in_fabric(geometry, vertex_count, fabric)


def build_rest_geometry(
    mesh: Mesh, options: RestOptions, *, place: str = "garment", key: str = "garment"
) -> RestGeometry:
    """Rest lengths of a garment, and its triangles laid flat.

    Args:
        mesh: the garment.
        options: what its scene says of its rest shape.
        place: the mesh's file or name, for messages.
        key: its scene table, for messages.

    Raises:
        InputError: the rest shape cannot be used.
    """
    source = choose_rest(mesh, options.rest, options.metres_per_uv, key, options.scale)
    notes: tuple[str, ...] = ()
    sides = triangle_sides(mesh.points[mesh.triangles])
    drawn = sides
    if source.kind == "uv":
        sides, notes = panel_sides(mesh, source.metres_per_uv, place, key)
    elif source.kind == "physics":
        sides = _stated_sides(mesh, place, key)
    areas = triangle_areas(sides)
    if not areas.sum() > 0.0:
        raise InputError(place, "the garment has no area", "check the mesh")
    like = _drawn_flat(mesh, options.grain, key, source)
    geometry = _laid_out(mesh.triangles, sides, mesh.vertex_count, like)
    if source.kind == "uv":
        notes += () if options.is_pattern else _scale_notes(mesh, source, drawn, geometry, place, key)
        notes += check_seams(sides, geometry.sheet.topology)
    return replace(
        geometry,
        notes=notes,
        hinge_angle=hinge_angles(mesh, geometry.sheet.topology, options.rest_angles, place, key),
        corners=_places(mesh, source),
        source=source,
    )


def _scale_notes(
    mesh: Mesh, source: RestSource, drawn: Floats, geometry: RestGeometry, place: str, key: str
) -> tuple[str, ...]:
    """What is doubtful about the scale of panels; ``drawn``: lengths of triangles' sides in the mesh [m], [F, 3]."""
    length, scale = geometry.length, source.metres_per_uv
    side_edge = geometry.sheet.topology.triangle_edges.ravel()
    initial = np.bincount(side_edge, drawn.ravel(), len(length)) / np.bincount(side_edge, minlength=len(length))
    notes = check_scale(mesh, length, initial, mean_scale(scale) / source.scale, place, key)
    if isinstance(scale, float):  # two scales are as the mesh shows them
        notes += check_axes(mesh, scale, key)
    return notes


def constants_of(triangles: Indices, sides: Floats, weight: Floats, fabric: Fabric, like: Floats | None) -> RestShape:
    """The constants of a garment whose triangles have these sides (0,1), (1,2), (2,0) at rest [m], shape [F, 3].

    Args:
        triangles: shape [F, 3].
        sides: of every triangle; an edge between two takes their mean.
        weight: of every vertex [N], shape [V].
        fabric: its material.
        like: corners of every triangle, x along weft and y along warp, shape [F, 3, 2]; None: it has no directions.
    """
    return _constants(_laid_out(triangles, sides, len(weight), like), weight, fabric)


def _laid_out(triangles: Indices, sides: Floats, vertex_count: int, like: Floats | None) -> RestGeometry:
    """Lengths of edges and triangles in the plane, from what ``constants_of`` takes."""
    topology = build_topology(triangles, vertex_count)
    edge_count = len(topology.edges)
    side_edge = topology.triangle_edges.ravel()
    # an edge between two panels takes the mean of the panels' lengths (model: cloth)
    length = np.bincount(side_edge, sides.ravel(), edge_count) / np.bincount(side_edge, minlength=edge_count)
    length = np.maximum(length, SHORTEST_EDGE * median(length))
    averaged = length[topology.triangle_edges]
    even = triangle_areas(averaged)
    flat = map_chunks(
        lambda part: lay_flat(averaged[part], even[part], None if like is None else like[part]), len(even)
    )
    sheet = Sheet(topology, triangles, concatenate(flat), even, like is not None)
    return RestGeometry(length, sheet, float(triangle_areas(sides).sum()))


def _constants(geometry: RestGeometry, weight: Floats, fabric: Fabric) -> RestShape:
    """The constants of a garment of this fabric; ``weight`` of every vertex [N], shape [V]."""
    sheet, length = geometry.sheet, geometry.length
    woven = fabric.woven and sheet.directed
    pull = np.zeros(len(length)) if woven else edge_constants(sheet, fabric, length)
    stiffness, slider = constants_of_hinges(sheet, fabric, length)
    own = {
        "edge_pull": pull,
        "edge_push": fabric.compression * pull,
        "hinge_stiffness": stiffness,
        "hinge_slider": slider,
        "vertex_weight": weight,
        "yarns": yarn_constants(sheet, fabric) if woven else None,
        "fabric": fabric,
    }
    return in_geometry(own, geometry)


def _check_directions(fabric: Fabric, directed: bool) -> tuple[str, ...]:
    """A note where the fabric has directions and the garment has not."""
    even = fabric.stretch_warp == fabric.stretch_weft and fabric.bending_warp == fabric.bending_weft
    own_shear = fabric.shear is not None and not np.isclose(fabric.shear, fabric.even_shear)
    if directed or (even and not own_shear):
        return ()
    return (
        f'the mesh has no texture coordinates for warp and weft, so the fabric "{fabric.name}" '
        "is treated as equal in all directions, without its shear",
    )


def _check_shear_friction(fabric: Fabric, directed: bool) -> tuple[str, ...]:
    """A note where the fabric states friction in shear and has no yarns that could rub."""
    if fabric.shear_friction == 0.0 or (directed and fabric.woven):
        return ()
    why = 'its shear is "edges"' if directed else "the mesh has no texture coordinates for warp and weft"
    return (f'the shear_hysteresis_2HG of the fabric "{fabric.name}" is left out: {why}',)
