"""One garment put on a posed avatar: sewn round it, pulled or lowered onto it where need be, and carried home.

While it is posed the avatar is thin within the garment; it grows on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from warp_cloth.anatomy.linking import curve_crossings
from warp_cloth.anatomy.openings import ARMS, LEGS
from warp_cloth.anatomy.skeleton import TRUNK
from warp_cloth.avatar.contact import followed
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.base.clock import StageClock
from warp_cloth.base.mesh import Points
from warp_cloth.dressing.catching_up import PULLED, catch_up
from warp_cloth.dressing.feet import Feet
from warp_cloth.dressing.loose_cloth import STEP as MEETING_STEP
from warp_cloth.dressing.loose_cloth import loose_cloth, met
from warp_cloth.dressing.panels import parted
from warp_cloth.dressing.posing import STATIONS, PosedBody
from warp_cloth.dressing.routes import curves_of, limb_routes
from warp_cloth.dressing.straps import tugged
from warp_cloth.fitting.body_collider import BodyCollider
from warp_cloth.fitting.film import DressedShape, Dressing
from warp_cloth.fitting.problem import build_problem
from warp_cloth.garment.outfit import Outfit
from warp_cloth.model.attempt import TORN, Attempt, Patience
from warp_cloth.model.result import LevelRun, Status
from warp_cloth.scene import Scene
from warp_cloth.scene.sewing import SEWING, sewing_scene_of
from warp_cloth.solver.certificate.strains import edge_strains
from warp_cloth.solver.loop import BURST

THIN = 0.03  # [m]; what the body has at most around its curves while it is within the garment
THICK = 0.25  # [m]; what it has just before it is whole
CHECK = 100  # iterations between looks at the seams, or at what falls
UNTANGLING = 2000  # iterations at most of cloth that crosses, round a thin body
SEWN = 0.2  # strain of the edges of seams that have closed
STEPS = 24  # from there home
POSED_FOR = 0.5  # fraction of the steps after which all limbs are home; then they only grow
HANGING_STEPS = 8  # further ones, in which arms come down to the trunk and legs to each other
LEG_STEP = 0.01  # [m] that legs move in a step at most as they sit down; steps of 2 cm leave crossing cloth
LEAN = 0.06  # [m]; what the body has at most then: whole thighs pinch what is between them, thin legs pass through it
SPREADING_STEPS = 10  # in which thin legs come to where trousers are pulled on
PULL = 0.01  # [m] that these are pulled up in a burst; cloth that moves by more passes through legs
PULLS = 60  # at most
NEAR = 0.003  # [m] from where they are pulled to
BELOW_CROTCH = 0.03  # [m] that they stay under the body's crotch, where growing thighs would pinch them
TUGS = 30  # at most, with which straps are laid on the shoulders
TAUT = 0.002  # fraction of edges stretched as no worn cloth is, at which they do not give, as of tight sleeves
LOWERING_STEPS = 40  # in which a garment that starts above the shoulders comes down onto them
GROWTH = 2.0  # exponent of the thickness over the steps: slow while limbs move
GROWING_STEPS = 12  # of the steps, in which the body grows before a skirt falls and arms go home
HEAVY = 3000.0  # weight of cloth that falls, over that of sewn cloth: 10 kg/m2 stretches by less than 1 %
FALLING = 3000  # iterations at most; as many again with the top held
HELD = 0.25  # [m] from the top in the cloth, up to which that is held
SLOW = 0.01  # [m] in CHECK iterations
SHORTEST = 1.0 / 32.0  # part of a step in which limbs move, where they come upon cloth


@dataclass(frozen=True, eq=False)
class PosedStart:
    """A garment sewn round the posed avatar and carried home."""

    points: Points | None  # [m], shape [V, 3]; None: it diverged
    run: LevelRun
    shapes: Dressing = ()  # on the way, where they were to be watched


class Dresser:
    """Dresses a posed avatar with a garment: a step of a method moves the body, the garment follows and relaxes."""

    def __init__(
        self,
        scene: Scene,
        outfit: Outfit,
        device: str,
        offset: float,
        clock: StageClock,
        *,
        lifted: bool,
        watching: bool,
        worn: Points | None = None,
    ) -> None:
        """
        Args:
            outfit: with its garments in the fabric that is sewn.
            offset: of the garment from the skin [m].
            lifted: whether what is sewn is moved to where it started at once, not pulled on.
            watching: whether shapes are kept for the film.
            worn: where it lies on the body at home [m], with others of the outfit, inner to outer, if there are any;
                None: alone, as panels, round the body posed within it.
        """
        wearing, avatar = outfit.wearing[0], outfit.avatar
        if wearing is None or avatar is None:
            raise ValueError("the garment has no openings, or the avatar no limbs")
        self.wearing, self._avatar, self._device = wearing, avatar, device
        sewing = sewing_scene_of(scene, offset)
        garments = outfit.garments
        if worn is None:
            (garment,) = garments
            garments = (replace(garment, points=parted(wearing, wearing.onto)),)
        else:
            parts = np.split(worn, np.cumsum([len(each.points) for each in garments])[:-1])
            garments = tuple(replace(each, points=part) for each, part in zip(garments, parts, strict=True))
        self._body = PosedBody(avatar, wearing.skeleton, chest_stays=wearing.hangs_from_waist)
        self._posed, self._moved, self.could_slide = self._body.home, list(ARMS), False
        self._loose = loose_cloth(wearing)
        self._loose_vertices = [np.unique(triangles) for triangles in self._loose]
        self._away: list[Points] | None = None
        if worn is None:
            self._pose(garments[0].points, lifted)
        self._curves: Sequence[Points] = self._posed
        self._thickness = THIN
        has_hem = LEGS in wearing.limbs and not wearing.has_legs  # round both legs, as a waist is, too
        self._feet = Feet(avatar.points, wearing.skeleton, may_be_met=has_hem and worn is None)
        self._feet.draw_in(garments[0].points, self._posed)
        self._surface = self._feet.on(self._body.points(self._posed, THIN), self._posed)
        sewn = replace(outfit, garments=garments, avatar=replace(avatar, points=self._surface))
        attempt = Attempt(sewing, sewing, patience=Patience.NONE, posed=True)
        clock.lap("dress")
        self._problem = build_problem([attempt], [sewn], device, clock=clock)
        clock.begin("dress")
        self._collider = BodyCollider(avatar.triangles, device, offset)
        self._meet_body()
        self._iterations = 0
        self._shapes: list[DressedShape] | None = [] if watching else None  # on the way; None: nobody watches

    def _pose(self, panels: Points, lifted: bool) -> None:
        """Poses the body within these panels [m]."""
        wearing, home = self.wearing, self._body.home
        routes = limb_routes(wearing, panels)
        has_armholes = any(route is not None and route.armhole is not None for route in routes)
        # arms that are only raised in their sleeves take these and the cloth next to them along as they come down
        self._moved = [arm for arm in ARMS if not (each := routes[arm]) or not each.is_raised]
        limbs, trunk = curves_of(routes, wearing.skeleton, STATIONS), home[TRUNK]
        if wearing.has_legs:  # trousers are sewn below the trunk's end
            trunk = self._body.trunk_up_to(limbs[LEGS[0]][0])
        self._posed = [*limbs, trunk]
        # straps would slide off thin shoulders as hanging arms come down to the trunk
        self.could_slide = has_armholes and self._body.away(ARMS) is not None
        last_home = [*(ARMS if has_armholes else ()), *(LEGS if wearing.has_legs and not lifted else ())]
        self._away = self._body.away(last_home)

    @property
    def in_the_way(self) -> bool:
        """Whether cloth that is far from an arm's opening lies where the arm is at home."""
        points, home = self.points, self._body.home
        return any(curve_crossings(points, self._loose[arm], home[arm]) > 0 for arm in self._moved)

    def sew(self, momentum: float | None = None) -> None:
        """Relaxes until the seams have closed and nothing crosses.

        Not longer: cloth slides down a body without shoulders. ``momentum``: of panels drawn together; None: as usual.
        """
        if momentum is not None and self._problem.schedule is not None:
            self._problem.schedule.hold_back(momentum)
        while self._iterations < SEWING:
            self._relax(CHECK)
            if not self.is_tangled and float(edge_strains(self._problem.model).max(initial=0.0)) < SEWN:
                break

    def untangle(self) -> None:
        """Relaxes until nothing crosses, on a body too thin to hold what does."""
        for _ in range(0, UNTANGLING, CHECK):
            if not self.is_tangled:
                break
            self._relax(CHECK)

    def hang(self) -> None:
        """Lets what is sewn hang from its top, held where it starts, if the arms would be in it once it is lifted.

        The sides of a round skirt stand up beside its top, and would be lifted over the shoulders.
        """
        lifted = self.points + self.wearing.rise(self.points) * self.wearing.skeleton.up
        if any(curve_crossings(lifted, self.wearing.triangles, self._posed[arm]) for arm in ARMS):
            self._set_weight(HEAVY)
            self._has_fallen(self._hold_top)
            self._set_weight(1.0)

    def lift(self) -> None:
        """Moves the garment to where its highest opening started.

        Seams that close draw a wide skirt together, and what falls is too heavy for a waist to hold.
        """
        self._move_up(self.wearing.rise(self.points))

    def _move_up(self, rise: float) -> None:
        self._put(self.points + rise * self.wearing.skeleton.up)

    def _put(self, points: Points) -> None:
        self._problem.model.set_points(points)
        self._meet_body()

    def pull_on(self) -> None:
        """Pulls trousers up between legs that are apart, where the body then grows."""
        for step in range(1, SPREADING_STEPS + 1):
            self._take(1.0 - step / SPREADING_STEPS, THIN)
        for _ in range(PULLS):
            rise = self.wearing.rise(self.points, BELOW_CROTCH)
            if abs(rise) < NEAR:
                break
            self._move_up(float(np.clip(rise, -PULL, PULL)))
            self._relax(BURST)
        self.grow(STEPS, posed=0.0)

    def lower(self) -> None:
        """Lowers a garment over raised thin arms onto the shoulders; there the body grows, then the arms come down."""
        low = self._body.at_shoulders(self._posed, self._last_pose)
        for step in range(1, LOWERING_STEPS + 1):
            left = LOWERING_STEPS - step
            above = self.wearing.over_shoulders(self.points) * left / (left + 1)
            self._follow(self._body.between(low, self._posed, left / LOWERING_STEPS), THIN)
            down = self.wearing.over_shoulders(self.points) - above
            self._move_up(-float(np.clip(down, 0.0, PULL)))
            self._relax(BURST)
        for step in range(1, GROWING_STEPS + 1):
            self._follow(low, _thickness(step / GROWING_STEPS))
        if self.in_the_way:
            self.fall()
        for left in reversed(range(steps := STEPS - GROWING_STEPS)):
            self._follow(self._body.between(self._last_pose, low, left / steps), THICK)

    def fall(self) -> None:
        """Lets the garment hang, under a weight that makes it fall fast, until it is out of the arms' way and slow.

        What hangs from a waist too wide to hold it falls as a whole, so that its hem comes no lower under its top: then
        the top is held.
        """
        self._set_weight(HEAVY)
        hangs = self.wearing.hangs_from_waist
        if not self._has_fallen(self.lift if hangs else None) and hangs:
            self._has_fallen(self._hold_top)
        self._set_weight(1.0)

    def _has_fallen(self, after: Callable[[], None] | None) -> bool:
        """Whether it hangs out of the arms' way, and slow, within FALLING iterations; ``after`` each CHECK of them."""
        before = self.points
        for _ in range(0, FALLING, CHECK):
            self._relax(CHECK)
            if after is not None:
                after()
            points = self.points
            self._feet.draw_in(points, self._curves)
            slow = float(((before - points) @ self.wearing.skeleton.up).max()) < SLOW
            if slow and not self.in_the_way:
                return True
            before = points
        return False

    def _hold_top(self) -> None:
        """Moves the opening that starts highest to where it started, and the cloth next to it along."""
        near = np.clip(1.0 - self.wearing.top.distances / HELD, 0.0, 1.0)
        rise = near * self.wearing.drop(self.points)
        self._put(self.points + rise[:, None] * self.wearing.skeleton.up)

    def grow(self, steps: int, *, posed: float) -> None:
        """Lets the body grow where ``posed`` has it, in steps of a burst each."""
        for step in range(1, steps + 1):
            self._take(posed, _thickness(step / steps))

    def press_out(self, thin: Points) -> None:
        """Grows at home again from cloth that lay untangled on the thin body [m], and presses it out without moving it.

        Cloth between a thigh and a belly would go along with each of them through what lies between. What is pressed
        onto one surface from several layers crosses for a moment, so it is untangled all along.
        """
        home = self._body.home
        self._problem.model.set_points(thin)
        for thickness in (*(_thickness(step / STEPS) for step in range(1, STEPS + 1)), np.inf):
            if self._problem.schedule is not None:
                self._problem.schedule.untangle()
            self._step(home, thickness, takes_cloth=False)

    def carry_home(self, steps: int, *, is_grown: bool = False) -> None:
        """Takes the body home, growing if it has not grown yet, in bursts, but for the limbs that come home last."""
        for step in range(1, steps):
            done = step / steps
            growing = max(1.0 - done / POSED_FOR, 0.0), _thickness(done)
            self._take(*((1.0 - done, THICK) if is_grown else growing))

    def lay_straps(self) -> None:
        """Tugs the straps of a garment inwards along the shoulders, while arms are still raised, unless that tears."""
        points = whole = self.points
        torn = before = self._stretched(TORN)
        for _ in range(TUGS):
            moved = tugged(self.wearing.shoulders, points, self.wearing.triangles)
            if moved is None or torn > TAUT * self._problem.model.edge_count:
                break
            self._put(moved)
            self._relax(BURST)
            points, torn = self.points, self._stretched(TORN)
            if torn <= before:
                whole = points
        if torn > before:
            self._put(whole)

    def come_home(self) -> None:
        """Takes the limbs home that come last, and lets the body be whole."""
        home, away = self._body.home, self._away
        if away is not None and self._body.stands_up(away):
            self._sit_down(away)
        elif away is not None:
            for step in range(HANGING_STEPS):
                self._follow(self._body.between(home, away, 1.0 - step / HANGING_STEPS), THICK)
        self._follow(self._body.home, np.inf)
        for _ in self._feet.grow(self.points, home):
            self._step(home, np.inf)

    def _sit_down(self, standing: Sequence[Points]) -> None:
        """Lets standing legs sit down lean, since thighs and shins would pinch what is between them, and grow there."""
        home = self._body.home
        farthest = max(float(np.linalg.norm(home[leg] - standing[leg], axis=1).max()) for leg in LEGS)
        steps = int(np.ceil(farthest / LEG_STEP))
        for step in range(steps + 1):
            self._follow(self._body.between(home, standing, 1.0 - step / steps), LEAN)
        self.untangle()
        for step in range(1, STEPS + 1):
            self._follow(home, LEAN + (THICK - LEAN) * (step / STEPS) ** GROWTH)

    def _take(self, posed: float, thickness: float) -> None:
        """Moves the body between home, 0, with some limbs away from it, and its pose, 1; ``thickness`` [m]."""
        self._follow(self._body.between(self._last_pose, self._posed, posed), thickness)

    @property
    def _last_pose(self) -> list[Points]:
        """The body at home, but for the limbs that come home last."""
        return self._body.home if self._away is None else self._away

    def _follow(self, curves: Sequence[Points], thickness: float) -> None:
        """Moves the body there, slowly where a limb comes upon cloth, which it would pass through; [m]."""
        first, done, growth = self._curves, 0.0, min(thickness, THICK) - self._thickness
        while done < 1.0:
            step = 1.0 - done
            while step > SHORTEST and self._met(self._body.between(curves, first, 1.0 - done - step)) > MEETING_STEP:
                step *= 0.5
            done += step
            if done < 1.0:
                self._step(self._body.between(curves, first, 1.0 - done), self._thickness + growth * done)
        self._step(curves, thickness)

    def _met(self, curves: Sequence[Points]) -> float:
        return met(self._loose_vertices, self.points, self._curves, curves)

    def _step(self, curves: Sequence[Points], thickness: float, *, takes_cloth: bool = True) -> None:
        """Moves the body there, and the cloth with it, but for what the trunk slides along itself; [m]."""
        points = self.points
        self._feet.draw_in(points, self._curves)
        surface = self._feet.on(self._body.points(curves, thickness), curves)
        if takes_cloth:
            exact = build_exact_collider(replace(self._avatar, points=self._surface), self._device, signed=False)
            slid = self._body.slid(curves) - self._body.slid(self._curves)
            self._problem.model.set_points(followed(exact, surface - slid, points))
        self._surface, self._curves, self._thickness = surface, curves, min(thickness, THICK)
        self._meet_body()
        self._relax(BURST)
        catch_up(partial(self._stretched, PULLED), partial(self._relax, BURST))

    def _stretched(self, strain: float) -> int:
        """How many edges are stretched by more than that."""
        return int((edge_strains(self._problem.model) > strain).sum())

    def ended(self) -> PosedStart:
        points = self.points
        is_finite = bool(np.isfinite(points).all())
        run = LevelRun(len(points), self._iterations, Status.ITERATION_LIMIT if is_finite else Status.DIVERGED)
        return PosedStart(points if is_finite else None, run, tuple(self._shapes or ()))

    @property
    def crosses(self) -> bool:
        """Whether cloth passes through cloth now."""
        return bool(self._problem.crossing_items([0]))

    @property
    def points(self) -> Points:
        """Where the garment lies now [m], shape [V, 3]."""
        return self._problem.model.points()

    @property
    def is_tangled(self) -> bool:
        """Whether cloth still crosses cloth."""
        return self._problem.schedule is not None and self._problem.schedule.calm

    def _meet_body(self) -> None:
        self._problem.relaxation.set_collider(0, self._collider.of(self._surface, self.points))

    def _set_weight(self, factor: float) -> None:
        relaxation = self._problem.relaxation
        relaxation.step.gravity = type(relaxation.step.gravity)(0.0, -factor, 0.0)
        relaxation.drop_graphs()

    def _relax(self, count: int) -> None:
        problem = self._problem
        problem.relaxation.run(count)
        problem.relaxation.update_model()
        self._iterations += count
        if problem.schedule is not None:
            problem.schedule.advance(self._iterations)
        if self._shapes is not None:
            shape = DressedShape(self._surface.astype(np.float32), self.points.astype(np.float32))
            self._shapes.append(shape)


def _thickness(done: float) -> float:
    """What a growing body has at most around its curves after this fraction of its steps [m]."""
    return THIN + (THICK - THIN) * done**GROWTH
