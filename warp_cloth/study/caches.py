"""How much a device's caches hold: the last one, beyond which memory is asked every time, and those of its cores."""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path

import warp as wp

# CUdevice_attribute
L2_SIZE = 38
SHARED_MEMORY_PER_CORE = 81  # which takes its room from the core's cache
CPU_CACHES = Path("/sys/devices/system/cpu/cpu0/cache")  # where Linux tells
DRIVERS = ("libcuda.so.1", "nvcuda.dll")


def cache_bytes(device: str) -> int:
    """Bytes of a GPU's L2, or of the processor's L3; 0 where the system does not tell."""
    where = wp.get_device(device)
    if not where.is_cuda:
        sizes = (path.read_text().strip() for path in CPU_CACHES.glob("index*/size"))
        return max((1024 * int(size[:-1]) for size in sizes if size.endswith("K")), default=0)
    return _told(where, L2_SIZE)


def core_bytes(device: str) -> int:
    """Bytes that a GPU's core has for its cache and its blocks' own memory; 0 where the system does not tell."""
    where = wp.get_device(device)
    return _told(where, SHARED_MEMORY_PER_CORE) if where.is_cuda else 0


def _told(device: wp.Device, attribute: int) -> int:
    """What the driver tells of a GPU; 0 where there is none."""
    for name in DRIVERS:
        with contextlib.suppress(OSError):
            driver = ctypes.CDLL(name)
            handle, value = ctypes.c_int(), ctypes.c_int()
            if driver.cuDeviceGet(ctypes.byref(handle), device.ordinal) == 0:
                driver.cuDeviceGetAttribute(ctypes.byref(value), attribute, handle)
            return value.value
    return 0
