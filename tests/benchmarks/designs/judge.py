"""Judges a worn garment from outside, by files alone: is it at rest, whole, free of crossings, and on the body?

    python tests/benchmarks/designs/judge.py --garment shirt.obj --body body.obj --worn out/shirt.usdc \\
        --report out/report.json

Shares no code with warp_cloth, so that ``worn`` can be compared with it. Only whether the shape is at rest is taken
from the report. Prints its words, or "good", and what it measured.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from designs.geometry import Body, Floats, Ints, Mesh, crossings, read_obj
from designs.limbs import LIMBS, Skeleton, boundary_loops, limbs_cut, opening_class, skeleton_of, ways_out
from designs.measures import chord_ratios, edge_depths, edge_strains, face_depths, stretches

TORN = 0.5  # strain of an edge; the issue's own limit
DEEP = 0.001  # [m] of a vertex, an edge or a face in the body; the issue's own limit
THROUGH = 0.01  # [m]: an edge so deep runs through a limb, and does not just cut a corner
SHORT = 0.6  # chord ratio from which cloth is crumpled; the worst vertices of good designs have 0.55 to 0.7
BUNCHED = 0.05  # of the panels' vertices; good designs have 0.007 at most
TIGHT, TIGHT_AREA = 0.3, 0.1  # stretch, and part of the area: more than most knits bear, and than any woven cloth does
SLID = 0.15  # [m] of the top opening; fitted skirts settle by up to 0.145
HUNG_SLID = 0.3  # [m] where the head passes through the top opening; hoods and collars fold down by up to 0.14
ON_FLOOR = 0.25  # of the body's height, under which all cloth of a garment that began higher has fallen
SHOULDER = (0.7, 0.95)  # of the way from the middle to an armpit's gap: where the top of a shoulder is
HANGS = 0.065  # [m] that all cloth on a side lies below the top of the shoulder, where it hangs on the arm
THIN = 0.025  # [m] before and behind the shoulder's top, where cloth counts as over it
OVER = 1.2  # of the way to an armpit's gap: cloth that began nearer in began over the shoulder
ASIDE = (0.85, 0.3)  # of that way: where cloth begins on either side, if the garment hangs off one of them
HIDDEN = 0.03  # [m] that a hand or foot ends before its opening
SIDE = 0.05  # [m] from the middle, beyond which an opening belongs to a side


class Word(str, Enum):
    """What can be wrong with a result."""

    NOT_A_SHAPE = "not a shape"  # numbers are missing or not finite
    NOT_AT_REST = "not at rest"
    TORN = "torn"  # an edge is far longer than on its panels
    CROSSING = "crossing"  # cloth passes through cloth
    PENETRATION = "penetration"  # a vertex lies in the body
    THROUGH_LIMB = "through a limb"  # an edge or face runs deep through the body
    SHOWS_THROUGH = "shows through"  # the body comes out between vertices
    LIMB_OUTSIDE = "limb outside"  # nothing passes through an opening
    WRONG_LIMB = "wrong limb"  # another limb than where it began
    SLID = "slid"
    OFF_SHOULDER = "off the shoulder"  # hangs on an arm, though it began over the shoulder
    FELL = "fell"
    BUNCHED = "bunched"
    TOO_SMALL = "too small"
    TOO_LARGE = "too large"  # a hand or foot does not come out


@dataclass(frozen=True)
class Wearer:
    """A body with its limbs; ``skeleton`` is None where it has not five of them."""

    body: Body
    skeleton: Skeleton | None

    @classmethod
    def of(cls, mesh: Mesh) -> Wearer:
        body = Body(mesh)
        return cls(body, skeleton_of(body))


@dataclass(frozen=True)
class Judgement:
    """Words, empty where all is good, and figures: lengths in mm."""

    words: tuple[Word, ...]
    figures: dict[str, float]

    @property
    def good(self) -> bool:
        return not self.words

    def __str__(self) -> str:
        return ", ".join(word.value for word in self.words) or "good"


def judge(garment: Mesh, points: Floats, wearer: Wearer, *, at_rest: bool) -> Judgement:
    """Judges worn ``points`` [m] [V, 3] of a garment as it was loaded: where it began, and its panels in metres."""
    if points.shape != garment.points.shape or not np.isfinite(points).all():
        return Judgement((Word.NOT_A_SHAPE,), {})
    figures = _measure(garment, points, wearer.body)
    found = {
        Word.NOT_AT_REST: not at_rest,
        Word.TORN: figures["strain_max"] > TORN,
        Word.CROSSING: figures["crossings"] > 0,
        Word.PENETRATION: figures["vertex_mm"] > 1e3 * DEEP,
        Word.THROUGH_LIMB: figures["edge_mm"] > 1e3 * THROUGH,
        Word.SHOWS_THROUGH: 1e3 * THROUGH >= max(figures["edge_mm"], figures["face_mm"]) > 1e3 * DEEP
        or figures["edge_mm"] <= 1e3 * THROUGH < figures["face_mm"],
        Word.BUNCHED: figures["bunched"] > BUNCHED,
        Word.TOO_SMALL: figures["tight"] > TIGHT_AREA,
    }
    words = {word for word, is_so in found.items() if is_so} | _placement(garment, points, wearer, figures)
    return Judgement(tuple(word for word in Word if word in words), figures)


def _measure(garment: Mesh, points: Floats, body: Body) -> dict[str, float]:
    """Figures of the cloth and of what of it lies in the body."""
    clear = body.closest(points)
    chords = chord_ratios(garment, points)
    stretch, area = stretches(garment, points)
    edges, faces = crossings(garment, points)
    return {
        "strain_max": float(edge_strains(garment, points).max()),
        "crossings": float(len(edges)),
        "crossing_faces": float(len(np.unique(faces))),
        "vertex_mm": 1e3 * float(clear[body.inside(points)].max(initial=0.0)),
        "edge_mm": 1e3 * float(edge_depths(body, garment, points, clear).max()),
        "face_mm": 1e3 * float(face_depths(body, garment, points, clear).max()),
        "bunched": float(np.mean(chords[np.isfinite(chords)] < SHORT)) if np.isfinite(chords).any() else 0.0,
        "tight": float(area[stretch > TIGHT].sum() / max(area.sum(), 1e-12)),
    }


def _placement(garment: Mesh, points: Floats, wearer: Wearer, figures: dict[str, float]) -> set[Word]:
    """Whether the garment is still where it began on the body, with every limb in its opening."""
    words: set[Word] = set()
    loops = boundary_loops(garment)
    low, high = wearer.body.low, wearer.body.high
    floor = low[1] + ON_FLOOR * (high[1] - low[1])
    if points[:, 1].max() < floor <= garment.points[:, 1].max():
        words.add(Word.FELL)
    if not loops:
        return words
    top = max(loops, key=lambda loop: float(garment.points[loop, 1].mean()))
    drop = float((garment.points[top, 1] - points[top, 1]).mean())
    figures["drop_mm"] = 1e3 * drop
    hung = False
    if wearer.skeleton is not None:
        figures["limbs_cut"] = float(limbs_cut(wearer.skeleton.curves, points[garment.triangles]))
        if figures["limbs_cut"]:
            words.add(Word.THROUGH_LIMB)
        after = [opening_class(points[loop], ways_out(wearer.skeleton, points[garment.triangles])) for loop in loops]
        words |= _limbs(garment, points, wearer.skeleton, loops, after)
        hung = any(limbs[0] for limbs in after)
        if hung and any(sum(limbs[1:3]) == 1 for limbs in after):
            words |= _shoulders(garment, points, wearer)
    if drop > (HUNG_SLID if hung else SLID):
        words.add(Word.SLID)
    return words


def _limbs(
    garment: Mesh, points: Floats, skeleton: Skeleton, loops: list[Ints], after: list[tuple[int, ...]]
) -> set[Word]:
    """Whether the limbs in the openings are the right ones, and come out of them.

    The start tells which they are where no limb cuts the cloth there: else an opening has no class of its own.
    """
    if not all(map(any, after)):
        return {Word.LIMB_OUTSIDE}
    words = set()
    corners = garment.points[garment.triangles]
    ways = ways_out(skeleton, corners)
    before = [opening_class(garment.points[loop], ways) for loop in loops]
    moved = all(map(any, before)) and before != after and not limbs_cut(ways, corners)
    if moved or any(
        _other_side(garment.points[loop], limbs, skeleton) for loop, limbs in zip(loops, after, strict=True)
    ):
        words.add(Word.WRONG_LIMB)
    for loop, limbs in zip(loops, after, strict=True):
        if sum(limbs) == 1 and max(limbs) == 1 and not limbs[0]:
            curve = skeleton.curves[limbs.index(1)]
            out = opening_class(points[loop], list(skeleton.curves)) == limbs
            if not out and np.linalg.norm(points[loop] - curve[-1], axis=1).min() > HIDDEN:
                words.add(Word.TOO_LARGE)
    return words


def _shoulders(garment: Mesh, points: Floats, wearer: Wearer) -> set[Word]:
    """Whether cloth that began over a shoulder hangs on the arm now, for bodies that face along z."""
    body = wearer.body
    middle = 0.5 * (body.low + body.high)
    flat = body.mesh.points - (middle[0], 0.0, 0.0)
    out = _armpits(flat, body.low[1], body.high[1])
    if out is None:
        return set()
    begun, now = [], []
    for side in (-1.0, 1.0):
        across = side * flat[:, 0]
        top = flat[(across > SHOULDER[0] * out) & (across < SHOULDER[1] * out)]
        top = top[np.argmax(top[:, 1])]
        for shape, found in ((garment.points, begun), (points, now)):
            aside = side * (shape[:, 0] - middle[0])
            over = (shape[:, 1] > top[1] - HANGS) & (aside > 0.0)
            if shape is points:  # flat panels begin before and behind the shoulders
                over &= np.abs(shape[:, 2] - top[2]) < THIN
            found.append(float(aside[over].min(initial=np.inf)) / out)
    lost = any(first < OVER and not np.isfinite(last) for first, last in zip(begun, now, strict=True))
    aside = abs(begun[0] - begun[1]) < ASIDE[1] and max(now) > ASIDE[0] and min(now) < ASIDE[1]
    return {Word.OFF_SHOULDER} if lost or aside else set()


def _armpits(flat: Floats, low: float, high: float) -> float | None:
    """How far from the middle the gap between trunk and arms ends at its top [m]; None: the arms hang at the trunk."""
    for height in np.arange(low + 0.8 * (high - low), low + 0.6 * (high - low), -0.005):
        level = np.sort(np.abs(flat[np.abs(flat[:, 1] - height) < 0.005, 0]))
        gaps = np.diff(level)
        if len(gaps) and gaps.max() > 0.015 and level[np.argmax(gaps)] > 0.06 * (high - low):
            return float(level[np.argmax(gaps)])
    return None


def _other_side(loop: Floats, limbs: tuple[int, ...], skeleton: Skeleton) -> bool:
    """Whether the only limb in an opening is one of the side where it did not begin."""
    if sum(map(abs, limbs)) != 1 or limbs[0]:
        return False
    out = float(loop[:, 0].mean() - skeleton.middle[0])
    tip = float(skeleton.curves[limbs.index(1)][-1, 0] - skeleton.middle[0])
    return abs(out) > SIDE and out * tip < 0.0


def limb_names(limbs: tuple[int, ...]) -> str:
    """An opening's class in words."""
    return " and ".join(name for name, count in zip(LIMBS, limbs, strict=True) if count) or "nothing"


