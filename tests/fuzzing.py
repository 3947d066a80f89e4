"""What the fuzzers share: files damaged in every way that hypothesis thinks of, and the promise on what they meet."""

from __future__ import annotations

import struct
from collections.abc import Callable
from copy import deepcopy
from typing import Any, TypeVar

from hypothesis import strategies as st

from warp_cloth.base.errors import InputError

LONGEST_LINE = 1000  # letters; a message quotes at most a path, a value and some names
T = TypeVar("T")

# Numbers that programs trip over, as text files write them.
NUMBERS = (
    "nan", "inf", "-inf", "1e400", "-1e308", "1e-320", "0", "-0.0", "-1", "1", "2147483647", "2147483648",
    "-2147483649", "18446744073709551616", "9" * 400, "1_000", "0x1f", "1,5", "1e", ".", "true", "None", "",
)  # fmt: skip
WORDS = tuple(
    struct.pack(layout, value)
    for layout, values in {
        "<f": (float("nan"), float("inf"), -float("inf"), 3.4e38, 1e-42, -0.0, 1e20),
        "<d": (float("nan"), float("inf"), 1.7e308, -1e200, 5e-324),
        "<i": (-1, -(2**31), 2**31 - 1, 0, 1, 255, 65536),
        "<q": (-1, -(2**63), 2**63 - 1, 2**40),
    }.items()
    for value in values
)
NUMBER_LETTERS = frozenset(b"0123456789.+-eE")


def kept(promise: Callable[[], T]) -> T | None:
    """The result of a call that may refuse its input with one line, None if it does."""
    try:
        return promise()
    except InputError as error:
        line = str(error)
        assert line.strip()
        assert len(line.splitlines()) == 1
        assert len(line) <= LONGEST_LINE
        return None


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """The content after a few edits: numbers swapped, bytes changed, pieces cut, doubled or moved, the end lost."""
    for _ in range(draw(st.integers(1, 4))):
        if not content:
            return content
        place = draw(st.integers(0, len(content) - 1))
        kind = draw(st.sampled_from(("number", "word", "byte", "cut", "double", "move", "end", "insert")))
        reach = min(len(content), place + draw(st.integers(1, 40)))
        if kind == "number":
            content = _with_number(content, place, draw(st.sampled_from(NUMBERS)).encode())
        elif kind == "word":
            word = draw(st.sampled_from(WORDS))
            place -= draw(st.sampled_from((0, place % 4)))
            content = content[:place] + word + content[place + len(word) :]
        elif kind == "byte":
            content = content[:place] + bytes([draw(st.integers(0, 255))]) + content[place + 1 :]
        elif kind == "cut":
            content = content[:place] + content[reach:]
        elif kind == "double":
            content = content[:reach] + content[place:reach] * draw(st.integers(1, 3)) + content[reach:]
        elif kind == "move":
            there = draw(st.integers(0, len(content) - 1))
            content = content[:there] + content[place:reach] + content[there:]
        elif kind == "end":
            content = content[:place]
        else:
            content = content[:place] + draw(st.binary(max_size=12)) + content[place:]
    return content


ODD_VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(2**70), 2**70),
    st.sampled_from((0, 1, -1, 3, 4, 5, 6, 5126, 5125, 2**31, 2**32, 2**63)),
    st.floats(),
    st.text(max_size=5),
    st.just([]),
    st.just({}),
    st.lists(st.integers(-2, 5) | st.floats(), max_size=3),
)


@st.composite
def altered(draw: st.DrawFn, tree: Any) -> Any:
    """A tree of tables and lists with a few of its entries replaced, taken out, or with keys of their own."""
    tree = deepcopy(tree)
    for _ in range(draw(st.integers(1, 3))):
        table = tree
        while True:
            keys = list(table) if isinstance(table, dict) else list(range(len(table)))
            if not keys:
                break
            key = draw(st.sampled_from(keys))
            if isinstance(table[key], dict | list) and draw(st.integers(0, 9)):
                table = table[key]
                continue
            number = isinstance(table[key], int | float) and not isinstance(table[key], bool)
            if number and draw(st.booleans()):  # often enough still allowed
                table[key] = table[key] * draw(st.sampled_from((0, -1, 0.5, 2, 3, 1e-3, 1e3, 1e-6, 1e6)))
            elif draw(st.integers(0, 4)):
                table[key] = draw(ODD_VALUES)
            else:
                del table[key]
            break
    return tree


def _with_number(content: bytes, place: int, number: bytes) -> bytes:
    """The content with the number at or after a place replaced."""
    start = next((i for i in range(place, len(content)) if content[i] in NUMBER_LETTERS), place)
    while start and content[start - 1] in NUMBER_LETTERS:
        start -= 1
    end = start
    while end < len(content) and content[end] in NUMBER_LETTERS:
        end += 1
    return content[:start] + number + content[end:]
