"""What a garment's pieces say of it as a whole: whether it is a top, begins below yokes, or ends between the legs."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np

from warp_cloth.pattern.briefs import briefs_sure
from warp_cloth.pattern.by_shape import is_bodice
from warp_cloth.pattern.curve import Floats
from warp_cloth.pattern.kinds import COLLARS, HALF_SLEEVES, LEFT, RIGHT, YOKE_OF
from warp_cloth.pattern.one_shoulder import have_one_shoulder
from warp_cloth.pattern.panel_roles import smooth_runs, yoke_roles
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.roles import Roles, Shape, concave_count, skirt_roles, upright
from warp_cloth.pattern.strapless import are_strapless

LOWER = ("leg", "skirt", "waistband")  # kinds of what may hang from straps, too
LEVEL_TOP = 0.08  # rise over width, of a waist at most; a neck between shoulders has more
LEAST_WAIST = 0.24  # [m] of half a waist, before or behind; the top of a bib is narrower
TOPS = ("sleeve", *HALF_SLEEVES, *COLLARS, "hood")


@dataclass(frozen=True)
class Top:
    """What a garment's pieces say of it as a top."""

    is_one: bool  # it has pieces that only tops have
    yoked: frozenset[str]  # of "front" and "back" those that begin below a yoke
    has_bodice: bool  # a front or back on the fold has armholes and a neck, as no leg has
    has_half_bodice: bool  # half a front or back has, as a waistcoat's
    lone: frozenset[str]  # of "front" and "back" those that one piece is named, or one for either side
    briefs: float | None  # how sure its fronts and backs are of briefs; None: not at all
    has_one_shoulder: bool
    is_strapless: bool
    has_lone_skirt: bool  # one piece is a skirt's, by its name, and none its front or back


def top_of(kinds: Set[str], pieces: Sequence[Piece]) -> Top:
    has_top = not kinds.isdisjoint(TOPS) or _hangs_from_straps(kinds, pieces)
    whole = [piece for piece in pieces if piece.what.kind in ("front", "back") and piece.mirror is not None]
    has_bodice = any(cut_outs(each) >= 2 for each in whole)
    halves = [piece for piece in pieces if piece.what.kind in ("front", "back") and piece.mirror is None]
    has_half_bodice = any(is_bodice(each) for each in halves)
    yokes = [piece for piece in pieces if piece.what.kind == "yoke" and is_at_neck(piece)]
    faces = {piece.what.face or "back" for piece in yokes}
    faces |= {face for face, yoke in YOKE_OF.items() if yoke in kinds and has_top}
    sides = {face: sorted(piece.what.side for piece in pieces if piece.what.kind == face) for face in YOKE_OF}
    lone = frozenset(face for face, own in sides.items() if len(own) == 1 or own == [RIGHT, LEFT])
    skirts = [piece.what.kind for piece in pieces if piece.what.kind.startswith("skirt")]
    is_one = has_top or bool(yokes)
    briefs = None if is_one or "strap" in kinds else _briefs_sure(pieces)
    has_bodice, has_half_bodice = has_bodice and briefs is None, has_half_bodice and briefs is None
    has_lower = any(kind.startswith(LOWER) for kind in kinds)
    is_strapless = not is_one and briefs is None and not has_lower and are_strapless(pieces)
    return Top(is_one, frozenset(faces), has_bodice, has_half_bodice, lone, briefs,
               have_one_shoulder(pieces), is_strapless, skirts == ["skirt"])  # fmt: skip


def _hangs_from_straps(kinds: Set[str], pieces: Sequence[Piece]) -> bool:
    """Whether straps are of a top: of whole fronts and backs, which legs are not, with nothing for a lower body."""
    faces = [piece for piece in pieces if piece.what.kind in ("front", "back")]
    is_whole = all(piece.mirror is not None for piece in faces)
    return "strap" in kinds and is_whole and not any(kind.startswith(LOWER) for kind in kinds)


def _briefs_sure(pieces: Sequence[Piece]) -> float | None:
    """How sure fronts and backs are of briefs, as they are not where one of them has a neck and shoulders."""
    faces = [[each for each in pieces if each.what.kind.endswith(f) and not each.what.panel] for f in ("front", "back")]
    return None if any(is_bodice(each) for face in faces for each in face) else briefs_sure(*faces)


def cut_outs(piece: Piece) -> int:
    """How many edges of a front or back are cut out, for neck, arms or crotch; the sides of a tube are not."""
    shape = Shape(piece.edges, upright(piece.edges, "front"))
    hollow = concave_count(shape)
    roles = tube_roles(piece) if hollow else None
    sides = (*roles["side+"], *roles["side-"]) if roles else ()
    return hollow - sum(shape.is_concave(k) for k in sides)


def tube_roles(piece: Piece, up: Floats | None = None) -> Roles | None:
    """Waist, hem and sides of a front or back, or half of one, that goes all round, such as a mermaid skirt; else None.

    Its sides run without a corner from the hem up to a level waist. ``up``: of the piece; None: the narrower end.
    """
    if len(piece.edges) < 4:
        return None
    shape = Shape(piece.edges, upright(piece.edges, "skirt") if up is None else up)
    roles = skirt_roles(shape)
    top = [shape.turned[k].points for k in roles["waist"]]
    size = np.ptp(np.concatenate(top), axis=0) if top else np.zeros(2)
    is_waist = size[1] < LEVEL_TOP * size[0] and size[0] > LEAST_WAIST * (0.5 if piece.mirror is None else 1.0)
    is_tube = is_waist and all(len(smooth_runs(shape, roles[f"side{mark}"])) == 1 for mark in "+-")
    return roles if is_tube else None


def is_at_neck(yoke: Piece) -> bool:
    """Whether a yoke is of a top, with a neck and shoulders, and not of trousers or a skirt."""
    shape = Shape(yoke.edges, upright(yoke.edges, "yoke"))
    return len(shape.order) >= 3 and bool(yoke_roles(shape, yoke.mirror is not None))
