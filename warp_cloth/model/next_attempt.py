"""Which attempt at a fit follows where one has not ended well, from how attempts have ended."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.trunk_girth import trunk_girth
from warp_cloth.anatomy.trunk_loop import trunk_loop
from warp_cloth.base.choice import Choice
from warp_cloth.base.mesh import Mesh
from warp_cloth.garment.outfit import Outfit
from warp_cloth.garment.rest import RestShape
from warp_cloth.model.attempt import Attempt, CutShort, Ended, Patience, best_of
from warp_cloth.model.first_attempt import (
    FALLING,
    METHOD_KEY,
    decided_attempt,
    may_be_posed,
    may_have_levels,
    posed_attempt,
    updated,
)
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene

# Crossing pairs of triangles per vertex up to which cloth relaxed without contact is worth untangling: of 20 random
# designs with 0.01 to 0.07 all but one came apart, with 0.1 or more none.
FEW_CROSSINGS = 0.08

# Per-vertex and implicit steps by turns, where cloth that meets cloth still falls: implicit ones let it fall as a
# whole, and per-vertex ones settle it for less. Of 37 loose designs 16 rested within LEVELLING implicit ones, and the
# others mostly sooner by per-vertex ones from there; by implicit ones alone one took 124,000.
LEVELLING, SETTLING = 4000, 15_000
MOST_LEVELLINGS = 2

# Torn edges per vertex, up to which cloth that is caught on a limb slides off it first: a cuff of a random design had
# 2.4e-3 where it had come to rest on the hand, and none after 250 iterations.
FEW_CAUGHT = 5e-3
FEW_TORN = 1e-3  # torn edges per vertex, up to which cloth slides whole in a second or two, as a neckline does

MOST_PADDINGS = 3  # of the avatar under faces that it shows through
OFFSET_KEY = "collision.offset_mm"
WHY_SETTLING = "the multilevel method has let it fall as a whole"

# Iterations in which torn cloth slides over the avatar without friction: in steps until it is whole, as straps slide
# off shoulders, too; where that ends badly, once for long.
SLIDES = (250, 250, 500, 1_000, 2_000)


def next_attempt(history: Sequence[Ended], outfit: Outfit, *, locked: bool = False) -> Attempt | None:
    """What a scene is fitted with after these attempts; None: all is well, or there is nothing else to try.

    Cloth that crosses is relaxed again with contact. Cloth that meets cloth and still falls, or comes no nearer to
    rest, goes on by implicit steps. Cloth that is torn or tangled round a limb is sewn again, round the avatar as it is
    posed within the garment, and so is what slid down or slipped off the shoulders. What is whole but crosses is
    untangled round the avatar as it is thinned within it. Where the avatar shows through faces, it is padded under
    them. Cloth that does not come to rest is relaxed by the multilevel method without contact, which sews and lets fall
    as a whole; where that leaves few crossings they are then undone, and where it leaves many the attempt with contact
    goes on. No other way of starting follows a dressed start, nor what is too short or narrow for the trunk by its cut.

    ``locked``: whether cloth crosses itself so much as it was modelled that no posed or thinned avatar parts it.
    """
    ended = history[-1]
    attempt, stated = ended.attempt, ended.attempt.stated
    if ended.good or ended.status is Status.DIVERGED:
        return None
    if ended.cut_short is CutShort.FALLING and (attempt.posed or not may_be_posed(stated, outfit)):
        return None  # it would fall so again
    if stated.solver.iterations is not None and ended.status is not Status.AT_REST and ended.cut_short is None:
        return None  # as many iterations as the scene wants
    if stated.solver.start == "dressed":
        return _after_dressed(history)
    if ended.cut_short is CutShort.SLOW or _may_turn(ended):
        return _turned(history)
    if attempt.slides and not _tangles(history):
        return _slid(history)
    if (ended.whole_but_short and _is_too_short(outfit)) or (ended.rests_torn and _is_too_narrow(outfit)):
        return None
    return (
        _usual_attempt(history, outfit, locked)
        or _thinned(history, outfit, locked)
        or _last_resort(history, outfit)
        or _thinned(history, outfit, locked, torn=True)
        or _padded_at_last(history)
        or _resumed(history)
    )


def _is_too_short(outfit: Outfit) -> bool:
    """Whether a garment's trunk is too short for the body by its cut: it pulls itself off the shoulders, or tears."""
    for rest, wearing, body in _on_body(outfit):
        loop = trunk_loop(wearing, rest.topology.edges, rest.edge_length, body)
        if loop is not None and loop.is_short:
            return True
    return False


