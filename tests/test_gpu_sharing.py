"""GPUs shared through NVIDIA's MPS: begun for a batch, ended with it however that ends, done without where it fails."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from warp_cloth.batch import gpu_sharing
from warp_cloth.batch.gpu_sharing import ALONE, CONTROL, OFF, PIPES, VISIBLE, shared_gpus

# As NVIDIA's, which takes commands at its standard input and needs a GPU.
DAEMON = """#!/bin/sh
here="$CUDA_MPS_PIPE_DIRECTORY"
if [ "$1" = -f ]; then
    while [ ! -e "$here/quit" ]; do sleep 0.02; done
    exit
fi
read -r command
case "$command" in
    get_server_list) echo 42 ;;
    "get_server_status 42") echo ACTIVE ;;
    quit*) touch "$here/quit" ;;
esac
"""
HOLD = """
from warp_cloth.batch import gpu_sharing
gpu_sharing.GPU_FILES = ["/"]
with gpu_sharing.shared_gpus(True) as sharing:
    print(sharing.environment[0][1], flush=True)
    input()
"""


@pytest.fixture(autouse=True)
def service(tmp_path, monkeypatch):
    """A GPU and NVIDIA's command are there; returns the command's file."""
    command = tmp_path / CONTROL
    command.write_text(DAEMON)
    command.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv(PIPES, str(tmp_path / "none"))
    monkeypatch.delenv(OFF, raising=False)
    monkeypatch.setattr(gpu_sharing, "GPU_FILES", ["/"])
    return command


def vanishes(place: str) -> bool:
    until = time.monotonic() + 20.0
    while Path(place).exists() and time.monotonic() < until:
        time.sleep(0.02)
    return not Path(place).exists()


def test_workers_find_the_service_and_it_ends_with_the_context():
    with shared_gpus(True) as sharing:
        (name, place), visible = sharing.environment
        assert sharing.active
        assert name == PIPES
        assert Path(place).is_dir()
        assert visible == (VISIBLE, None)
    assert vanishes(place)


def test_the_service_ends_with_a_killed_process():
    with subprocess.Popen([sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        place = process.stdout.readline().decode().strip()
        assert Path(place).is_dir()
        process.kill()
    assert vanishes(place)


def test_a_service_that_is_there_already_is_used(tmp_path):
    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "control").touch()
    with shared_gpus(True) as sharing:
        assert sharing.active
        assert not sharing.environment


def test_batches_do_without_a_service_that_cannot_start_is_off_or_not_wanted(service, monkeypatch):
    with shared_gpus(False) as sharing:
        assert sharing is ALONE
    service.write_text("#!/bin/sh\nexit 1\n")
    with shared_gpus(True) as sharing:
        assert not sharing.active
        assert not sharing.environment
    monkeypatch.setenv(OFF, "off")
    with shared_gpus(True) as sharing:
        assert sharing is ALONE


def test_a_shared_gpu_has_a_worker_for_each_core_that_its_memory_allows(monkeypatch):
    monkeypatch.setattr(gpu_sharing, "core_count", lambda: 32)
    monkeypatch.setattr(gpu_sharing, "gpu_memory", lambda gpu: {"cuda:0": 141 << 30, "cuda:1": 32 << 30}[gpu])
    with shared_gpus(True) as sharing:
        assert sharing.workers_on(["cuda:0"]) == 16
        assert sharing.workers_on(["cuda:0", "cuda:1"]) == 16
    assert ALONE.workers_on(["cuda:0", "cuda:1"]) == 8
