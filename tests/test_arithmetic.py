"""The vocabulary of the laws: a function computes what is stated with it, a packet has the bits of its lanes."""

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp

from warp_cloth.kernels.math import operators
from warp_cloth.kernels.math.lanes import REFERENCES, WIDTH, lane_types
from warp_cloth.kernels.math.operators import OPERATORS, add, div, mul, source_digest, sub
from warp_cloth.kernels.math.packet import (
    absolute,
    any_greater,
    broadcast,
    component,
    cross,
    dot,
    maximum,
    minimum,
    negative,
    symmetric,
    vector3,
    vector4,
    where_greater,
)
from warp_cloth.kernels.math.real import fused, inner, reciprocal, root, scaled_sum, where_positive

FOLDER = Path(operators.__file__).parents[1]
PLAIN = {"enable_backward": False, "fuse_fp": False}
# A reference rounds a product that its function fuses: by half a unit in the last place of the largest term.
LAST_DIGITS = {np.float32: 4e-7, np.float64: 8e-16}


def whole_vocabulary(real: Any, lanes: int) -> wp.Kernel:
    types: SimpleNamespace = lane_types(real, lanes)
    one, vec3, single = types.real, types.vec3, lane_types(real).vec3

    @wp.func
    def mixture(a: vec3, b: vec3, number: real):
        """A number in which every function has a part."""
        square, x, y = inner(a, b), component(a, 0), component(b, 1)
        fours = vector4(square, x, y, component(a, 2) - component(b, 2))
        size = absolute(fours)
        picked = where_positive(fours, root(size), reciprocal(maximum(size, type(size)(number))))
        picked = minimum(picked * size, picked + fours * number)
        ends = vector3(component(picked, 0), component(picked, 1), component(picked, 2) + component(picked, 3))
        moved = scaled_sum(a, component(picked, 3), b * maximum(x, y)) + (ends * number - b)
        turned = where_greater(x, y, cross(moved, ends), negative(broadcast(x, single(number, -number, number))))
        quotient = x / (absolute(y) + type(y)(number))
        matrix = symmetric(x, y, dot(a, turned), fused(x, y, square), root(absolute(y)), quotient)
        mixed = component(matrix, 2) + component(matrix, 3) * (component(matrix, 4) + component(matrix, 5))
        if any_greater(x, type(x)(real(1.0e9))):
            mixed = where_positive(x, x, y)
        return mixed + inner(moved, ends) * minimum(absolute(x), type(y)(number))

    @wp.kernel(module="unique", module_options=PLAIN)
    def mix(a: wp.array(dtype=vec3), b: wp.array(dtype=vec3), number: real, mixed_out: wp.array(dtype=one)):
        row = wp.tid()
        mixed_out[row] = mixture(a[row], b[row], number)

    return mix


@pytest.mark.parametrize(("real", "dtype"), [(wp.float32, np.float32), (wp.float64, np.float64)])
def test_a_packet_has_the_bits_of_its_lanes(real: Any, dtype: Any) -> None:
    random = np.random.default_rng(4)
    a, b = (10.0 ** random.uniform(-4, 2, (64, 3)) * random.choice([-1.0, 1.0], (64, 3)) for _ in range(2))
    a[:4], b[2:6] = 0.0, 0.0
    found = []
    for lanes in (1, WIDTH):
        types = lane_types(real, lanes)
        vectors = [v.astype(dtype) for v in (a, b)]
        if lanes > 1:
            vectors = [v.reshape(-1, WIDTH, 3).transpose(0, 2, 1).reshape(-1, 3 * WIDTH) for v in vectors]
        arrays = [wp.array(v, dtype=types.vec3, device="cpu") for v in vectors]
        mixed = wp.zeros(len(vectors[0]), dtype=types.real, device="cpu")
        wp.launch(whole_vocabulary(real, lanes), dim=len(mixed), inputs=[*arrays, 0.7, mixed], device="cpu")
        found.append(mixed.numpy().ravel())
    assert np.isfinite(found[0]).all()
    assert np.array_equal(found[0], found[1])
    assert len(np.unique(found[0])) > 32


CALLS = "test_arithmetic_calls"  # one module, compiled once
wp.set_module_options(PLAIN, module=wp.get_module(CALLS))


