"""Run by a Python that has bpy: ``in_blender.py ADDON COMMAND FOLDER`` drives the add-on, and prints what it finds."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np

SIDE, HEIGHT, VERTICES = 0.4, 1.0, 9  # of the cloth [m]
RADIUS = 0.15  # of the ball [m]
BUTTON = 0.004  # of the button from the middle of the cloth [m]
MATRIX = (
    (0.0, -2.0, 0.0, 0.3),
    (2.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 2.0, 0.0),
    (0.0, 0.0, 0.0, 1.0),
)  # turned, twice as big


def world(thing: Any) -> Any:
    """Vertices as shown, modifiers and shape keys included [m], shape [V, 3]."""
    shown = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.empty(3 * len(shown.data.vertices), dtype=np.float32)
    shown.data.vertices.foreach_get("co", points)
    matrix = np.array(shown.matrix_world)
    return points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def build() -> tuple[Any, Any]:
    """A cloth above a ball; the cloth's object is moved, turned and scaled, and has a button and a loose vertex."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=RADIUS, location=(0.3, 0.0, HEIGHT - RADIUS - 0.02), segments=32)
    ball = bpy.context.active_object
    line = np.linspace(-SIDE / 4, SIDE / 4, VERTICES)
    button = [(x, y, HEIGHT / 2 + BUTTON / 2) for x, y in ((0.0, 0.0), (0.004, 0.0), (0.0, 0.004))]
    points = [(x, y, HEIGHT / 2) for y in line for x in line] + [*button, (0.0, 0.0, 1.5)]
    quads = [
        (row * VERTICES + column, row * VERTICES + column + 1, (row + 1) * VERTICES + column + 1,
         (row + 1) * VERTICES + column)
        for row in range(VERTICES - 1) for column in range(VERTICES - 1)
    ]  # fmt: skip
    mesh = bpy.data.meshes.new("cloth")
    first = VERTICES**2
    mesh.from_pydata(points, [], [*quads, (first, first + 1, first + 2)])
    cloth = bpy.data.objects.new("cloth", mesh)
    cloth.matrix_world = [list(row) for row in zip(*MATRIX, strict=True)]
    bpy.context.collection.objects.link(cloth)
    ball.select_set(True)
    cloth.select_set(True)
    bpy.context.view_layer.objects.active = cloth
    bpy.context.view_layer.update()
    return cloth, ball


def clearance(cloth: Any, ball: Any) -> list[float]:
    """Least and greatest distance of the cloth's faces' vertices to the ball's surface [m]."""
    away = np.linalg.norm(world(cloth)[:-1] - np.array(ball.location), axis=1) - RADIUS
    return [float(away.min()), float(away.max())]


def enable(addon: Path, command: str) -> None:
    """Installs and enables the add-on as a user does, and chooses the command."""
    bpy.ops.preferences.addon_install(filepath=str(addon))
    bpy.ops.preferences.addon_enable(module=addon.stem)
    bpy.context.preferences.addons[addon.stem].preferences.command = command


def fit(**options: Any) -> str:
    """What the operator says, empty if it finished."""
    try:
        assert bpy.ops.object.warp_cloth_fit(fabric="silk", **options) == {"FINISHED"}
    except RuntimeError as error:
        return str(error)
    return ""


def rise_of_body(module: Any, ball: Any, folder: Path) -> list[float]:
    """How far the ball is from home in two frames [m], the first of which a fit has moved by 0.5 m upwards."""
    home = world(ball)
    shapes = np.stack([home + np.array([0.0, 0.0, 0.5]), home]) @ module.Y_UP.T
    header = module.PC2.pack(b"POINTCACHE2\0", 1, len(home), 1.0, 1.0, len(shapes))
    (folder / "moved.pc2").write_bytes(header + shapes.astype("<f4").tobytes())
    module.Fit._move_body(SimpleNamespace(body=ball.name, metres=1.0), bpy.context, folder / "moved.pc2")
    rises = []
    for frame in (1, 2):
        bpy.context.scene.frame_set(frame)
        rises.append(float((world(ball) - home)[:, 2].mean()))
    return rises


def main() -> None:
    addon, command, folder = Path(sys.argv[1]), *sys.argv[2:]
    found: dict[str, Any] = {}
    cloth, ball = build()
    before = world(cloth)
    enable(addon, "/nowhere/warp-cloth")
    found["missing"] = fit()
    enable(addon, command)
    found["refused"] = fit(options="--set garment.fabrik=1")
    found["said"] = fit()
    key = cloth.data.shape_keys.key_blocks["worn"]
    found["keys"] = [each.name for each in cloth.data.shape_keys.key_blocks]
    found["worn"] = clearance(cloth, ball)
    found["loose"] = float(np.abs(world(cloth)[-1] - before[-1]).max())
    worn = world(cloth)
    found["button"] = float(np.linalg.norm(worn[VERTICES**2] - worn[VERTICES**2 // 2])) - BUTTON
    found["fell"] = float((before - worn)[VERTICES**2, 2])
    key.value = 0.0
    bpy.context.view_layer.update()
    found["basis"] = float(np.abs(world(cloth) - before).max())
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "scene.blend"))
    found["said"] += fit(result="CACHE", frames=5)
    bpy.context.scene.frame_set(1)
    found["first"] = float(np.abs(world(cloth)[:-1] - before[:-1]).max())
    bpy.context.scene.frame_set(5)
    found["last"] = float(np.abs(world(cloth) - worn).max())
    found["caches"] = [str(path.relative_to(folder)) for path in Path(folder).rglob("*.pc2")]
    found["rise"] = rise_of_body(sys.modules[addon.stem], ball, Path(folder))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(Path(folder) / "worn.glb"))
    enable(addon, command)
    bpy.context.view_layer.objects.active = bpy.data.objects["shirt"]
    bpy.ops.object.warp_cloth_panels()
    shirt = bpy.data.objects["shirt"]
    found["groups"] = {
        group.name: sum(group.index in [each.group for each in vertex.groups] for vertex in shirt.data.vertices)
        for group in shirt.vertex_groups
    }
    print("FOUND " + json.dumps(found), flush=True)
    os._exit(0)  # bpy as a module may hang in its own clean-up


main()
