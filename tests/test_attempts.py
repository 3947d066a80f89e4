"""What a scene leaves open is decided: contact, method and end, first from its garments, then by how a fit goes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from warp_cloth.base.cache import Cache
from warp_cloth.fitting.problem import usual_first_attempt
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.attempt import Attempt, CutShort, Ended, Patience, best_of
from warp_cloth.model.first_attempt import MOST_ITERATIONS, first_attempt
from warp_cloth.model.next_attempt import FEW_CROSSINGS, SLIDES, _padded_at_last, next_attempt
from warp_cloth.model.result import Status
from warp_cloth.scene import load_scene

SMALL_SHIRT = ["garment.shape.edge_mm=50"]
DRAPED = ["garment.shape.vertices_per_side=17"]
VERTICES = 1000
REST, LIMIT, LOST = Status.AT_REST, Status.ITERATION_LIMIT, Status.DIVERGED
TWO_SHEETS: dict[str, Any] = {
    "garment": [
        {"shape": {"kind": "square", "vertices_per_side": 3, "height": height}, "pin": {"vertices": [0, 1]}}
        for height in (1.0, 1.1)
    ]
}


def first(scene: str | dict[str, Any], *changes: str) -> Attempt:
    chosen = load_scene(scene, changes)
    return first_attempt(chosen, load_outfit(chosen))


def after(*ends: tuple[Attempt, Status, int]) -> Attempt | None:
    return following(*(Ended(attempt, status, crossings, VERTICES) for attempt, status, crossings in ends))


def following(*history: Ended) -> Attempt | None:
    return next_attempt(history, load_outfit(history[0].attempt.stated))


def decisions(attempt: Attempt | None) -> tuple[str, bool, int | None] | None:
    if attempt is None:
        return None
    return attempt.scene.solver.method, attempt.touches, attempt.begins_after


def test_sewn_panels_touch_from_the_start() -> None:
    assert decisions(first("tshirt", *SMALL_SHIRT)) == ("accelerated", True, None)


def test_several_garments_touch_from_the_start() -> None:
    attempt = first(TWO_SHEETS)
    assert attempt.touches
    assert {choice.key: choice.reason for choice in attempt.choices}["collision.cloth"] == "2 garments touch each other"


@pytest.mark.parametrize("change", ["garment.shape.side=0.5", "garment.shape.plane=vertical"])
def test_one_sheet_begins_without_contact_and_is_watched(change: str) -> None:
    attempt = first("sphere", *DRAPED, change)
    assert decisions(attempt) == ("accelerated", False, None)
    assert attempt.ends_crossing


@pytest.mark.parametrize("rest", ["mesh", "uv"])
def test_a_sheet_that_hangs_over_the_sides_of_an_avatar_touches_from_the_start(rest: str) -> None:
    attempt = first("sphere", *DRAPED, f"garment.rest={rest}")
    assert decisions(attempt) == ("accelerated", True, None)
    assert {choice.key: choice.reason for choice in attempt.choices}["collision.cloth"] == "its rim falls in folds"


@pytest.mark.parametrize("cloth", [True, False])
def test_stated_contact_holds_and_is_no_choice(cloth: bool) -> None:
    attempt = first("tshirt", *SMALL_SHIRT, f"collision.cloth={str(cloth).lower()}")
    assert attempt.touches is cloth
    assert not attempt.ends_crossing
    assert [choice.key for choice in attempt.choices] == ["solver.method"]


def test_nothing_is_chosen_where_all_is_stated() -> None:
    attempt = first("hanging", "collision.cloth=false", "solver.method=direct", "solver.iterations=7")
    assert attempt.choices == ()
    assert attempt.patience is Patience.NONE
    assert attempt.scene.solver.iterations == 7


def test_a_dressed_start_has_no_contact_until_its_cloth_crosses() -> None:
    attempt = first("sphere", *DRAPED, "solver.start=dressed")
    assert decisions(attempt) == ("accelerated", False, None)
    assert not attempt.ends_crossing
    assert after((attempt, LIMIT, 0)) is None
    untangled = after((attempt, REST, 3))
    assert decisions(untangled) == ("accelerated", True, 0)
    assert untangled is not None
    assert after((attempt, REST, 3), (untangled, REST, 3)) is None
    assert after((first("sphere", *DRAPED, "solver.start=dressed", "collision.cloth=false"), REST, 3)) is None


def test_without_a_stated_limit_an_attempt_ends_where_it_makes_no_progress() -> None:
    attempt = first("hanging")
    assert attempt.scene.solver.iterations == MOST_ITERATIONS
    assert attempt.patience is Patience.SHORT


@pytest.mark.parametrize("status", [REST, LOST])
def test_what_ends_well_or_diverged_is_not_tried_again(status: Status) -> None:
    assert after((first("hanging"), status, 0)) is None


def test_a_sheet_that_still_falls_is_relaxed_by_levels() -> None:
    falling = first("hanging")
    assert falling.turn_after is not None
    levels = following(Ended(falling, LIMIT, 0, VERTICES, cut_short=CutShort.SLOW))
    assert (decisions(levels), levels.turn_after) == (("multilevel", False, None), None)


def test_a_sheet_that_lies_as_its_panel_is_cut_touches_only_an_avatar() -> None:
    assert not first("hanging", "garment.rest=uv").touches
    assert first("sphere", "garment.rest=uv", *DRAPED).touches


def test_what_crosses_is_relaxed_anew_with_contact() -> None:
    small = first("sphere", *DRAPED, "garment.shape.side=0.5")
    assert decisions(after((small, LIMIT, 3))) == ("accelerated", True, None)


def test_crossings_are_left_where_contact_is_stated_off() -> None:
    assert after((first("sphere", *DRAPED, "collision.cloth=false"), REST, 3)) is None


def test_what_stalls_is_relaxed_by_the_multilevel_method() -> None:
    falling = first("hanging")
    levels = after((falling, LIMIT, 0))
    assert decisions(levels) == ("multilevel", False, None)
    assert levels is not None
    assert after((falling, LIMIT, 0), (levels, REST, 0)) is None


def test_where_cloth_meets_cloth_both_kinds_of_steps_go_on_by_turns() -> None:
    history, wanted = [], ["multilevel", "accelerated", "multilevel", "accelerated"]
    attempt: Attempt | None = first("tshirt", *SMALL_SHIRT)
    for number, method in enumerate(wanted):
        assert attempt.turn_after
        history.append(Ended(attempt, LIMIT, 0, VERTICES, torn=5, cut_short=CutShort.SLOW))  # seams may still close
        attempt = following(*history)
        assert decisions(attempt) == (method, True, number)
    assert (attempt.turn_after, attempt.patience) == (None, Patience.LONG)
    assert decisions(following(*history, Ended(attempt, LIMIT, 0, VERTICES))) == ("multilevel", False, None)


@pytest.mark.parametrize("stated", ["solver.iterations=9000", "solver.method=accelerated"])
def test_turns_are_the_programs_own(stated: str) -> None:
    assert first("tshirt", *SMALL_SHIRT, stated).turn_after is None


def test_a_stated_method_is_kept() -> None:
    assert after((first("hanging", "solver.method=accelerated"), LIMIT, 0)) is None


def skirt() -> tuple[Attempt, Attempt]:
    """An attempt with contact that stalled, and the one that follows."""
    sewn = first("tshirt", *SMALL_SHIRT)
    levels = after((sewn, LIMIT, 0))
    assert levels is not None
    return sewn, levels


def test_few_crossings_are_undone_from_where_the_multilevel_method_ended() -> None:
    sewn, levels = skirt()
    few = int(FEW_CROSSINGS * VERTICES)
    last = after((sewn, LIMIT, 0), (levels, REST, few))
    assert decisions(last) == ("accelerated", True, 1)
    assert last.patience is Patience.LONG
    assert after((sewn, LIMIT, 0), (levels, REST, few), (last, LIMIT, 0)) is None


@pytest.mark.parametrize("few", [0, 9])
def test_where_it_left_many_crossings_the_attempt_with_contact_goes_on(few: int) -> None:
    sewn, levels = skirt()
    assert decisions(after((sewn, LIMIT, few), (levels, REST, VERTICES))) == ("accelerated", True, 0)


def test_where_that_crosses_too_it_is_untangled_once_round_a_thinned_body() -> None:
    sewn, levels = skirt()
    ends = (sewn, LIMIT, VERTICES), (levels, REST, VERTICES - 1)
    thinned = after(*ends)
    assert decisions(thinned) == ("accelerated", True, 1)
    assert thinned.thins
    assert after(*ends, (thinned, LIMIT, 1)) is None


def test_a_body_is_not_thinned_for_cloth_that_is_torn_or_where_nothing_crosses() -> None:
    sewn, levels = skirt()
    torn = Ended(levels, REST, VERTICES, VERTICES, torn=1)
    for history in ([Ended(sewn, LIMIT, 0, VERTICES), torn], [Ended(sewn, LIMIT, 9, VERTICES, misplaced=True), torn]):
        following_it = following(*history)
        assert following_it is None or not following_it.thins


def test_what_was_dressed_and_tore_as_it_crossed_is_untangled_once_all_else_is_tried() -> None:
    posed = replace(first("tshirt", *SMALL_SHIRT), posed=True)
    history = [Ended(posed, LIMIT, 9, VERTICES, torn=1, cut_short=CutShort.CROSSING)]
    while (attempt := following(*history)) is not None and not attempt.thins:
        history.append(Ended(attempt, LIMIT, 99, VERTICES, torn=9, misplaced=True))
    assert attempt is not None
    assert (attempt.begins_after, history[-1].attempt.lifted) == (0, True)
    assert following(*history, Ended(attempt, LIMIT, 9, VERTICES)) is None


def test_what_stays_tangled_on_the_posed_body_is_untangled_at_once() -> None:
    posed = replace(first("tshirt", *SMALL_SHIRT), posed=True)
    tangled = Ended(posed, LIMIT, 9, VERTICES, cut_short=CutShort.CROSSING)
    thinned = following(tangled)
    assert (thinned.thins, thinned.begins_after) == (True, 0)
    turned = following(tangled, Ended(thinned, LIMIT, 0, VERTICES, cut_short=CutShort.SLOW))
    assert (turned.thins, turned.begins_after) == (False, 1)


def test_what_is_torn_where_it_is_placed_is_tried_by_the_multilevel_method() -> None:
    sewn = first("tshirt", *SMALL_SHIRT, "solver.start=placed")
    torn = Ended(sewn, REST, 0, VERTICES, torn=5)
    levels = following(torn)
    assert decisions(levels) == ("multilevel", False, None)
    assert levels is not None
    assert decisions(following(torn, Ended(levels, REST, 9, VERTICES))) == ("accelerated", True, 1)


def sliding() -> tuple[Ended, Ended, Attempt]:
    """What ended torn by either method, and the attempt that follows."""
    sewn = Ended(first("tshirt", *SMALL_SHIRT, "solver.start=placed"), REST, 0, VERTICES, torn=5)
    levels = following(sewn)
    assert levels is not None
    failed = Ended(levels, REST, 9, VERTICES, torn=5)
    slides = following(sewn, failed)
    assert slides is not None
    return sewn, failed, slides


def test_what_rests_torn_slides_into_place_and_then_rubs_again() -> None:
    sewn, failed, slides = sliding()
    assert (slides.begins_after, slides.scene.avatar.friction) == (0, 0.0)
    farther = following(sewn, failed, Ended(slides, LIMIT, 0, VERTICES, torn=1))
    assert (farther.begins_after, farther.slides) == (2, 2)
    last = following(sewn, failed, Ended(slides, LIMIT, 0, VERTICES, torn=1), Ended(farther, LIMIT, 0, VERTICES))
    assert (last.begins_after, last.slides) == (3, 0)
    assert last.scene == sewn.attempt.scene


def test_what_tangles_as_it_slides_slides_no_farther() -> None:
    """A child's poncho crossed in 123, 182, 287 and 471 places as it slid, and friction took 25 s to make it worse."""
    sewn, failed, slides = sliding()
    slides = replace(slides, scene=sewn.attempt.scene)  # which touches
    assert slides.touches
    begins = Ended(slides, LIMIT, 12, VERTICES, torn=1)
    farther = following(sewn, failed, begins)
    assert farther.slides == 2
    untangling, growing = (Ended(farther, LIMIT, crossings, VERTICES, torn=1) for crossings in (12, 13))
    assert following(sewn, failed, begins, untangling).slides == 3
    retried = following(sewn, failed, begins, growing)
    assert (retried.begins_after, retried.slides) == (0, len(SLIDES))  # once for long, from where it was torn
    many = Ended(slides, LIMIT, int(FEW_CROSSINGS * VERTICES) + 1, VERTICES, torn=1)
    assert following(sewn, failed, many).begins_after == 0
    assert following(sewn, failed, begins, growing, replace(many, attempt=retried)) is None


