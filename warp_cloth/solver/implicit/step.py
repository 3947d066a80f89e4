"""The implicit step: every displacement solves the forces, linearised where the cloth is, over all vertices at once.

A per-vertex step passes a force on from neighbour to neighbour, so that its number grows with the vertices across the
cloth. Here the coarser levels carry it across at once, and the number hardly grows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_kernels, stiffness_types
from warp_cloth.kernels.implicit.coarse_levels import COARSEST, level_kernels, level_types
from warp_cloth.kernels.implicit.conjugate_gradient import conjugate_kernels, conjugate_types
from warp_cloth.kernels.implicit.step import implicit_kernels
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.implicit.coarse_levels import Level, coarsest
from warp_cloth.solver.implicit.rigid_level import Turning, turning_level
from warp_cloth.solver.implicit.vertex_pairs import PairTable
from warp_cloth.solver.reduction import launch_blocks, launch_rows, split

PART = 64  # vertices that a block works on, of a garment that is not large
FEW = 512  # vertices of a level, that a single block works on along with all below: each launch takes as long


class Pace(IntEnum):
    """How cloth that meets an avatar moves: it falls, its forces have balanced, it hardly moves, it comes to rest."""

    FALLING = 0
    CALM = 1
    STILL = 2
    RESTING = 3


@dataclass(frozen=True)
class ImplicitOptions:
    """How an implicit step moves the cloth. Every default with its unit and reason.

    fall: how far its own weight moves a vertex in the first step [m]: inertia is what resists where the cloth does
        not, and while it falls or unfolds too long a step overstretches it.
    most_fall: the same in the end [m]; beyond, hanging cloth no longer settles.
    most_fall_met: the same where an avatar is met, until forces have balanced.
    most_fall_calm: the same once they have: folds are soft.
    easing: growth of the fall from step to step. With 1.05 stiff cloth on a ball was still moving when it was eased.
    reach: the stiffness allows for an edge changing its length by this many times its last change.
    momentum: share of the last displacement that the solution starts from; with more, strips swing on and on.
    momentum_met: the same where an avatar is met: folds slide over it slowly, and what slides does not swing.
    momentum_calm: the same once its forces have balanced, and steps have half the rounds.
    least_momentum, most_momentum: what is kept once it hardly moves: more and more from step to step, less where a step
        does not repay it (Nesterov's way): slow folds slide far, and what swings comes to rest.
    left_still, left_resting: share of its steps that momentum has left there, as long as folds snap and at rest.
    share_still: once it hardly moves, forces are seen where momentum leads, not where it begins (Nesterov's way): what
        the solution resists, though the cloth as a whole hardly does (the sliding of a fold), keeps all its momentum,
        and what is stiff none. Of the solution this share is gone: what is up to twice as stiff as it looks settles
        so (threads that were slack), with all of it up to 4 / 3 times. Earlier it would tremble.
    swing_met: share of that displacement that comes on top of the solution, where an avatar is met, till then: the
        solution resists what the cloth hardly does (buckling), and would stop the folds again that have begun to form.
    rounds: of conjugate gradients in a step; 20 gain nothing.
    rounds_calm: the same where an avatar is met, once forces have balanced. What is left are folds that snap over,
        and hardly resist: of such a displacement a round finds the more the earlier it is in its step, and momentum
        does the rest. While stiff cloth of many vertices still falls, so few let it tremble.
    turning: the round of a step, once forces have balanced, before which what is left is solved for on a coarse level
        whose vertices turn. Of what a whole solution would do to free folds five rounds take a twentieth, with it from
        a fifth to two fifths. At the step's beginning what is left is too rough for it.
    renewal: the coarser levels' stiffness is summed anew every so many steps.
    """

    fall: float = 1e-3
    most_fall: float = 15e-3
    most_fall_met: float = 20e-3
    most_fall_calm: float = 0.1
    easing: float = 1.02
    reach: float = 1.0
    momentum: float = 0.9
    momentum_met: float = 0.95
    momentum_calm: float = 0.975
    least_momentum: float = 0.9
    most_momentum: float = 0.995
    left_still: float = 0.85
    left_resting: float = 0.75
    share_still: float = 0.7
    swing_met: float = 0.5
    rounds: int = 10
    rounds_calm: int = 5
    turning: int = 1
    renewal: int = 2


class ImplicitStep:
    """Owns the scratch memory of a model's implicit steps and launches them."""

    def __init__(
        self,
        model: ClothModel,
        contact: wp.Function | None,
        collider_type: Any,
        table: PairTable,
        levels: Sequence[Level],
        options: ImplicitOptions,
    ) -> None:
        precision = model.precision
        types, own = cloth_types(precision), stiffness_types(precision)
        self._model, self._levels, self._options = model, levels, options
        self._met = contact is not None
        self._swing = options.swing_met if self._met else 0.0
        self._pairs = table.pairs
        self._pair_count = len(table.ends)
        self._load = self._zeros(model.vertex_count, types.vec4)
        self._forces = ForcePass(model, "none", self._load)
        self._gradient = self._zeros((4, model.hinge_count), types.vec3)
        self._side = self._zeros((3, model.weave_count), own.vec6)
        sizes = [model.vertex_count, *(level.count for level in levels)]
        self._pair = [self._zeros(n, own.vec6) for n in (self._pair_count, *(level.pair_count for level in levels))]
        self._anchor = [self._zeros(size, own.vec6) for size in sizes]
        self._block = [self._zeros(size, own.vec6) for size in sizes[1:]]
        self._large = sum(level.count > FEW for level in levels)
        self._few = coarsest(levels[self._large :], model) if self._large < len(levels) else None
        self._divisor, self._few_divisor = self._of_levels(own.vec6)
        self._left, self._few_left = self._of_levels(types.vec3)
        self._answer, self._few_answer = self._of_levels(types.vec3)
        starts = np.array(model.vertex_start)
        self._groups = len(starts) - 1
        self._parts = split(starts, PART, model.device)
        self._along, self._before, self._across = (self._zeros(len(self._parts.garment), wp.float64) for _ in range(3))
        self._system = self._make_system(table)
        depth = turning_level(levels, model.vertex_count) if self._met else None
        self._turning = None if depth is None else Turning(model, table.ends, levels[:depth])
        self.go_at(Pace.FALLING)
        self._no_rows = level_types(precision).Rows()
        self._stiffness, self._level = stiffness_kernels(precision, model.terms.angles), level_kernels(precision)
        self._conjugate = conjugate_kernels(precision)
        self._ends = implicit_kernels(precision, contact, collider_type, model.terms.pins)

    def _of_levels(self, dtype: Any) -> tuple[list[wp.array], wp.array]:
        """What coarser vertices have, level by level; and of those of few vertices all in one array."""
        start = np.cumsum([0, *(level.count for level in self._levels)]).tolist()
        whole = self._zeros(start[-1], dtype)
        levels = [whole[first:last] for first, last in pairwise(start)]
        return levels, whole[start[self._large] :] if self._few is not None else None

    def _zeros(self, shape: Any, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self._model.device)

    def _make_system(self, table: PairTable) -> Any:
        model = self._model
        types, own = cloth_types(model.precision), stiffness_types(model.precision)
        count = model.vertex_count
        system = conjugate_types(model.precision).System()
        groups = np.repeat(np.arange(self._groups, dtype=np.int32), np.diff(model.vertex_start))
        system.garment = wp.array(groups, dtype=wp.int32, device=model.device)
        system.start, system.other = table.start, table.other
        system.fall = self._zeros(self._groups, types.real)
        system.fall.fill_(self._options.fall)
        system.momentum = self._zeros(self._groups, types.real)
        system.momentum.fill_(self._options.momentum_calm)
        system.coupling = self._zeros(2 * self._pair_count, own.mat3)
        for name in ("inertia", "drag", "gap"):
            setattr(system, name, self._zeros(count, types.real))
        system.divisor = self._zeros(count, own.vec6)
        system.hold, system.pressed = self._zeros(count, wp.int32), self._zeros(count, wp.uint8)
        for name in ("normal", "onward", "force", "displacement", "residual", "correction", "direction", "product"):
            setattr(system, name, self._zeros(count, types.vec3))
        return system

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a step launches."""

        def used(group: SimpleNamespace) -> list[wp.Kernel]:
            return list(vars(group).values())

        stiffness = [self._stiffness.couple_pairs]
        stiffness += [self._stiffness.linearise_hinges] if self._model.hinges is not None else []
        stiffness += [self._stiffness.linearise_weave] if self._model.weave is not None else []
        levels = used(self._level) if self._levels else []
        return [
            *self._forces.kernels(),
            *stiffness,
            *levels,
            *used(self._conjugate),
            *used(self._ends),
            *(self._turning.kernels() if self._turning is not None else ()),
        ]

    def launch(self, step: Any, collider_data: Any, renew: bool) -> None:
        """One step. ``step`` is a kernels.base.types Step; ``renew`` sums the coarser levels' stiffness anew."""
        model, system, own = self._model, self._system, self._options
        self._forces.launch(step)
        self._linearise(renew)
        inputs = [model.vertices, model.state, step, collider_data, self._load, system, self._anchor[0]]
        self._launch(self._ends.face_forces, model.vertex_count, inputs)
        for number, level in enumerate(self._levels):
            anchors, block = self._anchor[number : number + 2], self._block[number]
            together = self._met and number > 0
            inputs = [level.down, together, anchors[0], block, anchors[1], self._divisor[number]]
            self._launch_rows(self._level.gather_anchors, level.count, inputs)
        self._solve()
        if system.share:
            sums = [system, self._parts, self._across, self._along]
            self._launch_parts(self._ends.weigh_momentum, sums)
            inputs = [own.least_momentum, own.most_momentum, self._momentum_left, *sums]
            launch_blocks(self._ends.ease_momentum, self._groups, inputs, model.device)
        self._launch(
            self._ends.take_step, model.vertex_count, [model.vertices, model.state, step, collider_data, system]
        )
        self._launch(self._ends.ease_inertia, self._groups, [own.easing, self._most_fall, self._system])

    def go_at(self, pace: Pace) -> float:
        """Takes steps of this pace where an avatar is met; returns the momentum that goes with them."""
        own, calm = self._options, pace >= Pace.CALM
        self.rounds = own.rounds_calm if self._met and calm else own.rounds
        self._turns = self._turning if calm else None
        if not self._met:
            self._most_fall = own.most_fall
            return own.momentum
        self._most_fall = own.most_fall_calm if calm else own.most_fall_met
        self._system.share = own.share_still if pace >= Pace.STILL else 0.0
        self._system.made_heavy = pace == Pace.STILL
        self._momentum_left = own.left_still if pace == Pace.STILL else own.left_resting
        return own.momentum_calm if calm else own.momentum_met

    def renew_turns(self) -> bool:
        """Sums the stiffness of the level that turns anew, as the last step found it; whether that level is in use."""
        if self._turns is None:
            return False
        self._turns.renew(self._pair[0], self._anchor[0])
        return True

    def lengthen(self) -> None:
        """Steps are as long from now on as they get in the end."""
        self._system.fall.fill_(self._most_fall)

    def _linearise(self, renew: bool) -> None:
        model, kernels, reach = self._model, self._stiffness, self._options.reach
        if model.hinges is not None:
            self._launch(kernels.linearise_hinges, model.hinge_count, [model.state, model.hinges, self._gradient])
        if model.weave is not None:
            self._launch(kernels.linearise_weave, model.weave_count, [model.state, model.weave, reach, self._side])
        elements = [model.state, model.edges, self._pairs, reach, self._gradient, self._side]
        self._launch(kernels.couple_pairs, self._pair_count, [*elements, self._system.coupling, self._pair[0]])
        for number, level in enumerate(self._levels if renew else ()):
            finer, pair = self._pair[number : number + 2]
            self._launch_rows(self._level.gather_blocks, level.pair_count, [level.pairs, finer, pair])
            self._launch_rows(self._level.gather_blocks, level.count, [level.blocks, pair, self._block[number]])

    def _solve(self) -> None:
        system, kernels, count = self._system, self._conjugate, self._model.vertex_count
        if not system.share:  # else it begins with nothing
            self._launch(kernels.begin_solution, count, [1.0 - self._swing, system])
        before = None  # directions begin anew
        along, other = self._along, self._before
        for number in range(self.rounds):
            self._precondition(along)
            if self._turns is not None and number == self._options.turning:
                self._turns.correct(system, self._parts, along)
                before = None  # what is corrected in another way leads another way
            self._launch_parts(kernels.turn_direction, [system, self._parts, along, before])
            self._launch_parts(kernels.multiply_direction, [system, self._parts, self._across])
            self._launch_parts(kernels.advance_solution, [system, self._parts, along, self._across])
            before, along, other = along, other, along

    def _precondition(self, along: wp.array) -> None:
        large, kernels = self._large, self._level
        finer = self._system.residual
        for level, left in zip(self._levels[: large + 1], self._left, strict=False):
            self._launch_rows(kernels.restrict_residual, level.count, [level.down, finer, left])
            finer = left
        up, coarser = self._no_rows, None
        few = self._few
        if few is not None:
            inputs = [few.start, few.down, few.up, self._few_divisor, self._few_left, self._few_answer]
            launch_blocks(kernels.correct_coarsest, 1, inputs, self._model.device, COARSEST)
            up, coarser = self._levels[large].up, self._answer[large]
        for number in range(large - 1, -1, -1):
            level, answer = self._levels[number], self._answer[number]
            inputs = [up, self._divisor[number], self._left[number], coarser, answer]
            self._launch(kernels.correct_level, level.count, inputs)
            up, coarser = level.up, answer
        self._launch_parts(self._conjugate.precondition_residual, [self._system, self._parts, up, coarser, along])

    def _launch_parts(self, kernel: wp.Kernel, inputs: list[Any]) -> None:
        launch_blocks(kernel, len(self._parts.garment), inputs, self._model.device)

    def _launch_rows(self, kernel: wp.Kernel, rows: int, inputs: list[Any]) -> None:
        launch_rows(kernel, rows, inputs, self._model.device)

    def _launch(self, kernel: wp.Kernel, size: Any, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device)
