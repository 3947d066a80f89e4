"""Launches the force kernels that a model needs, the way its device sums best."""

from __future__ import annotations

from typing import Any

import warp as wp

from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.gather import gather_kernels
from warp_cloth.kernels.scatter import scatter_kernels
from warp_cloth.model import ClothModel


class ForcePass:
    """Sums the cloth's forces into ``load``: force [N] and a fourth part (kernels.cloth.FOURTH_PARTS) per vertex.

    ``load`` must be at zero before a pass; the kernels that read it leave it so.
    """

    def __init__(self, model: ClothModel, fourth: str, load: wp.array) -> None:
        self._model = model
        self._load = load
        self._bends = model.hinges is not None
        types = cloth_types(model.precision)
        if model.gathers:
            self._gather = gather_kernels(model.precision, fourth, self._bends)
            self._stored = wp.empty((4, model.hinge_count), dtype=types.vec4, device=model.device)
        else:
            self._scatter = scatter_kernels(model.precision, fourth)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a pass launches, in order."""
        if self._model.gathers:
            return [self._gather.store_bending, self._gather.gather_forces][0 if self._bends else 1 :]
        return [self._scatter.add_tension, self._scatter.add_bending][: 2 if self._bends else 1]

    def launch(self, step: Any) -> None:
        """Launches the pass; ``step`` is a kernels.cloth Step."""
        model, cloth = self._model, self._model.cloth
        if model.gathers:
            if self._bends:
                outputs = [cloth, model.hinges, step, self._stored]
                self._launch(self._gather.store_bending, model.hinge_count, outputs)
            rows = [cloth, model.edge_rows, model.hinge_rows, self._stored.flatten(), step, self._load]
            self._launch(self._gather.gather_forces, model.vertex_count, rows)
        else:
            self._launch(self._scatter.add_tension, model.edge_count, [cloth, model.edges, step, self._load])
            if self._bends:
                self._launch(self._scatter.add_bending, model.hinge_count, [cloth, model.hinges, step, self._load])

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device)
