"""How much a device's caches hold: the last one, beyond which memory is asked every time, and those of its cores.

And what registers do not hold, which goes to the caches, too.
"""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path
from typing import Any

import warp as wp

# CUdevice_attribute
L2_SIZE = 38
SHARED_MEMORY_PER_CORE = 81  # which takes its room from the core's cache
LOCAL_SIZE = 3  # CUfunction_attribute: bytes of a thread that are not in registers
CPU_CACHES = Path("/sys/devices/system/cpu/cpu0/cache")  # where Linux tells
DRIVERS = ("libcuda.so.1", "nvcuda.dll")


def cache_bytes(device: str) -> int:
    """Bytes of a GPU's L2, or of the processor's L3; 0 where the system does not tell."""
    where = wp.get_device(device)
    if not where.is_cuda:
        sizes = (path.read_text().strip() for path in CPU_CACHES.glob("index*/size"))
        return max((1024 * int(size[:-1]) for size in sizes if size.endswith("K")), default=0)
    return _told("cuDeviceGetAttribute", L2_SIZE, _handle(where))


def core_bytes(device: str) -> int:
    """Bytes that a GPU's core has for its cache and its blocks' own memory; 0 where the system does not tell."""
    where = wp.get_device(device)
    return _told("cuDeviceGetAttribute", SHARED_MEMORY_PER_CORE, _handle(where)) if where.is_cuda else 0


def spilled_bytes(command: Any, device: str) -> int:
    """Bytes of each thread of a launch, Warp's, that a GPU's registers do not hold."""
    if not wp.get_device(device).is_cuda:
        return 0
    return _told("cuFuncGetAttribute", LOCAL_SIZE, ctypes.c_void_p(command.hooks.forward))


def _handle(device: wp.Device) -> ctypes.c_int:
    """What the driver calls a GPU."""
    handle = ctypes.c_int()
    for driver in _drivers():
        driver.cuDeviceGet(ctypes.byref(handle), device.ordinal)
    return handle


def _told(function: str, attribute: int, of: Any) -> int:
    """What the driver tells of a GPU or a kernel; 0 where it does not."""
    value = ctypes.c_int()
    for driver in _drivers():
        getattr(driver, function)(ctypes.byref(value), attribute, of)
    return value.value


def _drivers() -> list[ctypes.CDLL]:
    """The driver, if the system has one."""
    for name in DRIVERS:
        with contextlib.suppress(OSError):
            return [ctypes.CDLL(name)]
    return []
