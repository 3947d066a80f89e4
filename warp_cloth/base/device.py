"""Devices by name: Warp's own, and the GPU driver's before Warp is imported."""

from __future__ import annotations

import ctypes
import functools
import threading

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import init_warp


def device_named(name: str | None) -> str:
    """Warp's alias of a device, "cpu" or "cuda:0"; None: the device that Warp prefers.

    Raises:
        InputError: there is no such device.
    """
    import warp as wp

    init_warp()
    if name is None:
        return str(wp.get_preferred_device().alias)
    name = str(name)
    try:
        if name.startswith("cuda") and not wp.get_cuda_device_count():  # Warp would print a longer message
            raise ValueError
        return str(wp.get_device(name).alias)
    except (RuntimeError, ValueError):
        devices = ", ".join(str(device.alias) for device in wp.get_devices())
        raise InputError("device", f'there is no device "{name}" on this machine', f"use one of: {devices}") from None


def likely_gpus(name: str | None) -> list[str]:
    """The GPUs that "cuda", "cuda:N" or None mean, by the driver: importing Warp takes a second."""
    gpus = [f"cuda:{number}" for number in range(gpu_count())]
    return gpus if name in (None, "cuda") else [gpu for gpu in gpus if gpu == name]


@functools.cache
def gpu_count() -> int:
    """Number of GPUs, by the driver; takes part of a second, without Python's lock."""
    try:
        driver = ctypes.CDLL("libcuda.so.1")
        count = ctypes.c_int()
        there = not driver.cuInit(0) and not driver.cuDeviceGetCount(ctypes.byref(count))
    except (OSError, AttributeError):
        return 0
    return count.value if there else 0


def gpu_memory(name: str) -> int:
    """Memory of a GPU, "cuda:N" [bytes], by the driver; 0 where there is no such GPU."""
    number, total = name.removeprefix("cuda:"), ctypes.c_size_t()
    if number.isdecimal() and int(number) < gpu_count():
        driver, device = ctypes.CDLL("libcuda.so.1"), ctypes.c_int()
        if not driver.cuDeviceGet(ctypes.byref(device), int(number)):
            driver.cuDeviceTotalMem_v2(ctypes.byref(total), device)
    return total.value


def wake_gpu(name: str) -> None:
    """Creates the primary context of a GPU, "cuda:N", which Warp will use; without Python's lock, during imports."""
    number = name.removeprefix("cuda:")
    if number.isdecimal() and int(number) < gpu_count():
        context = ctypes.c_void_p()
        ctypes.CDLL("libcuda.so.1").cuDevicePrimaryCtxRetain(ctypes.byref(context), int(number))


def begin_waking(name: str | None) -> None:
    """Wakes, in a thread, the GPU that a command named "cuda", "cuda:N" or None will use, if it will use one."""

    def wake() -> None:
        for gpu in likely_gpus(name)[:1]:
            wake_gpu(gpu)

    if name != "cpu":
        threading.Thread(target=wake, daemon=True).start()