def read_points(path: Path) -> Floats:
    """Worn points [m] of the first garment: of an OBJ, a USD stage, or an npz with ``points``."""
    if path.suffix == ".obj":
        return read_obj(path).points
    if path.suffix == ".npz":
        with np.load(path) as packed:
            return np.asarray(packed["points"], dtype=np.float64)
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(path))
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    cloth = [mesh for mesh in meshes if "avatar" not in str(mesh.GetPath()).lower()]
    attribute = cloth[0].GetPointsAttr()
    times = attribute.GetTimeSamples()
    values = attribute.Get(times[-1]) if times else attribute.Get()
    return np.asarray(values, dtype=np.float64) * UsdGeom.GetStageMetersPerUnit(stage)


def main() -> None:
    parse = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parse.add_argument("--garment", type=Path, required=True, help="OBJ as the scene loads it, panels in metres")
    parse.add_argument("--body", type=Path, required=True, help="OBJ, metres")
    parse.add_argument("--worn", type=Path, required=True, help=".obj, .usdc or .npz")
    parse.add_argument("--report", type=Path, help="report.json; without it the shape is taken to be at rest")
    given = parse.parse_args()
    at_rest = given.report is None or json.loads(given.report.read_text())["status"] == "at_rest"
    found = judge(read_obj(given.garment), read_points(given.worn), Wearer.of(read_obj(given.body)), at_rest=at_rest)
    print(found)
    for name, value in found.figures.items():
        print(f"{name} {value:.4g}")


if __name__ == "__main__":
    main()
