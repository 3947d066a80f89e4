"""Updates from time to time how much further vertices may go where hardly anything resists: the anisotropic step."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from warp_cloth.base.mesh import Indices
from warp_cloth.base.threads import map_in_threads
from warp_cloth.base.topology import ragged_rows
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.math.lanes import WIDTH
from warp_cloth.kernels.passes.anisotropic_step import compliance_kernels
from warp_cloth.kernels.passes.anisotropic_step_packets import packet_compliance_kernels
from warp_cloth.kernels.passes.scatter import edges_kernel
from warp_cloth.model.model import ClothModel
from warp_cloth.model.permutation import Permutation
from warp_cloth.model.upload import upload_concatenated
from warp_cloth.solver.active_set import ActiveSet
from warp_cloth.solver.forces import NormalsPass, pass_size, takes_packets


class AnisotropicStep:
    """Owns what an update of the state's compliance needs."""

    def __init__(
        self,
        model: ClothModel,
        permutation: Permutation | None = None,
        *,
        packed: bool = False,
        active_set: ActiveSet | None = None,
    ) -> None:
        """``permutation``: of the vertices of the cloth whose compliance it updates; None: the model's own.

        ``packed``: whether its positions and compliances are packed (kernels.patches.packing). ``active_set``: what is
        updated where it is not scattered; None: all.
        """
        self._model, types = model, cloth_types(model.precision)
        compliance = model.state.compliance
        none = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        self._none = [(compliance, none)]  # by components: of a vertex whose step is isotropic
        if packed:
            fours, twos = (
                wp.array(
                    ptr=compliance.ptr + first, dtype=dtype, shape=compliance.shape, device=model.device, copy=False
                )
                for first, dtype in ((0, types.vec4), (4 * types.real_size * len(compliance), types.vec2))
            )
            self._none = [(fours, none[:4]), (twos, none[4:])]
        self.forget(range(model.item_count))
        terms = model.terms
        own = terms.edges or terms.angles or terms.hysteresis or terms.shear_hysteresis
        scatters = model.patches is None and terms.yarns and not own
        packets = scatters and takes_packets(model, min(model.triangle_count, model.edge_count))
        self._update: _GatheredUpdate | ScatteredUpdate = (
            ScatteredUpdate(model) if packets else _GatheredUpdate(model, permutation, packed, active_set)
        )

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that an update launches, in order."""
        return self._update.kernels()

    @property
    def scatters(self) -> bool:
        """Whether an update adds to vertices triangle by triangle, which can be shared out."""
        return isinstance(self._update, ScatteredUpdate)

    def forget(self, items: Sequence[int]) -> None:
        """Makes the steps of these items' vertices isotropic until the next update."""
        some, starts = np.sort(np.asarray(items, dtype=np.int64)), self._model.item_start
        for run in np.split(some, np.flatnonzero(np.diff(some) != 1) + 1):  # neighbours in one go
            for part, none in self._none if len(run) else []:
                part[starts[run[0]] : starts[run[-1] + 1]].fill_(none)

    def update(self, vertices: Any, state: Any, step: Any) -> None:
        """Updates the compliance of the cloth as it lies; a Model, a State and a Step of kernels.base.types."""
        self._update.launch(vertices, state, step)


