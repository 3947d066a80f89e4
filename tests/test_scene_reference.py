"""scenes/README.md lists every scene key as the schema has it. `python tests/test_scene_reference.py` rewrites it."""

from __future__ import annotations

from pathlib import Path

from warp_cloth.scene.reference import key_table

README = Path(__file__).parent.parent / "scenes" / "README.md"
HEADING = "## All keys\n\n"
LARGEST = 9_000  # [bytes] of a README that is read to its end


def test_the_readme_lists_every_key_as_the_schema_has_it() -> None:
    text = README.read_text(encoding="utf-8")
    assert text.partition(HEADING)[2] == key_table() + "\n", f"run python tests/{Path(__file__).name}"


def test_the_readme_is_short() -> None:
    assert len(README.read_bytes()) <= LARGEST


if __name__ == "__main__":
    head = README.read_text(encoding="utf-8").partition(HEADING)[0]
    README.write_text(head + HEADING + key_table() + "\n", encoding="utf-8")
