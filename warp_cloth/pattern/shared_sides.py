"""Side panels that are of neither front nor back: tried as either, and taken as what lengths and notches say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from warp_cloth.pattern.bibs import with_bibs
from warp_cloth.pattern.bibs_on_bands import with_bibs_on_bands
from warp_cloth.pattern.collars import with_collars
from warp_cloth.pattern.draft import Part, Stated, parts_of
from warp_cloth.pattern.godets import with_marks_of_godets
from warp_cloth.pattern.half_bands import with_whole_bands
from warp_cloth.pattern.kinds import SIDE_PANEL
from warp_cloth.pattern.layers import with_single_layers
from warp_cloth.pattern.narrow_ends import with_narrow_ends_doubted
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.proposal import SEWN_FROM, proposed_joints
from warp_cloth.pattern.skirt_panels import with_skirt_panels
from warp_cloth.pattern.specification import short
from warp_cloth.pattern.straight_armholes import with_straight_armholes
from warp_cloth.pattern.straps import with_straps
from warp_cloth.pattern.tiers import with_tiers

SEAM_APART = 0.02  # relative, to which a front or back is as long at its side as the panel there
SURER = 0.02  # of mean confidence, by which one way is to be surer than the other
WAYS = ("side_front", "side_back")  # as which a panel between front and back goes on
SEAMS = ("princess", "side", "sleeve cap")


def parts_with_sides(
    file: str, pieces: Sequence[Piece], stated: Mapping[str, Stated]
) -> tuple[tuple[Part, ...], list[str]]:
    """The parts of a garment, its side panels between front and back among them; raises what ``parts_of`` raises."""
    shared = [piece for piece in pieces if piece.what.panel == SIDE_PANEL and not piece.what.kind]
    names = [piece.name for piece in shared if piece.name not in stated]
    fronts = any(piece.what.kind in ("front", "back") for piece in pieces)
    if len(names) != 1 or not fronts:
        return _made(file, pieces, stated)
    tried = []
    for way in WAYS:
        parts, notes = _made(file, pieces, {**stated, names[0]: Stated(way)})
        parts = _parted(parts, way, is_shared=True)
        tried.append((_sure(parts), way, parts, notes))
    tried.sort(key=lambda each: -each[0])
    (best, way, parts, notes), (next_best, *_) = tried
    place = f'piece "{short(names[0])}"'
    if not _is_sewn(parts) or (best - next_best < SURER and not _is_alike(parts, tried[1][2])):
        note = f"{place} may go on from the front or the back: state its place, side_front or side_back"
        parts, notes = _made(file, pieces, stated)
        return parts, [*notes, note]
    return parts, [*notes, f"{place} is between front and back, by its lengths: as if it were of the {way[5:]}"]


def _made(file: str, pieces: Sequence[Piece], stated: Mapping[str, Stated]) -> tuple[tuple[Part, ...], list[str]]:
    parts, notes = parts_of(file, pieces, stated)
    for way in WAYS:
        parts = _parted(parts, way)
    parts, bibs = with_bibs(with_straight_armholes(parts))
    parts = with_narrow_ends_doubted(with_tiers(with_straps(parts)))
    parts, layers = with_single_layers(with_skirt_panels(parts))
    parts, halves = with_whole_bands(parts)
    parts = with_bibs_on_bands(parts)
    parts, collars = with_collars(with_marks_of_godets(parts))
    return parts, [*notes, *bibs, *layers, *halves, *collars]


def _parted(parts: Sequence[Part], way: str, is_shared: bool = False) -> tuple[Part, ...]:
    """The parts, with armholes of fronts and backs from where the side panel ends, also where no sharp corner is.

    ``is_shared``: the panel is between front and back, so that the other one ends at it, too.
    """
    panel = next((part for part in parts if part.kind == way), None)
    if panel is None:
        return tuple(parts)
    roles = panel.roles
    outer = roles.get("side+") or roles.get("side-") or ()
    lengths = {"princess": panel.shape.length(roles.get("princess", ())), "side": panel.shape.length(outer)}
    faces = ("front", "back") if is_shared else (way[5:],)
    out = []
    for part in parts:
        role = "princess" if part.kind == way[5:] else "side"
        own = dict(part.roles)
        for mark in "+-" if part.kind in faces else "":
            run = own.get(f"{role}{mark}", ())
            upward = run if mark == "+" else run[::-1]
            fits = [n for n in range(1, len(run) + 1) if _agree(part.shape.length(upward[:n]), lengths[role])]
            if f"armhole{mark}" not in own and len(fits) == 1 and fits[0] < len(run):
                lower, upper = upward[: fits[0]], upward[fits[0] :]
                own[f"{role}{mark}"] = lower if mark == "+" else lower[::-1]
                own[f"armhole{mark}"] = upper if mark == "+" else upper[::-1]
        out.append(replace(part, roles=own))
    return tuple(out)


def _agree(one: float, other: float) -> bool:
    return abs(one - other) <= SEAM_APART * other


def _sure(parts: Sequence[Part]) -> float:
    """Mean confidence of the seams at the side; nothing where none is found."""
    found = [joint.confidence for joint in proposed_joints(parts) if joint.reason.split(",")[0] in SEAMS]
    return sum(found) / max(len(found), 6)


def _is_alike(one: Sequence[Part], other: Sequence[Part]) -> bool:
    """Whether both ways sew the same edges."""
    sewn = [{frozenset((*joint.one, *joint.other)) for joint in proposed_joints(parts)} for parts in (one, other)]
    return sewn[0] == sewn[1]


def _is_sewn(parts: Sequence[Part]) -> bool:
    """Whether a panel is surely enough sewn to what it goes on from."""
    return any(each.reason.startswith("princess") and each.confidence >= SEWN_FROM for each in proposed_joints(parts))