class _GatheredUpdate:
    """An update that sums at each vertex what bounds its step."""

    def __init__(
        self,
        model: ClothModel,
        permutation: Permutation | None = None,
        packed: bool = False,
        active_set: ActiveSet | None = None,
    ) -> None:
        types, terms = cloth_types(model.precision), model.terms
        self._model, self._active_set = model, active_set or ActiveSet(model)
        self._kernels = compliance_kernels(model.precision, terms, packed, in_order=permutation is not None)
        self._permutation = permutation or Permutation(None, model.vertex_count)
        self._edges, self._triangles = model.edges, model.triangles
        self._numbers: list[wp.array] = []
        if permutation is not None:
            self._edges = self._numbered(types.Edges, model.edges, "ends", wp.vec2i)
            self._triangles = self._numbered(types.Triangles, model.triangles, "corners", wp.vec3i)
        self._normals = NormalsPass(model, packed=packed, some=self._active_set.triangles) if terms.folds else None
        edges = model.edge_count if terms.folds else 0
        self._bound = wp.empty(edges, dtype=types.real, device=model.device)
        self._rows = types.Rows()
        if terms.edges:
            ends = [garment.ends for garment in model.garments]
            self._rows.edge_start, self._rows.edge = self._rows_of(ends, lambda entries: entries // 2, 2)
        if terms.folds or terms.yarns:
            corners = [garment.corners for garment in model.garments]
            self._rows.triangle_start, self._rows.triangle = self._rows_of(corners)

    def _rows_of(
        self, tables: Sequence[Indices], value: Callable[[Indices], Indices] = lambda entries: entries, each: int = 1
    ) -> tuple[wp.array, wp.array]:
        """Where each vertex's entries start, and the ``value`` of each entry, of the garments' tables end to end.

        ``each``: how many entries have the same value.
        """
        own = [self._permutation.part(*ends) for ends in itertools.pairwise(self._model.vertex_start)]
        keys = [(id(table), part.key) for table, part in zip(tables, own, strict=True)]
        distinct = dict(zip(keys, zip(tables, own, strict=True), strict=True))

        def rows(garment: tuple[Indices, Permutation]) -> tuple[Indices, Indices]:
            table, part = garment
            start, order = ragged_rows(table.ravel(), part.count)
            start, entries = part.lists(start, order.astype(np.int32))
            return start[:-1].astype(np.int32), value(entries)

        sorted_once = dict(zip(distinct, map_in_threads(rows, distinct.values()), strict=True))
        starts, orders = zip(*(sorted_once[key] for key in keys), strict=True)
        first = np.cumsum([0, *(len(order) for order in orders)])
        upload = partial(upload_concatenated, dtype=wp.int32, device=self._model.device)
        end = np.zeros(1, dtype=np.int32)
        return upload([*starts, end], starts=first.tolist()), upload(orders, starts=(first // each).tolist())

    def _numbered(self, kind: Any, elements: Any, name: str, dtype: Any) -> Any:
        """The model's edges or triangles by other numbers of their vertices."""
        found, given, device = kind(), getattr(elements, name), self._model.device
        for each in kind.vars:
            setattr(found, each, getattr(elements, each))
        size = wp.types.type_size_in_bytes(dtype) // wp.types.type_size_in_bytes(wp.int32)
        flat = wp.array(ptr=given.ptr, dtype=wp.int32, shape=size * len(given), device=device)
        numbers = wp.array(self._permutation.rank, dtype=wp.int32, device=device)[flat].contiguous()
        setattr(found, name, wp.array(ptr=numbers.ptr, dtype=dtype, shape=given.shape, device=device))
        self._numbers.append(numbers)  # which that lies in
        return found

    def kernels(self) -> list[wp.Kernel]:
        folds = [self._normals.kernel, self._kernels.bound_folds] if self._normals is not None else []
        return [*folds, self._kernels.find_compliance]

    def launch(self, vertices: Any, state: Any, step: Any) -> None:
        device, active_set = self._model.device, self._active_set
        if self._normals is not None:
            self._normals.launch(vertices, state, self._triangles)
            edges = active_set.edges
            read = [vertices, state, edges.groups, self._edges, self._normals.normal, step, self._bound]
            wp.launch(self._kernels.bound_folds, dim=edges.size, inputs=read, device=device)
        some = active_set.vertices
        read = [vertices, state, some.groups, self._edges, self._triangles, self._rows, self._bound, step]
        wp.launch(self._kernels.find_compliance, dim=some.size, inputs=read, device=device)


class ScatteredUpdate:
    """An update of woven cloth, or a ``span`` of it, that adds eight triangles' bounds at a time to their corners'."""

    def __init__(self, model: ClothModel, span: slice = slice(None)) -> None:
        types, terms = cloth_types(model.precision), model.terms
        self._model = model
        self._kernels = packet_compliance_kernels(model.precision, terms)
        self._normals = NormalsPass(model) if terms.folds else None
        # they only bend: nothing is added
        self._edges = edges_kernel(model.precision, Accumulate.ANISOTROPIC_STIFFNESS, terms, WIDTH)
        edges = model.edge_count if terms.folds else 0
        self._fold = wp.empty(edges, dtype=types.vec4, device=model.device)
        self._bounds = [wp.zeros(model.vertex_count, dtype=types.vec4, device=model.device) for _ in range(2)]
        self._own_bounds = [bounds[span] for bounds in self._bounds]

    def kernels(self) -> list[wp.Kernel]:
        folds = [self._normals.kernel, self._edges] if self._normals is not None else []
        return [*folds, self._kernels.begin_bounds, self._kernels.sum_bounds, self._kernels.take_bounds]

    def launch(self, vertices: Any, state: Any, step: Any, own: tuple[Any, Any] | None = None) -> None:
        """Launches it; ``own``: Model and State of the span alone, where that is not all."""
        model, device, kernels = self._model, self._model.device, self._kernels
        if self._normals is not None:
            self._normals.launch(vertices, state)
            inputs = [vertices, state, model.edges, self._normals.normal, step, self._fold, self._bounds[0]]
            wp.launch(self._edges, dim=pass_size(model.edge_count, True), inputs=inputs, device=device)
        (own_vertices, own_state), count = own or (vertices, state), len(self._own_bounds[0])
        begun = [own_vertices, *self._own_bounds]
        wp.launch(kernels.begin_bounds, dim=count, inputs=begun, device=device)
        inputs = [vertices, state, model.triangles, self._fold, step, *self._bounds]
        wp.launch(kernels.sum_bounds, dim=pass_size(model.triangle_count, True), inputs=inputs, device=device)
        wp.launch(kernels.take_bounds, dim=count, inputs=[own_vertices, own_state, *self._own_bounds], device=device)