def call_of(function: wp.Function, kinds: list[Any], result: Any) -> wp.Kernel:
    """A kernel that calls a function with the first elements of arrays of some types."""
    one, two, three, four, five, six = (*kinds, *[wp.int32] * (6 - len(kinds)))

    def call_1(a: wp.array(dtype=one), result_out: wp.array(dtype=result)):
        result_out[0] = function(a[0])

    def call_2(a: wp.array(dtype=one), b: wp.array(dtype=two), result_out: wp.array(dtype=result)):
        result_out[0] = function(a[0], b[0])

    def call_3(
        a: wp.array(dtype=one), b: wp.array(dtype=two), c: wp.array(dtype=three), result_out: wp.array(dtype=result)
    ):
        result_out[0] = function(a[0], b[0], c[0])

    def call_4(
        a: wp.array(dtype=one),
        b: wp.array(dtype=two),
        c: wp.array(dtype=three),
        d: wp.array(dtype=four),
        result_out: wp.array(dtype=result),
    ):
        result_out[0] = function(a[0], b[0], c[0], d[0])

    def call_6(
        a: wp.array(dtype=one),
        b: wp.array(dtype=two),
        c: wp.array(dtype=three),
        d: wp.array(dtype=four),
        e: wp.array(dtype=five),
        f: wp.array(dtype=six),
        result_out: wp.array(dtype=result),
    ):
        result_out[0] = function(a[0], b[0], c[0], d[0], e[0], f[0])

    return wp.kernel({1: call_1, 2: call_2, 3: call_3, 4: call_4, 6: call_6}[len(kinds)], module=CALLS)


def components(flat: np.ndarray) -> np.ndarray:
    """One value or one packet as references take it: components first, then lanes."""
    return flat.reshape(-1, WIDTH) if flat.size % WIDTH == 0 and flat.size > WIDTH else flat


def overloads() -> list[Any]:
    """Every overload of every function: it, its argument types, the kernel that calls it, and what it computes."""
    cases = []
    for name, (function, computes) in sorted(REFERENCES.items()):
        for signature, overload in sorted(function.user_overloads.items()):
            kinds = [wp.int32 if kind is int else kind for kind in overload.input_types.values()]
            result = overload.func.__annotations__["return"]
            result = wp.bool if result is bool else result
            call = call_of(function, kinds, result)
            cases.append(pytest.param(name, kinds, result, call, computes, id=f"{name}-{signature}"))
    return cases


@pytest.mark.parametrize(("name", "kinds", "result", "call", "computes"), overloads())
def test_a_function_computes_what_is_stated_beside_it(
    name: str, kinds: list[Any], result: Any, call: wp.Kernel, computes: Callable
) -> None:
    random = np.random.default_rng(7)
    arrays, inputs = [], []
    for kind in kinds:
        length = getattr(kind, "_length_", 1)
        dtype = wp.dtype_to_numpy(getattr(kind, "_wp_scalar_type_", kind))
        flat = np.ones(1, dtype) if kind is wp.int32 else random.uniform(0.5, 2.0, length).astype(dtype)
        if kind is not wp.int32 and name != "root":
            flat *= random.choice([-1, 1], length).astype(dtype)
        arrays.append(wp.array(flat[None] if length > 1 else flat, dtype=kind, device="cpu"))
        inputs.append(flat[0] if length == 1 else components(flat))
    found = wp.zeros(1, dtype=result, device="cpu")
    wp.launch(call, 1, inputs=[*arrays, found], device="cpu")
    expected = np.broadcast_to(np.asarray(computes(*inputs), found.numpy().dtype).ravel(), found.numpy().ravel().shape)
    tolerance = LAST_DIGITS.get(found.numpy().dtype.type, 0.0) * max(float(np.abs(expected).max()), 4.0)
    assert np.abs(found.numpy().ravel().astype(float) - expected).max() <= tolerance


def test_every_overload_of_the_vocabulary_has_a_reference() -> None:
    for name in ("operators", "packet", "real"):
        module = __import__(f"warp_cloth.kernels.math.{name}", fromlist=[name])
        for value in vars(module).values():
            if isinstance(value, wp.Function) and value.native_snippet:
                assert value.__name__ in REFERENCES, value.__name__


def test_operators_enter_every_hash() -> None:
    """Warp's hash follows calls, not operators: so what the laws call besides carries the operators' digest."""
    assert source_digest(add, sub, mul, div) == OPERATORS
    for name, (function, _) in REFERENCES.items():
        if function.__module__.endswith("math.packet"):
            for overload in function.user_overloads.values():
                assert OPERATORS in overload.native_snippet, name


def test_a_changed_operator_changes_the_digest(monkeypatch: pytest.MonkeyPatch) -> None:
    overload = next(iter(mul.user_overloads.values()))
    monkeypatch.setattr(overload, "native_snippet", overload.native_snippet.replace("u * b", "u + b"))
    assert source_digest(add, sub, mul, div) != OPERATORS


def test_files_with_the_vocabulary_of_packets_have_their_operators() -> None:
    """Without them Warp's own operators would be taken, which for packets are loops, or none."""
    for path in FOLDER.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "kernels.math.packet import" in text and "def " in text:
            assert "kernels.math.operators import" in text, path


CALL_FORMS = re.compile(r"\b(products|sums|differences|times|scaled|opposite)\(")


def test_no_arithmetic_in_call_form_is_left() -> None:
    for folder in ("math", "laws", "elements", "patches", "passes"):
        for path in (FOLDER / folder).glob("*.py"):
            assert not CALL_FORMS.search(path.read_text(encoding="utf-8")), path
