"""Bad input is refused in one line: how tests catch that, and write what is to be refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from warp_cloth.base.errors import InputError


def refusal(work: Callable[..., Any], *arguments: Any, **options: Any) -> InputError:
    """The error that a call ends with, which is one line."""
    with pytest.raises(InputError) as caught:
        work(*arguments, **options)
    assert "\n" not in str(caught.value)
    return caught.value


def write(folder: Path, text: str | bytes, name: str = "scene.toml") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path
