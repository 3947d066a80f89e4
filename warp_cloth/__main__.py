"""The ``warp-cloth`` command, and ``python -m warp_cloth``."""

import sys


def main() -> None:
    """Runs the command; an interrupt during its import also ends it with one line."""
    try:
        from warp_cloth.cli.main import main as run
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)  # as for Ctrl-C in a shell; cli.terminal.INTERRUPTED may not be imported yet
    run()


if __name__ == "__main__":
    main()
