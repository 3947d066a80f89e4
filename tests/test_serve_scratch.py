"""Files of requests: none outlives the next start of a service, and none of a living service is touched."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("fcntl")

from warp_cloth.serve import scratch
from warp_cloth.serve.scratch import PREFIX, scratch_folder

KILLED = """
import os, signal, sys
from pathlib import Path
from warp_cloth.serve import scratch
scratch.MEMORY, scratch.LEAST_MEMORY = Path(sys.argv[1]), 0
with scratch.scratch_folder() as folder:
    (folder / "7").mkdir()
    (folder / "7" / "body.obj").write_text("v 0 0 0")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in place of the one in memory."""
    monkeypatch.setattr(scratch, "MEMORY", tmp_path)
    monkeypatch.setattr(scratch, "LEAST_MEMORY", 0)
    return tmp_path


def test_a_killed_services_files_go_when_the_next_one_starts(memory: Path) -> None:
    kept = memory / "others"
    kept.mkdir()
    (memory / f"{PREFIX}link").symlink_to(kept)
    with scratch_folder() as living:
        (living / "body.obj").write_text("v 0 0 0")
        killed = subprocess.run([sys.executable, "-c", KILLED, str(memory)])
        assert killed.returncode == -signal.SIGKILL
        assert len(list(memory.glob(f"{PREFIX}*/7/body.obj"))) == 1
        with scratch_folder() as own:
            assert {each.name for each in memory.iterdir()} == {living.name, own.name, "others", f"{PREFIX}link"}
            assert (living / "body.obj").exists()
            assert own.stat().st_mode & 0o077 == 0
    assert not living.exists()
    assert not own.exists()


def test_a_folder_that_another_service_removes_before_it_is_locked_is_made_again(
    memory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[str] = []
    make = scratch.tempfile.mkdtemp

    def taken_once(**options: object) -> str:
        made.append(make(**options))
        if len(made) == 1:
            scratch._remove_dead(memory)
        return made[-1]

    monkeypatch.setattr(scratch.tempfile, "mkdtemp", taken_once)
    with scratch_folder() as folder:
        assert str(folder) == made[1]
        assert not Path(made[0]).exists()
