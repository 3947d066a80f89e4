"""Is a garment held? Nothing holds it, it fell off, slid down, or a piece of it came off."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from warp_cloth.anatomy.linking import COVERED, LOPSIDED
from warp_cloth.anatomy.skeleton import HEAD, LIMBS, skeleton_or_reason
from warp_cloth.avatar.openings import Opening
from warp_cloth.base.connected import mesh_parts
from warp_cloth.base.mesh import Mesh
from warp_cloth.loading.raw import counted
from warp_cloth.model.attempt import TORN
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.model.result import Status
from warp_cloth.report.armless import has_no_limb
from warp_cloth.report.judged import Judged, listed
from warp_cloth.report.trunk import too_narrow, too_short

BELOW_FEET = 0.15  # fraction of a garment that has come down below the avatar; less is a train, or a long hem
# Of the avatar's height: a garment that reaches higher is held there, like a gown, or a cloth over a ball.
HANGING = 0.5
# Of the avatar's height: how far the top opening of a worn garment comes down at most. Of 81 designs at rest, fitted
# skirts settle by up to 0.084, and two strapless tops slide down by 0.1; hoods and collars fold down further.
SLID, FOLDED = 0.09, 0.18
# Of the way from the waist down to the crotch: how low the top of a skirt rests at most, wherever it started. The hips
# hold it above there: they are widest at 0.85 to 0.95.
LOWEST_TOP = 0.67
# Of the way from the shoulders to the waist: how far what hangs from the bust comes down at most. Two strapless tops
# that stay there settle by 0.11 and 0.21; one that came down by 0.45 lies heaped up round the waist.
FROM_BUST = 0.33
LEVEL = 0.01  # of the avatar's height, up to which openings start at one height
OVER_END = 0.005  # [m], more than cloth that lies on the rim of a body that ends at the waist: nothing is in that there
NECK = 0.8  # of the avatar's height, above which a top opening is a collar or a hood
NARROWEST = 0.06  # of the avatar's height: the girth of an opening for a limb; less is a buttonhole
SCRAP = 0.1  # of the vertices of a garment's largest piece; what has fewer does not tell where the garment hangs
DETACHED = 0.1  # [m]; a piece of a garment that falls farther than the largest piece has come off


def support_problems(judged: Judged) -> Iterator[FitProblem]:
    """Problems of what holds a garment; of a pinned one only that a piece comes off."""
    lost = None
    if not judged.pinned:
        lost = unsupported(judged) or fell_off(judged) or slid_off(judged) or slid_down(judged)
        lost = lost or hangs_from_one_hip(judged) or off_shoulders(judged)
        yield from over_end(judged)
        yield from too_long(judged)
        if (lost is not None and lost.code is ProblemCode.SLID_OFF) or (judged.strains > TORN).any():
            yield from too_short(judged)
            yield from too_narrow(judged)
    if lost is not None:
        yield lost
    else:
        yield from detached_pieces(judged)
    if not judged.pinned and (lost is None or lost.code is ProblemCode.SLID_OFF):
        misplaced = list(wrong_openings(judged))
        yield from misplaced or empty_openings(judged)


def unsupported(judged: Judged) -> FitProblem | None:
    """A garment without pins and without a body."""
    if judged.of.body is not None or judged.of.outcome.status is Status.AT_REST:
        return None
    return FitProblem(
        ProblemCode.UNSUPPORTED,
        f'Nothing holds "{judged.name}": it has no pins and no avatar.',
        "Put it on an avatar, or pin some of its vertices.",
        judged.name,
        vertices=tuple(range(len(judged.points))),
    )


def fell_off(judged: Judged) -> FitProblem | None:
    """A garment that is wholly beside or below its body."""
    body, points = judged.of.body, judged.points
    if body is None:
        return None
    low, high = body.bounds()
    beside = np.maximum(points.min(axis=0) - high, low - points.max(axis=0))[[0, 2]].max()
    below = low[1] - points[:, 1].max()
    if beside <= 0.0 and below <= 0.0 and not judged.of.falling[judged.vertices].all():
        return None
    message = f'"{judged.name}" has fallen past the avatar, which does not hold it.'
    if beside > 0.0:
        message = f'"{judged.name}" is beside the avatar, which cannot hold it.'
    return FitProblem(
        ProblemCode.FELL_OFF,
        message,
        "Place it around or above the avatar, or pin some of its vertices.",
        judged.name,
        {"beside_mm": 1e3 * max(float(beside), 0.0), "below_mm": 1e3 * max(float(below), 0.0)},
        vertices=tuple(range(len(points))),
    )


def _feet_and_crown(judged: Judged, body: Mesh) -> tuple[float, float]:
    """Heights of the ends of a body, with the limbs that it may lack: trousers reach below a form without legs [m]."""
    wearing = judged.of.outfit.wearing[judged.index]
    points = body.points if wearing is None else wearing.skeleton.extremes
    return float(points[:, 1].min()), float(points[:, 1].max())


def slid_off(judged: Judged) -> FitProblem | None:
    """A garment that has slid down to its body's feet."""
    body, points = judged.of.body, judged.points
    if body is None:
        return None
    floor, top = _feet_and_crown(judged, body)
    if points[:, 1].max() > floor + HANGING * (top - floor):
        return None
    below, before = ((place[:, 1] < floor).mean() for place in (points, judged.garment.points))
    if not below - before > BELOW_FEET:
        return None
    return FitProblem(
        ProblemCode.SLID_OFF,
        f'"{judged.name}" has slid down to the avatar\'s feet, and {100 * below:.0f} % of it hangs below them '
        "(there is no floor).",
        "It is too wide to stay up: use a smaller one, or pin some of its vertices.",
        judged.name,
        {"below_feet_fraction": float(below), "slid_mm": 1e3 * _drop(judged)},
        vertices=listed(np.flatnonzero(points[:, 1] < floor)),
    )