def _is_too_narrow(outfit: Outfit) -> bool:
    """Whether a garment's trunk is too narrow for the body by its cut: no start makes it wider."""
    for rest, wearing, body in _on_body(outfit):
        girth = None if rest.sheet is None else trunk_girth(wearing, rest.sheet.flat, body)
        if girth is not None and girth.is_narrow:
            return True
    return False


def _on_body(outfit: Outfit) -> Iterator[tuple[RestShape, Wearing, Mesh]]:
    """The garments that have openings on a body, each as cut, and the body."""
    for garment, wearing in zip(outfit.garments, outfit.wearing, strict=True):
        if wearing is not None and outfit.avatar is not None:
            yield garment.rest, wearing, outfit.avatar


def _after_dressed(history: Sequence[Ended]) -> Attempt | None:
    """What crosses after a dressed start, which has no contact, goes on from there with it."""
    ended = history[-1]
    stated = ended.attempt.stated
    if ended.attempt.touches or not ended.crossings or stated.collision.cloth is False:
        return None
    begins_after = len(history) - 1
    why = "cloth crossed without it", "contact is per vertex"
    return decided_attempt(stated, "accelerated", True, *why, begins_after, last=True)


def is_locked(crossings: int, vertices: int) -> bool:
    """Whether too many pairs of triangles of a mesh cross for contact to part them."""
    return crossings > FEW_CROSSINGS * vertices


def _usual_attempt(history: Sequence[Ended], outfit: Outfit, locked: bool) -> Attempt | None:
    """What mostly helps; once the last resort is tried, only what follows a start that was lifted."""
    first = next((n for n, each in enumerate(history) if each.attempt.lifted), 0)
    ended, own = history[-1], history[first:]
    attempt, stated = ended.attempt, ended.attempt.stated
    levelled = max((n for n, each in enumerate(history) if each.attempt.has_levels), default=0)
    is_late = first > 0 or any(each.attempt.slides for each in history[levelled:])
    if _may_slide_off(history):
        return _sliding(attempt, len(history) - 1, 1)
    posed_next = not locked and may_be_posed(stated, outfit) and not any(each.attempt.posed for each in history)
    levels_next = may_have_levels(stated) and not any(each.attempt.has_levels for each in own)
    if posed_next and (ended.torn or ended.misplaced or (ended.cut_short is CutShort.CROSSING and attempt.touches)):
        return posed_attempt(stated, outfit, "cloth was torn or tangled round a limb", last=not levels_next)
    if attempt.touches and ended.cut_short is CutShort.CROSSING and (thinned := _thinned(history, outfit, locked)):
        return thinned
    if posed_next and ended.sunk:
        return posed_attempt(stated, outfit, "it slid down from the waist", last=not levels_next)
    if posed_next and ended.slipped:
        return posed_attempt(stated, outfit, "it slipped off the shoulders", last=not levels_next)
    if ended.well:
        may_pad = _may_pad(stated) and attempt.paddings < MOST_PADDINGS
        return _padded(ended, len(history) - 1) if ended.shown and may_pad else None
    if is_late and (not first or _last_posed(own) is None):
        return None
    if 0 < ended.torn <= FEW_TORN * ended.vertices and ended.ended_placed and attempt.posed:
        return None  # it slides into place
    may_touch = stated.collision.cloth is not False
    if attempt.touches:
        return _levels(stated, history, _last_posed(history)) if levels_next else None
    if may_touch and (ended.crossings or (attempt.has_levels and len(own) > 1)):
        if ended.torn and attempt.has_levels and own[0].status is Status.AT_REST:
            return None
        begins_after = _untangling_start(history, first)
        if begins_after is None and any(each.attempt.touches for each in own):
            return None
        why = "cloth crossed without it"
        method = "direct" if stated.solver.method == "direct" else "accelerated"
        untangled = decided_attempt(
            stated, method, True, why, "contact is per vertex", begins_after, last=not levels_next
        )
        return _on_padded(untangled, history)
    still_open = ended.torn or ended.misplaced or ended.status is not Status.AT_REST
    return _levels(stated, history, _last_posed(history)) if levels_next and still_open else None


