"""A chunk of iterations in the patches' own order of vertices: put so before, put back after."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.patches.packing import packing_kernels
from warp_cloth.model.model import ClothModel
from warp_cloth.model.patches.on_device import Patches
from warp_cloth.solver.active_set import Listed
from warp_cloth.solver.forces import launch_patches


class PackedCloth:
    """The cloth twice as patches own it, to iterate to and fro; what iterations change comes from and to the model.

    ``some``: the vertices that come and go. ``packed``: as of kernels.patches.packing; not where cloth meets cloth.
    The model's leeway lies as this cloth's vertices do.
    """

    def __init__(
        self, model: ClothModel, patches: Patches, accelerated: bool, some: Listed, *, packed: bool = True
    ) -> None:
        self._model, self._patches, self._some = model, patches, some
        self._kernels = packing_kernels(model.precision, accelerated, packed)
        types = cloth_types(model.precision)
        self._here, self._there = (types.Cloth() for _ in range(2))
        cloth, order = model.cloth, patches.order
        self.ahead = False  # whether it has gone on where the model does not know
        self._stiffness = wp.empty_like(cloth.stiffness) if accelerated else None
        weight = cloth.weight[order].contiguous()
        pinned = cloth.pinned[order].contiguous() if model.terms.pins else None
        for each in (self._here, self._there):
            each.position = wp.empty_like(cloth.position)
            each.moved = wp.empty(model.vertex_count, dtype=types.vec4, device=model.device)
            each.weight, each.item, each.items = weight, cloth.item, cloth.items
            if self._stiffness is not None:
                each.stiffness = self._stiffness
            if pinned is not None:
                each.pinned = pinned
            if cloth.held:  # which only iterations ask
                each.held = cloth.held
            if cloth.clear:
                each.clear = cloth.clear
            if cloth.leeway:
                each.leeway = cloth.leeway

    def kernels(self, move: wp.Kernel) -> list[wp.Kernel]:
        """The kernels of an iteration by ``move`` alone, in order."""
        return [self._kernels.pack_vertices, move, self._kernels.unpack_vertices]

    def brought(self) -> Any:
        """The cloth as patches own it, brought up to where the model has it.

        Where it is ``ahead`` it stays where it is.
        """
        if self.ahead:
            return self._here
        model, here = self._model, self._here
        written = [here.position, here.moved, self._stiffness]
        inputs = [self._some.groups, self._patches.order, model.cloth, *written]
        wp.launch(self._kernels.pack_vertices, dim=self._some.size, inputs=inputs, device=model.device)
        return here

    def iterate(self, move: wp.Kernel, asked: list[Any], count: int, before: Callable[[int, Any], int] | None) -> None:
        """Launches iterations by ``move``, of kernels.passes.move.advance_kernel; ``asked`` comes first there.

        ``before`` each iteration, given its number and the cloth then: how many
        more blocks it takes.
        """
        self.brought()
        self.go(move, asked, count, before)
        self.show(count)

    def go(self, move: wp.Kernel, asked: list[Any], count: int, before: Callable[[int, Any], int] | None) -> None:
        """Launches iterations of the cloth as patches own it, as of ``iterate``."""
        here, there = self._here, self._there
        for number in range(count):  # to and fro: the cache still has what the last patches have read and written
            more = before(number, here) if before is not None else 0
            read = [self._patches.packed_tables[number % 2], self._patches.overflow]
            launch_patches(move, self._model, [*asked, *read, here, there.position, there.moved], more)
            here, there = there, here

    def show(self, count: int = 0) -> None:
        """Has the model know where the cloth is after so many iterations since it was ``brought``."""
        model, cloth = self._model, self._model.cloth
        here = self._there if count % 2 else self._here
        stiffness = cloth.stiffness if self._stiffness is not None else None
        inputs = [self._some.groups, self._patches.rank, here, cloth.position, cloth.move, stiffness]
        wp.launch(self._kernels.unpack_vertices, dim=self._some.size, inputs=inputs, device=model.device)
