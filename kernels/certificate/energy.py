"""Energies of edges, yarns and hinges as the cloth lies, and the strains of edges and yarns."""

import functools

import warp as wp

from warp_cloth.kernels.base.options import SliderField, Terms, Yarn
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, difference_function, hinge_sides_function
from warp_cloth.kernels.laws.energy import (
    bending_energy,
    shear_slider_energy,
    slider_energy,
    tension_energy,
    yarn_energy,
)
from warp_cloth.kernels.laws.hinge import hinge_normals, rotated_back
from warp_cloth.kernels.laws.tension import spring_constants
from warp_cloth.kernels.laws.yarn import bias_vectors, warp_vector, weft_vector, yarn_stiffness


@functools.cache
def measure_tension_kernel(precision: str) -> wp.Kernel:
    """Kernel ``measure_tension``."""
    types, difference = cloth_types(precision), difference_function(precision)
    real, State, Edges = types.real, types.State, types.Edges

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_tension(
        state: State,
        edges: Edges,
        energy_out: wp.array(dtype=wp.float64),  # [J], shape [E]
        strain_out: wp.array(dtype=real),  # (r - L) / L, shape [E]
    ):
        """Energy and strain of each edge."""
        edge = wp.tid()
        rest, pull, push = spring_constants(edges.spring[edge])
        length = wp.length(difference(state.position[edges.ends[edge][1]], state.position[edges.ends[edge][0]]))
        energy_out[edge] = wp.float64(tension_energy(length - rest, pull, push))
        strain_out[edge] = (length - rest) / rest

    return measure_tension


@functools.cache
def measure_weave_kernel(precision: str, terms: Terms) -> wp.Kernel:
    """Kernel ``measure_weave``, of yarns with friction or without."""
    types, difference = cloth_types(precision), difference_function(precision)
    vec4, State, Weave = types.vec4, types.State, types.Weave

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_weave(
        state: State,
        weave: Weave,
        energy_out: wp.array(dtype=wp.float64),  # [J], shape [T]
        stretch_out: wp.array(dtype=vec4),  # of weft, warp and both biases: r / L, shape [T]
    ):
        """Energy and stretches of each woven triangle; what its friction has taken since it was laid counts."""
        triangle = wp.tid()
        corners = weave.corners[triangle]
        pull, push = yarn_stiffness(weave.yarns[triangle])
        slope = weave.slope[triangle]
        side_1 = difference(state.position[corners[1]], state.position[corners[0]])
        side_2 = difference(state.position[corners[2]], state.position[corners[0]])
        weft, warp = weft_vector(slope, side_1, side_2), warp_vector(slope, side_1, side_2)
        plus, minus = bias_vectors(weft, warp)
        straight = yarn_energy(weft, pull[Yarn.WEFT], push[Yarn.WEFT])
        straight += yarn_energy(warp, pull[Yarn.WARP], push[Yarn.WARP])
        biases = yarn_energy(plus, pull[Yarn.PLUS], push[Yarn.PLUS])
        biases += yarn_energy(minus, pull[Yarn.MINUS], push[Yarn.MINUS])
        if wp.static(terms.shear_hysteresis):
            straight += shear_slider_energy(weft, warp, weave.shear_hysteresis[triangle])
        energy_out[triangle] = wp.float64(straight + biases)
        stretch_out[triangle] = vec4(wp.length(weft), wp.length(warp), wp.length(plus), wp.length(minus))

    return measure_weave


@functools.cache
def measure_bending_kernel(precision: str, terms: Terms) -> wp.Kernel:
    """Kernel ``measure_bending``, of hinges with rest angles or flat ones, with friction or without."""
    types = cloth_types(precision)
    real, vec2, State, Hinges = types.real, types.vec2, types.State, types.Hinges
    hinge_sides = hinge_sides_function(precision)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def measure_bending(
        state: State,
        hinges: Hinges,
        energy_out: wp.array(dtype=wp.float64),  # [J], shape [H]
    ):
        """Energy of each hinge and what its friction has taken since it was laid; none where a triangle has no area."""
        hinge = wp.tid()
        corners = hinges.corners[hinge]
        axis, wing_0, wing_1 = hinge_sides(state.position, corners)
        normal_0, normal_1, area_0, area_1 = hinge_normals(axis, wing_0, wing_1)
        against = normal_1
        if wp.static(terms.angles):
            against = rotated_back(normal_1, axis, hinges.rest[hinge])
        energy = real(0.0)
        if area_0 > real(0.0) and area_1 > real(0.0):
            energy = bending_energy(normal_0, against, hinges.stiffness[hinge])
            if wp.static(terms.hysteresis):
                slider = hinges.hysteresis[hinge]
                laid = rotated_back(normal_1, axis, vec2(slider[SliderField.COSINE], slider[SliderField.SINE]))
                energy += slider_energy(normal_0, laid, slider[SliderField.MOMENT], slider[SliderField.STEEPNESS])
        energy_out[hinge] = wp.float64(energy)

    return measure_bending
