"""A process that compiles kernels' C++ for the CPU, run as a script by ``compilers.py``; imports none of this package.

It reads a line of JSON for each file, the folder of compiled headers and the arguments of Warp's ``build_cpu``, and
answers with a line: "done", or what went wrong. It ends with its input, or where nothing more comes.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

PATIENCE = 30.0  # [s] that it waits for more


def with_stored_header(compiler: Callable[..., None], folder: str, *args: Any, **options: Any) -> None:
    """Compiles a file with the header that a process before has compiled, which is then stored in ``folder``.

    Warp's header takes 2.7 s, a kernel 0.1 to 2 s; by itself Warp (1.19) compiles it in every process. Its name there
    says for which flags it is. One that does not fit all the same, as the compiler finds, is removed.
    """
    own = options.get("pch_dir")
    if not own or not options.get("use_precompiled_headers"):
        compiler(*args, **options)
        return
    linked, before = _link_headers(folder, own), set(os.listdir(own))
    compiler(*args, **options)
    after = set(os.listdir(own))
    with contextlib.suppress(OSError):
        os.makedirs(folder, exist_ok=True)
        for name in after - before:
            unfinished = os.path.join(folder, f"{name}.{os.getpid()}-{threading.get_ident()}")
            shutil.copyfile(os.path.join(own, name), unfinished)
            os.replace(unfinished, os.path.join(folder, name))
        for name in linked - after:
            os.remove(os.path.join(folder, name))


def _link_headers(folder: str, own: str) -> set[str]:
    """Names of the stored headers, which are now in the compiler's ``own`` folder as well."""
    linked: set[str] = set()
    with contextlib.suppress(OSError):
        for name in os.listdir(folder):
            stored, link = os.path.join(folder, name), os.path.join(own, name)
            if name.endswith(".pch") and not os.path.lexists(link):
                try:
                    os.symlink(stored, link)
                except OSError:  # Windows lets only some users
                    shutil.copyfile(stored, link)
                linked.add(name)
    return linked


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
        folder, args, kwargs = json.loads(line)
        if kwargs.get("use_precompiled_headers"):
            kwargs["pch_dir"] = context.runtime.get_clang_pch_dir()  # its own: others write theirs at the same time
        try:
            with_stored_header(build.build_cpu, folder, *args, **kwargs)
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
