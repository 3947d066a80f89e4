"""Scenes on a device: what their plans ask for is built there, ready to relax together."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.contact import AvatarContact, ContactOptions, avatar_modules
from warp_cloth.avatar.depth import DEFAULT_REACH
from warp_cloth.avatar.solid import solid_of
from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.warp_setup import keeping_kernels
from warp_cloth.contact.garments import build_cloth_contact, cloth_course, highest_lift, placed
from warp_cloth.fitting.nested_iteration import start_from_coarse
from warp_cloth.fitting.poses import Carried, carry
from warp_cloth.garment.outfit import MeshCache, Outfit, load_outfit
from warp_cloth.garment.part import terms_of
from warp_cloth.model.model import ClothModel, build_model
from warp_cloth.model.plan import contact_kind
from warp_cloth.model.result import LevelRun
from warp_cloth.scene import Scene
from warp_cloth.solver.certificate.certifier import Certifier, Tolerance
from warp_cloth.solver.certificate.rest_error import GROWING
from warp_cloth.solver.contact_schedule import Course
from warp_cloth.solver.implicit.multilevel import MultilevelRelaxation, build_relaxation
from warp_cloth.solver.loop import Boxes, Follow
from warp_cloth.solver.parallel_domains import thread_count
from warp_cloth.solver.relax import Relaxation, StepOptions


@dataclass(frozen=True, eq=False)
class Problem:
    """Scenes on a device, ready to relax together; each is an item. All are of one ``problem_kind``."""

    scenes: tuple[Scene, ...]
    outfits: tuple[Outfit, ...]
    contacts: tuple[AvatarContact, ...]
    model: ClothModel
    relaxation: Relaxation
    certifier: Certifier
    course: Course | None  # where cloth meets cloth
    carried: Carried | None = None  # what it took to bring the garments along, where the avatar moves

    @property
    def outfit(self) -> Outfit:
        """That of the first scene, or of a lone one."""
        return self.outfits[0]

    @property
    def contact(self) -> AvatarContact:
        """That of the first scene, or of a lone one."""
        return self.contacts[0]

    def avatar_surfaces(self) -> list[Mesh | None]:
        """What each item's distances to its avatar are measured from; the same of those whose avatars are the same."""
        found: dict[int, Mesh] = {}
        for outfit, contact in zip(self.outfits, self.contacts, strict=True):
            if outfit.avatar is not None and id(outfit.avatar) not in found:
                found[id(outfit.avatar)] = contact.surface(outfit.avatar)
        return [None if each.avatar is None else found[id(each.avatar)] for each in self.outfits]

    def contact_report(self, item: int) -> dict[str, Any] | None:
        """What an item's avatar is met by, and how good that is; None without avatar."""
        if self.outfits[item].avatar is None:
            return None
        carried = asdict(self.carried) if self.carried is not None else None
        return {**(self.contacts[item].report or {}), "carried": carried}


def problem_kind(scene: Scene, outfit: Outfit) -> tuple[Any, ...]:
    """What scenes must have in common to relax together: then their kernels are those of each alone.

    One whose cloth meets cloth is of a kind of its own: what it launches depends on how its garments lie. So is one
    whose avatar moves, and one of the multilevel method.
    """
    solver = scene.solver
    contact = contact_kind(scene, outfit)
    by_itself = scene.collision.cloth or outfit.poses or solver.method == "multilevel"
    alone = id(scene) if by_itself else 0
    return solver.method, solver.start, solver.precision, contact, alone, terms_of(outfit.parts)


def load_problem(
    scene: Scene,
    device: str,
    *,
    mesh_cache: MeshCache | None = None,
    earlier: AvatarContact | None = None,
    cache: Cache | None = None,
    options: StepOptions | None = None,
    tell: Callable[[str], None] = lambda _: None,
    lap: Callable[[str], None] = lambda _: None,
) -> Problem:
    """Loads one scene and builds its problem; ``mesh_cache`` caches what earlier scenes share with it.

    ``earlier`` is a contact to reuse, so that a change of fabric or offset need not sample the avatar again. The other
    arguments are those of ``build_problem``.
    """
    tell("load")
    outfit = load_outfit(scene, mesh_cache)
    lap("load")
    return build_problem([scene], [outfit], device, earlier=earlier, cache=cache, options=options, tell=tell, lap=lap)


