"""Iterations that several threads of the host run side by side, each of its domain; the same bits as of one thread."""

from __future__ import annotations

import concurrent.futures
import ctypes
import os
import time
from collections.abc import Callable, Sequence
from typing import Any

import warp as wp

from warp_cloth.base.collector import no_collection
from warp_cloth.base.threads import core_count
from warp_cloth.kernels.base.options import Accumulate
from warp_cloth.kernels.base.types import cloth_types
from warp_cloth.kernels.passes.domains import APART, NAP, domain_kernels, meet_threads
from warp_cloth.model.model import ClothModel
from warp_cloth.solver.anisotropic_step import AnisotropicStep, ScatteredUpdate
from warp_cloth.solver.domains import Domain, cut_model
from warp_cloth.solver.forces import ForcePass, pass_size

LEAST = 1500  # vertices of a domain: with fewer, starting and waiting take as long as they save
MOST = 8  # threads, where none are asked for
PATIENCE = 120.0  # [s] at least that a thread waits for another one, for what takes milliseconds
AT_WORK = 2 / 3  # share of the time that threads must have their cores, or they wait for each other in vain
LONGEST_PAUSE = 64  # bursts


def thread_count(asked: int | None, vertex_count: int) -> int:
    """How many threads iterate so many vertices on a CPU; ``asked`` at most, None: as many as are worth their while."""
    if os.name != "posix":
        return 1
    return max(1, min(MOST if asked is None else asked, core_count(), vertex_count // LEAST))


class ParallelDomains:
    """The domains of a relaxation's model, and the threads that iterate them.

    Between bursts of iterations the model has everything: each burst copies domains from it first, and back at last.
    """

    def __init__(
        self,
        model: ClothModel,
        count: int,
        accumulate: Accumulate,
        move: wp.Kernel,
        anisotropic_step: AnisotropicStep | None,
        add_contact: Callable[[int], None] | None = None,
    ) -> None:
        """``add_contact`` launches contact of cloth with cloth before an iteration of a burst, of all vertices."""
        self._model, self._move, self._anisotropic_step = model, move, anisotropic_step
        self._add_contact = add_contact
        updates = anisotropic_step is not None and anisotropic_step.scatters
        self._kernels = domain_kernels(model.precision)
        self._domains = [_Working(domain, accumulate, updates=updates) for domain in cut_model(model, count)]
        self._arrivals = wp.zeros(APART * (1 + count), dtype=wp.int32, device=model.device)
        self._usleep = ctypes.cast(ctypes.CDLL(None).usleep, ctypes.c_void_p).value
        self._pool = concurrent.futures.ThreadPoolExecutor(count - 1)
        self._pause = Pause()
        self._others: list[concurrent.futures.Future[float]] = []  # of the last burst that was iterated together
        self._at_work, self._seconds = 0.0, 0.0  # of this thread in it

    @property
    def count(self) -> int:
        """How many threads."""
        return len(self._domains)

    @property
    def updates_first(self) -> bool:
        """Whether compliances are updated by one thread, before a burst of iterations only."""
        return self._anisotropic_step is not None and not self._anisotropic_step.scatters

    def kernels(self) -> list[wp.Kernel]:
        """The kernels that a burst launches besides those of one thread."""
        shown = [] if self._add_contact is None else [self._kernels.show_domain]
        return [self._kernels.gather_domain, meet_threads, self._kernels.scatter_domain, *shown]

    def capture(self, arguments: Sequence[Any], updates: Sequence[bool]) -> list[Any]:
        """A graph of iterations for every domain; ``updates``: before which of them compliances are updated.

        ``arguments`` are those of the kernel that moves vertices, besides the cloth.
        """
        graphs = []
        for number in range(self.count):
            with no_collection(), wp.ScopedCapture(device=self._model.device) as capture:
                self._iterate(number, arguments, updates)
            graphs.append(capture.graph)
        return graphs

    def _iterate(self, number: int, arguments: Sequence[Any], updates: Sequence[bool]) -> None:
        """Launches iterations of a domain; the first one's thread also has contact of cloth with cloth."""
        step = arguments[0]
        working, model, device = self._domains[number], self._model, self._model.device
        domain, size = working.domain, len(working.domain.order)
        gathered, scattered = [model.state, domain.order, domain.state], [domain.state, domain.order, model.state]
        if self.updates_first and updates[0]:
            if self._anisotropic_step is not None and number == 0:
                self._anisotropic_step.update(model.vertices, model.state, step)
            self._meet(number)
        wp.launch(self._kernels.gather_domain, dim=size, inputs=gathered, device=device)
        self._meet(number)
        for iteration, updates_now in enumerate(updates):
            if self._add_contact is not None and number == 0:
                self._add_contact(iteration)
            if updates_now and working.update is not None:
                whole = domain.model.vertices, domain.model.state, step
                working.update.launch(*whole, (domain.vertices, domain.state))
            working.forces.launch(step)
            self._meet(number)
            inputs = [domain.vertices, domain.state, *arguments, domain.order, working.load]
            wp.launch(self._move, dim=pass_size(size, True), inputs=inputs, device=device)
            if self._add_contact is not None:
                wp.launch(self._kernels.show_domain, dim=size, inputs=scattered, device=device)
            self._meet(number)
        wp.launch(self._kernels.scatter_domain, dim=size, inputs=scattered, device=device)
        self._meet(number)

    def _meet(self, number: int) -> None:
        inputs = [number, self._usleep, round(PATIENCE / (1e-6 * NAP)), self._arrivals]
        wp.launch(meet_threads, dim=1, inputs=inputs, device=self._model.device)

    def pays(self) -> bool:
        """Whether the next burst is to be iterated together: not for a while where cores were busy with other work."""
        self._end()
        return self._pause.over()

    def run(self, graphs: Sequence[Any]) -> None:
        """Replays the graphs of the domains side by side; they end with a meeting, so that none is waited for here."""
        self._check()
        began = time.perf_counter()
        try:
            for graph in graphs[1:]:
                self._others.append(self._pool.submit(self._replay, graph))
            self._at_work = self._replay(graphs[0])
        except BaseException:
            self._give_up()
            concurrent.futures.wait(self._others)
            raise
        self._seconds = time.perf_counter() - began
        self._check()

    def _replay(self, graph: Any) -> float:
        """Replays a graph; the seconds that its thread had a core."""
        began = time.thread_time()
        try:
            wp.capture_launch(graph)
        except BaseException:
            self._give_up()
            raise
        return time.thread_time() - began

    def _give_up(self) -> None:
        """Lets nobody wait for what does not come."""
        self._arrivals.numpy()[0] = 1

    def _check(self) -> None:
        if self._arrivals.numpy()[0]:
            for other in self._others:
                other.result()  # raises what went wrong there
            raise RuntimeError(f"a thread waited {PATIENCE:.0f} s for another one; set solver.threads = 1")

    def _end(self) -> None:
        """Looks at how the last burst went, whose threads have ended by now."""
        if self._others:
            at_work = self._at_work + sum(other.result() for other in self._others)
            self._others.clear()
            self._pause.tell(at_work / (self.count * self._seconds))


class Pause:
    """When threads go together again that had to wait for each other: a pause twice as long each time that they do."""

    def __init__(self) -> None:
        self._left, self._next = 0, 1

    def over(self) -> bool:
        """Whether they are to go together now; else one burst less is left of the pause."""
        self._left = max(self._left - 1, -1)
        return self._left < 0

    def tell(self, at_work: float) -> None:
        """Notes what share of the time the threads had their cores."""
        if at_work >= AT_WORK:
            self._next = max(self._next // 2, 1)
        else:
            self._left, self._next = self._next, min(2 * self._next, LONGEST_PAUSE)


class _Working:
    """What a thread needs to iterate its domain."""

    def __init__(self, domain: Domain, accumulate: Accumulate, *, updates: bool) -> None:
        model = domain.model
        load = wp.zeros(model.vertex_count, dtype=cloth_types(model.precision).vec4, device=model.device)
        self.domain = domain
        self.load = load[domain.span]
        self.forces = ForcePass(model, accumulate, load)
        self.update = ScatteredUpdate(model, domain.span) if updates else None
