"""A fit and a batch run from a checkout, a wheel, an sdist and an editable install, by every start method."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pyarrow.parquet
import pytest

ROOT = Path(__file__).parents[1]
SOURCES = ("warp_cloth", "kernels", "scenes", "pyproject.toml", "README.md", "LICENSE")
WAIT = 120.0  # [s] for a command
SETUPTOOLS = 77  # as pyproject.toml says
FIT = "import warp_cloth; print(warp_cloth.fit('hanging', device='cpu', overrides=['solver.iterations=50']).status)"
JOBS = "name,scene,solver.iterations\none,hanging,50\ntwo,hanging,50\n"
BUILD = "from setuptools import build_meta; import sys; print(getattr(build_meta, 'build_' + sys.argv[1])(sys.argv[2]))"


def run(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs a command without this test's own package on its path."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        [str(word) for word in command],
        cwd=cwd, env={**inherited, **environment}, capture_output=True, text=True, timeout=WAIT, check=False,
    )  # fmt: skip


def succeeded(done: subprocess.CompletedProcess[str]) -> str:
    """The output of a command that went well."""
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout in which nothing has been built."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(ROOT / name, folder / name)
    return folder


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Path, Path], Path]:
    """Builds a "wheel", "sdist" or "editable" wheel of a source folder into another, as pip has setuptools do it."""
    python = Path(sys.executable)
    if find_spec("setuptools") is None or int(version("setuptools").partition(".")[0]) < SETUPTOOLS:
        python = tmp_path_factory.mktemp("builder") / "python" / "bin" / "python"
        venv.create(python.parents[1], with_pip=False)
        wanted = f"setuptools>={SETUPTOOLS}"
        done = run(sys.executable, "-m", "pip", "--python", python, "install", "-q", wanted, cwd=ROOT)
        if done.returncode:
            pytest.skip(f"{wanted} is not installed, and no package index answers")

    def built(kind: str, source: Path, folder: Path) -> Path:
        output = succeeded(run(python, "-c", BUILD, kind, folder, cwd=source))
        return folder / output.splitlines()[-1]

    return built


@pytest.fixture(scope="module")
def wheel(build: Callable[[str, Path, Path], Path], checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of a checkout."""
    copy = tmp_path_factory.mktemp("build") / "copy"
    shutil.copytree(checkout, copy)  # building leaves files behind
    return build("wheel", copy, tmp_path_factory.mktemp("wheel"))


class Environment:
    """A virtual environment with the packages of this one, but without warp_cloth."""

    def __init__(self, folder: Path) -> None:
        venv.create(folder, with_pip=False)
        self.bin = folder / "bin"
        scheme = "venv" if "venv" in sysconfig.get_scheme_names() else "posix_prefix"  # before Python 3.11
        self.packages = Path(sysconfig.get_path("purelib", scheme, {"base": str(folder), "platbase": str(folder)}))
        # path entries of a .pth file are not searched for .pth files, as of an editable install of warp_cloth here
        (self.packages / "shared.pth").write_text(f"{sysconfig.get_path('purelib')}\n")

    def install(self, *arguments: str | Path, cwd: Path) -> None:
        pip = (sys.executable, "-m", "pip", "--python", self.bin / "python", "install", "-q", "--ignore-installed")
        succeeded(run(*pip, "--no-deps", "--no-index", *arguments, cwd=cwd))

    def fit(self, cwd: Path) -> None:
        """Fits from ``python -c``, which looks for packages in the current folder first."""
        assert "ITERATION_LIMIT" in succeeded(run(self.bin / "python", "-c", FIT, cwd=cwd))

    def batch(self, out: Path, cwd: Path, method: str = "forkserver") -> None:
        """Fits two items in two processes, by the command."""
        out.mkdir()
        (out / "jobs.csv").write_text(JOBS)
        command = (self.bin / "warp-cloth", "batch", out / "jobs.csv", "--out", out, "--device", "cpu")
        done = run(*command, "--workers", "2", "--shard", "1", cwd=cwd, WARP_CLOTH_START_METHOD=method)
        assert done.returncode == 3, done.stderr  # too few iterations for anything to be worn
        assert "2 iteration limit" in done.stdout
        assert pyarrow.parquet.read_table(out / "results.parquet")["status"].to_pylist() == 2 * ["iteration_limit"]
        assert "Traceback" not in done.stderr


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Environment:
    """An environment in which the wheel is installed."""
    environment = Environment(tmp_path_factory.mktemp("installed"))
    environment.install(wheel, cwd=wheel.parent)
    return environment


