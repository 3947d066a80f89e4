"""Panels of a specification that are sewn to nothing, such as a pocket: they would fall off, and never rest."""

from __future__ import annotations

from dataclasses import replace

from warp_cloth.pattern.specification import Pattern, Side, short

SMALL = 0.15  # of the largest sewn panel's area; a scarf over a sewn garment is larger


def without_loose(pattern: Pattern) -> Pattern:
    """The pattern without small panels that no stitch names, where others are sewn; told in its notes."""
    sewn = {side.panel for stitch in pattern.stitches for side in stitch.sides}
    sewn |= {index for index, panel in enumerate(pattern.panels) if panel.cut_out}  # goes over the head, or has a dart
    least = SMALL * max((abs(pattern.panels[index].area) for index in sewn), default=0.0)
    kept = [index for index, panel in enumerate(pattern.panels) if index in sewn or not abs(panel.area) < least]
    if len(kept) == len(pattern.panels):
        return pattern
    number = {index: place for place, index in enumerate(kept)}
    stitches = []
    for stitch in pattern.stitches:
        one, other = (Side(number[side.panel], side.edge) for side in stitch.sides)
        stitches.append(replace(stitch, sides=(one, other)))
    loose = [panel.name for index, panel in enumerate(pattern.panels) if index not in number]
    told = [f'panel "{short(name)}" is sewn to nothing, and would fall off: left out' for name in loose]
    panels, notes = tuple(pattern.panels[index] for index in kept), (*pattern.notes, *told)
    return replace(pattern, panels=panels, stitches=tuple(stitches), notes=notes)
