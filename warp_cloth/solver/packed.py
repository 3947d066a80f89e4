"""A chunk of iterations in the patches' own order of vertices: packed before, unpacked after."""

from __future__ import annotations

from typing import Any

import warp as wp

from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.packing import packing_kernels
from warp_cloth.model import ClothModel
from warp_cloth.patches.on_device import Patches
from warp_cloth.solver.forces import launch_patches


class PackedCloth:
    """The cloth twice as patches own it, to iterate to and fro; what iterations change comes from and to the model."""

    def __init__(self, model: ClothModel, patches: Patches, accelerated: bool) -> None:
        self._model, self._patches = model, patches
        self._kernels = packing_kernels(model.precision, accelerated)
        self._here, self._there = (cloth_types(model.precision).Cloth() for _ in range(2))
        cloth, order = model.cloth, patches.order
        self._stiffness = wp.empty_like(cloth.stiffness) if accelerated else None
        self._leeway = wp.empty_like(cloth.leeway) if cloth.leeway else None
        weight = cloth.weight[order].contiguous()
        pinned = cloth.pinned[order].contiguous() if model.terms.pins else None
        for packed in (self._here, self._there):
            packed.position = wp.empty_like(cloth.position)
            packed.moved = wp.empty(model.vertex_count, dtype=cloth_types(model.precision).vec4, device=model.device)
            packed.weight, packed.item, packed.items = weight, cloth.item, cloth.items
            if self._stiffness is not None:
                packed.stiffness = self._stiffness
            if pinned is not None:
                packed.pinned = pinned
            if cloth.held:  # which only iterations ask
                packed.held = cloth.held
            if cloth.leeway:
                packed.leeway = self._leeway

    def kernels(self, move: wp.Kernel) -> list[wp.Kernel]:
        """The kernels of an iteration by ``move`` alone, in order."""
        leeway = [] if self._leeway is None else [self._kernels.pack_leeway]
        return [self._kernels.pack_vertices, *leeway, move, self._kernels.unpack_vertices]

    def iterate(self, move: wp.Kernel, asked: list[Any], count: int, *, loose: bool) -> None:
        """Launches iterations by ``move``, of kernels.displace.advance_kernel; ``asked`` comes first there.

        ``loose``: whether any item has leeway.
        """
        model, order, cloth = self._model, self._patches.order, self._model.cloth
        here, there = self._here, self._there
        written = [here.position, here.moved, self._stiffness]
        size, device = model.vertex_count, model.device
        wp.launch(self._kernels.pack_vertices, dim=size, inputs=[order, cloth, *written], device=device)
        if loose:
            wp.launch(self._kernels.pack_leeway, dim=size, inputs=[order, cloth, self._leeway], device=device)
        for number in range(count):  # to and fro: the cache still has what the last patches have read and written
            read = [self._patches.packed_tables[number % 2], self._patches.overflow]
            launch_patches(move, model, [*asked, *read, here, there.position, there.moved])
            here, there = there, here
        stiffness = cloth.stiffness if self._stiffness is not None else None
        inputs = [order, here, cloth.position, cloth.move, stiffness]
        wp.launch(self._kernels.unpack_vertices, dim=size, inputs=inputs, device=device)
