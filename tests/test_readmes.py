"""Every command, scene and link of the project's pages: they run as written, and lead somewhere."""

from __future__ import annotations

import importlib.util
import os
import re
import signal
import subprocess
import sys
import time
from copy import deepcopy
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import typer
import warp as wp
from pages import MARKS, PAGES, ROOT, Block, anchors, blocks, commands, inline_code, links, write_stand_in

from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import read_toml
from warp_cloth.batch.jobs import read_jobs
from warp_cloth.cli.main import app
from warp_cloth.material.fabric import resolve_fabric
from warp_cloth.scene import load_scene
from warp_cloth.scene.load import shipped_scenes

README_LIMIT = 9_000  # bytes: what a visitor reads in five minutes
TIME_LIMIT = 900.0  # [s] of one block: what takes longer hangs
REMOVED = ("methods", "extremes")  # commands that are scripts of tests/benchmarks/ now
SHOWN = 2_000  # letters of a failed block's output

BLOCKS = [block for page in PAGES for block in blocks(page)]
PICTURES = sorted((ROOT / ".github").glob("*.png"))


def by_language(*languages: str) -> list[Any]:
    """Blocks as parameters; those of a page run in one process (conftest), as later ones use what others wrote."""
    found = []
    for block in BLOCKS:
        if block.language in languages:
            marks = [pytest.mark.long] if "long" in block.marks else []
            found.append(pytest.param(block, id=block.place, marks=marks))
    return found


by_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


@pytest.fixture(scope="session")  # of a module xdist may run other modules in between
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Path]:
    """The folder of each page, empty at first, in which its blocks run in order."""
    return {page: tmp_path_factory.mktemp("page") for page in PAGES}


def folder_of(block: Block, folders: dict[Path, Path]) -> Path:
    """Where a block runs, with the files that its page shows and the stand-ins that it names."""
    folder = folders[block.page]
    for other in blocks(block.page):
        if other.language in ("toml", "csv") and ("file" in other.marks or other.line <= block.line):
            (folder / file_name(other)).write_text(other.text, encoding="utf-8")
        for name in other.marks.get("files", ()):
            if other.line <= block.line and not (folder / name).exists():
                write_stand_in(folder / name)
    return ROOT if block.marks.get("in") == ("checkout",) else folder


def file_name(block: Block) -> str:
    return (block.marks.get("file") or ("scene.toml",))[0]


