"""Pieces as the parts of a garment: how often each is cut, what it is, on which side, and what its edges are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.briefs import brief_of
from warp_cloth.pattern.by_shape import are_mirrored, is_leg_and_no_bodice, told_by_shape
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.cloth_layers import with_outer_layers
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.drawn_darts import turned
from warp_cloth.pattern.kinds import (
    BOTH,
    PAIRED,
    PLACES,
    SIDE_PANEL,
    SKIRTS,
    UNDER_SLEEVE,
    YOKE_OF,
    YOKES,
    named,
    without_side,
)
from warp_cloth.pattern.lower_sleeves import with_lower_sleeves
from warp_cloth.pattern.middles import with_middles
from warp_cloth.pattern.one_shoulder import is_no_half, one_shoulder_roles
from warp_cloth.pattern.panel_roles import half_skirt_roles, is_cut_across, parted_at_underarm
from warp_cloth.pattern.part_roles import roles_of, side_of
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.pieces import opened
from warp_cloth.pattern.pocket_openings import without_pocket_openings
from warp_cloth.pattern.roles import UPWARDS, Roles, Shape, is_strip, pants_roles, upright
from warp_cloth.pattern.round_skirts import ring_of
from warp_cloth.pattern.specification import MOST_PANELS, Dart, short
from warp_cloth.pattern.stacked import with_stacked
from warp_cloth.pattern.strapless import strapless_roles
from warp_cloth.pattern.tier_strips import with_faces_of_tiers
from warp_cloth.pattern.tops import Top, cut_outs, is_at_neck, top_of

MIRRORED = " mirrored"  # after the name of a second, mirrored copy
SINGLE = ("front", "back", "bib", "collar", "waistband", "hem_band", *YOKES, *SKIRTS)
MIRROR = np.diag([-1.0, 1.0])
ASLANT = 0.05  # across the grain, of the way up of a quarter of a ring
FEWEST_GORES = 3  # of one piece, all round
BY_SHAPE = 0.85  # how sure it is of what no name tells
MISREAD = 0.7  # factor on how sure a symmetric piece is whose roles are not symmetric


@dataclass(frozen=True, eq=False)
class Part:
    """One panel of the garment."""

    name: str
    edges: tuple[Chain, ...]
    numbers: tuple[int, ...]  # of the edges, as drawn
    mirror: tuple[int, ...] | None  # as Piece's
    notches: Floats
    lines: tuple[Floats, ...]
    kind: str  # of kinds.PLACES; empty: unknown
    side: int  # LEFT, RIGHT; BOTH: on either side of the middle, or not known
    up: Floats  # which way along the grain is up as worn, shape [2]
    roles: Roles
    sure: float  # of the kind
    holes: tuple[tuple[Chain, ...], ...] = ()  # cut out of it, counter-clockwise
    darts: tuple[Dart, ...] = ()  # within it
    twin: int | None = None  # the part that is its mirror image
    level: int = 0  # of a tier of a skirt, from above; 0: the uppermost

    @property
    def shape(self) -> Shape:
        return Shape(self.edges, self.up)


@dataclass(frozen=True)
class Stated:
    """What a scene states of a piece."""

    place: str | None = None
    copies: tuple[int, int] | None = None
    darts: bool = True  # whether inner lines show darts


def parts_of(file: str, pieces: Sequence[Piece], stated: Mapping[str, Stated]) -> tuple[tuple[Part, ...], list[str]]:
    """The panels of a garment in one size, and notes on what was decided or left out.

    Raises:
        InputError: a statement names no piece, or no piece is left.
    """
    names = [piece.name for piece in pieces]
    for name in stated:
        if name not in names:
            listed = ", ".join(f'"{short(each)}"' for each in names[:12])
            raise InputError(f"{file}: piece", f'there is no piece "{short(name)}"', f"the pieces are {listed}")
    parts: list[Part] = []
    left_out = [piece for piece in pieces if stated.get(piece.name, Stated()).place == "none"]
    told, notes = _identified(with_outer_layers([piece for piece in pieces if piece not in left_out], stated.keys()))
    told = with_stacked(told, stated.keys())
    told, tiered = with_faces_of_tiers(told, {name for name, said in stated.items() if said.copies or said.place})
    notes += tiered
    told = _with_half_sleeves(with_lower_sleeves(told, stated.keys()))
    told, closed = without_pocket_openings(told)
    notes += closed
    pieces = [*told, *left_out]
    panelled = _panelled(pieces, stated)
    places = {piece.name: stated.get(piece.name, Stated()).place for piece in pieces}
    kinds = {PLACES[place][0] if (place := places[piece.name]) else piece.what.kind for piece in pieces}
    top = top_of(kinds, pieces)
    for piece in _unique(pieces, notes):
        said = stated.get(piece.name, Stated())
        piece = _joined(piece, said, notes)
        part = _part(piece, said, panelled, top)
        place = f'piece "{short(piece.name)}"'
        is_half = _is_lone_half(piece, said, part, pieces)
        if is_half and is_no_half(part.shape, part.roles):
            is_half, part = False, replace(part, sure=MISREAD * part.sure)
        whole = opened(piece, part.roles["centre"]) if is_half else None
        if whole is not None:
            piece, part = whole, _part(whole, said, panelled, top)
            kind = part.kind.replace("_", " ")
            notes.append(f"{place} is half a {kind}, cut once, with no fold line: mirrored at its straight centre")
        if part.kind == "none":
            why = "by its name or material it is no part of the outer cloth"
            why = "it faces another piece" if piece.what.is_facing else why
            why = "by its name it is a second layer of another piece" if piece.what.is_layer else why
            why = "as stated" if said.place == "none" else why
            notes.append(f"{place} is left out: {why}")
            continue
        if part.kind in ("gore", "godet"):
            parts += _gores(part, said.copies or piece.copies or (1, 0))
            continue
        drawn, mirrored = _copies(piece, said, part, is_half and whole is None, place, notes)
        made = [part] if drawn else []
        if mirrored:
            made.append(_mirrored(part, drawn))
        if len(made) == 2:
            made = [replace(made[0], twin=len(parts) + 1), replace(made[1], twin=len(parts))]
        parts += made
        if len(parts) > MOST_PANELS:
            raise InputError(file, f"has over {MOST_PANELS:,} panels", "split the file")
    if not parts:
        raise InputError(file, "no piece is left to sew", "state a place for each piece that belongs to the garment")
    return tuple(_twins(parts)), notes


def parts_as_drawn(pieces: Sequence[Piece]) -> tuple[Part, ...]:
    """A part for each piece, none of them left out, mirrored or opened."""
    told, _ = _identified(pieces)
    top, panelled = top_of({piece.what.kind for piece in told}, told), _panelled(told, {})
    return tuple(_twins([_part(piece, Stated(), panelled, top) for piece in told]))


def _identified(pieces: Sequence[Piece]) -> tuple[list[Piece], list[str]]:
    """The pieces, identified by seams and shapes where names do not say what they are; and notes on that."""
    known, by_seams = with_middles(pieces)
    known, by_shapes = told_by_shape(known)
    return known, [*by_seams, *by_shapes]


def _with_half_sleeves(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces, sleeves made halves where names put some in front and some behind, and all others of none."""
    faces = [piece.what.face for piece in pieces if piece.what.kind == "sleeve" and not piece.what.panel]
    if {*faces} != {"front", "back"}:
        return list(pieces)
    halves = {face: f"{face}_sleeve" for face in faces}
    return [
        replace(piece, what=replace(piece.what, kind=halves[piece.what.face])) if piece.what.kind == "sleeve" else piece
        for piece in pieces
    ]


