"""Cloth that came to rest caught on a limb, as a cuff on a hand, slides off it before anything else is tried."""

from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.attempt import Ended, best_of
from warp_cloth.model.first_attempt import first_attempt
from warp_cloth.model.next_attempt import FEW_CAUGHT, next_attempt
from warp_cloth.model.result import Status
from warp_cloth.scene import load_scene

VERTICES = 10_000
FEW = int(FEW_CAUGHT * VERTICES)


def test_what_is_caught_on_a_limb_slides_off_first() -> None:
    scene = load_scene("tshirt", ["garment.shape.edge_mm=60", "collision.pixel_mm=8"])
    outfit = load_outfit(scene)
    attempt = first_attempt(scene, outfit)

    def ended(torn: int, *, caught: bool = True, status: Status = Status.AT_REST) -> Ended:
        return Ended(attempt, status, 0, VERTICES, torn=torn, misplaced=True, caught=caught)

    slides = next_attempt([ended(FEW)], outfit)
    assert slides is not None
    assert (slides.slides, slides.begins_after, slides.scene.avatar.friction) == (1, 0, 0.0)
    for other in (ended(FEW + 1), ended(FEW, caught=False), ended(FEW, status=Status.ITERATION_LIMIT)):
        following = next_attempt([other], outfit)
        assert following is None or not following.slides
    loose = Ended(slides, Status.ITERATION_LIMIT, 0, VERTICES)
    rubs = next_attempt([ended(FEW), loose], outfit)
    assert rubs is not None
    assert (rubs.begins_after, rubs.scene) == (1, attempt.scene)
    fails = Ended(rubs, Status.AT_REST, 0, VERTICES, torn=FEW, misplaced=True, caught=True)
    following = next_attempt([ended(FEW), loose, fails], outfit)
    assert following is None or following.slides != 1
    # with fewer torn edges, but a limb outside its opening
    assert best_of([ended(FEW), Ended(attempt, Status.AT_REST, 0, VERTICES, torn=1, misplaced=True)]) == 0
