"""The linear system of an implicit step, A x = b, its constraints, and what conjugate gradients write.

A = inertia + drag + sum over pairs of S_ij, b the forces, on what contact, friction and pins leave free. A constrained
vertex is filtered, not eliminated: every product and every correction drops what it may not do (Baraff and Witkin,
"Large Steps in Cloth Simulation", 1998, modified preconditioned conjugate gradients).
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.elements.stiffness import stiffness_types

# What contact, friction and pins leave of a vertex's freedom: all, all but its normal, nothing.
FREE, SLIDING, FIXED = wp.constant(0), wp.constant(1), wp.constant(2)


@functools.cache
def system_types(precision: str) -> SimpleNamespace:
    """Structs ``LinearSystem``, ``SolutionState`` and ``ImplicitState``."""
    types, own = cloth_types(precision), stiffness_types(precision)
    real, vec3 = types.real, types.vec3

    @wp.struct
    class LinearSystem:
        """A and b of one step; V vertices, N pairs, G garments."""

        garment: wp.array(dtype=wp.int32)  # of each vertex, shape [V]
        row_start: wp.array(dtype=wp.int32)  # first coupling of each vertex, shape [V + 1]
        neighbour: wp.array(dtype=wp.int32)  # the pair's other vertex, shape [2 N]
        coupling: wp.array(dtype=own.mat3)  # S_ij [N/m], shape [2 N]
        inertia: wp.array(dtype=real)  # weight over the free fall, and more where it oscillates [N/m], shape [V]
        anchor: wp.array(dtype=own.vec6)  # stiffness against the world: inertia, drag, constraint [N/m], shape [V]
        inverse: wp.array(dtype=own.vec6)  # of each vertex's own block of A [m/N], shape [V]
        constraint: wp.array(dtype=wp.int32)  # FREE, SLIDING or FIXED, shape [V]
        normal: wp.array(dtype=vec3)  # of the avatar where the vertex touches it, else zero, shape [V]
        gap: wp.array(dtype=real)  # from the contact offset to the vertex [m], shape [V]
        drag: wp.array(dtype=real)  # with which friction resists its displacement there [N/m], shape [V]
        force: wp.array(dtype=vec3)  # b [N], shape [V]

    @wp.struct
    class SolutionState:
        """What conjugate gradients write; V vertices."""

        displacement: wp.array(dtype=vec3)  # x [m], shape [V]
        residual: wp.array(dtype=vec3)  # r = b - A x [N], shape [V]
        correction: wp.array(dtype=vec3)  # z = B r, by the preconditioner [m], shape [V]
        direction: wp.array(dtype=vec3)  # p [m], shape [V]
        product: wp.array(dtype=vec3)  # A p [N], shape [V]

    @wp.struct
    class ImplicitState:
        """What one implicit step leaves to the next; V vertices, G garments."""

        free_fall: wp.array(dtype=real)  # how far its own weight alone moves a vertex in a step [m], shape [G]
        in_contact: wp.array(dtype=wp.uint8)  # 1: contact acted on the vertex's last displacement, shape [V]
        damps_snapping: wp.bool  # whether inertia follows oscillation at once (adaptive_inertia)
        step_fraction: real  # of the solution that a step takes under Nesterov momentum; 0: without it
        momentum: wp.array(dtype=real)  # Nesterov's, of each garment, shape [G]
        extrapolation: wp.array(dtype=vec3)  # from the last step's end to where forces are taken [m], shape [V]

    return SimpleNamespace(LinearSystem=LinearSystem, SolutionState=SolutionState, ImplicitState=ImplicitState)


@wp.func
def filtered(v: Any, normal: Any, constraint: int):
    """What a constraint leaves of a force or displacement: v if FREE, v - n (n . v) if SLIDING, zero if FIXED."""
    result = v
    if constraint == SLIDING:
        result = v - normal * wp.dot(v, normal)
    if constraint == FIXED:
        result = type(v)()
    return result