def _unique(pieces: Sequence[Piece], notes: list[str]) -> list[Piece]:
    """The pieces with names that differ."""
    seen: dict[str, int] = {}
    out = []
    for piece in pieces:
        seen[piece.name] = seen.get(piece.name, 0) + 1
        if seen[piece.name] > 1:
            name = f"{piece.name} #{seen[piece.name]}"
            notes.append(f'another piece is named "{short(piece.name)}": called "{short(name)}"')
            piece = replace(piece, name=name)
        out.append(piece)
    return out


def _is_lone_half(piece: Piece, said: Stated, part: Part, pieces: Sequence[Piece]) -> bool:
    """Whether a piece is half a front or back whose other half is nowhere."""
    if part.kind not in ("front", "back", "yoke", *SKIRTS) or part.side == BOTH or "centre" not in part.roles:
        return False
    kinds = (part.kind, part.kind.removeprefix("skirt_"))
    alike = [each for each in pieces if each.what.kind in kinds and not each.what.panel]
    copies = said.copies if said.copies is not None else piece.copies
    return (
        len(alike) == 1
        and piece.what.side == BOTH
        and said.place in (None, part.kind)
        and (copies is None or sum(copies) == 1)
    )


def _joined(piece: Piece, said: Stated, notes: list[str]) -> Piece:
    """A ruffle for a hem that is cut several times, as the one strip that these are joined to; else the piece."""
    count = sum(said.copies or piece.copies or (1, 0))
    shape = Shape(piece.edges, UPWARDS)
    if count < 2 or not piece.what.is_ruffle or piece.what.kind != "hem_band" or not is_strip(shape, is_named=True):
        return piece
    if not all(shape.is_straight(k) for k in shape.order):
        return piece
    size = shape.box[1] - shape.box[0]
    longer = np.diag([float(count), 1.0] if size[0] > size[1] else [1.0, float(count)])
    notes.append(f'piece "{short(piece.name)}" is a ruffle cut {count} times: sewn as one strip, as long as all')
    edges = tuple(edge.turned(longer, np.zeros(2)) for edge in piece.edges)
    return replace(piece, edges=edges, notches=piece.notches[:0], copies=(1, 0))


