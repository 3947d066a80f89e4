"""Threads of a woven triangle: the paper's tension law (section 2.2 a) along the cloth's own directions.

An edge pulls along itself, so a mesh of edges is stiff where its edges happen to run. A woven triangle carries threads
along weft, warp and both biases instead. A thread is an edge whose ends are fixed to the triangle: a unit of cloth
along it has become the vector t, and area times the law of ``tension`` acts on |t| against 1.

E = A sum over threads of K/3 | |t| - 1 |^3 (times c where |t| < 1); exact for any triangle, whatever the mesh.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.arithmetic import quotient, root
from warp_cloth.kernels.tension import tension_energy, tension_force, tension_stiffness

SHORTEST = wp.constant(1.0e-20)  # of a thread that has collapsed; what divides by it stays finite


@wp.func
def weft_vector(slope: Any, side_1: Any, side_2: Any):
    """What a unit of cloth along the weft has become; sides are those from the triangle's first corner."""
    return side_1 * slope[0] + side_2 * slope[1]


@wp.func
def warp_vector(slope: Any, side_1: Any, side_2: Any):
    """What a unit of cloth along the warp has become."""
    return side_1 * slope[2] + side_2 * slope[3]


@wp.func
def thread_pull(thread: Any, change: Any, pull: Any, push: Any, reach: Any, viscosity: Any):
    """Pull of a thread on the corners, per unit of their slopes [J], and the bound of its stiffness [J].

    ``change`` is what the corners' last displacements changed the thread by. ``viscosity``, part of the accelerated
    step, resists it as ``tension.edge_drag`` does; with 0 the pull is minus the gradient of ``thread_energy``.
    """
    one = type(pull)(1.0)
    length = root(wp.dot(thread, thread))
    stiffness = tension_stiffness(length, one, pull, push, reach * root(wp.dot(change, change)))
    along = quotient(tension_force(length, one, pull, push), wp.max(length, type(pull)(SHORTEST)))
    return change * (stiffness * viscosity) + thread * along, stiffness


@wp.func
def thread_energy(thread: Any, pull: Any, push: Any):
    """Energy of a thread [J], K A / 3 | |t| - 1 |^3."""
    return tension_energy(wp.length(thread), type(pull)(1.0), pull, push)


@wp.func
def slope_shares(slope_1: Any, slope_2: Any):
    """Share of a thread's stiffness that each corner bears [1/m2]: |b_i| (|b_0| + |b_1| + |b_2|) / 2.

    b are the corners' slopes, with b_0 = -b_1 - b_2. A thread that runs along an edge of length L gives 1 / L^2 to
    both its ends, as the edge itself would.
    """
    size_0 = wp.abs(slope_1 + slope_2)
    size_1 = wp.abs(slope_1)
    size_2 = wp.abs(slope_2)
    half = (size_0 + size_1 + size_2) * type(slope_1)(0.5)
    return half * size_0, half * size_1, half * size_2
