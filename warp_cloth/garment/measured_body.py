"""A mannequin that has a person's stated measures when it is measured."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import partial

import numpy as np

from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.anatomy.stored_body import levels_of
from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.scene import BodyMeasures
from warp_cloth.shapes import SIZE_BODIES, MannequinMeasures, build_mannequin

NAMES = ("stature", "chest", "waist", "hip")
CLOSE, ACCEPTED = 0.002, 0.004  # [m] from the stated measures: where the search ends, and what it may end with
ROUNDS = 12
PLAIN_ROUNDS = 3  # that take no slope from the one before: of two levels the fuller is read, now this, now that
LARGEST_STEP = 0.05  # of a measure's logarithm, in one round
ARM_ANGLES = (45.0, 52.0, 60.0)  # degrees from straight down: raised where arms would join the chest


def likeliest(stated: BodyMeasures) -> MannequinMeasures:
    """The stated measures, and those of the standard bodies between S and L, or beyond, that are nearest to them."""
    small, large = (np.array([getattr(SIZE_BODIES[size], name) for name in NAMES]) for size in ("S", "L"))
    values = {name: getattr(stated, name) for name in NAMES}
    known = np.array([values[name] is not None for name in NAMES])
    girths = known & (np.array(NAMES) != "stature")  # tall people are not much wider: girths tell girths
    chosen = girths if girths.any() else known
    given = np.array([values[name] or 0.0 for name in NAMES])
    size = float(((given - small) / (large - small))[chosen].mean())
    typical = small + (large - small) * np.where(np.array(NAMES) == "stature", np.clip(size, 0.0, 1.0), size)
    return MannequinMeasures(**dict(zip(NAMES, np.where(known, given, typical).tolist(), strict=True)))


def measured_mannequin(stated: BodyMeasures, cache: Cache) -> tuple[MannequinMeasures, Mesh]:
    """A mannequin on whose mesh the stated measures are read, within 4 mm, and the parameters that make it.

    Its girths are fullest a little off the levels that its form is calibrated at, so that the parameters are corrected
    by what is read.

    Raises:
        InputError: no mannequin has these measures.
    """
    return cache.get_or_make("measured", (), partial(_search, stated, cache), stated.model_dump_json())


def _search(stated: BodyMeasures, cache: Cache) -> tuple[MannequinMeasures, Mesh]:
    wanted = likeliest(stated)
    goal = np.array([getattr(wanted, name) for name in NAMES])
    for angle in ARM_ANGLES:
        best = _corrected(replace(wanted, arm_angle=angle), goal, cache)
        if best is not None and best[0] < ACCEPTED:
            return best[1:]
    told = ", ".join(f"{name} {value:.2f}" for name, value in asdict(wanted).items() if name in NAMES)
    raise InputError("avatar.measures", f"no mannequin has {told} m", "check the measures, or give the mesh of a body")


def _corrected(
    wanted: MannequinMeasures, goal: np.ndarray, cache: Cache
) -> tuple[float, MannequinMeasures, Mesh] | None:
    """The mannequin nearest to the goal, and how far off its farthest measure is [m].

    By Broyden's method on logarithms: a belly over the hips is measured with them, so that one measure's correction
    moves another.
    """
    wanted_logs = values = np.log(goal)
    slope = np.eye(len(goal))  # of what is read over what is set
    best: tuple[float, MannequinMeasures, Mesh] | None = None
    step = before = np.zeros(len(goal))
    for index in range(ROUNDS):
        try:
            measures = replace(wanted, **dict(zip(NAMES, np.exp(values).tolist(), strict=True)))
            mesh = build_mannequin(measures, cache)
        except InputError:  # corrected out of a mannequin's range
            break
        found = _read(mesh)
        if found is None:
            break
        error = float(np.abs(found - goal).max())
        if best is None or error < best[0]:
            best = error, measures, mesh
        if error < CLOSE:
            break
        now = np.log(found)
        if index > PLAIN_ROUNDS:
            slope = slope + np.outer(now - before - slope @ step, step) / (step @ step)
        step, before = np.clip(np.linalg.solve(slope, wanted_logs - now), -LARGEST_STEP, LARGEST_STEP), now
        values = values + step
    return best


def _read(mesh: Mesh) -> np.ndarray | None:
    """Stature, chest, waist and hip of a mannequin [m]."""
    levels = levels_of(mesh, skeleton_of(mesh))
    low, high = mesh.bounds()
    return None if levels is None else np.array([high[1] - low[1], *(level.girth for level in levels)])
