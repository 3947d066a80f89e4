"""What a newcomer sees first: the package's public names, and the commands by purpose."""

from __future__ import annotations

import pydoc
import subprocess
import sys
from functools import partial
from importlib.metadata import PackageNotFoundError, version

import pytest
from typer.testing import CliRunner

import warp_cloth
from warp_cloth.cli.main import app


def test_public_names_are_listed_before_they_are_imported() -> None:
    assert set(warp_cloth.__all__) <= set(dir(warp_cloth))
    for name in warp_cloth.__all__:
        assert getattr(warp_cloth, name).__name__ == name
    assert warp_cloth.__version__ == version("warp-cloth")


def test_a_folder_on_the_path_has_a_version(monkeypatch: pytest.MonkeyPatch) -> None:
    def not_installed(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("warp_cloth.base.version.version", not_installed)
    assert warp_cloth.__version__ == "0+checkout"


def test_a_fit_shows_itself() -> None:
    scene = {"garment.shape.edge_mm": 60, "solver.iterations": 300, "collision.pixel_mm": 10}
    fit = warp_cloth.fit("tshirt", overrides=scene, device="cpu")
    assert repr(fit).startswith("<Fit of 'tshirt': ")
    assert len(repr(fit)) < 120
    page = fit._repr_html_()
    chest = fit.ease["tshirt"]["chest"]
    assert f"ease: chest {100 * chest:+.1f} cm" in page
    assert "data:image/png;base64," in page
    assert list(fit.ease["tshirt"]) == [row["level"] for row in fit.report["girths_mm"]]


def test_warp_is_quiet_unless_python_logs() -> None:
    script = "import logging, sys; logging.basicConfig(level=sys.argv[1]); import warp_cloth; "
    script += "warp_cloth.fit('hanging', overrides={'solver.iterations': 1}, device='cpu')"
    run = partial(subprocess.run, capture_output=True, text=True, check=True)
    quiet, loud = (run([sys.executable, "-c", script, level]) for level in ("WARNING", "INFO"))
    assert (quiet.stdout, quiet.stderr) == ("", "")
    assert "Warp" in loud.stdout


def test_help_of_the_package_describes_its_names() -> None:
    text = pydoc.plain(pydoc.render_doc(warp_cloth))
    for name in ("fit", "load_scene", "Fit", "InputError"):
        assert f"\n    {name} " in text


def test_help_lists_commands_by_purpose_with_the_main_one_first() -> None:
    lines = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "120"}).stdout.splitlines()
    words = [line.strip(" │╭─╮╰╯").split() for line in lines]
    first = [line[0] for line in words if line]
    places = [first.index(word) for word in ("Fit", "fit", "Explore", "scenes", "Study", "plan")]
    assert places == sorted(places)
