"""The multilevel method: a garment's overstretched seams are closed vertex by vertex, all else by implicit steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.collider import Collider
from warp_cloth.garment.part import GarmentPart
from warp_cloth.kernels.certificate.residual import energy_kernels
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.certificate.strains import edge_strains
from warp_cloth.solver.implicit.coarse_garments import Ladder, build_ladder
from warp_cloth.solver.implicit.coarse_levels import build_hierarchy
from warp_cloth.solver.implicit.step import ImplicitOptions, ImplicitStep, Pace
from warp_cloth.solver.implicit.vertex_pairs import build_pairs
from warp_cloth.solver.relax import DEFAULT_CAP, TIGHTER, Relaxation, StepOptions

if TYPE_CHECKING:
    from warp_cloth.contact.cloth import ClothTouch

# Forces grow with the square of the strain: what starts 48 times too long tears at its neighbours far beyond where
# they may be linearised. Per-vertex steps with their bound of the stiffness close a seam in some hundred iterations.
DRAWN = 0.05  # rms strain of the edges from which on steps are implicit
LEAST_GAIN = 0.05  # or where so many iterations bring it down by no more than this share: tight cloth stays stretched
LOOK = 100  # iterations
MOST_LOOKS = 10
# Of a finer garment's first LOOK iterations on an avatar, vertex by vertex, too: a shape carried over is overstretched
# by some percent along its folds, and solved for all vertices at once, that throws them about by centimetres. So it is
# gone after a quarter of a millimetre (66,000 vertices, 200 kN/m).
SETTLING_MOMENTUM = 0.9
# Iterations after which the level that turns is renewed: what the avatar holds of the cloth changes from step to step.
TURNED = 40
# Relative residuals below which the forces of cloth on an avatar have balanced, below which it hardly moves any more,
# and below which it comes to rest; above TIGHTER times these it is not so any longer.
BOUNDS = {Pace.CALM: 0.02, Pace.STILL: 0.002, Pace.RESTING: 0.0005}


class MultilevelRelaxation(Relaxation):
    """Runs a model's iterations: per-vertex ones first where edges are overstretched, then implicit steps.

    An iteration is one pass over all vertices: of an implicit step's solution, a round.
    """

    def __init__(
        self,
        model: ClothModel,
        collider: Collider,
        options: StepOptions,
        ladders: Sequence[Ladder],
        implicit: ImplicitOptions | None = None,
    ) -> None:
        self.options, self.implicit_options = options, implicit or ImplicitOptions()
        self.ladders = tuple(ladders)
        self.collider = collider  # that the garments start with
        self._implicit: ImplicitStep | None = None
        super().__init__(model, collider, replace(vertex_by_vertex(options), threads=1))
        table = build_pairs(model)
        levels = build_hierarchy(model, ladders, table.ends)
        self._implicit = ImplicitStep(model, self.contact, self.collider_type, table, levels, self.implicit_options)
        self._drawing, self.pace = True, Pace.FALLING
        self._looks, self._strain, self._since = 0, math.inf, 0
        self._settles = False
        self._turned = 0  # iterations since the level that turns was last renewed

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that iterations launch."""
        own = self._implicit.kernels() if self._implicit is not None else []
        return [*super().kernels(), *own, energy_kernels(self.model.precision).measure_tension]

    def _iterate(self, count: int) -> None:
        """Launches iterations, of implicit steps whole ones."""
        if self._drawing or self._implicit is None:
            super()._iterate(count)
            return
        for number in range(self._steps(count)):
            renew = number % self.implicit_options.renewal == 0
            self._implicit.launch(self.step, self.collider_data, renew)

    def _steps(self, iterations: int) -> int:
        """How many implicit steps that is."""
        return max(1, iterations // self._implicit.rounds) if self._implicit is not None else 0

    @property
    def stays_packed(self) -> bool:
        """Whether the cloth stays as patches own it; implicit steps move it where the model has it."""
        return super().stays_packed and (self._implicit is None or self._drawing)

    def run(self, iterations: int, *, shown: bool = True) -> None:
        """Runs a chunk of iterations as captured graphs; looks from time to time whether seams are closed yet.

        Implicit steps run as graphs from one renewal of the coarser levels to the next, each pace's captured once.
        The model always knows where the cloth is then.
        """
        if self._drawing:
            self._look()
        elif self._implicit is not None and self._turned >= TURNED and self._implicit.renew_turns():
            self._turned = 0
        self._since, self._turned = self._since + iterations, self._turned + iterations
        if self._drawing or self._implicit is None:
            super().run(iterations)
            return
        most, steps = self.implicit_options.renewal, self._steps(iterations)
        for number in range(0, steps, most):
            wp.capture_launch(self._captured_steps(min(most, steps - number)))
        self._done += iterations

    def _captured_steps(self, count: int) -> Any:
        """The graph of so many implicit steps at this pace, the first of which renews the coarser levels."""
        which = self.pace, count
        if self._implicit is not None and which not in self._step_graphs:
            with wp.ScopedCapture(device=self.model.device) as capture:
                self._iterate(count * self._implicit.rounds)
            self._step_graphs[which] = capture.graph
        return self._step_graphs[which]

    def forget_graphs(self) -> None:
        super().forget_graphs()
        self._step_graphs: dict[tuple[Pace, int], Any] = {}

    def start_near_rest(self) -> None:
        """The cloth is where it hardly falls any more: steps are long from the first, on an avatar once it settled."""
        if self._implicit is not None:
            self._implicit.lengthen()
        if self.contact is not None:
            self._settles, self.step.momentum = True, SETTLING_MOMENTUM

    def loosen(self, relative_rms: NDArray[np.float64]) -> None:
        """Goes on at another pace once the forces of cloth that meets an avatar have balanced; see Relaxation."""
        steps = self._step_graphs
        super().loosen(relative_rms)
        self._step_graphs = steps  # leeway is nothing to implicit steps
        if self.contact is None:
            return
        pace = Pace.FALLING
        for better, bound in BOUNDS.items():
            if (relative_rms <= (TIGHTER * bound if self.pace >= better else bound)).all():
                pace = better
        if self._implicit is not None and pace != self.pace:
            self.pace = pace
            self._set_pace(self._implicit)

    def _set_pace(self, implicit: ImplicitStep) -> None:
        momentum = implicit.go_at(self.pace)
        if not self._drawing:
            self.step.momentum = momentum

    def _look(self) -> None:
        if self._implicit is None or ((self._looks or self._settles) and self._since < LOOK):
            return
        strain = float(np.sqrt(np.mean(np.maximum(edge_strains(self.model), 0.0) ** 2)))
        stays = strain > (1.0 - LEAST_GAIN) * self._strain
        if strain <= DRAWN or stays or self._looks == MOST_LOOKS:
            self._drawing = False
            self._set_pace(self._implicit)
            self._items["cap"] = self.options.largest_move
            self.tell_items()
            self.forget_graphs()
        self._looks, self._strain, self._since = self._looks + 1, strain, 0


def relaxation_by(
    options: StepOptions,
    model: ClothModel,
    colliders: Sequence[Collider],
    parts: Sequence[GarmentPart],
    touch: ClothTouch | None = None,
    caps: Sequence[float | None] | None = None,
) -> Relaxation:
    """What iterates by the options' method; vertex by vertex where cloth meets cloth.

    Args:
        options: the method and its step.
        model: the garments' model; of the multilevel method, of one item, or of several without an avatar.
        colliders: the items' contact with their avatars.
        parts: the model's garments.
        touch: contact of cloth with cloth; None: it passes through itself.
        caps: largest displacements of the items [m]; None: the options'.
    """
    if options.method != "multilevel":
        return Relaxation(model, colliders, options, touch, caps)
    if caps is not None:
        options = replace(options, cap=caps[0])
    if touch is not None:
        return Relaxation(model, colliders, vertex_by_vertex(options), touch)
    ladders = {id(part): build_ladder(part) for part in {id(part): part for part in parts}.values()}
    return MultilevelRelaxation(model, colliders[0], options, [ladders[id(part)] for part in parts])


def vertex_by_vertex(options: StepOptions) -> StepOptions:
    """The accelerated method's, with a cap no larger than its own."""
    return replace(options, method="accelerated", cap=min(options.largest_move, DEFAULT_CAP["accelerated"]))
