"""Orientation of garments: whether they face away from the body or towards it."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from warp_cloth.avatar.exact import ExactCollider
from warp_cloth.contact.crossing import Sheets
from warp_cloth.kernels.contact.facing import face_vertices, sides_kernel
from warp_cloth.model.permutation import Permutation


class Facing:
    """Computes for each vertex whether most of its garment's area faces away from the body, 1, or towards it, -1."""

    def __init__(self, precision: str, sheets: Sheets, permutation: Permutation, body: ExactCollider) -> None:
        """On Warp's default device, that of the body."""
        self._body, self._weigh = body, sides_kernel(precision)
        counts = np.diff(sheets.vertex_start)
        of_vertex = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
        self._of_triangle = wp.array(sheets.garment, dtype=wp.int32)
        self._of_vertex = wp.array(permutation.rows(of_vertex), dtype=wp.int32)
        self._away = wp.zeros(len(counts), dtype=wp.int64)

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that this launches."""
        return [self._weigh, face_vertices]

    def update(self, state: Any, search: Any, outward: wp.array) -> None:
        """Writes ``outward`` for the cloth in this state. Does not wait for the device."""
        device, away = self._away.device, self._away
        away.zero_()
        inputs = [state, search, self._of_triangle, self._body.collider, away]
        wp.launch(self._weigh, dim=len(self._of_triangle), inputs=inputs, device=device)
        wp.launch(face_vertices, dim=len(outward), inputs=[self._of_vertex, away, outward], device=device)
