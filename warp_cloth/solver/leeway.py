"""Looks up from time to time in which directions vertices have leeway (kernels.leeway)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.leeway import leeway_kernels
from warp_cloth.kernels.scatter import normals_kernel
from warp_cloth.model import ClothModel
from warp_cloth.topology import ragged_rows


class Leeway:
    """Owns what a look needs; gives the model's cloth the arrays that the iterations read."""

    def __init__(self, model: ClothModel) -> None:
        types, terms = cloth_types(model.precision), model.terms
        self._model = model
        self._kernels = leeway_kernels(model.precision, terms)
        self._normals = normals_kernel(model.precision)
        triangles, edges = (model.triangle_count, model.edge_count) if terms.folds else (0, 0)
        self._normal = wp.empty(triangles, dtype=types.vec4, device=model.device)
        self._bound = wp.empty(edges, dtype=types.real, device=model.device)
        self._rows = types.Rows()
        if terms.edges:
            start, order = self._rows_of(model.edges.ends.numpy())
            self._rows.edge_start, self._rows.edge = self._uploaded(start), self._uploaded(order // 2)
        if terms.folds or terms.threads:
            start, order = self._rows_of(model.triangles.corners.numpy())
            self._rows.triangle_start, self._rows.triangle = self._uploaded(start), self._uploaded(order)
        self._found = wp.zeros(model.vertex_count, dtype=types.vec6, device=model.device)
        model.cloth.leeway = wp.zeros(model.vertex_count, dtype=types.vec6, device=model.device)
        self.forget(range(model.item_count))

    def _rows_of(self, vertices: NDArray[np.int32]) -> tuple[NDArray[Any], NDArray[Any]]:
        return ragged_rows(vertices.ravel(), self._model.vertex_count)

    def _uploaded(self, numbers: NDArray[Any]) -> wp.array:
        return wp.array(numbers.astype(np.int32), dtype=wp.int32, device=self._model.device)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a look launches, in order."""
        folds = [self._normals, self._kernels.bound_folds] if self._model.terms.folds else []
        return [*folds, self._kernels.find_leeway, self._kernels.take_leeway]

    def forget(self, items: Sequence[int]) -> None:
        """Leaves the vertices of these items no leeway, till the next look."""
        none = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        for item in items:
            self._model.cloth.leeway[self._model.of_item(item)].fill_(none)

    def look_up(self, step: Any, cloth: Any) -> None:
        """Launches a look at the cloth as it lies; ``step`` is a kernels.cloth Step."""
        model, device = self._model, self._model.device
        if model.terms.folds:
            read = [cloth, model.triangles, step, self._normal]
            wp.launch(self._normals, dim=model.triangle_count, inputs=read, device=device)
            read = [cloth, model.edges, self._normal, step, self._bound]
            wp.launch(self._kernels.bound_folds, dim=model.edge_count, inputs=read, device=device)
        read = [cloth, model.edges, model.triangles, self._rows, self._bound, step, self._found]
        wp.launch(self._kernels.find_leeway, dim=model.vertex_count, inputs=read, device=device)
        wp.launch(self._kernels.take_leeway, dim=model.vertex_count, inputs=[cloth, self._found], device=device)
