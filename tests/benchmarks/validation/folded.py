"""A strip folded over on a plane: both ends are held together there, and its loop lies on the plane beyond them.

From the lower end the strip lies flat up to s = a. There it lifts off without a moment, goes round, comes back over
itself and meets its other end from above. The plane has no friction. a is unknown, as H and V at lift-off are:

    x = a, z = theta = M = 0 at s = a        x = z = 0, theta = pi at the end

A strip whose upper limb just lay on its lower one would need friction to rest: cloth has a thickness t, and each length
that rolls from the upper limb to the lower one gives back w t.

Strips relax until they pass the tolerance of the other cases, or for LIMIT iterations, and count as at rest by the
program's own tolerance: along the line where the strip lifts off, vertices touch the plane and leave it by micrometres
as long as it relaxes, and what is left of the forces there (rows ``residual``) is above the other cases' tolerance.

python tests/benchmarks/validation/folded.py --per-length 5 10 20
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from multiprocessing import get_context

import numpy as np
from elastica import LENGTH, Floats, Shape, curvature, line
from scipy.integrate import solve_bvp
from scipy.optimize import fsolve
from strips import FABRIC, LIMIT, MESHES, TIGHT, WIDTH, C, Figures, irregular_strip, report, script_parser

from warp_cloth.avatar.collider import Collider
from warp_cloth.avatar.exact import build_exact_collider
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.bench.specimen import Specimens, piece
from warp_cloth.bench.swatch import strip as regular_strip
from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.step_options import StepOptions

SPANS = (6.0, 5.0)  # from end to end, in l; beyond 7.4 the upper limb would sag onto the lower one
FIRST = 7.0  # the span that the solver starts with, under little weight
FLAT = 0.25  # of the strip, at first
UNIT = LENGTH * C  # l [m]
PLANE = 0.5  # half of the plane's side [m]


@dataclass(frozen=True, eq=False)
class Fold:
    """A folded strip's line, and how much of it lies flat, in l."""

    shape: Shape
    flat: float


def figures(shape: Shape) -> dict[str, float]:
    """How high the fold is, and how far it reaches from the ends."""
    return {"height": float(shape.z.max()), "reach": float(shape.x.max())}


def guess(span: float) -> tuple[Floats, Floats]:
    """A line over the plane that closes: length along it from where it lifts off, and angle.

    The angle grows smoothly past pi and comes back to it; how far past, and where, is what closes the line.
    """
    t = np.linspace(0.0, 1.0, 401)

    def smooth(part: Floats) -> Floats:
        part = np.clip(part, 0.0, 1.0)
        return np.asarray(part * part * (3.0 - 2.0 * part))

    def angle(shape: Floats) -> Floats:
        past, where = shape
        return np.asarray((np.pi + past) * smooth(t / where) - past * smooth((t - where) / (1.0 - where)))

    def open_by(shape: Floats) -> list[float]:
        x, z = (float(np.trapezoid(each(angle(shape)), t)) for each in (np.cos, np.sin))
        return [FLAT + (1.0 - FLAT) * x, z]

    return FLAT * span + (1.0 - FLAT) * span * t, angle(fsolve(open_by, [0.9, 0.7]))


def solve(spans: tuple[float, ...], power: float = 0.5) -> list[Fold]:
    """The lines at rest, each from the one before; the first from one under little weight.

    Raises:
        RuntimeError: the solver finds none, or one that passes through the plane.
    """
    s, angle = guess(FIRST)
    start, moment = line(s, angle), np.gradient(angle, s)
    t, unknown = (s - s[0]) / (FIRST - s[0]), np.array([0.0, -1.0, s[0]])  # H, V and a
    state = np.stack([s[0] + start.x, start.z, angle, moment * np.abs(moment)])
    if power == 1.0:
        state[3] = moment * LENGTH**-3
    folds: list[Fold] = []
    nearer = (np.linspace(one, other, 5)[1:] for one, other in pairwise((FIRST, *spans)))
    steps = [(FIRST, 0.3), (FIRST, 0.6), *((float(span), 1.0) for part in nearer for span in part)]
    for span, weight in steps:

        def change(at: Floats, y: Floats, p: Floats, span: float = span, weight: float = weight) -> Floats:
            below = p[1] + weight * (span - p[2]) * at  # V
            turn = p[0] * np.sin(y[2]) - below * np.cos(y[2])
            return np.asarray((span - p[2]) * np.stack([np.cos(y[2]), np.sin(y[2]), curvature(y[3], power), turn]))

        def ends(a: Floats, b: Floats, p: Floats) -> Floats:
            return np.array([a[0] - p[2], a[1], a[2], a[3], b[0], b[1], b[2] - np.pi])

        found = solve_bvp(change, ends, t, state, p=unknown, tol=1e-6, max_nodes=100_000)
        wanted = weight == 1.0 and span == spans[len(folds)]
        if not found.success or (wanted and (found.y[1].min() < -1e-6 or not 0.0 < found.p[2] < span)):
            raise RuntimeError(f"fold of span {span} at {weight} of its weight: {found.message}")
        t, state, unknown = found.x, found.y, found.p
        if wanted:
            along = unknown[2] + (span - unknown[2]) * t
            own = (np.concatenate([[0.0], each]) for each in (along, state[0], state[1]))
            folds.append(Fold(Shape(*own), float(unknown[2])))
    return folds


