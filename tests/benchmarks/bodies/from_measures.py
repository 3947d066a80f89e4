"""Bodies made from stated measures: are these read off them again?

    python tests/benchmarks/bodies/from_measures.py [--sets 200] [--workers 2] [--write]

Draws sets of stature, chest, waist and hip, alternately of men and of women, whose means, spreads and correlations are
about those of soldiers (Gordon et al., 2012 Anthropometric Survey of U.S. Army Personnel, rounded), makes a body of
each, writes it to an OBJ file and measures that file as ``warp-cloth avatar --measures`` does. Prints how many were
made and the differences of measured and stated.
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np
from measured import Figures, script_parser
from meshfiles import write_obj

from warp_cloth.anatomy.measures import measures_of
from warp_cloth.anatomy.skeleton import skeleton_of
from warp_cloth.base.cache import Cache
from warp_cloth.base.errors import InputError
from warp_cloth.garment.measured_body import NAMES, measured_mannequin
from warp_cloth.loading import load_mesh
from warp_cloth.scene import BodyMeasures

# Means and standard deviations of stature, chest, waist and hip [m].
MEN = np.array([1.756, 1.06, 0.94, 1.02]), np.array([0.069, 0.09, 0.11, 0.08])
WOMEN = np.array([1.63, 0.95, 0.86, 1.02]), np.array([0.064, 0.08, 0.10, 0.08])
CORRELATIONS = np.array(
    [[1.0, 0.25, 0.2, 0.35], [0.25, 1.0, 0.87, 0.83], [0.2, 0.87, 1.0, 0.87], [0.35, 0.83, 0.87, 1.0]]
)
CLOSE = 5.0  # [mm] asked
MM = 1e3

Read = tuple[BodyMeasures, np.ndarray | str]


def drawn(count: int, seed: int) -> list[BodyMeasures]:
    """``count`` sets of measures in millimetres, each within what a scene may state."""
    random = np.random.default_rng(seed)
    sets: list[BodyMeasures] = []
    while len(sets) < count:
        mean, spread = (MEN, WOMEN)[len(sets) % 2]
        values = random.multivariate_normal(mean, CORRELATIONS * np.outer(spread, spread))
        sets.append(BodyMeasures(**{n: round(float(v), 3) for n, v in zip(NAMES, values, strict=True)}))
    return sets


def read_again(stated: BodyMeasures) -> Read:
    """Measured less stated [mm] of the body that is made, or why there is none."""
    try:
        body = measured_mannequin(stated, Cache())[1]
    except InputError as error:
        return stated, str(error)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "body.obj"
        write_obj(path, body.points, body.triangles)
        mesh = load_mesh(path, role="avatar", key="avatar")
    skeleton = skeleton_of(mesh)
    if skeleton is None:
        return stated, "no limbs found"
    values = {each.name: each.value for each in measures_of(mesh, skeleton)}
    found = np.array([values[name] or np.nan for name in NAMES])
    return stated, MM * (found - [getattr(stated, name) for name in NAMES])


def main() -> None:
    parser = script_parser(__doc__)
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    with ProcessPoolExecutor(given.workers) as pool:
        results = list(pool.map(read_again, drawn(given.sets, given.seed)))
    made = [found for _, found in results if not isinstance(found, str)]
    for stated, found in results:
        said = ", ".join(f"{name} {getattr(stated, name):.3f}" for name in NAMES)
        if isinstance(found, str):
            print(f"# {said}: {found}")
        elif not np.abs(found).max() <= CLOSE:
            print(f"# {said}: off by {np.round(found, 1).tolist()} mm")
    with Figures(__file__, given) as figures:
        figures.add("sets", len(results), "sets")
        figures.add("made", len(made), "bodies")
        off = np.abs(np.array(made).reshape(-1, len(NAMES)))
        figures.add("within_5mm", int((off <= CLOSE).all(axis=1).sum()), "bodies")
        for name, column in zip(NAMES, off.T, strict=True):
            figures.add(f"{name}.median", float(np.nanmedian(column)), "mm")
            figures.add(f"{name}.largest", float(np.nanmax(column)), "mm")


if __name__ == "__main__":
    main()
