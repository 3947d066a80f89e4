"""The multilevel method: per-vertex steps close overstretched seams, implicit steps do all else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.collector import no_collection
from warp_cloth.garment.garment import Garment
from warp_cloth.kernels.certificate.energy import measure_tension_kernel
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.certificate.strains import edge_strains
from warp_cloth.solver.implicit.coarse_garments import Hierarchy, build_hierarchy
from warp_cloth.solver.implicit.coarse_levels import build_levels
from warp_cloth.solver.implicit.options import ImplicitOptions, Pace
from warp_cloth.solver.implicit.step import ImplicitStep
from warp_cloth.solver.implicit.vertex_pairs import build_pairs
from warp_cloth.solver.relax import TIGHTER, Relaxation
from warp_cloth.solver.step_options import DEFAULT_CAP, StepOptions, build_step

if TYPE_CHECKING:
    from warp_cloth.contact.cloth import ClothContact

# Forces grow with the square of the strain: what starts 48 times too long tears at its neighbours far beyond where
# they may be linearised. Per-vertex steps with their bound of the stiffness close a seam in some hundred iterations.
CLOSED = 0.05  # rms strain of the stretched edges up to which steps are implicit
LEAST_GAIN = 0.05  # or where CHECK_EVERY iterations reduce it by a smaller fraction: tight cloth stays stretched
CHECK_EVERY = 100  # iterations
MOST_CHECKS = 10
# A finer garment's first CHECK_EVERY iterations on an avatar are per-vertex, too: a shape prolonged from a coarse one
# is overstretched by some percent along its folds, and an implicit step would throw it about by centimetres. So it
# settles within a quarter of a millimetre (66,000 vertices, 200 kN/m).
SETTLING_MOMENTUM = 0.9
# Iterations after which the level with rigid modes is assembled again: contact changes its stiffness from step to step.
RIGID_RENEWAL = 40
# Relative residuals below which the forces of cloth on an avatar have balanced, below which it hardly moves any more,
# and below which it comes to rest. Above TIGHTER times its bound a pace ends.
PACE_BOUNDS = {Pace.BALANCED: 0.02, Pace.STILL: 0.002, Pace.RESTING: 0.0005}


class MultilevelRelaxation(Relaxation):
    """Runs a model's iterations: per-vertex ones first where edges are overstretched, then implicit steps.

    An iteration is one pass over all vertices: in an implicit step, an iteration of conjugate gradients.
    """

    def __init__(
        self,
        model: ClothModel,
        collider: Collider,
        options: StepOptions,
        hierarchies: Sequence[Hierarchy],
        implicit: ImplicitOptions | None = None,
        cloth_contact: ClothContact | None = None,
    ) -> None:
        self.options, self.implicit_options = options, implicit or ImplicitOptions()
        self.hierarchies = tuple(hierarchies)
        self.collider = collider  # that the garments start with
        self._implicit: ImplicitStep | None = None
        super().__init__(model, collider, replace(per_vertex_options(options), threads=1), cloth_contact)
        table = build_pairs(model)
        levels = build_levels(model, hierarchies, table.ends)
        self._implicit = ImplicitStep(
            model, self.avatar_contact, self.collider_type, table, levels, self.implicit_options, cloth_contact
        )
        self._momentum, self._full_momentum = 0.0, self.step.momentum  # of implicit steps; of others, never lowered
        self._per_vertex, self.pace = True, Pace.FALLING
        self._checks, self._strain, self._since_check = 0, math.inf, 0
        self._settles = False
        self._since_renewal = 0  # iterations since the level with rigid modes was assembled

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that iterations launch."""
        own = self._implicit.kernels() if self._implicit is not None else []
        return [*super().kernels(), *own, measure_tension_kernel(self.model.precision)]

    def _iterate(self, count: int) -> None:
        """Launches iterations; if steps are implicit, whole ones."""
        if self._per_vertex or self._implicit is None:
            super()._iterate(count)
            return
        for number in range(self._steps(count)):
            renew = number % self.implicit_options.renewal == 0
            self._implicit.launch(self._implicit_step, self.collider_data, renew, self.contact_state)

    @property
    def _implicit_step(self) -> Any:
        """The Step of implicit steps. Where cloth meets cloth the schedule of contact sets the others' momentum."""
        if self.cloth_contact is None:
            return self.step
        step = build_step(self.options, self.model.precision)
        step.gravity, step.momentum, step.viscosity = self.step.gravity, self._momentum, 0.0
        return step

    def _steps(self, iterations: int) -> int:
        """Number of implicit steps in so many iterations, at least one."""
        return max(1, iterations // self._implicit.iterations) if self._implicit is not None else 0

    @property
    def stays_packed(self) -> bool:
        """Whether the cloth stays in the patches' order; implicit steps move it in the model's."""
        return super().stays_packed and (self._implicit is None or self._per_vertex)

    def run(self, iterations: int, *, shown: bool = True) -> None:
        """Runs a burst of iterations as captured graphs; checks every CHECK_EVERY whether seams have closed.

        Implicit steps run as graphs from one renewal of the coarse levels to the next, captured once for each pace.
        The model's own positions are up to date then.
        """
        implicit, was_implicit = self._implicit, not self._per_vertex
        if self.cloth_contact is not None:
            self._follow_contact(self.cloth_contact)
        elif self._per_vertex:
            self._check_seams()
        due = was_implicit and not self._per_vertex and self._since_renewal >= RIGID_RENEWAL
        if due and implicit is not None and implicit.renew_rigid_level():
            self._since_renewal = 0
        self._since_check, self._since_renewal = self._since_check + iterations, self._since_renewal + iterations
        if self._per_vertex or self._implicit is None:
            super().run(iterations)
            return
        most, steps = self.implicit_options.renewal, self._steps(iterations)
        for number in range(0, steps, most):
            wp.capture_launch(self._captured_steps(min(most, steps - number)))
        self._done += iterations

    def _captured_steps(self, count: int) -> Any:
        """The graph of so many implicit steps at this pace, the first of which renews the coarse levels."""
        key = self.pace, count
        if self._implicit is not None and key not in self._step_graphs:
            with no_collection(), wp.ScopedCapture(device=self.model.device) as capture:
                self._iterate(count * self._implicit.iterations)
            self._step_graphs[key] = capture.graph
        return self._step_graphs[key]

    def drop_graphs(self) -> None:
        super().drop_graphs()
        self._step_graphs: dict[tuple[Pace, int], Any] = {}

    def start_near_rest(self) -> None:
        """Starts near rest: steps are long from the first, on an avatar once the cloth has settled."""
        if self._implicit is not None:
            self._implicit.lengthen()
        if self.avatar_contact is not None:
            self._settles, self.step.momentum = True, SETTLING_MOMENTUM

    def update_anisotropy(self, relative_rms: NDArray[np.float64]) -> None:
        """Changes pace once the forces of cloth on an avatar have balanced; see Relaxation."""
        graphs = self._step_graphs
        super().update_anisotropy(relative_rms)
        self._step_graphs = graphs  # implicit steps do not depend on what it changes
        if self.avatar_contact is None:
            return
        pace = Pace.FALLING
        for better, bound in PACE_BOUNDS.items():
            if (relative_rms <= (TIGHTER * bound if self.pace >= better else bound)).all():
                pace = better
        if self._implicit is not None and pace != self.pace:
            self.pace = pace
            self._set_pace(self._implicit)

    def _set_pace(self, implicit: ImplicitStep) -> None:
        self._momentum = implicit.set_pace(self.pace)
        if not self._per_vertex and self.cloth_contact is None:
            self.step.momentum = self._momentum

    def _follow_contact(self, cloth_contact: ClothContact) -> None:
        """Lets steps be implicit once cloth is sewn and untangled and momentum is no longer lowered for contact."""
        implicit = self._implicit
        if implicit is None or implicit.pressing is None:
            return
        implicit.pressing.make_room()
        ready = cloth_contact.awake and not cloth_contact.untangles and self.step.momentum >= self._full_momentum
        if ready is not self._per_vertex:
            return
        self.update_model()
        self._per_vertex = not ready
        cloth_contact.expect_implicit_steps(ready)
        self._set_pace(implicit)
        self._items["cap"] = self.options.largest_move if ready else per_vertex_options(self.options).largest_move
        self.upload_items()
        self.drop_graphs()

    def _check_seams(self) -> None:
        """Lets steps be implicit from now on if seams have closed, or close no further."""
        if self._implicit is None or ((self._checks or self._settles) and self._since_check < CHECK_EVERY):
            return
        strain = float(np.sqrt(np.mean(np.maximum(edge_strains(self.model), 0.0) ** 2)))
        stays = strain > (1.0 - LEAST_GAIN) * self._strain
        if strain <= CLOSED or stays or self._checks == MOST_CHECKS:
            self._per_vertex = False
            self._set_pace(self._implicit)
            self._items["cap"] = self.options.largest_move
            self.upload_items()
            self.drop_graphs()
        self._checks, self._strain, self._since_check = self._checks + 1, strain, 0


def build_relaxation(
    options: StepOptions,
    model: ClothModel,
    colliders: Sequence[Collider],
    garments: Sequence[Garment],
    cloth_contact: ClothContact | None = None,
    caps: Sequence[float | None] | None = None,
) -> Relaxation:
    """The relaxation of the options' method; per-vertex steps where cloth is in contact with cloth.

    Args:
        options: the method and its step.
        model: the garments' model; of the multilevel method, of one item, or of several without an avatar.
        colliders: the items' contact with their avatars.
        garments: the model's.
        cloth_contact: contact of cloth with cloth; None: it passes through itself.
        caps: largest displacements of the items [m]; None: the options'.
    """
    if options.method != "multilevel":
        return Relaxation(model, colliders, options, cloth_contact, caps)
    if caps is not None:
        options = replace(options, cap=caps[0])
    hierarchies = {key: build_hierarchy(each) for key, each in {id(each): each for each in garments}.items()}
    own = [hierarchies[id(garment)] for garment in garments]
    return MultilevelRelaxation(model, colliders[0], options, own, cloth_contact=cloth_contact)


def per_vertex_options(options: StepOptions) -> StepOptions:
    """The options for the accelerated method's per-vertex steps, with a cap no larger than its own."""
    return replace(options, method="accelerated", cap=min(options.largest_move, DEFAULT_CAP["accelerated"]))
