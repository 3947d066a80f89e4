"""What a newcomer types in a second hour, how long each command takes, and what it says: two people's paths.

    python tests/benchmarks/newcomer.py [--only maker] [--garment shirt.obj] [--body scan.obj] [--keep FOLDER]

The pattern maker goes from a garment and a scan to a report that a customer gets; the researcher from nothing to a plot
of a hundred fits; the artist to Blender. Commands run one after another in an empty folder, with those of this
interpreter; a garment and a body of ours stand in where none are named. The figures are the waits.
Ends with 1 where a command does not exit as it should.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from measured import Figures, script_parser

sys.path.insert(0, str(Path(__file__).parents[1]))
from pages import write_stand_in

STUDY = """scene = "tshirt"
[product.sweep]
garment.fabric = ["jersey", "cotton", "denim", "silk"]
avatar.shape.chest = {from = 0.88, to = 1.12, count = 25}
"""
PLOT = """import csv
import matplotlib.pyplot as plt
rows = list(csv.DictReader(open("study/results.csv", encoding="utf-8")))
for fabric in sorted({row["garment.fabric"] for row in rows}):
    own = [row for row in rows if row["garment.fabric"] == fabric and row["ease_chest_cm"]]
    plt.plot([float(row["ease_chest_cm"]) for row in own], [float(row["strain_p99"]) for row in own], "o", label=fabric)
plt.xlabel("ease at the chest [cm]")
plt.ylabel("strain")
plt.legend()
plt.savefig("study.png")
print(len(rows), "fits,", sum(row["worn"] == "true" for row in rows), "worn")
"""
WORN, NOT_WORN, REFUSED = 0, 3, 2


@dataclass(frozen=True)
class Typed:
    """A command, how it should exit, and a file that it should write."""

    name: str
    line: str
    status: tuple[int, ...] = (WORN,)
    writes: str = ""


JUDGED = WORN, NOT_WORN  # of garments that are not ours
PATHS = {
    "maker": (
        Typed("measures", "warp-cloth avatar body.obj --measures", writes="out/body_body.png"),
        Typed("first_fit", "warp-cloth fit shirt.obj --on body.obj --fabric jersey", JUDGED, "out/report.html"),
        Typed("scene_file", "warp-cloth init shirt.obj --on body.obj --fabric jersey", writes="shirt.toml"),
        Typed(
            "denim_with_maps",
            "warp-cloth fit shirt.toml --set garment.fabric=denim --maps pressure,gap --out denim",
            JUDGED,
        ),
        Typed("compare", "warp-cloth compare out denim --out change", writes="change/compare.json"),
        Typed("moved_20_cm", "warp-cloth fit shirt.toml --set garment.translate=[0,0,-0.2] --out moved", JUDGED),
        Typed("sizes", "warp-cloth sizes tshirt --size s,m,l --ease 4 --out sizes", writes="sizes/sizes.html"),
        Typed("typing_error", "warp-cloth fit shirt.obj --on body.obj --fabric jersy", (REFUSED,)),
    ),
    "researcher": (
        Typed("100_fits", "warp-cloth batch study.toml --out study --sheet 60", JUDGED, "study/contact_sheet.html"),
        Typed("plot", "python plot.py", writes="study.png"),
        Typed("python", "python -c \"import warp_cloth; print(repr(warp_cloth.fit('skirt')))\""),
        Typed("tradeoff", "warp-cloth tradeoff hanging --within 2mm --out tradeoff"),
    ),
    "artist": (
        Typed(
            "glb_and_frames",
            "warp-cloth fit trousers --format usdc,glb,obj,pc2 --frames 24 --out scene",
            writes="scene/trousers.glb",
        ),
        Typed("fabric", "warp-cloth fabric jersey --out laboratory"),
        Typed("pattern", "warp-cloth pattern shirt.json --out flat", JUDGED),
    ),
}


def prepare(folder: Path, garment: Path | None, body: Path | None) -> None:
    """Puts what the paths name into their folder."""
    for name, given in (("shirt.obj", garment), ("body.obj", body)):
        if given is None:
            write_stand_in(folder / name)
        else:
            shutil.copy(given, folder / name)
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    (folder / "plot.py").write_text(PLOT, encoding="utf-8")
    shutil.copy(Path(__file__).parents[2] / "scenes" / "shirt.json", folder)


def run(typed: Typed, folder: Path) -> tuple[float, str, bool]:
    """Seconds, the first line that it prints, and whether it ended as it should."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    began = time.perf_counter()
    done = subprocess.run(
        typed.line, shell=True, cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True
    )
    seconds = time.perf_counter() - began
    said = [line.strip() for line in (done.stdout or done.stderr).splitlines() if line.strip()]
    written = not typed.writes or (folder / typed.writes).is_file()
    whole = done.returncode in typed.status and written and "Traceback" not in done.stderr
    return seconds, said[0] if said else "", whole


def main() -> None:
    parser = script_parser(__doc__)
    parser.add_argument("--only", choices=PATHS, help="one person's path")
    parser.add_argument("--garment", type=Path)
    parser.add_argument("--body", type=Path)
    parser.add_argument("--keep", type=Path, help="folder for what is written, to look at it")
    options = parser.parse_args()
    failed = []
    with tempfile.TemporaryDirectory() as scratch, Figures(__file__, options) as figures:
        for person in [options.only] if options.only else PATHS:
            folder = (options.keep or Path(scratch)).resolve() / person
            folder.mkdir(parents=True, exist_ok=True)
            prepare(folder, options.garment, options.body)
            for typed in PATHS[person]:
                seconds, said, whole = run(typed, folder)
                print(f"$ {typed.line}\n  {said}")
                figures.add(f"{person}.{typed.name}", seconds, "s")
                if not whole:
                    failed.append(typed.line)
    sys.exit(f"not as it should: {failed}" if failed else 0)


if __name__ == "__main__":
    main()