def _may_slide_off(history: Sequence[Ended]) -> bool:
    """Whether cloth has few torn edges, where it is caught on a limb or was pushed out, and has not slid yet.

    Every limb is in its opening then. What is pushed out is coarse cloth where the avatar is padded under it: friction
    holds the edges around a thumb.
    """
    ended = history[-1]
    few = 0 < ended.torn <= FEW_CAUGHT * ended.vertices
    has_slid = any(each.attempt.slides for each in history)
    is_held = ended.caught or ended.attempt.paddings > 0
    return is_held and few and ended.hangs_in_openings and not has_slid and _may_do_more(ended.attempt.stated)


def _may_do_more(stated: Scene) -> bool:
    """Whether the scene leaves it to the program how it is relaxed, and for how long."""
    return stated.solver.iterations is None and stated.solver.method == "auto"


def _thinned(history: Sequence[Ended], outfit: Outfit, locked: bool, *, torn: bool = False) -> Attempt | None:
    """Once, what is whole and rightly worn but crosses is untangled round the avatar as it is thinned within.

    ``torn``: or what was torn as it crossed, once it was dressed.
    """
    stated = history[0].attempt.stated
    placed = [(n, each) for n, each in enumerate(history) if not (each.misplaced or each.attempt.slides)]
    ends = [(n, each) for n, each in placed if not each.torn or (torn and each.attempt.posed)]
    worn = {n: each.crossings for n, each in ends if each.status is not Status.DIVERGED}
    is_over = stated.collision.cloth is False or any(each.attempt.thins for each in history)
    if locked or is_over or not worn or min(worn.values()) == 0 or not may_be_posed(stated, outfit):
        return None
    number = min(worn, key=lambda n: (worn[n], -n))
    last = not may_have_levels(stated) or any(each.attempt.has_levels for each in history)
    why = "cloth crossed", "contact is per vertex"
    method = "accelerated" if stated.solver.method == "auto" else stated.solver.method
    attempt = decided_attempt(stated, method, True, *why, number, last=last)
    how = Choice("solver.start", "untangled", "cloth crossed that the body held, so the body was thinned within it")
    return _on_padded(replace(attempt, thins=True, choices=(*attempt.choices, how)), history)


def _may_pad(stated: Scene) -> bool:
    return "offset_mm" not in stated.collision.model_fields_set


