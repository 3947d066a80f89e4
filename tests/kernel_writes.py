"""What kernels write, read from their source: through arrays, members of structs and the functions that they call."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

# Functions in C++ whose Python body does not show that they write their first argument. Left out are those that write a
# block's own memory, which is no result.
NATIVE_WRITERS = {
    "await_blocks",
    "count_requests",
    "grid_barrier",
    "leave_blocks",
    "next_slot",
    "raise_step",
    "signal_done",
    "team_slot",
}


@dataclass
class DeviceFunction:
    """A Warp function or kernel as its source has it."""

    path: str
    node: ast.FunctionDef
    kind: str  # "func", "func_native" or "kernel"
    written: set[int] = field(default_factory=set)  # which of its parameters
    calls: list[tuple[tuple[str, ...], list[set[int]]]] = field(
        default_factory=list
    )  # names, parameters passed as each

    @property
    def parameters(self) -> list[ast.arg]:
        return self.node.args.args


def kind_of(node: ast.AST) -> str | None:
    """Whether Warp compiles a function, and as what."""
    for decorator in node.decorator_list if isinstance(node, ast.FunctionDef) else []:
        maker = decorator.func if isinstance(decorator, ast.Call) else decorator
        if isinstance(maker, ast.Attribute) and maker.attr in ("func", "func_native", "kernel"):
            return maker.attr
    return None


def root_of(node: ast.AST) -> str | None:
    """The variable whose element or member an expression is."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else None


def unpacked(target: ast.expr) -> list[ast.expr]:
    """What an assignment to several assigns to."""
    return list(target.elts) if isinstance(target, ast.Tuple) else [target]


def names_in(node: ast.AST) -> set[str]:
    """The variables, and last attributes, that an expression may be: ``a if c else b.d`` may be a or d."""
    if isinstance(node, ast.Name):
        return {node.id}
    if isinstance(node, ast.Attribute):
        return {node.attr}
    if isinstance(node, ast.IfExp):
        return names_in(node.body) | names_in(node.orelse)
    if isinstance(node, ast.Call):
        return names_in(node.func)
    if isinstance(node, ast.Subscript):
        return set().union(*(names_in(each) for each in ast.walk(node.value) if isinstance(each, ast.Name)))
    return set()


class Writes:
    """Which parameters of which functions are written, directly or by what is called."""

    def __init__(self, files: Sequence[Path]) -> None:
        self.functions: list[DeviceFunction] = []
        self._by_name: dict[str, list[DeviceFunction]] = defaultdict(list)
        self._aliases: dict[str, set[str]] = defaultdict(set)  # of a factory, or of a variable that has a function
        for path in files:
            self._read(path)
        for function in self.functions:
            self._read_body(function)
        changed = True
        while changed:
            changed = sum(self._spread(function) for function in self.functions) > 0

    def kernels(self) -> Iterator[DeviceFunction]:
        return (function for function in self.functions if function.kind == "kernel")

    def _read(self, path: Path) -> None:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            kind = kind_of(node)
            if isinstance(node, ast.FunctionDef) and kind:
                function = DeviceFunction(path.name, node, kind)
                self.functions.append(function)
                self._by_name[node.name].append(function)
            elif isinstance(node, ast.FunctionDef):  # a factory: what it returns is a function, or has some
                for returned in (each.value for each in ast.walk(node) if isinstance(each, ast.Return) and each.value):
                    self._aliases[node.name] |= names_in(returned) - {"SimpleNamespace"}
            elif isinstance(node, ast.Assign):
                for target in node.targets:
                    self._alias(target, node.value)
            elif isinstance(node, ast.Call) and names_in(node.func) == {"SimpleNamespace"}:
                for keyword in node.keywords:
                    if keyword.arg:
                        self._aliases[keyword.arg] |= names_in(keyword.value) - {keyword.arg}

    def _alias(self, target: ast.AST, value: ast.AST) -> None:
        if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for one, its in zip(target.elts, value.elts, strict=False):
                self._alias(one, its)
        elif isinstance(target, ast.Name):
            self._aliases[target.id] |= names_in(value) - {target.id}

    def _resolve(self, name: str) -> list[DeviceFunction]:
        """The functions that a name may be of."""
        seen, ahead, found = {name}, [name], list[DeviceFunction]()
        while ahead:
            one = ahead.pop()
            found += self._by_name.get(one, [])
            if one in self._by_name and one == name:
                continue
            for other in self._aliases.get(one, ()):
                if other not in seen:
                    seen.add(other)
                    ahead.append(other)
        return found

    def _read_body(self, function: DeviceFunction) -> None:
        places = self._places(function)
        if function.kind == "func_native" and function.node.name in NATIVE_WRITERS:
            function.written.add(0)
        for node in ast.walk(function.node):
            targets: list[ast.expr] = []
            if isinstance(node, ast.Assign):
                targets = [each for target in node.targets for each in unpacked(target)]
            elif isinstance(node, ast.AugAssign):
                targets = [node.target]
            for target in targets:
                if isinstance(target, ast.Subscript) and root_of(target) in places and self._is_array(function, target):
                    function.written |= places[str(root_of(target))]
            if isinstance(node, ast.Call):
                passed = [places.get(root_of(argument) or "", set()) for argument in node.args]
                names = tuple(names_in(node.func))
                if any(name.startswith("atomic_") for name in names) and passed:
                    function.written |= passed[0]
                function.calls.append((names, passed))

    @staticmethod
    def _places(function: DeviceFunction) -> dict[str, set[int]]:
        """Which parameters a variable of a function is, is a member of, or (a ``context``) has as members."""
        places = {argument.arg: {number} for number, argument in enumerate(function.parameters)}
        for node in (node for node in ast.walk(function.node) if isinstance(node, ast.Assign)):
            for target, value in zip(unpacked(node.targets[0]), unpacked(node.value), strict=False):
                parts = [value]
                if isinstance(value, ast.Call) and any(name.endswith("_context") for name in names_in(value.func)):
                    parts = value.args
                elif not isinstance(value, ast.Attribute) or any(isinstance(x, ast.Subscript) for x in ast.walk(value)):
                    continue
                found = set().union(*(places.get(root_of(part) or "", set()) for part in parts))
                if isinstance(target, ast.Name) and found:
                    places[target.id] = places.get(target.id, set()) | found
        return places

    @staticmethod
    def _is_array(function: DeviceFunction, target: ast.Subscript) -> bool:
        """Whether what is indexed is an array, and no vector that was passed by value."""
        root = root_of(target)
        if isinstance(target.value, ast.Name):
            argument = next((each for each in function.parameters if each.arg == root), None)
            if argument is None:
                return False
            return argument.annotation is not None and "array" in ast.unparse(argument.annotation)
        return True

    def _spread(self, function: DeviceFunction) -> bool:
        before = len(function.written)
        for names, passed in function.calls:
            for callee in [each for name in names for each in self._resolve(name)]:
                if callee is function:
                    continue
                for number, own in enumerate(passed):
                    if number in callee.written:
                        function.written |= own
        return len(function.written) > before
