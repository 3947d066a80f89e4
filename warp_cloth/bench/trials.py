"""Laboratory tests (KES-F, cantilever, Cusick drape), each on a piece of cloth: pure measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.bench.specimen import Settled, Specimens, piece
from warp_cloth.bench.swatch import along, disc, on_finer_disc
from warp_cloth.garment.laid import HUNG, laid_by
from warp_cloth.solver.certificate.certifier import Tolerance
from warp_cloth.solver.step_options import StepOptions

if TYPE_CHECKING:
    from warp_cloth.garment.garment import Garment
    from warp_cloth.material.fabric import Fabric
    from warp_cloth.material.hysteresis import Laid

BALANCED = Tolerance(relative_rms=2e-4, relative_p99=2e-3, rest_error=1e-5)  # clamp forces are then exact to 0.1 %
ITERATIONS = 20_000
DRAPE_ITERATIONS = 60_000  # of the multilevel method: most take 900 to 20,000, silk over 30,000 at 39,000 vertices
COARSEST_RINGS = 30  # of a disc that finer ones start from; on coarser ones silk forms other folds
DISCS = 6  # three specimens, each with both sides up
TIP_ANGLE = math.radians(41.5)  # of the cantilever (ISO 9073-7)
SUPPORT_RADIUS = 0.09  # [m], of the support in Cusick's test
DISC_RADIUS = 0.15  # [m]
SHADOW_PIXEL = 2.5e-4  # [m]; a disc's shadow is then exact to 0.1 points
DRAPE_MODES = range(3, 10)  # waves around the disc at the start, 1 mm high: cloth is never perfectly flat
HANGING = Tolerance(relative_rms=0.002, relative_p99=0.02, rest_error=1e-4)
DRAPED = Tolerance(relative_rms=0.01, relative_p99=0.05, rest_error=2e-4)  # the shadow is then exact to 0.5 points


@dataclass(frozen=True)
class Reading:
    """A reading: the deformation that was applied, and the response that was measured."""

    applied: float
    measured: float


def pull(
    mesh: Mesh, fabric: Fabric, strains: Sequence[float], *, grain_degrees: float = 0.0, device: str = "cpu"
) -> list[Reading]:
    """Tensile test: a strip clamped at both ends and pulled along its length, with free sides.

    Reads the strain in the middle two fifths of the length, like an extensometer, and the force per width [N/m].
    """
    across, place = along(mesh)
    length, width = np.ptp(place), np.ptp(across)
    specimen, far = _clamped(mesh, fabric, 1e-6 * length, grain_degrees, device)
    middle = np.abs(place / length - 0.5) < 0.2
    readings = []
    for strain in strains:
        start = mesh.points.copy()
        start[:, 2] *= 1.0 + strain
        settled = specimen.settle(start, BALANCED, ITERATIONS)
        stretch = -np.polyfit(place[middle], settled.points[middle, 2], 1)[0]
        readings.append(Reading(float(stretch) - 1.0, float(settled.forces[far, 2].sum() / width)))
    return readings


def _clamped(
    mesh: Mesh, fabric: Fabric, clamp: float, grain_degrees: float, device: str
) -> tuple[Specimens, NDArray[np.bool_]]:
    """A strip that is clamped at both ends over this length [m], and which vertices the far clamp holds, shape [V]."""
    _, place = along(mesh)
    far = place > np.ptp(place) - clamp
    held = _ids(far | (place < clamp))
    return Specimens([piece(mesh, fabric, held, grain_degrees=grain_degrees)], device=device), far


def released(mesh: Mesh, fabric: Fabric, strains: Sequence[float], *, device: str = "cpu") -> list[Reading]:
    """Recovery test: a strip is stretched along its warp, then released at one end.

    Reads the strain applied, and the mean strain that is left. There is neither weight nor friction; what is left is
    what the certificate accepts as rest.
    """
    _, place = along(mesh)
    length = np.ptp(place)
    near = place < length * 1e-6
    creeping = StepOptions(momentum=0.0)  # with momentum the strip would overshoot its length and crumple
    specimen = Specimens([piece(mesh, fabric, _ids(near))], device=device, options=creeping)
    readings = []
    for strain in strains:
        start = mesh.points.copy()
        start[:, 2] *= 1.0 + strain
        settled = specimen.settle(start, Tolerance(), ITERATIONS)
        left = -np.polyfit(place, settled.points[:, 2], 1)[0] - 1.0
        readings.append(Reading(strain, float(left)))
    return readings


def shear(
    mesh: Mesh, fabric: Fabric, angles: Sequence[float], *, grain_degrees: float = 0.0, device: str = "cpu"
) -> list[Reading]:
    """Shear test (KES-FB1): a wide, short strip whose far clamp moves sideways on an arc, with free sides.

    In the real test a small weight pulls the clamp, so that yarns keep their length; between clamps at a fixed distance
    they would be stretched too. Reads the angle [rad] and the sideways force per width [N/m], both in the middle half
    of the width, because the cloth shears less near its free sides.
    """
    across, place = along(mesh)
    length, width = np.ptp(place), np.ptp(across)
    specimen, far = _clamped(mesh, fabric, 1e-6 * length, grain_degrees, device)
    middle = np.abs(across) < 0.25 * width
    clamp = np.flatnonzero(far)[np.argsort(across[far])]
    clamped, widths = clamp[middle[clamp]], np.gradient(across[clamp])[middle[clamp]]
    readings = []
    for angle in angles:
        start = mesh.points.copy()
        start[:, 0] += math.sin(angle) * place
        start[:, 2] += (1.0 - math.cos(angle)) * place
        settled = specimen.settle(start, BALANCED, ITERATIONS)
        moved = settled.points[middle]
        slope = -np.polyfit(moved[:, 2], moved[:, 0] - across[middle], 1)[0]
        readings.append(Reading(math.atan(slope), -float(settled.forces[clamped, 0].sum() / widths.sum())))
    return readings


def bend(
    mesh: Mesh,
    fabric: Fabric,
    curvatures: Sequence[float],
    *,
    clamp: float,
    grain_degrees: float = 0.0,
    device: str = "cpu",
) -> list[Reading]:
    """Bending test (KES-FB2): a strip whose ends are clamped on an arc, over a length ``clamp`` [m] each.

    Reads the curvature [1/m] of a circle through the middle two fifths, and the moment per width [N].
    """
    across, place = along(mesh)
    length, width = np.ptp(place), np.ptp(across)
    specimen, far = _clamped(mesh, fabric, clamp * (1.0 + 1e-6), grain_degrees, device)
    middle, section = np.abs(place / length - 0.5) < 0.2, np.abs(place / length - 0.5) < 0.06
    readings = []
    for curvature in curvatures:
        angle = (place - 0.5 * length) * curvature
        start = np.column_stack([across, (1.0 - np.cos(angle)) / curvature, -np.sin(angle) / curvature])
        settled = specimen.settle(start, BALANCED, ITERATIONS)
        arms = settled.points[far] - settled.points[section].mean(axis=0)
        moment = abs(float(np.cross(arms, settled.forces[far])[:, 0].sum()))
        readings.append(Reading(_curvature(settled.points[middle, 1:]), float(moment / width)))
    return readings


def cantilever(mesh: Mesh, fabric: Fabric, clamp: float, *, grain_degrees: float = 0.0, device: str = "cpu") -> float:
    """Cantilever test: angle [rad] below the horizontal of a strip's free end, seen from its clamp.

    ``clamp`` [m] of its length are clamped. It starts on the arc with the angle that ends the test, because thin cloth
    that starts horizontally takes long to fall.
    """
    _, place = along(mesh)
    far = place > np.ptp(place) * (1.0 - 1e-6)
    edge = place[place <= clamp * (1.0 + 1e-6)].max()
    out = np.maximum(place - edge, 0.0)
    curvature = 2.0 * TIP_ANGLE / out.max()
    start = mesh.points.copy()
    start[:, 1] -= (1.0 - np.cos(curvature * out)) / curvature
    start[:, 2] += out - np.sin(curvature * out) / curvature
    specimen = Specimens(
        [piece(mesh, fabric, _ids(place <= edge), grain_degrees=grain_degrees)], weightless=False, device=device
    )
    settled = specimen.settle(start, HANGING, ITERATIONS)
    root, tip = settled.points[place == edge].mean(axis=0), settled.points[far].mean(axis=0)
    return math.atan2(root[1] - tip[1], root[2] - tip[2])


@dataclass(frozen=True, eq=False)
class Drape:
    """A disc draped over a round support."""

    mesh: Mesh  # as it was cut
    settled: Settled

    @property
    def coefficient(self) -> float:
        """Fraction of the free ring's area that its shadow covers [%]."""
        return drape_coefficient(self.settled.points, self.mesh.triangles)


