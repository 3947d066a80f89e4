"""Bad meshes, files and options through the command line: exit status 2, one line, nothing written."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from meshfiles import WRITERS, ball, sheet, write_obj
from typer.testing import CliRunner, Result

from warp_cloth.cli.main import app
from warp_cloth.export import save

STAGES = ("loading", "building", "compiling", "relaxing", "writing")


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own with a sound garment and a sound avatar; no pictures, which take most of the time."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(save, "write_preview", lambda path, _: path.touch())
    write_obj(tmp_path / "sheet.obj", *sheet())
    write_obj(tmp_path / "ball.obj", *ball())
    return tmp_path


def fit(*options: str) -> Result:
    arguments = ["fit", *options, "--device", "cpu", "--out", "new/out", "--set", "solver.iterations=20"]
    return CliRunner().invoke(app, arguments)


def refused(*options: str) -> str:
    """The one line of a refusal that leaves everything as it was."""
    before = {path: path.read_bytes() if path.is_file() else b"" for path in Path().rglob("*")}
    result = fit(*options)
    told = [line for line in result.stderr.splitlines() if line not in STAGES]
    assert result.exit_code == 2, (result.output, result.exception)
    assert len(told) == 1, told
    assert told[0].startswith("error: ")
    assert result.stdout == ""
    assert {path: path.read_bytes() if path.is_file() else b"" for path in Path().rglob("*")} == before
    return told[0]


def scene_of(garment: str = "sheet.obj", avatar: str = "ball.obj", *lines: str) -> str:
    """Writes a scene file; ``lines`` belong to its garment."""
    below = "".join(f"{line}\n" for line in lines)
    text = f"[garment]\nmesh = '{garment}'\n{below}[avatar]\nmesh = '{avatar}'\n"
    Path("scene.toml").write_text(text, encoding="utf-8")
    return "scene.toml"


def with_value(points: np.ndarray, value: float) -> np.ndarray:
    changed = points.copy()
    changed[3, 1] = value
    return changed


def with_corner(faces: np.ndarray, corner: int) -> np.ndarray:
    changed = faces.copy()
    changed[2, 1] = corner
    return changed


Change = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
DEFECTS: dict[str, tuple[Change, str]] = {
    "nan": (lambda p, f: (with_value(p, np.nan), f), "is not finite"),
    "infinite": (lambda p, f: (with_value(p, -np.inf), f), "is not finite"),
    "index too high": (lambda p, f: (p, with_corner(f, len(p) + 5)), "vert"),
    "index below zero": (lambda p, f: (p, with_corner(f, -1)), "vert"),
    "no faces": (lambda p, f: (p, f[:0]), "faces"),
    "far too large": (lambda p, f: (1e6 * p, f), 'units = "m"'),
    "far too small": (lambda p, f: (1e-6 * p, f), 'units = "m"'),
    "all at one point": (lambda p, f: (0.0 * p, f), "point"),
    "all on one line": (lambda p, f: (p * [1.0, 0.0, 0.0], f), "faces can be used"),
}
NOT_OF_STL = ("index too high", "index below zero")  # STL has no indices


def in_both_roles(cases: Iterable[str]) -> list[tuple[str, str, str]]:
    """Each case as garment and as avatar in every format; in USD, which is read in a process of its own, in turn."""
    roles = ("garment", "avatar")
    return [
        (case, role, kind)
        for turn, case in enumerate(cases)
        for kind in WRITERS
        for role in (roles if not kind.startswith("usd") else (roles[(turn + kind.count("c")) % 2],))
    ]


@pytest.mark.parametrize(("defect", "role", "kind"), in_both_roles(DEFECTS))
def test_a_broken_mesh_is_refused_in_every_format(defect: str, role: str, kind: str) -> None:
    if kind == "stl" and defect in NOT_OF_STL:
        return
    change, words = DEFECTS[defect]
    points, faces = sheet() if role == "garment" else ball()
    WRITERS[kind](Path(f"bad.{kind}"), *change(points, faces))
    line = refused(scene_of(**{role: f"bad.{kind}"}))
    assert f"bad.{kind}" in line
    assert words in line
    if "units" in words:
        assert f"{role}.units" in line


@pytest.mark.parametrize("kind", WRITERS)
def test_an_edge_with_three_faces_is_refused_in_every_format(kind: str) -> None:
    points, faces = sheet()
    points = np.concatenate([points, [[-0.2, 1.1, 0.4]]])
    WRITERS[kind](Path(f"fin.{kind}"), points, np.concatenate([faces, [[0, 6, 25]]]))
    assert "has 3 faces" in refused(scene_of(f"fin.{kind}"))


DAMAGES = ("missing", "empty", "half", "cut end", "noise", "prose", "folder", "dead link")


@pytest.mark.parametrize(("damage", "role", "kind"), in_both_roles(DAMAGES))
def test_a_damaged_file_is_refused_in_every_format(damage: str, role: str, kind: str) -> None:
    path = Path(f"bad.{kind}")
    whole = Path(f"whole.{kind}")
    WRITERS[kind](whole, *sheet())
    data = whole.read_bytes()
    contents = {
        "empty": b"",
        "half": data[: len(data) // 2],
        "cut end": data[:-4],
        "noise": np.random.default_rng(1).bytes(2000),
        "prose": b"Dear Sir,\nplease find enclosed the garment.\n",
    }
    if damage in contents:
        path.write_bytes(contents[damage])
    elif damage == "folder":
        path.mkdir()
    elif damage == "dead link":
        path.symlink_to("gone")
    assert str(path) in refused(scene_of(**{role: str(path)}))


UV = np.asarray(sheet()[0][:, :2])
UV_REFUSED: dict[str, tuple[np.ndarray | None, str]] = {
    "none": (None, "needs texture coordinates"),
    "all at one point": (0.0 * UV, "no area"),
    "on one line": (UV * [1.0, 0.0], "no area"),
    "half left out": (np.where(UV[:, 1:] > 1.25, UV, 0.0), "of 32 triangles have no area"),
    "nan": (np.where(np.arange(25)[:, None] == 3, np.nan, UV), "needs texture coordinates"),
    "beyond all numbers": (1e200 * UV, "needs texture coordinates"),
    "in cm": (100.0 * UV, 'set garment.uv_units = "cm"'),
    "in mm": (1000.0 * UV, 'set garment.uv_units = "mm"'),
    "in inches": (UV / 0.0254, 'set garment.uv_units = "in"'),
    "in a unit of its own": (7.0 * UV, "near 0.143"),
}


@pytest.mark.parametrize("case", UV_REFUSED)
def test_panels_that_cannot_be_the_rest_shape_are_refused(case: str) -> None:
    texcoords, words = UV_REFUSED[case]
    write_obj(Path("panels.obj"), *sheet(), texcoords)
    line = refused(scene_of("panels.obj", "ball.obj", 'rest = "uv"\nuv_units = "m"'))
    assert line.startswith("error: panels.obj: ")
    assert words in line
    assert "garment." in line


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ((".",), "is a folder"),
        (("sheet.obj",), "sheet.obj"),
        (("hanging", "--device", "cuda:99"), 'no device "cuda:99"'),
        (("hanging", "--device", "gpu"), 'no device "gpu"'),
        (("hanging", "--device", ""), 'no device ""'),
        (("hanging", "--frames", "-1"), "frames: must be an integer from 0 to 10000, not -1"),
        (("hanging", "--frames", "1000000"), "frames: must be an integer from 0 to 10000, not 1000000"),
        (("hanging", "--out", "sheet.obj"), "sheet.obj: is a file, not a folder"),
        (("hanging", "--out", "sheet.obj/out"), "cannot be written"),
        (("hanging", "--out", "/proc/out"), "cannot be written"),
        (("hanging", "--out", "x" * 300), "cannot be written"),
    ],
)
def test_nonsense_on_the_command_line_is_refused(options: tuple[str, ...], words: str) -> None:
    if "--device" in options or "--out" in options:  # the last one given counts
        result = CliRunner().invoke(app, ["fit", *options, *(("--device", "cpu") if "--out" in options else ())])
        told = [line for line in result.stderr.splitlines() if line not in STAGES]
        assert (result.exit_code, result.stdout) == (2, "")
        assert len(told) == 1
        assert words in told[0]
        assert not Path("out").exists()
    else:
        assert words in refused(*options)


def test_a_garment_far_from_its_avatar_or_ten_times_its_size_is_refused() -> None:
    points, faces = sheet()
    write_obj(Path("far.obj"), points + np.array([50.0, 0.0, 0.0]), faces)
    assert "away from the avatar" in refused(scene_of("far.obj"))
    write_obj(Path("wide.obj"), points * [10.0, 10.0, 1.0], faces)
    assert "garment.units" in refused(scene_of("wide.obj"))
    assert "does not fit an avatar" in refused(scene_of("sheet.obj", "ball.obj", 'units = "in"'))


def test_a_garment_that_is_pinned_everywhere_or_has_no_possible_path_is_refused() -> None:
    assert "nothing can move" in refused(scene_of("sheet.obj", "ball.obj", "pin = {box = [[-9, -9, -9], [9, 9, 9]]}"))
    assert "cannot be opened" in refused(scene_of(f"{'x' * 5000}.obj"))


def notes_of_fit(scene: str) -> tuple[dict[str, Any], str]:
    result = fit(scene)
    assert result.exit_code in (0, 3), result.output  # written; 20 iterations leave most cloth in motion
    report = json.loads(Path("new/out/report.json").read_text(encoding="utf-8"))
    return report, " ".join(report["garments"][0]["notes"])


def test_what_was_mended_is_told_in_the_report() -> None:
    points, faces = sheet()
    quads = np.stack([faces[::2, 0], faces[::2, 1], faces[::2, 2], faces[1::2, 2]], axis=1)
    write_obj(Path("quads.obj"), np.concatenate([points, [[0.0, 1.2, 0.5]]]), quads)
    report, notes = notes_of_fit(scene_of("quads.obj"))
    assert (report["vertices"], report["faces"]) == (25, 32)
    assert "isolated" in notes
    assert "cut into triangles" in notes


def oddities() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Garments that are strange and sound."""
    points, faces = sheet()
    behind, _ = sheet(toward=0.4)
    thin = points.copy()
    thin[12] = thin[13] + [0.0, 0.0, 1e-5]
    closed, closed_faces = ball(0.3)
    return {
        "one triangle": (points[[0, 1, 6]] * 2.0 - [0.0, 1.0, 0.0], np.array([[0, 1, 2]])),
        "two parts": (np.concatenate([points, behind]), np.concatenate([faces, faces + 25])),
        "thin triangles": (thin, faces),
        "closed": (closed, closed_faces),
        "the avatar itself": ball(),
    }


