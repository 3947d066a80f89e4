"""Launches the force kernels that a model needs, the way its device sums best."""

from __future__ import annotations

from typing import Any

import warp as wp

from warp_cloth.base.compiling import in_blocks
from warp_cloth.kernels.base.options import Accumulate, KernelOptions, block_for
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.math.lanes import WIDTH, lane_types
from warp_cloth.kernels.passes.gather import gather_kernel
from warp_cloth.kernels.passes.scatter import edges_kernel, normals_kernel, packet_normals_kernel, triangles_kernel
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.active_set import ActiveGroups


class NormalsPass:
    """Measures the triangles' normals, one by one or in packets of eight."""

    def __init__(self, model: ClothModel, *, packed: bool = False, some: ActiveGroups | None = None) -> None:
        """``packed``: whether the cloth's positions are (kernels.patches.packing).

        ``some`` of the triangles, where they are not taken in packets; None: all.
        """
        types, count = cloth_types(model.precision), model.triangle_count
        self._packets = takes_packets(model, count) and not packed
        self._model, self._some = model, some or ActiveGroups([0, count], model.device)
        self.kernel = (
            packet_normals_kernel(model.precision) if self._packets else normals_kernel(model.precision, packed)
        )
        self.normal = wp.empty(count, dtype=types.vec4, device=model.device)
        # sides of packets of triangles, which kernels read after it
        sides = 2 * self.size if self._packets else 0
        self.sides = wp.empty(sides, dtype=lane_types(types.real, WIDTH).vec3, device=model.device)

    @property
    def size(self) -> int:
        """Threads that it takes."""
        return pass_size(self._model.triangle_count, True) if self._packets else self._some.size

    def launch(self, vertices: Any, state: Any, triangles: Any = None) -> None:
        """Launches it; a Model and a State of base.types, and their triangles, or the model's."""
        written = [self.normal, self.sides] if self._packets else [self._some.groups, self.normal]
        inputs = [vertices, state, triangles or self._model.triangles, *written]
        wp.launch(self.kernel, dim=self.size, inputs=inputs, device=self._model.device)


class ForcePass:
    """Sums the cloth's forces into ``load``: per vertex force [N] and what ``accumulate`` names.

    ``load`` must be at zero before a pass; the kernels that read it leave it so.
    """

    def __init__(self, model: ClothModel, accumulate: Accumulate, load: wp.array) -> None:
        self._model = model
        types, terms = cloth_types(model.precision), model.terms
        self._normals: NormalsPass | None = None  # which goes first
        self._passes: list[tuple[wp.Kernel, int, list[Any], list[Any]]] = []  # kernel, size, reads, writes
        if model.patches is not None:
            read = [model.patches.tables, model.patches.overflow]
            options = KernelOptions(
                model.precision, terms, accumulate, fits=model.patches.fits, paired=model.patches.paired
            )
            self._passes.append((in_patches(gather_kernel(options), model.patches.paired), 0, read, [load]))
            return
        edges, triangles = model.edge_count, model.triangle_count
        normal = wp.empty(0, dtype=types.vec4, device=model.device)
        sides = wp.empty(0, dtype=lane_types(types.real, WIDTH).vec3, device=model.device)
        no_sides = wp.empty(0, dtype=types.vec3, device=model.device)
        fold = wp.empty(edges if terms.folds else 0, dtype=types.vec4, device=model.device)
        asked = model.precision, accumulate, terms
        if terms.folds:
            self._normals = NormalsPass(model)
            normal, sides = self._normals.normal, self._normals.sides
        iterates = accumulate.is_bound
        if terms.edges or terms.folds:
            packets = iterates and not (terms.angles or terms.hysteresis) and takes_packets(model, edges)
            kernel, size = edges_kernel(*asked, WIDTH if packets else 1), pass_size(edges, packets)
            self._passes.append((kernel, size, [model.edges, normal], [fold, load]))
        if terms.folds or terms.yarns:
            packets = iterates and not terms.shear_hysteresis and takes_packets(model, triangles)
            kernel, size = triangles_kernel(*asked, WIDTH if packets else 1), pass_size(triangles, packets)
            read = [model.triangles, normal, sides if packets else no_sides, fold]
            self._passes.append((kernel, size, read, [load]))

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a pass launches, in order."""
        first = [] if self._normals is None else [self._normals.kernel]
        return [*first, *(entry[0] for entry in self._passes)]

    def launch(self, step: Any) -> None:
        """Launches the pass; ``step`` is a kernels.base.types Step."""
        model = self._model
        if self._normals is not None:
            self._normals.launch(model.vertices, model.state)
        for kernel, size, read, written in self._passes:
            inputs = [model.vertices, model.state, *read, step, *written]
            if model.patches is not None:
                launch_patches(kernel, model, inputs)
            else:
                wp.launch(kernel, dim=size, inputs=inputs, device=model.device)


def takes_packets(model: ClothModel, count: int) -> bool:
    """Whether that many elements are taken in packets of eight: a CPU has instructions for that."""
    return count >= WIDTH and bool(wp.get_device(model.device).is_cpu)


def pass_size(count: int, packets: bool) -> int:
    """How many threads a pass over elements takes, one by one or in ``packets``."""
    return -(-count // WIDTH) if packets else count


def launch_patches(kernel: wp.Kernel, model: ClothModel, inputs: list[Any], more: int = 0) -> None:
    """Launches a kernel whose blocks work on a patch each, and so many more."""
    if model.patches is None:
        return
    threads = patch_threads(kernel, model.patches.paired) if wp.get_device(model.device).is_cuda else 1
    wp.launch(kernel, dim=(model.patches.count + more) * threads, inputs=inputs, device=model.device, block_dim=threads)


def in_patches(kernel: wp.Kernel, paired: bool) -> wp.Kernel:
    """A kernel whose blocks work on a patch each, compiled for blocks as ``launch_patches`` has them."""
    return in_blocks(kernel, patch_threads(kernel, paired))


def patch_threads(kernel: wp.Kernel, paired: bool) -> int:
    """Threads of a block that works on a patch: as many as the kernel is made for, if it says so."""
    bounds = kernel.options.get("launch_bounds")
    return int(bounds[0]) if isinstance(bounds, tuple) else block_for(paired).threads
