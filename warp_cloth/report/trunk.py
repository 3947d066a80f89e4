"""Is a garment large enough for the body's trunk by its cut? Too short from shoulder to crotch, or too narrow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from warp_cloth.anatomy.skeleton import HEAD
from warp_cloth.anatomy.trunk_girth import NARROW, trunk_girth
from warp_cloth.anatomy.trunk_loop import SHORT, trunk_loop
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.report.judged import Judged, listed


def too_short(judged: Judged) -> Iterator[FitProblem]:
    """A trunk too short for its body, so that a garment with legs slid off the shoulders or tore."""
    wearing, body, rest = judged.of.outfit.wearing[judged.index], judged.of.body, judged.garment.rest
    loop = None if wearing is None or body is None else trunk_loop(wearing, judged.edge_ends, rest.edge_length, body)
    if wearing is None or loop is None or not loop.is_short:
        return
    pairs = zip(wearing.openings, wearing.limbs, strict=True)
    yield FitProblem(
        ProblemCode.TOO_SMALL,
        f'"{judged.name}" is too small for the body: over a shoulder and between the legs it is '
        f"{100 * loop.garment:.0f} cm around as cut, and the body {100 * loop.body:.0f} cm.",
        "Lengthen its trunk, or use a larger size or a smaller body.",
        judged.name,
        {"loop_mm": 1e3 * loop.garment, "body_loop_mm": 1e3 * loop.body, "limit": SHORT},
        vertices=listed(np.concatenate([opening.loop for opening, limbs in pairs if HEAD in limbs])),
    )


def too_narrow(judged: Judged) -> Iterator[FitProblem]:
    """A trunk too narrow for its body's chest, so that a garment with sleeves tore."""
    wearing, body, sheet = judged.of.outfit.wearing[judged.index], judged.of.body, judged.garment.rest.sheet
    if wearing is None or body is None or sheet is None:
        return
    girth = trunk_girth(wearing, sheet.flat, body)
    if girth is None or not girth.is_narrow:
        return
    yield FitProblem(
        ProblemCode.TOO_SMALL,
        f'"{judged.name}" is too small for the body: from waist to chest it is {100 * girth.garment:.0f} cm around as '
        f"cut, and the body's chest {100 * girth.body:.0f} cm.",
        "Use a larger size, or a smaller body.",
        judged.name,
        {"girth_mm": 1e3 * girth.garment, "body_girth_mm": 1e3 * girth.body, "limit": NARROW},
        vertices=listed(girth.vertices),
    )
