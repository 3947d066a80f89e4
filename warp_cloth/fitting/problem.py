"""Scenes on a device, ready to relax: model, colliders, relaxation and certifier of one or several scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.contact import AvatarContact, avatar_modules
from warp_cloth.base.cache import Cache
from warp_cloth.base.choice import Choice
from warp_cloth.base.clock import StageClock
from warp_cloth.base.compiling import load_modules
from warp_cloth.base.first_run import kernels_known
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.contact.garments import build_cloth_contact, model_crossings, placed
from warp_cloth.fitting.avatar_contacts import avatar_contacts
from warp_cloth.fitting.compile_ahead import compile_ahead
from warp_cloth.fitting.nested_iteration import start_from_coarse
from warp_cloth.fitting.placement import LimbPlacement
from warp_cloth.fitting.poses import PoseRun, follow_poses
from warp_cloth.garment.garment import terms_of
from warp_cloth.garment.outfit import MeshCache, Outfit, load_outfit
from warp_cloth.loading.raw import counted
from warp_cloth.model.attempt import Attempt
from warp_cloth.model.first_attempt import MOST_ITERATIONS, first_attempt, may_begin_posed, posed_first, trial_attempt
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.model.patches.on_device import CutOptions
from warp_cloth.model.plan import contact_kind
from warp_cloth.model.result import LevelRun
from warp_cloth.model.vertices import AvatarSkin
from warp_cloth.report.numbers import short_number
from warp_cloth.scene import Scene
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.certificate.rest_error import GROWING
from warp_cloth.solver.certificate.strains import strain_kernels
from warp_cloth.solver.contact_schedule import ContactSchedule, build_contact_schedule
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation, build_relaxation
from warp_cloth.solver.loop import Boxes, Follow
from warp_cloth.solver.parallel_domains import thread_count
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import Method, StepOptions


@dataclass(frozen=True, eq=False)
class Problem:
    """Scenes of one ``problem_kind`` on a device, ready to relax together; each scene is an item."""

    attempts: tuple[Attempt, ...]
    loaded: tuple[Outfit, ...]
    outfits: tuple[Outfit, ...]  # those, moved clear of their avatars
    contacts: tuple[AvatarContact, ...]
    model: ClothModel
    relaxation: Relaxation
    certifier: Certifier
    schedule: ContactSchedule | None  # of cloth contact; None: without
    pose_run: PoseRun | None = None  # how the garments followed the avatar's poses, where it has any

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scenes, with nothing left to decide."""
        return tuple(attempt.scene for attempt in self.attempts)

    @property
    def outfit(self) -> Outfit:
        """The outfit of the first scene, or of the only one."""
        return self.outfits[0]

    @property
    def contact(self) -> AvatarContact:
        """The avatar contact of the first scene, or of the only one."""
        return self.contacts[0]

    def avatar_surfaces(self) -> list[Mesh | None]:
        """The surface of each item's avatar, for distances; one object for all items that share an avatar."""
        found: dict[int, Mesh] = {}
        for outfit, contact in zip(self.outfits, self.contacts, strict=True):
            if outfit.avatar is not None and id(outfit.avatar) not in found:
                found[id(outfit.avatar)] = contact.surface(outfit.avatar)
        return [None if each.avatar is None else found[id(each.avatar)] for each in self.outfits]

    def place(self, points: Points, earlier: AvatarContact | None = None) -> None:
        """Moves the only scene's garments to these points [m], shape [V, 3], with a collider that covers them.

        It is that of an ``earlier`` contact with the same avatar, where that does.
        """
        self.model.set_points(points)
        if not self.contact.covers(points):
            reused = None if earlier is None else self.contact.reused_from(earlier, points)
            self.relaxation.set_collider(0, reused or self.contact.collider(points))

    def contact_report(self, item: int) -> dict[str, Any] | None:
        """The collider of an item's avatar and its error, for the report; None without avatar."""
        if self.outfits[item].avatar is None:
            return None
        poses = asdict(self.pose_run) if self.pose_run is not None else None
        return {**(self.contacts[item].report or {}), "carried": poses}

    def choices(self, item: int) -> tuple[Choice, ...]:
        """What was chosen for an item where its scene says "auto", in the order of the scene's keys."""
        of_rest = [choice for garment in self.outfits[item].garments for choice in garment.rest.source.choices]
        return (*self.outfits[item].readings, *of_rest, *self._avatar_choices(item), *self.attempts[item].choices)

    def _avatar_choices(self, item: int) -> tuple[Choice, ...]:
        """The collider that "auto" has come to."""
        report = self.contacts[item].report
        if self.scenes[item].collision.avatar != "auto" or not report or not report.get("error_mm"):
            return ()
        views, error = counted(len(report["buffers"]), "view"), short_number(report["error_mm"]["p999"], 2)
        return (
            Choice("collision.avatar", "depth", f"{views} show 99.9 % of the skin near the cloth within {error} mm"),
        )

    def goals(self) -> list[Goal]:
        """What each item is to reach."""
        return [
            Goal(
                tolerance_of(attempt.scene),
                limit_of(attempt.scene),
                attempt.patience,
                ends_crossing=attempt.ends_crossing,
                sews=attempt.trial and not attempt.starts_dressed,
                turn_after=attempt.turn_after,
                ends_misworn=attempt.ends_misworn,
            )
            for attempt in self.attempts
        ]

    def crossing_items(self, items: Sequence[int]) -> list[int]:
        """Which of these items' cloth passes through cloth now."""
        self.relaxation.update_model()
        found = model_crossings(self.model, self.outfits)
        return [item for item in items if found[item].pairs]

    def falling_items(self, items: Sequence[int]) -> list[int]:
        """Of which of these items cloth falls now that nothing can catch."""
        self.relaxation.update_model()
        points = self.model.points()
        found = []
        for item in items:
            outfit, own = self.outfits[item], points[self.model.of_item(item)]
            if np.isfinite(own).all() and outfit.catcher.falling(own).any():
                found.append(item)
        return found

    def is_astray(self) -> bool:
        """Whether a limb of the only scene's avatar is outside its opening now, or within the cloth."""
        self.relaxation.update_model()
        points = self.model.points()
        if not np.isfinite(points).all():
            return False
        return LimbPlacement.of(self.loaded[0], points).is_astray


