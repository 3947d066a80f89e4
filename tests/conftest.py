"""Fixtures that every test file may use."""

from __future__ import annotations

import os
import re
import shutil
import signal
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from bodies import sure_skeleton
from hypothesis import HealthCheck, settings

from warp_cloth.anatomy.skeleton import Skeleton
from warp_cloth.base import compilers
from warp_cloth.base.first_run import note_kernels
from warp_cloth.base.mesh import Mesh
from warp_cloth.shapes import mannequin

# Every property gets a few examples in the suite, the same ones on every run; --hypothesis-profile=fuzz looks for
# new ones, $WARP_CLOTH_FUZZ of them (100,000 unless it says otherwise) for each property.
LONG_ENOUGH = 60_000  # [ms] of one example: what takes longer hangs
_COMMON = {"deadline": LONG_ENOUGH, "suppress_health_check": list(HealthCheck), "print_blob": True}
settings.register_profile("suite", max_examples=15, derandomize=True, database=None, **_COMMON)
settings.register_profile("fuzz", max_examples=int(os.environ.get("WARP_CLOTH_FUZZ", "100000")), **_COMMON)
settings.load_profile("suite")


def pytest_configure(config: pytest.Config) -> None:
    """Bodies, patterns and fields are made once for all tests, in a folder that begins empty: of no earlier code."""
    if "WARP_CLOTH_CACHE" not in os.environ:  # workers of xdist inherit it
        os.environ["WARP_CLOTH_CACHE"] = folder = tempfile.mkdtemp(prefix="warp_cloth-tests-")
        config.add_cleanup(partial(shutil.rmtree, folder, ignore_errors=True))
        for device in ("cpu", "cuda"):  # commands do not say that it is their first run
            note_kernels(device, str(Path(__file__).parent))
    # Threads of NumPy's BLAS wait for each other busily: on two busy cores, 16 s of test_reference.py were 3.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of xdist's workers, and of commands
    if hasattr(config, "workerinput"):  # other cores have work
        compilers.core_count = lambda: 1


def pytest_sessionstart() -> None:
    """An interrupt counts, for tests that send one, even where a shell started this in the background without it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_runtest_setup(item: pytest.Item) -> None:
    import warp as wp

    if item.get_closest_marker("cuda") and not wp.is_cuda_available():
        pytest.skip("no CUDA device")


COMPILING = "test_kernels.py"
MANY = 10  # tests of a file that begins before long ones: it compiles most of the kernels that these need


def scope_of(nodeid: str) -> str:
    """Which tests run in one process, since what they share is made once: those of a file, or of a page's code blocks.

    Tests that only compile share nothing: each goes where there is time for it.
    """
    page = re.search(r"\[(.+\.md):\d+\]$", nodeid)
    path = nodeid.partition("::")[0]
    return page[1] if page else nodeid if path.endswith(COMPILING) else path


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In several processes, long tests begin early enough, and compile tests fill up the end: these are short.

    So no process ends long after the others. A compile test has less to do where others have compiled: most files come
    before.
    """
    if not hasattr(config, "workerinput"):
        return
    long = {scope_of(item.nodeid) for item in items if item.get_closest_marker("long")}
    count = Counter(scope_of(item.nodeid) for item in items)

    def place(item: pytest.Item) -> tuple[bool, bool, bool, int]:
        scope = scope_of(item.nodeid)
        is_early = count[scope] >= MANY and scope not in long
        return COMPILING in scope, not is_early, scope not in long, -count[scope]

    items.sort(key=place)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keeps a scope's tests in one process, and the order of scopes.

    Not by xdist's own groups: they are names appended to node ids, which pytest 9.2 no longer lets them change.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByPageOrFile(LoadScopeScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            return scope_of(nodeid)

    if config.getoption("dist") != "load":
        return None
    config.option.loadscopereorder = False
    return ByPageOrFile(config, log)


@pytest.fixture(scope="session", autouse=True)
def _no_compiler_warnings() -> Iterator[None]:
    """Whatever kernels a test has compiled, the compiler warns of nothing."""
    with compilers.compiled_by(_compile_strictly):
        yield


def _compile_strictly(compiler: Callable[..., None], *words: Any, **options: Any) -> None:
    """What a compiler warns of would be on every user's screen, at the first fit: it fails."""
    with tempfile.TemporaryFile() as file:
        stderr = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            compiler(*words, **options)
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            file.seek(0)
            said = file.read()
            os.write(2, said)
    assert b": warning: " not in said, said.decode(errors="replace")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real garments and bodies, which this project does not ship: $WARP_CLOTH_DATA or ../shared/data."""
    folder = Path(os.environ.get("WARP_CLOTH_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no real meshes here: set WARP_CLOTH_DATA to a folder that has them")
    return folder


@pytest.fixture(scope="session")
def body() -> Mesh:
    """The shipped mannequin, of an M."""
    return mannequin()


@pytest.fixture(scope="module")
def skeleton(body: Mesh) -> Skeleton:
    """That of the shipped mannequin, or of the body that a file of tests has instead."""
    return sure_skeleton(body)