def test_what_slid_off_a_shoulder_slides_anew_at_once() -> None:
    sewn, failed, slides = sliding()
    rubs = following(sewn, failed, Ended(slides, LIMIT, 0, VERTICES))
    assert rubs is not None
    history = [sewn, failed, Ended(slides, LIMIT, 0, VERTICES), Ended(rubs, REST, 0, VERTICES, slipped=True)]
    anew = following(*history)
    assert (anew.begins_after, anew.scene.solver.iterations) == (0, SLIDES[-1])
    last = following(*history, Ended(anew, LIMIT, 0, VERTICES))
    assert (last.begins_after, last.scene) == (4, sewn.attempt.scene)
    assert following(*history, Ended(anew, LIMIT, 0, VERTICES), Ended(last, REST, 0, VERTICES)) is None


def test_what_is_torn_at_an_edge_or_two_once_dressed_slides_before_it_is_sewn_otherwise() -> None:
    posed = replace(first("tshirt", *SMALL_SHIRT), posed=True)
    nearly = Ended(posed, REST, 0, VERTICES, torn=1)
    slides = following(nearly)
    assert (slides.begins_after, slides.slides) == (0, 1)
    rubs = following(nearly, Ended(slides, LIMIT, 0, VERTICES))
    history = [nearly, Ended(slides, LIMIT, 0, VERTICES), Ended(rubs, REST, 0, VERTICES, torn=1)]
    anew = following(*history)
    history += [Ended(anew, LIMIT, 0, VERTICES, torn=1)]
    history += [Ended(following(*history), REST, 0, VERTICES, torn=1)]
    levels = following(*history)
    assert decisions(levels) == ("multilevel", False, None)
    assert decisions(following(*history, Ended(levels, REST, 9, VERTICES))) == ("accelerated", True, 5)


