"""Many fits: tables of jobs, worker processes or a Ray cluster, results that survive being killed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from warp_cloth.batch.jobs import Item, read_jobs
    from warp_cloth.batch.many import fit_many
    from warp_cloth.batch.run import BatchReport, run_batch
    from warp_cloth.batch.sizes import SizeRun, fit_sizes

__all__ = ["BatchReport", "Item", "SizeRun", "fit_many", "fit_sizes", "read_jobs", "run_batch"]

_HOMES = {
    "BatchReport": "run",
    "Item": "jobs",
    "SizeRun": "sizes",
    "fit_many": "many",
    "fit_sizes": "sizes",
    "read_jobs": "jobs",
    "run_batch": "run",
}


def __getattr__(name: str) -> Any:
    """Imports a public name when it is first used: a fit needs no tables, a job file no solver."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
