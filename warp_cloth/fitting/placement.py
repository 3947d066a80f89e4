"""Which limbs of the body pass through a scene's garments, and how."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from warp_cloth.anatomy.linking import Misplaced
from warp_cloth.anatomy.openings import Limbs
from warp_cloth.base.mesh import Points
from warp_cloth.garment.outfit import Outfit


@dataclass(frozen=True, eq=False)
class LimbPlacement:
    """A scene's garments at a shape, and the limbs of their body."""

    misplaced: tuple[tuple[Misplaced, ...], ...] = ()  # openings of each garment that the wrong limbs pass through
    pierced: bool = False  # whether cloth runs through the middle of a limb
    sunk: bool = False  # whether a garment has slid down from the waist
    off_shoulders: tuple[Limbs, ...] = ()  # arms whose shoulder each garment has slipped off

    @property
    def is_astray(self) -> bool:
        """Whether a limb is outside its opening, or within the cloth."""
        return self.pierced or any(self.misplaced)

    @property
    def slipped(self) -> bool:
        """Whether a garment has slipped off a shoulder."""
        return any(self.off_shoulders)

    @classmethod
    def of(cls, outfit: Outfit, points: Points) -> LimbPlacement:
        """With the garments at these points [m], all finite, shape [V, 3]; garments without openings have none."""
        misplaced: list[tuple[Misplaced, ...]] = []
        off_shoulders: list[Limbs] = []
        pierced, sunk, first = False, False, 0
        for garment, wearing in zip(outfit.garments, outfit.wearing, strict=True):
            own = points[first : first + len(garment.points)]
            first += len(garment.points)
            if wearing is None:
                misplaced.append(())
                off_shoulders.append(())
                continue
            misplaced.append(tuple(wearing.misplaced(own)))
            pierced = pierced or bool(wearing.pierced(own))
            sunk = sunk or wearing.sunk(own)
            off_shoulders.append(wearing.off_shoulders(own))
        return cls(tuple(misplaced), pierced, sunk, tuple(off_shoulders))


def measure_starts(outfits: Iterable[Outfit]) -> None:
    """Measures where garments start on their bodies, once for all items that share a garment and a body.

    It is two thirds of what ``LimbPlacement.of`` and a scene's problems take, and copies of this process would each
    measure it again.
    """
    for wearing in dict.fromkeys(own for outfit in outfits for own in outfit.wearing if own is not None):
        wearing.measure_start()
