"""Fixtures that every test file may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real garments and bodies, which this project does not ship: $WARP_CLOTH_DATA or ../shared/data."""
    folder = Path(os.environ.get("WARP_CLOTH_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no real meshes here: set WARP_CLOTH_DATA to a folder that has them")
    return folder
