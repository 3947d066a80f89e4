"""Contact of cloth with cloth in a model's implicit steps: forces, the stiffness of pairs that press, its products."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.implicit.contact_pairs import (
    limit_by_pairs_kernel,
    linearise_pairs_kernel,
    multiply_pairs_kernel,
    pressing_type,
)
from warp_cloth.model.model import ClothModel

if TYPE_CHECKING:
    from warp_cloth.contact.cloth import ClothContact


class PressingPairs:
    """Owns the pairs that press in a step, and launches what lists them and multiplies with them."""

    def __init__(self, model: ClothModel, cloth_contact: ClothContact) -> None:
        self._model, self._cloth_contact = model, cloth_contact
        self.data = pressing_type(model.precision)()
        self.data.count = wp.zeros(1, dtype=wp.int32, device=model.device)
        self.data.fraction = wp.zeros(1, dtype=wp.int32, device=model.device)
        self.data.block = wp.zeros((model.vertex_count, 6), dtype=wp.int64, device=model.device)
        self.data.product = wp.zeros((model.vertex_count, 3), dtype=wp.int64, device=model.device)
        self._linearise = linearise_pairs_kernel(model.precision, model.patches is not None)
        self._multiply = multiply_pairs_kernel(model.precision)
        self._limit = limit_by_pairs_kernel(model.precision)
        self.make_room()

    @property
    def capacity(self) -> int:
        """The number of pairs that contact can list."""
        return len(self._cloth_contact.data.pairs.corners)

    def make_room(self) -> None:
        """Allocates room for as many pairs as contact lists."""
        if self.data.corners is not None and len(self.data.corners) == self.capacity:
            return
        types, device = cloth_types(self._model.precision), self._model.device
        for name, dtype in (
            ("corners", wp.vec4i),
            ("weights", types.vec4),
            ("stiffness", types.vec6),
            ("distance", types.real),
        ):
            setattr(self.data, name, wp.zeros(self.capacity, dtype=dtype, device=device))

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that it launches."""
        return [self._linearise, self._multiply, self._limit]

    def launch(self, step: Any, state: Any, load: wp.array) -> None:
        """Searches where it is due, adds contact to the load, and lists what presses; ``state`` of contact_state."""
        contact = self._cloth_contact
        contact.search_where_due(state)
        contact.add_forces(step, state)
        contact.add_load(load)
        self.data.count.zero_()
        inputs = [state, step, contact.data, contact.order, self.data]
        wp.launch(self._linearise, dim=self.capacity, inputs=inputs, device=self._model.device)

    def multiply(self, x: wp.array) -> None:
        """Multiplies displacements [m] with the pairs' stiffness; what follows takes the product."""
        wp.launch(self._multiply, dim=self.capacity, inputs=[x, self.data], device=self._model.device)

    def limit(self) -> None:
        """Lowers the fraction of the displacements that is taken, so that no pair comes too near."""
        contact, model = self._cloth_contact, self._model
        size = max(self.capacity, model.vertex_count)
        inputs = [model.state, contact.data, contact.order, self.data]
        wp.launch(self._limit, dim=size, inputs=inputs, device=model.device)