def test_a_checkout_without_an_install_fits_from_its_own_folder(checkout: Path, tmp_path: Path) -> None:
    Environment(tmp_path / "bare").fit(checkout)


@pytest.mark.parametrize("method", ["forkserver", "spawn", "fork"])
def test_an_installed_command_runs_batches_in_a_checkout(
    installed: Environment, checkout: Path, tmp_path: Path, method: str
) -> None:
    installed.batch(tmp_path / "out", checkout, method)


def test_an_installed_package_fits_in_a_checkout(installed: Environment, checkout: Path) -> None:
    installed.fit(checkout)


def test_an_installed_package_fits_from_a_read_only_folder(installed: Environment, tmp_path: Path) -> None:
    folder = tmp_path / "read_only"
    folder.mkdir(mode=0o555)  # root may write there all the same
    installed.fit(folder)


@pytest.mark.skipif(sys.version_info < (3, 11), reason="python -c cannot leave out the current folder")
def test_workers_import_the_package_of_their_command_not_one_in_the_current_folder(
    installed: Environment, tmp_path: Path
) -> None:
    (tmp_path / "warp_cloth").mkdir()
    (tmp_path / "warp_cloth" / "__init__.py").write_text("raise RuntimeError('not this one')\n")
    (tmp_path / "warp_cloth").chmod(0o555)
    installed.batch(tmp_path / "out", tmp_path)


def test_an_sdist_builds_the_same_wheel(
    build: Callable[[str, Path, Path], Path], wheel: Path, checkout: Path, tmp_path: Path
) -> None:
    shutil.copytree(checkout, tmp_path / "copy")
    shutil.unpack_archive(build("sdist", tmp_path / "copy", tmp_path), tmp_path / "unpacked")
    (source,) = (tmp_path / "unpacked").iterdir()
    with zipfile.ZipFile(wheel) as one, zipfile.ZipFile(build("wheel", source, tmp_path)) as other:
        assert {name: one.read(name) for name in one.namelist()} == {
            name: other.read(name) for name in other.namelist()
        }


def test_an_editable_install_fits_and_runs_batches(
    build: Callable[[str, Path, Path], Path], checkout: Path, tmp_path: Path
) -> None:
    shutil.copytree(checkout, tmp_path / "copy")
    environment = Environment(tmp_path / "editable")
    environment.install(build("editable", tmp_path / "copy", tmp_path), cwd=tmp_path)
    environment.fit(Path("/"))
    environment.batch(tmp_path / "out", tmp_path / "copy")


def test_workers_that_cannot_import_end_the_batch_with_one_line(
    installed: Environment, wheel: Path, tmp_path: Path
) -> None:
    broken = Environment(tmp_path / "broken")
    broken.install(wheel, cwd=tmp_path)
    (broken.packages / "warp_cloth" / "batch" / "loading.py").write_text("import package_that_is_missing\n")
    (tmp_path / "jobs.csv").write_text(JOBS)
    command = (broken.bin / "warp-cloth", "batch", tmp_path / "jobs.csv", "--out", tmp_path / "out", "--device", "cpu")
    done = run(*command, cwd=tmp_path)
    assert done.returncode == 2
    progress, *errors = done.stderr.splitlines()
    assert progress == "fitted 0/2"
    assert errors == [
        "error: batch: worker processes cannot start (ModuleNotFoundError: No module named 'package_that_is_missing'); "
        "install warp-cloth again"
    ]
    assert not (tmp_path / "out" / "results.parquet").exists()
