"""A batch on a Ray cluster: the same results, though a node is lost midway."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
import warp as wp

from warp_cloth.base.errors import InputError
from warp_cloth.batch import Item, run_batch
from warp_cloth.batch.cluster import task_resources
from warp_cloth.batch.run import BatchProgress

ray = pytest.importorskip("ray")


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Two nodes of one core each, on this machine; the second can be taken away."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        yield nodes
    finally:
        ray.shutdown()
        with contextlib.suppress(Exception):
            nodes.shutdown()


def items(count: int) -> list[Item]:
    changes = ("garment.shape.vertices_per_side=5", "garment.fabric=silk")
    return [Item(f"item-{i}", "hanging", (*changes, f"solver.iterations={100 + 20 * i}")) for i in range(count)]


def rows(folder: Path) -> list[dict[str, Any]]:
    return pyarrow.parquet.read_table(folder / "results.parquet").to_pylist()


@pytest.mark.long
def test_a_cluster_that_loses_a_node_midway_gives_the_same_results(cluster: Any, tmp_path: Path) -> None:
    second = cluster.add_node(num_cpus=1)
    cluster.wait_for_nodes()
    lost: list[bool] = []

    def lose_a_node(progress: BatchProgress) -> None:
        if progress.done and not lost:
            lost.append(True)
            cluster.remove_node(second, allow_graceful=False)

    report = run_batch(items(12), tmp_path / "ray", device="cpu", ray=cluster.address, shard=1, progress=lose_a_node)
    assert lost
    assert report.complete
    assert report.statuses == {"iteration_limit": 12}
    run_batch(items(12), tmp_path / "here", device="cpu", workers=1, shard=1)
    assert rows(tmp_path / "ray") == rows(tmp_path / "here")


def test_a_cluster_without_gpus_is_not_asked_for_one(cluster: Any, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the cluster has no GPU"):
        run_batch(items(1), tmp_path, device="cuda", ray=cluster.address)


def test_no_cluster_at_an_address_is_told_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no cluster answers at"):
        run_batch(items(1), tmp_path, ray="127.0.0.1:1")


@pytest.mark.long
@pytest.mark.skipif(wp.is_cuda_available(), reason="the GPU that the node claims is there")
def test_what_needs_a_gpu_goes_to_the_node_that_claims_one_and_says_that_it_does_not_answer(
    cluster: Any, tmp_path: Path
) -> None:
    cluster.add_node(num_cpus=1, num_gpus=1)
    cluster.wait_for_nodes()
    report = run_batch(items(1), tmp_path, ray=cluster.address)
    assert report.statuses == {"failed": 1}
    assert [row["message"] for row in rows(tmp_path)] == ["cuda:0 does not respond"]


@pytest.mark.parametrize(
    ("device", "resources", "asked"),
    [
        (None, {"CPU": 4.0}, {"num_cpus": 1}),
        (None, {"CPU": 4.0, "GPU": 1.0}, {"num_gpus": 1, "num_cpus": 1}),
        ("cpu", {"CPU": 4.0, "GPU": 1.0}, {"num_cpus": 1}),
        ("cuda", {"CPU": 4.0, "GPU": 2.0}, {"num_gpus": 1, "num_cpus": 1}),
    ],
)
def test_gpus_are_asked_of_ray_where_they_are_wanted(
    device: str | None, resources: dict[str, float], asked: dict[str, float]
) -> None:
    assert task_resources(device, resources) == asked
