"""A batch on a Ray cluster: one task per shard, scheduled, and retried where workers are lost, by Ray."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Sequence
from typing import Any

from warp_cloth.base.errors import InputError
from warp_cloth.batch.pool import Lost
from warp_cloth.batch.task import DeviceLostError, Done, Task, do_task

RETRIES = 3  # of a task whose worker or node is lost
MOST_SUBMITTED = 4096  # tasks at a time
CONNECT_TIMEOUT = 10.0  # [s] for a connection to the head of the cluster


class RayPool:
    """Tasks on a Ray cluster. Every node must see the output folder.

    ``device``: "cpu" requests a core for each task, "cuda" a GPU; None: GPUs if the cluster has any.
    """

    retries = True  # Ray itself

    def __init__(self, address: str, device: str | None, workers: int | None) -> None:
        self._ray = _ray()
        self._started = not self._ray.is_initialized()
        if self._started:
            _check_answers(address)
            try:
                self._ray.init(address=address, log_to_driver=False, configure_logging=False)
            except (ConnectionError, ValueError, RuntimeError) as error:
                raise _no_answer(address, error) from None
        resources = self._ray.cluster_resources()
        self._resources = task_resources(device, resources)
        kind = next(iter(self._resources))
        places = int(resources.get("GPU" if kind == "num_gpus" else "CPU", 0))
        if not places:
            self.close()
            raise InputError("device", "the cluster has no GPU", "use cpu, or add a node that has one")
        self._device = "cuda:0" if kind == "num_gpus" else "cpu"  # Ray shows a task its own GPU only
        self.devices: Sequence[str] = (self._device,) * min(places, workers or places)
        self._most = len(self.devices) if workers else MOST_SUBMITTED
        self._waiting: list[Task] = []
        self._running: dict[Any, Task] = {}
        self._do = self._ray.remote(do_task).options(
            max_retries=RETRIES, retry_exceptions=[DeviceLostError], name="warp-cloth shard", **self._resources
        )

    def submit(self, task: Task) -> None:
        self._waiting.append(Task(task.store, task.shard, self._device, task.write))

    def finished(self) -> Iterator[Done | Lost]:
        while self._waiting or self._running:
            while self._waiting and len(self._running) < self._most:
                task = self._waiting.pop(0)
                self._running[self._do.remote(task)] = task
            ready, _ = self._ray.wait(list(self._running), num_returns=1)
            for reference in ready:
                task = self._running.pop(reference)
                try:
                    yield self._ray.get(reference)
                except self._ray.exceptions.RayTaskError as error:
                    yield Lost(task, str(error.cause))
                except self._ray.exceptions.RayError as error:
                    yield Lost(task, " ".join(str(error).split())[:300])

    def close(self) -> None:
        for reference in getattr(self, "_running", {}):
            self._ray.cancel(reference, force=True)
        if self._started:
            self._ray.shutdown()


def task_resources(device: str | None, cluster: dict[str, float]) -> dict[str, float]:
    """Resources of a task: a GPU where GPUs are wanted, otherwise a core."""
    if device is None:
        device = "cuda" if cluster.get("GPU") else "cpu"
    if device == "cpu":
        return {"num_cpus": 1}
    if device == "cuda":
        return {"num_gpus": 1, "num_cpus": 1}
    raise InputError("device", f'"{device}" names one device of one machine', "on a cluster use cpu or cuda")


def _check_answers(address: str) -> None:
    """Raises at once where nothing listens at HOST:PORT: Ray itself would try for minutes."""
    host, colon, port = address.rpartition(":")
    if not colon or not port.isdigit() or "/" in host:  # "auto", or another form that Ray understands
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), CONNECT_TIMEOUT).close()
    except (OSError, OverflowError, UnicodeError) as error:
        raise _no_answer(address, error) from None


def _no_answer(address: str, error: Exception) -> InputError:
    return InputError("ray", f"no cluster answers at {address} ({error})", "start one with `ray start --head`")


def _ray() -> Any:
    try:
        import ray
    except ImportError:
        raise InputError("ray", "Ray is not installed", "pip install 'warp-cloth[ray]'") from None
    return ray
