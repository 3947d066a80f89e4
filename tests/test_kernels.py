"""Every kernel compiles, and says what it does: what a type checker is elsewhere, these tests are for kernels."""

from __future__ import annotations

import ast
import importlib
import itertools
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import warp as wp
from kernel_writes import NATIVE_WRITERS, Writes

import warp_cloth.kernels
from warp_cloth.base.compilers import compiled_by
from warp_cloth.base.compiling import missing_builds
from warp_cloth.kernels.avatar.bake import bake_kernels
from warp_cloth.kernels.avatar.closest import MeshCollider, mesh_contact
from warp_cloth.kernels.avatar.depth import DepthSolid, plain_contact, solid_level
from warp_cloth.kernels.avatar.field import ContactField, field_contact
from warp_cloth.kernels.avatar.layers import LayeredSolid, layered_level
from warp_cloth.kernels.base.options import Accumulate, KernelOptions, Terms
from warp_cloth.kernels.base.types import PRECISIONS
from warp_cloth.kernels.certificate.energy import measure_bending_kernel, measure_tension_kernel, measure_weave_kernel
from warp_cloth.kernels.certificate.pressure import normal_force_kernel
from warp_cloth.kernels.certificate.residual import residual_kernel
from warp_cloth.kernels.contact.crossing_search import crossing_groups_kernel, crossing_list_kernels
from warp_cloth.kernels.contact.force import force_kernel
from warp_cloth.kernels.contact.pairs import near_groups_kernel, near_list_kernels
from warp_cloth.kernels.contact.search import refit_kernel, start_kernel
from warp_cloth.kernels.contact.sums import add_load_kernel
from warp_cloth.kernels.contact.untangle import finish_kernel, layers_kernel
from warp_cloth.kernels.math.lanes import WIDTH
from warp_cloth.kernels.passes.advance import advance_kernel
from warp_cloth.kernels.passes.gather import gather_kernel
from warp_cloth.kernels.passes.move import displace_kernel
from warp_cloth.kernels.passes.scatter import edges_kernel, normals_kernel, packet_normals_kernel, triangles_kernel
from warp_cloth.kernels.passes.step import NoCollider, accumulated

FOLDER = Path(warp_cloth.kernels.__path__[0])
FILES = sorted(path for path in FOLDER.rglob("*.py") if path.name != "__init__.py")
COLLIDERS = ((None, None), (field_contact, ContactField), (mesh_contact, MeshCollider), (plain_contact, DepthSolid))
SOLIDS = ((solid_level, DepthSolid), (layered_level, LayeredSolid))


def module_name(path: Path) -> str:
    """The dotted name of a kernel file below ``warp_cloth.kernels``."""
    return ".".join(path.relative_to(FOLDER).with_suffix("").parts)


# Kernels may use these besides Warp and each other: they are written in a language of their own.
STANDARD = {"collections.abc", "ctypes", "dataclasses", "enum", "functools", "hashlib", "math", "types", "typing"}

MADE_BY_WARP = ("func", "kernel", "struct")


