"""Judges garments in a given shape: what is wrong with them as worn, without a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from warp_cloth.avatar.exact import exact_colliders
from warp_cloth.avatar.solid import solid_of
from warp_cloth.base.cache import Cache
from warp_cloth.base.device import device_named
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.base.threads import one_thread_at_a_time
from warp_cloth.contact.garments import modelled_crossings, placed, worn_crossings
from warp_cloth.fitting.fit import loaded_scene
from warp_cloth.fitting.overlap import avatar_overlaps
from warp_cloth.fitting.placement import LimbPlacement
from warp_cloth.fitting.problem import tolerance_of
from warp_cloth.fitting.warm_start import earlier_garments
from warp_cloth.garment.outfit import Outfit, load_outfit
from warp_cloth.model.first_attempt import first_attempt
from warp_cloth.model.fit_problem import FitProblem
from warp_cloth.model.result import FitResult, Residual, Status
from warp_cloth.report.measurements import Measurements
from warp_cloth.report.problems import find_problems
from warp_cloth.report.verdict import is_worn, shape_verdict
from warp_cloth.scene import Scene
from warp_cloth.solver.certificate.certifier import Check
from warp_cloth.solver.certificate.strains import strain_summary
from warp_cloth.solver.goal import Outcome

FARTHEST = 1e4  # [m]
STILL = Check(0, Residual(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, True)  # what a shape at rest would be measured to have


@dataclass(frozen=True)
class Judgement:
    """What is wrong with a shape."""

    problems: tuple[FitProblem, ...]  # the likeliest cause first
    message: str  # the verdict in words

    @property
    def worn(self) -> bool:
        """Whether garments at rest in this shape would be worn."""
        return is_worn(Status.AT_REST, self.problems)


@one_thread_at_a_time
def judge(
    scene: Scene | str | Path | Mapping[str, Any],
    shape: FitResult | str | Path | ArrayLike | Sequence[ArrayLike],
    *,
    on: str | Path | None = None,
    fabric: Any = None,
    device: str | None = None,
    overrides: Sequence[str] | Mapping[str, Any] = (),
) -> Judgement:
    """Judges garments in a shape that something else made: another program, an edit by hand, an earlier version.

    Nothing is relaxed, so it is quick, and does not tell whether the shape is at rest: take that as given.

    >>> warp_cloth.judge("shirt.toml", "edited.usdc").problems
    >>> warp_cloth.judge("shirt.obj", points, on="body.obj").worn

    Args:
        scene: what ``warp_cloth.fit`` takes; where its garments start tells which limb each opening is for.
        shape: vertices of its garment [m], shape [V, 3], in the order of its mesh as loaded (of several garments a
            list, inner to outer); or an earlier result, or its file, of the same meshes.
        on: the body, as for ``warp_cloth.fit``.
        fabric: of the garment, as for ``warp_cloth.fit``.
        device: "cpu", "cuda" or "cuda:N"; None: a GPU if there is one.
        overrides: changes to the scene, as for ``warp_cloth.fit``.

    Raises:
        InputError: the scene or the shape cannot be used, or the shape is not one of these garments.
    """
    chosen, name = loaded_scene(scene, overrides, on, fabric), device_named(device)
    outfit = load_outfit(chosen)
    try:
        points = _points_of(shape, chosen, outfit.meshes)
    except InputError:
        outfit = load_outfit(chosen, divides=False)  # another program knows the file's own faces alone
        points = _points_of(shape, chosen, outfit.meshes)
    return judged_shape(chosen, outfit, points, name)


def judged_shape(scene: Scene, outfit: Outfit, points: Points, device: str) -> Judgement:
    """Judges a scene's garments, one after another at these points [m], all finite, shape [V, 3]."""
    attempt, cache = first_attempt(scene, outfit), Cache()
    start = outfit if attempt.posed else placed([attempt.scene], [outfit], device, cache)[0]
    measured = measured_shape(outfit, points, device)
    outcome = Outcome(Status.AT_REST, STILL, points, 0, 0.0)
    problems = find_problems(attempt.scene, start, outcome, measured, tolerance_of(attempt.scene))
    return Judgement(problems, shape_verdict(problems))


def measured_shape(outfit: Outfit, points: Points, device: str, contact: dict[str, Any] | None = None) -> Measurements:
    """What is measured of garments, one after another at these points [m], shape [V, 3]; ``contact``: of a collider."""
    garments, avatar = outfit.garments, outfit.avatar
    starts = np.cumsum([0, *(len(garment.points) for garment in garments)])
    ends = np.concatenate([each.rest.topology.edges + at for each, at in zip(garments, starts, strict=False)])
    natural = np.concatenate([garment.rest.edge_length for garment in garments])
    strains = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1) / natural - 1.0
    surface = None if avatar is None else solid_of(avatar).closing.surface(avatar)
    (overlap,) = avatar_overlaps([outfit], [points], [strains], exact_colliders([surface], device))
    (crossings,) = worn_crossings([outfit], [points], device)
    placement = LimbPlacement.of(outfit, points)
    limbs = placement.misplaced, placement.off_shoulders
    modelled = modelled_crossings(outfit, device) if crossings.pairs else ()
    return Measurements(strain_summary(strains), {}, strains, overlap, crossings, contact, *limbs, modelled)


def _points_of(shape: Any, scene: Scene, meshes: Sequence[Mesh]) -> Points:
    """The vertices of a scene's garments in a shape, one after another [m], shape [V, 3]."""
    if isinstance(shape, FitResult | str | Path):
        parts = []
        for spec, new, (mesh, points) in zip(scene.garments, meshes, earlier_garments(shape, scene), strict=True):
            if mesh.vertex_count != new.vertex_count or not np.array_equal(mesh.triangles, new.triangles):
                place = shape if isinstance(shape, str | Path) else "shape"
                fault = f'"{spec.name}" has other vertices or triangles there than in the scene'
                raise InputError(place, fault, "give a shape of the same mesh")
            parts.append(points)
    else:
        is_list = isinstance(shape, list | tuple) and (len(meshes) > 1 or len(shape) == 1)
        arrays = list(shape) if is_list else [shape]
        if len(arrays) != len(meshes):
            raise InputError("shape", f"has {len(arrays)} arrays for {len(meshes)} garments", "give one for each")
        parts = [_vertices(each, mesh) for each, mesh in zip(arrays, meshes, strict=True)]
    points = np.concatenate(parts)
    if not (np.abs(points) < FARTHEST).all():
        raise InputError("shape", f"has coordinates that are not finite, or beyond {FARTHEST:g} m", "give metres")
    return points


def _vertices(array: Any, mesh: Mesh) -> Points:
    try:
        points = np.array(array, dtype=np.float64)
    except (TypeError, ValueError):
        points = np.zeros(0)
    wanted = mesh.vertex_count, 3
    if points.shape != wanted:
        found = f"shape {points.shape}" if points.size else type(array).__name__
        raise InputError(
            "shape", f'"{mesh.name}" needs an array of {wanted}, not {found}', "give its vertices as loaded"
        )
    return points
