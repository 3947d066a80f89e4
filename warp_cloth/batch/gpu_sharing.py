"""Workers share a GPU through NVIDIA's Multi-Process Service (MPS), where it is there.

By itself a GPU runs the kernels of one process at a time, and those of a single garment leave most of it idle: 96
random designs on bodies of their own took 141 s with 16 workers on an H200, and 61 s through MPS.
https://docs.nvidia.com/deploy/mps/
"""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from warp_cloth.base.device import gpu_memory
from warp_cloth.base.first_run import GPU_FILES
from warp_cloth.base.threads import core_count

CONTROL = "nvidia-cuda-mps-control"
PIPES, LOGS, VISIBLE = "CUDA_MPS_PIPE_DIRECTORY", "CUDA_MPS_LOG_DIRECTORY", "CUDA_VISIBLE_DEVICES"
USUAL_PIPES = "/tmp/nvidia-mps"  # of a service that the machine's users share
OFF = "WARP_CLOTH_MPS"  # environment variable; "off": every process by itself
WORKERS = 4  # a GPU, by itself: while one worker's garments relax, the others load or measure theirs
MOST_WORKERS = 16  # a shared GPU; of 48 designs 16 took 0.84 of the time of 8, 28 workers of 96 as long as 16
MEMORY_EACH = 4 << 30  # [bytes] of a shared GPU for each worker, at least
PATIENCE = 5.0  # [s] for the service to start, which takes a fraction of one

# Ends with the process at the other end of its standard input, however that ends, and leaves nothing behind.
SERVICE = f"""
{CONTROL} -f > /dev/null 2>&1 &
control=$!
ask() {{ echo "$1" | {CONTROL} 2> /dev/null; }}
state=
for _ in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do
    ask "start_server -uid $(id -u)" > /dev/null
    server=$(ask get_server_list | tail -n 1)
    if [ -n "$server" ] && [ "$(ask "get_server_status $server")" = ACTIVE ]; then state=active; break; fi
    kill -0 "$control" 2> /dev/null || break
    sleep 0.1
done
echo "${{state:-none}}"
if [ -n "$state" ]; then read -r _; fi
ask "quit -t 1" > /dev/null
wait
rm -rf "${PIPES}"
"""


@dataclass(frozen=True)
class GpuSharing:
    """How the workers of a batch share its GPUs."""

    active: bool = False  # whether their kernels run at the same time
    environment: tuple[tuple[str, str | None], ...] = ()  # of each worker; None: not set there

    def workers_on(self, gpus: Sequence[str]) -> int:
        """Number of workers for these GPUs, "cuda:N"."""
        if not self.active:
            return WORKERS * len(gpus)
        memory = min(gpu_memory(gpu) for gpu in gpus)
        return len(gpus) * max(WORKERS, min(core_count() // len(gpus), MOST_WORKERS, memory // MEMORY_EACH))


ALONE = GpuSharing()


@contextlib.contextmanager
def shared_gpus(wanted: bool) -> Iterator[GpuSharing]:
    """How processes that start within this context share the GPUs; where ``wanted``, through MPS if that can be had.

    A service that is there already is used. Otherwise one starts for this context: it sees the GPUs that this process
    does, under the same numbers, and ends with this process, however that ends.
    """
    there = any(Path(file).exists() for file in GPU_FILES) and shutil.which(CONTROL) is not None
    if not wanted or not there or os.environ.get(OFF, "") == "off":
        yield ALONE
        return
    if (Path(os.environ.get(PIPES, USUAL_PIPES)) / "control").exists():
        yield GpuSharing(active=True)
        return
    place = tempfile.mkdtemp(prefix="warp-cloth-mps-")  # a short path: that of a socket
    own = {**os.environ, PIPES: place, LOGS: place}
    service = subprocess.Popen(
        ["sh", "-c", SERVICE],
        env=own,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C ends it with this process, not before
    )
    try:
        active = _answer(service) == "active"
        yield GpuSharing(active, ((PIPES, place), (VISIBLE, None)) if active else ())
    finally:
        if service.stdin is not None:
            service.stdin.close()
        threading.Thread(target=service.wait, daemon=True).start()  # it takes a while to end


def _answer(service: subprocess.Popen[bytes]) -> str:
    """What the service says first, "active" or "none"; nothing where it says nothing in time."""
    if service.stdout is None:
        return ""
    ready, _, _ = select.select([service.stdout], [], [], PATIENCE)
    return service.stdout.readline().decode().strip() if ready else ""