@dataclass(frozen=True, eq=False)
class Folded:
    """A simulated fold at rest."""

    mesh: str
    shape: Shape  # in l
    at_rest: bool
    residual: float  # rms, of the forces that meet at a vertex


def folded(span: float, device: str, case: tuple[str, int]) -> Folded:
    """Simulates a fold, from the guess that the solver starts from."""
    start_warp(False)
    rows = max(round(span * LENGTH * case[1]), 4)
    edge = span * UNIT / rows
    mesh = (regular_strip if case[0] == "regular" else irregular_strip)(WIDTH, edge * (rows + 1), edge)
    s = 0.5 * edge * rows - mesh.points[:, 2]
    whole = span * UNIT
    held = (s < 0.6 * edge) | (s > whole - 0.6 * edge)
    along, angle = guess(span)
    first = line(along, angle)
    x, z = (np.interp(s / UNIT, along, each) for each in (along[0] + first.x, first.z))
    x += (np.minimum(s / UNIT - along[0], 0.0)) - np.maximum(s / UNIT - span, 0.0)
    start = np.column_stack([mesh.points[:, 0], UNIT * z, UNIT * x])
    below = _plane()
    exact = build_exact_collider(below, device)
    specimen = Specimens(
        [piece(mesh, FABRIC, np.flatnonzero(held).astype(np.int32))],
        weightless=False,
        device=device,
        options=StepOptions(method="multilevel"),
        collider=Collider(mesh_contact, exact.collider, MeshCollider),
    )
    found = specimen.settle(start, TIGHT, LIMIT)
    bins = np.round(s / edge + 0.5).astype(int)
    own = (np.bincount(bins, each)[1:-1] / np.bincount(bins)[1:-1] for each in (s, *found.points[:, [2, 1]].T))
    shape = Shape(*(each / UNIT for each in own))
    return Folded(case[0], shape, found.check.within(Tolerance()), found.check.residual.relative_rms)


def _plane() -> Mesh:
    """A block whose upper face is y = 0."""
    corners = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-0.5, 0.0) for z in (-1.0, 1.0)]) * 2.0 * PLANE
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return Mesh("plane", corners, np.array(faces, dtype=np.int32))


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--per-length", type=int, nargs="+", default=(5, 10, 20), help="elements a bending length")
    parser.add_argument("--workers", type=int, default=1)
    chosen = parser.parse_args()
    theory = dict(zip(SPANS, solve(SPANS), strict=True))
    other = dict(zip(SPANS, solve(SPANS, 1.0), strict=True))
    with (
        ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool,
        Figures(__file__, chosen, device=chosen.device, cores=1) as shown,
    ):
        for span, fold in theory.items():
            shown.add(f"span_{span:g}.flat", f"{fold.flat:.3f}", "l lie flat from the lower end, by theory")
            cases = [(mesh, count) for mesh in MESHES for count in chosen.per_length]
            found = list(pool.map(partial(folded, span, chosen.device), cases))
            for key, value in figures(fold.shape).items():
                off = 100.0 * (figures(other[span].shape)[key] / value - 1.0)
                shown.add(f"span_{span:g}.{key}.line", f"{off:+.1f}", f"% of {value:.4g}: cloth with M = B k instead")
                for mesh in MESHES:
                    own = [each for each in found if each.mesh == mesh]
                    errors = [100.0 * (figures(each.shape)[key] / value - 1.0) for each in own]
                    rests = [each.at_rest for each in own]
                    report(shown, f"span_{span:g}.{key}.{mesh}", errors, rests, value, chosen.per_length)
            for mesh in MESHES:
                residuals = ", ".join(f"{100.0 * each.residual:.2f}" for each in found if each.mesh == mesh)
                shown.add(f"span_{span:g}.residual.{mesh}", residuals, "% rms of the forces that meet at a vertex")


if __name__ == "__main__":
    main()