def test_what_slid_is_never_the_result() -> None:
    sewn, _, slides = sliding()
    assert Ended(slides, REST, 0, VERTICES).rank < sewn.rank


def test_what_still_tears_is_sewn_again_and_lifted() -> None:
    sewn = Ended(first("tshirt", *SMALL_SHIRT), LIMIT, 0, VERTICES, torn=5)
    posed = following(sewn)
    assert posed is not None
    failed = Ended(posed, LIMIT, 0, VERTICES, torn=4)
    levels = following(sewn, failed)
    assert levels is not None
    history = [sewn, failed, Ended(levels, REST, VERTICES, VERTICES, torn=9)]
    lifted = following(*history)
    assert (lifted.posed, lifted.lifted, lifted.begins_after) == (True, True, None)
    assert following(*history, Ended(lifted, LIMIT, 0, VERTICES, torn=3)) is None
    assert decisions(following(*history, Ended(lifted, LIMIT, 0, VERTICES))) == ("multilevel", False, 3)


def test_what_slips_off_as_it_is_carried_onto_the_shoulders_is_lifted() -> None:
    posed = replace(first("tshirt", *SMALL_SHIRT), posed=True)
    slipped = Ended(posed, REST, 0, VERTICES, slipped=True)
    lifted = following(slipped)
    assert (lifted.posed, lifted.lifted, lifted.begins_after) == (True, True, None)
    assert following(slipped, Ended(lifted, REST, 0, VERTICES, slipped=True)) is None


