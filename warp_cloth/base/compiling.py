"""Loading kernels; those that Warp has not compiled on this machine yet are compiled in several processes.

In one process Warp compiles for the CPU one module after another: in threads it takes twice as long (Warp 1.19).
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from warp_cloth.base.threads import core_count
from warp_cloth.base.warp_setup import keeping_kernels

MOST = 16  # processes, or a GPU compiler's threads
FEW = 3  # modules that one process has compiled before another is ready


def load_modules(modules: Sequence[Any], device: str) -> None:
    """Loads Warp modules on a device, compiled where Warp's cache does not have them yet.

    Raises:
        OutputError: Warp's folder of compiled kernels cannot be written.
    """
    import warp as wp

    modules = list(dict.fromkeys(modules))
    with keeping_kernels():
        if wp.get_device(device).is_cuda:
            wp.force_load(device, modules=modules, max_workers=min(core_count(), MOST))
        else:
            compile_for_cpu(modules)
            wp.force_load(device, modules=modules, max_workers=0)


def in_blocks(kernel: Any, threads: int) -> Any:
    """A kernel in a module of its own that a GPU launches in blocks of so many threads; it is compiled for those.

    Warp (1.19) compiles a kernel again for every size of block, and by default for 256 threads.
    """
    kernel.module.options["block_dim"] = threads
    return kernel


class Build(NamedTuple):
    """A module that is to be compiled for the CPU, and where to."""

    module: Any
    block_dim: int
    folder: str
    name: str  # of the file

    def run(self) -> None:
        import warp as wp

        options = self.module.resolved_options[self.block_dim]
        self.module._compile(wp.get_device("cpu"), self.folder, self.name, None, options=options)


def missing_builds(modules: Sequence[Any]) -> list[Build]:
    """What Warp's cache lacks; nothing where it cannot be found out, as Warp's internals are not those of 1.19."""
    import warp as wp
    from warp._src import context

    builds = []
    with contextlib.suppress(AttributeError, TypeError, KeyError):
        device = wp.get_device("cpu")
        for module in dict.fromkeys(modules):
            block_dim = context._resolve_launch_block_dim(device, None)
            folder = os.path.join(wp.config.kernel_cache_dir, module.get_module_identifier(block_dim))
            name = module._get_compile_output_name(device, block_dim=block_dim)
            if not os.path.exists(os.path.join(folder, name)):
                builds.append(Build(module, block_dim, folder, name))
    return builds


def compile_for_cpu(modules: Sequence[Any], on_begin: Callable[[], None] = lambda: None) -> None:
    """Compiles in other processes what Warp's cache lacks. What cannot be, Warp compiles when it is loaded.

    ``on_begin`` is called where there is anything to compile.
    """
    count = min(core_count(), MOST)
    builds = missing_builds(modules) if count > 1 else []
    if len(builds) < FEW:
        return
    on_begin()
    with compiled_by(_compilers(os.getpid(), count).build), ThreadPoolExecutor(2 * count) as threads:
        for ended in [threads.submit(build.run) for build in builds]:
            with contextlib.suppress(Exception):  # raised again, and reported, when the module is loaded
                ended.result()


@contextlib.contextmanager
def compiled_by(build: Callable[..., None]) -> Iterator[None]:
    """Lets Warp call ``build`` in place of its own compiler, which that gets as its first argument."""
    from warp._src import build as compiler

    own = compiler.build_cpu
    compiler.build_cpu = functools.partial(build, own)
    try:
        yield
    finally:
        compiler.build_cpu = own


class _Compilers:
    """Processes that compile; each is started when it is first needed, and ends when nothing comes for a while."""

    def __init__(self, count: int) -> None:
        self._free: queue.LifoQueue[_Compiler] = queue.LifoQueue()
        for _ in range(count):
            self._free.put(_Compiler())
        self._own = threading.Lock()

    def build(self, own: Callable[..., None], *args: Any, **kwargs: Any) -> None:
        """Compiles a file by a free process, or in this one where that fails."""
        compiler = self._free.get()
        try:
            done = compiler.build(args, kwargs)
        finally:
            self._free.put(compiler)
        if not done:
            with self._own:
                own(*args, **kwargs)


class _Compiler:
    """One of these processes."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self._serves = True  # False once it could not be started

    def build(self, args: Sequence[Any], kwargs: dict[str, Any]) -> bool:
        """Whether the process has compiled a file."""
        with contextlib.suppress(OSError, ValueError, TypeError):
            request = json.dumps([args, kwargs])
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
def _compilers(process: int, count: int) -> _Compilers:
    """Those of this process."""
    return _Compilers(count)
