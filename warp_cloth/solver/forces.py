"""Launches the force kernels that a model needs, the way its device sums best."""

from __future__ import annotations

from typing import Any

import warp as wp

from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.gather import gather_kernels
from warp_cloth.kernels.scatter import normals_kernel, scatter_kernels
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
        terms = model.terms

        def empty(count: int, dtype: Any = types.vec4) -> wp.array:
            return wp.empty(count, dtype=dtype, device=model.device)

        normal = empty(model.triangle_count if terms.folds else 0)
        fold = empty(model.edge_count if terms.folds else 0, types.vec2)
        self._gather: wp.Kernel | None = None
        self.stored: list[Any] = []  # what a gathering kernel reads beside the model
        edge_out = triangle_out = load
        if model.gathers:
            kernels = gather_kernels(model.precision, fourth, terms)
            edge_kernel, triangle_kernel, self._gather = (
                kernels.store_edges, kernels.store_triangles, kernels.gather_forces,
            )  # fmt: skip
            edge_out = empty(model.edge_count if terms.edges else 0)
            triangle_out = empty(3 * model.triangle_count if terms.folds or terms.threads else 0)
            self.stored = [model.stored_rows, edge_out, triangle_out]
            triangle_out = triangle_out.reshape((3, -1))
        else:
            kernels = scatter_kernels(model.precision, fourth, terms)
            edge_kernel, triangle_kernel = kernels.add_edges, kernels.add_triangles
        edges, triangles = model.edge_count, model.triangle_count
        self._stores: list[tuple[wp.Kernel, int, list[Any], list[Any]]] = []  # kernel, size, reads, writes
        if terms.folds:
            self._stores.append((normals_kernel(model.precision), triangles, [model.triangles], [normal]))
        if terms.edges or terms.folds:
            self._stores.append((edge_kernel, edges, [model.edges, normal], [fold, edge_out]))
        if terms.folds or terms.threads:
            self._stores.append((triangle_kernel, triangles, [model.triangles, normal, fold], [triangle_out]))

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a pass launches, in order."""
        return self.storing_kernels() + [kernel for kernel in [self._gather] if kernel is not None]

    def storing_kernels(self) -> list[wp.Kernel]:
        """The kernels that ``store`` launches, in order."""
        return [store[0] for store in self._stores]

    def launch(self, step: Any) -> None:
        """Launches the pass; ``step`` is a kernels.cloth Step."""
        model = self._model
        self.store(step, model.cloth)
        if self._gather is not None:
            self._launch(self._gather, model.vertex_count, [*self.stored, self._load])

    def store(self, step: Any, cloth: Any) -> None:
        """Scatters the forces into ``load``, or stores them where they are gathered."""
        for kernel, size, read, written in self._stores:
            self._launch(kernel, size, [cloth, *read, step, *written])

    def _launch(self, kernel: wp.Kernel, size: int, inputs: list[Any]) -> None:
        wp.launch(kernel, dim=size, inputs=inputs, device=self._model.device)
