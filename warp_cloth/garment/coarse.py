"""Garments whose faces are so large that a body shows through them: their sides are halved until they are short."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.base.choice import Choice
from warp_cloth.base.division import refined
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.rest_choice import RestSource, panel_corners
from warp_cloth.garment.triangles import triangle_areas, triangle_sides
from warp_cloth.scene import Scene

# A side that is too long on a body [m]: over an arm of 5 cm radius it would lie 9 mm deep. Garments have 1 to 3 cm.
COARSE = 0.06
COARSE_PART = 0.1  # of a garment's area in faces with such sides, from which on it is coarse
FINE_MM = 25.0  # longest side of one that is divided


def divide_coarse(
    scene: Scene, garments: Sequence[Garment], worn: Sequence[Wearing | None]
) -> tuple[Scene, list[Choice]]:
    """The scene with the coarse garments of its files divided, and why; else the same scene.

    ``worn``: their openings on a body; None: a garment has none, or there is no body that stays.
    """
    specs, choices = list(scene.garments), []
    of_each = zip(scene.garments, scene.garment_keys, garments, worn, strict=True)
    for index, (spec, key, garment, wearing) in enumerate(of_each):
        if wearing is None or spec.mesh is None or spec.edge_mm is not None or spec.rest_angles == "physics":
            continue
        longest = _longest_where_coarse(garment)
        if longest is not None:
            reason = f"a body would show through its faces, whose sides are up to {1e3 * longest:.0f} mm long"
            specs[index] = spec.model_copy(update={"edge_mm": FINE_MM})
            choices.append(Choice(f"{key}.edge_mm", FINE_MM, reason))
    return (scene.model_copy(update={"garments": tuple(specs)}) if choices else scene), choices


def _longest_where_coarse(garment: Garment) -> float | None:
    """The longest side at rest [m] of a garment whose faces are too large for a body; None: they are not."""
    corners = garment.rest.corners
    sides = triangle_sides(garment.points[garment.triangles] if corners is None else corners)
    longest, areas = sides.max(axis=1), triangle_areas(sides)
    is_coarse = float(areas[longest > COARSE].sum()) > COARSE_PART * float(areas.sum())
    return float(longest.max()) if is_coarse else None


def with_short_sides(mesh: Mesh, source: RestSource, longest: float) -> Mesh:
    """A garment's mesh with no side longer at rest [m]; its own vertices stay the first.

    Args:
        mesh: the garment.
        source: of its rest shape.
        longest: side [m].
    """
    corners = mesh.points[mesh.triangles]
    if source.kind == "uv":
        corners = panel_corners(mesh, source.metres_per_uv)
    elif source.kind == "physics" and mesh.rest_corners is not None:
        corners = mesh.rest_corners
    points, parts = refined(mesh.points, mesh.triangles, corners, longest)
    if len(points) == mesh.vertex_count:
        return mesh
    own = np.arange(mesh.triangle_count) if mesh.triangle_source is None else mesh.triangle_source
    return replace(
        mesh,
        points=points,
        triangles=parts.triangles,
        texcoords=None if mesh.texcoords is None else parts.held(mesh.texcoords),
        panels=None if mesh.panels is None else mesh.panels[parts.source],
        materials=None if mesh.materials is None else mesh.materials[parts.source],
        folds=None,  # between faces of the file
        rest_corners=None if mesh.rest_corners is None else parts.held(mesh.rest_corners),
        vertex_map=np.arange(mesh.vertex_count) if mesh.vertex_map is None else mesh.vertex_map,
        triangle_source=own[parts.source],
    )
