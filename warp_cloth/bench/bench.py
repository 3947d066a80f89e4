"""All tests of one fabric, compared with the values that the fabric states."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.bench.swatch import strip
from warp_cloth.bench.trials import (
    DISCS,
    TIP_ANGLE,
    Drape,
    Reading,
    bend,
    cantilever,
    drape,
    let_down,
    pull,
    released,
    shear,
)
from warp_cloth.material.laboratory import (
    KES_BENDING,
    KES_FORCE,
    KES_SHEAR,
    MATCHED_FOLD,
    MATCHED_SHEAR_ANGLE,
    bending_length,
    rigidity_of_bending,
)
from warp_cloth.model.result import WornGarment

if TYPE_CHECKING:
    from warp_cloth.material.fabric import Fabric

EDGE = 0.01  # [m], mean edge of strips that are pulled or sheared
BENT_EDGES = (10, 20)  # across and along a strip that is bent
BENT_EDGE = 0.3  # of the bending length: at the matched curvature, a quarter of a radian from edge to edge
OVERHANG_EDGES = 16  # of the cantilever, at any length
STRIP = (0.05, 0.20)  # width and length pulled [m]
SHEARED = (0.20, 0.05)  # width and gap of KES-FB1's shear test
CANTILEVER_EDGES = 8  # across; its sides are free, so that its width does not matter
DISC_RINGS = 30  # 1,974 vertices; the coefficient is within 3 points of 40,000's
FEWEST_RINGS, MOST_RINGS = 5, 500  # 500,000 vertices
MOST_DISCS = 100
PULLED_TO = np.arange(1, 9) / 8.0  # of the elongation at 500 gf/cm
SHEARED_TO = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)  # [degrees]
BENT_TO = (0.6, 1.0, 1.5, 2.0)  # of the matched curvature
STRETCHED_BY = (0.01, 0.05, 0.20)  # before release
BIAS_FORCE = 5 * 0.980665  # [N/m], 5 gf/cm, at which FAST reads the bias extension

DIRECTIONS = (("warp", 0.0), ("weft", 90.0))


@dataclass(frozen=True)
class Finding:
    """A measured value and the fabric's own, in laboratory units."""

    name: str
    unit: str
    measured: float
    stated: float | None = None  # None: the fabric states none

    @property
    def deviation(self) -> float | None:
        """Relative deviation from the fabric's own value."""
        return self.measured / self.stated - 1.0 if self.stated else None


@dataclass(frozen=True)
class Curve:
    """A measured curve and, at the same points, the fabric's own law."""

    name: str
    x_unit: str
    y_unit: str
    x: tuple[float, ...]
    measured: tuple[float, ...]
    stated: tuple[float, ...] | None


@dataclass(frozen=True, eq=False)
class Bench:
    """Test results of one fabric."""

    fabric: Fabric
    findings: tuple[Finding, ...]
    curves: tuple[Curve, ...]
    disc: WornGarment  # draped; of several discs the one whose coefficient is closest to the mean


