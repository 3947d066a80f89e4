"""The scene in which a posed start sews garments: the same for all fabrics and frictions."""

from __future__ import annotations

from warp_cloth.material.fabric import Fabric
from warp_cloth.scene.schema import Scene, SolverSpec

# Light and stretchy, so that seams close at once, and stiff in folds: with a hundredth of the bending it crumples.
FABRIC = Fabric(
    name="sewing",
    weight=3e-3,
    stretch_warp=20e3,
    stretch_weft=20e3,
    bending_warp=1e-5,
    bending_weft=1e-5,
    thickness=1e-3,
    friction=0.0,
)
FRICTION = 0.5  # of cloth on skin: without any, straps slide off shoulders that grow under them
SEWING = 1500  # iterations at most
# Of panels that are drawn together again since they crossed: with 0.9 narrow strips (of a flared cuff) flew through
# each other and stayed twisted (4 crossings on each of three bodies), with this none.
SLOW_MOMENTUM = 0.5


def sewing_scene_of(scene: Scene, offset: float) -> Scene:
    """The scene in the fabric that is sewn, ``offset`` [m] from the body."""
    avatar = scene.avatar
    solver = SolverSpec(
        method="accelerated",
        start="placed",
        iterations=SEWING,
        precision=scene.solver.precision,
        threads=scene.solver.threads,
    )
    return scene.model_copy(
        update={
            "name": "sewing",
            "garments": tuple(spec.model_copy(update={"fabric": FABRIC}) for spec in scene.garments),
            "avatar": None if avatar is None else avatar.model_copy(update={"friction": FRICTION}),
            "collision": scene.collision.model_copy(update={"avatar": "depth", "offset_mm": 1e3 * offset}),
            "solver": solver,
        }
    )
