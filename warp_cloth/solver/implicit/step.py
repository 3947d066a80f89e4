"""The implicit step: every displacement solves the forces, linearised where the cloth is, over all vertices at once.

A per-vertex step passes a force on from neighbour to neighbour, so that its number grows with the vertices across the
cloth. Here the coarse levels of the preconditioner carry it across at once, and the number hardly grows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types
from warp_cloth.kernels.implicit.conjugate_gradient import conjugate_gradient_kernels
from warp_cloth.kernels.implicit.step import implicit_kernels
from warp_cloth.kernels.implicit.system import system_types
from warp_cloth.kernels.passes.step import NoClothContact
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.implicit.coarse_levels import Level
from warp_cloth.solver.implicit.contact_pairs import PressingPairs
from warp_cloth.solver.implicit.linearisation import Linearisation
from warp_cloth.solver.implicit.options import ImplicitOptions, Pace
from warp_cloth.solver.implicit.preconditioner import Preconditioner
from warp_cloth.solver.implicit.rigid_level import RigidCorrection, rigid_depth
from warp_cloth.solver.implicit.vertex_pairs import PairTable
from warp_cloth.solver.reduction import launch_blocks, split_into_chunks

if TYPE_CHECKING:
    from warp_cloth.contact.cloth import ClothContact

CHUNK = 64  # vertices that a block works on, of a garment that is not large


class ImplicitStep:
    """Owns the scratch memory of a model's implicit steps and launches them."""

    def __init__(
        self,
        model: ClothModel,
        avatar_contact: wp.Function | None,
        collider_type: Any,
        table: PairTable,
        levels: Sequence[Level],
        options: ImplicitOptions,
        cloth_contact: ClothContact | None = None,
    ) -> None:
        types = cloth_types(model.precision)
        self._model, self._options, self._cloth_contact = model, options, cloth_contact
        self.pressing = None if cloth_contact is None else PressingPairs(model, cloth_contact)
        self._on_avatar = avatar_contact is not None
        self._load = wp.zeros(model.vertex_count, dtype=types.vec4, device=model.device)
        self._forces = ForcePass(model, Accumulate.NONE, self._load)
        self.linearisation = Linearisation(model, table, options.allowance)
        # garments that meet are solved as one
        starts = np.array(model.vertex_start if cloth_contact is None else model.item_start)
        self._starts = starts
        self._garments = len(starts) - 1
        self._chunks = split_into_chunks(starts, CHUNK, model.device)
        self._rho, self._rho_before, self._curvature = (
            wp.zeros(len(self._chunks.garment), dtype=wp.float64, device=model.device) for _ in range(3)
        )
        self._system, self._solution, self.state = self._build_system(table)
        self.preconditioner = Preconditioner(model, levels, self.linearisation.pair, self._system.anchor)
        depth = rigid_depth(levels, model.vertex_count) if self._on_avatar else None
        self._rigid_correction = None if depth is None else RigidCorrection(model, table.ends, levels[:depth])
        self.set_pace(Pace.FALLING)
        meets = cloth_contact is not None
        self._solver = conjugate_gradient_kernels(model.precision, meets)
        self._ends = implicit_kernels(model.precision, avatar_contact, collider_type, meets, model.terms.pins)

    def _build_system(self, table: PairTable) -> tuple[Any, Any, Any]:
        """A LinearSystem, a SolutionState and an ImplicitState (kernels.implicit.system)."""
        model, count, device = self._model, self._model.vertex_count, self._model.device
        types, own = cloth_types(model.precision), stiffness_types(model.precision)
        structs = system_types(model.precision)
        system, solution, state = structs.LinearSystem(), structs.SolutionState(), structs.ImplicitState()
        garment = np.repeat(np.arange(self._garments, dtype=np.int32), np.diff(self._starts))
        system.garment = wp.array(garment, dtype=wp.int32, device=device)
        system.row_start, system.neighbour = table.start, table.neighbour
        system.coupling = self.linearisation.coupling
        system.constraint = wp.zeros(count, dtype=wp.int32, device=device)
        for name, dtype in (("inertia", types.real), ("gap", types.real), ("drag", types.real),
                            ("normal", types.vec3), ("force", types.vec3),
                            ("anchor", own.vec6), ("inverse", own.vec6)):  # fmt: skip
            setattr(system, name, wp.zeros(count, dtype=dtype, device=device))
        for name in ("displacement", "residual", "correction", "direction", "product"):
            setattr(solution, name, wp.zeros(count, dtype=types.vec3, device=device))
        options = self._options
        state.free_fall = wp.full(self._garments, options.free_fall, dtype=types.real, device=device)
        state.momentum = wp.full(self._garments, options.momentum_balanced, dtype=types.real, device=device)
        state.in_contact = wp.zeros(count, dtype=wp.uint8, device=device)
        state.extrapolation = wp.zeros(count, dtype=types.vec3, device=device)
        return system, solution, state

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a step launches."""
        return [
            *self._forces.kernels(),
            *self.linearisation.kernels(),
            *self.preconditioner.kernels(),
            *vars(self._solver).values(),
            *vars(self._ends).values(),
            *(self._rigid_correction.kernels() if self._rigid_correction is not None else ()),
            *(self.pressing.kernels() if self.pressing is not None else ()),
        ]

    def launch(self, step: Any, collider_data: Any, renew: bool, contact_state: Callable[[], Any]) -> None:
        """One step.

        Args:
            step: a kernels.base.types Step.
            collider_data: of the avatars.
            renew: whether the coarse levels' stiffness is summed again.
            contact_state: returns the State in the numbering of contact of cloth with cloth, brought up to date.
        """
        model, system, solution, state = self._model, self._system, self._solution, self.state
        vertices, count, ends, options = model.vertices, model.vertex_count, self._ends, self._options
        self._forces.launch(step)
        pressing = NoClothContact()
        if self.pressing is not None:
            self.pressing.launch(step, contact_state(), self._load)
            pressing = self.pressing.data
        self.linearisation.launch()
        if renew:
            self.preconditioner.coarsen_stiffness()
        inputs = [vertices, model.state, step, collider_data, state, pressing, solution, self._load, system]
        self._launch(ends.prepare_step, count, inputs)
        self.preconditioner.coarsen_anchors(lumped=self._on_avatar)
        self._solve()
        if state.step_fraction:
            work = self._curvature, self._rho
            self._launch_chunks(ends.measure_momentum_work, [system, state, solution, self._chunks, *work])
            inputs = [options.least_momentum, options.most_momentum, self._restart_fraction, self._chunks, *work, state]
            launch_blocks(ends.adapt_momentum, self._garments, inputs, model.device)
        self._launch(ends.take_step, count, [vertices, system, solution, collider_data, state, model.state])
        if self.pressing is not None and self._cloth_contact is not None:
            self.pressing.limit()
            contact = self._cloth_contact
            inputs = [vertices, contact.data, contact.order, pressing, state, model.state]
            self._launch(ends.move_together, count, inputs)
        self._launch(ends.grow_free_fall, self._garments, [options.free_fall_growth, self._free_fall_limit, state])

    def _solve(self) -> None:
        """Conjugate gradients from the displacement that ``prepare_step`` left, or from nothing under momentum."""
        system, solution, chunks, kernels = self._system, self._solution, self._chunks, self._solver
        if not self.state.step_fraction:
            stiffness_fraction = 1.0 - (self._options.swing_on_avatar if self._on_avatar else 0.0)
            inputs = [system, stiffness_fraction, self._multiplied(solution.displacement), solution]
            self._launch(kernels.subtract_initial_guess, self._model.vertex_count, inputs)
        before = None  # directions start afresh
        rho, other = self._rho, self._rho_before
        for number in range(self.iterations):
            self.preconditioner.launch(system, chunks, solution, rho)
            if self._rigid is not None and number == self._options.rigid_iteration:
                self._rigid.correct(system, solution, chunks, rho)
                before = None  # another preconditioner makes other directions
            self._launch_chunks(kernels.update_direction, [chunks, rho, before, solution])
            pressing = self._multiplied(solution.direction)
            self._launch_chunks(kernels.multiply_direction, [system, chunks, pressing, solution, self._curvature])
            self._launch_chunks(kernels.advance_solution, [chunks, rho, self._curvature, solution])
            before, rho, other = rho, other, rho

    def _multiplied(self, x: wp.array) -> Any:
        """The pairs that press, with the products of their stiffness and displacements."""
        if self.pressing is None:
            return NoClothContact()
        self.pressing.multiply(x)
        return self.pressing.data

    def set_pace(self, pace: Pace) -> float:
        """Takes steps of this pace on an avatar; returns the momentum that goes with them."""
        options, balanced = self._options, pace >= Pace.BALANCED
        self.iterations = options.iterations_balanced if self._on_avatar and balanced else options.iterations
        self._rigid = self._rigid_correction if balanced else None
        if not self._on_avatar:
            self._free_fall_limit = options.free_fall_limit
            return options.momentum
        self._free_fall_limit = options.free_fall_limit_balanced if balanced else options.free_fall_limit_on_avatar
        self.state.step_fraction = options.step_fraction_still if pace >= Pace.STILL else 0.0
        self.state.damps_snapping = pace == Pace.STILL
        self._restart_fraction = options.restart_still if pace == Pace.STILL else options.restart_resting
        return options.momentum_balanced if balanced else options.momentum_on_avatar

    def renew_rigid_level(self) -> bool:
        """Assembles the level with rigid modes as the last step found the cloth; whether that level is in use."""
        if self._rigid is None:
            return False
        self._rigid.renew(self.linearisation.pair, self._system.anchor)
        return True

    def lengthen(self) -> None:
        """Steps are as long from now on as they get in the end."""
        self.state.free_fall.fill_(self._free_fall_limit)

    def _launch_chunks(self, kernel: wp.Kernel, inputs: list[Any]) -> None:
        launch_blocks(kernel, len(self._chunks.garment), inputs, self._model.device)

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device)
