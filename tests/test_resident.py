"""A resident does a command's work as the client itself would; where there is none, the client does it."""

from __future__ import annotations

import gc
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from warp_cloth.base.errors import InputError
from warp_cloth.base.first_run import FOLDER
from warp_cloth.base.mesh import Mesh
from warp_cloth.cli.main import app
from warp_cloth.cli.resident import forget, listening
from warp_cloth.cli.resident_client import ENDING, PREFIX

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="residents are for Linux")

PATIENCE = 60.0  # [s] for a process
ALONE = "no such scene file"  # what a client says that runs alone, of a scene with a name like these words
# A resident whose command tells where it runs, and does what the scene's name says.
RESIDENT = """
import os, signal, sys, time
from warp_cloth.__main__ import _terminate
from warp_cloth.base.errors import InputError
from warp_cloth.cli.resident import listening, serve
from warp_cloth.cli.resident_client import resident_place

def command():
    word = sys.argv[2]
    print("aside", file=sys.stderr)
    try:
        print(word, os.getcwd(), os.environ.get("TOLD"), os.getpid(), flush=True)
        time.sleep(60 * (word == "wait"))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    if word == "fail":
        raise RuntimeError("unexpected")
    sys.exit(3)

signal.signal(signal.SIGTERM, _terminate)
try:
    with listening(resident_place()) as listener:
        print("ready", flush=True)
        serve(listener, command, float(sys.argv[1]))
except InputError as error:
    print(error, flush=True)
"""


@pytest.fixture
def folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path_factory.mktemp("r")  # a short path
    monkeypatch.setenv(FOLDER, str(folder))
    monkeypatch.setenv("TOLD", "once")
    return folder


def started(patience: float = PATIENCE) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", RESIDENT, str(patience)], stdout=subprocess.PIPE, text=True)


@pytest.fixture
def resident(folder: Path) -> Iterator[subprocess.Popen[str]]:
    process = started()
    assert said(process) == "ready"
    yield process
    process.kill()
    process.communicate()


def said(process: subprocess.Popen[str]) -> str:
    return process.stdout.readline().strip()


def client(word: str) -> subprocess.Popen[str]:
    words = [sys.executable, "-m", "warp_cloth", "fit", word]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def run(word: str) -> tuple[int, str, str]:
    process = client(word)
    out, err = process.communicate(timeout=PATIENCE)
    return process.returncode, out.strip(), err.strip()


def test_a_resident_stands_for_its_client(
    resident: subprocess.Popen[str], folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (place,) = folder.glob(f"*{ENDING}")
    assert stat.S_IMODE(place.stat().st_mode) == 0o600
    monkeypatch.chdir(tmp_path)
    for told in ("twice", "thrice"):
        monkeypatch.setenv("TOLD", told)
        assert run("look") == (3, f"look {tmp_path} {told} {resident.pid}", "aside")
    second = started()
    assert "there is one already" in said(second)
    second.communicate()


def test_what_is_bound_to_another_environment_runs_alone(
    resident: subprocess.Popen[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    status, _, err = run("look")
    assert (status, ALONE in err) == (2, True)


def test_a_client_whose_resident_is_killed_or_busy_does_the_work(resident: subprocess.Popen[str]) -> None:
    waiting = client("wait")
    assert said(waiting).startswith("wait")
    status, _, err = run("look")  # it is busy
    assert (status, ALONE in err) == (2, True)
    resident.kill()
    _, err = waiting.communicate(timeout=PATIENCE)
    assert (waiting.returncode, ALONE in err) == (2, True)


def test_a_resident_that_is_terminated_while_it_works_ends(resident: subprocess.Popen[str], folder: Path) -> None:
    """It took the end of the work for the command's own, and stayed."""
    waiting = client("wait")
    assert said(waiting).startswith("wait")
    resident.terminate()
    _, err = waiting.communicate(timeout=PATIENCE)
    assert (waiting.returncode, ALONE in err) == (2, True)
    assert resident.wait(PATIENCE) == 128 + signal.SIGTERM
    assert not list(folder.glob(f"*{ENDING}"))


def test_an_interrupted_or_killed_client_ends_the_work(resident: subprocess.Popen[str]) -> None:
    waiting = client("wait")
    assert said(waiting).startswith("wait")
    waiting.send_signal(signal.SIGINT)
    _, err = waiting.communicate(timeout=PATIENCE)
    assert (waiting.returncode, err.split()) == (130, ["aside", "interrupted"])
    waiting = client("wait")
    assert said(waiting).startswith("wait")
    waiting.kill()
    waiting.communicate()
    assert run("look")[0] == 3


def test_a_resident_ends_after_a_failure_and_when_idle(folder: Path) -> None:
    process = started()
    assert said(process) == "ready"
    status, _, err = run("fail")
    assert status == 1
    assert "RuntimeError: unexpected" in err
    process.communicate(timeout=PATIENCE)
    idle = started(0.1)
    idle.communicate(timeout=PATIENCE)
    assert (process.returncode, idle.returncode) == (0, 0)
    assert not list(folder.glob(f"*{ENDING}"))


def test_sockets_of_killed_residents_go_and_live_ones_stay(folder: Path) -> None:
    killed, one, other = (folder / f"{PREFIX}{name}{ENDING}" for name in ("killed", "one", "other"))
    with socket.socket(socket.AF_UNIX) as line:
        line.bind(str(killed))
    with listening(one), listening(other):
        assert {one, other} == set(folder.glob(f"*{ENDING}"))
        with pytest.raises(InputError, match="there is one already"), listening(one):
            pass
    assert not list(folder.glob(f"*{ENDING}"))


def test_nothing_of_a_garment_is_kept(folder: Path, tmp_path: Path) -> None:
    changes = ("garment.shape.vertices_per_side=9", "solver.iterations=20")
    words = ["fit", "hanging", "--device", "cpu", "--out", str(tmp_path / "out")]
    gc.unfreeze()  # else frozen ones are not told
    others = _meshes()  # of tests before this one
    result = CliRunner().invoke(app, [*words, *(word for change in changes for word in ("--set", change))])
    assert result.exit_code in (0, 3), result.output
    del result
    forget()
    gc.unfreeze()
    assert not [mesh for mesh in _meshes() if not any(mesh is other for other in others)]


def _meshes() -> list[Mesh]:
    return [each for each in gc.get_objects() if isinstance(each, Mesh)]