def slid_down(judged: Judged) -> FitProblem | None:
    """A garment whose top opening has come down far."""
    body, overlap = judged.of.body, judged.of.measured.overlap
    openings = [] if overlap is None else [each for each in overlap.openings if each.garment == judged.index]
    if body is None or not openings:
        return None
    number, count = _pieces(judged)
    openings = [each for each in openings if count[number[each.vertices[0]]] >= SCRAP * count.max()] or openings
    wearing = judged.of.outfit.wearing[judged.index]
    floor, top = _feet_and_crown(judged, body)
    start, height = (judged.garment.points if wearing is None else wearing.onto)[:, 1], top - floor
    heights = [float(start[opening.vertices].mean()) for opening in openings]
    # of a cape that starts as a flat disc all openings do so at one height
    level = [each for each, high in zip(openings, heights, strict=True) if high > max(heights) - LEVEL * height]
    highest = max(level, key=lambda opening: float(judged.points[opening.vertices, 1].mean()))
    began, ended = (float(place[highest.vertices].mean()) for place in (start, judged.points[:, 1]))
    limit, than = height * (FOLDED if began - floor > NECK * height else SLID), "than it started"
    if wearing is not None and wearing.is_held_by_hips:
        waist, crotch = (float(at @ wearing.skeleton.up) for at in (wearing.skeleton.waist, wearing.skeleton.spine[0]))
        began, ended = waist, float((judged.points[highest.vertices] @ wearing.skeleton.up).mean())
        limit, than = LOWEST_TOP * (waist - crotch), "than the waist"
    elif wearing is not None:
        above = max(wearing.too_high, wearing.above_waist, wearing.above_neck)
        if above > 0.0:  # it was placed higher than where it belongs: it comes down to there first
            began, than = began - above, "than where it belongs"
        if wearing.hangs_from_bust:
            way = wearing.skeleton.shoulders - wearing.skeleton.waist
            limit = min(limit, FROM_BUST * float(way @ wearing.skeleton.up))
    if not began - ended > limit:
        return None
    if wearing is not None and wearing.is_trousers and not wearing.rise(judged.points) > limit:
        return None  # trousers that are too high on this body as they start: their crotch holds them
    return FitProblem(
        ProblemCode.SLID_OFF,
        f'"{judged.name}" has slid down: its top opening came to rest {100 * (began - ended):.0f} cm lower '
        f"{than} (limit {100 * limit:.0f} cm).",
        "It is too wide to stay up: use a smaller one, pin some of its vertices, or start it where it is to be worn.",
        judged.name,
        {"slid_mm": 1e3 * (began - ended), "limit_mm": 1e3 * limit},
        vertices=listed(highest.vertices),
    )


