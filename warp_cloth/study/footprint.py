"""What an iteration costs: kernels, launches, compulsory bytes, memory and time, all from the objects that run it."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, fields

from warp_cloth.contact.crossing import search_bytes
from warp_cloth.fitting.problem import Problem
from warp_cloth.garment.outfit import Outfit
from warp_cloth.solver.certificate.strains import strain_bytes
from warp_cloth.study.launches import Launch, arrays_in, bytes_of
from warp_cloth.study.timing import Times, times_of

SEARCH_CHECK = "search_if_due"  # not a kernel: a conditional node of the captured graph


@dataclass(frozen=True)
class KernelCost:
    """One kernel's part of an iteration."""

    name: str
    purpose: str
    launches: float  # per iteration
    threads: int
    bytes: float  # per iteration: compulsory, see compulsory_bytes
    seconds: float  # per iteration, from its start to that of the next launch


@dataclass(frozen=True)
class Footprint:
    """What one iteration launches, moves and takes, and the memory that a scene holds."""

    device: str
    vertices: int
    kernels: tuple[KernelCost, ...]
    launches: float  # per iteration
    seconds: float  # of an iteration as a fit runs it, captured
    threads: int  # CPU threads that share it
    iterations: tuple[int, int]  # timed from, to
    memory: dict[str, int]  # [bytes] by use

    @property
    def bytes(self) -> float:
        """Compulsory bytes of an iteration."""
        return sum(kernel.bytes for kernel in self.kernels)

    def fraction(self, kernel: KernelCost) -> float:
        """A kernel's fraction of the time."""
        return kernel.seconds / max(sum(other.seconds for other in self.kernels), 1e-30)


def footprint_of(problem: Problem) -> Footprint:
    """Runs and times some hundreds or thousands of iterations from the start; the cloth has moved afterwards."""
    model = problem.model
    times = times_of(problem)
    kernels = [_cost(launch, times) for launch in times.launches]
    if times.search_check:
        purpose = "Decides whether to search for cloth near cloth again."
        kernels.append(KernelCost(SEARCH_CHECK, purpose, times.search_checks, 1, 0.0, times.search_check))
    return Footprint(
        device=model.device,
        vertices=model.vertex_count,
        kernels=tuple(kernels),
        launches=sum(kernel.launches for kernel in kernels),
        seconds=times.seconds,
        threads=problem.relaxation.thread_count,
        iterations=(times.begin, times.end),
        memory=memory_of(problem),
    )


def _cost(launch: Launch, times: Times) -> KernelCost:
    key = launch.kernel.key
    launches = times.count[key]
    return KernelCost(
        name=key.rpartition("__")[2],
        purpose=(inspect.getdoc(launch.kernel.func) or "").partition("\n")[0],
        launches=launches,
        threads=launch.threads,
        bytes=compulsory_bytes(launch) * launches,
        seconds=times.spent[key],
    )


def compulsory_bytes(launch: Launch) -> int:
    """Sum of the sizes of the arrays that a launch takes as inputs and outputs, each counted once [bytes].

    It is what would move if nothing were cached between launches and everything within one. Lists count with all their
    capacity, and arrays of a struct whether or not the kernel uses them; tables of more than one dimension, which are
    sampled at places (the avatar's distance field), do not count. tests/benchmarks/traffic.py measures real traffic.
    """
    return bytes_of([array for array in launch.arrays().values() if array.ndim == 1])


def memory_of(problem: Problem) -> dict[str, int]:
    """Bytes of the arrays that a scene holds on its device: of the avatar, of the cloth, more for the checks.

    The report's are allocated at the end, in addition; of snapshots the largest number counts.
    """
    avatar = arrays_in(problem.contacts)
    cloth = arrays_in([getattr(problem, garment.name) for garment in fields(problem) if garment.name != "certifier"])
    whole = bytes_of(arrays_in(problem))
    now, most = problem.certifier.snapshot_bytes
    return {
        "cloth": bytes_of(cloth) - bytes_of(avatar),
        "avatar": bytes_of(avatar),
        "checks": whole - bytes_of(cloth) - now + most,
        "report": max(strain_bytes(problem.model), *(_crossing_bytes(outfit) for outfit in problem.outfits)),
    }


def _crossing_bytes(outfit: Outfit) -> int:
    garments = outfit.garments
    sizes = [(len(garment.points), len(garment.rest.topology.edges), len(garment.triangles)) for garment in garments]
    return search_bytes(*(sum(column) for column in zip(*sizes, strict=True)))
