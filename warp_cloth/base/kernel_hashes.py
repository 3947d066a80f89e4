"""Hashing Warp's kernels once a process, not once for each module that calls them, and in less time."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from types import ModuleType
from typing import Any, ClassVar
from weakref import WeakKeyDictionary

KERNELS = "warp_cloth.kernels."  # of whose functions alone hashes are kept: what these refer to never changes
WRITTEN_FOR = {"hash_adjoint", "hash_function", "get_hash"}  # methods of Warp's hasher that this counts on
SEARCH = "iter_call_callable_arg_targets"  # Warp's search of a call's arguments for functions,
SEARCHED = ("adj", "func", "call_node", "callable_arg_values")  # and its arguments that this counts on


class _Visited(set[Any]):
    """The functions that are being hashed; ``met`` tells whether one was met again, as it calls itself."""

    met = False

    def __contains__(self, function: object) -> bool:
        found = super().__contains__(function)
        self.met = self.met or found
        return found


def share_hashes() -> None:
    """Lets Warp's modules share the hashes of the functions that their kernels call; these stay what they were.

    Warp goes through the source of a function again for each module that calls it: 3,500 times for a T-shirt's kernels,
    which have 700 functions. Where this Warp has another hasher than this was written for, nothing is done.
    """
    from warp._src import context

    hasher = getattr(context, "ModuleHasher", None)
    if isinstance(hasher, type) and not hasattr(hasher, "shared") and set(vars(hasher)) >= WRITTEN_FOR:
        context.ModuleHasher = _sharing(hasher)
    _search_less()


def _search_less() -> None:
    """Lets Warp search the arguments of a call for functions only where the function that is called takes some.

    It would bind the arguments to every overload first, for each of 2,900 calls: a third of the time that hashing and
    registering a T-shirt's kernels take. Where this Warp has another search, nothing is done.
    """
    from warp._src import codegen, types

    own = getattr(codegen, SEARCH, None)
    names = getattr(getattr(own, "__code__", None), "co_varnames", ())
    is_known = names[: len(SEARCHED)] == SEARCHED and hasattr(types, "is_warp_function_annotation")
    if is_known and not hasattr(own, "__wrapped__"):  # which one of ours has
        setattr(codegen, SEARCH, _searching_less(own, types))


def _searching_less(own: Any, types: ModuleType) -> Any:
    """Warp's search, which is passed over for functions of this package that take no functions."""
    known: WeakKeyDictionary[Any, tuple[int, bool]] = WeakKeyDictionary()  # how many overloads; whether one takes some

    def takes_functions(func: Any) -> bool:
        overloads = [func, *func.user_overloads.values(), *func.user_templates.values()]
        count, takes = known.get(func, (0, True))
        if count != len(overloads):
            parameters = [kind for each in overloads for kind in each.input_types.values()]
            takes = any(map(types.is_warp_function_annotation, parameters))
            known[func] = len(overloads), takes
        return takes

    @functools.wraps(own)
    def search(adj: Any, func: Any, call_node: Any, callable_arg_values: Any = None) -> Iterator[Any]:
        is_ours = str(getattr(getattr(func, "func", None), "__module__", "")).startswith(KERNELS)
        if is_ours and not takes_functions(func):
            return iter(())
        found: Iterator[Any] = own(adj, func, call_node, callable_arg_values)
        return found

    return search


def _sharing(base: Any) -> type:
    """Warp's hasher of a module, which looks first whether another module's has met the same function."""

    class Hasher(base):
        shared: ClassVar[WeakKeyDictionary[Any, bytes]] = WeakKeyDictionary()

        @property
        def functions_in_progress(self) -> set[Any]:
            return self._visited

        @functions_in_progress.setter
        def functions_in_progress(self, functions: set[Any]) -> None:
            self._visited = _Visited(functions)

        def hash_adjoint(self, adj: Any) -> bytes:
            known: bytes | None = self.shared.get(adj)
            if known is not None:
                return known
            found: bytes = super().hash_adjoint(adj)
            settled = not (adj.has_unresolved_static_expressions or adj.deferred_static_expressions)
            if settled and not self._visited.met and str(adj.func.__module__).startswith(KERNELS):
                self.shared[adj] = found
            return found

    return Hasher