def run_bench(
    fabric: Fabric,
    *,
    device: str = "cpu",
    rings: int = DISC_RINGS,
    discs: int = DISCS,
    progress: Callable[[str], None] | None = None,
) -> Bench:
    """Runs every test of a fabric.

    Args:
        fabric: to be tested.
        device: Warp's name of it; strips are so small that a GPU is no faster.
        rings: of vertices in each disc of the drape test.
        discs: number of them.
        progress: called with the name of every test that begins.

    Raises:
        InputError: the number of rings or discs is out of range.
    """
    if not FEWEST_RINGS <= rings <= MOST_RINGS:
        raise InputError("--rings", f"must be an integer from {FEWEST_RINGS} to {MOST_RINGS}, not {rings}")
    if not 1 <= discs <= MOST_DISCS:
        raise InputError("--discs", f"must be an integer from 1 to {MOST_DISCS}, not {discs}")
    progress = progress or (lambda _: None)
    findings: list[Finding] = []
    curves: list[Curve] = []
    tests = (("tension", _tension), ("bias", _bias), ("shear", _shear), ("bending", _bending))
    for name, test in (*tests, ("cantilever", _cantilever), ("release", _release)):
        progress(name)
        test_findings, test_curves = test(fabric, device)
        findings += test_findings
        curves += test_curves
    progress("drape")
    draped = drape(rings, fabric, discs=discs, device=device)
    coefficients = [disc.coefficient for disc in draped]
    findings += _draped(coefficients, draped)
    if fabric.has_band:
        down = [disc.coefficient for disc in let_down(draped, fabric, device=device)]
        findings.append(Finding("drape coefficient, let down from the hang", "%", float(np.mean(down))))
    middle = draped[int(np.argmin(np.abs(np.array(coefficients) - np.mean(coefficients))))]
    shown = WornGarment("disc", middle.mesh, middle.settled.points, fabric.thickness, None)
    return Bench(fabric, tuple(findings), tuple(curves), shown)


TestResult = tuple[list[Finding], list[Curve]]


def _tension(fabric: Fabric, device: str) -> TestResult:
    findings, curves = [], []
    for (direction, grain), stretch in zip(DIRECTIONS, (fabric.stretch_warp, fabric.stretch_weft), strict=True):
        emt = math.sqrt(KES_FORCE / stretch)
        readings = pull(strip(*STRIP, EDGE), fabric, list(emt * PULLED_TO), grain_degrees=grain, device=device)
        strain, force = _columns(readings)
        at = emt * math.sqrt(KES_FORCE / np.interp(emt, strain, force))  # forces go as strain squared
        findings.append(Finding(f"EMT {direction}", "%", 100.0 * at, 100.0 * emt))
        findings.append(Finding(f"LT {direction}", "", _linearity(strain, force), 2.0 / 3.0))
        curves.append(
            Curve(
                f"tension {direction}", "%", "N/m", _tuple(100.0 * strain), _tuple(force), _tuple(stretch * strain**2)
            )
        )
    return findings, curves


def _linearity(strain: np.ndarray, force: np.ndarray) -> float:
    """LT of KES-F: the work along the curve, divided by that along a straight line to its end."""
    x, y = np.concatenate([[0.0], strain]), np.concatenate([[0.0], force])
    fit = np.polynomial.Polynomial.fit(x, y, 3).integ()
    return float((fit(x[-1]) - fit(0.0)) / (0.5 * x[-1] * y[-1]))


def _bias(fabric: Fabric, device: str) -> TestResult:
    scale = fabric.shear if fabric.shear is not None else 0.1 * fabric.stretch
    end = min(math.sqrt(2.0 * BIAS_FORCE / scale), 0.2)
    readings = pull(strip(*STRIP, EDGE), fabric, list(end * PULLED_TO), grain_degrees=45.0, device=device)
    strain, force = _columns(readings)
    extension = float(np.mean(strain * np.sqrt(BIAS_FORCE / force)))
    findings = [Finding("bias extension at 5 gf/cm", "%", 100.0 * extension)]
    return findings, [Curve("tension bias", "%", "N/m", _tuple(100.0 * strain), _tuple(force), None)]


def _shear(fabric: Fabric, device: str) -> TestResult:
    findings, curves = [], []
    for direction, grain in DIRECTIONS:
        angles = [math.radians(degrees) for degrees in SHEARED_TO]
        angle, force = _columns(shear(strip(*SHEARED, EDGE), fabric, angles, grain_degrees=grain, device=device))
        at = float(np.interp(MATCHED_SHEAR_ANGLE, angle, force / angle**2)) * MATCHED_SHEAR_ANGLE / KES_SHEAR
        own = None if fabric.shear is None else fabric.shear * MATCHED_SHEAR_ANGLE / KES_SHEAR
        findings.append(Finding(f"G {direction}", "gf/(cm deg)", at, own))
        law = None if fabric.shear is None else _tuple(fabric.shear * angle**2)
        curves.append(Curve(f"shear {direction}", "degrees", "N/m", _tuple(np.degrees(angle)), _tuple(force), law))
    return findings, curves


