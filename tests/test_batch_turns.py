"""Workers on one GPU take turns, and whoever ends, however, leaves the turn to the others."""

from __future__ import annotations

import fcntl
from pathlib import Path
from types import SimpleNamespace

from warp_cloth.batch.gpu_queue import FEW, Turn


def free(path: Path) -> bool:
    """Whether another one could have its turn now."""
    with open(path, "w") as other:
        try:
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


def test_a_turn_ends_when_most_vertices_are_at_rest(tmp_path: Path) -> None:
    path = tmp_path / "turn"
    with Turn(path) as turn:
        assert not free(path)
        turn.offer(20, SimpleNamespace(active_share=FEW))
        assert not free(path)
        turn.offer(40, SimpleNamespace(active_share=FEW - 0.01))
        assert free(path)
    with Turn(path):
        assert not free(path)
    assert free(path)


def test_who_waits_knows_it(tmp_path: Path) -> None:
    turn, other = Turn(tmp_path / "turn"), Turn(tmp_path / "turn")
    assert not turn.taken()
    with other:
        assert turn.taken()
        assert not other.taken()
    assert not turn.taken()
    assert not Turn(None).taken()


def test_one_that_fails_leaves_its_turn(tmp_path: Path) -> None:
    path, turn = tmp_path / "turn", Turn(tmp_path / "turn")
    for _ in range(2):
        try:
            with turn:
                raise MemoryError
        except MemoryError:
            assert free(path)


def test_who_is_alone_needs_no_turn(tmp_path: Path) -> None:
    with Turn(None) as turn:
        turn.offer(20, SimpleNamespace(active_share=0.0))
    assert not list(tmp_path.iterdir())