def _last_resort(history: Sequence[Ended], outfit: Outfit) -> Attempt | None:
    """What is tried where all else ended badly: cloth tugged into place, then another way of sewing it."""
    best, stated = history[best_of(history)], history[0].attempt.stated
    if best.good or not _may_do_more(stated):
        return None
    torn = [each for each in history if each.torn and each.hangs_in_openings]
    slid = max(each.attempt.slides for each in history)
    if torn and stated.avatar is not None and slid < len(SLIDES):
        most = max(torn, key=lambda each: each.rank)
        return _sliding(most.attempt, history.index(most), len(SLIDES) if slid else 1)
    if torn and not any(each.attempt.has_levels for each in history) and may_have_levels(stated):
        return _levels(stated, history, _last_posed(history))
    may_lift = any(wearing is not None and not wearing.is_skirt for wearing in outfit.wearing)
    is_torn = best.torn > 0 or best.misplaced
    posed = [each.attempt for each in history if each.attempt.posed]
    if (is_torn or best.slipped) and may_lift and posed and not any(attempt.lifted for attempt in posed):
        why = "it was torn as it hung on the avatar" if is_torn else "it slipped off the shoulders, carried onto them"
        return replace(posed_attempt(stated, outfit, why, last=False), lifted=True)
    return None


def _sliding(before: Attempt, number: int, slides: int) -> Attempt:
    """One that slides over the avatar from where an attempt left it, as its wearer would tug it into place."""
    before = _settling(before)
    scene = before.scene
    if scene.avatar is None:
        raise ValueError("there is no avatar to slide over")
    solver = updated(scene.solver, iterations=SLIDES[slides - 1])
    sliding = updated(scene, avatar=updated(scene.avatar, friction=0.0), solver=solver)
    others = tuple(choice for choice in before.choices if choice.key != "solver.start")
    why = "friction held cloth where it was torn, so it slid into place without"
    return replace(
        before,
        scene=sliding,
        choices=(*others, Choice("solver.start", "slid into place", why)),
        begins_after=number,
        patience=Patience.NONE,
        posed=False,
        thins=False,
        slides=slides,
    )


def _slid(history: Sequence[Ended]) -> Attempt:
    """What follows one that slid: the same farther while cloth is torn, then the scene's own friction."""
    ended, number = history[-1], len(history) - 1
    slides = ended.attempt.slides
    if ended.torn and slides < len(SLIDES) - 1:
        return _sliding(ended.attempt, number, slides + 1)
    first = history[number if slides == len(SLIDES) else number - slides + 1].attempt
    own = history[first.begins_after or 0].attempt.scene
    return _settling(replace(ended.attempt, scene=own, begins_after=number, patience=Patience.LONG, slides=0))


def _tangles(history: Sequence[Ended]) -> bool:
    """Whether cloth that meets cloth tangles as it slides: it crosses in many places, or in ever more.

    Friction would hold it so. It began apart: a slide goes on from what keeps out of itself.
    """
    ended = history[-1]
    before = history[ended.attempt.begins_after or 0].crossings
    grows = ended.crossings > before > 0
    return ended.attempt.touches and ended.torn > 0 and (grows or is_locked(ended.crossings, ended.vertices))


def _last_posed(history: Sequence[Ended]) -> int | None:
    """The attempt with the avatar posed, if it put every limb into its opening."""
    good = [n for n, each in enumerate(history) if each.attempt.posed and not (each.torn or each.misplaced)]
    return good[-1] if good else None


def _untangling_start(history: Sequence[Ended], first: int) -> int | None:
    """The attempt from whose shape one with contact starts; None: as the garments are placed."""
    ended = history[-1]
    if ended.attempt.has_levels:
        if ended.crossings <= FEW_CROSSINGS * ended.vertices and not ended.torn:
            return len(history) - 1
        for number, each in reversed(list(enumerate(history[first:], first))):
            if each.attempt.touches and each.crossings <= FEW_CROSSINGS * each.vertices and not each.torn:
                return number
    return None


def _levels(
    stated: Scene,
    history: Sequence[Ended],
    begins_after: int | None,
    why: str = "the accelerated method ended torn, or made no more progress",
) -> Attempt:
    attempt = decided_attempt(stated, "multilevel", False, "nothing crosses", why, begins_after, last=False)
    return _on_padded(attempt, history)


