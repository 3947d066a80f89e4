"""A DXF file as a pattern: pieces of one size, seams as stated or proposed, each piece laid round the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.connected import connected_components
from warp_cloth.base.errors import InputError
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.draft_options import DraftOptions
from warp_cloth.pattern.dxf import Drawing, read_drawing
from warp_cloth.pattern.dxf_drawn import GRAIN
from warp_cloth.pattern.figure import Figure, figure_of
from warp_cloth.pattern.grade_table import GradeTable
from warp_cloth.pattern.joints import Joint, cut, side_text, stated_joints
from warp_cloth.pattern.kinds import BOTH
from warp_cloth.pattern.loose import without_panels
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.piece_notes import gathered
from warp_cloth.pattern.piece_sizes import rank
from warp_cloth.pattern.pieces import pieces_of
from warp_cloth.pattern.placing import wraps_of
from warp_cloth.pattern.proposal import SEWN_FROM, proposed_joints
from warp_cloth.pattern.runs import length_of
from warp_cloth.pattern.shared_sides import parts_with_sides
from warp_cloth.pattern.spare import spare_of
from warp_cloth.pattern.specification import Edge, Panel, Pattern, Side, Stitch, short

CLEARLY = 1.1  # times longer, as which seams tell which way pieces lie
ADVICE = "draw it with `warp-cloth pattern`, and state the seams that it needs ([[garment.seam]])"


@dataclass(frozen=True, eq=False)
class Draft:
    """The parts of a garment in one size, and the joints that are sewn and those that are only proposed."""

    file: str
    size: str
    sizes: tuple[str, ...]  # of the file; empty where it states none
    parts: tuple[Part, ...]
    joints: tuple[Joint, ...]
    unsewn: tuple[Joint, ...]
    spare: frozenset[int]  # parts that are drawn, and left out of the garment: small, unknown and sewn to nothing
    notes: tuple[str, ...]


def read_draft(file: str, data: bytes, options: DraftOptions, table: GradeTable | None = None) -> Draft:
    """The parts and joints of a DXF file, in one of the sizes that it has, or that a grade rule table makes.

    Raises:
        InputError: ezdxf is not installed, the file cannot be read, or what is stated does not fit it.
    """
    drawing = read_drawing(file, data)
    if any(GRAIN in drawn.lines for drawn in drawing.pieces):
        return _draft(file, drawing, options, table, False)
    # pieces without any grain line may be laid for cutting: their proposed seams are then clearly longer
    unstated = replace(options, seams=())
    upright, sideways = (_draft(file, drawing, unstated, table, way) for way in (False, True))
    is_sideways = _sewn_length(sideways) > CLEARLY * _sewn_length(upright)
    if options.seams:
        return _draft(file, drawing, options, table, is_sideways)
    return sideways if is_sideways else upright


def _sewn_length(draft: Draft) -> float:
    """Length of all seams that are sewn [m]."""
    return sum(length_of(draft.parts, joint.one) for joint in draft.joints)


def _draft(file: str, drawing: Drawing, options: DraftOptions, table: GradeTable | None, sideways: bool) -> Draft:
    """The draft of a drawing; ``sideways``: as ``pieces_of``'s."""
    undarted = {name for name, said in options.pieces.items() if not said.darts}
    pieces, told = pieces_of(file, drawing, options.seam_allowance, table, undarted, sideways)
    sample = drawing.stated.get("samplesize") or drawing.stated.get("basesize", "") or (table.sample if table else "")
    rules = drawing.stated.get("graderuletable")
    if rules and table is None and len({piece.size for piece in pieces}) < 2:
        told.append(
            f"its sizes are in the grade rule table {short(rules)}: put it next to the file, under its name with .rul"
        )
    size, sizes, chosen = _of_size(file, pieces, options.size, sample)
    notes = [*told, *(note for piece in chosen for note in piece.notes)]
    if options.size is None and len(sizes) > 1:
        notes.append(f"size {size} of {', '.join(sizes)}: state garment.size for another")
    parts, decided = parts_with_sides(file, chosen, options.pieces)
    notes += decided
    unsewn: tuple[Joint, ...] = ()
    if options.seams:
        joints = stated_joints(file, parts, options.seams)
    else:
        proposed = proposed_joints(parts)
        joints = tuple(joint for joint in proposed if joint.confidence >= SEWN_FROM)
        unsewn = tuple(joint for joint in proposed if joint.confidence < SEWN_FROM)
        notes += _told(parts, joints, unsewn)
    spare = spare_of(parts, joints)
    why = "is small, sewn to nothing and of no known name: left out; state a seam of it to keep it"
    notes += [f'piece "{short(parts[index].name)}" {why}' for index in sorted(spare)]
    return Draft(file, size, sizes, parts, joints, unsewn, spare, tuple(gathered(notes)))