def drape(rings: int, fabric: Fabric, *, discs: int = DISCS, device: str = "cpu") -> list[Drape]:
    """Drape test by Cusick (BS 5058, ISO 9073-9): discs of 30 cm on a support of 18 cm; ``rings`` sets the resolution.

    The number of folds depends on how a disc is laid, and the shadow on the folds: so laboratories test several
    specimens with both sides up, and state the mean. These discs differ in their mesh and in slight waves at the start;
    the two sides of cloth do not differ here. Fine discs start from the rest shapes of coarser ones, or they would
    creep for long.
    """
    levels = [rings]
    while levels[0] % 2 == 0 and levels[0] >= 2 * COARSEST_RINGS:
        levels.insert(0, levels[0] // 2)
    meshes = [drape_disc(levels[0], seed=number) for number in range(discs)]
    start = [Hanging(mesh, fabric, _waved(mesh, number)) for number, mesh in enumerate(meshes)]
    settled = hung(start, device)
    for level in levels[1:]:
        coarse, meshes = meshes, [drape_disc(level, seed=number) for number in range(discs)]
        start = [
            Hanging(fine, fabric, on_finer_disc(mesh, each.points, fine))
            for mesh, each, fine in zip(coarse, settled, meshes, strict=True)
        ]
        settled = hung(start, device, near_rest=True)
    return [Drape(mesh, each) for mesh, each in zip(meshes, settled, strict=True)]


def let_down(draped: Sequence[Drape], fabric: Fabric, *, device: str = "cpu") -> list[Drape]:
    """The same discs again, pulled down by HUNG times their weight and let up to their own.

    ``drape`` lays cloth from the flat. Where friction keeps what was laid, these are the other end of the
    band in which it may rest; without friction they hang as before.
    """
    heavy = [Hanging(each.mesh, fabric, each.settled.points, load=HUNG) for each in draped]
    pulled = hung(heavy, device, near_rest=True)
    start = [
        Hanging(each.mesh, fabric, shape.points, laid=laid_by(each.garment.rest, shape.points))
        for each, shape in zip(heavy, pulled, strict=True)
    ]
    settled = hung(start, device, near_rest=True)
    return [Drape(each.mesh, shape) for each, shape in zip(draped, settled, strict=True)]


def drape_disc(rings: int, disc_radius: float = DISC_RADIUS, seed: int = 0) -> Mesh:
    """Cusick's disc [m] without its centre: two rings of vertices on the support are enough.

    ``rings`` of edges lie between its centre and its rim; each ``seed`` has another mesh. A hinge represents the bend
    from half an edge before it to half an edge after it. So the outer clamped ring lies half an edge outside the
    support, and the cloth bends from the support's edge at any resolution.
    """
    return disc(disc_radius, SUPPORT_RADIUS, disc_radius / rings, seed)


def held_by_support(mesh: Mesh) -> Indices:
    """The clamped vertices of ``drape_disc``: its two innermost rings."""
    radius = np.hypot(mesh.points[:, 0], mesh.points[:, 2]).round(9)
    return _ids(radius <= np.unique(radius)[1])


def _waved(mesh: Mesh, seed: int) -> Points:
    """Points of the disc with slight waves in its free ring [m]."""
    radius, angle = np.hypot(mesh.points[:, 0], mesh.points[:, 2]), np.arctan2(mesh.points[:, 2], mesh.points[:, 0])
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(DRAPE_MODES))
    start = mesh.points.copy()
    for mode, phase in zip(DRAPE_MODES, phases, strict=True):
        out = np.maximum(radius - SUPPORT_RADIUS, 0.0) / (DISC_RADIUS - SUPPORT_RADIUS)
        start[:, 1] += 1e-3 * np.cos(mode * angle + phase) * out**2
    return start


