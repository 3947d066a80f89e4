"""A specification that places no panel: laid round the body, by what its panels' names say, as a DXF file's pieces are.

Its stitches are stated, and so tell how panels of the back are drawn: seen from outside, as those of DXF files are, or
from the front, as GarmentCode draws all of them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.pattern.chain import Chain
from warp_cloth.pattern.curve import Curve, Floats
from warp_cloth.pattern.draft import Part, parts_as_drawn
from warp_cloth.pattern.figure import Figure, figure_of
from warp_cloth.pattern.half_sleeves import half_sleeves
from warp_cloth.pattern.handles import handle_count
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT, STRIPS, Named, named_all, plain
from warp_cloth.pattern.piece import Piece
from warp_cloth.pattern.pieces import halved
from warp_cloth.pattern.placing import wraps_of
from warp_cloth.pattern.sewing import DECISIVE, seams_of
from warp_cloth.pattern.specification import Edge, Panel, Pattern, Side, Stitch
from warp_cloth.pattern.vocabulary import WORDS
from warp_cloth.pattern.wrap import MIRROR, Laid

POINTS = 33  # of a curve, when shapes are compared
KNOWN = 0.9  # of the cloth's area, that is to be of kinds which are known, and shaped as these are
LED = 0.6  # the same, where the rest lies as its seams lead
SEAMS_TELL = 1.5  # times as far apart, as which seams count where they lead sleeves, against names
SURELY = 1.05  # times nearer that ends may be the other way; up to DECISIVE where no way has less
SHARED = 0.5  # of the smaller one's box, that two panels share which lie on each other
FACES = ("front", "back")
SLEEVES = ("sleeve", "under_sleeve", "cuff", "")
_BACK = dict(WORDS)["back"]


@dataclass(frozen=True, eq=False)
class _Laid:
    """A pattern laid round a figure, and how far apart the ends of its stitches then are, in the mean [m]."""

    pattern: Pattern
    apart: float
    contrary: float  # how many times nearer the ends of a stitch are the other way, at most


def laid_round(pattern: Pattern, figure: Figure | None) -> Pattern:
    """A pattern that places no panel, laid round a figure (None: a usual one); as it is where names do not tell how.

    Raises:
        InputError: they do not tell, there is a person to wear it, and panels lie on those that they are sewn to.
    """
    figure = figure or figure_of(None)
    ways: list[tuple[bool, float, _Laid]] = []
    for led, weight in ((False, 1.0), (True, SEAMS_TELL)):
        found = [laid for behind in (False, True) if (laid := _laid(pattern, figure, behind, led)) is not None]
        ways += [(laid.contrary > SURELY, weight * laid.apart, laid) for laid in found if not _has_handles(laid)]
    if not ways:
        if not figure.is_nominal and _lie_on_each_other(pattern):
            pattern.refuse(
                "",
                "places no panel, and neither names nor seams tell where they lie on the body",
                "state translation and rotation of each panel, or name them: front, back, left_sleeve, skirt_back, ...",
            )
        return pattern
    _, _, best = min(ways, key=lambda way: way[:2])  # the first of equal ones
    nobody = "; no person is there: a figure of 1.70 m" if figure.is_nominal else ""
    note = f"no panel is placed: laid round the body by their names and shapes{nobody}"
    kept = [told for told in pattern.notes if not told.endswith("starts at the origin")]
    return replace(best.pattern, notes=(*kept, note))


def _laid(pattern: Pattern, figure: Figure, behind: bool, led: bool) -> _Laid | None:
    """The pattern laid round a figure.

    ``behind``: panels of the back are drawn as seen through the front. ``led``: what is of a bodice or skirt lies by
    its name and shape, all else as its seams lead from there.
    """
    names = [panel.name for panel in pattern.panels]
    kinds = [Named() if what.kind == "none" else what for what in named_all([(name, "", "") for name in names])]
    kinds = [replace(what, side=what.side or _side_of(pattern, index, kinds)) for index, what in enumerate(kinds)]
    flips = [behind and _is_back(pattern, index, kinds) for index in range(len(names))]
    panels = [_outside(panel, flip) for panel, flip in zip(pattern.panels, flips, strict=True)]
    turned = [one is not other for one, other in zip(panels, pattern.panels, strict=True)]
    stitches = tuple(replace(stitch, sides=_renumbered(stitch, panels, turned)) for stitch in pattern.stitches)
    drawn = [_piece(panel, what, flip) for panel, what, flip in zip(panels, kinds, flips, strict=True)]
    count = Counter((what.kind, what.side) for what in kinds if what.kind in STRIPS)
    # bands of several pieces are led by their seams; so is "l_f" where "front" is whole: it may be half a sleeve
    whole = {what.kind for what, (piece, _) in zip(kinds, drawn, strict=True) if piece.mirror and what.kind in FACES}
    loose = [led and (what.kind in SLEEVES or (what.kind in whole and what.side != BOTH)) for what in kinds]
    follow = [count[what.kind, what.side] > 1 or own for what, own in zip(kinds, loose, strict=True)]
    pieces = [replace(piece, what=Named()) if own else piece for (piece, _), own in zip(drawn, follow, strict=True)]
    gores = sum(what.kind == "skirt" for what in kinds)  # of neither front nor back, they go round in their order
    pieces = [replace(piece, copies=(gores, 0)) if piece.what.kind == "skirt" else piece for piece in pieces]
    parts = parts_as_drawn(pieces)
    if led:
        parts = tuple(
            replace(part, kind="", roles={}) if own else part for part, own in zip(parts, follow, strict=True)
        )
    shared = Counter((part.kind, part.side) for part in parts if part.roles and part.kind not in (*STRIPS, "gore"))
    if max(shared.values(), default=0) > 1:  # two of them would lie in one place
        return None
    if any(len(part.edges) != len(piece.edges) for part, (piece, _) in zip(parts, drawn, strict=True)):
        return None
    areas = np.array([abs(panel.area) for panel in panels])
    if areas[[bool(part.roles) for part in parts]].sum() < (LED if led else KNOWN) * areas.sum():
        return None
    places = [places for _, places in drawn]
    joints = [_joint(stitch, places) for stitch in stitches]
    try:
        wraps = list(wraps_of(parts, joints, figure))
        halves = half_sleeves(parts, joints, wraps, figure) if led else {}
        wraps = [halves.get(index, wrap) for index, wrap in enumerate(wraps)]
    except np.linalg.LinAlgError:  # a part so narrow that it leads nowhere
        return None
    laid = [
        replace(panel, wrap=_of_panel(wrap, part, piece, flip))
        for panel, wrap, part, (piece, _), flip in zip(panels, wraps, parts, drawn, flips, strict=True)
    ]
    # loops that all run counter-clockwise as seen from outside tell which way round each seam is
    told = tuple(replace(each, right_to_wrong=bool(each.right_to_wrong)) for each in stitches)
    made = replace(pattern, panels=tuple(laid), stitches=told)
    apart, contrary = _apart(made, {*halves})
    return _Laid(made, apart, contrary) if contrary < DECISIVE else None


def _has_handles(laid: _Laid) -> bool:
    """Whether a pattern laid so has handles, or cannot be sewn: then panels are taken for what they are not."""
    try:
        return handle_count(laid.pattern, seams_of(laid.pattern)) > 0
    except InputError:
        return True


def _lie_on_each_other(pattern: Pattern) -> bool:
    """Whether two panels that are sewn to each other are drawn at one place, so that they could not be worn so."""
    boxes = []
    for panel in pattern.panels:
        points = panel.placed(np.concatenate([edge.curve.at(np.linspace(0.0, 1.0, 9)) for edge in panel.edges]))
        boxes.append((points[:, :2].min(axis=0), points[:, :2].max(axis=0)))
    for stitch in pattern.stitches:
        (low, high), (its_low, its_high) = (boxes[side.panel] for side in stitch.sides)
        shared = np.prod(np.maximum(np.minimum(high, its_high) - np.maximum(low, its_low), 0.0))
        least = min(np.prod(high - low), np.prod(its_high - its_low))
        if len({side.panel for side in stitch.sides}) > 1 and shared > SHARED * least:
            return True
    return False


def _side_of(pattern: Pattern, index: int, kinds: Sequence[Named]) -> int:
    """On which side of a front a sleeve is sewn: at +x on the wearer's left; BOTH: of none, or not to be told."""
    if kinds[index].kind != "sleeve":
        return BOTH
    found = set()
    for stitch in pattern.stitches:
        for mine, theirs in (stitch.sides, stitch.sides[::-1]):
            what = kinds[theirs.panel]
            if mine.panel == index and what.kind == "front" and not what.side:
                panel = pattern.panels[theirs.panel]
                ends = np.array([point for edge in panel.edges for point in (edge.curve.start, edge.curve.end)])
                curve = panel.edges[theirs.edge].curve
                aside = float(0.5 * (curve.start[0] + curve.end[0]) - 0.5 * (ends[:, 0].min() + ends[:, 0].max()))
                found.add(LEFT if aside > 0.0 else RIGHT)
    return found.pop() if len(found) == 1 else BOTH


