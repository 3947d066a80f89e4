"""The picture marks where problems are, and only there."""

from __future__ import annotations

import numpy as np
import pytest
from worn import box_avatar, worn

from warp_cloth import FitProblem, ProblemCode
from warp_cloth.export.preview import preview_image
from warp_cloth.export.problem_marks import concerned, places_of

SHIRT = worn()


def problem(vertices: tuple[int, ...] = (), faces: tuple[int, ...] = (), garment: str = "shirt") -> FitProblem:
    return FitProblem(ProblemCode.CROSSING, "It crosses.", "Let it not.", garment, vertices=vertices, faces=faces)


def test_what_is_concerned_are_vertices_and_the_corners_of_faces() -> None:
    assert concerned(problem(vertices=(3,)), SHIRT).tolist() == [3]
    assert concerned(problem(faces=(0,)), SHIRT).tolist() == sorted(SHIRT.mesh.triangles[0].tolist())
    assert len(concerned(problem(vertices=(3,), garment="trousers"), SHIRT)) == 0


def test_where_all_of_a_garment_is_concerned_nothing_is_marked() -> None:
    everywhere = problem(vertices=tuple(range(len(SHIRT.points))))
    assert len(concerned(everywhere, SHIRT)) == 0
    assert places_of([SHIRT], [everywhere]) == []


def test_a_ring_stands_at_a_vertex_that_is_concerned() -> None:
    ((code, place),) = places_of([SHIRT], [problem(vertices=(0, 1, 2))])
    assert code == "crossing"
    assert any(np.array_equal(place, SHIRT.points[vertex]) for vertex in (0, 1, 2))


@pytest.mark.parametrize("marked", [False, True])
def test_the_picture_is_red_where_a_problem_is(marked: bool) -> None:
    problems = [problem(faces=tuple(range(10)))] if marked else []
    picture = preview_image(garments=[SHIRT], avatar=box_avatar(), size=(600, 300), problems=problems)
    pixels = np.asarray(picture).astype(int)
    red = (pixels[..., 0] > 120) & (pixels[..., 1] < 60) & (pixels[..., 2] < 60)
    assert (red.sum() > 100) == marked