def _on_padded(attempt: Attempt, history: Sequence[Ended]) -> Attempt:
    """The attempt with the avatar padded as that from which it starts, and where it showed through there."""
    if attempt.begins_after is None:
        return attempt
    before = history[attempt.begins_after]
    paddings = before.attempt.paddings
    if before.shown and not (before.torn or before.misplaced) and _may_pad(attempt.stated) and paddings < MOST_PADDINGS:
        paddings += 1
    return _with_paddings(attempt, paddings)


def _may_turn(ended: Ended) -> bool:
    """Whether cloth that comes no nearer to rest by per-vertex steps can turn: it is whole, or no more can be sewn."""
    attempt = ended.attempt
    whole = ended.apart and (attempt.posed or not (ended.torn or ended.misplaced))
    stalled = ended.cut_short is CutShort.STALLED and attempt.patience is Patience.SHORT
    return whole and stalled and attempt.touches and attempt.turn_after == FALLING


def _turned(history: Sequence[Ended]) -> Attempt:
    """The same attempt, from where it ended, by the other kind of steps; without contact they begin with levels."""
    if not history[-1].attempt.touches:
        return _levels(history[0].attempt.stated, history, _last_posed(history), "loose cloth was still falling")
    before = replace(history[-1].attempt, begins_after=len(history) - 1, patience=Patience.LONG, thins=False)
    levelled = sum(each.attempt.levels_contact for each in history)
    if before.levels_contact:
        turn_after = SETTLING if levelled < MOST_LEVELLINGS else None
        method, why = "accelerated", WHY_SETTLING
    else:
        turn_after, method, why = LEVELLING, "multilevel", "loose cloth was still falling"
    return replace(_by_method(before, method, why), turn_after=turn_after)


def _settling(before: Attempt) -> Attempt:
    """The same attempt by per-vertex steps alone, where the program chose both kinds."""
    alone = replace(before, turn_after=None)
    return _by_method(alone, "accelerated", WHY_SETTLING) if before.levels_contact else alone


def _by_method(before: Attempt, method: str, why: str) -> Attempt:
    """The same attempt by another method, which the program chose."""
    others = [choice for choice in before.choices if choice.key != METHOD_KEY]
    scene = updated(before.scene, solver=updated(before.scene.solver, method=method))
    return replace(before, scene=scene, choices=(*others, Choice(METHOD_KEY, method, why)))


def _padded(ended: Ended, number: int) -> Attempt:
    """The same attempt, from where it ended, with the avatar padded where it shows through."""
    before = _settling(ended.attempt)
    return _with_paddings(replace(before, begins_after=number, posed=False, thins=False), before.paddings + 1)


def _padded_at_last(history: Sequence[Ended]) -> Attempt | None:
    """The best attempt with the avatar padded, where it rests whole and only shows the avatar, such as a toe."""
    number = best_of(history)
    best = history[number]
    rests = best.rests_apart and not (best.torn or best.sunk or best.slipped)
    paddings = best.attempt.paddings
    may_pad = _may_pad(best.attempt.stated) and paddings < MOST_PADDINGS
    is_over = any(each.attempt.begins_after == number and each.attempt.paddings > paddings for each in history)
    return _padded(best, number) if rests and best.shown and may_pad and not is_over else None


def _resumed(history: Sequence[Ended]) -> Attempt | None:
    """What ended as it was not worn as it should be, to its end, where no other start has come to rest apart."""
    misworn = [n for n, each in enumerate(history) if each.cut_short is CutShort.MISWORN]
    if not misworn or any(each.rests_apart or each.attempt.begins_after == misworn[0] for each in history):
        return None
    return replace(history[misworn[0]].attempt, begins_after=misworn[0], ends_misworn=False)


def _with_paddings(attempt: Attempt, paddings: int) -> Attempt:
    if not paddings:
        return attempt
    others = [choice for choice in attempt.choices if choice.key != OFFSET_KEY]
    raised = Choice(OFFSET_KEY, "raised", "the body showed through large faces, and is padded under them")
    return replace(attempt, paddings=paddings, choices=(*others, raised))
