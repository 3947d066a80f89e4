"""Drapes of cloth in dimensionless numbers: what counts is its bending length over the support's radius."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.bench.trials import DRAPE_MODES, SUPPORT_RADIUS, Hanging, drape_disc, hung
from warp_cloth.drape.outline import ANGLES, Floats, Outline, outline_of_drape
from warp_cloth.material.fabric import Fabric
from warp_cloth.material.laboratory import GRAVITY, bending_length, bending_of_rigidity, rigidity_of_bending

RINGS = (20, 36)  # fewest and most; 1,060 vertices, 3 to 10 s on a core, and 3,400
EDGE = 0.4  # of the bending length, at most where rings allow; coarser meshes hold limp cloth up by 10 points
HANGING_DROP = 0.95  # of the drop of a rim that hangs from the support's edge on straight lines: cloth is round there


@dataclass(frozen=True, eq=False)
class SimulatedDrape:
    """A disc at rest on a support of ``bench.trials.SUPPORT_RADIUS``, and its outline."""

    mesh: Mesh
    points: Points  # [m], shape [V, 3]
    outline: Outline


@dataclass(frozen=True, eq=False)
class Trial:
    """A disc to drape."""

    fabric: Fabric
    start: Floats | Outline  # height of its flat rim over the angle [m], shape [ANGLES]; or how it already hangs
    mesh_seed: int = 0


def bending_lengths(fabric: Fabric) -> tuple[float, float]:
    """Bending lengths [m] along warp and weft."""
    warp, weft = (
        bending_length(rigidity_of_bending(bending, fabric.weight), fabric.weight)
        for bending in (fabric.bending_warp, fabric.bending_weft)
    )
    return warp, weft


def with_bending_lengths(fabric: Fabric, warp: float, weft: float) -> Fabric:
    """The fabric with other bending lengths [m]."""
    warp_bending, weft_bending = (
        bending_of_rigidity(fabric.weight * GRAVITY * length**3, fabric.weight) for length in (warp, weft)
    )
    return replace(fabric, bending_warp=warp_bending, bending_weft=weft_bending)


def simulate(
    trials: Sequence[Trial],
    support: float,
    ratio: float,
    *,
    device: str = "cpu",
    rings: int | None = None,
) -> list[SimulatedDrape]:
    """Drapes discs of ``ratio`` times the support's radius [m].

    The drape is computed on the bench's support with the bending lengths scaled to it, and stretch and shear scaled
    with weight times radius, which leaves its shape the same. ``rings`` None: by the shortest bending length.
    """
    scale, radius = SUPPORT_RADIUS / support, SUPPORT_RADIUS * ratio
    scaled = {id(trial.fabric): _scaled(trial.fabric, scale) for trial in trials}
    if rings is None:
        shortest = min(min(bending_lengths(fabric)) for fabric in scaled.values())
        rings = int(np.clip(round(radius / (EDGE * shortest)), *RINGS))
    meshes = {seed: drape_disc(rings, radius, seed) for seed in {trial.mesh_seed for trial in trials}}
    discs = []
    for trial in trials:
        mesh = meshes[trial.mesh_seed]
        start = trial.start
        placed = hanging(mesh, ratio, start) if isinstance(start, Outline) else _waved(mesh, radius, start)
        discs.append(Hanging(mesh, scaled[id(trial.fabric)], placed))
    return [
        SimulatedDrape(each.mesh, settled.points, outline_of_drape(each.mesh, settled.points, SUPPORT_RADIUS))
        for each, settled in zip(discs, hung(discs, device), strict=True)
    ]


def _scaled(fabric: Fabric, scale: float) -> Fabric:
    """The fabric whose drape on a support so many times as large has the same shape."""
    warp, weft = bending_lengths(fabric)
    return replace(
        with_bending_lengths(fabric, warp * scale, weft * scale),
        stretch_warp=fabric.stretch_warp * scale,
        stretch_weft=fabric.stretch_weft * scale,
        shear=None if fabric.shear is None else fabric.shear * scale,
    )


def random_start(seed: int) -> Floats:
    """Slight waves [m] of every usual number of folds, shape [ANGLES]."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(DRAPE_MODES))
    turn = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    wave = sum(np.cos(mode * turn + phase) for mode, phase in zip(DRAPE_MODES, phases, strict=True))
    return np.asarray(1e-3 * wave)


def _waved(mesh: Mesh, disc_radius: float, start: Floats) -> Points:
    radius, angle = np.hypot(mesh.points[:, 0], mesh.points[:, 2]), np.arctan2(-mesh.points[:, 2], mesh.points[:, 0])
    height = np.interp(angle * ANGLES / (2.0 * np.pi), np.arange(ANGLES), start, period=ANGLES)
    out = np.maximum(radius - SUPPORT_RADIUS, 0.0) / (disc_radius - SUPPORT_RADIUS)
    points = mesh.points.copy()
    points[:, 1] += height * out**2
    return points


def hanging(mesh: Mesh, ratio: float, outline: Outline) -> Points:
    """Points [m] of the disc, laid on straight lines from the support's edge to its rim below an outline.

    Slight waves would do for a start, but cloth grows folds of other numbers from them.
    """
    turn = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    rim = np.clip(outline.smooth, 1.0, ratio)
    drop = HANGING_DROP * np.sqrt((ratio - 1.0) ** 2 - (rim - 1.0) ** 2)
    # the rim is stretched evenly: as far along it in the cloth as along the outline in space
    place = np.column_stack([rim * np.cos(turn), rim * np.sin(turn), drop])
    side = np.linalg.norm(np.roll(place, -1, axis=0) - place, axis=1)
    ahead = 2.0 * np.pi * (np.cumsum(side) - side) / side.sum() - turn
    ahead -= ahead.mean()
    flat = np.hypot(mesh.points[:, 0], mesh.points[:, 2]) / SUPPORT_RADIUS
    angle = np.arctan2(-mesh.points[:, 2], mesh.points[:, 0])
    seen = angle - np.interp(angle, turn + ahead, ahead, period=2.0 * np.pi)
    out = np.maximum(flat - 1.0, 0.0) / (ratio - 1.0)
    radius = np.minimum(flat, 1.0) + out * (np.interp(seen, turn, rim, period=2.0 * np.pi) - 1.0)
    turned = angle + out * (seen - angle)
    height = -out * np.interp(seen, turn, drop, period=2.0 * np.pi)
    return SUPPORT_RADIUS * np.column_stack([radius * np.cos(turned), height, -radius * np.sin(turned)])
