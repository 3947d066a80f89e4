"""Blender add-on: fits the active mesh, a garment, on the other selected mesh, its body; as shape key or cache.

Install it in Blender 4.2 or newer by Edit > Preferences > Add-ons > Install from Disk, and choose there the
``warp-cloth`` command of a Python environment; Blender's own Python needs no package. It is then in the sidebar (N) of
the 3-D view. The two meshes travel as OBJ in metres, y up; vertices keep their numbers.
"""

# No `from __future__ import annotations`: Blender reads its properties from annotations that are values.
import json
import os
import shlex
import struct
import subprocess
import tempfile
from pathlib import Path

import bpy
import numpy as np

bl_info = {
    "name": "warp_cloth",
    "author": "warp_cloth",
    "version": (1, 0, 0),
    "blender": (4, 2, 0),
    "location": "View3D > Sidebar > warp_cloth",
    "description": "Fits a garment on a body",
    "category": "Object",
}

NAME = "warp_cloth"  # of the modifier, of the folder of caches, of the sidebar's tab
WORN_KEY = "worn"  # the shape key
PANEL_ATTRIBUTE = "_panel_"  # as warp_cloth writes panels into .glb files
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # takes Blender's axes to the command's
WORN, NOT_WORN = 0, 3  # exit statuses with a result
LOOK = 0.2  # [s] from look to look at a running fit
PC2 = struct.Struct("<12siiffi")  # signature, version, points, first frame, frames per sample, samples


class FitError(Exception):
    """What a person can mend, in one sentence."""


class Fit:
    """A running fit: its meshes in a folder of its own, its process, and where the result goes."""

    def __init__(self, context, garment, body, command, settings):
        self.garment, self.body, self.settings = garment.name, body.name, settings
        self.vertices = len(garment.data.vertices)
        self.metres = _metres(context.scene)
        self._folder = tempfile.TemporaryDirectory(prefix="warp_cloth_")
        self.folder = Path(self._folder.name)
        _write_garment(self.folder / "garment.obj", garment, self.metres)
        _write_body(self.folder / "body.obj", body, self.metres, context.evaluated_depsgraph_get())
        self._log = (self.folder / "log.txt").open("w+", encoding="utf-8", errors="replace")
        environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
        try:
            self.process = subprocess.Popen(
                [command, *self._arguments()],
                cwd=self.folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=subprocess.STDOUT,
            )
        except OSError as error:
            self.close()
            raise FitError(f"{command}: {error.strerror}; choose the warp-cloth command in the preferences") from error

    def _arguments(self):
        settings = self.settings
        words = ["fit", "garment.obj", "--on", "body.obj", "--fabric", settings["fabric"], "--out", "out"]
        for key in ("garment.units=m", "avatar.units=m", "garment.up=y", "avatar.up=y"):
            words += ["--set", key]
        if settings["result"] == "CACHE":
            return [*words, "--format", "obj,pc2", "--frames", str(settings["frames"]), *settings["options"]]
        return [*words, "--format", "obj", *settings["options"]]

    @property
    def running(self):
        return self.process.poll() is None

    def cancel(self):
        self.process.terminate()
        self.process.wait()
        self.close()

    def close(self):
        self._log.close()
        self._folder.cleanup()

    def finish(self, context):
        """Puts the result on the garment; whether it is worn, and the verdict in words."""
        try:
            if self.process.returncode not in (WORN, NOT_WORN):
                self._log.seek(0)
                lines = [line for line in self._log.read().splitlines() if line.strip()] or ["warp-cloth ended early"]
                raise FitError(next((line for line in lines if line.startswith("error: ")), lines[-1]))
            garment = bpy.data.objects.get(self.garment)
            if garment is None or len(garment.data.vertices) != self.vertices:
                raise FitError(f"{self.garment} has changed since the fit began; fit it again")
            out = self.folder / "out"
            if self.settings["result"] == "CACHE":
                shapes, trims = _frames(out / "garment_garment.pc2"), out / "garment_garment_trims.pc2"
                if trims.exists():
                    shapes = np.concatenate([shapes, _frames(trims)], axis=1)
                _set_cache(context, garment, self._local(garment, shapes))
                self._move_body(context, out / "garment_avatar.pc2")
            else:
                _set_shape_key(garment, self._local(garment, _obj_points(out / "garment.obj")[None])[0])
            report = json.loads((out / "report.json").read_text(encoding="utf-8"))
            remedies = " ".join(problem["remedy"] for problem in report.get("problems", ()))
            return bool(report["worn"]), f"{report['message']} {remedies}".strip()
        finally:
            self.close()

    def _move_body(self, context, path):
        """The body's own cache, where it moved while it was dressed, and has the vertices that it was fitted with."""
        body = bpy.data.objects.get(self.body)
        if body is None:
            return
        modifier = body.modifiers.get(NAME)
        if modifier is not None and modifier.type == "MESH_CACHE":
            body.modifiers.remove(modifier)  # of an earlier fit
        if not path.exists():
            return
        shapes = _frames(path)
        if shapes.shape[1] == len(body.data.vertices) and not body.modifiers:
            home = np.array(body.matrix_world.inverted())
            shapes = shapes @ Y_UP / self.metres @ home[:3, :3].T + home[:3, 3]
            _set_cache(context, body, shapes.astype(np.float32))

    def _local(self, garment, shapes):
        """Shapes of the mesh as fitted [N, V, 3] as places of the garment's own vertices, in its own space.

        Those of buttons and other trims, which the cloth carried along, follow those of the cloth.
        """
        count = self.vertices
        world, home = np.array(garment.matrix_world), np.array(garment.matrix_world.inverted())
        start = _points(garment.data) @ world[:3, :3].T + world[:3, 3]
        found = shapes @ Y_UP / self.metres
        kept = np.arange(count)
        for file in (self.folder / "out").glob("*_map.npz"):  # written where loading has merged or dropped vertices
            with np.load(file) as arrays:
                kept = arrays.get("vertex_map", kept)
                if "trim_map" in arrays:
                    trims = arrays["trim_map"]
                    kept = np.where(trims >= 0, trims + found.shape[1] - int(arrays["trim_count"]), kept)
        placed = np.where((kept >= 0)[None, :, None], found[:, np.maximum(kept, 0)], start[None])
        return (placed @ home[:3, :3].T + home[:3, 3]).astype(np.float32)


