"""Linearised forces of a model: the 3 x 3 coupling of every pair of vertices, as the cloth lies."""

from __future__ import annotations

from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_kernels, stiffness_types
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.implicit.vertex_pairs import PairTable


class Linearisation:
    """Owns a model's couplings and launches what computes them."""

    def __init__(self, model: ClothModel, table: PairTable, allowance: float) -> None:
        types, own, device = cloth_types(model.precision), stiffness_types(model.precision), model.device
        self._model, self._pairs, self._allowance = model, table.pairs, allowance
        self.pair_count = len(table.ends)
        self.coupling = wp.zeros(2 * self.pair_count, dtype=own.mat3, device=device)  # S_ij by rows [N/m]
        self.pair = wp.zeros(self.pair_count, dtype=own.vec6, device=device)  # symmetric part of each [N/m]
        self._gradient = wp.zeros((4, model.hinge_count), dtype=types.vec3, device=device)
        self._side = wp.zeros((3, model.weave_count), dtype=own.vec6, device=device)
        self._kernels = stiffness_kernels(model.precision, model.terms)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that it launches."""
        hinges = [self._kernels.linearise_hinges] if self._model.hinges is not None else []
        weave = [self._kernels.linearise_weave] if self._model.weave is not None else []
        return [self._kernels.couple_pairs, *hinges, *weave]

    def launch(self) -> None:
        """Linearises the forces where the cloth is."""
        model, state, kernels = self._model, self._model.state, self._kernels
        if model.hinges is not None:
            self._launch(kernels.linearise_hinges, model.hinge_count, [state, model.hinges, self._gradient])
        if model.weave is not None:
            self._launch(kernels.linearise_weave, model.weave_count, [state, model.weave, self._allowance, self._side])
        elements = [state, model.edges, self._pairs, self._allowance, self._gradient, self._side]
        self._launch(kernels.couple_pairs, self.pair_count, [*elements, self.coupling, self.pair])

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device)
