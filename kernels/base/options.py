"""Thread blocks, the bit layout of packed triangle pairs, and the options that kernels are compiled for.

Imports no Warp: processes that only load files have none.
"""

import enum
from dataclasses import dataclass
from typing import Any, NamedTuple

BLOCK_MEMORY = 36 * 1024  # [bytes] of a thread block; six such blocks fit a multiprocessor of a large GPU
BLOCK_THREADS = 192  # that work on a patch
BLOCKS_PER_CORE = 5  # that must fit its registers: some load while others compute
WORN_THREADS = 160  # where the avatar is queried: that takes registers, and as many blocks still fit a core
FEW = 264  # blocks: two for each core of a large GPU
SLOTS = 3  # edges that a thread takes at most with its two triangles
# Layout of the words that describe triangles a, b, c and b, a, d to a thread, or an edge that no thread takes with its
# triangles: numbers of NUMBER_BITS, one after another, and other fields from a certain bit on.
NUMBER_BITS = 10
WORD_CODE, CODE_BITS = 44, 5  # of the first word: which side each edge is that is taken in addition to the shared one
WORD_REVERSED, REVERSED_BITS = 40, 3  # of the second word: whose torque is negated, of each triangle's sides
WORD_BEGIN, BEGIN_BITS = 46, 2  # and at which corner the mesh begins each triangle
WORD_ACROSS = 54  # of both: the triangle across one of those edges
WORD_CONSTANTS = 40  # of an edge that no thread takes: number of its constants
SIDE_BC, SIDE_CA, SIDE_AD, SIDE_DB, SIDE_AB = 1, 2, 3, 4, 5  # which side an edge is; 0: there is no edge
CODE_BACK, CODE_AFTER = 8, 16  # it runs against its triangle's winding; that is the hinge's second one
RANKS = 8  # edges or triangles at a vertex that one vec4i packs


class Block(NamedTuple):
    """A thread block that computes a patch, on a large GPU."""

    threads: int
    memory: int  # [bytes]
    per_core: int  # blocks that must fit its memory and registers: some load while others compute
    vertices: int  # that a patch owns at most: with what is around them they nearly always fit the memory


SINGLE = Block(BLOCK_THREADS, BLOCK_MEMORY, BLOCKS_PER_CORE, 152)
PAIRS = Block(256, 47 * 1024, 4, 200)  # a thread for a pair of triangles: less of the work is at borders


def block_for(paired: bool) -> Block:
    """The block for patches whose threads compute pairs of triangles, or single ones."""
    return PAIRS if paired else SINGLE


class Accumulate(enum.Enum):
    """What the fourth component of a load sums besides the force: at a vertex, an edge's end or a triangle's corner."""

    NONE = "none"
    STIFFNESS = "stiffness"  # a bound [N/m], for the accelerated step
    ANISOTROPIC_STIFFNESS = "anisotropic stiffness"  # the same for a step that may be longer across yarns
    MAGNITUDE = "magnitude"  # of the forces that act there [N], for the certificate

    @property
    def is_bound(self) -> bool:
        """Whether it is a bound of the stiffness."""
        return self in (Accumulate.STIFFNESS, Accumulate.ANISOTROPIC_STIFFNESS)


class SpringField(enum.IntEnum):
    """Where a figure of an edge stands in ``Edges.spring`` and ``Patches.edge_constants`` (kernels.base.types)."""

    LENGTH = 0  # at rest [m]
    PULL = 1  # stiffness while it is stretched [N/m2]
    PUSH = 2  # while it is shortened [N/m2]
    HINGE = 3  # C of its hinge [N m]; of ``edge_constants``


class SliderField(enum.IntEnum):
    """Where a figure of a hinge's friction stands in ``hysteresis`` of Edges, Hinges, Patches (kernels.base.types)."""

    MOMENT = 0  # at which it slips [N m]
    STEEPNESS = 1  # inverse of the fold at which it does
    COSINE = 2  # of the angle that the cloth was laid into
    SINE = 3


