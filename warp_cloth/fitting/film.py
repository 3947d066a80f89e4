"""The intermediate shapes of a fit in their order: how the garments were dressed, then how they came to rest."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from warp_cloth.fitting.attempts import Course, Run
from warp_cloth.garment.outfit import Outfit

T = TypeVar("T")
Shape = NDArray[np.float32]  # of all vertices [m], shape [V, 3]


@dataclass(frozen=True, eq=False)
class DressedShape:
    """A garment and the body that it is carried on, at one moment [m]."""

    body: Shape
    cloth: Shape


Dressing = Sequence[DressedShape]  # of one garment


@dataclass(frozen=True, eq=False)
class Film:
    """Intermediate shapes, float32 [N, V, 3]: of each garment, and of the avatar where it moves."""

    garments: tuple[NDArray[np.float32], ...]
    avatar: NDArray[np.float32] | None = None


def film_of(course: Course, outfit: Outfit, count: int, dressings: Sequence[Dressing] = ()) -> Film:
    """``count`` shapes of the best run: the loaded one first, then evenly chosen ones, the worn one last.

    Half of them show the dressing, where there was one: one garment after another, while the others wait. Where fewer
    shapes are known than are wanted, each serves for several.
    """
    runs = _leading_to(course.best, course)
    starts = np.cumsum([0, *(mesh.vertex_count for mesh in outfit.meshes)]).tolist()
    placed = np.concatenate([mesh.points for mesh in outfit.meshes]).astype(np.float32)
    dressed = _dressed(placed, dressings, starts) if runs[0].attempt.posed else []
    relaxed = [shape for run in runs for shape in _recorded(run)]
    last = course.best.outcome.points.astype(np.float32)
    early = _evenly(dressed, count // 2)
    known = [placed, *relaxed] if not dressed else relaxed or [dressed[-1].cloth]
    shapes = [*(each.cloth for each in early), *_evenly(known, max(count - 1 - len(early), 0)), last][:count]
    frames = np.stack(shapes)
    garments = tuple(frames[:, first:end] for first, end in itertools.pairwise(starts))
    if not dressed or outfit.avatar is None:
        return Film(garments)
    home = outfit.avatar.points.astype(np.float32)
    return Film(garments, np.stack([*(each.body for each in early), *[home] * (len(frames) - len(early))]))


def _leading_to(best: Run, course: Course) -> list[Run]:
    """The runs that the best one goes on from, and itself, in their order."""
    runs = [best]
    while (before := runs[0].attempt.begins_after) is not None:
        runs.insert(0, course.runs[before])
    return runs


def _recorded(run: Run) -> list[Shape]:
    """The shapes of a run before its last, as far as they are finite."""
    frames = run.outcome.frames
    return [shape for iteration, shape in frames if iteration < run.outcome.iterations and np.isfinite(shape).all()]


def _dressed(placed: Shape, dressings: Sequence[Dressing], starts: Sequence[int]) -> list[DressedShape]:
    """All garments while they are dressed one after another, from where they were placed."""
    shapes: list[DressedShape] = []
    cloth = placed
    for number, dressing in enumerate(dressings):
        for each in dressing:
            cloth = cloth.copy()
            cloth[starts[number] : starts[number + 1]] = each.cloth
            shapes.append(DressedShape(each.body, cloth))
    return [DressedShape(shapes[0].body, placed), *shapes] if shapes else []


def _evenly(known: Sequence[T], count: int) -> list[T]:
    """So many of what is known, evenly chosen, the first and the last among them."""
    if not known:
        return []
    return [known[pick] for pick in np.linspace(0, len(known) - 1, count).round().astype(int)]
