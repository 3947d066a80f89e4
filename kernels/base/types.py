"""Device arrays of a garment in one precision, as structs that the force and displacement kernels share."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_cloth.kernels.base.access import element
from warp_cloth.kernels.base.options import Accumulate, point_size, real_size

PRECISIONS = ("float32", "mixed", "float64")

# Compilers fuse no multiplication and addition of their own choice: so the CPU and CUDA round alike, operation by
# operation, and a fit gives the same bits on both. Where fusing pays, ``arithmetic`` has it written out for both.
MODULE_OPTIONS = {"enable_backward": False, "fuse_fp": False}


def takes_exact_stretch(precision: str, accumulate: Accumulate) -> bool:
    """Whether forces take r - L out of squares in the positions' own float64.

    Of yarns drawn out by a thousandth a float32 length keeps no more than four digits of the stretch: 0.03 vertex
    weights on 66,000 vertices of 200 kN/m. A step that goes by a bound ends by the certificate long before that tells.
    """
    return precision == "mixed" and not accumulate.is_bound


@wp.struct
class Patch:
    """Where a patch's data begin in the arrays, and how many there are; stored as four vec4i."""

    vertex_start: int
    vertex_count: int
    owned_count: int  # of its vertices
    item: int  # that it belongs to
    edge_start: int
    edge_count: int
    constants_start: int
    constants_count: int  # of its edges' constants, each once, where threads compute pairs of triangles
    triangle_start: int
    triangle_count: int  # those at its vertices, which come first
    normal_count: int  # and those beyond its edges
    slot_start: int
    ranks: int  # edges or triangles at a vertex, at most
    overflow: int  # where its overflow memory starts if shared memory is too small; else -1
    place: int  # of its first owned vertex, where vertices are in the patches' order
    tile_count: int  # pairs of triangles and single ones, one for each thread (patches.tiles); where it bends


def _parameters(types: SimpleNamespace) -> dict[str, type]:
    """What an iteration goes by: ``Step``, ``Item``."""
    real, vec3 = types.real, types.vec3

    @wp.struct
    class Step:
        """Parameters of an iteration, the same for all items."""

        gravity: vec3  # unit vector
        allowance: real  # change of length that the bound allows for, as a fraction of the vertex's last displacement
        momentum: real  # fraction of the last displacement that is repeated
        momentum_loose: real  # the same for worn cloth that is loose, whose displacements nothing else damps
        damping: real  # factor on momentum where the displacement points against the force
        viscosity: real  # fraction of an edge's stiffness that resists its ends' moving apart
        buckling: real  # fraction of that which acts across an edge that is shorter than at rest; worn cloth only
        memory: real  # fraction of a vertex's stiffness bound that is carried over from one iteration to the next
        memory_falling: real  # the same for worn cloth that is not loose yet
        horizon: real  # how many last displacements ahead a compliance allows for

    @wp.struct
    class Item:
        """Parameters of one fit of a batch; a single fit is a batch of one."""

        cap: real  # largest displacement in an iteration [m]
        offset: float  # contact offset [m]
        avatar_friction: float  # Coulomb coefficient of avatar.friction
        anisotropy_limit: real  # how many times the bound's step a step may be at most where cloth is soft; 0: once
        active: int  # 0: at rest, or stopped; its vertices stay and cost nothing

    return {"Step": Step, "Item": Item}


def _vertices(types: SimpleNamespace) -> dict[str, type]:
    """``Model``, ``State`` and ``Vertex``."""
    real, point, vec3, vec4, vec6, Item = types.real, types.point, types.vec3, types.vec4, types.vec6, types.Item

    @wp.struct
    class Model:
        """Constants of the vertices of all garments of all items, concatenated; V vertices."""

        weight: wp.array(dtype=real)  # [N]
        pinned: wp.array(dtype=wp.uint8)  # where any is
        item: wp.array(dtype=wp.int32)  # which fit each vertex belongs to
        items: wp.array(dtype=Item)  # which the host changes between iterations

    @wp.struct
    class State:
        """What a step changes of the vertices. Arrays that nothing in the scene needs are empty."""

        position: wp.array(dtype=point)  # [m]
        displacement: wp.array(dtype=vec3)  # the last one [m]
        displacement4: wp.array(dtype=vec4)  # the same and its length, in the patches' order (kernels.patches.packing)
        stiffness: wp.array(dtype=real)  # bound that the last step used [N/m]; accelerated method only
        compliance: wp.array(dtype=vec6)  # symmetric factor of the step (passes.anisotropic_step); worn cloth only
        in_contact: wp.array(dtype=wp.uint8)  # whether the avatar pushed it in the last iteration; worn cloth only
        clearance: wp.array(dtype=wp.float32)  # [m] it may move and surely not meet the avatar; where queries are saved

    @wp.struct
    class Vertex:
        """A vertex before a step; units as in State."""

        index: int
        item_index: int
        item: Item
        free: bool  # whether it may move
        position: point
        displacement: vec3
        weight: real
        stiffness: real

    return {"Model": Model, "State": State, "Vertex": Vertex}


