"""Which kernels an action launches, over which arrays: seen from outside, so that it is what really happens."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from types import SimpleNamespace
from typing import Any

import warp as wp


@dataclass(frozen=True, eq=False)
class Launch:
    """One launch: its kernel, the arguments by name, and how to do it again."""

    kernel: wp.Kernel
    threads: int
    arguments: dict[str, Any]
    command: Any  # Warp's Launch, which repeats it without looking at the arguments again

    def arrays(self) -> dict[str, wp.array]:
        """The arrays that it is given, by name; those in structs as "struct.member"; unused ones left out.

        Of structs that lie in an array, that in which a batch's items keep theirs, the first one's.
        """
        return dict(chain.from_iterable(_arrays(name, value) for name, value in self.arguments.items()))


def _arrays(name: str, value: Any) -> Iterator[tuple[str, wp.array]]:
    if isinstance(value, wp.array):
        if value.size:
            yield name, value
            yield from _within(name, value)
        return
    for member in getattr(getattr(value, "_cls", None), "vars", {}):
        yield from _arrays(f"{name}.{member}", getattr(value, member))


def _within(name: str, structs: wp.array) -> Iterator[tuple[str, wp.array]]:
    """Arrays that the first struct of an array holds."""
    members = getattr(structs.dtype, "vars", {})
    inner = {member: var.type for member, var in members.items() if isinstance(var.type, wp.array)}
    if not inner:
        return
    first = structs[:1].numpy()[0]
    for member, kind in inner.items():
        told = first[member]
        shape = tuple(int(count) for count in told["shape"][: kind.ndim])
        if int(told["data"]) and all(shape):
            yield (
                f"{name}.{member}",
                wp.array(ptr=int(told["data"]), shape=shape, dtype=kind.dtype, device=structs.device),
            )


def launches_of(
    action: Callable[[], Any], seconds: list[float] | None = None, see: Callable[[Launch], None] = lambda _: None
) -> list[Launch]:
    """Does the action, and tells what it launched, in order. One such call at a time in a process.

    ``seconds``: takes how long each launch kept the host; ``see``: told of each launch before the next one.
    """
    found: list[Launch] = []
    with _watched(found, [] if seconds is None else seconds, see):
        action()
    return found


@contextmanager
def _watched(found: list[Launch], seconds: list[float], see: Callable[[Launch], None]) -> Iterator[None]:
    launch = wp.launch

    def watch(
        kernel: wp.Kernel, dim: Any, inputs: Sequence[Any] = (), outputs: Sequence[Any] = (), **more: Any
    ) -> None:
        given = launch(kernel, dim, inputs, outputs, **{**more, "record_cmd": True})
        names = (argument.label for argument in kernel.adj.args)
        values = dict(zip(names, [*inputs, *outputs], strict=False))
        found.append(Launch(kernel, int(given.bounds.size), values, given))
        began = time.perf_counter()
        given.launch()
        seconds.append(time.perf_counter() - began)
        see(found[-1])

    wp.launch = watch
    try:
        yield
    finally:
        wp.launch = launch


def arrays_in(thing: Any, seen: dict[int, Any] | None = None) -> list[wp.array]:
    """Every array that an object of this library holds, in its attributes, in structs and in containers."""
    seen = {} if seen is None else seen
    if id(thing) in seen:
        return []
    seen[id(thing)] = thing  # kept, so that nothing else gets its id
    if isinstance(thing, wp.array):
        return [thing]
    if isinstance(thing, Mapping):
        inner = list(thing.values())
    elif isinstance(thing, (list, tuple)):
        inner = list(thing)
    elif hasattr(thing, "_cls"):  # an instance of a Warp struct
        inner = [getattr(thing, name) for name in thing._cls.vars]
    elif type(thing).__module__.startswith("warp_cloth") or isinstance(thing, (SimpleNamespace, wp.Mesh)):
        inner = list(vars(thing).values())
    else:
        inner = []
    return [array for part in inner for array in arrays_in(part, seen)]


def bytes_of(arrays: Sequence[wp.array]) -> int:
    """Memory that arrays take [bytes], each byte once, however many of them share it."""
    spans = sorted((array.ptr, array.ptr + array.capacity) for array in arrays if array.ptr)
    total, end = 0, 0
    for first, last in spans:
        total += max(last - max(first, end), 0)
        end = max(end, last)
    return total
