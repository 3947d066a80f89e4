"""Imports what loads garments, in the process that others are forked from; excluded from garbage collection.

The collector would traverse everything that imports leave, again and again, in that process and in each forked from it.
"""

import gc
from importlib import import_module

gc.disable()
for name in ("batch.worker", "batch.task", "batch.loading", "pattern"):
    import_module(f"warp_cloth.{name}")
gc.freeze()
gc.enable()
