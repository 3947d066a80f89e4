"""Fabrics from rendered photographs of known drapes: how often coefficient and bending come back.

Every photograph is of another fabric, whose stretch and shear are off those that the fit is told.

python tests/benchmarks/validation/drape_photos.py --fabrics 100 --workers 6 --device cuda --write
python tests/benchmarks/validation/drape_photos.py --fabrics 30 --keep drapes   (takes the drapes that it made before)
python tests/benchmarks/validation/drape_photos.py --fabrics 30 --table         (the table's estimate alone)
python tests/benchmarks/validation/drape_photos.py --fabrics 60 --outlines      (no photographs)
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2]))
from drape_photos import photograph, random_view
from measured import Figures, script_parser

from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.bench.trials import SUPPORT_RADIUS, drape_disc
from warp_cloth.drape.made import fabric_of_readings, rigidities
from warp_cloth.drape.outline import outline_of_drape
from warp_cloth.drape.photograph import Photograph
from warp_cloth.drape.reading import DrapeReading, Setting, read_drape
from warp_cloth.drape.simulated import SimulatedDrape, Trial, random_start, simulate, with_bending_lengths
from warp_cloth.material.fabric import Fabric, fabric_named
from warp_cloth.material.laboratory import GRAVITY, KES_BENDING

CLASSES = ("cotton", "wool", "jersey", "silk", "polyester", "linen")
LENGTHS = (0.11, 0.42)  # bending length over the support's radius
UNEVEN = 0.15  # of ln(bending length along the warp, and along the weft)
OFF = 0.2  # of ln(stretch, shear), which the fit takes from the class, and of ln(weight), which it is told
PLAIN_ERROR = 0.3  # [points], of an outline that is not photographed


@dataclass(frozen=True)
class Found:
    """What came back of one drape."""

    text: str
    coefficient_off: float = np.inf  # [points]
    rigidity_off: tuple[float, float] = (np.inf, np.inf)  # ln of found over true, warp and weft
    errors: tuple[float, float] = (1.0, 1.0)  # stated, of ln of the mean rigidity, and of one

    @property
    def mean_off(self) -> float:
        return 0.5 * sum(self.rigidity_off)


def unknown_fabric(number: int, setting: Setting) -> tuple[Fabric, Fabric, np.ndarray]:
    """A fabric that is no entry of the table, the one of its class as which it is taken, and B along warp and weft."""
    rng = np.random.default_rng((7, number))
    lengths = setting.support * np.exp(rng.uniform(*np.log(LENGTHS)) + np.array([0.5, -0.5]) * rng.normal(0, UNEVEN))
    base = fabric_named(str(rng.choice(CLASSES)))
    base = replace(base, weight=base.weight * float(np.exp(rng.normal(0, OFF))))
    off = np.exp(rng.normal(0, OFF, 2))
    cloth = replace(base, stretch_warp=base.stretch_warp * off[0], stretch_weft=base.stretch_weft * off[0])
    shear = min((base.shear or 0.0) * float(off[1]), 0.24 * min(cloth.stretch_warp, cloth.stretch_weft))
    true = with_bending_lengths(replace(cloth, shear=shear), *lengths)
    return true, base, base.weight * GRAVITY * lengths**3 / KES_BENDING


def tried(photos: int, rings: int, refine: bool, outlines: bool, device: str, folder: Path, number: int) -> list[Found]:
    """Drapes one fabric, on a finer mesh than the fit's, photographs it, and makes it again from each photograph."""
    start_warp(False)
    setting = Setting()
    true, base, truth = unknown_fabric(number, setting)
    drape = draped(true, setting, rings, device, folder, number)
    found = []
    for copy in range(1 if outlines else photos):
        name = f"{number}_{copy}"
        try:
            reading = outlined(drape, setting) if outlines else photographed(drape, setting, number, copy, folder)
        except InputError as error:
            found.append(Found(f"{name} {error}"))
            continue
        made = fabric_of_readings([reading], base, setting, device=device, refine=refine)
        rigidity = np.array(rigidities(made.fabric, made.estimate, setting.support))
        off = reading.coefficient - drape.outline.coefficient(setting.ratio)
        warp, weft = np.log(rigidity / truth).tolist()
        mean_error, error = made.rigidity_errors
        text = (
            f"{name} DC {reading.coefficient:5.1f} ({off:+5.2f})  folds {reading.outline.folds} ({drape.outline.folds})"
            f"  ln B off {0.5 * (warp + weft):+.2f} (+-{mean_error:.2f}),"
            f" warp {warp:+.2f}, weft {weft:+.2f} (+-{error:.2f})"
            f"  warp/weft {rigidity[0] / rigidity[1]:.2f} ({truth[0] / truth[1]:.2f})"
        )
        found.append(Found(text, off, (warp, weft), (mean_error, error)))
    return found


