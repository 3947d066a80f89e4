"""The status sentence of a fit: how it ended and, where that is not at rest or not right, what to change."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from warp_cloth.model.result import Status
from warp_cloth.report.faults import (
    coarse_faces,
    crossing_faces,
    detached_pieces,
    pierced_avatar,
    slid_off,
    unheld,
    unseen_avatar,
    wrong_size,
)
from warp_cloth.report.numbers import short_number

if TYPE_CHECKING:
    from warp_cloth.base.mesh import Points
    from warp_cloth.garment.outfit import Outfit
    from warp_cloth.report.measurements import Measurements
    from warp_cloth.scene import Scene
    from warp_cloth.solver.certificate.certifier import Tolerance
    from warp_cloth.solver.loop import Outcome

FAR_FROM_REST = 0.02  # [m]; with a larger rest error a garment still falls or slides as a whole
FINE, STIFF = 20_000, 2e5  # vertices, and stretch [N/m], from which on the default method is slow


def status_sentence(
    scene: Scene,
    outfit: Outfit,
    outcome: Outcome,
    measured: Measurements,
    worn: Sequence[Points],
    tolerance: Tolerance,
) -> tuple[str, str]:
    """The sentence, and the clause about a garment that nothing holds (empty where all are held).

    ``worn`` are the garments' points [m], each shape [V, 3].
    """
    kind = scene.collision.avatar
    depth = measured.penetration if kind != "none" else None
    loss = slid_off(scene, outfit, worn)
    if outcome.status is not Status.AT_REST:  # a garment that still falls is not at rest
        loss = unheld(scene, outfit, worn) or loss or detached_pieces(scene, outfit, worn)
    causes = [loss] if loss else [pierced_avatar(depth), wrong_size(measured.strain)]
    others = [unseen_avatar(measured.contact, kind), coarse_faces(depth)]
    if not any(causes):
        faces = sum(len(garment.triangles) for garment in outfit.garments)
        others.append(crossing_faces(measured.crossings.face_count / faces, scene.collision.cloth))
    longer = [] if any(causes) else [more_iterations(scene, outcome)]
    remedy, fault = ("; and ".join(filter(None, clauses)) for clauses in ([*causes, *longer, *others], causes + others))
    return sentence_of(outcome, tolerance, remedy, fault), loss


def sentence_of(outcome: Outcome, tolerance: Tolerance, remedy: str, fault: str = "") -> str:
    """How a fit ended; ``remedy`` follows where it ran out of iterations, ``fault`` where it is at rest but wrong."""
    check, residual = outcome.check, outcome.check.residual
    if outcome.status is Status.AT_REST:
        return (
            f"At rest after {outcome.iterations:,} iterations: forces balance to {100 * residual.relative_rms:.2g} %, "
            f"and the shape is within {1e3 * check.rest_error:.2g} mm of its rest shape."
            + (f" But {fault}." if fault else "")
        )
    if outcome.status is Status.DIVERGED:
        return (
            f"Diverged after {check.iteration:,} iterations, beyond the range of the precision; this is the last "
            'finite shape. Use a smaller solver.cap, a softer fabric, or solver.precision = "float64".'
        )
    misses = []
    if not residual.relative_rms <= tolerance.relative_rms:
        misses.append(f"relative residual {short_number(residual.relative_rms, 2)} (limit {tolerance.relative_rms:g})")
    if not residual.relative_p99 <= tolerance.relative_p99:
        p99 = short_number(residual.relative_p99, 2)
        misses.append(f"its 99th percentile {p99} (limit {tolerance.relative_p99:g})")
    if not check.rest_error <= tolerance.rest_error:
        error = short_number(1e3 * check.rest_error, 2)
        misses.append(f"rest error {error}{' mm' * (error != 'unknown')} (limit {1e3 * tolerance.rest_error:g} mm)")
    if not check.growing <= tolerance.growing:
        misses.append(f"some folds still move faster at every check ({short_number(1e3 * check.growing, 2)} mm)")
    return f"Not at rest after {outcome.iterations:,} iterations: {', '.join(misses)}; {remedy}."


def more_iterations(scene: Scene, outcome: Outcome) -> str:
    """The remedy where a fit only needs more iterations, or a faster method."""
    method, cloth = scene.solver.method, scene.collision.cloth
    if method == "direct":
        return 'use solver.method = "accelerated"'
    if falls_as_a_whole(method, cloth, outcome.check.rest_error):
        return 'use solver.method = "multilevel", which moves loose garments as a whole, or raise solver.iterations'
    stretches = [value for spec in scene.garments for value in (spec.fabric.stretch_warp, spec.fabric.stretch_weft)]
    if fine_or_stiff(len(outcome.points), stretches, method, cloth):
        return (
            'use solver.method = "multilevel", which is faster for fine meshes and stiff cloth, or raise '
            "solver.iterations"
        )
    return "raise solver.iterations"


def falls_as_a_whole(method: str, cloth_contact: bool, rest_error: float | None) -> bool:
    """Whether a fit that ran out of iterations would come down sooner by the multilevel method; rest error [m]."""
    known = rest_error is not None and math.isfinite(rest_error)
    return method == "accelerated" and not cloth_contact and known and float(rest_error or 0.0) > FAR_FROM_REST


def fine_or_stiff(vertex_count: int, stretches: Iterable[float], method: str, cloth_contact: bool) -> bool:
    """Whether a fit comes to rest sooner by the multilevel method.

    ``vertex_count`` is that of all its garments, ``stretches`` are those of their yarns [N/m].
    """
    slow = vertex_count > FINE or max(stretches) > STIFF
    return slow and method == "accelerated" and not cloth_contact
