"""Is a garment with sleeves wide enough for the trunk? Its longest ring below the armholes, and the body's chest.

Wherever else it starts it is not: its sleeves keep it at the chest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_cloth.anatomy.figure import Figure
from warp_cloth.anatomy.geodesics import Floats
from warp_cloth.anatomy.linking import SLEEVED, Wearing
from warp_cloth.anatomy.skeleton import HEAD
from warp_cloth.anatomy.tape import Plane
from warp_cloth.base.mesh import Indices, Mesh
from warp_cloth.base.section import encloses

# What the longest ring round the trunk must stretch by to go round the chest. Of 82 designs worn in the size that they
# were drafted in, one is 21 % narrower than its body, which is a strain of 0.27; the others are wider.
NARROW = 0.3
LEVELS = 9  # from the waist to the chest, at which a garment is measured


@dataclass(frozen=True, eq=False)
class TrunkGirth:
    """Round the chest."""

    garment: float  # its longest ring from waist to chest, as cut [m]
    body: float  # a tape round the chest [m]
    vertices: Indices  # of that ring, shape [N]

    @property
    def strain(self) -> float:
        """What the garment has to stretch by, if that is more than 0."""
        return self.body / self.garment - 1.0

    @property
    def is_narrow(self) -> bool:
        """Whether the garment is too narrow to be worn, wherever it starts."""
        return self.strain > NARROW


def trunk_girth(wearing: Wearing, flat: Floats, body: Mesh) -> TrunkGirth | None:
    """A garment's girth at the trunk; None: it has no neckline or sleeves, or no ring round the chest as it starts.

    Args:
        wearing: its openings on the body.
        flat: corners of its triangles as cut [m], shape [F, 3, 2].
        body: what wears it.
    """
    if not all(limbs in wearing.limbs for limbs in SLEEVED) or not any(HEAD in limbs for limbs in wearing.limbs):
        return None
    figure = Figure.of(body, wearing.skeleton)
    chest, waist = figure.levels.get("chest"), figure.levels.get("waist")
    if chest is None or waist is None:
        return None
    heights = np.linspace(chest.height, waist.height, LEVELS).tolist()
    rings = [_ring_at(height, wearing, flat, figure) for height in heights]
    if rings[0] is None:
        return None
    longest, vertices = max((ring for ring in rings if ring is not None), key=lambda ring: ring[0])
    return TrunkGirth(longest, figure.tape_at(chest).length, vertices)


def _ring_at(height: float, wearing: Wearing, flat: Floats, figure: Figure) -> tuple[float, Indices] | None:
    """The longest ring round the spine at a height in the figure's frame: as cut [m], and its vertices, shape [N].

    Sleeves that join it there are part of it.
    """
    left, up, forward = figure.frame
    section = Plane(up * height, np.stack([left, forward]), up).section(wearing.onto, wearing.triangles)
    (spine,) = wearing.skeleton.spine_at(up[None] * height)
    middle = np.array([spine @ left, spine @ forward])
    found = []
    for part in set(range(section.part_count)) - section.open_parts:
        own = section.part == part
        if encloses(section.ends[own], middle):
            found.append((section.length_on(flat, own), wearing.triangles[section.faces[own]].ravel()))
    return max(found, key=lambda ring: ring[0], default=None)
