"""The ten headings of a newcomer's second hour as a table: what is typed, what is seen, in how many seconds.

    python tests/benchmarks/newcomer_headings.py [--only 1,9] [--keep FOLDER] [--write]

Each command runs in one folder, one after another, with those of this interpreter. The pattern maker's files are as
her programs write them: a shirt and a scan with holes, in centimetres, z up. ``--write`` puts the table into
newcomer.md. What is to be seen lies in FOLDER, to be looked at; what a command must print or write is checked here.
Ends with 1 where that is not so.
"""

from __future__ import annotations

import argparse
import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np
from measured import commit, hardware
from newcomer import JUDGED, WORN

sys.path.insert(0, str(Path(__file__).parents[1]))
from pages import write_stand_in

from warp_cloth.base.first_run import kernels_known

ROOT = Path(__file__).parents[2]
TABLE = Path(__file__).with_name("newcomer.md")
COLUMNS = 80
CENTIMETRES, HOLES, HOLE = 100.0, 8, 0.03  # a scan's holes, and their radius [m]
WAIT = 120.0  # [s] for a server's address
SERVERS = ("view", "serve")
ENDED = (130, -signal.SIGINT)  # by Ctrl-C, the command or the shell round it
BLOCKED = "import sys; sys.modules['matplotlib'] = None; from warp_cloth.__main__ import main; main()"
INSPECTED = (
    "import warp_cloth as w; print(w.__version__, *dir(w)); f = w.fit('skirt', overrides={'garment.fabric': 'denim'}); "
    "print(repr(f)); open('fit.html', 'w').write(f._repr_html_()); print(f.garments[0].points.shape)"
)


@dataclass(frozen=True)
class Line:
    """A command under a heading: what it must print, what it must write, and what a person sees."""

    heading: int
    typed: str
    seen: str
    says: str = ""
    writes: str = ""
    status: tuple[int, ...] = (WORN,)
    command: str = ""  # where that is not what is typed

    @property
    def run(self) -> str:
        return self.command or self.typed


HEADINGS = {
    1: "No scene file for the first garment",
    2: "Say what a tailor reads",
    3: "Sizes keep the body",
    4: "Compare, and batches that name what failed",
    5: "The live page, and the service",
    6: "Progress",
    7: "Python as people expect it",
    8: "Optional packages",
    9: "Artists' programs",
    10: "Works where it is unpacked",
}
IN_CHECKOUT = f"cd {shlex.quote(str(ROOT))} && "
LINES = (
    Line(
        1,
        "warp-cloth fit shirt.obj --on scan.obj --fabric jersey",
        "units and up axis found, both stand; shirt on its wearer, next to how it started",
        "garment.up = z",
        "out/preview.png",
        JUDGED,
    ),
    Line(
        1,
        "warp-cloth init shirt.obj --on scan.obj --fabric jersey",
        "a scene file with a comment on each key",
        "wrote shirt.toml",
        "shirt.toml",
    ),
    Line(
        2,
        "warp-cloth fit shirt.toml --maps pressure,gap --out report",
        "verdict in its colour, ease at three levels, strain in per cent, two maps; residuals folded away",
        "ease         chest +",
        "report/map_gap.png",
        JUDGED,
    ),
    Line(
        2, "warp-cloth avatar scan.obj --measures", "17 measures and where each was taken", "chest", "out/scan_body.png"
    ),
    Line(
        3,
        "warp-cloth sizes tshirt --size s,m,l --ease 4 --out sizes",
        "three sizes on one body in a row; above them which to take, and why",
        "",
        "sizes/sizes.png",
    ),
    Line(
        4,
        "warp-cloth compare sizes/M sizes/L --out change",
        "ease and strain of both, and the change (pictures where both have maps)",
        "",
        "change/compare.json",
    ),
    Line(
        4,
        "warp-cloth batch jobs.csv --out batch --sheet 12",
        "the failed row by name, column and remedy; a page of thumbnails, the worst first",
        "column garment.fabric",
        "batch/contact_sheet.html",
        JUDGED,
    ),
    Line(5, "warp-cloth view tshirt", "an address that waits for a browser; Ctrl-C ends it", "http://"),
    Line(5, "warp-cloth serve", "an address, the product's page at /docs; Ctrl-C ends it", "http://"),
    Line(
        6,
        "warp-cloth fit skirt --out skirt",
        f"one bar of five stages, the rest error as it falls; nothing cut at {COLUMNS} columns",
        "5/5",
        "skirt/report.html",
    ),
    Line(
        7,
        "python -c 'dir(warp_cloth); repr(fit)'",
        "names, version, a short line for a fit, a picture with verdict in a notebook; Warp is quiet",
        "worn",
        "fit.html",
        command=f'python -c "{INSPECTED}"',
    ),
    Line(
        8,
        "warp-cloth fabric jersey --out lab   # no matplotlib",
        "the table, and one line: no plots, and how to have them",
        "no plots",
        "lab",
        command=f'python -c "{BLOCKED}" fabric jersey --out lab',
    ),
    Line(
        9,
        "warp-cloth fit trousers --format usdc,glb,obj,pc2 --frames 24 --out scene",
        "panels, materials, normals and frames in each file that has a place for them",
        "",
        "scene/trousers.glb",
    ),
    Line(
        10,
        "cd CHECKOUT && python -c 'import warp_cloth'",
        "the installed package",
        "0.",
        command=f'{IN_CHECKOUT}python -c "import warp_cloth; print(warp_cloth.__version__)"',
    ),
    Line(
        10,
        "cd CHECKOUT && warp-cloth batch jobs.csv",
        "two items fitted",
        "2 at rest",
        command=IN_CHECKOUT + "warp-cloth batch {folder}/two.csv --out {folder}/two",
    ),
)
JOBS = "name,scene,garment.fabric\none,hanging,silk\ntwo,hanging,denim\nthree,hanging,jersy\n"
TWO = "name,scene\none,hanging\ntwo,hanging\n"


