"""Posed starts: the avatar comes to the garment, posed and thin within it; there it is sewn, then carried home.

A garment that was drafted for another body starts with panels on the wrong side of limbs, and no force undoes that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.contact import followed
from warp_cloth.avatar.depth import DEFAULT_REACH
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.avatar.field import FieldBuild, build_contact_field
from warp_cloth.avatar.layers import build_layered_buffers
from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.dressing.posing import STATIONS, PosedBody
from warp_cloth.dressing.routes import curves_of, limb_routes
from warp_cloth.fitting.problem import Problem, build_problem
from warp_cloth.garment.outfit import Outfit, garments_in
from warp_cloth.kernels.avatar.field import ContactField, field_contact
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.attempt import Attempt, Patience
from warp_cloth.model.result import LevelRun, Status
from warp_cloth.scene import Scene
from warp_cloth.scene.schema import SolverSpec
from warp_cloth.solver.certificate.strains import edge_strains
from warp_cloth.solver.loop import BURST

# Light and stretchy, so that seams close at once, and stiff in folds: with a hundredth of the bending it crumples.
FABRIC = Fabric(
    name="sewing",
    weight=3e-3,
    stretch_warp=20e3,
    stretch_weft=20e3,
    bending_warp=1e-5,
    bending_weft=1e-5,
    thickness=1e-3,
    friction=0.0,
)
FRICTION = 0.5  # of cloth on skin: without any, straps slide off shoulders that grow under them
THIN = 0.03  # [m]; what the body has at most around its curves while it is within the garment
THICK = 0.25  # [m]; what it has just before it is whole
SEWING = 1500  # iterations at most
SEWING_CHECK = 100  # iterations between looks at the seams
SEWN = 0.2  # strain of the edges of seams that have closed
STEPS = 24  # from there home
POSED_FOR = 0.5  # fraction of the steps after which all limbs are home; then they only grow
GROWTH = 2.0  # exponent of the thickness over the steps: slow while limbs move
PIXEL = 0.006  # [m] of the body's layers; with 4 mm a start takes twice as long
OFFSET = 0.003  # [m]
MARGIN = 0.06  # [m] around the garment, within which the body is drawn
CACHE_NAME = "posed"


@dataclass(frozen=True, eq=False)
class _PosedStart:
    """A garment sewn round the posed avatar and carried home."""

    points: Points | None  # [m], shape [V, 3]; None: it diverged
    run: LevelRun


def start_posed(problem: Problem, cache: Cache) -> tuple[LevelRun, ...]:
    """Moves a lone scene's garment to where it is sewn and worn by the avatar; returns the relaxation that this took.

    The same for all fabrics and frictions, so it is made once for each garment and avatar.
    """
    (scene,), (outfit,) = problem.scenes, problem.loaded
    device = problem.model.device
    garment = outfit.garments[0]
    sources = outfit.avatar, garment.points, garment.rest.topology
    make = partial(_sewn_and_carried, scene, outfit, str(device))
    start = cache.get_or_make(CACHE_NAME, sources, make, scene.solver.precision, scene.collision.cloth, device)
    if start.points is not None:
        problem.model.set_points(start.points)
        if not problem.contact.covers(start.points):
            problem.relaxation.set_collider(0, problem.contact.collider(start.points))
    return (start.run,)


def _sewn_and_carried(scene: Scene, outfit: Outfit, device: str) -> _PosedStart:
    (wearing,), avatar = outfit.wearing, outfit.avatar
    if wearing is None or avatar is None:
        raise ValueError("the garment has no openings, or the avatar no limbs")
    sewing = _sewing_scene(scene)
    (garment,) = garments_in(sewing, outfit.meshes)
    garment = replace(garment, points=garment.points + wearing.shift(garment.points))
    body = PosedBody(avatar, wearing.skeleton)
    curves = curves_of(limb_routes(wearing, garment.points), wearing.skeleton, STATIONS)
    surface = body.points(curves, THIN)
    sewn = replace(outfit, garments=(garment,), avatar=replace(avatar, points=surface))
    attempt = Attempt(sewing, sewing, patience=Patience.NONE, posed=True)
    problem = build_problem([sewing], [sewn], device, attempts=[attempt])
    relaxation = problem.relaxation
    collider = _BodyCollider(avatar.triangles, device)
    relaxation.set_collider(0, collider.of(surface, garment.points))
    iterations = _sew(problem)
    for step in range(1, STEPS + 1):
        before, surface = surface, _on_the_way(body, curves, avatar, step)
        exact = build_exact_collider(replace(avatar, points=before), device)
        cloth = followed(exact, surface, problem.model.points())
        problem.model.set_points(cloth)
        relaxation.set_collider(0, collider.of(surface, cloth))
        iterations = _relax(problem, iterations, BURST)
    relaxation.update_model()
    points = problem.model.points()
    is_finite = bool(np.isfinite(points).all())
    run = LevelRun(len(points), iterations, Status.ITERATION_LIMIT if is_finite else Status.DIVERGED)
    return _PosedStart(points if is_finite else None, run)


def _sew(problem: Problem) -> int:
    """Relaxes until the seams have closed and nothing crosses; returns the iterations.

    Not longer: cloth slides down a body without shoulders.
    """
    iterations = 0
    while iterations < SEWING:
        iterations = _relax(problem, iterations, SEWING_CHECK)
        is_calm = problem.schedule is not None and problem.schedule.calm
        if not is_calm and float(edge_strains(problem.model).max(initial=0.0)) < SEWN:
            break
    return iterations


def _relax(problem: Problem, iterations: int, count: int) -> int:
    """Relaxes for ``count`` iterations; returns how many there have been."""
    problem.relaxation.run(count)
    problem.relaxation.update_model()
    if problem.schedule is not None:
        problem.schedule.advance(iterations + count)
    return iterations + count


def _on_the_way(body: PosedBody, curves: list[Points], avatar: Mesh, step: int) -> Points:
    """The avatar's vertices after a step of the way home [m]."""
    if step == STEPS:
        return avatar.points
    done = step / STEPS
    thickness = THIN + (THICK - THIN) * done**GROWTH
    return body.points(body.between(curves, max(1.0 - done / POSED_FOR, 0.0)), thickness)


