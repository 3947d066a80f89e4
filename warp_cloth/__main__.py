"""The ``warp-cloth`` command, and ``python -m warp_cloth``."""

import atexit
import contextlib
import os
import signal
import sys


def main() -> None:
    """Runs the command; an interrupt during its import also ends it with one line."""
    signal.signal(signal.SIGTERM, _terminate)
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # it would look through all packages for some: 0.03 s
    end = _LastAct()
    atexit.register(end)  # the first to be registered is the last to run
    try:
        from warp_cloth.cli.resident_client import answered

        status = answered(sys.argv)
        if status is not None:
            sys.exit(status)
        from warp_cloth.cli.main import main as run

        run()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        end.status = 130  # as for Ctrl-C in a shell; cli.terminal.INTERRUPTED may not be imported yet
        sys.exit(end.status)
    except SystemExit as ended:
        end.status = ended.code or 0
        raise


def _terminate(number: int, _: object) -> None:
    """Ends the process in order, as an interrupt does, so that nothing half-written is left."""
    sys.exit(128 + number)


class _LastAct:
    """Ends the process once threads, children and exit handlers are done, before libraries take themselves down.

    Taking down Arrow's threads aborts the process at times (github.com/apache/arrow/issues/34314), after all the work.
    """

    def __init__(self) -> None:
        self.status: object = 1  # of an error that Python prints

    def __call__(self) -> None:
        if not isinstance(self.status, int):
            return  # a message, which Python prints
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError, AttributeError):
                stream.flush()
        os._exit(self.status)


if __name__ == "__main__":
    main()
