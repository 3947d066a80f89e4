"""Edges and triangles of a garment as the force kernels read them, in float64 on the host."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices
from warp_cloth.base.topology import Topology
from warp_cloth.garment.rest import Floats, RestShape
from warp_cloth.kernels.base.options import ShearSliderField, SliderField, SpringField


@dataclass(frozen=True, eq=False)
class Elements:
    """Constants of E edges and F triangles as the force kernels read them (kernels.base.types: Edges, Triangles)."""

    ends: Indices  # shape [E, 2]
    spring: Floats  # by SpringField, shape [E, 3]
    adjacent_triangles: Indices  # of each edge's hinge, 0 where it has none, shape [E, 2]
    hinge_stiffness: Floats  # C of that hinge [N m], negative where both triangles run along the edge, shape [E]
    rest: Floats  # cosine and sine of its rest angle, shape [E, 2]
    hysteresis: Floats  # its friction, by SliderField, shape [E, 4]
    corners: Indices  # shape [F, 3]
    edges: Indices  # opposite to each corner, -1 - edge where the hinge's torque has the other sign, shape [F, 3]
    slope: Floats  # as YarnConstants.slope, zero where there are no yarns, shape [F, 4]
    yarns: Floats  # as YarnConstants.packed, shape [F, 4]
    shear_hysteresis: Floats  # as YarnConstants.slider, zero where there is none, shape [F, 3]


@dataclass(frozen=True, eq=False)
class Winding:
    """Orientation of triangles and hinges: the same for every fabric whose hinges are all stiff."""

    ends: Indices  # these three as in Elements
    adjacent_triangles: Indices
    edges: Indices
    hinge_edge: Indices  # edges of the stiff hinges
    sign: Floats  # -1 where both triangles use that edge in the same direction (one-sided cloth), else 1


def winding_of(triangles: Indices, topology: Topology, stiff: NDArray[np.bool_] | slice = slice(None)) -> Winding:
    """The winding of a garment; only ``stiff`` hinges count."""
    ends = topology.edges.copy()
    adjacent = np.zeros((len(ends), 2), dtype=np.int32)
    edges = topology.triangle_edges[:, [1, 2, 0]]
    edge, axis = topology.hinge_edges[stiff], topology.hinges[stiff, :2]
    ends[edge] = axis  # as its first triangle is wound
    adjacent[edge] = topology.hinge_triangles[stiff]
    # where each triangle's sides start, opposite to its corners
    starts = np.roll(triangles, -1, axis=1)
    second = topology.hinge_triangles[stiff, 1]
    there = edges[second] == edge[:, None]
    alike = (there & (starts[second] == axis[:, :1])).any(axis=1)
    counted = edges.copy()
    rows, columns = np.nonzero(there & alike[:, None])
    counted[second[rows], columns] = -1 - edges[second[rows], columns]
    return Winding(ends, adjacent, counted, edge, np.where(alike, -1.0, 1.0))


def garment_elements(triangles: Indices, rest: RestShape, winding: Winding | None = None) -> Elements:
    """Edges and triangles of a garment, in float64; ``winding`` is that of all its hinges, if already computed."""
    stiff = rest.hinge_stiffness > 0.0
    if winding is None or not stiff.all():
        winding = winding_of(triangles, rest.topology, stiff)
    count, edge = len(winding.ends), winding.hinge_edge
    stiffness, angles = np.zeros(count), np.zeros((count, 2))
    stiffness[edge] = winding.sign * rest.hinge_stiffness[stiff]
    angles[:, 0] = 1.0
    if rest.hinge_angle is not None:
        angles[edge, 0], angles[edge, 1] = np.cos(rest.hinge_angle[stiff]), np.sin(rest.hinge_angle[stiff])
    hysteresis = np.zeros((count, len(SliderField)))
    if rest.hinge_slider is not None:
        hysteresis[edge] = rest.hinge_hysteresis[stiff]
    slope, yarns = (np.zeros((len(triangles), 4)) for _ in range(2))
    rubbing = np.zeros((len(triangles), len(ShearSliderField)))
    if rest.yarns is not None:
        slope[rest.yarns.triangles], yarns[rest.yarns.triangles] = rest.yarns.slope, rest.yarns.packed
        rubbing[rest.yarns.triangles] = rest.yarns.slider
    spring = np.empty((count, 3))
    spring[:, SpringField.LENGTH] = rest.edge_length
    spring[:, SpringField.PULL], spring[:, SpringField.PUSH] = rest.edge_pull, rest.edge_push
    return Elements(
        winding.ends,
        spring,
        winding.adjacent_triangles,
        stiffness,
        angles,
        hysteresis,
        triangles,
        winding.edges,
        slope,
        yarns,
        rubbing,
    )


def elements_of(elements: Elements, real: type[np.floating[Any]]) -> Elements:
    """The elements with floating-point numbers of the device's type."""
    floats = {
        name: getattr(elements, name).astype(real)
        for name in ("spring", "hinge_stiffness", "rest", "hysteresis", "slope", "yarns", "shear_hysteresis")
    }
    return replace(elements, **floats)
