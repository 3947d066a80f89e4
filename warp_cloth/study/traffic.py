"""Which of its arrays a kernel reads and writes, and within which loops, from the kernel's own source."""

from __future__ import annotations

import ast
import inspect
from dataclasses import dataclass, field
from typing import Any

import warp as wp

ATOMICS = frozenset({"atomic_add", "atomic_sub", "atomic_min", "atomic_max", "atomic_cas", "atomic_exch"})
PACKED = frozenset({"packed_point", "put_packed_point", "packed_six", "put_packed_six"})
LOOKS = frozenset({"look_due"})  # that read some of an array's elements at once
QUEUES = frozenset({"queue_due"})  # that are given those, and say how many of them go on, of each kind
COUNTERS = frozenset({"team_slot", "next_slot"})  # that add to a count, and are told what it was
TURNS = frozenset({"turn_on"})  # that go through tables with a number for each region of vertices
RAISES = frozenset({"raise_to"})  # where each vertex raises its region's number
REGIONS = "region_count"
ANY = -1  # corner
SEVERAL = "*"  # in a chain: several for each that the loop round it goes over

FROM = "from "  # before a count: what is not below it

# What bounds a use, from outside to inside: counts of a patch, "vertex_count" of ``while local < patch.vertex_count``,
# or of ``if`` for a loop's first turn; counters on the device, "contact.count" of ``while pair < contact.count[0]`` or
# of ``if contact.count[0] > 0``; arrays that say who goes on, "contact.due" of ``if contact.due[pair] > gone: return``
# or of ``queue_due(place, look_due(contact.due, ...), ...)``, "contact.lean" where those that do not go on have theirs
# put to nothing;
# members of structs in an array, "cloth.items.leeway" of ``if item.leeway > 0``, where ``item`` is one of them.
Chain = tuple[str, ...]


@dataclass
class Uses:
    """Of arrays, by the names that ``Launch.arrays`` gives them, the chains of their uses."""

    read: dict[str, set[Chain]] = field(default_factory=dict)
    written: dict[str, set[Chain]] = field(default_factory=dict)
    starts: dict[str, str] = field(default_factory=dict)  # where a patch's part of an array begins: "edge_start"
    summed: set[str] = field(default_factory=set)  # that are added to in the cache, number by number
    raised: set[str] = field(default_factory=set)  # that vertices raise, of each its region's
    answered: set[str] = field(default_factory=set)  # of which the cache tells what they were, each time
    ahead: set[str] = field(default_factory=set)  # that are looked at before it is known how many there are
    picked: dict[str, set[int]] = field(default_factory=dict)  # which of a pair's corners; ANY: no certain one
    members: dict[str, str] = field(default_factory=dict)  # of structs made on the way: "collider", of "colliders"
    packed: set[str] = field(default_factory=set)  # whose elements lie as kernels.patches.packing packs positions


def array_uses(kernel: wp.Kernel) -> Uses:
    """Arrays that a kernel's source reads and writes, in the functions that it calls too.

    Branches that ``wp.static`` leaves out do not count.
    """
    uses = Uses()
    names = [argument.label for argument in kernel.adj.args]
    _Reader(kernel.func, dict(zip(names, names, strict=True)), uses).read(kernel.adj.tree)
    return uses


