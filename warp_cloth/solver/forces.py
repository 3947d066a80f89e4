"""Launches the force kernels that a model needs, the way its device sums best."""

from __future__ import annotations

from typing import Any

import warp as wp

from warp_cloth.kernels.arithmetic import WIDTH
from warp_cloth.kernels.block import BLOCK_THREADS
from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.gather import gather_kernel
from warp_cloth.kernels.scatter import edges_kernel, normals_kernel, triangles_kernel
from warp_cloth.model import ClothModel


class ForcePass:
    """Sums the cloth's forces into ``load``: force [N] and a fourth part (kernels.cloth.FOURTH_PARTS) per vertex.

    ``load`` must be at zero before a pass; the kernels that read it leave it so.
    """

    def __init__(self, model: ClothModel, fourth: str, load: wp.array) -> None:
        self._model = model
        types, terms = cloth_types(model.precision), model.terms
        self._passes: list[tuple[wp.Kernel, int, list[Any], list[Any]]] = []  # kernel, size, reads, writes
        if model.patches is not None:
            read = [model.patches.tables, model.patches.overflow]
            self._passes.append((gather_kernel(model.precision, fourth, terms, model.patches.fits), 0, read, [load]))
            return
        edges, triangles = model.edge_count, model.triangle_count
        normal = wp.empty(triangles if terms.folds else 0, dtype=types.vec4, device=model.device)
        fold = wp.empty(edges if terms.folds else 0, dtype=types.vec3, device=model.device)
        asked = model.precision, fourth, terms
        if terms.folds:
            self._passes.append((normals_kernel(model.precision), triangles, [model.triangles], [normal]))
        if terms.edges or terms.folds:
            self._passes.append((edges_kernel(*asked), edges, [model.edges, normal], [fold, load]))
        if terms.folds or terms.threads:
            read = [model.triangles, normal, fold]
            self._passes.append((triangles_kernel(*asked), -(-triangles // WIDTH), read, [load]))

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a pass launches, in order."""
        return [entry[0] for entry in self._passes]

    def launch(self, step: Any) -> None:
        """Launches the pass; ``step`` is a kernels.cloth Step."""
        model = self._model
        for kernel, size, read, written in self._passes:
            inputs = [model.cloth, *read, step, *written]
            if model.patches is not None:
                launch_patches(kernel, model, inputs)
            else:
                wp.launch(kernel, dim=size, inputs=inputs, device=model.device)


def launch_patches(kernel: wp.Kernel, model: ClothModel, inputs: list[Any], more: int = 0) -> None:
    """Launches a kernel whose blocks work on a patch each, and so many more."""
    if model.patches is None:
        return
    threads = BLOCK_THREADS if wp.get_device(model.device).is_cuda else 1
    wp.launch(kernel, dim=(model.patches.count + more) * threads, inputs=inputs, device=model.device, block_dim=threads)
