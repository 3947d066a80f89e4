"""scenes/keys.md lists every scene key as the schema has it. `python tests/test_scene_reference.py` rewrites it."""

from __future__ import annotations

from pathlib import Path

from warp_cloth.scene.reference import key_lines, key_table

FOLDER = Path(__file__).parent.parent / "scenes"
HEAD = """# Scene keys

Written from the schema (`warp_cloth/scene`) by `python tests/test_scene_reference.py`.

"""
LARGEST = 9_000  # [bytes] of a page that is read to its end


def test_the_page_of_keys_is_as_the_schema_has_it() -> None:
    text = (FOLDER / "keys.md").read_text(encoding="utf-8")
    assert text == HEAD + key_table() + "\n", f"run python tests/{Path(__file__).name}"


def test_a_terminal_shows_the_keys_that_a_word_is_in() -> None:
    assert key_lines("solver.tolerance_mm")[0].startswith("solver.tolerance_mm = ")
    assert len(key_lines()) == 2 * (len(key_table().splitlines()) - 2)
    assert key_lines("no such key") == []


def test_the_pages_are_short() -> None:
    assert all(len(page.read_bytes()) <= LARGEST for page in FOLDER.glob("*.md"))


if __name__ == "__main__":
    (FOLDER / "keys.md").write_text(HEAD + key_table() + "\n", encoding="utf-8")
