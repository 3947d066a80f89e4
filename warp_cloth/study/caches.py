"""How much a device's last cache holds: what an iteration touches beyond that comes from memory every time."""

from __future__ import annotations

import contextlib
import ctypes
from pathlib import Path

import warp as wp

L2_SIZE = 38  # CU_DEVICE_ATTRIBUTE_L2_CACHE_SIZE
CPU_CACHES = Path("/sys/devices/system/cpu/cpu0/cache")  # where Linux tells
DRIVERS = ("libcuda.so.1", "nvcuda.dll")


def cache_bytes(device: str) -> int:
    """Bytes of a GPU's L2, or of the processor's L3; 0 where the system does not tell."""
    where = wp.get_device(device)
    if not where.is_cuda:
        sizes = (path.read_text().strip() for path in CPU_CACHES.glob("index*/size"))
        return max((1024 * int(size[:-1]) for size in sizes if size.endswith("K")), default=0)
    for name in DRIVERS:
        with contextlib.suppress(OSError):
            driver = ctypes.CDLL(name)
            handle, size = ctypes.c_int(), ctypes.c_int()
            if driver.cuDeviceGet(ctypes.byref(handle), where.ordinal) == 0:
                driver.cuDeviceGetAttribute(ctypes.byref(size), L2_SIZE, handle)
            return size.value
    return 0
