"""``python -m warp_cloth`` is the ``warp-cloth`` command."""

from warp_cloth.cli import main

if __name__ == "__main__":
    main()
