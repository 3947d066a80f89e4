"""The version of this package, also where it was never installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

NOT_INSTALLED = "0+checkout"  # a folder on the path of another program's Python, which has no metadata of it


def package_version() -> str:
    try:
        return version("warp-cloth")
    except PackageNotFoundError:
        return NOT_INSTALLED