def _of_size(
    file: str, pieces: Sequence[Piece], wanted: str | None, sample: str
) -> tuple[str, tuple[str, ...], list[Piece]]:
    """The size (by default the sample's, else the middle one), all sizes from small to large, and its pieces."""
    sizes = tuple(sorted({piece.size for piece in pieces if piece.size}, key=rank))
    if wanted is None:
        if len(sizes) < 2:
            return sizes[0] if sizes else "", sizes, list(pieces)
        wanted = sample if sample in sizes else sizes[len(sizes) // 2]
    found = next((size for size in sizes if size.lower() == wanted.strip().lower()), None)
    if found is None:
        listed = f"its sizes are {', '.join(sizes)}" if sizes else "it states no sizes"
        raise InputError(file, f'has no size "{short(wanted)}"', f"{listed}")
    named = {piece.name for piece in pieces if piece.size == found}
    # a piece that is cut alike in all sizes states none
    return found, sizes, [p for p in pieces if p.size == found or (not p.size and p.name not in named)]


def _told(parts: Sequence[Part], joints: Sequence[Joint], unsewn: Sequence[Joint]) -> list[str]:
    told = []
    if joints:
        low, high = min(j.confidence for j in joints), max(j.confidence for j in joints)
        told.append(
            f"no seams are stated: {len(joints)} proposed ones are sewn, of confidence {low:.2f} to {high:.2f} "
            f"(from {SEWN_FROM:g}); `warp-cloth pattern` lists them"
        )
    sewn = {side for joint in joints for side in (*joint.one, *joint.other)}
    for kind in ("front", "skirt_front"):
        fronts = [panel for panel, part in enumerate(parts) if part.kind == kind and part.side != BOTH]
        centres = [Side(panel, edge) for panel in fronts for edge in parts[panel].roles.get("centre", ())]
        if len(fronts) == 2 and centres and not sewn.intersection(centres):
            names = ", ".join(f'"{short(side_text(parts, [side]))}"' for side in centres[:4])
            told.append(f"the front is left open at {names}: state a seam to close it")
    for joint in unsewn[:8]:
        one, other = (short(side_text(parts, run)) for run in (joint.one, joint.other))
        told.append(f"proposed, but not sewn: {one} to {other}, {joint.reason}, confidence {joint.confidence:.2f}")
    return told


def unjoined(draft: Draft) -> tuple[str, ...]:
    """Names of parts of the garment that are sewn to nothing, where there are others."""
    count = len(draft.parts)
    if count == 1:
        return ()
    alone = np.bincount(_groups(draft), minlength=count)[_groups(draft)] == 1
    return tuple(draft.parts[index].name for index in np.flatnonzero(alone) if index not in draft.spare)


def _groups(draft: Draft) -> NDArray[np.int64]:
    """The lowest part that each part is sewn to, however far, shape [P]."""
    pairs = [(a.panel, b.panel) for joint in draft.joints for a in joint.one for b in joint.other]
    one, other = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    return connected_components(len(draft.parts), one, other)


def _apart(draft: Draft) -> list[str]:
    """A note where the parts are sewn into several garments that no seam joins, as a top and trousers are."""
    group = _groups(draft)
    firsts = [draft.parts[first].name for first in np.unique(group) if first not in draft.spare]
    if len(firsts) < 2:
        return []
    named = ", ".join(f'"{short(name)}"' for name in firsts[:4])
    return [f"it is sewn into {len(firsts)} garments, those of {named}: state the seams between them, if there are any"]


def not_joined(draft: Draft) -> tuple[str, str] | None:
    """Runs of edges of two unconnected groups of parts that a proposal would join, if it were surer."""
    group = _groups(draft)
    for joint in draft.unsewn:
        one, other = joint.one[0].panel, joint.other[0].panel
        if group[one] != group[other] and draft.spare.isdisjoint((one, other)):
            return side_text(draft.parts, joint.one), side_text(draft.parts, joint.other)
    return None


def drafted_pattern(draft: Draft, figure: Figure | None) -> Pattern:
    """The pattern of a draft, laid round a figure (None: a usual one), its edges cut where they are sewn.

    Raises:
        InputError: a part is sewn to nothing.
    """
    alone = unjoined(draft)
    if alone:
        listed = ", ".join(f'"{short(name)}"' for name in alone[:6])
        one = len(alone) == 1
        verb = "is" if one else "are"
        raise InputError(f"{draft.file}: piece{'' if one else 's'} {listed}", f"{verb} sewn to nothing",
                         f'{ADVICE}, or state place = "none" to leave a piece out')  # fmt: skip
    loose = not_joined(draft)
    if loose is not None:
        one_side, other_side = map(short, loose)
        raise InputError(draft.file, f'is in parts: whether "{one_side}" is sewn to "{other_side}" is not sure', ADVICE)
    apart = _apart(draft)
    figure = figure or figure_of(None)
    wraps = wraps_of(draft.parts, draft.joints, figure)
    made = cut(draft.parts, draft.joints)
    panels = tuple(
        Panel(
            part.name,
            tuple(Edge(number, curve) for number, curve in edges),
            np.eye(3),
            np.zeros(3),
            wrap=wrap,
            notches=part.notches,
            lines=part.lines,
            holes=part.holes,
            darts=part.darts,
        )
        for part, edges, wrap in zip(draft.parts, made.edges, wraps, strict=True)
    )
    notes = (*draft.notes, *apart)
    if figure.is_nominal:
        notes = (*notes, "no person is there to lay the pieces round: laid round a figure of 1.70 m")
    return without_panels(Pattern(draft.file, panels, made.stitches, notes), draft.spare)


def drawn_pattern(draft: Draft) -> Pattern:
    """The pattern of a draft as it is drawn: whole edges, and a stitch number for each joint that is sewn."""
    panels = tuple(
        Panel(
            part.name,
            tuple(Edge(number, curve) for number, curve in zip(part.numbers, part.edges, strict=True)),
            np.eye(3),
            np.zeros(3),
            notches=part.notches,
            lines=part.lines,
            holes=part.holes,
            darts=part.darts,
        )
        for part in draft.parts
    )
    stitches = tuple(
        Stitch(number, (one or joint.one[-1], other or joint.other[-1]), False)
        for number, joint in enumerate(draft.joints)
        for one, other in zip_longest(joint.one, joint.other)
    )
    return Pattern(draft.file, panels, stitches, draft.notes)
