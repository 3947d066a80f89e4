"""The kernel that moves vertices by their displacement where they lie, and what it shares with ``passes.advance``."""

import functools

import warp as wp

from warp_cloth.kernels.avatar.field import fetch_field, field_contact
from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.options import KernelOptions
from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types, free_function
from warp_cloth.kernels.contact.search_trigger import load_bounds, note_displacement
from warp_cloth.kernels.math.real import inner, root
from warp_cloth.kernels.passes.step import (
    AHEAD,
    cloth_contact_type,
    colliders_type,
    displacement_function,
    prefetch_function,
    saves_queries,
)
from warp_cloth.kernels.patches.packing import order_functions


@functools.cache
def read_function(options: KernelOptions) -> wp.Function:
    """The function that reads a vertex from memory."""
    types = cloth_types(options.precision)
    Model, State, Vertex, Item = types.Model, types.State, types.Vertex, types.Item
    order = order_functions(options.precision, options.packed, options.in_order)
    position_at, displacement_at = order.position_at, order.displacement_at

    @wp.func
    def read_vertex(model: Model, state: State, index: int, item_index: int, item: Item):
        """A vertex of an item: as it lies, its last displacement, its weight and the stiffness of its last step."""
        vertex = Vertex()
        vertex.index = index
        vertex.item_index = item_index
        vertex.item = item
        vertex.position = position_at(state, index)
        vertex.weight = element(model.weight, index)
        if wp.static(options.accelerated):
            vertex.displacement = displacement_at(state, index)
            vertex.stiffness = element(state.stiffness, index)
        return vertex

    return read_vertex


@functools.cache
def displace_kernel(options: KernelOptions) -> wp.Kernel:
    """Kernel ``displace_vertices``, which moves the cloth where it lies."""
    types, cloth_contact = cloth_types(options.precision), options.cloth_contact
    point, vec3, vec4, Model, State, Step = (
        types.point, types.vec3, types.vec4, types.Model, types.State, types.Step,
    )  # fmt: skip
    vertex_displacement, prefetch = displacement_function(options), prefetch_function(options)
    read_vertex, free = read_function(options), free_function(options.precision, options.terms.pins)

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def displace_vertices(
        model: Model,
        state: State,
        step: Step,
        colliders: colliders_type(options.avatar_contact, options.collider),
        contact: cloth_contact_type(cloth_contact),
        load_out: wp.array(dtype=vec4),  # the cloth's forces [N] and stiffness bounds [N/m], shape [V]; left at zero
    ):
        """Moves each free vertex of an item that is not at rest."""
        index = wp.tid()
        load = element(load_out, index)
        load_out[index] = vec4()
        item_index = element(model.item, index)
        if wp.static(options.avatar_contact is field_contact):
            if index + AHEAD < model.weight.shape[0]:
                queried = True
                if wp.static(saves_queries(options)):
                    queried = element(state.clearance, index + AHEAD) == 0.0
                if queried:
                    fetch_field(colliders[item_index], wp.vec3d(element(state.position, index + AHEAD)))
        item = model.items[item_index]
        if item.active == 0:
            return
        move = vec3()
        if wp.static(cloth_contact):
            iteration, path = load_bounds(contact, index)
        position = element(state.position, index)
        known = prefetch(state, colliders, contact, index, wp.vec3d(position), item_index, item)
        if free(model, index):
            vertex = read_vertex(model, state, index, item_index, item)
            move, inertial, stiffness = vertex_displacement(state, step, colliders, contact, known, load, vertex)
            state.displacement[index] = inertial
            state.position[index] = vertex.position + point(move)
            if wp.static(options.accelerated):
                state.stiffness[index] = stiffness
        if wp.static(cloth_contact):
            note_displacement(contact, index, known.contact, float(root(inner(move, move))), iteration, path)

    return displace_vertices
