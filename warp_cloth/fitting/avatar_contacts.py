"""The avatars' contact of scenes that relax together, built once for all that start alike on one avatar."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import partial

import numpy as np

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.contact import AvatarContact, ContactOptions
from warp_cloth.avatar.depth import DEFAULT_REACH
from warp_cloth.avatar.solid import solid_of
from warp_cloth.base.cache import Cache
from warp_cloth.contact.garments import highest_lift
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.plan import contact_kind
from warp_cloth.scene import Scene


def contact_key(scene: Scene, outfit: Outfit) -> Hashable:
    """A key that is equal for scenes with the same first collider."""
    return id(outfit.avatar), _avatar_collision(scene), *(id(garment.points) for garment in outfit.garments)


def _avatar_collision(scene: Scene) -> Hashable:
    """What the scene says of the collider, whether cloth meets cloth or not."""
    return scene.collision.model_copy(update={"cloth": False}), highest_lift(scene)


def avatar_contacts(
    scenes: Sequence[Scene], outfits: Sequence[Outfit], device: str, earlier: AvatarContact | None, cache: Cache
) -> tuple[list[AvatarContact], list[Collider]]:
    """Avatar contact and first collider of every scene; built once for scenes that start alike on one avatar."""

    def build(scene: Scene, outfit: Outfit) -> tuple[AvatarContact, Collider]:
        contact = _avatar_contact(scene, outfit, device, cache)
        points = np.concatenate([garment.points for garment in outfit.garments])
        reused = contact.reused_from(earlier, points) if earlier is not None else None
        return contact, reused or contact.collider(points)

    sources = [
        (each.padded or each.avatar, earlier, *(garment.points for garment in each.garments)) for each in outfits
    ]
    keys = {
        cache.key("contact", source, _avatar_collision(scene), device)
        for source, scene in zip(sources, scenes, strict=True)
    }
    cache.evict_except(keys)
    contacts, colliders = [], []
    for source, scene, outfit in zip(sources, scenes, outfits, strict=True):
        make = partial(build, scene, outfit)
        contact, collider = cache.get_or_make(
            "contact", source, make, _avatar_collision(scene), device, size=lambda made: made[0].bytes
        )
        contacts.append(contact.alike())
        colliders.append(collider)
    return contacts, colliders


def _avatar_contact(scene: Scene, outfit: Outfit, device: str, cache: Cache) -> AvatarContact:
    avatar, kind = outfit.starting_avatar, contact_kind(scene, outfit)
    solid = None
    if avatar is not None and kind != "none":
        solid = cache.get_or_make("solid", (avatar,), partial(solid_of, avatar))
    options = ContactOptions(
        kind,
        pixel=scene.collision.pixel,
        offset=scene.collision.offset,
        error=scene.collision.error,
        device=device,
        reach=DEFAULT_REACH + highest_lift(scene),
    )
    return AvatarContact(
        avatar,
        options,
        solid=solid,
        place=scene.avatar.place if scene.avatar is not None else "avatar",
    )
