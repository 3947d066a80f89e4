"""Coulomb friction on the avatar: cloth holds below the angle of friction, slides above it, and does not creep."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from meshfiles import box, write_obj

import warp_cloth
from warp_cloth.fitting.problem import Problem, collider_updates, limit_of, load_problem, tolerance_of
from warp_cloth.model.result import Status
from warp_cloth.solver.goal import Goal
from warp_cloth.solver.loop import relax_items

WITHIN = 2.0  # [degrees] of the angle of friction, on either side
HELD = 1e-3  # [m] that cloth which holds may move: it stretches under its own weight
SLID = 0.005  # [m] that cloth which slides must have gone; measured 12 to 16 mm
ITERATIONS = 600
EDGE = 0.02  # [m]
SHOULDERS = 0.8  # share of a T-shirt's vertices below its shoulders
CREEP = 1e-4  # [m], the most that a vertex may move in 1,000 iterations after rest


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    """Turned about x, so that +z goes down."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return points @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def slab(width: float = 0.4, thickness: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A block whose upper side is y = 0: points and triangles."""
    return box((-0.5 * width, -thickness, -0.5 * width), (0.5 * width, 0.0, 0.5 * width))


def sheet(height: float, count: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """A square of ``count`` vertices a side, flat at a height: points and triangles."""
    x, z = np.meshgrid(np.arange(count) * EDGE, np.arange(count) * EDGE)
    points = np.stack([x.ravel(), np.full(x.size, height), z.ravel()], axis=1) - [x.mean(), 0.0, z.mean()]
    corner = (np.arange(count - 1) + count * np.arange(count - 1)[:, None]).reshape(-1, 1, 1)
    return points, (corner + np.array([[0, count + 1, 1], [0, count, count + 1]])).reshape(-1, 3)


def way_down(folder: Path, kind: str, friction: float, degrees: float) -> float:
    """How far a sheet goes on a slope [m]."""
    block, faces = slab()
    write_obj(folder / "slab.obj", turned(block, degrees), faces)
    cloth, triangles = sheet(0.003)
    write_obj(folder / "sheet.obj", turned(cloth, degrees), triangles)
    scene = {
        "garment": {"mesh": str(folder / "sheet.obj"), "units": "m"},
        "avatar": {"mesh": str(folder / "slab.obj"), "units": "m", "friction": friction},
        "collision": {"avatar": kind, "pixel_mm": 4.0},
        "solver": {"iterations": ITERATIONS, "residual": 1e-30},
    }
    worn = warp_cloth.fit(scene, device="cpu").garments[0]
    down = turned(np.array([[0.0, 0.0, 1.0]]), degrees)[0]
    return float(((worn.points - turned(cloth, degrees)) @ down).mean())


@pytest.mark.parametrize("kind", ["depth", "mesh", "plain"])
@pytest.mark.parametrize("friction", [0.2, 0.5, 1.0])
def test_sheet_holds_below_the_angle_of_friction_and_slides_above(tmp_path: Path, kind: str, friction: float) -> None:
    angle = math.degrees(math.atan(friction))
    assert abs(way_down(tmp_path, kind, friction, angle - WITHIN)) < HELD
    assert way_down(tmp_path, kind, friction, angle + WITHIN) > SLID


def worn_t_shirt(*overrides: str) -> tuple[Problem, np.ndarray]:
    """A coarse T-shirt, relaxed until its certificate holds, and its points [m]."""
    own = ["garment.shape.edge_mm=30", "collision.pixel_mm=4", "collision.cloth=false"]
    scene = warp_cloth.load_scene("tshirt", [*own, *overrides])
    made = load_problem(scene, "cpu")
    (outcome,) = relax_items(
        made.certifier, [Goal(tolerance_of(scene), limit_of(scene))], follow=collider_updates(made)
    )
    assert outcome.status is Status.AT_REST
    return made, outcome.points


def way_on(made: Problem, points: np.ndarray) -> np.ndarray:
    """How far each vertex goes in 1,000 further iterations [m]."""
    for _ in range(10):
        made.relaxation.run(100)
    return np.asarray(np.linalg.norm(made.model.points() - points, axis=1))


def test_t_shirt_at_rest_does_not_creep() -> None:
    """Held to the rest that the test measures: at the default 1 mm its free folds are still settling."""
    made, points = worn_t_shirt("solver.tolerance_mm=0.05")
    assert way_on(made, points).max() < CREEP


@pytest.mark.parametrize("fabric", ["jersey", "denim"])
def test_t_shirt_does_not_creep_off_the_shoulders_from_the_default_certificate_on(fabric: str) -> None:
    made, points = worn_t_shirt(f"garment.fabric={fabric}")
    pushes = made.certifier.normal_forces()
    assert pushes is not None
    shoulders = (pushes > 0.0) & (points[:, 1] > np.quantile(points[:, 1], SHOULDERS))
    assert shoulders.sum() > 20
    assert way_on(made, points)[shoulders].max() < CREEP
