"""Arrays of many garments on a device: end to end, whether they are put so there or on the host."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import warp as wp
from devices import DEVICES
from numpy.typing import NDArray

from warp_cloth.model import upload as joining
from warp_cloth.model.upload import upload_concatenated

NUMBERS = np.arange(12, dtype=np.int32).reshape(4, 3)
SIGNED = np.array([[-3, 4, -1], [7, -9, 2]], dtype=np.int32)
LAWS = np.linspace(-1.0, 1.0, 20).reshape(5, 4)


@pytest.mark.parametrize(
    ("own", "dtype", "how"),
    [
        ([NUMBERS, SIGNED[:0], NUMBERS + 5], wp.vec3i, {"starts": (0, 4, 100, 104, 108)}),
        ([SIGNED, SIGNED - 7], wp.vec3i, {"starts": (0, 10, 20), "signed": True}),
        ([LAWS, 2.0 * LAWS[:2]], wp.vec4f, {"more": 1}),
        ([LAWS[:, :3].copy()], wp.vec3d, {}),
        ([np.array([5, 1 << 63], dtype=np.uint64), np.array([9], dtype=np.uint64)], wp.uint64, {"more": 2}),
    ],
)
@pytest.mark.parametrize("device", DEVICES)
def test_arrays_are_put_end_to_end_alike_here_and_there(
    own: list[NDArray[Any]], dtype: Any, how: dict[str, Any], device: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "starts" in how:
        how = {**how, "starts": how["starts"] + how["starts"][-1:]}
    several = [*own, own[0]]
    found = []
    for there in (False, True):
        monkeypatch.setattr(joining, "_device_is_faster", lambda *_, there=there: there)
        found.append(upload_concatenated(several, dtype, device, **how).numpy())
    assert found[0].tobytes() == found[1].tobytes()
    assert len(found[0]) == sum(map(len, several)) + how.get("more", 0)
    last = several[-1].astype(found[0].dtype)
    if "starts" in how:
        start = how["starts"][len(several) - 1]
        last = np.where(last < 0, last - start, last + start) if how.get("signed") else last + start
    end = len(found[0]) - how.get("more", 0)
    assert np.array_equal(found[1][end - len(last) : end].reshape(last.shape), last)
    assert not found[1][end:].any()


def test_different_arrays_are_put_together_on_the_host() -> None:
    assert not joining._device_is_faster(9, 10, "cpu")
    assert not joining._device_is_faster(1, 10, "cpu"), "where memory is the same"
