"""The command line: exit statuses, one-line errors, nothing half-written; the fit itself is a stand-in."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import pytest
from stand_ins import StandIn
from typer.testing import CliRunner, Result

from warp_cloth.base.errors import InputError
from warp_cloth.cli.main import app, main
from warp_cloth.cli.terminal import keep_interrupts


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> StandIn:
    stand_in = StandIn()
    module = ModuleType("warp_cloth.fitting.fit")
    module.fit = stand_in.fit  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "warp_cloth.fitting.fit", module)
    monkeypatch.chdir(tmp_path)
    return stand_in


def call(*arguments: str) -> Result:
    return CliRunner().invoke(app, arguments)


def command(*arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "warp_cloth", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_fit_hands_scene_device_and_frames_on_and_tells_what_was_written(stand_in: StandIn) -> None:
    result = call("fit", "sphere", "--device", "cpu", "--frames", "3", "--set", "solver.iterations=7")
    assert result.exit_code == 0, result.output
    (made,) = stand_in.calls
    assert (made["device"], made["frames"], made["scene"].solver.iterations) == ("cpu", 3, 7)
    assert "sphere: worn. All forces balance." in result.output
    assert str(Path("out") / "report.json") in result.output
    assert Path("out/report.json").is_file()


@pytest.mark.parametrize(("worn", "code"), [(True, 0), (False, 3)])
def test_the_exit_status_tells_whether_the_garments_are_worn(stand_in: StandIn, worn: bool, code: int) -> None:
    stand_in.worn = worn
    assert call("fit", "sphere").exit_code == code
    assert Path("out/report.json").is_file()


@pytest.mark.parametrize("command", ["fit", "batch"])
def test_help_lists_the_exit_statuses(command: str) -> None:
    text = " ".join(CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200"}).stdout.split())
    assert "Exit status: 0" in text
    assert "2 bad input" in text
    assert "; 3 " in text


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("fit", "tshrt"), 'error: "tshrt": no such scene file; did you mean "tshirt"?'),
        (
            ("fit", "sphere", "--set", "garment.fabric=dennim"),
            'unknown fabric "dennim"; did you mean "denim"?',
        ),
        (("fit", "sphere", "--set", "nonsense"), "error: --set nonsense: has no value"),
        (("fit", "sphere", "--set", "a=\x1b[31m"), "error: --set a=?[31m: unknown key a"),
        (("fit", "sphere", "--out", "taken"), "error: taken: is a file, not a folder"),
        (("fit", "sphere", "--set", 'garment={mesh="g.obj"}', "--out", "circle"), "error: circle: cannot be written"),
    ],
)
def test_bad_input_is_one_line_exit_2_and_no_fit(stand_in: StandIn, arguments: tuple[str, ...], line: str) -> None:
    Path("taken").touch()
    Path("circle").symlink_to("circle")
    result = call(*arguments)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert line in result.stderr
    assert result.stdout == ""
    assert not stand_in.calls
    assert sorted(path.name for path in Path().iterdir()) == ["circle", "taken"]


def test_bad_input_found_by_the_fit_leaves_no_folder_behind(stand_in: StandIn) -> None:
    stand_in.error = InputError("[markup] --device", "there is no cuda:7", "use cpu")
    result = call("fit", "sphere", "--out", "new/deep", "--device", "cuda:7")
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == "error: [markup] --device: there is no cuda:7; use cpu"
    assert not list(Path().iterdir())


def test_bad_input_leaves_an_older_result_as_it_was(stand_in: StandIn) -> None:
    Path("out").mkdir()
    Path("out/report.json").write_text("older")
    stand_in.error = InputError("x.obj", "is empty")
    assert call("fit", "sphere").exit_code == 2
    assert Path("out/report.json").read_text() == "older"


def test_an_interrupt_ends_with_130_and_one_line(stand_in: StandIn) -> None:
    stand_in.error = KeyboardInterrupt()
    result = call("fit", "sphere")
    assert result.exit_code == 130
    assert result.stderr.splitlines()[-1] == "interrupted"
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("fit",), "Missing argument 'scene' (see warp-cloth fit --help)"),
        (("fit", "a", "b"), "unexpected extra argument"),
        (("fit", "sphere", "--frames", "x"), "--frames: "),
        (("fit", "sphere", "--nope"), "--nope"),
        (("fit", "sphere", "--translate", "1"), "a key of the scene? --set garment.translate=... (see"),
        (("no",), "No such command 'no' (see warp-cloth --help)"),
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(
    stand_in: StandIn,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    words: str,
) -> None:
    monkeypatch.setattr(sys, "argv", ["warp-cloth", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("error: ")
    assert words in told.err
    assert told.err.count("\n") == 1
    assert not stand_in.calls


def test_scenes_lists_every_scene_and_fabric_on_one_line_each() -> None:
    lines = call("scenes").stdout.splitlines()
    names = [line.split()[0] for line in lines if line.startswith("  ")]
    assert names[:6] == ["hanging", "shirt", "skirt", "sphere", "trousers", "tshirt"]
    assert {"cotton", "denim", "felt"} < set(names)
    assert len(names) == len(set(names))


def test_the_command_itself_refuses_without_a_traceback(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_bytes(b"\x00\xff")
    before = sorted(tmp_path.iterdir())
    done = command("fit", "scene.toml", folder=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == "error: scene.toml: is not text in UTF-8 (byte 1); save the scene file as UTF-8\n"
    assert sorted(tmp_path.iterdir()) == before


def test_help_and_version_import_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys\nsys.argv = ['warp-cloth', '{}']\nfrom warp_cloth.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code\n"
        "heavy = {{'warp', 'pxr', 'trimesh', 'numpy', 'pydantic'}} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    for option in ("--help", "--version"):
        done = subprocess.run(
            [sys.executable, "-c", code.format(option)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "warp-cloth" in done.stdout


def test_an_interrupt_while_the_command_is_imported_is_one_line(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "class Interrupted:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer':\n"
        "            raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Interrupted())\n"
        "from warp_cloth.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="registers an exit handler of glibc")
def test_a_library_that_aborts_while_the_process_ends_changes_no_status(tmp_path: Path) -> None:
    code = (
        "import ctypes, sys\n"
        "sys.argv = ['warp-cloth', '--version']\n"
        "libc = ctypes.CDLL(None)\n"
        "libc.on_exit(libc.abort, None)\n"
        "from warp_cloth.__main__ import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()[0]) == (0, "warp-cloth")


def test_a_refused_job_file_ends_in_one_line_although_workers_are_starting(tmp_path: Path) -> None:
    (tmp_path / "jobs.csv").write_text("name,scen\na,hanging\n")
    done = command("batch", "jobs.csv", "--device", "cpu", folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines() == [
        'error: jobs.csv: has no column "scene"; '
        "give each row a scene file or a shipped scene there, or a garment.mesh and an avatar.mesh"
    ]
    assert not (tmp_path / "out").exists()


def test_an_interrupt_while_an_object_is_freed_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted:
        def __del__(self) -> None:
            raise KeyboardInterrupt

    def frees() -> None:
        thing = Interrupted()
        del thing
        for _ in range(100):
            time.sleep(0.05)

    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    keep_interrupts()
    with pytest.raises(KeyboardInterrupt):
        frees()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("fit", "shirt.obj"), "shirt.obj: is a mesh, not a scene"),
        (("view", "tshirt", "--port", "70000"), "--port"),
        (("view", "tshirt", "--host", "192.0.2.1"), "192.0.2.1"),
        (("sizes", "tshirt", "--ease", "nan"), "--ease: must be a length in cm"),
    ],
)
def test_what_cannot_be_meant_is_told_in_a_line(arguments: tuple[str, ...], said: str, tmp_path: Path) -> None:
    (tmp_path / "shirt.obj").write_text("v 0 0 0\n")
    done = command(*arguments, folder=tmp_path)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "arguments", [("fit", "hanging"), ("plan", "hanging"), ("batch", "jobs.csv", "--workers", "1")]
)
def test_kernels_that_cannot_be_kept_are_told_in_a_line(
    arguments: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "jobs.csv").write_text("name,scene\nsquare,hanging\n")
    monkeypatch.setenv("WARP_CACHE_PATH", str(tmp_path / "jobs.csv" / "kernels"))
    done = command(*arguments, "--device", "cpu", folder=tmp_path)
    assert done.returncode == (1 if "batch" in arguments else 2)
    told = done.stdout if "batch" in arguments else done.stderr
    assert "compiled kernels cannot be stored there (Not a directory); free some space, or set WARP_CACHE_PATH" in told
    assert "Traceback" not in done.stderr


def test_a_batch_of_bad_items_only_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "jobs.csv").write_text("name,scene\na,nosuch\nb,nosuch\n")
    done = command("batch", "jobs.csv", "--device", "cpu", "--workers", "1", folder=tmp_path)
    assert done.returncode == 2
    assert '"nosuch": no such scene file' in done.stdout


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full here")
def test_an_output_that_takes_nothing_more_is_told_in_a_line() -> None:
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "warp_cloth", "scenes"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: output: No space left on device")


def test_a_name_that_the_locale_cannot_write_is_told_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.toml").write_text('[garment]\nmesh = "Größe.obj"\n', encoding="utf-8")
    for name, value in (("LC_ALL", "C"), ("PYTHONUTF8", "0"), ("PYTHONCOERCECLOCALE", "0")):
        monkeypatch.setenv(name, value)
    done = command("fit", "scene.toml", folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("error: ") == 1
    assert "Traceback" not in done.stderr
