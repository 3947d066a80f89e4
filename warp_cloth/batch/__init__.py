"""Many fits: tables of jobs, worker processes or a Ray cluster, results that survive being killed."""

from warp_cloth.batch.drive import BatchReport, run_batch
from warp_cloth.batch.jobs import Item, read_jobs

__all__ = ["BatchReport", "Item", "read_jobs", "run_batch"]
