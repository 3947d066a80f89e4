"""Constants of edges, yarns and hinges from a fabric and a rest shape, for one material on every mesh.

All in float64 on the host. How a network of edges responds to a uniform deformation depends on their directions and
sizes. So each edge gets a constant by its rest geometry; two factors per garment, for warp and weft, are then fitted so
that the garment, pulled uniformly along warp or weft, responds like the fabric.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.kernels.base.options import ShearSliderField, YarnField

if TYPE_CHECKING:
    from warp_cloth.base.topology import Topology
    from warp_cloth.material.fabric import Fabric

Floats = NDArray[np.float64]

# A regular grid pulled along its yarns bears on one of its three edge families, and an equilateral one, its sides
# free, likewise: so each edge answers for three times the area that it carries (a third of its triangles').
EDGE_FACTOR = 3.0
DIRECTIONS = 180  # one per degree, over which strains differ by at most 2 %
EQUAL_ROUNDS = 40  # of the fixed point for the two factors
NEWTON_ROUNDS = 40
# A mesh may have no edges along warp or weft. Beyond these factors its other edges would be another material.
LEAST_FACTOR, MOST_FACTOR = 0.2, 20.0
LEAST_RESISTED = 1e-30  # fraction of the bias yarns' K below which nothing resists contraction
# Shear up to which yarns cling: KES-F reads 2HG at half a degree, and from there on G, the slope where they slip.
CLINGING_SHEAR = float(np.sin(np.radians(0.5)))
THINNEST_FRACTION = 1e-6  # of the median triangle's area; thinner triangles carry no yarns


@dataclass(frozen=True, eq=False)
class YarnConstants:
    """Yarns of the T woven triangles of a garment (kernels.laws.yarn)."""

    triangles: Indices  # those of the garment's triangles that carry yarns, shape [T]
    corners: Indices  # shape [T, 3]
    slope: Floats  # of second and third corner along weft, then warp [1/m], shape [T, 4]
    weft: Floats  # area times K of the weft yarns [N m], shape [T]
    warp: Floats
    shear: Floats  # of each of the two bias yarns, which bear the fabric's shear
    compression: float  # c of the fabric
    areas: Floats  # [m2], shape [T]
    clinging: float = CLINGING_SHEAR  # shear up to which yarns cling
    friction: float = 0.0  # h of the fabric: force per width at which yarns that are sheared slip [N/m]
    laid: Floats | None = None  # shear that they were laid into (kernels.laws.shear_hysteresis), [T]; None: as at rest

    @property
    def packed(self) -> Floats:
        """For the device, by ``YarnField``, shape [T, 4]."""
        yarns = np.empty((len(self.triangles), len(YarnField)))
        yarns[:, YarnField.WEFT], yarns[:, YarnField.WARP] = self.weft, self.warp
        yarns[:, YarnField.SHEAR], yarns[:, YarnField.COMPRESSION] = self.shear, self.compression
        return yarns

    @property
    def slider(self) -> Floats:
        """Friction for the device, by ``ShearSliderField``, shape [T, 3]."""
        slider = np.zeros((len(self.triangles), len(ShearSliderField)))
        slider[:, ShearSliderField.FRICTION] = self.areas * self.friction
        slider[:, ShearSliderField.STEEPNESS] = 1.0 / self.clinging
        if self.laid is not None:
            slider[:, ShearSliderField.LAID] = self.laid
        return slider

    def sheared(self, points: Floats) -> Floats:
        """Shear of every woven triangle in this shape [m], [V, 3]: g of laws/shear_hysteresis, shape [T]."""
        sides = points[self.corners[:, 1:]] - points[self.corners[:, :1]]
        weft, warp = (np.einsum("tk,tkx->tx", self.slope[:, part], sides) for part in (slice(0, 2), slice(2, 4)))
        return np.asarray(np.einsum("tx,tx->t", weft, warp))


@dataclass(frozen=True, eq=False)
class Sheet:
    """A garment's rest shape, triangle by triangle, laid flat; x along the weft and y along the warp where known."""

    topology: Topology
    triangles: Indices  # shape [F, 3]
    flat: Floats  # corners [m], shape [F, 3, 2]
    areas: Floats  # [m2], shape [F]
    directed: bool  # whether x and y are weft and warp

    @property
    def area(self) -> float:
        return float(self.areas.sum())


