"""What a newcomer sees first: the package's public names, and the commands by purpose."""

from __future__ import annotations

import pydoc
from importlib.metadata import version

from typer.testing import CliRunner

import warp_cloth
from warp_cloth.cli.main import app


def test_public_names_are_listed_before_they_are_imported() -> None:
    assert set(warp_cloth.__all__) <= set(dir(warp_cloth))
    for name in warp_cloth.__all__:
        assert getattr(warp_cloth, name).__name__ == name
    assert warp_cloth.__version__ == version("warp-cloth")


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