def device_code(tree: ast.AST) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
    """Every function, kernel and struct of a kernel file, wherever in it, with which of these it is."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            for decorator in node.decorator_list:
                maker = decorator.func if isinstance(decorator, ast.Call) else decorator
                if isinstance(maker, ast.Attribute) and maker.attr in MADE_BY_WARP:
                    yield maker.attr, node


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_every_kernel_function_and_struct_has_a_docstring(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "the file itself"
    for _, node in device_code(tree):
        assert ast.get_docstring(node), f"{node.name}, line {node.lineno}"


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_kernels_import_warp_and_each_other_only(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
        for name in names:
            assert name in {"warp", *STANDARD} or name.startswith("warp_cloth.kernels."), name


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_kernels_are_named_by_a_verb_and_write_to_outputs_named_so(path: Path) -> None:
    for kind, node in device_code(ast.parse(path.read_text(encoding="utf-8"))):
        if kind == "kernel":
            assert "_" in node.name, f"{node.name}: verb_noun"
            names = [argument.arg for argument in node.args.args]  # type: ignore[union-attr]
            outputs = [name for name in names if name.endswith("_out")]
            assert names[len(names) - len(outputs) :] == outputs, f"{node.name}: outputs come last"


# Structs that are no State, and which kernels write nevertheless: memory of the solver's own.
SCRATCH = {
    "ContactData": "cloth contact: its state and scratch, all but ``model``",
    "ContactSearch": "trees and boxes of a search, refitted in place",
    "StickMemory": "hash table of static friction",
    "Candidates": "lists of the broad phase",
    "Untangling": "sums of what crosses",
    "Chunks": "sums of an ordered reduction",
    "RigidLevel": "its chunks' sums",
}
# Arrays that are read, and then written, under one name.
IN_PLACE = {
    ("count_open_seams", "count"),
    ("pair_layers", "count"),
    ("pair_layers", "surface"),
    ("add_contact_load", "load"),
}


def test_no_kernel_writes_the_constants_of_cloth_contact() -> None:
    for path in FILES:
        assert not re.search(r"contact\.model\.\w+(\[[^\]]*\])? \S?= ", path.read_text(encoding="utf-8")), path


def test_kernels_show_what_they_write() -> None:
    """Also by the functions that they call, and through members of structs."""
    writes, needless = Writes(FILES), {*SCRATCH, *IN_PLACE}
    assert {each.node.name for each in writes.functions} >= NATIVE_WRITERS
    for kernel in writes.kernels():
        for argument in (kernel.parameters[number] for number in sorted(kernel.written)):
            annotation = ast.unparse(argument.annotation) if argument.annotation is not None else ""
            annotation = "ContactData" if annotation.startswith("cloth_contact_type") else annotation
            if argument.arg.endswith("_out") or annotation.endswith("State"):
                continue
            place = (kernel.node.name, argument.arg)
            assert annotation in SCRATCH or place in IN_PLACE, f"{kernel.path}: {place} is written"
            needless -= {annotation, place}
    assert not needless, "no kernel writes these any more"


def compiled(*kernels: Any) -> None:
    """Compiles kernels for the CPU, or what a factory made; of those that another test has compiled, it loads that.

    The others are compiled into a folder that is removed and are not loaded, so that what tests run is optimised.
    """
    made = [k for entry in kernels for k in (vars(entry).values() if isinstance(entry, SimpleNamespace) else [entry])]
    modules = {kernel.module: None for kernel in made if isinstance(kernel, wp.Kernel)}  # in order
    assert modules
    with tempfile.TemporaryDirectory() as folder, compiled_by(compile_quickly):
        for number, build in enumerate(missing_builds(list(modules))):
            build._replace(folder=str(Path(folder) / str(number))).run()
            del modules[build.module]
    wp.force_load("cpu", modules=list(modules))


def compile_quickly(compiler: Callable[..., None], target: str, source: str, **options: Any) -> None:
    """Compiles a file without optimising, in half the time, unless that is to heed a pragma, or warn that it cannot."""
    if not heeds_pragma(Path(source).read_text(encoding="utf-8")):
        options["optimization_level"] = 0
    compiler(target, source, **options)


def heeds_pragma(source: str) -> bool:
    """Whether a CPU's compiler meets a pragma: outside of what only a GPU's reads."""
    depth, gpu = 0, 0  # of conditions; that of the GPU's code, or 0
    for line in map(str.strip, source.splitlines()):
        if line.startswith("#pragma") and not gpu:
            return True
        if line.startswith("#if"):
            depth += 1
            gpu = gpu or (depth if line.startswith("#if defined(__CUDA_ARCH__)") else 0)
        elif line.startswith(("#el", "#endif")) and gpu == depth:
            gpu = 0
        depth -= line.startswith("#endif")
    return False


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_kernels_outside_factories_compile(path: Path) -> None:
    module = importlib.import_module(f"warp_cloth.kernels.{module_name(path)}")
    kernels = [value for value in vars(module).values() if isinstance(value, wp.Kernel)]
    if kernels:
        compiled(*kernels)


def test_bake_kernels_compile() -> None:
    compiled(*(bake_kernels(*solid) for solid in SOLIDS))


BOUNDS = tuple(each for each in Accumulate if each.is_bound)
FOLDED = Terms(True, True, True, angles=True, hysteresis=True, shear_hysteresis=True)


def spread(precision: str, *options: Any) -> Iterator[tuple[Any, ...]]:
    """Every combination of options falls to one precision: pairs of choices are met, at a third of the compiling."""
    for chosen in itertools.product(*(tuple(enumerate(values)) for values in options)):
        if PRECISIONS[sum(number for number, _ in chosen) % len(PRECISIONS)] == precision:
            yield tuple(value for _, value in chosen)


def turned(precision: str, choices: Sequence[Any]) -> list[Any]:
    """The choices, begun with another one in every precision, so that each meets what the others hold."""
    first = PRECISIONS.index(precision)
    return [*choices[first:], *choices[:first]]


# Half a minute of compiling each but for the usual precision, whose turn it is in a third of the combinations.
IN_TURN = ["mixed", *(pytest.param(each, marks=pytest.mark.long) for each in PRECISIONS if each != "mixed")]


@pytest.mark.parametrize("precision", IN_TURN)
def test_force_kernels_compile(precision: str) -> None:
    terms = (Terms(True, True, False), Terms(False, True, True), Terms(False, False, True), FOLDED)
    compiled(normals_kernel(precision), packet_normals_kernel(precision))
    for make in (edges_kernel, triangles_kernel):
        compiled(*(make(precision, *rest) for rest in spread(precision, Accumulate, terms)))
    for make in (edges_kernel, triangles_kernel):
        pairs = zip(turned(precision, terms[:-1]), (*BOUNDS, BOUNDS[0]), strict=True)
        compiled(*(make(precision, bound, chosen, WIDTH) for chosen, bound in pairs))
    gathers = [KernelOptions(precision, chosen, summed) for summed, chosen in spread(precision, Accumulate, terms)]
    compiled(*map(gather_kernel, gathers))


@pytest.mark.parametrize("precision", IN_TURN)
def test_displacement_and_certificate_kernels_compile(precision: str) -> None:
    compiled(measure_tension_kernel(precision), measure_weave_kernel(precision, FOLDED))
    compiled(*(measure_bending_kernel(precision, terms) for terms in (Terms(True, True, True), FOLDED)))
    choices = list(itertools.product((False, True), repeat=2))
    sizes = itertools.cycle(turned(precision, ((True, False, False), (True, True, True), (False, True, False))))
    for (contact, data), (accelerated, cloth_contact) in zip(COLLIDERS, turned(precision, choices), strict=True):
        asked = contact, data or NoCollider
        compiled(residual_kernel(precision, *asked, cloth_contact))
        if contact is not None:
            compiled(normal_force_kernel(precision, *asked, cloth_contact))
        options = KernelOptions(
            precision,
            Terms(True, True, True, pins=cloth_contact),
            accelerated=accelerated,
            avatar_contact=contact,
            collider=data,
            cloth_contact=cloth_contact,
        )
        compiled(displace_kernel(options))
        few, fits, paired = next(sizes)
        moves = replace(options, few=few, fits=fits, paired=paired)
        compiled(advance_kernel(replace(moves, accumulate=accumulated(moves))))


@pytest.mark.parametrize("precision", IN_TURN)
def test_kernels_of_cloth_on_cloth_compile(precision: str) -> None:
    searching = start_kernel, refit_kernel, near_groups_kernel, crossing_groups_kernel
    compiled(*(made(precision) for made in (*searching, layers_kernel, finish_kernel, add_load_kernel)))
    compiled(*near_list_kernels(precision), *crossing_list_kernels(precision))
    compiled(*(force_kernel(precision, *rest) for rest in spread(precision, Accumulate)))


def test_every_pair_of_choices_is_compiled() -> None:
    met = {(precision, *rest) for precision in PRECISIONS for rest in spread(precision, range(4), range(4))}
    assert len(met) == 4 * 4
    for first, second in itertools.combinations(range(3), 2):
        pairs = {(row[first], row[second]) for row in met}
        assert len(pairs) == (16 if first else 3 * 4)