def environment() -> dict[str, str]:
    """This interpreter's commands come first, as in its activated environment."""
    return {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def run(words: list[str], folder: Path, status: int = 0) -> None:
    done = subprocess.run(
        words,
        cwd=folder,
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=TIME_LIMIT,
        check=False,
    )
    assert done.returncode == status, f"exit status {done.returncode}: {done.stdout[-SHOWN:]}"


def serve(text: str, folder: Path) -> None:
    """Runs a block that serves a page until it tells its address, then interrupts it."""
    log = folder / "served.txt"
    with log.open("w", encoding="utf-8") as out:
        process = subprocess.Popen(
            ["bash", "-euo", "pipefail", "-c", text],
            cwd=folder,
            env={**environment(), "PYTHONUNBUFFERED": "1"},
            stdout=out,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        end = time.monotonic() + TIME_LIMIT
        while "http://" not in log.read_text(encoding="utf-8"):
            assert process.poll() is None, f"ended: {log.read_text(encoding='utf-8')[-SHOWN:]}"
            assert time.monotonic() < end, "no address"
            time.sleep(0.2)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        process.wait(timeout=60)


def skip_without(needs: tuple[str, ...]) -> None:
    for need in needs:
        if need == "cuda":
            if not wp.get_cuda_device_count():
                pytest.skip("needs a CUDA device")
        elif importlib.util.find_spec(need) is None:
            pytest.skip(f"needs the package {need}")


def without_out(text: str) -> str:
    return re.sub(r" --out \S+", "", text)


@pytest.mark.parametrize("block", by_language("sh"))
def test_every_command_runs_as_written(block: Block, folders: dict[Path, Path]) -> None:
    for words in commands(block.text):
        check_form(words, values="form" in block.marks)
    if "form" in block.marks:
        return
    if "as" in block.marks:
        (page,) = block.marks["as"]
        run_there = [other.text for other in blocks(ROOT / page) if not {"as", "form"} & set(other.marks)]
        done = list(commands("\n".join(without_out(text) for text in run_there)))
        assert [words for words in commands(without_out(block.text)) if words not in done] == []
        return
    skip_without(block.marks.get("needs", ()))
    folder = folder_of(block, folders)
    if "serves" in block.marks:
        serve(block.text, folder)
    else:
        run(["bash", "-euo", "pipefail", "-c", block.text], folder, int(block.marks.get("ends", ("0",))[0]))


@pytest.mark.parametrize("block", by_language("python"))
def test_every_piece_of_python_runs_as_written(block: Block, folders: dict[Path, Path]) -> None:
    skip_without(block.marks.get("needs", ()))
    folder = folder_of(block, folders)
    script = folder / f"line_{block.line}.py"
    script.write_text(block.text, encoding="utf-8")
    run([sys.executable, str(script)], folder)


@pytest.mark.parametrize("block", by_language("toml"))
def test_every_scene_fabric_and_job_file_is_valid(block: Block, folders: dict[Path, Path]) -> None:
    folder = folder_of(block, folders)
    path = folder / file_name(block)
    values = read_toml(path, block.place)
    if "fragment" in block.marks:
        return
    if "product" in values or "job" in values:
        assert [item.name for item in read_jobs(path) if item.problem] == []
    elif not {"garment", "avatar", "collision", "solver"} & set(values):
        resolve_fabric(path.name, folder)
    else:
        load_scene(_completed(values, folder))


def _completed(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    """A scene that a page shows a part of, with a garment; its files are in a folder."""
    values = deepcopy(values)
    garments = values.setdefault("garment", {})
    for garment in garments if isinstance(garments, list) else [garments]:
        if not {"mesh", "pattern", "shape"} & set(garment):
            garment["shape"] = {"kind": "tshirt"}
    for wearable in (*(garments if isinstance(garments, list) else [garments]), values.get("avatar", {})):
        if "mesh" in wearable:
            wearable["mesh"] = str(folder / wearable["mesh"])
        if isinstance(wearable.get("poses"), list):
            wearable["poses"] = [str(folder / pose) for pose in wearable["poses"]]
    avatar = values.get("avatar", {"mesh": ""})
    if not {"mesh", "shape"} & set(avatar):
        avatar["shape"] = {"kind": "mannequin"}
    return values


@by_page
def test_every_command_that_a_page_names_exists(page: Path) -> None:
    for code in inline_code(page):
        if code.startswith(("warp-cloth ", "python ", "pip ")):
            for words in commands(code):
                check_form(words, values=True)


def check_form(words: list[str], *, values: bool) -> None:
    """A command of ours exists and takes these options, as do scripts; an extra that is installed is there.

    ``values``: whether what is set is checked, too, which a command that is run does itself.
    """
    program, *arguments = words
    if program == "warp-cloth":
        _check_command(arguments, values)
    elif program in ("python", "python3") and arguments[0].endswith(".py"):
        script = ROOT / arguments[0]
        source = script.read_text(encoding="utf-8")
        for shared in re.findall(r"^from (?:\w+\.)?(\w+) import", source, re.MULTILINE):  # options of several scripts
            modules = (folder / f"{shared}.py" for folder in script.parents[:2])
            source += "".join(module.read_text(encoding="utf-8") for module in modules if module.exists())
        for option in arguments[1:]:
            name = option.partition("=")[0]
            assert not option.startswith("--") or f'"{name}"' in source, f"{arguments[0]} has no option {name}"
    elif program in ("pip", "pip3"):
        projects = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
        for extra in re.findall(r"\[([a-z,]+)\]", " ".join(arguments)):
            assert all(re.search(rf"^{name} = \[", projects, re.MULTILINE) for name in extra.split(","))


def _check_command(arguments: list[str], values: bool) -> None:
    group: Any = typer.main.get_command(app)
    if arguments and not arguments[0].startswith("-"):
        assert arguments[0] in group.commands, f"no command {arguments[0]}"
    if len(arguments) < 2 or "..." in arguments or "SCENE" in arguments:
        return
    name, *rest = arguments
    try:
        group.commands[name].make_context(name, list(rest))
    except Exception as error:  # typer's versions keep these classes at different places
        if not hasattr(error, "format_message"):
            raise
        pytest.fail(f"warp-cloth {' '.join(arguments)}: {error.format_message()}")
    changes = [value for option, value in pairwise(rest) if option == "--set"]
    if values and rest[0] in shipped_scenes() and "{size}" not in " ".join(changes):
        try:
            load_scene(rest[0], changes)
        except InputError as error:
            pytest.fail(f"warp-cloth {' '.join(arguments)}: {error}")


@by_page
def test_every_link_leads_to_a_file_or_heading_of_the_project(page: Path) -> None:
    for target in links(page):
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        assert path.exists(), target
        assert path.is_relative_to(ROOT), target
        if anchor:
            assert anchor in anchors(path), f"{target}: has {sorted(anchors(path))}"


@by_page
def test_comments_on_tests_are_understood_and_stand_right_above_a_block(page: Path) -> None:
    content = page.read_text(encoding="utf-8")
    marked = [block for block in blocks(page) if block.marks]
    assert content.count("<!-- test:") == len(marked)
    assert set().union(*(block.marks for block in marked)) <= MARKS


@by_page
def test_no_page_names_a_command_that_is_gone(page: Path) -> None:
    for name in REMOVED:
        assert f"warp-cloth {name}" not in page.read_text(encoding="utf-8")


def test_readme_is_short_enough_to_be_read() -> None:
    assert len((ROOT / "README.md").read_bytes()) <= README_LIMIT


def test_every_picture_is_shown_on_a_page() -> None:
    shown = {(page.parent / target).resolve() for page in PAGES for target in links(page)}
    assert [picture.name for picture in PICTURES if picture not in shown] == []


def test_every_page_is_reached_from_the_readme() -> None:
    reached, rest = set(), [ROOT / "README.md"]
    while rest:
        page = rest.pop()
        if page not in reached:
            reached.add(page)
            targets = [(page.parent / target.partition("#")[0]).resolve() for target in links(page)]
            rest += [target for target in targets if target.suffix == ".md"]
    assert [str(page.relative_to(ROOT)) for page in PAGES if page not in reached] == []


def test_ci_runs_both_commands_of_the_readme() -> None:
    """Each is the only line of README that ends as the script looks for it."""
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    readme = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    for end in ("fit tshirt --out out", "pytest -n 3"):
        assert f"'{end}$'" in script
        (line,) = (line for line in readme if line.endswith(end))
        assert line.startswith("python3 -m venv .venv && .venv/bin/pip install ")
