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

    ``load`` must be at zero before a pass; the kernels that read it leave it so. Where forces are gathered, a kernel
    that gathers by itself needs no load: it calls ``store`` and reads ``stored``.
    """

    def __init__(self, model: ClothModel, fourth: str, load: wp.array | None) -> None:
        self._model = model
        self._load = load
        types = cloth_types(model.precision)
        bends, woven = model.hinges is not None, model.weave is not None
        if model.gathers:
            kernels = gather_kernels(model.precision, fourth, bends or woven)
            planes, last = 4 * model.hinge_count, 4 * model.hinge_count + 3 * model.weave_count
            stored = wp.empty(last, dtype=types.vec4, device=model.device)
            self._stores = []
            if bends:
                out = stored[:planes].reshape((4, model.hinge_count))
                self._stores.append((kernels.store_bending, model.hinge_count, model.hinges, out))
            if woven:
                out = stored[planes:].reshape((3, model.weave_count))
                self._stores.append((kernels.store_weave, model.weave_count, model.weave, out))
            self._gather = kernels.gather_forces
            self.stored = stored
        else:
            scatter = scatter_kernels(model.precision, fourth)
            tension = (scatter.add_tension, model.pulling_count, model.pulling, load)
            bending = (scatter.add_bending, model.hinge_count, model.hinges, load)
            weave = (scatter.add_weave, model.weave_count, model.weave, load)
            self._stores = [store for store in (tension, bending, weave) if store[1]]

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a pass launches, in order."""
        last = [self._gather] if self._model.gathers else []
        return self.storing_kernels() + last

    def storing_kernels(self) -> list[wp.Kernel]:
        """The kernels that ``store`` launches, in order."""
        return [store[0] for store in self._stores]

    def launch(self, step: Any) -> None:
        """Launches the pass; ``step`` is a kernels.cloth Step."""
        model, cloth = self._model, self._model.cloth
        self.store(step, cloth)
        if model.gathers:
            rows = [cloth, model.edge_rows, model.stored_rows, self.stored, step, self._load]
            self._launch(self._gather, model.vertex_count, rows)

    def store(self, step: Any, cloth: Any) -> None:
        """Scatters the elements' forces into ``load``, or stores them where forces are gathered."""
        for kernel, count, elements, out in self._stores:
            self._launch(kernel, count, [cloth, elements, step, out])

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device)
