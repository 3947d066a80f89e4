"""Strains of a shape's edges and yarns, and the energies of its elements."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.base.quantiles import quantiles
from warp_cloth.kernels.base.options import Terms
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.certificate.energy import measure_bending_kernel, measure_tension_kernel, measure_weave_kernel
from warp_cloth.model.model import ClothModel
from warp_cloth.model.result import Strain


def strain_summary(strain: NDArray[Any]) -> Strain:
    """Percentiles of |strain| and the extremes of strain."""
    most, least = float(strain.max()), float(strain.min())
    p50, p99 = quantiles(np.abs(strain), 0.5, 0.99) if not math.isnan(most) else (most, most)
    return Strain(p50, p99, most, least)


@dataclass(frozen=True, eq=False)
class Strains:
    """Strains of a model's edges and stretches of its yarns, in the device's precision: half the bytes of float64."""

    edge: NDArray[Any]  # strain (r - L) / L, shape [E]
    stretch: NDArray[Any]  # r / L of every woven triangle along weft, warp and both biases, shape [T, 4]

    def of_yarns(self, some: slice = slice(None)) -> NDArray[Any]:
        """Strains of woven triangles along weft, warp and both biases, shape [4, N], exact as in float64."""
        own = np.ascontiguousarray(self.stretch[some].T)
        if own.size and not (own.min() >= 0.5 and own.max() <= 2.0):  # within, subtracting 1 is exact (Sterbenz)
            own = own.astype(np.float64)
        return own - own.dtype.type(1.0)


def measured_strains(model: ClothModel) -> Strains:
    """Strains of all edges and stretches of all woven triangles."""
    return Strains(_measure_tension(model)[1].numpy(), _measure_weave(model)[1].numpy().reshape(-1, 4))


def strain_kernels(precision: str, terms: Terms) -> list[wp.Kernel]:
    """The kernels that measure strains."""
    return [measure_tension_kernel(precision), measure_weave_kernel(precision, terms)]


def edge_strains(model: ClothModel) -> NDArray[np.float64]:
    """Strain (r - L) / L of every edge, shape [E]."""
    return _measure_tension(model)[1].numpy().astype(np.float64)


def yarn_summaries(strain: NDArray[Any]) -> dict[str, Strain]:
    """Strains along "warp", "weft" and both directions of the "bias" (``Strains.of_yarns``); empty if none is woven."""
    if not strain.size:
        return {}
    directions = {"warp": strain[1], "weft": strain[0], "bias": strain[2:].ravel()}
    return {name: strain_summary(along) for name, along in directions.items()}


def strain_bytes(model: ClothModel) -> int:
    """Memory [bytes] that strains take while they are measured."""
    types = cloth_types(model.precision)
    energy, real, vec4 = (wp.types.type_size_in_bytes(kind) for kind in (wp.float64, types.real, types.vec4))
    return max((energy + real) * model.edge_count, (energy + vec4) * model.weave_count)


def element_energies(model: ClothModel) -> tuple[NDArray[np.float64], ...]:
    """Energies [J] of every edge, shape [E], hinge, shape [H], and woven triangle, shape [T]."""
    fold = wp.zeros(model.hinge_count, dtype=wp.float64, device=model.device)
    if model.hinges is not None:
        kernel = measure_bending_kernel(model.precision, model.terms)
        wp.launch(kernel, dim=model.hinge_count, inputs=[model.state, model.hinges, fold], device=model.device)
    return _measure_tension(model)[0].numpy(), fold.numpy(), _measure_weave(model)[0].numpy()


def _measure_weave(model: ClothModel) -> tuple[wp.array, wp.array]:
    """Energy [J] and stretches of every woven triangle."""
    energy = wp.zeros(model.weave_count, dtype=wp.float64, device=model.device)
    stretch = wp.zeros(model.weave_count, dtype=cloth_types(model.precision).vec4, device=model.device)
    if model.weave is not None:
        kernel = measure_weave_kernel(model.precision, model.terms)
        wp.launch(
            kernel, dim=model.weave_count, inputs=[model.state, model.weave, energy, stretch], device=model.device
        )
    return energy, stretch


def _measure_tension(model: ClothModel) -> tuple[wp.array, wp.array]:
    """Energy [J] and strain of every edge."""
    energy = wp.zeros(model.edge_count, dtype=wp.float64, device=model.device)
    strain = wp.zeros(model.edge_count, dtype=cloth_types(model.precision).real, device=model.device)
    wp.launch(
        measure_tension_kernel(model.precision),
        dim=model.edge_count,
        inputs=[model.state, model.edges, energy, strain],
        device=model.device,
    )
    return energy, strain
