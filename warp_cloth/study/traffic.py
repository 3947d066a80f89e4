"""Which of its arrays a kernel reads and writes, from the kernel's own source."""

from __future__ import annotations

import ast
import inspect
from dataclasses import dataclass, field
from typing import Any

import warp as wp

ATOMICS = frozenset({"atomic_add", "atomic_sub", "atomic_min", "atomic_max", "atomic_cas", "atomic_exch"})


@dataclass
class Uses:
    """Names of arrays as ``Launch.arrays`` gives them."""

    read: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)
    # of each array the counts up to which loops go over it, "vertex_count" of ``while local < patch.vertex_count``, or
    # of ``if`` for a loop's first turn; "" where it is used outside such a loop
    loops: dict[str, set[str]] = field(default_factory=dict)


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

    def __init__(self, function: Any, paths: dict[str, str], uses: Uses, loop: str = "") -> None:
        closure = inspect.getclosurevars(function)
        self._known = {**closure.globals, **closure.nonlocals}
        self._paths = dict(paths)
        self._uses = uses
        self._loop = loop
        self._counts: dict[str, str] = {}  # names that stand for a count

    def read(self, tree: ast.AST) -> None:
        found = tree.body[0] if isinstance(tree, ast.Module) else tree
        for statement in getattr(found, "body", []):
            self.visit(statement)

    def visit_If(self, node: ast.If) -> None:
        chosen = self._static(node.test)
        if chosen is None:
            self._visit_below(node)
            return
        for statement in node.body if chosen else node.orelse:
            self.visit(statement)

    def visit_Assign(self, node: ast.Assign) -> None:
        count = self._count(node.value)
        if count and isinstance(node.targets[0], ast.Name):
            self._counts[node.targets[0].id] = count
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        self._visit_below(node)

    def _visit_below(self, node: ast.While | ast.If) -> None:
        """Goes into what is done below a count, or into anything else."""
        outer = self._loop
        if isinstance(node.test, ast.Compare) and isinstance(node.test.ops[0], ast.Lt):
            self._loop = self._count(node.test.comparators[0]) or outer
        self.generic_visit(node)
        self._loop = outer

    def visit_For(self, node: ast.For) -> None:
        outer, self._loop = self._loop, ""  # several for each that the loop round it goes over
        self.generic_visit(node)
        self._loop = outer

    def visit_Subscript(self, node: ast.Subscript) -> None:
        path = self._path(node.value)
        if path:
            self._note(path, self._uses.read if isinstance(node.ctx, ast.Load) else self._uses.written)
        else:
            self.visit(node.value)
        self.visit(node.slice)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.generic_visit(node)
        if isinstance(node.target, ast.Subscript):
            self._note(self._path(node.target.value), self._uses.read)

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in ATOMICS and node.args:
            path = self._path(node.args[0])
            self._note(path, self._uses.read)
            self._note(path, self._uses.written)
        self.generic_visit(node)
        called = self._known.get(name)
        if isinstance(called, wp.Function) and called.func is not None and getattr(called, "adj", None) is not None:
            labels = [argument.label for argument in called.adj.args]
            paths = {label: self._path(value) for label, value in zip(labels, node.args, strict=False)}
            given = {label: path for label, path in paths.items() if path}
            if given:
                _Reader(called.func, given, self._uses, self._loop).read(called.adj.tree)

    def _note(self, path: str, use: set[str]) -> None:
        if path:
            use.add(path)
            self._uses.loops.setdefault(path, set()).add(self._loop)

    def _count(self, node: ast.AST) -> str:
        """The name of a count, as a member or by the name that it was given; empty for anything else."""
        if isinstance(node, ast.Attribute) and node.attr.endswith("_count"):
            return node.attr
        return self._counts.get(node.id, "") if isinstance(node, ast.Name) else ""

    def _path(self, node: ast.AST) -> str:
        """What a name, a member or an element of one stands for; empty where that is no argument of the kernel."""
        if isinstance(node, ast.Subscript):
            return self._path(node.value)
        if isinstance(node, ast.Attribute):
            owner = self._path(node.value)
            return f"{owner}.{node.attr}" if owner else ""
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
