"""Waistbands and bands at the hem that are drawn by half, on a fold that is not marked, or cut twice: made whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.band_rings import are_unshaped_skirts, ring_of
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.layers import without_parts
from warp_cloth.pattern.part_roles import roles_of
from warp_cloth.pattern.pieces import mirrored_at
from warp_cloth.pattern.runs import length_of, parts_of_kind
from warp_cloth.pattern.specification import short

KINDS = ("waistband", "hem_band")
HALF = (0.45, 0.51)  # length of such a band, over what it goes round; a shorter one gathers it, a longer one is whole
LEAST_WAIST = 0.5  # [m] of a band that is whole, but for children
SURE = 0.9  # that it is one


def with_whole_bands(parts: Sequence[Part]) -> tuple[tuple[Part, ...], list[str]]:
    """The parts, with the only band of a kind opened at its end if it is as long as half of what it goes round.

    Of a pair one is opened: the other is its other half, or lies behind it. And notes on these.
    """
    out, notes = list(parts), []
    gone: set[int] = set()
    for kind in KINDS:
        bands = parts_of_kind(parts, kind)
        if not bands or {*bands} - {bands[0], parts[bands[0]].twin}:
            continue
        made = _opened(parts, bands[0])
        if made is not None:
            out[bands[0]] = made
            gone |= {*bands[1:]}
            what = f"half a {kind.replace('_', ' ')}, as long as half of what it goes round"
            notes.append(f'piece "{short(made.name)}" is {what}, with no fold line: mirrored at its end')
    return without_parts(out, gone), notes


def _opened(parts: Sequence[Part], band: int) -> Part | None:
    """A band that is half as long as its ring, mirrored at one of its ends; None: it is not."""
    part = parts[band]
    ring = ring_of(parts, band)
    long = part.shape.length(part.roles.get("long", ()))
    if not ring or "end" not in part.roles or not HALF[0] <= long / length_of(parts, ring) <= HALF[1]:
        return None
    is_of_trousers = all(parts[side.panel].kind.startswith("leg") for side in ring)
    if not is_of_trousers and (long > LEAST_WAIST or are_unshaped_skirts(parts, ring)):  # gathered to half, as likely
        return None
    whole = made_whole(part, part.roles["end"])
    return None if whole is None else replace(whole, sure=SURE * part.sure)


def made_whole(part: Part, run: Sequence[int]) -> Part | None:
    """Half a band or collar and its mirror image at a run of its edges, as one; None: that is no straight fold."""
    made = mirrored_at(part.edges, run)
    if made is None:
        return None
    edges, mirror, matrix, shift = made
    whole = replace(
        part,
        edges=edges,
        numbers=tuple(range(len(edges))),
        mirror=mirror,
        notches=np.concatenate([part.notches, part.notches @ matrix.T + shift]),
        lines=(*part.lines, *(line @ matrix.T + shift for line in part.lines)),
        twin=None,
    )
    return replace(whole, roles=roles_of(part.kind, whole.shape, True, False, False))
