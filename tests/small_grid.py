"""A grid of nine squares, as a file in USD and as it is loaded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, Vt

from warp_cloth.base.mesh import Mesh
from warp_cloth.loading import load_mesh

FLOAT32_AT_ONE_METRE = 1e-7  # most formats store float32
POINTS = np.array([[x, y, 0.1 * x * y] for y in range(4) for x in range(4)]) / 3.0
CELLS = [(i + 4 * j, i + 1 + 4 * j, i + 5 + 4 * j, i + 4 + 4 * j) for j in range(3) for i in range(3)]
TRIANGLES = np.array([corner for a, b, c, d in CELLS for corner in ((a, b, c), (a, c, d))])


def load(path: Path, **options: object) -> Mesh:
    return load_mesh(path, **{"role": "garment", "key": "garment", **options})  # type: ignore[arg-type]


def write_usd(path: Path, transform: np.ndarray | None = None, **stage_data: object) -> None:
    """The small grid below /root/shirt, in metres."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, stage_data.get("metres", 1.0))
    UsdGeom.SetStageUpAxis(stage, stage_data.get("up", UsdGeom.Tokens.y))
    root = UsdGeom.Xform.Define(stage, "/root")
    if transform is not None:
        root.AddTransformOp().Set(Gf.Matrix4d(transform.tolist()))
    mesh = UsdGeom.Mesh.Define(stage, "/root/shirt")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(stage_data.get("points", POINTS).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(TRIANGLES))
    mesh.CreateFaceVertexIndicesAttr(TRIANGLES.reshape(-1).tolist())
    stage.Save()
