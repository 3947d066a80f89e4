"""Time of an iteration with thousands to a million vertices, and whether its bits stay the same.

    python tests/benchmarks/iteration_times.py [edges:4k,65k,1m] [irregular:1m] [woven:1m] [worn:147] [loose:147]
        [--device cuda:0]

``edges`` and ``woven`` are hanging squares, a million of vertices as sixteen of them, ``irregular`` such of edges whose
triangles are all different; ``worn`` are as many T-shirts on mannequins, ``loose`` the same after 600 iterations, by
the anisotropic step. Printed are the median, least and most of five times, and a hash of the points: equal hashes of
two versions of the code mean equal bits. Iterations run in graphs as between two checks of a fit; packing and unpacking
of vertices counts, too.
"""

from __future__ import annotations

import hashlib
import time
from dataclasses import replace
from functools import partial

import numpy as np
import warp as wp
from measured import Figures, script_parser
from scipy.spatial import Delaunay

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.mesh import Mesh
from warp_cloth.fitting.problem import build_problem
from warp_cloth.garment.garment import Garment
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.garment.rest import build_rest_shape
from warp_cloth.material.fabric import Fabric
from warp_cloth.model.model import build_model
from warp_cloth.scene import load_scene
from warp_cloth.shapes import square
from warp_cloth.solver.loop import BURST, bursts
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import StepOptions

FABRICS = {"edges": Fabric(), "irregular": Fabric(), "woven": replace(Fabric(), shear=800.0)}
SIZES = {"4k": (64, 1), "65k": (256, 1), "1m": (256, 16)}  # vertices along a side, squares
FALLING = 600  # iterations
WARMING, ROUNDS, REPEATS = 3, 7, 5  # checks' intervals before the clock runs, for a median, medians


def irregular(vertices_per_side: int) -> Mesh:
    """A square of which nothing lies in rows, its vertices in no order."""
    count, rng = vertices_per_side, np.random.default_rng(0)
    places = np.stack(np.meshgrid(np.arange(count), np.arange(count)), axis=-1).reshape(-1, 2)
    inside = ((places > 0) & (places < count - 1)).all(axis=1)
    places = places + inside[:, None] * rng.uniform(-0.4, 0.4, places.shape)
    flat = places[rng.permutation(len(places))] / (count - 1)
    return Mesh(
        "irregular",
        np.column_stack([flat - [0.5, 0.0], np.zeros(len(flat))]),
        Delaunay(flat).simplices.astype(np.int32),
    )


def relaxation_of(fabric: str, size: str, device: str) -> Relaxation:
    """Cloth on a device, ready to iterate."""
    if fabric in ("worn", "loose"):
        scene, count = load_scene("tshirt", ["collision.cloth=false"]), int(size)
        relaxation = build_problem([scene] * count, [load_outfit(scene, None)] * count, device).relaxation
        if fabric == "loose":
            for _ in range(FALLING // BURST):
                relaxation.run(BURST)
            relaxation.update_anisotropy(np.zeros(count))
        return relaxation
    side, count = SIZES[size]
    mesh = (irregular if fabric == "irregular" else partial(square, plane="vertical"))(vertices_per_side=side)
    rest = build_rest_shape(mesh, FABRICS[fabric], rest="mesh")
    corners = np.argmax(mesh.points[:, :2] @ [[-1.0, 1.0], [-1.0, -1.0]], axis=0)
    garment = Garment(mesh.points, mesh.triangles, rest, corners.astype(np.int32))
    model = build_model([garment] * count, device=device, precision="mixed", garment_counts=[1] * count)
    return Relaxation(model, Collider(), StepOptions())


def microseconds(relaxation: Relaxation) -> float:
    """Median time of an iteration in a fit's graphs."""
    device, taken, parts = relaxation.model.device, [], bursts(relaxation)

    def interval() -> None:
        for number, count in enumerate(parts, 1):
            relaxation.run(count, shown=number == len(parts))

    relaxation.iterate(BURST)
    for _ in range(WARMING):
        interval()
    for _ in range(ROUNDS):
        wp.synchronize_device(device)
        began = time.perf_counter()
        interval()
        wp.synchronize_device(device)
        taken.append(time.perf_counter() - began)
    return 1e6 * float(np.median(taken)) / sum(parts)


def main() -> None:
    parser = script_parser(__doc__, device="cuda:0")
    parser.add_argument("cloth", nargs="*", default=["edges:4k,65k,1m", "irregular:1m", "woven:4k,65k,1m", "worn:147"])
    options = parser.parse_args()
    every = [(cloth.partition(":")[0], size) for cloth in options.cloth for size in cloth.partition(":")[2].split(",")]
    with Figures(__file__, options, device=options.device) as figures:
        for fabric, size in every:
            relaxation = relaxation_of(fabric, size, options.device)
            taken = sorted(microseconds(relaxation) for _ in range(REPEATS))
            digest = hashlib.sha1(relaxation.model.points().tobytes()).hexdigest()[:12]
            count = relaxation.model.vertex_count
            figures.add(f"{fabric}.{size}", taken[REPEATS // 2], "us")
            print(f"  {taken[0]:.2f} to {taken[-1]:.2f} us, {count:,} vertices, {digest}", flush=True)


if __name__ == "__main__":
    main()