def _bending(fabric: Fabric, device: str) -> TestResult:
    findings, curves = [], []
    for (direction, grain), bending in zip(DIRECTIONS, (fabric.bending_warp, fabric.bending_weft), strict=True):
        if bending == 0.0:
            continue
        length = bending_length(rigidity_of_bending(bending, fabric.weight), fabric.weight)
        matched, edge = MATCHED_FOLD / length, BENT_EDGE * length
        mesh = strip(BENT_EDGES[0] * edge, BENT_EDGES[1] * edge, edge)
        curvatures = [fraction * matched for fraction in BENT_TO]
        readings = bend(mesh, fabric, curvatures, clamp=2.0 * edge, grain_degrees=grain, device=device)
        curvature, moment = _columns(readings)
        constant = float(np.interp(matched, curvature, 2.0 * moment / curvature**2))
        to_b = 0.5 * matched / KES_BENDING
        findings.append(Finding(f"B {direction}", "gf cm2/cm", constant * to_b, bending * to_b))
        law = _tuple(0.5e3 * bending * curvature**2)
        curves.append(Curve(f"bending {direction}", "1/m", "mN", _tuple(curvature), _tuple(1e3 * moment), law))
    return findings, curves


def _cantilever(fabric: Fabric, device: str) -> TestResult:
    """Bending length: half the overhang whose end is 41.5 degrees below the clamp, found iteratively.

    The hinges on the clamp's edge represent the bend from half an edge before it, which counts as overhang.
    """
    findings = []
    for (direction, grain), bending in zip(DIRECTIONS, (fabric.bending_warp, fabric.bending_weft), strict=True):
        if bending == 0.0:
            continue
        length = bending_length(rigidity_of_bending(bending, fabric.weight), fabric.weight)
        overhang, edge = 2.0 * length, 0.0
        for _ in range(3):
            edge = overhang / OVERHANG_EDGES
            piece = strip(CANTILEVER_EDGES * edge, overhang + 2.0 * edge, edge)
            angle = cantilever(piece, fabric, 2.0 * edge, grain_degrees=grain, device=device)
            # small angles are proportional to the power 2.5 of the length; steps are limited for large ones
            ratio = math.tan(TIP_ANGLE) / math.tan(min(max(angle, 0.1), 1.5))
            overhang *= min(max(ratio**0.4, 0.7), 1.4)
        findings.append(Finding(f"bending length {direction}", "mm", 500.0 * (overhang + 0.5 * edge), 1e3 * length))
    return findings, []


def _release(fabric: Fabric, device: str) -> TestResult:
    readings = released(strip(*STRIP, EDGE), fabric, STRETCHED_BY, device=device)
    return [Finding(f"strain left after {100 * r.applied:g} %", "%", 100.0 * r.measured) for r in readings], []


def _draped(coefficients: Sequence[float], draped: Sequence[Drape]) -> list[Finding]:
    """Drape coefficient: mean of all discs, each disc's, and their standard deviation."""
    singles = [
        Finding(f"drape coefficient of disc {number}", "%", value) for number, value in enumerate(coefficients, start=1)
    ]
    if len(singles) > 1:
        singles.append(Finding("standard deviation of the discs", "%", float(np.std(coefficients, ddof=1))))
    worst = max(disc.settled.check.rest_error for disc in draped)
    return [
        Finding("drape coefficient", "%", float(np.mean(coefficients))),
        *singles,
        Finding("rest error of the drape", "mm", 1e3 * worst),
    ]


def _columns(readings: Sequence[Reading]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([r.applied for r in readings]), np.array([r.measured for r in readings])


def _tuple(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
