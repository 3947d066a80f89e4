"""What loads garments, imported by the process that others are forked from; none of that is looked through for garbage.

The collector would look through all that imports leave, again and again, in that process and in each forked from it.
"""

import gc
from importlib import import_module

gc.disable()
for name in ("warp_cloth.batch.pool", "warp_cloth.batch.loading"):
    import_module(name)
gc.freeze()
gc.enable()
