"""Does a garment keep out of the body? Edges through a limb, vertices under the skin, skin through faces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_cloth.avatar.penetration import VISIBLE
from warp_cloth.loading.raw import counted
from warp_cloth.model.fit_problem import FitProblem, ProblemCode
from warp_cloth.report.judged import Judged, JudgedScene, listed, own
from warp_cloth.report.numbers import short_number

if TYPE_CHECKING:
    from warp_cloth.avatar.penetration import Overlap

DEEP = 1.0  # [mm]; a third of the usual offset, and no more than float32 and the collider leave
USUAL_EDGE = 15.0  # [mm]
UNSEEN = 5.0  # [mm]; where a hundredth of the surface has a larger error, cloth rests on what is not there


def body_problems(judged: Judged) -> Iterator[FitProblem]:
    """Problems of a garment with the surface of its body."""
    overlap = judged.of.measured.overlap
    if judged.of.body is None or overlap is None:
        return
    found = through_body(judged, overlap), inside_body(judged, overlap), shown_through(judged, overlap)
    yield from (problem for problem in found if problem is not None)


def through_body(judged: Judged, overlap: Overlap) -> FitProblem | None:
    """Edges that pass through a limb."""
    mine = own(overlap.edges, judged.edges)
    if not mine.any():
        return None
    edges, depth = overlap.edges[mine] - judged.edges.start, 1e3 * float(overlap.edge_depths[mine].max())
    verb = "passes" if len(edges) == 1 else "pass"
    return FitProblem(
        ProblemCode.THROUGH_BODY,
        f'{counted(len(edges), "edge")} of "{judged.name}" {verb} through the body, up to {short_number(depth, 2)} mm '
        "deep: part of it started on the wrong side of a limb.",
        "Set avatar.mesh to the body in the pose that the garment was placed around, and avatar.poses to this one; or "
        "move panels that reach past another limb, such as wide trouser legs, clear of it.",
        judged.name,
        {"edges": len(edges), "depth_mm": depth},
        vertices=listed(judged.edge_ends[edges]),
    )


def inside_body(judged: Judged, overlap: Overlap) -> FitProblem | None:
    """Vertices under the skin."""
    depths = 1e3 * np.nan_to_num(overlap.vertex_depths[judged.vertices].astype(np.float64))
    deep = np.flatnonzero(depths > DEEP)
    if not len(deep):
        return None
    return FitProblem(
        ProblemCode.INSIDE_BODY,
        f'{counted(len(deep), "vertex")} of "{judged.name}" {"is" if len(deep) == 1 else "are"} inside the body, up to '
        f"{short_number(float(depths.max()), 2)} mm deep (limit {DEEP:g} mm).",
        "Start the garment further out, or check that it is not smaller than the body there.",
        judged.name,
        {"vertices": len(deep), "depth_mm": float(depths.max()), "limit_mm": DEEP},
        vertices=listed(deep),
    )


def shown_through(judged: Judged, overlap: Overlap) -> FitProblem | None:
    """Faces that the body shows through, although their corners are outside; edges through it say more."""
    mine = own(overlap.faces, judged.faces)
    depth = 1e3 * float(overlap.face_depths[mine].max(initial=0.0))
    if not depth > VISIBLE or own(overlap.edges, judged.edges).any():
        return None
    faces = overlap.faces[mine] - judged.faces.start
    return FitProblem(
        ProblemCode.SHOWN_THROUGH,
        f'The body shows through {counted(len(faces), "large face")} of "{judged.name}" by up to '
        f"{short_number(depth, 2)} mm (limit {VISIBLE:g} mm).",
        f"Divide these faces to edges of {finer_edge(judged, faces):.0f} mm (garment.edge_mm), or raise "
        "collision.offset_mm.",
        judged.name,
        {"faces": len(faces), "depth_mm": depth, "limit_mm": VISIBLE},
        faces=listed(faces),
    )


def finer_edge(judged: Judged, faces: NDArray[np.int64]) -> float:
    """Edges of which these faces are to be [mm]: as garments usually have, or half as long as theirs are."""
    corners = judged.points[judged.garment.triangles[faces]]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return min(USUAL_EDGE, max(500.0 * float(np.median(longest)), 1.0))


def unseen_body(of: JudgedScene) -> FitProblem | None:
    """A collider of depth buffers that misses much of the avatar."""
    kind, error = of.scene.collision.avatar, (of.measured.contact or {}).get("error_mm")
    if kind not in ("depth", "auto") or error is None or not error["p99"] > UNSEEN:
        return None
    remedy = "Leave collision.avatar out, so that views are added until none is missed."
    if kind == "auto":
        remedy = 'Set collision.avatar = "mesh", the exact surface, which is slower.'
    return FitProblem(
        ProblemCode.VIEWS_INSUFFICIENT,
        "The collider's views miss part of the body near the garment (99th percentile of its error: "
        f"{short_number(error['p99'], 2)} mm), so cloth may stand off the skin there.",
        remedy,
        figures={"error_p99_mm": float(error["p99"]), "limit_mm": UNSEEN},
    )