@pytest.mark.parametrize("case", oddities())
def test_strange_garments_are_fitted(case: str) -> None:
    write_obj(Path("Größe S.obj"), *oddities()[case])
    Path("link to it.obj").symlink_to("Größe S.obj")
    report, _ = notes_of_fit(scene_of("link to it.obj"))
    assert report["status"] == "iteration_limit"
    assert all(value is not None for value in (*report["strain"].values(), *report["residual"].values()))


def command(*arguments: str) -> subprocess.Popen[str]:
    whole = [sys.executable, "-m", "warp_cloth", "fit", *arguments]
    return subprocess.Popen(whole, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize(("sent", "status", "said"), [(signal.SIGINT, 130, ["interrupted"]), (signal.SIGTERM, 143, [])])
def test_an_interrupt_while_it_relaxes_leaves_nothing(place: Path, sent: int, status: int, said: list[str]) -> None:
    scene_of()
    endless = ("--set", "solver.iterations=10000000", "--set", "solver.residual=1e-300")
    running = command("scene.toml", "--device", "cpu", "--out", "new/out", *endless)
    for line in running.stderr:
        if line.startswith("relaxing"):
            break
    running.send_signal(sent)
    out, err = running.communicate(timeout=120)
    assert running.returncode == status
    assert out == ""
    assert err.splitlines()[-1:] == said
    assert not Path("new").exists()
