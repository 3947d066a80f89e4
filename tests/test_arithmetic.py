"""The words that laws are written in mean the same for eight at a time as for one, to the bit."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp

from warp_cloth.kernels.math.packet import (
    above,
    alike,
    any_above,
    cross,
    differences,
    dot,
    four,
    least,
    most,
    opposite,
    part,
    products,
    scaled,
    six,
    sizes,
    spread,
    sums,
    three,
    times,
)
from warp_cloth.kernels.math.real import (
    WIDTH,
    chosen,
    fused,
    inner,
    inverses,
    quotient,
    root,
    roots,
    scaled_sum,
    shaped,
)


def all_words(real: Any, wide: bool) -> wp.Kernel:
    types: SimpleNamespace = shaped(real, wide)
    one, vec3, alone = types.real, types.vec3, shaped(real, False).vec3

    @wp.func
    def mixture(a: vec3, b: vec3, number: real):
        """A number in which every word has a part."""
        size_2, x, y = inner(a, b), part(a, 0), part(b, 1)
        fours = four(size_2, x, y, differences(part(a, 2), part(b, 2)))
        size = sizes(fours)
        picked = chosen(fours, roots(size), inverses(most(size, alike(size, number))))
        picked = least(products(picked, size), sums(picked, times(fours, number)))
        ends = three(part(picked, 0), part(picked, 1), sums(part(picked, 2), part(picked, 3)))
        moved = sums(scaled_sum(a, part(picked, 3), scaled(b, most(x, y))), differences(times(ends, number), b))
        turned = above(x, y, cross(moved, ends), opposite(spread(x, alone(number, -number, number))))
        matrix = six(
            x, y, dot(a, turned), fused(x, y, size_2), root(sizes(y)), quotient(x, sums(sizes(y), alike(y, number)))
        )
        mixed = sums(part(matrix, 2), products(part(matrix, 3), sums(part(matrix, 4), part(matrix, 5))))
        if any_above(x, alike(x, real(1.0e9))):
            mixed = x
        return sums(mixed, products(inner(moved, ends), least(sizes(x), alike(y, number))))

    @wp.kernel(module="unique", module_options={"enable_backward": False, "fuse_fp": False})
    def mix(a: wp.array(dtype=vec3), b: wp.array(dtype=vec3), number: real, mixed_out: wp.array(dtype=one)):
        row = wp.tid()
        mixed_out[row] = mixture(a[row], b[row], number)

    return mix


@pytest.mark.parametrize(("real", "dtype"), [(wp.float32, np.float32), (wp.float64, np.float64)])
def test_eight_at_a_time_have_the_bits_of_one(real: Any, dtype: Any) -> None:
    random = np.random.default_rng(4)
    a, b = (10.0 ** random.uniform(-4, 2, (64, 3)) * random.choice([-1.0, 1.0], (64, 3)) for _ in range(2))
    a[:4], b[2:6] = 0.0, 0.0
    found = []
    for wide in (False, True):
        types = shaped(real, wide)
        given = [v.astype(dtype) for v in (a, b)]
        if wide:
            given = [v.reshape(-1, WIDTH, 3).transpose(0, 2, 1).reshape(-1, 3 * WIDTH) for v in given]
        arrays = [wp.array(v, dtype=types.vec3, device="cpu") for v in given]
        mixed = wp.zeros(len(given[0]), dtype=types.real, device="cpu")
        wp.launch(all_words(real, wide), dim=len(mixed), inputs=[*arrays, 0.7, mixed], device="cpu")
        found.append(mixed.numpy().ravel())
    assert np.isfinite(found[0]).all()
    assert np.array_equal(found[0], found[1])
    assert len(np.unique(found[0])) > 32