def draped(fabric: Fabric, setting: Setting, rings: int, device: str, folder: Path, number: int) -> SimulatedDrape:
    """The drape to be photographed, kept in the folder from an earlier run where that made it."""
    radius = SUPPORT_RADIUS * setting.ratio
    kept, mesh = folder / f"{number}_{rings}.npy", drape_disc(rings, radius, 100 + number)
    if kept.exists():
        points = np.load(kept)
        return SimulatedDrape(mesh, points, outline_of_drape(mesh, points, SUPPORT_RADIUS))
    trial = Trial(fabric, random_start(100 + number), 100 + number)
    (drape,) = simulate([trial], setting.support, setting.ratio, device=device, rings=rings)
    np.save(kept, drape.points)
    return drape


def photographed(drape: SimulatedDrape, setting: Setting, number: int, copy: int, folder: Path) -> DrapeReading:
    view, path = random_view(1000 * number + copy), folder / f"{number}_{copy}.jpg"
    photograph(drape.points, drape.mesh.triangles, view, setting.support, setting.disc, path)
    return read_drape(path, setting)


def outlined(drape: SimulatedDrape, setting: Setting) -> DrapeReading:
    """A reading without a photograph: what the fit makes of a faultless one."""
    outline = drape.outline
    nothing = Photograph(Path("outline"), np.zeros((1, 1, 3)), 1.0, None)
    coefficient = outline.coefficient(setting.ratio)
    return DrapeReading(nothing, None, np.zeros((0, 2)), np.zeros((2, 3)), outline, coefficient, PLAIN_ERROR, ())


def counted(every: list[Found], figures: Figures, kind: str) -> None:
    """The counts, and how far off bending is."""
    read = [each for each in every if np.isfinite(each.coefficient_off)]
    limit = np.log(1.15)
    counts = {
        "read": len(read),
        "coefficient_within_1": sum(abs(each.coefficient_off) < 1.0 for each in read),
        "mean_B_within_15_percent": sum(abs(each.mean_off) < limit for each in read),
        "both_B_within_15_percent": sum(max(map(abs, each.rigidity_off)) < limit for each in read),
        "mean_B_within_two_stated": sum(abs(each.mean_off) < 2.0 * each.errors[0] for each in read),
        "both_B_within_two_stated": sum(max(map(abs, each.rigidity_off)) < 2.0 * each.errors[1] for each in read),
    }
    for key, count in counts.items():
        figures.add(key, f"{count} of {len(every)}", kind)
    stated = np.array([each.errors for each in read]).mean(axis=0)
    for name, column, values in (
        ("mean_B_off", 0, [each.mean_off for each in read]),
        ("one_B_off", 1, [each.rigidity_off for each in read]),
    ):
        rms = float(np.sqrt(np.mean(np.square(values))))
        figures.add(name, 100.0 * rms, f"% rms over the {kind}; {100.0 * stated[column]:.0f} % stated")


def main() -> None:
    parser = script_parser(__doc__, device="cpu")
    parser.add_argument("--fabrics", type=int, default=30)
    parser.add_argument("--first", type=int, default=0, help="number of the first fabric")
    parser.add_argument("--photos", type=int, default=1, help="of each fabric")
    parser.add_argument("--rings", type=int, default=32, help="of the discs that are photographed")
    parser.add_argument("--table", action="store_true", help="the table's estimate alone, without simulation")
    parser.add_argument("--outlines", action="store_true", help="no photographs: the simulated outlines themselves")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for drapes and photographs; drapes that it has are taken")
    chosen = parser.parse_args()
    folder = chosen.keep or Path(tempfile.mkdtemp())
    folder.mkdir(exist_ok=True)
    try_one = partial(tried, chosen.photos, chosen.rings, not chosen.table, chosen.outlines, chosen.device, folder)
    every: list[Found] = []
    kind = "outlines" if chosen.outlines else "photographs"
    with (
        ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool,
        Figures(__file__, chosen, device=chosen.device, cores=chosen.workers) as figures,
    ):
        for some in pool.map(try_one, range(chosen.first, chosen.first + chosen.fabrics)):
            every += some
            for each in some:
                print(each.text, flush=True)
        counted(every, figures, f"{kind}, by the table alone" if chosen.table else kind)


if __name__ == "__main__":
    main()