def lay_flat(sides: Floats, areas: Floats, like: Floats | None) -> Floats:
    """Triangles of these sides (0,1), (1,2), (2,0) [m] in the plane, shape [F, 3, 2].

    Each is rotated, and mirrored if needed, to fit ``like`` best; triangles without area there stay as they are.
    """
    first, second, third = sides.T
    base = np.maximum(first, np.finfo(float).tiny)
    x = (first**2 + third**2 - second**2) / (2.0 * base)
    corners = np.stack([np.zeros_like(x), first, x], axis=1) + 0j
    corners[:, 2] += 2j * areas / base
    if like is not None:
        target = like[:, :, 0] + 1j * like[:, :, 1]
        target = target - target.mean(axis=1, keepdims=True)
        along, across = target[:, 1] - target[:, 0], target[:, 2] - target[:, 0]
        mirrored = (np.conj(along) * across).imag < 0.0
        corners = np.where(mirrored[:, None], np.conj(corners), corners)
        centred = corners - corners.mean(axis=1, keepdims=True)
        rotation = (target * np.conj(centred)).sum(axis=1)
        size = np.abs(rotation)
        rotation = np.where(size > 0.0, rotation / np.where(size > 0.0, size, 1.0), 1.0)
        corners = corners * rotation[:, None]
    return np.stack([corners.real, corners.imag], axis=2)


def edge_constants(sheet: Sheet, fabric: Fabric, length: Floats) -> Floats:
    """k of every edge [N/m2]: k L^3 = 3 K A, A the area that it carries, K by its direction and the two factors.

    The 3 is what the factors are on a regular grid, nearly.
    """
    topology = sheet.topology
    count = len(topology.edges)
    carried = np.bincount(topology.triangle_edges.ravel(), np.repeat(sheet.areas / 3.0, 3), count)
    if not sheet.directed:
        stiffness = fabric.stretch / even_network(fabric.compression)
        return stiffness * carried / length**3
    double = _edge_double_angle(sheet)
    along = 0.5 + 0.5 * double.real  # cos^2 of the angle to the warp
    families = np.stack([along * fabric.stretch_warp, (1.0 - along) * fabric.stretch_weft], axis=1)
    angle = 0.5 * np.angle(double) % np.pi
    sector = np.round(angle * DIRECTIONS / np.pi).astype(int) % DIRECTIONS
    density = (
        np.stack([np.bincount(sector, carried * family, DIRECTIONS) for family in families.T], axis=1) / sheet.area
    )
    factors = _network_factors(density, fabric)
    return families @ factors * carried / length**3


def even_network(compression: float) -> float:
    """K of a network with edges of k L^3 = 1 J per area in every direction alike, pulled one way, its sides free."""
    spread = np.full((DIRECTIONS, 1), 1.0 / DIRECTIONS)
    return float(_pulled(spread, np.ones(1), compression, 0.0)[0])


def _edge_double_angle(sheet: Sheet) -> NDArray[np.complex128]:
    """exp(2 i angle to the warp) of every edge, the mean of its triangles'."""
    across = np.roll(sheet.flat, -1, axis=1) - sheet.flat
    side = (across[..., 1] + 1j * across[..., 0]).ravel()  # angle 0 along y, the warp
    edge = sheet.topology.triangle_edges.ravel()
    squared = side**2 / np.maximum(np.abs(side), np.finfo(float).tiny)
    count = len(sheet.topology.edges)
    total = np.bincount(edge, squared.real, count) + 1j * np.bincount(edge, squared.imag, count)
    size = np.abs(total)
    return np.asarray(np.where(size > 0.0, total / np.where(size > 0.0, size, 1.0), 1.0))


def _network_factors(density: Floats, fabric: Fabric) -> Floats:
    """Factors of the two families such that the network meets the fabric's stretch along warp and weft, shape [2].

    ``density``: K A summed over the edges near each direction to the warp, per area; warp and weft, [DIRECTIONS, 2].
    """
    wanted = np.array([fabric.stretch_warp, fabric.stretch_weft])
    factors = np.full(2, EDGE_FACTOR)
    for _ in range(EQUAL_ROUNDS):
        rows = [_pulled(density, factors, fabric.compression, pull) for pull in (0.0, 0.5 * np.pi)]
        factors = 0.5 * factors + 0.5 * solved_within(np.array(rows), wanted, EDGE_FACTOR)
    return factors