def build_problem(
    scenes: Sequence[Scene],
    outfits: Sequence[Outfit],
    device: str,
    *,
    earlier: AvatarContact | None = None,
    cache: Cache | None = None,
    like: int | None = None,
    options: StepOptions | None = None,
    tell: Callable[[str], None] = lambda _: None,
    lap: Callable[[str], None] = lambda _: None,
) -> Problem:
    """Builds what the scenes' plans ask for on the device, and compiles the kernels.

    Args:
        scenes: loaded scenes of one ``problem_kind``.
        outfits: theirs.
        device: Warp's name of it.
        earlier: a contact that may serve again.
        cache: what earlier set-ups left of the same garments and avatars.
        like: as of build_model: what a larger set-up of the same garments was cut into serves again.
        options: how an iteration moves the cloth; None: the method's defaults.
        tell: told at every stage.
        lap: told the name of every stage at its end.
    """
    first = scenes[0]
    if outfits[0].avatar is not None:
        tell("compile")
        _compile(avatar_modules(contact_kind(first, outfits[0])), device)
        lap("compile")
    tell("build")
    cache = cache or Cache()
    outfits = placed(scenes, outfits, device, cache)
    contacts, colliders = _avatar_contacts(scenes, outfits, device, earlier, cache)
    model = build_model(
        [part for each in outfits for part in each.parts],
        device=device,
        precision=first.solver.precision,
        garments=[len(each.parts) for each in outfits],
        cache=cache,
        layered=first.collision.cloth and len(outfits[0].parts) > 1,
        like=like,
    )
    threads = thread_count(first.solver.threads, model.vertex_count)
    options = options or StepOptions(method=first.solver.method, threads=threads)
    cloth_contact = build_cloth_contact(first, outfits[0], model, device) if first.collision.cloth else None
    parts = [part for each in outfits for part in each.parts]
    relaxation = build_relaxation(
        options, model, colliders, parts, cloth_contact, [scene.solver.cap for scene in scenes]
    )
    certifier = Certifier(relaxation)
    course = cloth_course(outfits[0], relaxation, cloth_contact) if cloth_contact is not None else None
    wp.synchronize_device(device)
    lap("build")
    tell("compile")
    _compile(
        [kernel.module for kernel in relaxation.kernels() + relaxation.seldom_kernels() + certifier.kernels()], device
    )
    lap("compile")
    made = Problem(tuple(scenes), tuple(outfits), tuple(contacts), model, relaxation, certifier, course)
    if not outfits[0].poses:
        return made
    tell("carry")
    carried = _carry(made)
    lap("carry")
    return replace(made, certifier=Certifier(relaxation), carried=carried)


def tolerance_of(scene: Scene) -> Tolerance:
    """The scene's tolerances in SI."""
    solver = scene.solver
    growing = math.inf if solver.method == "direct" else GROWING  # the paper's rule moves by what it chatters
    return Tolerance(solver.residual, solver.residual_p99, solver.tolerance_mm * 1e-3, growing)


def start_coarse(made: Problem) -> tuple[LevelRun, ...]:
    """Lets simplified garments come to rest first, where the method has them; the relaxation goes on from there."""
    relaxation = made.relaxation
    if not isinstance(relaxation, MultilevelRelaxation) or made.outfit.poses:
        return ()
    (scene,) = made.scenes
    return start_from_coarse(
        relaxation,
        made.contact if made.outfit.avatar is not None else None,
        tolerance=tolerance_of(scene),
        limit=scene.solver.iterations,
        load=lambda kernels: _compile([kernel.module for kernel in kernels], made.model.device),
    )