def problem_kind(scene: Scene, outfit: Outfit) -> tuple[Any, ...]:
    """A key that is equal for scenes that can relax together: their kernels are then those of each alone.

    A scene with cloth contact has a kind of its own, because what it launches depends on how its garments lie. So has
    one whose avatar moves or is posed, and one of the multilevel method.
    """
    usual = first_attempt(scene, outfit)
    attempt = trial_attempt(usual, outfit) or usual
    decided, solver = attempt.scene, attempt.scene.solver
    contact = contact_kind(decided, outfit)
    is_alone = decided.collision.cloth or outfit.poses or attempt.posed or solver.method == "multilevel"
    identity = id(scene) if is_alone else 0
    is_dressed = solver.start == "dressed"
    return solver.method, attempt.trial, is_dressed, solver.precision, contact, identity, terms_of(outfit.garments)


def load_problem(
    scene: Scene,
    device: str,
    *,
    mesh_cache: MeshCache | None = None,
    earlier: AvatarContact | None = None,
    cache: Cache | None = None,
    options: StepOptions | None = None,
    clock: StageClock | None = None,
    may_pose: bool = True,
) -> Problem:
    """Loads one scene and builds its problem.

    ``mesh_cache`` holds meshes that earlier scenes share with it. ``earlier`` is an avatar contact to reuse, so that a
    change of fabric or offset need not sample the avatar again. ``may_pose`` is that of ``first_attempt``; the other
    arguments are those of ``build_problem``.
    """
    clock = clock or StageClock()
    compile_ahead(scene, device, clock)
    clock.begin("load")
    outfit = load_outfit(scene, mesh_cache)
    clock.lap("load")
    cache = cache or Cache()
    attempt = _first_attempt(scene, outfit, device, cache, may_pose=may_pose)
    return build_problem([attempt], [outfit], device, earlier=earlier, cache=cache, options=options, clock=clock)


