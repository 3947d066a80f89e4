"""A process that compiles kernels' C++ for the CPU, run as a script by ``compiling.py``; imports none of this package.

It reads a line of JSON for each file, the arguments of Warp's ``build_cpu``, and answers with a line: "done", or what
went wrong. It ends with its input, or where nothing more comes.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading

PATIENCE = 30.0  # [s] that it waits for more


def main() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the parent, and the input with it
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what the compiler prints goes to stderr
    del sys.path[0]  # this folder, whose modules have names that others have
    import warp
    from warp._src import build, context

    warp.config.log_level = warp.LOG_WARNING
    warp.init()
    while line := _next_line():
        args, kwargs = json.loads(line)
        if kwargs.get("use_precompiled_headers"):
            kwargs["pch_dir"] = context.runtime.get_clang_pch_dir()  # its own: others write theirs at the same time
        try:
            build.build_cpu(*args, **kwargs)
            answer = "done"
        except Exception as error:
            answer = " ".join(str(error).split()) or "failed"
        print(answer, file=answers, flush=True)


def _next_line() -> str:
    waiting = threading.Timer(PATIENCE, os._exit, (0,))
    waiting.daemon = True
    waiting.start()
    line = sys.stdin.readline()
    waiting.cancel()
    return line


if __name__ == "__main__":
    main()