def _metres(scene):
    """Metres in a unit of the scene."""
    return scene.unit_settings.scale_length if scene.unit_settings.system != "NONE" else 1.0


def _points(mesh):
    """Places of a mesh's vertices, shape [V, 3]."""
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    return points.reshape(-1, 3).astype(np.float64)


def _write_garment(path, garment, metres):
    if garment.mode == "EDIT":
        garment.update_from_editmode()
    _write_obj(path, garment.data, garment.matrix_world, metres)


def _write_body(path, body, metres, depsgraph):
    """The body as it is posed now, its modifiers included."""
    posed = body.evaluated_get(depsgraph)
    mesh = posed.to_mesh()
    try:
        _write_obj(path, mesh, body.matrix_world, metres)
    finally:
        posed.to_mesh_clear()


def _write_obj(path, mesh, matrix, metres):
    """A mesh in metres, y up, with its active texture coordinates."""
    if not len(mesh.polygons):
        raise FitError(f"{mesh.name} has no faces")
    world = np.array(matrix)
    points = (_points(mesh) @ world[:3, :3].T + world[:3, 3]) @ Y_UP.T * metres
    corners = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", corners)
    words = (corners + 1).astype(str)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points.tolist()]
    if mesh.uv_layers.active is not None:
        texcoords = np.empty(2 * len(mesh.loops), dtype=np.float32)
        mesh.uv_layers.active.data.foreach_get("uv", texcoords)
        lines += [f"vt {u:.9g} {v:.9g}" for u, v in texcoords.reshape(-1, 2).tolist()]
        words = np.char.add(np.char.add(words, "/"), np.arange(1, len(corners) + 1).astype(str))
    starts, totals = (np.empty(len(mesh.polygons), dtype=np.int32) for _ in range(2))
    mesh.polygons.foreach_get("loop_start", starts)
    mesh.polygons.foreach_get("loop_total", totals)
    words = words.tolist()
    if np.linalg.det(world[:3, :3]) < 0.0:  # mirrored: faces would be inside out
        words_of = [words[first : first + count][::-1] for first, count in zip(starts, totals, strict=True)]
    else:
        words_of = [words[first : first + count] for first, count in zip(starts, totals, strict=True)]
    lines += [f"f {' '.join(corners)}" for corners in words_of]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _obj_points(path):
    """Vertices of an OBJ, shape [V, 3]."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=np.float64)


def _frames(path):
    """Shapes of a point cache, shape [N, V, 3]."""
    data = path.read_bytes()
    _, _, points, _, _, samples = PC2.unpack_from(data)
    return np.frombuffer(data, dtype="<f4", offset=PC2.size).reshape(samples, points, 3).astype(np.float64)


def _set_shape_key(garment, points):
    """The shape key of the worn shape, on; one of an earlier fit is replaced."""
    if garment.data.shape_keys is None:
        garment.shape_key_add(name="Basis", from_mix=False)
    key = garment.data.shape_keys.key_blocks.get(WORN_KEY) or garment.shape_key_add(name=WORN_KEY, from_mix=False)
    key.data.foreach_set("co", points.ravel())
    key.value = 1.0
    garment.data.update()


def _set_cache(context, garment, frames):
    """A point cache next to the .blend file, or in Blender's own folder while there is none; played from the start."""
    folder = Path(bpy.path.abspath("//") or bpy.app.tempdir) / NAME
    folder.mkdir(exist_ok=True)
    path = folder / f"{bpy.path.clean_name(garment.name)}.pc2"
    header = PC2.pack(b"POINTCACHE2\0", 1, frames.shape[1], 0.0, 1.0, len(frames))
    path.write_bytes(header + frames.astype("<f4").tobytes())
    modifier = garment.modifiers.get(NAME)
    if modifier is None or modifier.type != "MESH_CACHE":
        modifier = garment.modifiers.new(NAME, "MESH_CACHE")
        garment.modifiers.move(len(garment.modifiers) - 1, 0)
    modifier.cache_format = "PC2"
    modifier.filepath = str(path)
    modifier.frame_start = context.scene.frame_start