def _elements(types: SimpleNamespace) -> dict[str, type]:
    """What forces act in: ``Edges``, ``Triangles``, and ``Rows`` of these at each vertex."""
    real, vec2, vec3, vec4 = types.real, types.vec2, types.vec3, types.vec4

    @wp.struct
    class Edges:
        """E edges; hinges only where cloth bends, ``rest`` only where it is not flat at rest."""

        ends: wp.array(dtype=wp.vec2i)
        spring: wp.array(dtype=vec3)  # of options.SpringField
        adjacent_triangles: wp.array(dtype=wp.vec2i)  # both; the edge runs as the first is wound
        # C of its hinge [N m], negative where the second triangle is wound likewise
        hinge_stiffness: wp.array(dtype=real)
        rest: wp.array(dtype=vec2)  # cosine and sine of its hinge's rest angle
        hysteresis: wp.array(dtype=vec4)  # friction of its hinge, by options.SliderField, where folds have any

    @wp.struct
    class Triangles:
        """F triangles; arrays of the terms that the scene has."""

        corners: wp.array(dtype=wp.vec3i)
        edges: wp.array(dtype=wp.vec3i)  # opposite to each corner; -1 - edge where its torque is negated
        slope: wp.array(dtype=vec4)  # as Weave.slope; zero where there are no yarns
        yarns: wp.array(dtype=vec4)  # as Weave.yarns
        shear_hysteresis: wp.array(dtype=vec3)  # as Weave.shear_hysteresis

    @wp.struct
    class Rows:
        """Edges and triangles at each vertex: row v of ``edge``, ``triangle`` goes from start[v] to start[v + 1]."""

        edge_start: wp.array(dtype=wp.int32)
        edge: wp.array(dtype=wp.int32)
        triangle_start: wp.array(dtype=wp.int32)
        triangle: wp.array(dtype=wp.int32)  # three times the triangle, and which of its corners the vertex is

    return {"Edges": Edges, "Triangles": Triangles, "Rows": Rows}


def _measured(types: SimpleNamespace) -> dict[str, type]:
    """What the certificate measures: ``Hinges``, ``Weave``."""
    real, vec2, vec3, vec4 = types.real, types.vec2, types.vec3, types.vec4

    @wp.struct
    class Hinges:
        """H hinges, as the certificate measures them."""

        corners: wp.array(dtype=wp.vec4i)  # axis start, axis end, two wings
        stiffness: wp.array(dtype=real)  # C [N m]
        rest: wp.array(dtype=vec2)  # cosine and sine of the rest angle, where cloth is not flat at rest
        hysteresis: wp.array(dtype=vec4)  # as Edges.hysteresis

    @wp.struct
    class Weave:
        """T woven triangles, as the certificate measures them."""

        corners: wp.array(dtype=wp.vec3i)
        slope: wp.array(dtype=vec4)  # of the second and third corner along weft, then along warp [1/m]
        yarns: wp.array(dtype=vec4)  # of options.YarnField
        shear_hysteresis: wp.array(dtype=vec3)  # friction of its yarns, by options.ShearSliderField, where any has it

    return {"Hinges": Hinges, "Weave": Weave}


def _geometry(types: SimpleNamespace) -> dict[str, type]:
    """Elements in the present positions: ``Span``, ``Sides``."""
    real, point, vec3 = types.real, types.point, types.vec3

    @wp.struct
    class Span:
        """An edge in the present positions."""

        side: vec3  # from its first end to its second [m]
        length: real  # [m], and never 0
        inverse: real  # of that
        change: vec3  # of the side by the last displacements [m]
        move: real  # length of the first end's last displacement [m]
        exact: point  # the side in the positions' own precision, where forces need it

    @wp.struct
    class Sides:
        """A triangle's sides from its first corner [m]."""

        side_1: vec3
        side_2: vec3
        side_0: vec3  # from the second corner to the third, where hinges need it
        change_1: vec3  # of the sides by the last displacements [m]
        change_2: vec3
        exact_1: point  # as in Span
        exact_2: point

    return {"Span": Span, "Sides": Sides}