def _sewing_scene(scene: Scene) -> Scene:
    """The scene in the fabric that is sewn."""
    avatar = scene.avatar
    solver = SolverSpec(
        method="accelerated",
        start="placed",
        iterations=SEWING,
        precision=scene.solver.precision,
        threads=scene.solver.threads,
    )
    return scene.model_copy(
        update={
            "name": "sewing",
            "garments": tuple(spec.model_copy(update={"fabric": FABRIC}) for spec in scene.garments),
            "avatar": None if avatar is None else avatar.model_copy(update={"friction": FRICTION}),
            "collision": scene.collision.model_copy(update={"avatar": "depth"}),
            "solver": solver,
        }
    )


class _BodyCollider:
    """Colliders of a body that moves, drawn in layers since limbs lie before each other; the last one is kept."""

    def __init__(self, triangles: Indices, device: str) -> None:
        self._triangles, self._device = triangles, device
        self._built: list[FieldBuild] = []

    def of(self, surface: Points, cloth: Points) -> Collider:
        """The collider of a body with these vertices, near cloth at these points [m]."""
        lower = np.maximum(cloth.min(axis=0), surface.min(axis=0)) - MARGIN
        upper = np.minimum(cloth.max(axis=0), surface.max(axis=0)) + MARGIN
        buffers = build_layered_buffers(surface, self._triangles, lower, upper, PIXEL, self._device)
        field = build_contact_field(buffers, reach=DEFAULT_REACH)
        self._built = [*self._built[-1:], field]  # the one before is in use until the new one is set
        return Collider(field_contact, field.limited_to(OFFSET, 0.0), ContactField)
