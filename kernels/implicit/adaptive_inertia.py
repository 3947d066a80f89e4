"""Adaptive inertia: a damping of implicit steps that grows where a vertex oscillates (Levenberg and Marquardt's idea).

A vertex whose force has turned against its last displacement went too far. Its inertia grows by a factor, up to a
fraction of the stiffness around it, and else decays again. Without this, wrinkles of stiff cloth oscillate for ever.
"""

import functools
from typing import Any

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types
from warp_cloth.kernels.implicit.system import system_types
from warp_cloth.kernels.math.symmetric import symmetric_times

GROWTH, DECAY = wp.constant(1.05), wp.constant(0.97)
LIMIT = wp.constant(0.02)  # of the block's trace

# Under Nesterov momentum a vertex oscillates where the force would take back more than this fraction of its
# displacement against the stiffness around it. Near rest the oscillation of others turns forces back and forth, and
# every vertex would get heavy: what still slides would then hardly move.
OSCILLATION = wp.constant(0.3)

# While folds still snap and slide (``damps_snapping``), inertia follows at once: a fold's tip that hits the avatar
# oscillates for ever otherwise. Not where cloth comes to rest: what is heavy would hold what has not arrived yet
# (66,000 vertices over a ball were certified 1.1 and 1.4 mm rms too early).
SNAPPING_GROWTH, SNAPPING_DECAY = wp.constant(1.5), wp.constant(0.8)
SNAPPING_LIMIT = wp.constant(0.5)
SNAPPING_OSCILLATION = wp.constant(0.1)


@wp.func
def adapt_inertia(implicit: Any, inertia: Any, displacement: Any, force: Any, block: Any):
    """A vertex's next inertia [N/m]: more where -F . d > threshold d . block d, else less; at most a limit.

    ``displacement`` d is the last one [m], ``force`` F the present one [N], ``block`` the stiffness around [N/m].
    """
    snapping = implicit.damps_snapping
    threshold = wp.where(snapping, type(inertia)(SNAPPING_OSCILLATION), type(inertia)(OSCILLATION))
    tolerated = type(inertia)(0.0)
    if implicit.step_fraction > type(inertia)(0.0):
        tolerated = threshold * wp.dot(displacement, symmetric_times(block, displacement))
    turned_back = wp.dot(displacement, force) < -tolerated
    growth = wp.where(snapping, type(inertia)(SNAPPING_GROWTH), type(inertia)(GROWTH))
    decay = wp.where(snapping, type(inertia)(SNAPPING_DECAY), type(inertia)(DECAY))
    limit = wp.where(snapping, type(inertia)(SNAPPING_LIMIT), type(inertia)(LIMIT)) * (block[0] + block[1] + block[2])
    return wp.min(inertia * wp.where(turned_back, growth, decay), limit)


@functools.cache
def grow_free_fall_kernel(precision: str) -> wp.Kernel:
    real, ImplicitState = cloth_types(precision).real, system_types(precision).ImplicitState

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def grow_free_fall(
        growth: real,
        limit: real,  # [m]
        implicit: ImplicitState,
    ):
        """Lets every garment fall further in its next step."""
        garment = wp.tid()
        implicit.free_fall[garment] = wp.min(implicit.free_fall[garment] * growth, limit)

    return grow_free_fall
