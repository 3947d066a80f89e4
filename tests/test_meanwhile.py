"""USD is loaded before anything is imported while the fit runs: both would wait for each other's lock for ever."""

from __future__ import annotations

import subprocess
import sys

LOADED_FIRST = """
import sys
from types import SimpleNamespace
from warp_cloth.cli.fit import _Meanwhile

export = _Meanwhile("json", print)
export._show = lambda step: print("pxr.Tf" in sys.modules, export._thread is not None)
for stage in ("load", "compile"):
    export(SimpleNamespace(stage=stage))
"""


def test_usd_is_loaded_before_the_thread_that_imports_starts() -> None:
    found = subprocess.run([sys.executable, "-c", LOADED_FIRST], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["False", "False", "True", "True"]
