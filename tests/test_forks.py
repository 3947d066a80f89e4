"""Work in copies of a process: in order, and whole where a copy fails or dies."""

from __future__ import annotations

import os
import signal

import pytest

from warp_cloth.base import forks
from warp_cloth.base.forks import LEAST_ITEMS, map_in_forks

ITEMS = range(4 * LEAST_ITEMS)
needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system knows no fork")


def test_results_are_in_order_from_several_processes() -> None:
    results = map_in_forks(lambda item: (item, os.getpid()), ITEMS, 4)
    assert [item for item, _ in results] == list(ITEMS)
    assert len({process for _, process in results}) == (4 if hasattr(os, "fork") else 1)


@pytest.mark.parametrize("copies", [0, 1])
def test_one_process_does_the_work_itself(copies: int) -> None:
    assert {os.getpid()} == set(map_in_forks(lambda _: os.getpid(), ITEMS, copies))


@needs_fork
@pytest.mark.parametrize("end", ["raises", "is killed", "exits"])
def test_items_of_a_copy_that_fails_are_done_here(end: str) -> None:
    here = os.getpid()

    def work(item: int) -> tuple[int, bool]:
        if item == LEAST_ITEMS and os.getpid() != here:
            if end == "raises":
                raise ValueError
            os.kill(os.getpid(), signal.SIGKILL) if end == "is killed" else os._exit(3)
        return item, os.getpid() == here

    results = map_in_forks(work, ITEMS, 4)
    assert [item for item, _ in results] == list(ITEMS)
    assert [at for at, mine in results if mine] == list(range(LEAST_ITEMS, 2 * LEAST_ITEMS))


@needs_fork
def test_what_fails_here_too_is_raised() -> None:
    def work(item: int) -> int:
        return 1 // (item - 5)

    with pytest.raises(ZeroDivisionError):
        map_in_forks(work, ITEMS, 4)


@needs_fork
def test_what_no_process_could_be_copied_for_is_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    fork, made = os.fork, list[int]()

    def twice() -> int:
        if len(made) == 2:
            raise OSError("no memory")
        made.append(fork())
        return made[-1]

    monkeypatch.setattr(os, "fork", twice)
    assert map_in_forks(lambda item: item, ITEMS, 4) == list(ITEMS)
    for process in made:
        with pytest.raises(ChildProcessError):  # it has been waited for
            os.waitpid(process, os.WNOHANG)


@needs_fork
def test_copies_end_with_the_process_that_made_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forks, "_receive", lambda *_: os.kill(os.getpid(), signal.SIGKILL))
    copied, into = os.pipe()

    def work(_: int) -> bytes:
        os.write(into, b".")
        return bytes(1 << 20)  # more than a pipe takes

    parent = os.fork()
    if not parent:
        map_in_forks(work, ITEMS, 4)
        os._exit(0)
    os.close(into)
    _, status = os.waitpid(parent, 0)
    assert os.WTERMSIG(status) == signal.SIGKILL
    while os.read(copied, 64):
        pass  # until all copies have ended, too
    os.close(copied)