def _carry(made: Problem) -> Carried:
    """Takes a lone scene's garments along to its avatar's last pose."""
    (scene,) = made.scenes
    return carry(
        made.relaxation,
        made.certifier,
        made.contact,
        made.outfit.poses,
        tolerance=tolerance_of(scene),
        limit=scene.solver.iterations,
        follow=collider_updates(made),
        course=made.course,
    )


def contact_key(scene: Scene, outfit: Outfit) -> Hashable:
    """What scenes have in common that meet their avatar alike to begin with."""
    return id(outfit.avatar), scene.collision, *(id(part.points) for part in outfit.parts)


def _avatar_contacts(
    scenes: Sequence[Scene], outfits: Sequence[Outfit], device: str, earlier: AvatarContact | None, cache: Cache
) -> tuple[list[AvatarContact], list[Collider]]:
    """Every scene's contact and first collider; built once for scenes whose garments start alike on one avatar."""

    def built(scene: Scene, outfit: Outfit) -> tuple[AvatarContact, Collider]:
        contact = _avatar_contact(scene, outfit, device, cache)
        points = np.concatenate([part.points for part in outfit.parts])
        taken = contact.reused_from(earlier, points) if earlier is not None else None
        return contact, taken or contact.collider(points)

    of = [(outfit.avatar, earlier, *(part.points for part in outfit.parts)) for outfit in outfits]
    keys = {cache.key("contact", met, scene.collision, device) for met, scene in zip(of, scenes, strict=True)}
    cache.evict_except(keys)
    contacts, colliders = [], []
    for met, scene, outfit in zip(of, scenes, outfits, strict=True):
        friction = scene.avatar.friction if scene.avatar is not None else 0.0
        make = partial(built, scene, outfit)
        contact, collider = cache.get_or_make(
            "contact", met, make, scene.collision, device, size=lambda made: made[0].bytes
        )
        contacts.append(contact.alike(friction))
        colliders.append(replace(collider, friction=friction))
    return contacts, colliders


def _compile(modules: list[wp.Module], device: str) -> None:
    """Loads kernels, compiled where Warp's cache does not have them yet.

    For the CPU one after another: two threads of that compiler take twice as long as one (measured, Warp 1.19).
    """
    with keeping_kernels():
        wp.force_load(device, modules=modules, max_workers=0 if wp.get_device(device).is_cpu else None)


def _avatar_contact(scene: Scene, outfit: Outfit, device: str, cache: Cache) -> AvatarContact:
    avatar, kind = outfit.starting_avatar, contact_kind(scene, outfit)
    solid = None
    if avatar is not None and kind != "none":
        solid = cache.get_or_make("solid", (avatar,), partial(solid_of, avatar))
    options = ContactOptions(
        kind,
        pixel=scene.collision.pixel_mm * 1e-3,
        offset=scene.collision.offset_mm * 1e-3,
        error=scene.collision.error_mm * 1e-3,
        device=device,
        reach=DEFAULT_REACH + highest_lift(scene),
    )
    return AvatarContact(
        avatar,
        options,
        friction=scene.avatar.friction if scene.avatar is not None else 0.0,
        solid=solid,
        place=scene.avatar.place if scene.avatar is not None else "avatar",
    )


def collider_updates(made: Problem) -> Follow:
    """What gives items new colliders where their garments leave the region of the old ones."""
    rooms = np.array([contact.region() for contact in made.contacts])

    def follow(items: Sequence[int], boxes: Boxes) -> dict[int, Collider]:
        left = (boxes[:, 0] < rooms[items, 0]).any(axis=1) | (boxes[:, 1] > rooms[items, 1]).any(axis=1)
        found = {}
        for at in np.flatnonzero(left).tolist():
            item = items[at]
            made.relaxation.show()
            found[item] = made.contacts[item].collider(made.model.points(item))
            rooms[item] = made.contacts[item].region()
        return found

    return follow
