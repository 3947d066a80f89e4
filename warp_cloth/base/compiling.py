"""Loading kernels; those that Warp has not compiled on this machine yet are compiled several at a time."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Sequence
from typing import Any, NamedTuple

from warp_cloth.base.compilers import compiler_count
from warp_cloth.base.warp_setup import keeping_kernels

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
            wp.force_load(device, modules=modules, max_workers=compiler_count())
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


def compile_for_cpu(modules: Sequence[Any]) -> None:
    """Compiles several at a time what Warp's cache lacks. What cannot be, Warp compiles when it is loaded."""
    for thread in begin_compiling(modules):
        thread.join()


def begin_compiling(modules: Sequence[Any]) -> list[threading.Thread]:
    """Begins to compile what Warp's cache lacks, where that is more than a few: threads that no exit waits for."""
    count = compiler_count()
    builds = missing_builds(modules) if count > 1 else []
    left = iter(builds)

    def compile_left() -> None:
        for build in left:
            with contextlib.suppress(Exception):  # raised again, and reported, when the module is loaded
                build.run()

    number = min(2 * count, len(builds)) if len(builds) >= FEW else 0
    threads = [threading.Thread(target=compile_left, daemon=True) for _ in range(number)]
    for thread in threads:
        thread.start()
    return threads
