"""Maps of finished fits, measured while the problem that they were relaxed in is there: pressure needs its forces."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from warp_cloth.fitting.problem import Problem
from warp_cloth.maps import map_summary, measure_maps
from warp_cloth.model.result import FitResult


def with_maps(result: FitResult, names: Sequence[str], problem: Problem, item: int = 0) -> FitResult:
    """The result of a problem's item with these maps, in its garments' fields and in the report too."""
    forces = problem.certifier.normal_forces() if "pressure" in names else None
    own = None if forces is None else forces[problem.model.of_item(item)]
    ends = list(itertools.accumulate((len(worn.points) for worn in result.garments), initial=0))
    garment_names = [worn.name for worn in result.garments]
    maps = measure_maps(
        names,
        garments=problem.outfits[item].garments,
        worn=[worn.points for worn in result.garments],
        normal_forces=None if own is None else [own[first:last] for first, last in itertools.pairwise(ends)],
        avatar=problem.avatar_surfaces()[item],
        garment_names=garment_names,
        device=result.device,
    )
    garments = tuple(
        replace(worn, fields={**worn.fields, **values})
        for worn, values in zip(result.garments, maps.fields, strict=True)
    )
    report = {**result.report, "maps": map_summary(maps, garment_names)}
    if maps.notes:
        report["map_notes"] = list(maps.notes)
    return replace(result, garments=garments, report=report, maps=maps)
