"""Compiling what a machine lacks before a fit needs it, several modules at a time."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import warp as wp

from warp_cloth.avatar.contact import avatar_modules
from warp_cloth.base.clock import StageClock
from warp_cloth.base.compiling import begin_compiling, load_modules
from warp_cloth.base.first_run import kernels_known
from warp_cloth.export.render import picture_modules
from warp_cloth.kernels.anatomy import geodesics
from warp_cloth.kernels.contact import crossing
from warp_cloth.scene import Scene


def compile_ahead(scene: Scene, device: str, clock: StageClock) -> None:
    """On a machine that has no kernels yet, compiles those that are launched before and after iterating, all at once.

    Where they are launched one is compiled after another. For the CPU they are compiled while the scene is loaded.
    """
    if kernels_known(device):
        return
    gpu = wp.get_device(device).is_cuda
    host = [] if scene.avatar is None else [wp.get_module(geodesics.__name__)]  # the CPU's work for any device
    own = [] if scene.avatar is None else avatar_modules("auto" if gpu else "depth")
    modules = [*own, wp.get_module(crossing.__name__), *picture_modules()]
    if gpu:
        clock.begin("compile")
        with ThreadPoolExecutor(1) as thread:  # meanwhile
            of_host = thread.submit(load_modules, host, "cpu")
            load_modules(modules, device)
            of_host.result()
        clock.lap("compile")
    else:
        begin_compiling([*host, *modules])
