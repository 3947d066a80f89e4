"""However the cloth is cut into patches, every vertex sums the same numbers in the same order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cloths import cloth_forces, grid, model_of

from warp_cloth.avatar.collider import Collider
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh
from warp_cloth.base.topology import build_topology
from warp_cloth.garment.elements import garment_elements
from warp_cloth.garment.garment import Garment, terms_of
from warp_cloth.garment.rest import RestShape, build_rest_shape
from warp_cloth.kernels.base.options import FEW, SINGLE, Accumulate, Terms, block_for
from warp_cloth.material.fabric import resolve_fabric
from warp_cloth.model.model import build_model
from warp_cloth.model.patches import block_memory, cutting, on_device
from warp_cloth.model.patches.cutting import cut_patches, even_size
from warp_cloth.model.patches.tables import PatchTables
from warp_cloth.solver.relax import Relaxation
from warp_cloth.solver.step_options import Method, StepOptions

FABRIC = resolve_fabric({"stretch": 20e3, "compression": 0.1, "bending": 1e-5})
WOVEN = replace(FABRIC, stretch_weft=9e3, shear=800.0)
BENT = Terms(edges=True, folds=True, yarns=False)


def fan(count: int) -> Mesh:
    """A wheel of ``count`` triangles around one vertex."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle), 0.1 * np.cos(3.0 * angle)], axis=1)
    number = np.arange(count)
    triangles = np.stack([0 * number, 1 + number, 1 + (number + 1) % count], axis=1)
    return Mesh("fan", np.concatenate([np.zeros((1, 3)), rim]), triangles.astype(np.int32))


def fan_rest(mesh: Mesh) -> RestShape:
    topology = build_topology(mesh.triangles, mesh.vertex_count)
    even = np.ones(len(topology.edges))
    weight = np.ones(mesh.vertex_count)
    return RestShape(topology, 0.9 * even, even, 0.1 * even, np.ones(len(topology.hinges)), weight, 1.0)


def cut(mesh: Mesh, rest: RestShape, terms: Terms = BENT) -> PatchTables:
    elements = garment_elements(mesh.triangles, rest)
    return cut_patches([elements], [mesh.points], terms, precision="mixed", own_memory=True)


def owned(tables: PatchTables) -> np.ndarray:
    rows = zip(tables.patch["vertex_start"], tables.patch["owned_count"], strict=True)
    return np.concatenate([tables.vertex[start : start + count] for start, count in rows])


