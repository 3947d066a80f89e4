"""Shares of the cloth that threads of the host iterate side by side: taken, given back, and waited for.

A launch on the CPU takes one thread. So each thread has launches of its own, of its vertices and of the edges and
triangles around them; what threads need of each other are positions and displacements, which change at one moment.
"""

import functools
from types import SimpleNamespace

import warp as wp

from warp_cloth.kernels.base.types import MODULE_OPTIONS, cloth_types

APART = 16  # numbers of four bytes from one thread's counter to the next one's: they share no line of a cache
SPINS = 6000  # looks at another's counter before this thread leaves its core to whatever else wants it
NAP = 50  # [us] from look to look then

_WAIT = """
    int* const gave_up = arrivals.data;
    int* const counters = arrivals.data + %(apart)d;
    const int count = arrivals.shape[0] / %(apart)d - 1;
    if (__atomic_load_n(gave_up, __ATOMIC_RELAXED))
        return;
    const unsigned now = 1u + (unsigned)counters[%(apart)d * number];
    __atomic_store_n(&counters[%(apart)d * number], (int)now, __ATOMIC_RELEASE);
    for (int other = 0; other < count; ++other) {
        int looks = 0;
        while ((int)((unsigned)__atomic_load_n(&counters[%(apart)d * other], __ATOMIC_ACQUIRE) - now) < 0) {
            if (++looks < %(spins)d) {
#if defined(__x86_64__)
                __builtin_ia32_pause();
#endif
            } else if (looks - %(spins)d < naps && !__atomic_load_n(gave_up, __ATOMIC_RELAXED)) {
                reinterpret_cast<void (*)(unsigned)>(usleep)(%(nap)du);
            } else {
                __atomic_store_n(gave_up, 1, __ATOMIC_RELAXED);
                return;
            }
        }
    }
"""


@wp.func_native(_WAIT % {"apart": APART, "spins": SPINS, "nap": NAP})
def wait_for_all(arrivals: wp.array(dtype=wp.int32), number: int, usleep: wp.uint64, naps: int):
    """Goes on when all threads have come as often as this one; takes no part where one has given up."""
    arrivals[number] = arrivals[number] + 1


@wp.kernel(module="unique", module_options=MODULE_OPTIONS)
def meet_threads(
    number: int,  # of this thread
    usleep: wp.uint64,  # where the system has that function
    naps: int,  # before this thread gives up
    arrivals_out: wp.array(dtype=wp.int32),  # whether one gave up, and how often each came; APART apart
):
    """Waits till all threads have written what the others read next."""
    wait_for_all(arrivals_out, number, usleep, naps)


@functools.cache
def domain_kernels(precision: str) -> SimpleNamespace:
    """Kernels ``gather_domain``, ``scatter_domain`` and ``show_domain``, which copy what iterations change."""
    State = cloth_types(precision).State

    @wp.func
    def copy_vertex(state: State, vertex: int, state_out: State, place: int):
        """Copies what iterations change of a vertex."""
        state_out.position[place] = state.position[vertex]
        state_out.displacement[place] = state.displacement[vertex]
        state_out.stiffness[place] = state.stiffness[vertex]
        if state.compliance.shape[0] > 0:
            state_out.compliance[place] = state.compliance[vertex]
        if state.in_contact.shape[0] > 0:
            state_out.in_contact[place] = state.in_contact[vertex]
        if state.clearance.shape[0] > 0:
            state_out.clearance[place] = state.clearance[vertex]

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def gather_domain(
        state: State,  # of all vertices
        order: wp.array(dtype=wp.int32),  # the domain's vertices
        domain_out: State,
    ):
        """Copies the vertices of a domain to where they lie together."""
        copy_vertex(state, order[wp.tid()], domain_out, wp.tid())

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def scatter_domain(
        domain: State,
        order: wp.array(dtype=wp.int32),
        state_out: State,  # of all vertices
    ):
        """Copies them back."""
        copy_vertex(domain, wp.tid(), state_out, order[wp.tid()])

    @wp.kernel(module="unique", module_options=MODULE_OPTIONS)
    def show_domain(
        domain: State,
        order: wp.array(dtype=wp.int32),
        state_out: State,  # of all vertices
    ):
        """Copies back where they are and how they moved, which contact of cloth with cloth reads."""
        vertex, place = order[wp.tid()], wp.tid()
        state_out.position[vertex] = domain.position[place]
        state_out.displacement[vertex] = domain.displacement[place]

    return SimpleNamespace(gather_domain=gather_domain, scatter_domain=scatter_domain, show_domain=show_domain)