def _is_back(pattern: Pattern, index: int, kinds: Sequence[Named]) -> bool:
    """Whether a panel is of the back, by its name or its seams."""
    words = plain(re.sub(r"[\W\d_]+", " ", pattern.panels[index].name))
    return bool(re.search(_BACK, words)) or kinds[index].kind.endswith("back") or _is_behind(pattern, index, kinds)


def _is_behind(pattern: Pattern, index: int, kinds: Sequence[Named]) -> bool:
    """Whether a panel that is neither front nor back by name is sewn to a back, and to no front."""
    if kinds[index].kind not in SLEEVES:
        return False
    pairs = [tuple(side.panel for side in stitch.sides) for stitch in pattern.stitches]
    others = {kinds[one + other - index].kind for one, other in pairs if index in (one, other)}
    return "back" in others and "front" not in others


def _outside(panel: Panel, flip: bool) -> Panel:
    """The panel, its loop as it runs counter-clockwise seen from outside; ``flip``: drawn as seen from inside."""
    if (panel.area > 0.0) != flip:
        return panel
    return replace(panel, edges=tuple(Edge(edge.number, edge.curve.reversed) for edge in panel.edges[::-1]))


def _renumbered(stitch: Stitch, panels: Sequence[Panel], turned: Sequence[bool]) -> tuple[Side, Side]:
    one, other = (
        Side(side.panel, len(panels[side.panel].edges) - 1 - side.edge) if turned[side.panel] else side
        for side in stitch.sides
    )
    return one, other