class _Reader(ast.NodeVisitor):
    """Walks one function; ``paths`` says what each of its names stands for in the kernel's arguments."""

    def __init__(
        self,
        function: Any,
        paths: dict[str, str],
        uses: Uses,
        chain: Chain = (),
        starts: dict[str, str] | None = None,
        elements: dict[str, str] | None = None,
        counts: dict[str, str] | None = None,
        corners: dict[str, int] | None = None,
    ) -> None:
        closure = inspect.getclosurevars(function)
        self._known = {**closure.globals, **closure.nonlocals}
        self._paths = dict(paths)
        self._uses = uses
        self._chain = chain
        self._counts = counts or {}  # names that stand for a count
        self._starts = starts or {}  # names of places that are counted from a patch's start
        self._elements = elements or {}  # names that stand for an element of an array
        self._corners = corners or {}  # names that stand for one of several, by its number

    def read(self, tree: ast.AST) -> None:
        found = tree.body[0] if isinstance(tree, ast.Module) else tree
        for statement in getattr(found, "body", []):
            self.visit(statement)

    def visit_If(self, node: ast.If) -> None:
        chosen = self._static(node.test)
        if chosen is not None:
            for statement in node.body if chosen else node.orelse:
                self.visit(statement)
            return
        guard = self._guard(node)
        self._visit_below(node)
        if guard:  # what comes after is for those that go on
            self._chain = (*self._chain, guard)

    def visit_Assign(self, node: ast.Assign) -> None:
        given, values = node.targets[0], [node.value]
        names = [given]
        if isinstance(given, ast.Tuple) and isinstance(node.value, ast.Tuple):
            names, values = given.elts, node.value.elts
        for name, value in zip(names, values, strict=False):
            if isinstance(name, ast.Name):
                self._name(name.id, value)
            elif isinstance(name, ast.Attribute) and isinstance(value, ast.Subscript):
                self._member_of(name.attr, self._path(value))
        self.generic_visit(node)

    def _member_of(self, member: str, path: str) -> None:
        """Remembers what a member of a struct made on the way is, if it is one of those that the kernel is given."""
        if path and "." not in path:
            self._uses.members[member] = path

    def _name(self, name: str, value: ast.AST) -> None:
        """Remembers what a name stands for, where that matters."""
        if _called(value) in LOOKS:
            self._paths[name] = self._queued(value)
        elif isinstance(value, ast.Attribute) and self._path(value):  # tree = search.edge_tree
            self._paths[name] = self._path(value)
        corner = self._corner(value)
        if corner != ANY:
            self._corners[name] = corner
        element = self._path(value) if isinstance(value, ast.Subscript) else ""
        for known, found in (
            (self._counts, self._count(value)),
            (self._starts, self._start(value)),
            (self._elements, element),
        ):
            if found:
                known[name] = found

    def visit_While(self, node: ast.While) -> None:
        self._visit_below(node)

    def _visit_below(self, node: ast.While | ast.If) -> None:
        """Goes into what is done below a count, from one on, or into anything else."""
        outer = self._chain
        for test in node.test.values if isinstance(node.test, ast.BoolOp) else [node.test]:
            if isinstance(test, ast.Compare):
                below = self._count(test.comparators[0])
                above = self._count(test.left) or self._member(test.left)
                operator = type(test.ops[0])
                if below and operator in (ast.Lt, ast.GtE):
                    self._chain = (*self._chain, below if operator is ast.Lt else FROM + below)
                elif above and operator is ast.Gt:  # zero
                    self._chain = (*self._chain, above)
        self.generic_visit(node)
        self._chain = outer

    def _guard(self, node: ast.If) -> str:
        """The array of ``if array[i] > limit: return``, or of ``if ...: array[i] = nothing; return``.

        The first also where its element has a name.

        What comes after is for fewer elements: those within the limit, or those that are not nothing.
        """
        if not isinstance(node.body[-1], ast.Return):
            return ""
        left = node.test.left if isinstance(node.test, ast.Compare) else None
        if isinstance(left, ast.Subscript):
            return self._path(left)
        if isinstance(left, ast.Name) and left.id in self._elements:
            return self._elements[left.id]
        put = (
            inner for inner in ast.walk(node) if isinstance(inner, ast.Subscript) and isinstance(inner.ctx, ast.Store)
        )
        return next(filter(None, map(self._path, put)), "")

    def visit_For(self, node: ast.For) -> None:
        outer, self._chain = self._chain, (*self._chain, SEVERAL)
        self.generic_visit(node)
        self._chain = outer

    def visit_Subscript(self, node: ast.Subscript) -> None:
        path = self._path(node.value)
        if path:
            self._note(path, self._uses.read if isinstance(node.ctx, ast.Load) else self._uses.written, node.slice)
        else:
            self.visit(node.value)
        self.visit(node.slice)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.generic_visit(node)
        if isinstance(node.target, ast.Subscript):
            self._note(self._path(node.target.value), self._uses.read, node.target.slice)

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in ATOMICS and node.args:
            self._note(self._path(node.args[0]), self._uses.written)  # the cache adds by itself
            self._uses.summed.add(self._path(node.args[0]))
        if name in COUNTERS:
            self._note(self._path(node.args[0]), self._uses.written)
            self._uses.answered.add(self._path(node.args[0]))
        if name in RAISES:
            self._note(self._path(node.args[0]), self._uses.written)
            self._uses.raised.add(self._path(node.args[0]))
        if name in QUEUES:
            for path in filter(None, map(self._path, node.args)):
                self._note(path, self._uses.read)
                self._uses.ahead.add(path)
        if getattr(self._known.get(name), "key", "") in PACKED and node.args:
            self._uses.packed.add(self._path(node.args[0]))
        self.generic_visit(node)
        called = self._known.get(name)
        if isinstance(called, wp.Function) and called.func is not None and getattr(called, "adj", None) is not None:
            given = list(zip((argument.label for argument in called.adj.args), node.args, strict=False))
            paths = {label: path for label, value in given if (path := self._path(value))}
            starts = {label: start for label, value in given if (start := self._start(value))}
            counts = {label: count for label, value in given if (count := self._count(value))}
            elements = {
                label: self._elements[value.id]
                for label, value in given
                if isinstance(value, ast.Name) and value.id in self._elements
            }
            corners = {label: corner for label, value in given if (corner := self._corner(value)) != ANY}
            if paths:
                chain = (*self._chain, REGIONS) if name in TURNS else self._chain
                below = _Reader(called.func, paths, self._uses, chain, starts, elements, counts, corners)
                below.read(called.adj.tree)

    def _note(self, path: str, use: dict[str, set[Chain]], index: ast.AST | None = None) -> None:
        if not path:
            return
        use.setdefault(path, set()).add(self._chain)
        self._uses.picked.setdefault(path, set()).add(self._corner(index))
        start = self._start(index) if index is not None else ""
        if start:
            self._uses.starts[path] = start

    def _corner(self, node: ast.AST | None) -> int:
        """Which of several something is that is counted out: 3 of ``corners[3]``, or of a name of that."""
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant) and not self._path(node):
            return int(node.slice.value) if isinstance(node.slice.value, int) else ANY
        return self._corners.get(node.id, ANY) if isinstance(node, ast.Name) else ANY

    def _queued(self, node: ast.AST) -> str:
        """The array that a queue's elements, or those looked at, are of."""
        return next(filter(None, map(self._path, getattr(node, "args", ()))), "")

    def _count(self, node: ast.AST) -> str:
        """A patch's count or a counter on the device, by itself, by a name of it, or the least of it and others.

        Of a queue the array that says who is in it.
        """
        if _called(node) in QUEUES:
            return self._queued(node)
        if isinstance(node, ast.Attribute) and node.attr.endswith("_count"):
            return node.attr
        if isinstance(node, ast.Subscript) and self._path(node).endswith(".count"):
            return self._path(node)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "min":
            return next((count for count in map(self._count, node.args) if count), "")
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):  # of a kind
            return self._counts.get(node.value.id, "")
        return self._counts.get(node.id, "") if isinstance(node, ast.Name) else ""

    def _member(self, node: ast.AST) -> str:
        """A member of a struct that is an element of an array; empty for anything else."""
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in self._elements:
            return f"{self._elements[node.value.id]}.{node.attr}"
        return ""

    def _start(self, node: ast.AST) -> str:
        """The start of a patch's part from which a place is counted; empty where it is counted from none."""
        for inner in ast.walk(node):
            if isinstance(inner, ast.Attribute) and inner.attr.endswith("_start") and not self._path(inner):
                return inner.attr
            if isinstance(inner, ast.Name) and inner.id in self._starts:
                return self._starts[inner.id]
        return ""

    def _path(self, node: ast.AST) -> str:
        """What a name, a member or an element of one stands for; empty where that is no argument of the kernel."""
        if isinstance(node, ast.Subscript):
            return self._path(node.value)
        if isinstance(node, ast.Attribute):
            owner = self._path(node.value)
            return f"{owner}.{node.attr}" if owner else self._uses.members.get(node.attr, "")
        return self._paths.get(node.id, "") if isinstance(node, ast.Name) else ""

    def _static(self, test: ast.AST) -> bool | None:
        """The value of ``wp.static(...)``, before or after Warp has put it in; None for any other test."""
        if isinstance(test, ast.Constant):
            return bool(test.value)
        if not (isinstance(test, ast.Call) and isinstance(test.func, ast.Attribute) and test.func.attr == "static"):
            return None
        code = compile(ast.Expression(test.args[0]), "<static>", "eval")
        try:
            return bool(eval(code, dict(self._known)))  # as Warp does
        except NameError:
            return None


def _called(node: ast.AST) -> str:
    """The name of the function that is called, where that is what an expression does."""
    return node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