def solved_within(rows: Floats, wanted: Floats, usual: float) -> Floats:
    """The two factors that solve rows @ factors = wanted; one may be clipped near ``usual``, the other refitted."""
    low, high = usual * LEAST_FACTOR, usual * MOST_FACTOR
    try:
        factors = np.asarray(np.linalg.solve(rows, wanted), dtype=np.float64)
    except np.linalg.LinAlgError:
        factors = np.full(2, low)
    if (factors >= low).all() and (factors <= high).all():
        return factors
    worst = int(np.argmin(factors))
    factors[worst] = np.clip(factors[worst], low, high)
    other, row = 1 - worst, rows[1 - worst]
    left = wanted[other] - row[worst] * factors[worst]
    factors[other] = np.clip(left / max(row[other], np.finfo(float).tiny), low, high)
    return factors


def _pulled(density: Floats, factors: Floats, compression: float, direction: float) -> Floats:
    """Contribution of each family to the network's K, pulled in a direction with free sides.

    The strains are e(angle) = cos^2 - t sin^2 + g sin cos with the contraction t and the shear g that cost least.
    """
    angle = np.arange(DIRECTIONS) * np.pi / DIRECTIONS - direction
    cosine, sine = np.cos(angle), np.sin(angle)
    derivatives = np.stack([-(sine**2), sine * cosine], axis=1)  # change of e with t and g
    total = density @ factors
    free = np.array([0.3, 0.0])
    for _ in range(NEWTON_ROUNDS):
        strain = cosine**2 + derivatives @ free
        weight = total * np.where(strain > 0.0, 1.0, compression)
        slope = derivatives.T @ (weight * strain * np.abs(strain))
        curve = (derivatives * (2.0 * weight * np.abs(strain))[:, None]).T @ derivatives
        curve += 1e-9 * (np.trace(curve) + 1e-30) * np.eye(2)
        free = free - np.clip(np.linalg.solve(curve, slope), -0.3, 0.3)
    strain = cosine**2 + derivatives @ free
    cubes = np.abs(strain) ** 3 * np.where(strain > 0.0, 1.0, compression)
    return cubes @ density


def yarn_constants(sheet: Sheet, fabric: Fabric) -> YarnConstants:
    """Yarns of every triangle that has an area, of the stiffnesses that ``yarn_stretches`` computes."""
    shear = fabric.shear if fabric.shear is not None else 0.0
    yarns = yarn_stretches(fabric.stretch_warp, fabric.stretch_weft, shear, fabric.compression)
    used = sheet.areas > THINNEST_FRACTION * float(np.median(sheet.areas))
    flat, areas = sheet.flat[used], sheet.areas[used]
    sides = np.swapaxes(flat[:, 1:] - flat[:, :1], 1, 2)  # columns are the sides from the first corner
    inverse = np.linalg.inv(sides)  # [F, corner, direction]
    slope = np.stack([inverse[:, 0, 0], inverse[:, 1, 0], inverse[:, 0, 1], inverse[:, 1, 1]], axis=1)
    return YarnConstants(
        triangles=np.flatnonzero(used).astype(np.int32),
        corners=sheet.triangles[used].astype(np.int32),
        slope=slope,
        weft=areas * yarns.weft,
        warp=areas * yarns.warp,
        shear=areas * yarns.shear,
        compression=fabric.compression,
        areas=areas,
        friction=fabric.shear_friction,
    )


class YarnStretches(NamedTuple):
    """K of the yarns of a woven fabric [N/m]."""

    warp: float
    weft: float
    shear: float  # of each of the two bias yarns


def yarn_stretches(warp: float, weft: float, shear: float, compression: float) -> YarnStretches:
    """K of warp, weft and bias yarns [N/m] such that the cloth has these stretches and this shear.

    Sheared by an angle g, the biases have strains of +-g/2 and energy (1 + c) K_b / 3 (g / 2)^3 per area, so K_b =
    8 shear / (1 + c). Pulled by e with its sides free, the cloth contracts by t e where that costs least, and bears
    K_warp + 2 K_b ((1 - t) / 2)^3 + c t^3 K_weft in all.
    """
    shear_yarn = 8.0 * shear / (1.0 + compression)
    own = np.array([warp, weft])
    for _ in range(EQUAL_ROUNDS):
        resisted = compression * own[::-1]
        least = LEAST_RESISTED * shear_yarn + np.finfo(float).tiny
        ratio = np.sqrt(shear_yarn / np.maximum(4.0 * resisted, least))
        t = np.where(resisted > 0.0, ratio / (1.0 + ratio), 1.0)
        own = np.array([warp, weft]) - 2.0 * shear_yarn * (0.5 * (1.0 - t)) ** 3 - resisted * t**3
    return YarnStretches(float(own[0]), float(own[1]), shear_yarn)