def _copies(piece: Piece, said: Stated, part: Part, is_half: bool, place: str, notes: list[str]) -> tuple[bool, bool]:
    """Whether the piece is cut as drawn, and mirrored; ``is_half``: its other half is nowhere, and no mirror image."""
    stated = said.copies if said.copies is not None else piece.copies
    if stated is None:
        one_sided = piece.what.side != BOTH or PLACES.get(said.place or "", ("", BOTH))[1] != BOTH
        is_strip_of_hood = part.kind == "hood" and "long" in part.roles
        pair = ((part.kind in PAIRED and not is_strip_of_hood) or is_half) and not one_sided
        if pair:
            notes.append(f"{place} states no quantity: a pair is taken")
        return True, pair
    drawn, mirrored = stated
    if said.copies is None and part.kind in SINGLE and piece.mirror is not None and drawn + mirrored > 1:
        notes.append(f"{place} is symmetric and cut {drawn + mirrored} times: one is sewn")
        return True, False
    if said.copies is None and drawn > 1 and not mirrored:
        drawn, mirrored = 1, 1
    if drawn > 1 or mirrored > 1:
        notes.append(f"{place} is cut {drawn + mirrored} times: one pair is sewn")
    return drawn > 0, mirrored > 0


def _gores(part: Part, copies: tuple[int, int]) -> list[Part]:
    """The gores of a skirt in their order round it, or godets; as drawn and mirrored in turn, where these differ."""
    turns = part.mirror is None and copies[0] == copies[1]
    made = [_mirrored(part, False) if turns and number % 2 else part for number in range(min(sum(copies), MOST_PANELS))]
    names = [part.name, *(f"{part.name} #{number}" for number in range(2, len(made) + 1))]
    return [replace(each, name=name) for each, name in zip(made, names, strict=True)]


def _panelled(pieces: Sequence[Piece], stated: Mapping[str, Stated]) -> frozenset[str]:
    """Of "front" and "back" those that are of middle and side panels."""
    faces = {piece.what.kind for piece in pieces if piece.what.panel == SIDE_PANEL and piece.name not in stated}
    places = {PLACES[said.place][0] for said in stated.values() if said.place is not None}
    return frozenset(face for face in ("front", "back") if face in faces or f"side_{face}" in places)


