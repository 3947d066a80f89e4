"""The collector rests during imports and while graphs are captured, and is as it was afterwards."""

from __future__ import annotations

import contextlib
import gc
import threading
import time
from typing import Any

import pytest
import warp as wp

import warp_cloth
from warp_cloth.base.collector import collector_paused, no_collection


@pytest.mark.parametrize("rest", [collector_paused, no_collection])
@pytest.mark.parametrize("enabled", [True, False])
def test_the_collector_is_as_it_was_even_after_an_error(enabled: bool, rest: Any) -> None:
    (gc.enable if enabled else gc.disable)()
    try:
        with contextlib.suppress(ValueError), rest():
            assert not gc.isenabled()
            raise ValueError
        assert gc.isenabled() is enabled
    finally:
        gc.enable()
        gc.unfreeze()


def test_it_rests_while_a_graph_is_captured(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    class Watched(wp.ScopedCapture):
        def __enter__(self) -> Any:
            seen.append(gc.isenabled())
            return super().__enter__()

    monkeypatch.setattr(wp, "ScopedCapture", Watched)
    warp_cloth.fit("hanging", overrides=["garment.shape.vertices_per_side=8"], device="cpu")
    assert seen
    assert not any(seen)


def test_a_collection_that_runs_in_another_thread_is_waited_for() -> None:
    """As of what frees a GPU's arrays, which lets other threads run."""
    events: list[str] = []
    began = threading.Event()

    class Slow:
        def __del__(self) -> None:
            began.set()
            time.sleep(0.05)
            events.append("freed")

    def litter() -> None:
        held: list[Any] = [Slow()]
        held.append(held)
        del held
        gc.collect()

    thread = threading.Thread(target=litter)
    thread.start()
    assert began.wait(10.0)
    with no_collection():
        events.append("captured")
    thread.join()
    assert events == ["freed", "captured"]


@pytest.mark.cuda
def test_garbage_of_other_threads_breaks_no_capture() -> None:
    def circle() -> list[Any]:
        held: list[Any] = [wp.zeros(1000, device="cuda:0")]
        held.append(held)
        return held

    garbage, done = [circle() for _ in range(3000)], threading.Event()

    def litter() -> None:
        while garbage and not done.is_set():
            garbage.pop()
            _ = [[] for _ in range(300)]  # which has the collector run

    thread, before = threading.Thread(target=litter), gc.get_threshold()
    gc.set_threshold(100)
    try:
        thread.start()
        for side in (10, 11, 12):  # each with graphs of its own
            fit = warp_cloth.fit("hanging", overrides=[f"garment.shape.vertices_per_side={side}"], device="cuda:0")
            assert fit.worn
    finally:
        done.set()
        thread.join()
        gc.set_threshold(*before)
