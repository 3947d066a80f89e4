"""A burst of iterations in the patches' own order of vertices: put so before, put back after."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp

from warp_cloth.kernels.patches.packing import packing_kernels
from warp_cloth.model.model import ClothModel
from warp_cloth.model.patches.on_device import Patches
from warp_cloth.model.vertices import patch_ordered
from warp_cloth.solver.active_set import ActiveGroups
from warp_cloth.solver.forces import launch_patches

BeforeMove = Callable[[int, Any], int]  # (iteration, State) -> how many more blocks the iteration takes


class PackedCloth:
    """The cloth twice as patches own it, to iterate to and fro; what iterations change comes from and to the model.

    ``some``: the vertices that come and go. ``packed``: as of kernels.patches.packing; not where cloth meets cloth.
    The model's compliance lies as this cloth's vertices do.
    """

    def __init__(
        self, model: ClothModel, patches: Patches, accelerated: bool, some: ActiveGroups, *, packed: bool = True
    ) -> None:
        self._model, self._patches, self._some = model, patches, some
        self._kernels = packing_kernels(model.precision, accelerated, packed)
        self.ahead = False  # whether it has gone on where the model does not know
        # Model in the patches' order, and two States
        self.vertices, (self._here, self._there) = patch_ordered(
            model.precision, model.vertices, model.state, patches.order
        )

    def kernels(self, move: wp.Kernel) -> list[wp.Kernel]:
        """The kernels of an iteration by ``move`` alone, in order."""
        return [self._kernels.pack_vertices, move, self._kernels.unpack_vertices]

    def pack(self) -> Any:
        """State in the patches' order, read from the model; where it is ``ahead`` of that it stays as it is."""
        if self.ahead:
            return self._here
        model, here = self._model, self._here
        written = [here.position, here.displacement4, here.stiffness]
        inputs = [self.vertices, model.state, self._some.groups, self._patches.order, *written]
        wp.launch(self._kernels.pack_vertices, dim=self._some.size, inputs=inputs, device=model.device)
        return here

    def iterate(self, move: wp.Kernel, arguments: list[Any], count: int, before: BeforeMove | None) -> None:
        """Launches iterations by ``move``, of kernels.passes.move.advance_kernel; ``arguments`` comes first there.

        ``before`` is called before each iteration.
        """
        self.pack()
        self.iterate_packed(move, arguments, count, before)
        self.unpack(count)

    def iterate_packed(self, move: wp.Kernel, arguments: list[Any], count: int, before: BeforeMove | None) -> None:
        """The iterations of ``iterate`` alone, on what is packed already."""
        here, there = self._here, self._there
        for number in range(count):  # to and fro: the cache still has what the last patches have read and written
            more = before(number, here) if before is not None else 0
            read = [self._patches.packed_tables[number % 2], self._patches.overflow]
            launch_patches(
                move, self._model, [self.vertices, here, *arguments, *read, there.position, there.displacement4], more
            )
            here, there = there, here

    def unpack(self, count: int = 0) -> None:
        """Writes the cloth after so many iterations since ``pack`` to the model's State."""
        model, state = self._model, self._model.state
        here = self._there if count % 2 else self._here
        inputs = [
            self.vertices,
            here,
            self._some.groups,
            self._patches.rank,
            state.position,
            state.displacement,
            state.stiffness,
        ]
        wp.launch(self._kernels.unpack_vertices, dim=self._some.size, inputs=inputs, device=model.device)
