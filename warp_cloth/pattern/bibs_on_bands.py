"""Bibs above a waistband, of dungarees and pinafores: sewn to the middle of its upper edge in front.

Their straps go from the bib's top corners to that edge behind, as far from the middle, where nothing else marks it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from warp_cloth.pattern.band_rings import ring_of
from warp_cloth.pattern.bibs import BIB
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.joints import Joint
from warp_cloth.pattern.kinds import BOTH, LEFT, RIGHT
from warp_cloth.pattern.parting import parted
from warp_cloth.pattern.roles import skirt_roles
from warp_cloth.pattern.runs import joint_of, length_of, parts_of_kind, run_of, side_mark
from warp_cloth.pattern.straps import ACROSS, STRAP, across_of, end_of_strap, pair_of_straps, with_end

LEAST_FREE = 0.3  # of a waistband's length, that a bib leaves free at least
AS_LONG = 0.08  # relative: to which a band's upper edge is as long as the lower one, as where it hangs straight


def with_bibs_on_bands(parts: Sequence[Part]) -> tuple[Part, ...]:
    """The parts, the waistband's upper edge parted where the one bib is sewn to it, and where straps end behind."""
    bibs, bands = parts_of_kind(parts, BIB), parts_of_kind(parts, "waistband")
    if len(bibs) != 1 or len(bands) != 1 or parts[bibs[0]].mirror is None:
        return tuple(parts)
    (bib,), (band,) = bibs, bands
    out = list(parts)
    out[bib] = _as_bib(parts[bib])
    middles = _middles(parts, band)
    if middles is None:
        return tuple(parts)
    hem = out[bib].shape.length(out[bib].roles["hem"])
    spans = {BIB: (middles[0] - 0.5 * hem, middles[0] + 0.5 * hem)}
    straps = pair_of_straps(parts)
    for strap, side in zip(straps, (LEFT, RIGHT), strict=True) if straps else ():
        wide = [out[strap].shape.length(out[strap].roles[end]) for end in ("end", "end2")]
        end = end_of_strap(out[bib], side, wide[0])
        if end is None:
            return tuple(parts)
        far = across_of(out[bib], end)
        out[bib] = with_end(out[bib], side, end)
        # along the upper edge as the ring goes, from the wearer's right over the front to the left, and on behind
        at = middles[1] - side * far
        spans[STRAP + side_mark(out[band], side)] = (at - 0.5 * wide[1], at + 0.5 * wide[1])
        out[strap] = replace(out[strap], side=side, sure=ACROSS * out[strap].sure)
    parts_of_edge = _with_spans(out[band], spans)
    if parts_of_edge is None:
        return tuple(parts)
    out[band] = parts_of_edge
    return tuple(out)


def proposed_bibs(parts: Sequence[Part]) -> Iterable[Joint]:
    """The seam between a bib and the part of a waistband that ``with_bibs_on_bands`` found for it."""
    for bib in parts_of_kind(parts, BIB):
        for band in parts_of_kind(parts, "waistband"):
            runs = parts[bib].roles.get("hem", ()), parts[band].roles.get(BIB, ())
            yield from joint_of(parts, run_of(bib, runs[0]), run_of(band, runs[1], True), BIB)


def _as_bib(part: Part) -> Part:
    """A bib with its edges by role: sewn at its hem, its sides open as armholes are."""
    roles = skirt_roles(part.shape)
    sides = {f"armhole{mark}": roles[f"side{mark}"] for mark in "+-"}
    return replace(part, roles={"hem": roles["hem"], "neck": roles["waist"], **sides, BIB: ()})


def _middles(parts: Sequence[Part], band: int) -> tuple[float, float] | None:
    """Where along a band's upper edge the middles of front and back are [m], from where its ring begins.

    None: it goes round no closed ring of a front and a back, or its upper edge is not as long as the lower.
    """
    part, ring = parts[band], ring_of(parts, band)
    long, upper = (part.shape.length(part.roles.get(role, ())) for role in ("long", "long2"))
    if not ring or not long or upper < (1.0 - AS_LONG) * long:
        return None
    faces = [parts[side.panel].kind.rpartition("_")[2] for side in ring]
    turns = [face for face, before in zip(faces, ["", *faces], strict=False) if face != before]
    if turns != ["front", "back"]:
        return None
    ahead = length_of(parts, [side for side, face in zip(ring, faces, strict=True) if face == "front"])
    whole = length_of(parts, ring)
    return 0.5 * ahead / whole * upper, 0.5 * (ahead + whole) / whole * upper


def _with_spans(band: Part, spans: dict[str, tuple[float, float]]) -> Part | None:
    """A band whose upper edge is parted at spans from where its ring begins [m]; None: they overlap, or do not fit.

    The lower edge runs along the ring, so that the upper one runs against it.
    """
    long = band.shape.length(band.roles["long2"])
    turned = sorted((long - high, long - low, role) for role, (low, high) in spans.items())
    places = [place for low, high, _ in turned for place in (low, high)]
    free = long - sum(high - low for low, high, _ in turned)
    if places[0] <= 0.0 or places[-1] >= long or (np.diff(places) <= 0.0).any() or free < LEAST_FREE * long:
        return None
    made, runs = parted(band, band.roles["long2"], places)
    own = {role: runs[2 * n + 1] for n, (_, _, role) in enumerate(turned)}
    return replace(made, roles={**made.roles, **own}) if made.side == BOTH else None