@dataclass(frozen=True, eq=False)
class Hanging:
    """A disc of ``drape_disc`` that is to hang, and where it starts."""

    mesh: Mesh
    fabric: Fabric
    start: Points  # [m], shape [V, 3]
    laid: Laid | None = None  # None: flat
    load: float = 1.0  # times its own weight

    @cached_property
    def garment(self) -> Garment:
        """The disc as it enters a model."""
        own = piece(self.mesh, self.fabric, held_by_support(self.mesh), laid=self.laid)
        return replace(own, rest=replace(own.rest, vertex_weight=self.load * own.rest.vertex_weight))


def hung(discs: Sequence[Hanging], device: str, *, near_rest: bool = False) -> list[Settled]:
    """Relaxes discs: on a GPU all together, on the CPU one by one; the bits are the same."""
    options = StepOptions(method="multilevel")  # which rotates folds as rigid bodies
    held = {id(each.mesh): held_by_support(each.mesh) for each in discs}
    settled: list[Settled] = []
    for group in [discs] if wp.get_device(device).is_cuda else [[each] for each in discs]:
        alike = {_kind(each): each for each in group}
        pieces = {key: each.garment for key, each in alike.items()}
        starts = []
        for each in group:
            start, clamped = each.start.copy(), held[id(each.mesh)]
            start[clamped] = each.mesh.points[clamped]
            starts.append(start)
        all_pieces = [pieces[_kind(each)] for each in group]
        specimens = Specimens(all_pieces, weightless=False, device=device, options=options)
        settled += specimens.settle_all(starts, DRAPED, DRAPE_ITERATIONS, near_rest=near_rest)
    return settled