class ShearSliderField(enum.IntEnum):
    """Where a figure of a woven triangle's friction stands in ``shear_hysteresis`` of Triangles, Weave, Patches."""

    FRICTION = 0  # area times the force per width at which yarns slip [N m]
    STEEPNESS = 1  # inverse of the shear at which they do
    LAID = 2  # shear that the cloth was laid into


class YarnField(enum.IntEnum):
    """Where a figure of a woven triangle stands in ``Weave.yarns``, ``Triangles.yarns`` and ``Patches.yarns``."""

    WEFT = 0  # area times stiffness K of the weft [N m]
    WARP = 1  # of the warp
    SHEAR = 2  # of each of the two bias yarns, which bear the fabric's ``shear``
    COMPRESSION = 3  # stiffness while they are shortened, as a fraction of that while they are stretched


class Yarn(enum.IntEnum):
    """Which of a triangle's four yarns a figure is of, in a vec4 of such figures (kernels.laws.yarn)."""

    WEFT = 0
    WARP = 1
    PLUS = 2  # the bias between weft and warp
    MINUS = 3  # the bias between weft and the warp's opposite


class SlopeField(enum.IntEnum):
    """Where a corner's slope stands in ``Weave.slope``, ``Triangles.slope`` and ``Patches.slope`` [1/m]."""

    WEFT_1 = 0  # of the second corner along weft
    WEFT_2 = 1  # of the third
    WARP_1 = 2  # of the second corner along warp
    WARP_2 = 3


class Terms(NamedTuple):
    """What acts in a scene's cloth; the kernels are made for these."""

    edges: bool
    folds: bool
    yarns: bool
    angles: bool = False  # folds that are not flat at rest
    pins: bool = False  # vertices that stay
    hysteresis: bool = False  # friction in folds
    shear_hysteresis: bool = False  # friction of yarns that cross


NO_TERMS = Terms(False, False, False)


@dataclass(frozen=True)
class KernelOptions:
    """What the kernels of an iteration are compiled for; equal options give the same kernel.

    precision: of positions and forces (kernels.base.types.PRECISIONS).
    terms: what acts in the cloth.
    accumulate: what a load's fourth component sums besides the force.
    accelerated: each vertex has a step of its own and momentum; else the paper's rule.
    avatar_contact: (collider, world position) -> (normal, distance [m]); None: there is no avatar.
    collider: the struct that it reads, one for each item.
    cloth_contact: whether cloth collides with cloth.
    fits: whether no patch is too large for a block's own memory and threads.
    few: whether there are no more patches than FEW.
    paired: whether a thread works on a pair of triangles at a time.
    packets: whether a packet of vertices is moved at a time, as the CPU does.
    in_order: whether vertices lie in the patches' order.
    packed: whether positions and compliance are packed (kernels.patches.packing).
    block_threads: threads of a block, where that is known at compile time; 0: read on the device.
    """

    precision: str
    terms: Terms = NO_TERMS
    accumulate: Accumulate = Accumulate.NONE
    accelerated: bool = True
    avatar_contact: Any = None
    collider: Any = None
    cloth_contact: bool = False
    fits: bool = False
    few: bool = False
    paired: bool = False
    packets: bool = False
    in_order: bool = False
    packed: bool = False
    block_threads: int = 0

    @property
    def anisotropic(self) -> bool:
        """Whether steps may be longer across yarns (passes.anisotropic_step): of cloth that is worn or lies on cloth.

        What just hangs is taut, and loses nothing by steps alike in all directions.
        """
        return self.accelerated and (self.avatar_contact is not None or self.cloth_contact)


def real_size(precision: str) -> int:
    """Bytes of ``real``, the type of everything but positions."""
    return 8 if precision == "float64" else 4


def point_size(precision: str) -> int:
    """Bytes of a position."""
    return 12 if precision == "float32" else 24


def fold_numbers(terms: Terms) -> int:
    """How many numbers its triangles need of an edge's hinge: those with yarns compute L^2 themselves."""
    return 2 if terms.yarns else 3
