"""What a fit came to: the sentence that tells it, and the report's figures under their stable keys."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_cloth.base.connected import lowest_connected
from warp_cloth.fitting.plan import make_plan
from warp_cloth.loading.raw import counted
from warp_cloth.model.result import Penetration, Status, Strain
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.loop import Outcome

if TYPE_CHECKING:
    from warp_cloth.base.mesh import Points
    from warp_cloth.contact.garments import GarmentCrossings
    from warp_cloth.fitting.nested_iteration import LevelRun
    from warp_cloth.garment.outfit import Outfit
    from warp_cloth.scene import Scene


FAR_FROM_REST = 0.02  # [m]; what is farther than that from rest still falls or slides as a whole
SHOWN = 1.0  # [mm]; what shows less of itself is not seen
HIDDEN = 5.0  # [mm]; where a hundredth of the skin is farther off than that, cloth hangs on what is not there
BELOW = 0.15  # share of a garment that has come down below all of the avatar; less is a train, or a long hem
HANGING = 0.5  # share of the avatar's height: what reaches up farther hangs there, as a gown, or a cloth over a ball
FALLEN = 0.1  # [m]; a piece of a garment that comes down farther than the largest piece has come off
CROSSED = 0.05  # share of faces that pass through others; of a T-shirt's, creased at the armpits, 0.03 do
FINE, STIFF = 20_000, 2e5  # vertices, and stretch [N/m], from which on the default method takes long
OTHER_SIZE = 0.3  # strain of half the edges: the tightest of worn cloth has less


def figure(value: float | None, digits: int = 3) -> str:
    """A number for people: no more digits than matter, and none as a power of ten where it is large."""
    if value is None or not math.isfinite(value):
        return "unknown"
    return f"{value:,.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"


def falls_as_a_whole(method: str, cloth_contact: bool, rest_error: float | None) -> bool:
    """Whether a fit that ran out of iterations would come down sooner by the multilevel method; rest error [m]."""
    known = rest_error is not None and math.isfinite(rest_error)
    return method == "accelerated" and not cloth_contact and known and float(rest_error or 0.0) > FAR_FROM_REST


def fine_or_stiff(vertex_count: int, stretches: Iterable[float], method: str, cloth_contact: bool) -> bool:
    """Whether a fit is one of those that come to rest sooner by the multilevel method.

    ``vertex_count`` of all its garments, ``stretches`` of their threads [N/m].
    """
    wanted = vertex_count > FINE or max(stretches) > STIFF
    return wanted and method == "accelerated" and not cloth_contact


def more_iterations(scene: Scene, outcome: Outcome) -> str:
    """What to change where a fit only needs longer."""
    if scene.solver.method == "direct":
        return 'use solver.method = "accelerated"'
    if falls_as_a_whole(scene.solver.method, scene.collision.cloth, outcome.check.rest_error):
        return 'use solver.method = "multilevel", by which loose garments fall as a whole, or raise solver.iterations'
    threads = [thread for spec in scene.garments for thread in (spec.fabric.stretch_warp, spec.fabric.stretch_weft)]
    if fine_or_stiff(len(outcome.points), threads, scene.solver.method, scene.collision.cloth):
        return 'use solver.method = "multilevel", made for fine meshes and stiff cloth, or raise solver.iterations'
    return "raise solver.iterations"


def unheld(scene: Scene, outfit: Outfit, worn: Sequence[Points]) -> str:
    """What to change where a garment falls because nothing holds it; empty where all are held.

    ``worn`` are the garments' points [m], each shape [V, 3].
    """
    for spec, part, points in zip(scene.garments, outfit.parts, worn, strict=True):
        if len(part.pins):
            continue
        if outfit.avatar is None or scene.collision.avatar == "none":
            return f'nothing holds "{spec.name}": pin some of its vertices, or let it meet an avatar'
        low, high = outfit.avatar.bounds()
        beside = (points.min(axis=0) > high) | (points.max(axis=0) < low)
        if beside[0] or beside[2]:
            return f'"{spec.name}" is beside the avatar, which cannot hold it: place it round or above it'
        if points[:, 1].max() < low[1]:
            return f'"{spec.name}" has fallen past the avatar: place it round or above it, or pin some of its vertices'
    return ""


def slid_off(scene: Scene, outfit: Outfit, worn: Sequence[Points]) -> str:
    """What to change where a garment has come down to the avatar's feet; empty where all are held above.

    ``worn`` are the garments' points [m], each shape [V, 3].
    """
    if outfit.avatar is None:
        return ""
    floor, top = outfit.avatar.points[:, 1].min(), outfit.avatar.points[:, 1].max()
    for spec, part, points in zip(scene.garments, outfit.parts, worn, strict=True):
        if len(part.pins) or points[:, 1].max() > floor + HANGING * (top - floor):
            continue
        below, before = ((place[:, 1] < floor).mean() for place in (points, part.points))
        if below - before > BELOW:
            return (
                f'"{spec.name}" has slid down to the avatar\'s feet, and {100 * below:.0f} % of it hang below them, as '
                "there is no floor: it is too wide to be held; take a smaller one, or pin some of its vertices"
            )
    return ""


def fallen_pieces(scene: Scene, outfit: Outfit, worn: Sequence[Points]) -> str:
    """What to change where pieces of a garment that nothing joins to the rest fall off it; empty where none do.

    ``worn`` are the garments' points [m], each shape [V, 3].
    """
    for spec, part, points in zip(scene.garments, outfit.parts, worn, strict=True):
        a, b, c = part.triangles.T
        piece = lowest_connected(len(points), np.concatenate([a, b]), np.concatenate([b, c]))
        kinds, number, count = np.unique(piece, return_inverse=True, return_counts=True)
        if len(kinds) == 1 or not np.isfinite(points).all():
            continue
        fall = part.points[:, 1] - points[:, 1]
        least = np.full(len(kinds), np.inf)
        np.minimum.at(least, number, fall)
        fallen = int((least > np.median(fall[number == np.argmax(count)]) + FALLEN).sum())
        if fallen:
            return (
                f'{fallen} of the {len(kinds)} pieces of "{spec.name}" fall off, as nothing joins them to the others: '
                "leave buttons and the like out, or weld them on"
            )
    return ""


def drawn_through(edges: int, what: str) -> str:
    """How many edges of a garment are drawn through what it should lie on, as a clause."""
    return f"{counted(edges, 'edge')} {'is' if edges == 1 else 'are'} drawn through the {what}"


def misplaced(depth: Penetration | None) -> str:
    """What to change where a garment is drawn through the avatar; empty where it is not."""
    if depth is None or not depth.edges:
        return ""
    return (
        f"{drawn_through(depth.edges, 'avatar')}, {figure(depth.edge_max, 2)} mm deep, probably since part of the "
        "garment began on the wrong side of a limb: let avatar.mesh be in the pose that the garment is placed "
        "round, and avatar.poses be this one; or place panels that reach beyond another limb, as of wide trouser legs, "
        "clear of it"
    )


def too_coarse(depth: Penetration | None) -> str:
    """What to change where the avatar shows through large faces; empty where it does not, or other faults say more."""
    if depth is None or depth.edges or not depth.face_max > SHOWN:
        return ""
    return (
        f"the avatar shows through {counted(depth.faces, 'large face')}, by {figure(depth.face_max, 2)} mm: "
        "divide them to edges of 15 mm, or raise collision.offset_mm"
    )


def crossed(share: float, cloth_contact: bool) -> str:
    """What to change where a share of the faces passes through others, so large that folds are not those of cloth."""
    if cloth_contact or not share > CROSSED:
        return ""
    return (
        f"{100 * share:.0f} % of the faces pass through others: set collision.cloth = true, which takes about three "
        "times the iterations"
    )


def hidden(contact: Mapping[str, Any] | None, kind: str) -> str:
    """What to change where the avatar is drawn so that much of it is not where it is; empty where it is.

    ``contact`` is what the report says of it, ``kind`` the scene's collision.avatar.
    """
    error = (contact or {}).get("error_mm")
    if kind not in ("depth", "auto") or error is None or not error["p99"] > HIDDEN:
        return ""
    views = "the front, back and top view do not show all of" if kind == "depth" else "the buffers miss some of"
    return (
        f"{views} the avatar near the garment ({figure(error['p99'], 2)} mm off at the 99th percentile of its skin): "
        f'use collision.avatar = "{"auto" if kind == "depth" else "mesh"}"'
    )


def of_another_size(strain: Strain) -> str:
    """What to check where the rest shape is far from what is worn; empty where it is not."""
    if not strain.p50 > OTHER_SIZE:
        return ""
    return (
        f"half of the edges are {100 * strain.p50:.0f} % or more off their natural length: check garment.rest, "
        "garment.uv_units, and the garment's size against the avatar's"
    )


def verdict(outcome: Outcome, tolerance: Tolerance, advice: str, flaw: str = "") -> str:
    """How a fit ended and, where it ran out of iterations, what to change; ``flaw``: what is wrong though at rest."""
    residual = outcome.check.residual
    if outcome.status is Status.AT_REST:
        return (
            f"At rest after {outcome.iterations:,} iterations: forces balanced to "
            f"{100 * residual.relative_rms:.2g} %, {1e3 * outcome.check.rest_error:.2g} mm or less from the rest shape."
            + (f" But {flaw}." if flaw else "")
        )
    if outcome.status is Status.DIVERGED:
        return (
            f"The numbers left the range of their precision after {outcome.check.iteration:,} iterations; this is the "
            'last finite shape. Use a smaller solver.cap, a softer fabric, or solver.precision = "float64".'
        )
    misses = []
    if not residual.relative_rms <= tolerance.relative_rms:
        misses.append(f"relative residual {figure(residual.relative_rms, 2)} (wanted {tolerance.relative_rms:g})")
    if not residual.relative_p99 <= tolerance.relative_p99:
        misses.append(f"its 99th percentile {figure(residual.relative_p99, 2)} (wanted {tolerance.relative_p99:g})")
    if not outcome.check.rest_error <= tolerance.rest_error:
        far = figure(1e3 * outcome.check.rest_error, 2)
        misses.append(f"rest error {far}{' mm' * (far != 'unknown')} (wanted {1e3 * tolerance.rest_error:g} mm)")
    if not outcome.check.growing <= tolerance.growing:
        misses.append(f"folds still move faster and faster ({figure(1e3 * outcome.check.growing, 2)} mm at a look)")
    return f"Not at rest after {outcome.iterations:,} iterations: {', '.join(misses)}; {advice}."


def report_of(
    scene: Scene,
    outfit: Outfit,
    outcome: Outcome,
    *,
    message: str,
    loss: str,
    seconds: dict[str, float],
    device: str,
    strain: Strain,
    threads: Mapping[str, Strain],
    depth: Penetration | None,
    crossing: GarmentCrossings,
    contact: dict[str, Any] | None,
    levels: Sequence[LevelRun],
) -> dict[str, Any]:
    """The report under its stable keys; lengths as their names say. ``loss`` says what the avatar does not hold.

    ``strain`` is that of edges; ``threads`` those along "warp", "weft" and "bias", of woven garments only.
    """
    relaxing = seconds["relax"]
    topologies = [part.rest.topology for part in outfit.parts]
    return {
        "status": outcome.status.value,
        "message": message,
        "unheld": loss or None,
        "vertices": sum(len(part.points) for part in outfit.parts),
        "faces": sum(len(part.triangles) for part in outfit.parts),
        "edges": sum(len(topology.edges) for topology in topologies),
        "hinges": sum(len(topology.hinges) for topology in topologies),
        "iterations": outcome.iterations,
        "levels": [{**asdict(level), "status": level.status.value} for level in levels],
        "seconds": seconds,
        "iterations_per_second": outcome.iterations / relaxing if relaxing > 0.0 else None,
        "device": device,
        "precision": scene.solver.precision,
        "residual": asdict(outcome.check.residual),
        "rest_error_mm": 1e3 * outcome.check.rest_error,
        "growing_mm": 1e3 * outcome.check.growing,
        "strain": {**asdict(strain), **{way: asdict(found) for way, found in threads.items()}},
        "penetration_mm": asdict(depth) if depth is not None else None,
        "crossings": {"pairs": crossing.pairs, "between_garments": crossing.between, "faces": crossing.face_count},
        "contact": contact,
        "garments": [
            {
                "name": spec.name,
                "unit": mesh.unit,
                "area_m2": part.rest.area,
                "pinned": len(part.pins),
                "notes": [*mesh.notes, *part.rest.notes],
                "crossing_faces": faces.tolist(),
            }
            for spec, mesh, part, faces in zip(
                scene.garments, outfit.garments, outfit.parts, crossing.faces, strict=True
            )
        ],
        "avatar": {"unit": outfit.avatar.unit, "notes": list(outfit.avatar.notes)} if outfit.avatar else None,
        "plan": [asdict(term) for term in make_plan(scene, outfit)],
        "settings": scene.settings(),
    }
