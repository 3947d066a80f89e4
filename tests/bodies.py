"""Bodies that tests dress."""

from __future__ import annotations

from warp_cloth.anatomy.skeleton import Skeleton, skeleton_of
from warp_cloth.base.mesh import Mesh


def sure_skeleton(body: Mesh) -> Skeleton:
    """The skeleton of a body that is certain to have one."""
    found = skeleton_of(body)
    assert found is not None
    return found
