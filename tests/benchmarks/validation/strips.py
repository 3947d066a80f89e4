"""Strips of cloth, simulated: regular and irregular meshes, held at one or both ends, against the elastica's line."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from elastica import LENGTH, Floats, Shape, Strip, guess, line, solve
from PIL import Image, ImageDraw
from scipy.spatial import Delaunay

sys.path.insert(0, str(Path(__file__).parents[1]))
from measured import Figures, script_parser

from warp_cloth.base.mesh import Mesh
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.bench import specimen
from warp_cloth.bench.specimen import Specimens, piece
from warp_cloth.bench.swatch import strip as regular_strip
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.laid import laid_by
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.hysteresis import Laid
from warp_cloth.material.laboratory import GRAVITY, bending_of_rigidity
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.step_options import StepOptions

C = 0.02  # bending length [m]
WEIGHT = 0.16  # [kg/m2]
STIFF = 4e5  # [N/m]; the strip's weight then stretches it by at most 0.1 %
FABRIC = Fabric(
    weight=WEIGHT,
    stretch_warp=STIFF,
    stretch_weft=STIFF,
    shear=0.2 * STIFF,
    bending_warp=bending_of_rigidity(WEIGHT * GRAVITY * C**3, WEIGHT),
    bending_weft=bending_of_rigidity(WEIGHT * GRAVITY * C**3, WEIGHT),
)
WIDTH = 0.8 * C  # [m]; a strip of some edges' width, however fine, would be all border
SHAKEN = 0.3  # of the edge, by which inner vertices of irregular strips leave the grid
PER_LENGTH = (10, 20, 40)  # elements a bending length
MESHES = ("regular", "irregular")
TIGHT = Tolerance(relative_rms=5e-4, relative_p99=5e-3, rest_error=2e-5)
LIMIT = 60_000  # iterations
SPOTS = 60  # of a line
CONVERGED = 0.02  # [%]; smaller differences are the certificate's


@dataclass(frozen=True)
class Run:
    """One simulated strip."""

    name: str
    strip: Strip
    mesh: str  # of MESHES
    per_length: int
    method: str = "multilevel"
    device: str = "cpu"
    fabric: Fabric = FABRIC
    let_down: float = 0.0  # times its weight under which it hung before; 0: laid from the flat


@dataclass(frozen=True, eq=False)
class Settled:
    """Its middle line at rest, of half of it where both ends are held, in l."""

    run: Run
    shape: Shape
    at_rest: bool
    iterations: int


def irregular_strip(width: float, length: float, edge: float, seed: int = 0) -> Mesh:
    """A rectangle whose inner vertices are shaken and triangulated anew; two rows at both ends stay."""
    columns, rows = max(round(width / edge), 1), max(round(length / edge), 1)
    y, x = np.meshgrid(np.arange(rows + 1.0), np.arange(columns + 1.0), indexing="ij")
    moved = np.random.default_rng(seed).uniform(-SHAKEN, SHAKEN, (2, *x.shape))
    moved[:, [0, 1, -2, -1]] = 0.0
    moved[0][:, [0, -1]] = 0.0
    flat = np.column_stack([(x + moved[0]).ravel() * width / columns, (y + moved[1]).ravel() * length / rows])
    triangles = Delaunay(flat).simplices
    corners = flat[triangles]
    along, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(along[:, 0] * other[:, 1] - along[:, 1] * other[:, 0])
    triangles = triangles[area > 0.02 * edge**2]  # along a side of the rectangle
    points = np.column_stack([flat[:, 0] - 0.5 * width, np.zeros(len(flat)), 0.5 * length - flat[:, 1]])
    return Mesh("strip", points, triangles.astype(np.int32), texcoords=flat[triangles])


def settled(run: Run) -> Settled:
    """Simulates a strip, from the guess that the elastica's solver starts from, too.

    A hinge stands for the bend from half an edge before it to half an edge after it: a clamp lies between its two rows.
    """
    start_warp(False)
    unit, strip = LENGTH * C, run.strip
    both = strip.last is not None
    whole = (2.0 if both else 1.0) * strip.span * unit
    rows = max(round(whole * run.per_length / C), 4)  # of edges between the clamps, or from the clamp to the end
    edge = whole / (rows if both else rows - 0.5)
    length = edge * (rows + 1 if both else rows)
    mesh = (regular_strip if run.mesh == "regular" else irregular_strip)(WIDTH, length, edge)
    flat = mesh.points
    s = 0.5 * length - flat[:, 2] - 0.5 * edge  # from the clamp
    held = s < 0.6 * edge
    if both:
        held |= s > whole - 0.6 * edge
    place = unit * _started(strip, s / unit)
    clamped, start = np.flatnonzero(held).astype(np.int32), np.column_stack([flat[:, 0], place[:, 1], place[:, 0]])

    def strip_of(weight: float, laid: Laid | None) -> Garment:
        return piece(mesh, replace(run.fabric, weight=weight), clamped, laid=laid)

    def settled(own: Garment, start: Floats) -> specimen.Settled:
        options = StepOptions(method=run.method)
        return Specimens([own], weightless=False, device=run.device, options=options).settle(start, TIGHT, LIMIT)

    laid = None
    if run.let_down:
        heavy = strip_of(run.let_down * run.fabric.weight, None)
        start = settled(heavy, start).points
        laid = laid_by(heavy.rest, start)
    found = settled(strip_of(run.fabric.weight, laid), start)
    shape = _middle(s / edge, edge / unit, found.points[:, [2, 1]] / unit, strip)
    return Settled(run, shape, found.check.within(TIGHT), found.check.iteration)


def _started(strip: Strip, s: Floats) -> Floats:
    """Where the guess puts vertices, and the clamped ones beyond it, shape [N, 2]."""
    along, angle = guess(strip)
    if strip.last is not None:
        along = np.concatenate([along, 2.0 * strip.span - along[-2::-1]])
        angle = np.concatenate([angle, 2.0 * strip.last - angle[-2::-1]])
    shape = line(along, angle)
    place = np.column_stack([np.interp(s, along, shape.x), np.interp(s, along, shape.z)])
    before, after = np.minimum(s, 0.0), np.maximum(s - along[-1], 0.0)
    for beyond, turn in ((before, angle[0]), (after, angle[-1])):
        place += beyond[:, None] * np.array([np.cos(turn), np.sin(turn)])
    return np.asarray(place)


def _middle(row: Floats, edge: float, points: Floats, strip: Strip) -> Shape:
    """The mean over the strip's width, from the clamp to its end or its middle."""
    bins = np.round(row + 0.5).astype(int)
    count = np.bincount(bins)
    s, x, z = (np.bincount(bins, each) / count for each in (edge * row, points[:, 0], points[:, 1]))
    spots = np.linspace(0.0, strip.span, SPOTS)
    return Shape(spots, np.interp(spots, s, x), np.interp(spots, s, z))


