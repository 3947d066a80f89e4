"""What + - * / mean in a law, for packets and for the four yarns of a triangle.

Warp looks for functions named ``add``, ``sub``, ``mul`` and ``div`` among the globals of a function before it takes its
own operator; a file that imports these four is written with operators for one value and for a packet alike. Numbers and
vectors of one value have Warp's own + - and *, whose bits are the same.

Warp's hash of a kernel does not see them: every function of ``packet`` carries ``OPERATORS``, a digest of their source,
so that a changed operator is a new kernel. Not looked up are comparisons, u[i] and unary minus: ``packet.negative``.
"""

import hashlib

import warp as wp

from warp_cloth.kernels.math.lanes import WIDTH, elementwise, lane_types, reference
from warp_cloth.kernels.math.real import quotient

div = quotient

for _real in (wp.float32, wp.float64):
    _packet, _single = lane_types(_real, WIDTH), lane_types(_real)
    for _kind in (_packet.real, _packet.vec3, _packet.vec4, _packet.vec6):

        @wp.func_native(elementwise(_kind, "u + v", "ab"))
        def add(a: _kind, b: _kind) -> _kind:
            """a + b."""
            ...

        reference(add, lambda a, b: a + b)

        @wp.func_native(elementwise(_kind, "u - v", "ab"))
        def sub(a: _kind, b: _kind) -> _kind:
            """a - b."""
            ...

        reference(sub, lambda a, b: a - b)

        @wp.func_native(elementwise(_kind, "u * b", "a"))
        def mul(a: _kind, b: _real) -> _kind:
            """Every component of a times one number."""
            ...

        reference(mul, lambda a, b: a * b)

    for _kind in (_packet.real, _packet.vec4, _single.vec4):

        @wp.func_native(elementwise(_kind, "u * v", "ab"))
        def mul(a: _kind, b: _kind) -> _kind:
            """a times b, component by component."""
            ...

    @wp.func_native(elementwise(_packet.vec3, "u * v", "ab", "b"))
    def mul(a: _packet.vec3, b: _packet.real) -> _packet.vec3:
        """Vectors a times numbers b."""
        ...


def source_digest(*functions: wp.Function) -> str:
    """A digest of the C++ of all overloads of some functions."""
    code = hashlib.sha256()
    for function in functions:
        for signature, overload in sorted(function.user_overloads.items()):
            code.update(f"{function.key} {signature} {overload.native_snippet}".encode())
    return code.hexdigest()[:16]


OPERATORS = source_digest(add, sub, mul, div)