def test_what_tears_as_the_body_is_padded_under_it_slides_before_it_is_sewn_otherwise() -> None:
    """Edges of a poncho of 20 mm tore round a thumb that was padded: without friction they slid off it."""
    shirt = {"shape": {"kind": "tshirt", "edge_mm": 50}}
    scene = {"garment": shirt, "avatar": {"shape": {"kind": "mannequin"}}}
    shown = Ended(first(scene), REST, 0, VERTICES, shown=True)
    padded = following(shown)
    assert padded is not None
    torn = Ended(padded, REST, 0, VERTICES, torn=1)
    slides = following(shown, torn)
    assert slides is not None
    assert (slides.slides, slides.begins_after, slides.paddings) == (1, 1, 1)
    many = following(shown, replace(torn, torn=VERTICES // 10))
    assert many is not None
    assert many.posed


def test_the_body_stays_padded_where_it_showed_through() -> None:
    shirt = {"shape": {"kind": "tshirt", "edge_mm": 50}}
    scene = {"garment": shirt, "avatar": {"shape": {"kind": "mannequin"}}}
    shown = Ended(first(scene), REST, 0, VERTICES, shown=True)
    padded = following(shown)
    assert (padded.paddings, padded.begins_after) == (1, 0)
    posed = Ended(replace(shown.attempt, posed=True), LIMIT, 0, VERTICES, shown=True)
    levels = following(posed)
    assert (decisions(levels), levels.paddings) == (("multilevel", False, 0), 1)
    untangled = following(posed, Ended(levels, REST, 9, VERTICES))
    assert (untangled.begins_after, untangled.paddings) == (1, 1)


@pytest.mark.parametrize(("spoilt", "is_padded"), [({}, True), ({"torn": 3}, False), ({"sunk": True}, False)])
def test_what_rests_best_but_for_a_toe_that_shows_is_padded_once_all_else_is_tried(
    spoilt: dict[str, Any], is_padded: bool
) -> None:
    """A long skirt on whose front the toes stand out, so that the leg's curve pierces it."""
    shirt = {"shape": {"kind": "tshirt", "edge_mm": 50}}
    sewn = first({"garment": shirt, "avatar": {"shape": {"kind": "mannequin"}}})
    shown = Ended(sewn, REST, 0, VERTICES, misplaced=True, shown=True, **spoilt)
    posed = Ended(replace(sewn, posed=True), REST, 4, VERTICES, misplaced=True, shown=True, torn=9)
    last = _padded_at_last([shown, posed])
    assert (last is not None and (last.paddings, last.begins_after) == (1, 0)) == is_padded
    if last is not None:  # and no more than once from there
        assert _padded_at_last([shown, posed, Ended(last, LIMIT, 9, VERTICES, shown=True)]) is None


@pytest.mark.parametrize(("forward", "posed"), [(0.0, False), (0.05, False), (0.5, True)])
def test_what_moved_clear_of_the_body_would_be_off_its_limbs_is_sewn_round_the_posed_body(
    forward: float, posed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def moved(scenes: Any, outfits: Any, *_: Any) -> list[Any]:
        (outfit,) = outfits
        (garment,) = outfit.garments
        move = garment if not forward else replace(garment, points=garment.points + np.array([0.0, 0.0, forward]))
        return [replace(outfit, garments=(move,))]

    monkeypatch.setattr("warp_cloth.fitting.problem.placed", moved)
    scene = load_scene("tshirt", SMALL_SHIRT)
    assert usual_first_attempt(scene, load_outfit(scene), "cpu", Cache()).posed is posed


@pytest.mark.parametrize(
    "wrong",
    [{"torn": 5}, {"misplaced": True}, {"cut_short": CutShort.CROSSING}],
    ids=lambda wrong: next(iter(wrong)),
)
def test_what_is_wrong_round_a_limb_is_sewn_round_the_body_posed_within_it(wrong: dict[str, Any]) -> None:
    failed = Ended(first("tshirt", *SMALL_SHIRT), LIMIT, 0, VERTICES, **wrong)
    posed = following(failed)
    assert (posed.start, posed.touches, posed.scene.solver.method) == ("posed", True, "accelerated")
    assert posed.choices[-1].key == "solver.start"
    turned = following(failed, Ended(posed, LIMIT, 0, VERTICES, cut_short=CutShort.STALLED))
    assert decisions(turned) == ("multilevel", True, 1)
    torn = following(failed, Ended(posed, LIMIT, 0, VERTICES, torn=5, cut_short=CutShort.STALLED))
    assert decisions(torn) == ("multilevel", True, 1)
    assert following(failed, Ended(posed, REST, 0, VERTICES)) is None


def test_what_is_locked_as_it_was_modelled_is_not_sewn_round_a_posed_or_thinned_body() -> None:
    """Trousers modelled through themselves took 82 s to be sewn round a posed body, and crossed as before."""
    scene = load_scene("tshirt", SMALL_SHIRT)
    outfit, sewn = load_outfit(scene), first("tshirt", *SMALL_SHIRT)
    history = [Ended(sewn, LIMIT, VERTICES, VERTICES, torn=1, cut_short=CutShort.CROSSING)]
    while (attempt := next_attempt(history, outfit, locked=True)) is not None:
        assert (attempt.posed, attempt.thins) == (False, False)
        history.append(Ended(attempt, LIMIT, VERTICES, VERTICES, torn=1, cut_short=CutShort.CROSSING))
    assert len(history) > 1
    assert next_attempt(history[:1], outfit).posed


def test_only_what_a_posed_body_may_mend_ends_where_it_is_not_worn_rightly() -> None:
    assert first("tshirt", *SMALL_SHIRT).ends_misworn
    assert not first("tshirt", *SMALL_SHIRT, "solver.start=placed").ends_misworn
    assert not first("tshirt", *SMALL_SHIRT, "solver.iterations=9000").ends_misworn
    assert not first("sphere", *DRAPED).ends_misworn


@pytest.mark.parametrize("wrong", [{"misplaced": True}, {"slipped": True}, {"sunk": True}])
def test_what_ended_as_it_was_not_worn_rightly_is_posed_and_else_goes_on_to_its_end(wrong: dict[str, Any]) -> None:
    """So that the report shows where what no other start mends comes to lie."""
    sewn = first("tshirt", *SMALL_SHIRT)
    history = [Ended(sewn, LIMIT, 0, VERTICES, cut_short=CutShort.MISWORN, **wrong)]
    assert following(*history).posed
    assert following(*history, Ended(following(*history), REST, 0, VERTICES)) is None
    while (attempt := following(*history)) is not None:
        history.append(Ended(attempt, LIMIT, 1, VERTICES, torn=3))
    (resumed,) = [each.attempt for each in history if each.attempt.begins_after == 0]
    assert (resumed.touches, resumed.ends_misworn) == (True, False)


def test_a_posed_attempt_that_none_can_follow_goes_on_longer() -> None:
    sewn, levels = skirt()
    failed = Ended(sewn, LIMIT, 0, VERTICES), Ended(levels, REST, 0, VERTICES, torn=5)
    first_posed, last_posed = following(replace(failed[0], torn=5)), following(*failed)
    assert (first_posed.posed, last_posed.posed) == (True, True)
    assert (first_posed.patience, last_posed.patience) == (Patience.SHORT, Patience.LONG)


def test_cloth_without_openings_for_limbs_is_never_posed() -> None:
    sheet = following(Ended(first("sphere", *DRAPED), REST, 0, VERTICES, torn=5))
    assert sheet is None or not sheet.posed


def test_the_best_attempt_is_free_of_crossings_then_at_rest() -> None:
    attempt = first("hanging")
    ends = [
        Ended(attempt, status, crossings, VERTICES)
        for status, crossings in ((LOST, 0), (REST, 9), (LIMIT, 2), (LIMIT, 0), (REST, 0))
    ]
    ranks = [each.rank for each in ends]
    assert ranks == sorted(ranks)


def test_what_came_off_is_told_not_the_same_on_its_way_there() -> None:
    attempt = first("hanging")
    sliding, came_off, tangled, hangs, worn = (
        Ended(attempt, LIMIT, 0, VERTICES, sunk=True),
        Ended(attempt, REST, 0, VERTICES, sunk=True, misplaced=True),
        Ended(attempt, REST, 0, VERTICES, misplaced=True),
        Ended(attempt, LIMIT, 0, VERTICES),
        Ended(attempt, REST, 0, VERTICES),
    )
    ends = [tangled, sliding, came_off, hangs, worn]
    assert sorted(ends, key=lambda each: each.rank) == ends


def test_what_still_hung_on_its_way_down_is_not_told() -> None:
    """A skirt far too wide for a child was told to be moving, as it was long before it lay at the feet."""
    attempt = first("hanging")
    hangs = Ended(attempt, LIMIT, 0, VERTICES)
    slides_down = Ended(replace(attempt, begins_after=0), LIMIT, 0, VERTICES, sunk=True, misplaced=True)
    lies = Ended(replace(attempt, begins_after=1), REST, 0, VERTICES, sunk=True, misplaced=True)
    assert best_of([hangs, slides_down, lies]) == 2
    assert best_of([hangs, replace(slides_down, sunk=False), lies]) == 2
    assert best_of([hangs, slides_down]) == 0  # nothing tells where it will lie
    elsewhere = replace(lies, attempt=replace(attempt, begins_after=None))
    assert best_of([hangs, elsewhere]) == 0  # another start
    rests = replace(hangs, status=REST)
    assert best_of([rests, slides_down, lies]) == 0
    with_feet_shown = Ended(replace(attempt, begins_after=0), REST, 0, VERTICES, sunk=True, shown=True)
    assert best_of([hangs, with_feet_shown]) == 1