def _kind(disc: Hanging) -> tuple[int, int, int, float]:
    """Equal for discs that only start differently."""
    return id(disc.mesh), id(disc.fabric), id(disc.laid), disc.load


def drape_coefficient(points: Points, triangles: Indices) -> float:
    """Fraction of the free ring's area that the shadow of a draped disc, lit from above, covers [%]."""
    size = math.ceil(2.1 * DISC_RADIUS / SHADOW_PIXEL)
    pixels = points[:, [0, 2]] / SHADOW_PIXEL + 0.5 * size
    image = Image.new("1", (size, size))
    draw = ImageDraw.Draw(image)
    half = SUPPORT_RADIUS / SHADOW_PIXEL
    draw.ellipse([0.5 * size - half, 0.5 * size - half, 0.5 * size + half, 0.5 * size + half], fill=1)
    for corners in pixels[triangles].reshape(-1, 6).tolist():
        draw.polygon(corners, fill=1)
    area = float(np.asarray(image).sum()) * SHADOW_PIXEL**2
    inner = math.pi * SUPPORT_RADIUS**2
    return 100.0 * (area - inner) / (math.pi * DISC_RADIUS**2 - inner)


def _curvature(points: Points) -> float:
    """Curvature of the circle that fits points in a plane, by least squares [1/m]."""
    rows = np.column_stack([2.0 * points, np.ones(len(points))])
    fit = np.linalg.lstsq(rows, (points**2).sum(axis=1), rcond=None)[0]
    return float(1.0 / math.sqrt(fit[2] + fit[0] ** 2 + fit[1] ** 2))


def _ids(chosen: np.ndarray) -> Indices:
    return np.flatnonzero(chosen).astype(np.int32)
