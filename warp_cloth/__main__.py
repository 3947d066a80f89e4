"""The ``warp-cloth`` command, and ``python -m warp_cloth``."""

import sys


def main() -> None:
    """Runs the command; an interrupt while it is still imported ends it with one line, too."""
    try:
        from warp_cloth.cli.main import main as run
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)  # as a shell's Ctrl-C; its name is not imported yet
    run()


if __name__ == "__main__":
    main()