def build_problem(
    scenes: Sequence[Scene | Attempt],
    outfits: Sequence[Outfit],
    device: str,
    *,
    earlier: AvatarContact | None = None,
    cache: Cache | None = None,
    like: int | None = None,
    options: StepOptions | None = None,
    clock: StageClock | None = None,
) -> Problem:
    """Builds what the scenes' plans name on the device, and compiles the kernels.

    Args:
        scenes: loaded scenes of one ``problem_kind``, at their first attempt, or attempts at them.
        outfits: of each scene.
        device: Warp's name of it.
        earlier: an avatar contact to reuse.
        cache: what earlier problems left of the same garments and avatars.
        like: vertex count of a larger problem of the same garments, whose patches serve again (see build_model).
        options: of an iteration's step; None: the method's defaults.
        clock: measures the stages.
    """
    clock, cache = clock or StageClock(), cache or Cache()
    attempts = [
        each if isinstance(each, Attempt) else _first_attempt(each, outfit, device, cache)
        for each, outfit in zip(scenes, outfits, strict=True)
    ]
    if outfits[0].avatar is not None and wp.get_device(device).is_cuda:  # the CPU may find what they do on disk
        clock.begin("compile")
        load_modules(avatar_modules(contact_kind(attempts[0].scene, outfits[0])), device)
        clock.lap("compile")
    clock.begin("build")
    problem = _assemble(attempts, outfits, device, earlier, cache, like, options)
    wp.synchronize_device(device)
    clock.lap("build")
    clock.begin("compile")
    relaxation, certifier = problem.relaxation, problem.certifier
    kernels = [relaxation.slowest_to_compile, *relaxation.kernels(), *relaxation.seldom_kernels(), *certifier.kernels()]
    if not kernels_known(device):
        kernels += strain_kernels(problem.model.precision, problem.model.terms)
    load_modules([kernel.module for kernel in kernels], device)
    clock.lap("compile")
    if not problem.outfit.poses:
        return problem
    clock.begin("carry")
    pose_run = _through_poses(problem)
    clock.lap("carry")
    return replace(problem, certifier=Certifier(relaxation), pose_run=pose_run)


def _first_attempt(scene: Scene, outfit: Outfit, device: str, cache: Cache, *, may_pose: bool = True) -> Attempt:
    """The first attempt, a trial where that may do."""
    trial = trial_attempt(first_attempt(scene, outfit), outfit) if may_pose else None
    return trial or usual_first_attempt(scene, outfit, device, cache, may_pose=may_pose)


def usual_first_attempt(scene: Scene, outfit: Outfit, device: str, cache: Cache, *, may_pose: bool = True) -> Attempt:
    """The first attempt, with the avatar posed where garments moved clear of it would be round the wrong limbs."""
    attempt = first_attempt(scene, outfit, may_pose=may_pose)
    if attempt.posed or not attempt.touches or not (may_pose and may_begin_posed(scene, outfit)):
        return attempt
    (moved,) = placed([attempt.scene], [outfit], device, cache)
    points = np.concatenate([garment.points for garment in moved.garments])
    if moved is not outfit and LimbPlacement.of(moved, points).is_astray:
        return posed_first(scene, outfit, "moved clear of the body it would be round the wrong limbs")
    return attempt


