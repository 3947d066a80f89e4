"""Sums over rows: to the bit those that numpy.bincount adds up."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from cloths import grid
from scipy.ndimage import distance_transform_edt

from warp_cloth.base import chunks, row_sums
from warp_cloth.base.compiled_scipy import compiled_scipy
from warp_cloth.base.row_sums import RowSums
from warp_cloth.base.topology import build_topology, ragged_rows
from warp_cloth.dressing.free_space import cells_off

WIDTH = 41  # of a grid whose rows take several parts
LONG = 64  # entries of a row, as few have


def neighbours(mixed: bool) -> tuple[np.ndarray, np.ndarray, int]:
    """Every vertex of a grid, and one next to it; ``mixed``: numbered in no order."""
    mesh = grid(WIDTH)
    edges = build_topology(mesh.triangles, mesh.vertex_count).edges
    if mixed:
        edges = np.random.default_rng(3).permutation(mesh.vertex_count)[edges]
    return edges[:, ::-1].T.ravel(), edges.T.ravel(), mesh.vertex_count


@pytest.fixture(params=["bincount", "SciPy's"])
def sparse(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without SciPy's product, and with it."""
    if request.param == "bincount":
        monkeypatch.setattr(row_sums, "sparse_tools", lambda: None)


@pytest.mark.usefixtures("sparse")
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("at_once", [100, 1 << 15])
def test_they_are_those_of_bincount(mixed: bool, at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "CHUNK_ROWS", at_once)
    rows, places, count = neighbours(mixed)
    held = np.random.default_rng(4).normal(size=count) * np.geomspace(1e-9, 1e9, count)
    held[::7] = -0.0
    summed = RowSums(rows, places, count)(held)
    wanted = np.bincount(rows, held[places], count)
    assert summed.tobytes() == wanted.tobytes()
    several = RowSums(rows, places, count)(np.column_stack([held, 2.0 * held]))
    assert np.array_equal(several, np.column_stack([wanted, 2.0 * wanted]))


@pytest.mark.usefixtures("sparse")
@pytest.mark.parametrize("at_once", [100, 1 << 15])
def test_entries_with_factors_are_rounded_before_they_are_added(at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "CHUNK_ROWS", at_once)
    rows, places, count = neighbours(mixed=True)
    rows[: 2 * LONG] = 7
    rng = np.random.default_rng(6)
    held, factors = rng.normal(size=count), rng.normal(size=len(rows))
    summed = RowSums(rows, places, count, factors)(held)
    assert np.array_equal(summed, np.bincount(rows, factors * held[places], count))
    grouped = ragged_rows(rows, count)
    assert np.array_equal(RowSums(grouped, places, count, factors)(held), summed)
    assert np.array_equal(RowSums(rows, places, count, factors)(held[:, None])[:, 0], summed)


@pytest.mark.usefixtures("sparse")
def test_rows_may_be_empty_or_very_long() -> None:
    rng = np.random.default_rng(5)
    rows = np.concatenate([np.full(3 * LONG, 7), rng.integers(10, 60, 500), np.full(LONG + 1, 98)])
    rng.shuffle(rows)
    places, held = rng.integers(0, 33, len(rows)), rng.normal(size=33)
    summed = RowSums(rows, places, 100)(held)
    assert summed.tobytes() == np.bincount(rows, held[places], 100).tobytes()


@pytest.mark.usefixtures("sparse")
def test_there_may_be_no_entries_at_all() -> None:
    none = np.zeros(0, dtype=np.int64)
    assert (RowSums(none, none, 5)(np.zeros(3)) == np.zeros(5)).all()
    assert len(RowSums(none, none, 0)(np.zeros(0))) == 0


@pytest.mark.parametrize(
    "module",
    [("sparse", "_sparsetools", "csr_matvec", "csr_matvecs"), ("ndimage", "_nd_image", "euclidean_feature_transform")],
)
def test_scipy_has_what_is_taken_from_it_where_it_is_looked_for(module: tuple[str, ...]) -> None:
    """These are no public modules: a SciPy that moves one costs time, not bits."""
    assert compiled_scipy(*module) is not None
    assert compiled_scipy(*module, "what no module has") is None


def test_cells_are_as_far_from_cloth_as_scipy_has_it() -> None:
    filled = np.random.default_rng(3).random((12, 20, 9)) < 0.01
    assert np.array_equal(cells_off(filled), distance_transform_edt(~filled))


def test_the_product_is_loaded_without_the_package_around_it() -> None:
    code = (
        "import sys; from warp_cloth.base.row_sums import sparse_tools as s; print(s(), 'scipy.sparse' in sys.modules)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.split()[-1] == "False"


def test_a_product_that_rounds_once_is_found_out() -> None:
    class Fused:
        """As a build with fused multiply-add has it, of two entries: the second product is added unrounded."""

        @staticmethod
        def csr_matvec(rows: int, columns: int, starts: object, places: object, *held: np.ndarray) -> None:
            factors, values, sums = held
            high = factors[1] * values[1]
            sums += factors[0] * values[0] + high + 2.0**-60

        @staticmethod
        def csr_matvecs(rows: int, columns: int, count: int, *others: object) -> None:
            pass

    assert row_sums.is_fused(Fused())
