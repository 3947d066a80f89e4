"""Threads of a woven triangle: the paper's tension law (section 2.2 a) along the cloth's own directions.

An edge pulls along itself, so a mesh of edges is stiff where its edges happen to run. A woven triangle carries threads
along weft, warp and both biases instead. A thread is an edge whose ends are fixed to the triangle: a unit of cloth
along it has become the vector t, and area times the law of ``tension`` acts on |t| against 1.

E = A sum over threads of K/3 | |t| - 1 |^3 (times c where |t| < 1); exact for any triangle, whatever the mesh.
"""

from typing import Any

import warp as wp

from warp_cloth.kernels.laws.tension import tension_energy
from warp_cloth.kernels.math.packet import alike, differences, least, most, part, products, scaled, sizes, sums, times
from warp_cloth.kernels.math.real import chosen, inverses, roots, scaled_sum

SHORTEST = wp.constant(1.0e-20)  # of a thread that has collapsed; what divides by it stays finite
FAINTEST = wp.constant(1.0e-30)  # bound of stiffness [J]; likewise


@wp.func
def weft_vector(slope: Any, side_1: Any, side_2: Any):
    """What a unit of cloth along the weft has become; sides are those from the triangle's first corner."""
    return scaled_sum(side_2, part(slope, 1), scaled(side_1, part(slope, 0)))


@wp.func
def warp_vector(slope: Any, side_1: Any, side_2: Any):
    """What a unit of cloth along the warp has become."""
    return scaled_sum(side_2, part(slope, 3), scaled(side_1, part(slope, 2)))


@wp.func
def stretched_pulls(length: Any, stretch: Any, change: Any, pull: Any, push: Any, reach: Any):
    """Pulls of four threads over their lengths, per unit of their corners' slopes [J], and bounds of stiffness [J].

    The law is that of ``tension``, for all four at a time: processors that can do so in one go, do.

    Args:
        length: of the threads.
        stretch: how much longer than 1 they are.
        change: square of what the corners' last displacements changed the threads by.
        pull: K A [J].
        push: that where they are shorter than 1.
        reach: how many such changes the bound allows for.
    """
    far = times(roots(change), reach)
    size = sizes(stretch)
    inverse = inverses(most(length, alike(length, type(reach)(SHORTEST))))
    along = products(products(chosen(stretch, pull, push), products(stretch, size)), inverse)
    bound = products(chosen(sums(stretch, far), pull, push), sums(size, far))
    return along, sums(bound, bound)


@wp.func
def thread_pulls(square: Any, change: Any, pull: Any, push: Any, reach: Any):
    """``stretched_pulls`` by the squares of the threads' lengths."""
    length = roots(square)
    return stretched_pulls(length, differences(length, alike(length, type(reach)(1.0))), change, pull, push, reach)


@wp.func
def thread_shares(square: Any, change: Any, along: Any, bound: Any, horizon: Any):
    """``tension.share_across`` of four threads, and the inverses of their lengths.

    Args:
        square: of their lengths.
        change: square of what the corners' last displacements changed the threads by.
        along: their pulls over their lengths, and
        bound: the bounds of their stiffness, both of ``thread_pulls``.
        horizon: how many such changes ahead they may turn.
    """
    inverse = inverses(most(roots(square), alike(square, type(horizon)(SHORTEST))))
    turn = products(times(roots(change), horizon), inverse)
    stiffness = most(bound, alike(bound, type(horizon)(FAINTEST)))
    share = sums(products(sizes(along), inverses(stiffness)), products(turn, turn))
    return least(share, alike(share, type(horizon)(1.0))), inverse


@wp.func
def thread_energy(thread: Any, pull: Any, push: Any):
    """Energy of a thread [J], K A / 3 | |t| - 1 |^3."""
    return tension_energy(wp.length(thread), type(pull)(1.0), pull, push)


@wp.func
def slope_shares(slope_1: Any, slope_2: Any):
    """Twice the share of a thread's stiffness that each corner bears [1/m2]: |b_i| (|b_0| + |b_1| + |b_2|).

    b are the corners' slopes, with b_0 = -b_1 - b_2. A thread that runs along an edge of length L gives 1 / L^2 to
    both its ends, as the edge itself would.
    """
    size_0, size_1, size_2 = sizes(sums(slope_1, slope_2)), sizes(slope_1), sizes(slope_2)
    sum = sums(sums(size_0, size_1), size_2)
    return products(sum, size_0), products(sum, size_1), products(sum, size_2)
