"""Imports what loads garments, in the process that others are forked from; excluded from garbage collection.

The collector would traverse everything that imports leave, again and again, in that process and in each forked from it.
"""

import gc
from importlib import import_module

gc.disable()
for name in ("warp_cloth.batch.worker", "warp_cloth.batch.task", "warp_cloth.batch.loading"):
    import_module(name)
gc.freeze()
gc.enable()