def _part(piece: Piece, said: Stated, panelled: frozenset[str], top: Top) -> Part:
    """A piece as a part."""
    kind, side, sure = piece.what.kind, piece.what.side, piece.what.sure
    if said.place is not None:
        kind, stated_side = PLACES[said.place]
        side = stated_side or side
        sure = 1.0
    elif piece.what.panel == SIDE_PANEL and kind:
        kind = f"side_{kind}"
    elif piece.what.panel == UNDER_SLEEVE:
        kind = kind if is_cut_across(piece) else "under_sleeve"
    elif kind == "yoke" and piece.what.face == "front" and is_at_neck(piece):
        kind = "front_yoke"
    elif kind in ("front", "back") and kind not in panelled:
        kind = kind if top.is_one else _worn_on(piece, kind, top)
    elif kind == "leg" and _is_whole_leg(piece):
        pass
    elif kind == "skirt" and (_is_cut_all_round(piece, said, top) or ring_of(piece.edges, False)):
        kind = "gore"
    elif kind in ("leg", "skirt", ""):
        kind, sure = "", BY_SHAPE
    brief = brief_of(piece.edges, piece.mirror) if top.briefs and kind.endswith(("front", "back")) else None
    if brief is not None and top.briefs:
        kind, sure = f"skirt_{kind.rpartition('_')[2]}", sure * (1.0 if said.place else top.briefs)
    copies = said.copies or piece.copies
    is_half = kind in SKIRTS and piece.mirror is None and (copies is None or all(copies))
    ring = brief or (ring_of(piece.edges, is_half) if kind in (*SKIRTS, "gore") else None)
    is_strapless = top.is_strapless and kind in YOKE_OF
    is_upright = is_strapless or piece.what.level is not None
    turn = (1.0 if is_upright else upright(piece.edges, kind)[1]) * np.eye(2)  # half a turn keeps the warp along y
    up = UPWARDS
    if ring is not None:
        turn, up = (np.eye(2), ring.up) if abs(ring.up[0]) > ASLANT else (np.sign(ring.up[1]) * np.eye(2), UPWARDS)
    edges = tuple(edge.turned(turn, np.zeros(2)) for edge in piece.edges)
    lines = tuple(line @ turn for line in piece.lines)
    holes = tuple(tuple(edge.turned(turn, np.zeros(2)) for edge in hole) for hole in piece.holes)
    darts = tuple(turned(dart, turn.T, np.zeros(2)) for dart in piece.darts)
    if kind == "under_sleeve":
        edges = parted_at_underarm(edges, UPWARDS, piece.notches @ turn)
    mirror = piece.mirror if len(edges) == len(piece.edges) else None
    part = Part(piece.name, edges, tuple(range(len(edges))), mirror, piece.notches @ turn, lines,
                kind, side, up, {}, sure, holes, darts, level=piece.what.level or 0)  # fmt: skip
    shape = part.shape
    roles = roles_of(kind, shape, mirror is not None, kind in panelled, kind in top.yoked)
    if top.has_one_shoulder and kind in YOKE_OF:
        return replace(part, roles=one_shoulder_roles(shape))
    if is_strapless:
        return replace(part, roles=strapless_roles(shape))
    if ring is not None:
        roles = ring.roles
    elif kind in SKIRTS and mirror is None:
        roles = half_skirt_roles(shape) or roles
    if mirror is not None and not _are_mirrored(roles, mirror):
        part = replace(part, sure=MISREAD * sure)
    return replace(part, roles=roles, side=side or side_of(kind, shape, roles, mirror is not None))


def _are_mirrored(roles: Roles, mirror: Sequence[int]) -> bool:
    """Whether what the two sides of a symmetric piece are agrees, as it does where its shape is read rightly."""
    sides = {role[:-1] for role in roles if role[-1] in "+-"}
    pairs = [({mirror[k] for k in roles.get(f"{role}+", ())}, {*roles.get(f"{role}-", ())}) for role in sides]
    return all(one == other for one, other in pairs)