def hangs_from_one_hip(judged: Judged) -> FitProblem | None:
    """A garment whose waist has slid down on one side, from the hip there."""
    wearing = judged.of.outfit.wearing[judged.index]
    if wearing is None or judged.of.body is None or not wearing.hangs_from_one_hip(judged.points):
        return None
    slope = wearing.slope(judged.points)
    return FitProblem(
        ProblemCode.SLID_OFF,
        f'"{judged.name}" has slid down on the {"right" if slope > 0.0 else "left"}: its top opening slopes by '
        f"{np.degrees(np.arctan(abs(slope))):.0f} degrees from side to side (limit "
        f"{np.degrees(np.arctan(LOPSIDED)):.0f}).",
        "It is too wide to stay up: use a smaller one, or pin some of its vertices.",
        judged.name,
        {"slope": abs(slope), "limit": LOPSIDED},
        vertices=listed(wearing.top.loop),
    )


def over_end(judged: Judged) -> Iterator[FitProblem]:
    """A waist that stands above a body that ends below it."""
    wearing = judged.of.outfit.wearing[judged.index]
    if wearing is None or judged.of.body is None or not wearing.hangs_from_waist:
        return
    over = wearing.over_end(judged.points)
    if over > OVER_END:
        yield FitProblem(
            ProblemCode.EMPTY_OPENING,
            f'The top of "{judged.name}" stands {1e3 * over:.0f} mm above the body, which ends below it, so that '
            "nothing holds it there.",
            "Use a body that reaches above its waist, or a garment that begins lower.",
            judged.name,
            {"over_mm": 1e3 * over, "limit_mm": 1e3 * OVER_END},
            vertices=listed(wearing.top.loop),
        )


def off_shoulders(judged: Judged) -> FitProblem | None:
    """A garment that started over the shoulders, and hangs on the arms now."""
    wearing, found = judged.of.outfit.wearing[judged.index], judged.of.measured.off_shoulders
    arms = found[judged.index] if found and judged.of.body is not None else ()
    if wearing is None or not arms:
        return None
    sides = " and ".join(LIMBS[arm].split()[0] for arm in arms)
    necklines = [opening.loop for opening, limbs in zip(wearing.openings, wearing.limbs, strict=True) if HEAD in limbs]
    return FitProblem(
        ProblemCode.SLID_OFF,
        f'"{judged.name}" has slipped off the {sides} shoulder{"s" * (len(arms) > 1)}, and hangs on the arm'
        f"{'s' * (len(arms) > 1)}.",
        "Its neckline is too wide for this body: use a smaller size, or pin some of its vertices.",
        judged.name,
        {"shoulders": len(arms)},
        vertices=listed(np.concatenate(necklines)),
    )


def too_long(judged: Judged) -> Iterator[FitProblem]:
    """Sleeves and legs that hands and feet do not come out of."""
    wearing = judged.of.outfit.wearing[judged.index]
    covered = [] if wearing is None or judged.of.body is None else wearing.covered(judged.points)
    if not covered:
        return
    ends = " and ".join(LIMBS[limb] for _, limbs in covered for limb in limbs)
    yield FitProblem(
        ProblemCode.TOO_LARGE,
        f'"{judged.name}" is too large for the body: the {ends} {"ends" if len(covered) == 1 else "end"} in it, more '
        f"than {100 * COVERED:.0f} cm before its opening.",
        "Use a smaller size, or shorten its sleeves or legs.",
        judged.name,
        {"openings": len(covered), "limit_mm": 1e3 * COVERED},
        vertices=listed(np.concatenate([opening.loop for opening, _ in covered])),
    )


def wrong_openings(judged: Judged) -> Iterator[FitProblem]:
    """Openings that other limbs pass through than those that they are for."""
    for each in judged.of.measured.misplaced[judged.index] if judged.of.measured.misplaced else ():
        wanted = " and ".join(LIMBS[limb] for limb in each.wanted)
        found = " and ".join(LIMBS[limb] for limb in each.found) or "nothing"
        yield FitProblem(
            ProblemCode.WRONG_OPENING,
            f'An opening of "{judged.name}" that is {100 * each.opening.girth:.0f} cm around is for the {wanted}, but '
            f"{found} pass{'es' if len(each.found) < 2 else ''} through it.",
            "Place the panels around the limb that is to pass through, in the body's pose.",
            judged.name,
            {"girth_mm": 1e3 * each.opening.girth},
            vertices=listed(each.opening.loop),
        )


