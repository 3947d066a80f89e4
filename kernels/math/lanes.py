"""SIMD packets: eight values that the CPU computes with one instruction, each rounded as it is alone.

A packet of vectors holds the first components of all eight, then the second ones, and so on. Here are the types and
the C++ that functions of packets are made of; ``operators``, ``real`` and ``packet`` are these functions.
"""

import functools
from collections.abc import Callable
from types import SimpleNamespace

import warp as wp

WIDTH = 8  # lanes of a packet
REFERENCES: dict[str, tuple[wp.Function, Callable]] = {}  # functions, and what they compute in NumPy's words
PACKET = "typedef %(real)s Packet __attribute__((ext_vector_type(8)));"


def reference(function: wp.Function, computes: Callable) -> None:
    """States next to a function's C++ what all its overloads compute, of NumPy arrays.

    Of vectors the first axis are the components; a packet has another axis, its lanes.
    """
    REFERENCES[function.__name__] = function, computes


@functools.cache
def lane_types(real: type, lanes: int = 1) -> SimpleNamespace:
    """The types ``real``, ``vec3``, ``vec4`` and ``vec6`` of one value (``lanes`` 1) or of a packet (WIDTH)."""
    if lanes == WIDTH:
        one, three, four, six = (wp.types.vector(length=count * WIDTH, dtype=real) for count in (1, 3, 4, 6))
        return SimpleNamespace(real=one, vec3=three, vec4=four, vec6=six)
    three, four = (wp.vec3f, wp.vec4f) if real is wp.float32 else (wp.vec3d, wp.vec4d)
    return SimpleNamespace(real=real, vec3=three, vec4=four, vec6=wp.types.vector(length=6, dtype=real))


def elementwise(kind: type, code: str, names: str | list, single: str = "") -> str:
    """C++ that computes ``code`` of u, v, w, x for each component of the arguments ``names`` of a type.

    Arguments in ``single`` have one component, which serves all.
    """
    if kind in (wp.float32, wp.float64):
        return " ".join(f"auto {u} = {a};" for u, a in zip("uvwx", names, strict=False)) + f" return {code};"
    count, real = kind._length_, "float" if kind._wp_scalar_type_ is wp.float32 else "double"
    wide = count >= WIDTH
    step = WIDTH if wide else 1
    places = [f"{name}.c[0]" if name in single else f"{name}.c[k]" for name in names]
    if wide:
        read = "Packet {0}; __builtin_memcpy(&{0}, &{1}, sizeof(Packet));"
    else:
        read = "auto {0} = {1};"
        places = [name if name in single else place for name, place in zip(names, places, strict=True)]
    reads = " ".join(read.format(*pair) for pair in zip("uvwx", places, strict=False))
    write = (
        "const Packet r = {0}; __builtin_memcpy(&result.c[k], &r, sizeof(Packet));" if wide else "result.c[k] = {0};"
    )
    return f"""
    {PACKET % {"real": real} if wide else ""}
    wp::vec_t<{count}, {real}> result;
    for (int k = 0; k < {count}; k += {step}) {{
        {reads}
        {write.format(code)}
    }}
    return result;
"""


def vectorwise(count: int, real: type, code: str) -> str:
    """C++ that computes ``count`` components ``code`` of eight results from eight pairs of vec3, u and v."""
    return f"""
    {PACKET % {"real": "float" if real is wp.float32 else "double"}}
    Packet u[3], v[3];
    __builtin_memcpy(u, a.c, sizeof(u));
    __builtin_memcpy(v, b.c, sizeof(v));
    const Packet r[] = {{{code}}};
    wp::vec_t<{count * WIDTH}, {"float" if real is wp.float32 else "double"}> result;
    __builtin_memcpy(result.c, r, sizeof(r));
    return result;
"""