def _is_cut_all_round(piece: Piece, said: Stated, top: Top) -> bool:
    """Whether a skirt is of one piece cut several times: for gores, or where there is no other for front and back."""
    return sum(said.copies or piece.copies or ()) >= (2 if top.has_lone_skirt else FEWEST_GORES)


def _worn_on(piece: Piece, face: str, top: Top) -> str:
    """A front or back as a bodice's, a leg's or a skirt's, by what is cut out of it.

    Where the other one is of a bodice, this one is, too, though its neck be cut straight, or all its top, as below
    straps: that, if no other piece is named so, which a skirt may have.
    """
    if top.has_one_shoulder or top.is_strapless:
        return face
    hollow = cut_outs(piece)
    if piece.mirror is not None:
        return face if hollow >= 2 or (top.has_bodice and face in top.lone) else f"skirt_{face}"
    if hollow and (top.has_bodice or (top.has_half_bodice and face in top.lone)):
        return face
    if hollow >= 2 and is_leg_and_no_bodice(piece):
        return f"leg_{face}"
    return face if hollow >= 2 else f"leg_{face}" if hollow == 1 else f"skirt_{face}"


def _is_whole_leg(piece: Piece) -> bool:
    """Whether a piece covers a leg all round: cut out for the crotch on either side."""
    shape = Shape(piece.edges, upright(piece.edges, "leg"))
    roles = pants_roles(shape)
    crotches = [roles.get(f"crotch{mark}", ()) for mark in "+-"]
    return all(any(shape.is_concave(k) for k in run) for run in crotches)


def _mirrored(part: Part, drawn: bool) -> Part:
    """The mirror image: its edges in the reversed order, so that it runs counter-clockwise, too."""
    count = len(part.edges)
    edges = tuple(edge.turned(MIRROR, np.zeros(2)).reversed for edge in part.edges[::-1])
    swap = {"+": "-", "-": "+"}
    roles = {
        (role[:-1] + swap[role[-1]] if role[-1] in swap else role): tuple(count - 1 - k for k in run[::-1])
        for role, run in part.roles.items()
    }
    mirror = None if part.mirror is None else tuple(count - 1 - part.mirror[count - 1 - k] for k in range(count))
    return replace(
        part,
        name=part.name + MIRRORED if drawn else part.name,
        edges=edges,
        numbers=part.numbers[::-1],
        mirror=mirror,
        notches=part.notches @ MIRROR,
        lines=tuple(line @ MIRROR for line in part.lines),
        holes=tuple(tuple(edge.turned(MIRROR, np.zeros(2)).reversed for edge in hole[::-1]) for hole in part.holes),
        darts=tuple(turned(dart, MIRROR, np.zeros(2)) for dart in part.darts),
        side=-part.side,
        up=part.up @ MIRROR,
        roles=roles,
    )


def _twins(parts: list[Part]) -> list[Part]:
    """The parts, with those that are drawn as left and right of one pair made twins, by their names or shapes."""
    names: dict[tuple[str, str], list[int]] = {}
    for index, part in enumerate(parts):
        if part.twin is None and named(part.name).side != BOTH:
            names.setdefault((without_side(part.name), part.kind), []).append(index)
    for own in names.values():
        if len(own) == 2 and len(parts[own[0]].edges) == len(parts[own[1]].edges):
            _pair_up(parts, *own)
    bare = [index for index, part in enumerate(parts) if part.twin is None and part.mirror is None and part.kind]
    drawn = [pair for pair in combinations(bare, 2) if _is_pair(*(parts[index] for index in pair))]
    for pair in drawn:
        if sum(bool({*pair} & {*other}) for other in drawn) == 1:
            _pair_up(parts, *pair)
    return parts


def _is_pair(one: Part, other: Part) -> bool:
    apart = one.side != other.side or one.side == BOTH
    return one.kind == other.kind and apart and are_mirrored(one.edges, other.edges)


def _pair_up(parts: list[Part], one: int, other: int) -> None:
    parts[one], parts[other] = replace(parts[one], twin=other), replace(parts[other], twin=one)