class WarpClothPreferences(bpy.types.AddonPreferences):
    bl_idname = __name__

    command: bpy.props.StringProperty(
        name="warp-cloth command",
        description="In the folder bin (Scripts on Windows) of the environment that warp_cloth is installed in",
        subtype="FILE_PATH",
        default="warp-cloth",
    )

    def draw(self, context):
        self.layout.prop(self, "command")


class OBJECT_OT_warp_cloth_fit(bpy.types.Operator):  # noqa: N801 (Blender's own naming)
    """Fit the active mesh, a garment, on the other selected mesh, its body"""

    bl_idname = "object.warp_cloth_fit"
    bl_label = "Fit Garment on Body"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    fabric: bpy.props.StringProperty(
        name="Fabric", description="A shipped fabric (jersey, denim, silk), or a .toml file", default="jersey"
    )
    result: bpy.props.EnumProperty(
        name="Result",
        items=[
            ("SHAPE_KEY", "Shape key", f'The worn shape, as the shape key "{WORN_KEY}"'),
            ("CACHE", "Point cache", "The shapes on the way to rest, as a cache that is played from the first frame"),
        ],
        default="SHAPE_KEY",
    )
    frames: bpy.props.IntProperty(name="Frames", description="Shapes in the cache", default=48, min=2, max=10_000)
    options: bpy.props.StringProperty(
        name="Options", description="Further options of warp-cloth fit: --set garment.rest=uv", default=""
    )

    @classmethod
    def poll(cls, context):
        meshes = [each for each in context.selected_objects if each.type == "MESH"]
        return context.active_object in meshes and len(meshes) == 2

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        if not self._begin(context):
            return {"CANCELLED"}
        if bpy.app.background:  # no events come
            self._fit.process.wait()
            return self._end(context)
        self._timer = context.window_manager.event_timer_add(LOOK, window=context.window)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set("warp_cloth: fitting; Esc cancels")
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._fit.cancel()
            self._stop_waiting(context)
            return {"CANCELLED"}
        if event.type != "TIMER" or self._fit.running:
            return {"PASS_THROUGH"}
        self._stop_waiting(context)
        return self._end(context)

    def _begin(self, context):
        (body,) = (each for each in context.selected_objects if each.type == "MESH" and each != context.active_object)
        command = context.preferences.addons[__name__].preferences.command or "warp-cloth"
        try:
            settings = {
                "fabric": self.fabric,
                "result": self.result,
                "frames": self.frames,
                "options": shlex.split(self.options),
            }
            self._fit = Fit(context, context.active_object, body, command, settings)
        except (FitError, ValueError) as error:
            self.report({"ERROR"}, str(error))
            return False
        return True

    def _end(self, context):
        try:
            worn, words = self._fit.finish(context)
        except (FitError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"} if worn else {"WARNING"}, words if worn else f"not worn: {words}")
        return {"FINISHED"}

    def _stop_waiting(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)


class OBJECT_OT_warp_cloth_panels(bpy.types.Operator):  # noqa: N801
    """Make a vertex group of each panel of an imported .glb file"""

    bl_idname = "object.warp_cloth_panels"
    bl_label = "Panels to Vertex Groups"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    @classmethod
    def poll(cls, context):
        return context.active_object is not None and context.active_object.type == "MESH"

    def execute(self, context):
        garment = context.active_object
        names = [each.name for each in garment.data.attributes if each.name.startswith(PANEL_ATTRIBUTE)]
        panels = {}  # all are read before the first group is made, which moves attributes in memory
        for name in names:
            values = np.empty(len(garment.data.vertices), dtype=np.float32)
            garment.data.attributes[name].data.foreach_get("value", values)
            panels[name.removeprefix(PANEL_ATTRIBUTE)] = np.flatnonzero(values > 0.5).tolist()
        for name, vertices in panels.items():
            group = garment.vertex_groups.get(name) or garment.vertex_groups.new(name=name)
            group.add(vertices, 1.0, "REPLACE")
        if not panels:
            self.report(
                {"ERROR"}, f"{garment.name} has no attributes {PANEL_ATTRIBUTE}...; import a .glb of warp_cloth"
            )
            return {"CANCELLED"}
        return {"FINISHED"}


class VIEW3D_PT_warp_cloth(bpy.types.Panel):  # noqa: N801
    bl_label = "Garment fitting"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = NAME

    def draw(self, context):
        column = self.layout.column()
        column.label(text="Select the body, then the garment")
        column.operator(OBJECT_OT_warp_cloth_fit.bl_idname)
        column.operator(OBJECT_OT_warp_cloth_panels.bl_idname)


CLASSES = (WarpClothPreferences, OBJECT_OT_warp_cloth_fit, OBJECT_OT_warp_cloth_panels, VIEW3D_PT_warp_cloth)


def register():
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister():
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
