"""Reads a USD file in a process of its own, with bounded memory, to see whether it can be read at all.

A damaged crate file makes USD ask for any amount of memory, or crash, and neither can be caught where it happens.
Run as a script: FILE MEMORY_LIMIT. Exits with 0, or with 3 and USD's reason on standard output.
"""

from __future__ import annotations

import contextlib
import sys


def probe(file: str, memory_limit: int) -> int:
    """Open the stage and read every value once, at its default or first time."""
    with contextlib.suppress(ImportError, ValueError, OSError):  # not on every system
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (memory_limit, memory_limit))
    from pxr import Usd

    try:
        stage = Usd.Stage.Open(file)
        for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
            for attribute in prim.GetAttributes():
                times = attribute.GetTimeSamples()
                attribute.Get(times[0]) if times else attribute.Get()
    except Exception as error:  # of any kind: reported to the calling process
        try:
            reason = str(error)
        except UnicodeDecodeError as quoted:  # USD quotes the file's bytes
            reason = quoted.object.decode(errors="replace")
        sys.stdout.buffer.write(reason.encode(errors="replace"))
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(probe(sys.argv[1], int(sys.argv[2])))