def empty_openings(judged: Judged) -> Iterator[FitProblem]:
    """Openings that nothing passes through, such as the end of a sleeve beside the arm."""
    body, overlap = judged.of.body, judged.of.measured.overlap
    if body is None or overlap is None:
        return
    low, high = body.bounds()
    narrowest = NARROWEST * float(high[1] - low[1])
    own = [opening for opening in overlap.openings if opening.garment == judged.index]
    empty = [
        opening
        for opening in own
        if not opening.filled
        and opening.girth > narrowest
        and judged.points[opening.vertices, 1].max() > low[1]  # below a bust, or the feet, there is nothing to enclose
        and not has_no_limb(judged, opening, own)
        and not _is_cut_out(judged, opening)
    ]
    if not empty:
        return
    girth = max(opening.girth for opening in empty)
    verb = "encloses" if len(empty) == 1 else "enclose"
    yield FitProblem(
        ProblemCode.EMPTY_OPENING,
        f'{counted(len(empty), "opening")} of "{judged.name}" {verb} nothing, the largest {100 * girth:.0f} cm around: '
        f"no limb passes through.{_unlimbed(judged)}",
        "Place the panels around the limb that is to pass through, in the body's pose.",
        judged.name,
        {"openings": len(empty), "girth_mm": 1e3 * girth},
        vertices=listed(np.concatenate([opening.vertices for opening in empty])),
    )


def _is_cut_out(judged: Judged, empty: Opening) -> bool:
    """Whether an opening is for no limb, as a hole in lace, while others in the same piece of cloth are for some."""
    wearing = judged.of.outfit.wearing[judged.index]
    if wearing is None:
        return False
    place, pairs = empty.vertices[0], list(zip(wearing.openings, wearing.limbs, strict=True))
    is_own = any(not limbs and place in opening.loop for opening, limbs in pairs)
    return is_own and any(limbs and np.isfinite(opening.distances[place]) for opening, limbs in pairs)


def _unlimbed(judged: Judged) -> str:
    """A sentence that says why it was not dressed, where no limbs of the body can be identified; else empty."""
    body, outfit = judged.of.body, judged.of.outfit
    if body is None or outfit.poses or outfit.wearing[judged.index] is not None:
        return ""
    reason = skeleton_or_reason(body)
    why = f" It started as it was placed, since no limbs of the body can be identified: {reason}."
    return why if isinstance(reason, str) else ""


def _drop(judged: Judged) -> float:
    """How far its highest vertex has come down [m]."""
    return float(judged.garment.points[:, 1].max() - judged.points[:, 1].max())


def detached_pieces(judged: Judged) -> Iterator[FitProblem]:
    """Pieces that fall off because nothing connects them to the rest."""
    start, points = judged.garment.points, judged.points
    fall, falls = start[:, 1] - points[:, 1], judged.of.falling[judged.vertices]
    if not (fall.max() > fall.min() + DETACHED or falls.any()):
        return
    number, count = _pieces(judged)
    if len(count) == 1:
        return
    least = np.full(len(count), np.inf)
    np.minimum.at(least, number, fall)
    further = least - np.median(fall[number == np.argmax(count)])
    fallen = further > DETACHED
    fallen[number[falls]] = True
    if not fallen.any():
        return
    stays = ~fallen[number]  # the largest piece may be the one that fell; then it is compared with the others
    others = float(np.median(fall[stays])) if stays.any() else 0.0
    yield FitProblem(
        ProblemCode.DETACHED_PIECE,
        f'{int(fallen.sum())} of the {counted(len(count), "piece")} of "{judged.name}" fall off, because nothing '
        "connects them to the others.",
        "Leave out loose parts, weld them to the garment, or lay them on its cloth, which carries buttons.",
        judged.name,
        {"pieces": int(fallen.sum()), "fallen_mm": 1e3 * (float(least[fallen].max()) - others)},
        vertices=listed(np.flatnonzero(fallen[number])),
    )


def _pieces(judged: Judged) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which piece of connected cloth each vertex is of, shape [V], and how many vertices each piece has, shape [P]."""
    piece = mesh_parts(len(judged.points), judged.garment.triangles)
    _, number, count = np.unique(piece, return_inverse=True, return_counts=True)
    return number, count