Read = Callable[[Shape], dict[str, float]]  # a case's figures of a line


def run_cases(script: str, cases: dict[str, Strip], read: Read) -> None:
    """The command of a case's script: simulates on all meshes, prints errors [%] and the order of convergence."""
    parser = script_parser(f"Strips against the heavy elastica: {', '.join(cases)}.", device="cpu")
    parser.add_argument("--method", default="multilevel")
    parser.add_argument("--per-length", type=int, nargs="+", default=PER_LENGTH, help="elements a bending length")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--picture", type=Path, help="draws the lines")
    chosen = parser.parse_args()
    runs = [
        Run(name, strip, mesh, count, chosen.method, chosen.device)
        for name, strip in cases.items()
        for mesh in MESHES
        for count in chosen.per_length
    ]
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        found = list(pool.map(settled, runs))
    theory = {name: solve(strip) for name, strip in cases.items()}
    other = {name: solve(strip, 1.0) for name, strip in cases.items()}
    way = "" if (chosen.method, chosen.device) == ("multilevel", "cpu") else f".{chosen.method}"
    with Figures(script, chosen, device=chosen.device, cores=1) as figures:
        for name in cases:
            for key, value in read(theory[name]).items():
                line_off = 100.0 * (read(other[name])[key] / value - 1.0)
                figures.add(f"{name}.{key}.line", f"{line_off:+.1f}", f"% of {value:.4g}: cloth with M = B k instead")
                for mesh in MESHES:
                    own = [each for each in found if (each.run.name, each.run.mesh) == (name, mesh)]
                    off = [100.0 * (read(each.shape)[key] / value - 1.0) for each in own]
                    rests = [each.at_rest for each in own]
                    report(figures, f"{name}.{key}.{mesh}{way}", off, rests, value, chosen.per_length)
    if chosen.picture:
        draw(theory, other, found, chosen.picture)


def report(
    figures: Figures, name: str, errors: Sequence[float], rests: Sequence[bool], value: float, counts: Sequence[int]
) -> None:
    """One row: errors [%] on all meshings, and the order of convergence."""
    shown = [f"{error:+.2f}{'' if rest else ' (not at rest)'}" for error, rest in zip(errors, rests, strict=True)]
    meshings = ", ".join(str(count) for count in counts)
    figures.add(name, ", ".join(shown), f"% of {value:.4g} at {meshings} elements a length; order {order(errors)}")


def order(errors: Sequence[float]) -> str:
    """Order of convergence of three values on meshes twice as fine each, by their differences."""
    if len(errors) < 3:
        return "-"
    coarse, fine = errors[-2] - errors[-3], errors[-1] - errors[-2]
    if abs(coarse) < CONVERGED:
        return f"hidden, below {CONVERGED} %"
    return f"{np.log2(abs(coarse / fine)):.1f}" if coarse * fine > 0.0 else "changes sign"


def draw(theory: dict[str, Shape], other: dict[str, Shape], found: Sequence[Settled], path: Path) -> None:
    """Theory as black lines, the laboratory's straight line as grey ones, simulated strips as dots."""
    side, count = 320, len(theory)
    picture = Image.new("RGB", (side * count, side + 20), "white")
    pen = ImageDraw.Draw(picture)
    for number, (name, shape) in enumerate(theory.items()):
        lines = [shape, other[name], *(each.shape for each in found if each.run.name == name)]
        x, z = (np.concatenate(each) for each in zip(*((one.x, one.z) for one in lines), strict=True))
        scale = 0.9 * side / max(np.ptp(x), np.ptp(z), 1e-9)

        corner = (number * side + 16 - scale * float(x.min()), 30 + scale * float(z.max()))
        pen.line(_placed(other[name], corner, scale), fill=(190, 190, 190), width=2)
        pen.line(_placed(shape, corner, scale), fill="black", width=2)
        for each in (each for each in found if each.run.name == name):
            colour = (20, 90, 230) if each.run.mesh == "regular" else (220, 60, 30)
            for across, down in _placed(each.shape, corner, scale)[::3]:
                pen.ellipse([across - 2, down - 2, across + 2, down + 2], outline=colour)
        pen.text((number * side + 6, 4), name, fill="black")
    picture.save(path)


def _placed(shape: Shape, corner: tuple[float, float], scale: float) -> list[tuple[float, float]]:
    """Pixels of a line's points."""
    across, down = corner[0] + scale * shape.x, corner[1] - scale * shape.z
    return list(zip(across.tolist(), down.tolist(), strict=True))
