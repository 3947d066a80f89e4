"""Hashing Warp's kernels once a process, not once for each module that calls them."""

from __future__ import annotations

from typing import Any, ClassVar
from weakref import WeakKeyDictionary

KERNELS = "warp_cloth.kernels."  # of whose functions alone hashes are kept: what these refer to never changes
WRITTEN_FOR = {"hash_adjoint", "hash_function", "get_hash"}  # methods of Warp's hasher that this counts on


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
