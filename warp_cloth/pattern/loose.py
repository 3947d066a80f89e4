"""Panels of a specification that are sewn to nothing, such as a pocket: they would fall off, and never rest."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

from warp_cloth.pattern.specification import Pattern, Side, short

SMALL = 0.15  # of the largest sewn panel's area; a scarf over a sewn garment is larger


def without_loose(pattern: Pattern) -> Pattern:
    """The pattern without small panels that no stitch names, where others are sewn; told in its notes."""
    sewn = {side.panel for stitch in pattern.stitches for side in stitch.sides}
    sewn |= {index for index, panel in enumerate(pattern.panels) if panel.cut_out}  # goes over the head, or has a dart
    least = SMALL * max((abs(pattern.panels[index].area) for index in sewn), default=0.0)
    loose = {index for index, panel in enumerate(pattern.panels) if index not in sewn and abs(panel.area) < least}
    if not loose:
        return pattern
    names = [pattern.panels[index].name for index in sorted(loose)]
    told = [f'panel "{short(name)}" is sewn to nothing, and would fall off: left out' for name in names]
    return replace(without_panels(pattern, loose), notes=(*pattern.notes, *told))


def without_panels(pattern: Pattern, gone: Set[int]) -> Pattern:
    """The pattern without panels that no stitch names."""
    kept = [index for index in range(len(pattern.panels)) if index not in gone]
    number = {index: place for place, index in enumerate(kept)}
    stitches = []
    for stitch in pattern.stitches:
        one, other = (Side(number[side.panel], side.edge) for side in stitch.sides)
        stitches.append(replace(stitch, sides=(one, other)))
    return replace(pattern, panels=tuple(pattern.panels[index] for index in kept), stitches=tuple(stitches))
