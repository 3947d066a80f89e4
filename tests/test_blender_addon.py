"""The Blender add-on, run by Blender without a window: what it fits comes back to its own vertices.

Needs a Python with bpy (as of `pip install bpy`): this one, or that of $WARP_CLOTH_BPY.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from worn import worn

from warp_cloth.export.meshes import write_glb

ROOT = Path(__file__).parents[1]
ADDON = ROOT / "warp_cloth" / "addons" / "warp_cloth_blender.py"
COMMAND = Path(sys.executable).parent / "warp-cloth"
PYTHON = os.environ.get("WARP_CLOTH_BPY") or (sys.executable if importlib.util.find_spec("bpy") else "")
FLOAT32 = 1e-6  # [m], near 1 m, through two files and back
SAGITTA = 0.003  # [m] by which the ball's faces lie within its radius
WAIT = 600.0  # [s], of a process that hangs

pytestmark = pytest.mark.skipif(not PYTHON, reason="no Python with bpy: set WARP_CLOTH_BPY")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("blender")
    write_glb(folder / "worn.glb", garments=[worn("shirt")], avatar=None, ranges={})
    words = [PYTHON, Path(__file__).with_name("in_blender.py"), ADDON, COMMAND, folder]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")}
    done = subprocess.run(
        [str(word) for word in words], env=environment, capture_output=True, text=True, timeout=WAIT, check=False
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("FOUND ")]
    assert lines, done.stdout + done.stderr
    return json.loads(lines[0].removeprefix("FOUND "))


def test_the_worn_shape_is_a_shape_key_in_the_objects_own_space(found: dict[str, Any]) -> None:
    assert found["said"] == ""
    assert found["keys"] == ["Basis", "worn"]
    least, most = found["worn"]
    assert -SAGITTA < least < 0.005  # touches the ball
    assert 0.02 < most < 0.4  # hangs over it
    assert found["loose"] < FLOAT32
    assert found["basis"] < FLOAT32


def test_a_button_goes_along_with_the_cloth(found: dict[str, Any]) -> None:
    assert found["fell"] > 0.005
    assert abs(found["button"]) < 1e-3


def test_frames_are_a_cache_beside_the_file_from_the_start_to_the_worn_shape(found: dict[str, Any]) -> None:
    assert found["caches"] == ["warp_cloth/cloth.pc2"]
    assert found["first"] < FLOAT32
    assert found["last"] < FLOAT32


def test_a_body_that_moved_to_dress_has_a_cache_too(found: dict[str, Any]) -> None:
    assert found["rise"] == pytest.approx([0.5, 0.0], abs=1e-5)


def test_what_a_person_can_mend_is_one_sentence(found: dict[str, Any]) -> None:
    assert "choose the warp-cloth command in the preferences" in found["missing"]
    assert "error: " in found["refused"]
    assert "fabrik" in found["refused"]
    assert "Traceback" not in found["refused"]


def test_panels_of_a_glb_become_vertex_groups(found: dict[str, Any]) -> None:
    mesh = worn("shirt").mesh
    names = ("front", "back", "panel_2")
    expected = {name: len(np.unique(mesh.triangles[mesh.panels == index])) for index, name in enumerate(names)}
    assert found["groups"] == expected