def prepare(folder: Path) -> None:
    """The pattern maker's ``shirt.obj`` and ``scan.obj`` with holes, in centimetres with z up; and job files."""
    for name in ("shirt.obj", "scan.obj"):
        write_stand_in(folder / name)
        lines = (folder / name).read_text(encoding="utf-8").splitlines()
        points = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], dtype=float)
        holes = points[:: len(points) // HOLES] if name == "scan.obj" else np.zeros((0, 3))
        written, vertex = [], 0
        for line in lines:
            if line.startswith("v "):
                x, y, z = CENTIMETRES * points[vertex]
                line, vertex = f"v {x:.4f} {-z:.4f} {y:.4f}", vertex + 1
            elif line.startswith("f "):
                corners = [int(corner.partition("/")[0]) - 1 for corner in line.split()[1:]]
                if (np.linalg.norm(holes - points[corners].mean(axis=0), axis=1) < HOLE).any():
                    continue
            if not line.startswith("vn "):
                written.append(re.sub(r"//\d+|(/\d+)/\d+", r"\1", line) if line.startswith("f ") else line)
        (folder / name).write_text("\n".join(written), encoding="utf-8")
    (folder / "jobs.csv").write_text(JOBS, encoding="utf-8")
    (folder / "two.csv").write_text(TWO, encoding="utf-8")


def run(line: Line, folder: Path) -> tuple[float, str, int]:
    """Seconds, all that a terminal of 80 columns shows, and the exit status; a server's are until its address."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "COLUMNS": str(COLUMNS), "TERM": "xterm"}
    ours, theirs = pty.openpty()
    began, text, asked = time.perf_counter(), "", False
    command = line.run.replace("{folder}", shlex.quote(str(folder)))
    process = subprocess.Popen(
        command, shell=True, cwd=folder, env=environment, stdin=theirs, stdout=theirs, stderr=theirs,
        start_new_session=True,
    )  # fmt: skip
    os.close(theirs)
    seconds = 0.0
    while True:
        try:
            data = os.read(ours, 65536)
        except OSError:  # the other end is closed
            break
        if not data:
            break
        text += data.decode(errors="replace")
        if line.typed.split()[1] in SERVERS and line.says in text and not asked:
            seconds, asked = time.perf_counter() - began, True
            os.killpg(process.pid, signal.SIGINT)
    os.close(ours)
    status = process.wait(WAIT)
    return seconds or time.perf_counter() - began, text, 0 if asked and status in ENDED else status


def widest(text: str) -> int:
    """The longest line of a bar [columns], as a terminal shows it."""
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)
    bars = [part for part in re.split(r"[\r\n]", plain) if re.match(r"\s*\d/5 ", part)]
    return max(map(len, bars), default=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="numbers of headings, separated by commas")
    parser.add_argument("--keep", type=Path, help="folder for what is written, to look at it")
    parser.add_argument("--write", action="store_true", help=f"put the table into {TABLE.name}")
    options = parser.parse_args()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell starts what runs in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)
    wanted = {int(number) for number in options.only.split(",") if number} or set(HEADINGS)
    rows, failed, load = [], [], os.getloadavg()[0]
    kernels = "kernels compiled before" if kernels_known("cpu") else "the first command compiles the kernels"
    with tempfile.TemporaryDirectory() as scratch:
        folder = (options.keep or Path(scratch)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        prepare(folder)
        for line in (line for line in LINES if line.heading in wanted):
            seconds, text, status = run(line, folder)
            print(f"{line.heading:2}  {seconds:6.1f} s  $ {line.typed}", flush=True)
            said = " ".join(text.split())  # lines are folded
            is_whole = status in line.status and " ".join(line.says.split()) in said and "Traceback" not in said
            if not is_whole or not (folder / line.writes).exists() or widest(text) > COLUMNS:
                failed.append(line.typed)
                print(text)
            rows.append(f"| {line.heading} | `{line.typed}` | {line.seen} | {seconds:.1f} |")
    if options.write:
        write_table(rows, load, kernels)
    sys.exit(f"not as it should: {failed}" if failed else 0)


def write_table(rows: list[str], load: float, kernels: str) -> None:
    """Writes newcomer.md.

    ``load``: processes that ran or waited for a core, on average, when the first command was typed; ``kernels``: which
    were compiled by then.
    """
    titles = [f"{number}. {title}" for number, title in HEADINGS.items()]
    head = [
        "# A newcomer's second hour, by its ten headings",
        "",
        f"`python tests/benchmarks/newcomer_headings.py --write`: {hardware('cpu', 0)}, commit {commit()},",
        f"{date.today()}; {kernels}. Processes that competed for the cores when it began: {load:.0f}.",
        "Seconds are a wait, a server's until it tells its address.",
        "Pictures of headings 1 to 5, 7 and 9 were looked at; what a command must print and write the script checks.",
        "",
        *titles,
        "",
        "| heading | typed | seen | seconds |",
        "| --- | --- | --- | --- |",
    ]
    TABLE.write_text("\n".join([*head, *rows, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
