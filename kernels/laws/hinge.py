"""Geometry of one hinge: the normals of its two triangles, and its rest angle.

Apart from ``bending``, as / here is Warp's own division.
"""

from typing import Any

import warp as wp


@wp.func
def hinge_normals(axis: Any, wing_0: Any, wing_1: Any):
    """Unit normals of the two triangles and twice their areas [m2]; zero normals where a triangle has no area.

    All three arguments are relative to the axis' first vertex [m]. Flat cloth has equal normals.
    """
    normal_0 = wp.cross(axis, wing_0)
    normal_1 = wp.cross(wing_1, axis)
    return wp.normalize(normal_0), wp.normalize(normal_1), wp.length(normal_0), wp.length(normal_1)


@wp.func
def rotated_back(normal: Any, axis: Any, rest: Any):
    """The second triangle's unit normal, rotated about the axis by minus a rest angle of this cosine and sine.

    The angle counts as theta does: positive where (n0 x n1) . axis is.
    """
    length = wp.max(wp.length(axis), type(rest[0])(1.0e-30))
    return normal * rest[0] - wp.cross(axis, normal) * (rest[1] / length)
