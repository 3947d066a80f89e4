"""Compiled modules of SciPy, loaded without the packages round them, whose imports take 0.1 to 0.4 s of a fit."""

from __future__ import annotations

import functools
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from typing import Any


@functools.cache
def compiled_scipy(package: str, name: str, *functions: str) -> Any:
    """The compiled module of this name in a package of SciPy; None where one with these functions is not found."""
    scipy = find_spec("scipy")
    inside = () if scipy is None else scipy.submodule_search_locations or ()
    found = PathFinder.find_spec(name, [str(Path(place) / package) for place in inside])
    if found is None or found.loader is None:
        return None
    module = module_from_spec(found)
    found.loader.exec_module(module)
    return module if all(hasattr(module, each) for each in functions) else None
