"""A plan as text and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from warp_cloth.export.files import unwritable, whole_file
from warp_cloth.model.plan import Term
from warp_cloth.study.footprint import Footprint
from warp_cloth.study.savings import Saving

COMPULSORY = "compulsory bytes: the sizes of all arrays that a launch takes, each counted once; not measured traffic"


def plan_lines(name: str, terms: Sequence[Term], cost: Footprint, savings: Sequence[Saving] = ()) -> list[str]:
    """Terms with their reasons, kernels with their costs, savings without a term, memory."""
    shared = f", {cost.threads} threads" if cost.threads > 1 else ""
    lines = [f"{name}: {cost.vertices:,} vertices on {cost.device}{shared}", "Terms:"]
    lines += [f"  {'+' if term.used else '-'} {term.name:<16} {term.reason}" for term in terms]
    lines.append(f"An iteration (mean over iterations {cost.iterations[0]:,} to {cost.iterations[1]:,}):")
    lines.append(f"  {'kernel':<24} {'launches':>8} {'threads':>10} {'MB':>9} {'us':>9} {'time':>6}")
    for kernel in cost.kernels:
        lines.append(
            f"  {kernel.name:<24} {kernel.launches:>8.3g} {kernel.threads:>10,} {1e-6 * kernel.bytes:>9.3f} "
            f"{1e6 * kernel.seconds:>9.1f} {cost.fraction(kernel):>6.0%}"
        )
    lines.append(
        f"  {'as a fit runs it':<24} {cost.launches:>8.3g} {'':>10} {1e-6 * cost.bytes:>9.3f} "
        f"{1e6 * cost.seconds:>9.1f}        {1e-9 * cost.bytes / cost.seconds:.3g} GB/s"
    )
    lines.append(f"  MB: {COMPULSORY}")
    if savings:
        lines.append("Time saved without:")
        lines += [
            f"  {each.term:<24} {'':>8} {'':>10} {'':>9} {1e6 * each.share * cost.seconds:>9.1f} {each.share:>6.0%}"
            for each in savings
        ]
    total = sum(cost.memory.values())
    parts = ", ".join(f"{what} {1e-6 * size:,.3g}" for what, size in cost.memory.items())
    lines.append(f"Memory: {1e-6 * total:,.3g} MB ({parts}), {total / cost.vertices:,.0f} bytes a vertex")
    return lines


def plan_values(terms: Sequence[Term], cost: Footprint, savings: Sequence[Saving] = ()) -> dict[str, Any]:
    """The same for JSON; bytes and seconds are of one iteration."""
    values = asdict(cost)
    for row, kernel in zip(values["kernels"], cost.kernels, strict=True):
        row["share"] = cost.fraction(kernel)
    return {
        "terms": [asdict(term) for term in terms],
        "bytes": cost.bytes,
        "bytes_meaning": COMPULSORY,
        "savings": [asdict(saving) for saving in savings],
        **values,
    }


def write_plan(path: Path, terms: Sequence[Term], cost: Footprint, savings: Sequence[Saving] = ()) -> None:
    """Writes the plan as JSON.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path, error) from None
    with whole_file(path) as place:
        place.write_text(json.dumps(plan_values(terms, cost, savings), indent=2) + "\n", encoding="utf-8")
