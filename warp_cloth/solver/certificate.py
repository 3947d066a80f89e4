"""The certificate of rest: residual, rest error, strain (model: rest: a certificate, not a guess)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_cloth.kernels.certify import bending_energy_kernel, energy_kernels, residual_kernel
from warp_cloth.kernels.cloth import cloth_types
from warp_cloth.kernels.pressure import push_kernel
from warp_cloth.mesh import Points
from warp_cloth.model import ClothModel
from warp_cloth.result import Residual, Strain
from warp_cloth.solver.forces import ForcePass
from warp_cloth.solver.relax import Collider, Relaxation
from warp_cloth.solver.rest_error import RestError

# A vertex at rest on the avatar stands at the contact offset to within the rounding of a float32 distance and one
# iteration's fall; this far above it still counts as held.
CONTACT_SLACK = 2e-5  # [m]


@dataclass(frozen=True)
class Tolerance:
    """When a shape counts as at rest. All three must hold.

    relative_rms: 1 % of the forces that meet at a vertex is what a laboratory's tensile test resolves.
    relative_p99: single vertices at folds may be five times worse.
    rest_error: 1 mm is below what a fitting shows.
    """

    relative_rms: float = 0.01
    relative_p99: float = 0.05
    rest_error: float = 1e-3  # [m]


@dataclass(frozen=True)
class Check:
    """The certificate's figures after some iterations."""

    iteration: int
    residual: Residual
    rest_error: float  # [m]; inf while nothing is known of it
    finite: bool

    def within(self, tolerance: Tolerance) -> bool:
        """Whether this is rest."""
        return (
            self.finite
            and self.residual.relative_rms <= tolerance.relative_rms
            and self.residual.relative_p99 <= tolerance.relative_p99
            and self.rest_error <= tolerance.rest_error
        )


class Certifier:
    """Measures a relaxation's shape with the forces and the contact that its iterations use."""

    def __init__(self, relaxation: Relaxation, collider: Collider) -> None:
        model = relaxation.model
        types = cloth_types(model.precision)
        self._model = model
        self._step = relaxation.step
        self._touch = relaxation.touch
        self._collider = relaxation.collider_data
        self._load = wp.zeros(model.vertex_count, dtype=types.vec4, device=model.device)
        self._forces = ForcePass(model, "size", self._load)
        self._residual = residual_kernel(model.precision, collider.contact, relaxation.collider_type)
        self._contact = (collider.contact, relaxation.collider_type)
        self._left = wp.zeros(model.vertex_count, dtype=wp.vec2f, device=model.device)
        self._rest_error = RestError()

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a check launches."""
        return [*self._forces.kernels(), self._residual]

    def meet(self, collider: Collider) -> None:
        """Goes on with this collider; it must be of the kind that the certifier was made with."""
        if collider.data is not None:
            self._collider = collider.data

    def check(self, iteration: int, points: Points) -> Check:
        """Measures the shape as it stands, which is ``points`` [m], shape [V, 3]. Waits for the device."""
        model = self._model
        self._sum_forces()
        wp.launch(
            self._residual,
            dim=model.vertex_count,
            inputs=[self._step, CONTACT_SLACK, self._collider, model.cloth, self._load, self._left],
            device=model.device,
        )
        left = self._left.numpy()
        finite = bool(np.isfinite(points).all() and np.isfinite(left).all())
        if not finite:
            return Check(iteration, Residual(*([math.inf] * 5)), math.inf, False)
        return Check(iteration, residual_summary(left), self._rest_error.estimate(iteration, points), True)

    def _sum_forces(self) -> None:
        self._forces.launch(self._step)
        if self._touch is not None:
            self._touch.measure(self._step, self._load)

    def pushes(self) -> NDArray[np.float64] | None:
        """Force with which each vertex presses on the avatar [N], shape [V]; None without contact. Waits."""
        model = self._model
        if self._contact[0] is None:
            return None
        self._sum_forces()
        push = wp.zeros(model.vertex_count, dtype=wp.float64, device=model.device)
        wp.launch(
            push_kernel(model.precision, *self._contact),
            dim=model.vertex_count,
            inputs=[self._step, CONTACT_SLACK, self._collider, model.cloth, self._load, push],
            device=model.device,
        )
        return np.array(push.numpy())


def residual_summary(left: NDArray[np.float32]) -> Residual:
    """Summary over free vertices; ``left`` [V, 2] holds weights and relative, -1 where pinned."""
    free = left[left[:, 0] >= 0.0].astype(np.float64)
    if not len(free):
        return Residual(0.0, 0.0, 0.0, 0.0, 0.0)
    rms, relative_rms = np.sqrt(np.mean(free**2, axis=0))
    p99, relative_p99 = np.quantile(free, 0.99, axis=0)
    return Residual(float(rms), float(p99), float(free[:, 0].max()), float(relative_rms), float(relative_p99))


def strain_summary(strain: NDArray[np.float64]) -> Strain:
    """Percentiles of |strain| and the extremes of strain."""
    size = np.abs(strain)
    p50, p99 = np.quantile(size, [0.5, 0.99])
    return Strain(float(p50), float(p99), float(strain.max()), float(strain.min()))


def edge_strains(model: ClothModel) -> NDArray[np.float64]:
    """Strain (r - L) / L of every edge, shape [E]."""
    return _measure_tension(model)[1]


def thread_strains(model: ClothModel) -> NDArray[np.float64]:
    """Strain of every woven triangle along weft, warp and both biases, shape [T, 4]."""
    return _measure_weave(model)[1]


def thread_summaries(model: ClothModel) -> dict[str, Strain]:
    """Strains of woven triangles along "warp", "weft" and both ways of the "bias"; empty where nothing is woven."""
    if model.weave is None:
        return {}
    strain = thread_strains(model)
    ways = {"warp": strain[:, 1], "weft": strain[:, 0], "bias": strain[:, 2:].ravel()}
    return {way: strain_summary(along) for way, along in ways.items()}


def element_energies(model: ClothModel) -> tuple[NDArray[np.float64], ...]:
    """Energy of every edge, shape [E], hinge, shape [H], and woven triangle, shape [T] [J]."""
    fold = wp.zeros(model.hinge_count, dtype=wp.float64, device=model.device)
    if model.hinges is not None:
        kernel = bending_energy_kernel(model.precision, model.terms.angles)
        wp.launch(kernel, dim=model.hinge_count, inputs=[model.cloth, model.hinges, fold], device=model.device)
    return _measure_tension(model)[0], np.array(fold.numpy()), _measure_weave(model)[0]


def _measure_weave(model: ClothModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    energy = wp.zeros(model.weave_count, dtype=wp.float64, device=model.device)
    strain = wp.zeros(model.weave_count, dtype=wp.vec4d, device=model.device)
    if model.weave is not None:
        kernel = energy_kernels(model.precision).measure_weave
        wp.launch(kernel, dim=model.weave_count, inputs=[model.cloth, model.weave, energy, strain], device=model.device)
    return np.array(energy.numpy()), np.array(strain.numpy()).reshape(-1, 4)


def _measure_tension(model: ClothModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    energy = wp.zeros(model.edge_count, dtype=wp.float64, device=model.device)
    strain = wp.zeros(model.edge_count, dtype=wp.float64, device=model.device)
    wp.launch(
        energy_kernels(model.precision).measure_tension,
        dim=model.edge_count,
        inputs=[model.cloth, model.edges, energy, strain],
        device=model.device,
    )
    return np.array(energy.numpy()), np.array(strain.numpy())
