"""Do fits have the same bits on every run and on both devices? A table of hashes of the worn shapes.

    python tests/benchmarks/bits.py --device cpu --device cuda:0 --device cuda:0 --iterations 2000 --processes 8

A scene is fitted once for every --device, and twice if one is repeated. With $WARP_CLOTH_DATA the real T-shirt is among
the scenes. Exits with 1 where hashes of one scene differ.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

from wearing import BODIES, SHARED, SHARED_SHIRT

NOTHING_STATED = "sphere, nothing stated"  # a fit of two attempts
LAYERS = {
    "garment": [
        {"shape": {"kind": "tshirt", "size": "M"}, "rest": "mesh", "fabric": "cotton"},
        {"shape": {"kind": "tshirt", "size": "L"}, "rest": "mesh", "fabric": "denim"},
    ],
    "avatar": {"shape": {"kind": "mannequin"}},
    "collision": {"cloth": True},
}


def scenes() -> dict[str, tuple[str | dict[str, Any], list[str]]]:
    """Scenes by name: what ``warp_cloth.fit`` takes, and what is changed in it."""
    found: dict[str, tuple[str | dict[str, Any], list[str]]] = {
        "hanging": ("hanging", []),
        "hanging, edges": ("hanging", ["garment.fabric=default"]),
        "hanging, multilevel": ("hanging", ["solver.method=multilevel"]),
        "hanging, direct": ("hanging", ["solver.method=direct"]),
        "hanging, float64": ("hanging", ["solver.precision=float64"]),
        "sphere": ("sphere", []),
        "sphere, multilevel": ("sphere", ["solver.method=multilevel"]),
        "sphere, direct": ("sphere", ["solver.method=direct"]),
        "T-shirt": ("tshirt", []),
        "T-shirt, felt, auto": ("tshirt", ["garment.fabric=felt", "collision.avatar=auto"]),
        "T-shirt, plain": ("tshirt", ["collision.avatar=plain"]),
        "T-shirt, multilevel": ("tshirt", ["solver.method=multilevel"]),
        "T-shirt, cloth on cloth": ("tshirt", ["collision.cloth=true"]),
        "layers": (LAYERS, []),
        NOTHING_STATED: ("sphere", []),
    }
    if SHARED.is_dir():
        worn = {"garment": SHARED_SHIRT, "avatar": BODIES["mean_all"]}
        found["real T-shirt"] = (worn, [])
        found["real T-shirt, stiff"] = (worn, ["garment.fabric={stretch=2e5}"])
        found["real T-shirt, cloth on cloth"] = (worn, ["collision.cloth=true"])
    return found


def hashed(name: str, device: str, iterations: int) -> tuple[str, int]:
    """The hash of a scene's worn shapes, and the iterations that it took."""
    import warp_cloth
    from warp_cloth.base.warp_setup import start_warp

    start_warp()
    scene, changes = scenes()[name]
    contact = [] if name == "layers" else ["collision.cloth=false"]
    stated = [*contact, *changes, f"solver.iterations={iterations}"]
    overrides = [] if name == NOTHING_STATED else stated
    fit = warp_cloth.fit(warp_cloth.load_scene(scene, overrides), device=device)
    points = b"".join(garment.points.tobytes() for garment in fit.garments)
    return hashlib.sha256(points).hexdigest()[:12], fit.report["iterations"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", action="append", required=True)
    parser.add_argument("--iterations", type=int, default=20_000)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--only", action="append", help="a scene's name; all by default")
    options = parser.parse_args()
    names = options.only or list(scenes())
    with ProcessPoolExecutor(options.processes, mp_context=get_context("spawn")) as pool:
        runs = {
            name: [pool.submit(hashed, name, device, options.iterations) for device in options.device] for name in names
        }
        differ = 0
        for name, results in runs.items():
            found = [run.result() for run in results]
            same = len(set(found)) == 1
            differ += not same
            hashes = " ".join(f"{text}/{count}" for text, count in found)
            print(f"{name:<30} {'same' if same else 'DIFFER'} {hashes}", flush=True)
    sys.exit(differ > 0)


if __name__ == "__main__":
    main()