def _piece(panel: Panel, what: Named, flip: bool) -> tuple[Piece, list[list[int]]]:
    """The panel as a piece seen from outside, counter-clockwise, and which of its edges each edge of the panel became.

    Those of a symmetric piece are parted in the middle.
    """
    whole = [_chain(edge.curve, flip) for edge in panel.edges]
    edges, mirror = halved(whole)
    places: list[list[int]] = []
    at = 0
    for edge in whole:
        steps = 1 if np.array_equal(edges[at].end, edge.end) else 2
        places.append([*range(at, at + steps)])
        at += steps
    none = np.zeros((0, 2))
    return Piece(panel.name, "", (1, 0), tuple(edges), mirror, none, (), (), (), (), what), places


def _chain(curve: Curve, flip: bool) -> Chain:
    points = curve.at(np.linspace(0.0, 1.0, 2 if curve.is_line else POINTS))
    points[0], points[-1] = curve.start, curve.end
    return Chain(points * MIRROR if flip else points)


def _joint(stitch: Stitch, places: Sequence[list[list[int]]]) -> Joint:
    one, other = ([Side(side.panel, k) for k in places[side.panel][side.edge]] for side in stitch.sides)
    return Joint(tuple(one), tuple(other[::-1]), is_layer=stitch.is_layer)


def _of_panel(wrap: Laid, part: Part, piece: Piece, flip: bool) -> Laid:
    """A part's wrap, for the panel as drawn: the part may be turned by half, and mirrored."""
    upright = float(np.abs(part.edges[0].points - piece.edges[0].points).max()) < 1e-9
    own = wrap if upright else wrap.upside_down()
    return own.mirrored() if flip else own


def _apart(pattern: Pattern, halves: Set[int]) -> tuple[float, float]:
    """How far apart the ends of stitched edges start in the mean [m]; and how many times nearer the other way, at most.

    All loops run counter-clockwise as seen from outside, so that edges that are sewn run against each other, if each
    panel is what it is taken for. Both ends of half a sleeve's cap are about as far from those of an armhole: the seams
    between ``halves`` tell.
    """
    found, contrary = [], 1.0
    for stitch in pattern.stitches:
        if len(halves & {side.panel for side in stitch.sides}) == 1:
            continue
        one, other = (_ends(pattern, side) for side in stitch.sides)
        against, along = (float(np.linalg.norm(one - ends, axis=1).mean()) for ends in (other[::-1], other))
        if not stitch.right_to_wrong:
            contrary = max(contrary, against / max(along, 1e-9))
        found.append(min(against, along))
    return float(np.mean(found)) if found else 0.0, contrary


def _ends(pattern: Pattern, side: Side) -> Floats:
    panel = pattern.panels[side.panel]
    curve = panel.edges[side.edge].curve
    return panel.placed(np.stack([curve.start, curve.end]))