def _assemble(
    attempts: Sequence[Attempt],
    loaded: Sequence[Outfit],
    device: str,
    earlier: AvatarContact | None,
    cache: Cache,
    like: int | None,
    options: StepOptions | None,
) -> Problem:
    """The problem's arrays on the device, their kernels not compiled yet; arguments as in ``build_problem``."""
    scenes = [attempt.scene for attempt in attempts]
    first = scenes[0]
    outfits = list(loaded) if attempts[0].posed else placed(scenes, loaded, device, cache)
    contacts, colliders = avatar_contacts(scenes, outfits, device, earlier, cache)
    garments = [garment for outfit in outfits for garment in outfit.garments]
    model = build_model(
        garments,
        device=device,
        precision=first.solver.precision,
        garment_counts=[len(outfit.garments) for outfit in outfits],
        avatars=[
            AvatarSkin(scene.avatar.friction if scene.avatar is not None else 0.0, scene.collision.offset)
            for scene in scenes
        ],
        cache=cache,
        cut=CutOptions(bool(first.collision.cloth) and len(outfits[0].garments) > 1, like),
    )
    threads = thread_count(first.solver.threads, model.vertex_count)
    options = options or StepOptions(method=decided_method(first), threads=threads)
    cloth_contact = build_cloth_contact(first, outfits[0], model, device) if first.collision.cloth else None
    caps = [scene.solver.cap for scene in scenes]
    relaxation = build_relaxation(options, model, colliders, garments, cloth_contact, caps)
    certifier = Certifier(relaxation)
    schedule = None
    if cloth_contact is not None:
        schedule = build_contact_schedule(outfits[0].garments, relaxation, cloth_contact)
    return Problem(
        tuple(attempts), tuple(loaded), tuple(outfits), tuple(contacts), model, relaxation, certifier, schedule
    )


def tolerance_of(scene: Scene) -> Tolerance:
    """The scene's tolerances in SI units."""
    solver = scene.solver
    growing = math.inf if solver.method == "direct" else GROWING  # the paper's rule never stops oscillating
    return Tolerance(solver.residual, solver.residual_p99, solver.tolerance, growing)


def decided_method(scene: Scene) -> Method:
    """The method of a scene with nothing left to decide."""
    method = scene.solver.method
    if method == "auto":
        raise ValueError("the scene's method is not decided yet")
    return method


def limit_of(scene: Scene) -> int:
    """Most iterations of a scene."""
    return MOST_ITERATIONS if scene.solver.iterations is None else scene.solver.iterations


def start_coarse(problem: Problem, clock: StageClock | None = None) -> tuple[LevelRun, ...]:
    """Nested iteration, where the method has it: relaxes coarse garments first, and starts from their shapes.

    Not where cloth meets cloth: coarse garments would go through themselves.
    """
    relaxation = problem.relaxation
    if not isinstance(relaxation, MultilevelRelaxation) or relaxation.cloth_contact or problem.outfit.poses:
        return ()
    (scene,) = problem.scenes
    clock = clock or StageClock()

    def load(kernels: Sequence[wp.Kernel]) -> None:
        clock.lap("relax")
        load_modules([kernel.module for kernel in kernels], problem.model.device)
        clock.lap("compile")

    clock.begin("relax")
    levels = start_from_coarse(
        relaxation,
        problem.contact if problem.outfit.avatar is not None else None,
        tolerance=tolerance_of(scene),
        limit=limit_of(scene),
        load=load,
    )
    clock.lap("relax")
    return levels


def _through_poses(problem: Problem) -> PoseRun:
    """Moves a lone scene's garments along with its avatar, to the last pose."""
    (scene,) = problem.scenes
    return follow_poses(
        problem.relaxation,
        problem.certifier,
        problem.contact,
        problem.outfit.poses,
        tolerance=tolerance_of(scene),
        limit=limit_of(scene),
        follow=collider_updates(problem),
        schedule=problem.schedule,
    )


def collider_updates(problem: Problem) -> Follow:
    """A function that returns new colliders for items whose garments have left the regions of the old ones."""
    regions = np.array([contact.region() for contact in problem.contacts])

    def follow(items: Sequence[int], boxes: Boxes) -> dict[int, Collider]:
        left = (boxes[:, 0] < regions[items, 0]).any(axis=1) | (boxes[:, 1] > regions[items, 1]).any(axis=1)
        colliders = {}
        for at in np.flatnonzero(left).tolist():
            item = items[at]
            problem.relaxation.update_model()
            colliders[item] = problem.contacts[item].collider(problem.model.points(item))
            regions[item] = problem.contacts[item].region()
        return colliders

    return follow
