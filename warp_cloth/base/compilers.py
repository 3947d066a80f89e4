"""Compiling kernels for the CPU in several processes, with one header that they and later ones share.

By itself Warp (1.19) compiles in the process that needs a kernel, where two threads take twice as long, and in each
process its header first.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import queue
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Protocol

from warp_cloth.base.compiler import with_stored_header
from warp_cloth.base.threads import core_count

MOST = 16  # processes, or a GPU compiler's threads
BUILD = "build_cpu"  # Warp's function that compiles a file for the CPU
HEADERS = "headers"  # in the folder of kernels, for each place and target: Warp's header, compiled

Compiler = Callable[..., None]


def share_compilers() -> None:
    """Lets Warp compile for the CPU by the compilers of this process. Where Warp's own is another, nothing is done."""
    from warp._src import build

    own = getattr(build, BUILD, None)
    if own is not None and not hasattr(own, "compilers"):
        shared = functools.partial(_compile, own)
        shared.compilers = True  # type: ignore[attr-defined]
        setattr(build, BUILD, shared)


@contextlib.contextmanager
def compiled_by(build: Compiler) -> Iterator[None]:
    """Lets Warp call ``build`` in place of its compiler, which that gets as its first argument."""
    from warp._src import build as compiler

    own = getattr(compiler, BUILD)
    setattr(compiler, BUILD, functools.partial(build, own))
    try:
        yield
    finally:
        setattr(compiler, BUILD, own)


def _compile(own: Compiler, output: str, *args: Any, **options: Any) -> None:
    _compilers(os.getpid(), compiler_count()).build(own, output, *args, **options)


def compiler_count() -> int:
    """How many files are compiled at a time."""
    return min(core_count(), MOST)


class Compilers:
    """This process and others that compile; each of these is started when it is first needed."""

    def __init__(self, count: int) -> None:
        self._free: queue.LifoQueue[_Compiler] = queue.LifoQueue()
        for _ in range(count - 1):
            self._free.put(_Process())
        self._free.put(_Here())
        self._lock = threading.Lock()
        self._first: Future[None] | None = None
        self._outputs: dict[str, Future[str]] = {}  # by name: where it has been compiled to

    def build(self, own: Compiler, output: str, *args: Any, **options: Any) -> None:
        """Compiles a file; waits for one of the same name that is being compiled, and copies that."""
        name = os.path.basename(output)
        with self._lock:
            earlier, mine = self._outputs.get(name), Future[str]()
            if earlier is None:
                self._outputs[name] = mine
        if earlier is not None:
            with contextlib.suppress(Exception):
                _copy_compiled(earlier.result(), output)
                return
        try:
            self._build(own, output, *args, **options)
        except BaseException as error:
            with self._lock:
                self._outputs.pop(name, None)
            mine.set_exception(error)
            raise
        mine.set_result(output)

    def _build(self, own: Compiler, output: str, *args: Any, **options: Any) -> None:
        folder, compiler = _header_folder(output), self._free.get()
        try:
            compiler.start()
            with self._lock:
                before, first = self._first, Future[None]()
                self._first = before or first
            if before is not None and not os.path.isdir(folder):
                before.result()  # it compiles the header
            try:
                done = compiler.build(own, folder, output, *args, **options)
            finally:
                if before is None:
                    first.set_result(None)
        finally:
            self._free.put(compiler)
        if not done:
            own(output, *args, **options)


def _copy_compiled(compiled: str, output: str) -> None:
    """Copies a file from where it was compiled to, or from where Warp has moved it since."""
    try:
        shutil.copyfile(compiled, output)
    except FileNotFoundError:
        folder, name = os.path.split(compiled)
        shutil.copyfile(os.path.join(folder.rpartition("_p")[0], name), output)  # FOLDER_p123_t456


class _Compiler(Protocol):
    """One that compiles a file at a time."""

    def start(self) -> None: ...

    def build(self, own: Compiler, folder: str, *args: Any, **options: Any) -> bool: ...


class _Here:
    """This process."""

    def start(self) -> None:
        """It runs already."""

    def build(self, own: Compiler, folder: str, *args: Any, **options: Any) -> bool:
        """Compiles a file with the header from ``folder``, or raises what Warp does."""
        with_stored_header(own, folder, *args, **options)
        return True


class _Process:
    """Another process, which ends when nothing comes for a while."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._serves = True  # False once it could not be started

    def start(self) -> None:
        """Starts it, if it does not run."""
        with contextlib.suppress(OSError):
            self._process = self._process or _started()

    def build(self, own: Compiler, folder: str, *args: Any, **options: Any) -> bool:
        """Whether the process has compiled a file."""
        with contextlib.suppress(OSError, ValueError, TypeError):
            request = json.dumps([folder, args, options])
            while self._serves:
                fresh = self._process is None
                self._process = self._process or _started()
                answer = _answer(self._process, request)
                if answer:
                    return answer == "done\n"
                self._process, self._serves = None, not fresh  # one that ended for lack of work is started again
        return False


def _started() -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("compiler.py"))],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "CUDA_VISIBLE_DEVICES": ""},  # it needs no GPU
    )


def _answer(process: subprocess.Popen[str], request: str) -> str:
    """A process's answer to a request, with its newline; empty where the process has ended."""
    if process.stdin is None or process.stdout is None:
        return ""
    try:
        process.stdin.write(request + "\n")
        process.stdin.flush()
    except OSError:
        return ""
    return process.stdout.readline()


@functools.cache
def _compilers(process: int, count: int) -> Compilers:
    """Those of a process, which is this one."""
    return Compilers(count)


def _header_folder(output: str) -> str:
    """Where headers are that fit a compiled file: for the same target, which its name ends with, and Warp."""
    import warp as wp

    header, kernels = Path(wp.__file__).parent / "native" / "builtin.h", wp.config.kernel_cache_dir
    if not kernels:
        return ""
    with contextlib.suppress(OSError):
        found = hashlib.blake2b(repr([str(header), header.stat().st_mtime_ns]).encode(), digest_size=6).hexdigest()
        target = os.path.splitext(output)[0].rpartition(".")[2]
        return os.path.join(kernels, HEADERS, f"{found}-{target}")
    return ""
