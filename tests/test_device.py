"""Which GPU a command wakes before it imports Warp."""

from __future__ import annotations

import threading

import pytest

from warp_cloth.base import device


@pytest.mark.parametrize(
    ("name", "woken"), [(None, "cuda:0"), ("cuda", "cuda:0"), ("cuda:1", "cuda:1"), ("cuda:7", None), ("cpu", None)]
)
def test_the_gpu_that_a_command_will_use_is_woken(
    name: str | None, woken: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = list[str]()
    monkeypatch.setattr(device, "gpu_count", lambda: 2)
    monkeypatch.setattr(device, "wake_gpu", found.append)
    before = set(threading.enumerate())
    device.begin_waking(name)
    for thread in set(threading.enumerate()) - before:
        thread.join()
    assert found == ([] if woken is None else [woken])