@pytest.mark.parametrize("paired", [False, True], ids=["single", "pairs"])
@pytest.mark.parametrize("size", [1, 7, 1000])
@pytest.mark.parametrize("fabric", [FABRIC, WOVEN], ids=["edges", "yarns"])
def test_patches_of_any_size_give_the_bits_of_scattered_forces(
    fabric: object, size: int, paired: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = grid(12)
    rest = build_rest_shape(mesh, fabric, rest="mesh")
    points = mesh.points + np.random.default_rng(1).normal(scale=5e-3, size=mesh.points.shape)
    monkeypatch.setattr(on_device, "takes_pairs", lambda terms, vertices: paired and not terms.yarns)
    monkeypatch.setattr(cutting, "SMALLEST", size)
    monkeypatch.setattr(cutting, "block_for", lambda paired: block_for(paired)._replace(vertices=size))
    loads = []
    for gathers in (False, True):
        model = model_of(mesh, rest, precision="mixed", gathers=gathers)
        model.set_points(points)
        loads.append(cloth_forces(model, Accumulate.STIFFNESS))
    assert model.patches.count >= mesh.vertex_count // size
    assert model.patches.paired == (paired and not model.terms.yarns)
    assert (loads[0] == loads[1]).all()


@pytest.mark.parametrize("count", [6, 60, 600])
def test_many_triangles_at_a_vertex_are_summed_as_scattered_ones(count: int) -> None:
    mesh = fan(count)
    loads = [cloth_forces(model_of(mesh, fan_rest(mesh), precision="mixed", gathers=how)) for how in (False, True)]
    assert (loads[0] == loads[1]).all()


def test_where_more_meets_than_words_of_pairs_tell_apart_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(on_device, "takes_pairs", lambda terms, vertices: True)
    mesh = fan(600)
    models = [model_of(mesh, fan_rest(mesh), precision="mixed", gathers=how) for how in (False, True)]
    assert not models[1].patches.paired
    assert (cloth_forces(models[0]) == cloth_forces(models[1])).all()


@pytest.mark.parametrize("mesh", [grid(40), fan(3000)], ids=["grid", "fan"])
def test_every_vertex_is_owned_once_and_every_patch_has_memory(mesh: Mesh) -> None:
    tables = cut(mesh, fan_rest(mesh))
    assert (np.sort(owned(tables)) == np.arange(mesh.vertex_count)).all()
    needed = block_memory.block_memory(tables.patch, BENT, "mixed")
    place = tables.patch["overflow"]
    assert ((needed > SINGLE.memory) == (place >= 0)).all()
    assert (tables.patch["owned_count"][place >= 0] == 1).all()  # only what cannot be cut further
    ends = np.sort(place[place >= 0])[1:], tables.overflow
    assert ((place + needed)[place >= 0] <= np.append(*ends)).all()


def test_a_vertex_with_too_many_triangles_is_told() -> None:
    mesh = fan(20_000)
    with pytest.raises(InputError, match="more than 10,000 triangles meet at a vertex"):
        cut(mesh, fan_rest(mesh))


@pytest.mark.parametrize("fabric", [FABRIC, WOVEN], ids=["edges", "yarns"])
def test_patches_cut_in_several_parts_are_those_cut_at_once(fabric: object, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = grid(12)
    rest = build_rest_shape(mesh, fabric, rest="mesh")
    terms = terms_of([Garment(mesh.points, mesh.triangles, rest, np.zeros(0, dtype=np.int32))])
    monkeypatch.setattr(cutting, "SMALLEST", 7)
    for module in (cutting, block_memory):  # some have to be halved
        monkeypatch.setattr(module, "block_for", lambda paired: SINGLE._replace(memory=4000))
    whole = cut(mesh, rest, terms)
    monkeypatch.setattr(cutting, "PORTION", 3)
    parts = cut(mesh, rest, terms)
    assert len(whole.patch["owned_count"]) > 144 / 7
    for name in (field for field in PatchTables.__dataclass_fields__ if field != "patch"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name)), name
    for name, numbers in whole.patch.items():
        assert np.array_equal(parts.patch[name], numbers), name


def test_items_that_have_ended_leave_the_launch_and_come_back() -> None:
    meshes = [grid(side) for side in (6, 9, 12)]
    garments = [
        Garment(mesh.points, mesh.triangles, build_rest_shape(mesh, WOVEN, rest="mesh"), np.array([0]))
        for mesh in meshes
    ]
    model = build_model(garments, device="cpu", precision="mixed", gathers=True, garment_counts=[1, 1, 1])
    relaxation = Relaxation(model, Collider(), StepOptions())
    everything = model.patches.count
    relaxation.run(20)
    before = model.points()
    relaxation.deactivate([0, 1])
    assert 0 < model.patches.count < everything
    relaxation.run(20)
    moved = [not np.array_equal(model.points(item), before[model.of_item(item)]) for item in range(3)]
    assert moved == [False, False, True]
    relaxation.restart()
    assert model.patches.count == everything
    relaxation.run(20)
    assert all(not np.array_equal(model.points(item), before[model.of_item(item)]) for item in range(3))


@pytest.mark.parametrize("method", ["accelerated", "direct"])
def test_iterations_in_the_patches_order_have_the_bits_of_scattered_ones(method: Method) -> None:
    mesh = grid(20)
    garment = Garment(mesh.points, mesh.triangles, build_rest_shape(mesh, WOVEN, rest="mesh"), np.array([0, 19]))
    shapes = []
    for gathers in (False, True):
        model = build_model([garment], device="cpu", precision="mixed", gathers=gathers)
        relaxation = Relaxation(model, Collider(), StepOptions(method=method))
        relaxation.run(20)
        relaxation.run(3)
        shapes.append(model.points())
    assert (shapes[0] == shapes[1]).all()
    assert not np.array_equal(shapes[0], mesh.points)


@pytest.mark.parametrize("vertices", [7_000, 14_000, 20_000])
def test_patches_are_half_as_many_where_other_blocks_of_a_core_press(vertices: int) -> None:
    several, one = (-(-vertices // even_size(vertices, least=least)) for least in (2, 1))
    assert several <= FEW
    assert FEW / 2 * 0.95 < one <= FEW / 2
