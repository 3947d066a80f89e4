"""Workers lease the GPU that they share, and a worker that ends, however, releases it to the others."""

from __future__ import annotations

import fcntl
from pathlib import Path
from types import SimpleNamespace

from warp_cloth.batch.gpu_queue import FEW_ACTIVE, GpuLease


def free(path: Path) -> bool:
    """Whether another process could take the lease now."""
    with open(path, "w") as other:
        try:
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


def test_a_lease_ends_when_most_vertices_are_at_rest(tmp_path: Path) -> None:
    path = tmp_path / "lease"
    with GpuLease(path) as lease:
        assert not free(path)
        lease.release_early(20, SimpleNamespace(active_fraction=FEW_ACTIVE))
        assert not free(path)
        lease.release_early(40, SimpleNamespace(active_fraction=FEW_ACTIVE - 0.01))
        assert free(path)
    with GpuLease(path):
        assert not free(path)
    assert free(path)


def test_a_process_knows_whether_another_one_has_the_lease(tmp_path: Path) -> None:
    lease, other = GpuLease(tmp_path / "lease"), GpuLease(tmp_path / "lease")
    assert not lease.taken()
    with other:
        assert lease.taken()
        assert not other.taken()
    assert not lease.taken()
    assert not GpuLease(None).taken()


def test_a_process_that_fails_releases_its_lease(tmp_path: Path) -> None:
    path, lease = tmp_path / "lease", GpuLease(tmp_path / "lease")
    for _ in range(2):
        try:
            with lease:
                raise MemoryError
        except MemoryError:
            assert free(path)


def test_a_process_alone_needs_no_lease(tmp_path: Path) -> None:
    with GpuLease(None) as lease:
        lease.release_early(20, SimpleNamespace(active_fraction=0.0))
    assert not list(tmp_path.iterdir())
