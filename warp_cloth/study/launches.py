"""Records which kernels an action launches, over which arrays, by wrapping wp.launch."""

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
        """Its array arguments by name, members of structs as "struct.member"; empty ones left out.

        Of an array of structs (a batch has one element per item) the members of the first element.
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
    """Arrays in the first element of an array of structs."""
    members = getattr(structs.dtype, "vars", {})
    inner = {member: var.type for member, var in members.items() if isinstance(var.type, wp.array)}
    if not inner:
        return
    first = structs[:1].numpy()[0]
    for member, kind in inner.items():
        descriptor = first[member]
        shape = tuple(int(count) for count in descriptor["shape"][: kind.ndim])
        pointer = int(descriptor["data"])
        if pointer and all(shape):
            yield f"{name}.{member}", wp.array(ptr=pointer, shape=shape, dtype=kind.dtype, device=structs.device)


def launches_of(action: Callable[[], Any], seconds: list[float] | None = None) -> list[Launch]:
    """Runs the action and returns its launches, in order. One such call at a time in a process.

    ``seconds``: receives the time for which each launch kept the host.
    """
    launches: list[Launch] = []
    with _recorded(launches, [] if seconds is None else seconds):
        action()
    return launches


@contextmanager
def _recorded(launches: list[Launch], seconds: list[float]) -> Iterator[None]:
    launch = wp.launch

    def record(
        kernel: wp.Kernel, dim: Any, inputs: Sequence[Any] = (), outputs: Sequence[Any] = (), **more: Any
    ) -> None:
        command = launch(kernel, dim, inputs, outputs, **{**more, "record_cmd": True})
        names = (argument.label for argument in kernel.adj.args)
        values = dict(zip(names, [*inputs, *outputs], strict=False))
        launches.append(Launch(kernel, int(command.bounds.size), values, command))
        began = time.perf_counter()
        command.launch()
        seconds.append(time.perf_counter() - began)

    wp.launch = record
    try:
        yield
    finally:
        wp.launch = launch


def arrays_in(thing: Any, seen: dict[int, Any] | None = None) -> list[wp.array]:
    """Every array that an object of this library holds, in its attributes, in structs and in containers."""
    seen = {} if seen is None else seen
    if id(thing) in seen:
        return []
    seen[id(thing)] = thing  # a reference, so that no other object gets its id
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
    """Memory of arrays [bytes]; memory that several arrays share counts once."""
    spans = sorted((array.ptr, array.ptr + array.capacity) for array in arrays if array.ptr)
    total, end = 0, 0
    for first, last in spans:
        total += max(last - max(first, end), 0)
        end = max(end, last)
    return total