def _patches(types: SimpleNamespace) -> dict[str, type]:
    """``Patches``."""
    real, vec2, vec3, vec4 = types.real, types.vec2, types.vec3, types.vec4

    @wp.struct
    class Patches:
        """The cloth cut into patches, a block each. Indices are local to a patch: its own vertices, edges, triangles.

        A uint64 packs four of them, a vec4i eight. The slots that a vertex sums are interleaved: the first eight of
        each vertex, then the next eight; padded with slots that hold zero. Where a thread computes a pair of triangles
        ``ends`` and ``edge_constants`` are as in warp_cloth.model.patches.tiles.
        """

        patch: wp.array(dtype=wp.vec4i)  # as Patch
        vertex: wp.array(dtype=wp.int32)  # of all garments; of each patch those that it owns first
        ends: wp.array(dtype=wp.uint64)  # of an edge, and its two triangles
        edge_constants: wp.array(dtype=vec4)  # of options.SpringField; where there are edges
        hinge_stiffness: wp.array(dtype=real)  # as Edges.hinge_stiffness, where there are folds only
        rest: wp.array(dtype=vec2)  # as Edges.rest
        hysteresis: wp.array(dtype=vec4)  # as Edges.hysteresis
        corners: wp.array(dtype=wp.uint64)  # of a triangle
        sides: wp.array(dtype=wp.uint64)  # its edges, opposite to the corners; bits: whose torque is negated
        slope: wp.array(dtype=vec4)  # as Triangles.slope
        yarns: wp.array(dtype=vec4)
        shear_hysteresis: wp.array(dtype=vec3)
        edge_slot: wp.array(dtype=wp.vec4i)  # twice the edge, and 1 where the vertex is its second end
        slot: wp.array(dtype=wp.vec4i)  # the triangle; after all normals come second corners, then third ones
        ahead: int  # how many patches a GPU computes at a time

    return {"Patches": Patches}


@functools.cache
def cloth_types(precision: str) -> SimpleNamespace:
    """Types and structs of one precision: ``real``, ``point`` (of positions), ``vec3``, ``Model``, ``State`` and more.

    ``wide`` is the type of a position's coordinate.
    ``vec6`` is xx, yy, zz, xy, xz, yz of a symmetric matrix.

    "mixed" keeps positions in float64, takes their differences there and computes everything else in float32: near
    1 m float32 positions are 6e-8 m apart, which on fine stiff cloth is more force noise than a vertex weighs.
    """
    real = wp.float64 if precision == "float64" else wp.float32
    types = SimpleNamespace(
        name=precision,
        real=real,
        wide=wp.float32 if precision == "float32" else wp.float64,
        point=wp.vec3f if precision == "float32" else wp.vec3d,
        vec2=wp.vec2d if precision == "float64" else wp.vec2f,
        vec3=wp.vec3d if precision == "float64" else wp.vec3f,
        vec4=wp.vec4d if precision == "float64" else wp.vec4f,
        vec6=wp.types.vector(length=6, dtype=real),
        real_size=real_size(precision),
        point_size=point_size(precision),
    )
    for structs in (_parameters, _vertices, _elements, _measured, _geometry, _patches):
        vars(types).update(structs(types))
    return types


@wp.func
def rests(model: Any, vertex: int):
    """Whether the item of a vertex no longer iterates; ``model`` of ``cloth_types``."""
    return model.items[element(model.item, vertex)].active == 0


@functools.cache
def free_function(precision: str, pins: bool) -> wp.Function:
    """Function of model and vertex: whether it may move. Without ``pins`` it loads nothing."""
    Model = cloth_types(precision).Model

    @wp.func
    def unpinned(model: Model, vertex: int):
        """Whether a vertex is not pinned."""
        return model.pinned[vertex] == wp.uint8(0)

    @wp.func
    def always(model: Model, vertex: int):
        """True."""
        return True

    return unpinned if pins else always


@functools.cache
def difference_function(precision: str) -> wp.Function:
    """Function ``difference``."""
    types = cloth_types(precision)
    point, real, vec3 = types.point, types.real, types.vec3

    @wp.func
    def difference(a: point, b: point):
        """a - b [m], subtracted in the positions' own precision, then rounded to ``vec3``."""
        d = a - b
        return vec3(real(d[0]), real(d[1]), real(d[2]))

    return difference


@functools.cache
def hinge_sides_function(precision: str) -> wp.Function:
    """Function ``hinge_sides``."""
    types, difference = cloth_types(precision), difference_function(precision)
    point = types.point

    @wp.func
    def hinge_sides(position: wp.array(dtype=point), corners: wp.vec4i):
        """Axis and both wings of a hinge: from its first corner to the others [m]."""
        start = position[corners[0]]
        axis = difference(position[corners[1]], start)
        return axis, difference(position[corners[2]], start), difference(position[corners[3]], start)

    return hinge_sides
