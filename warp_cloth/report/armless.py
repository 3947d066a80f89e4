"""Which openings of a garment a dress form or an armless mannequin has no limb for, so that they hang empty rightly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_cloth.avatar.openings import Opening
from warp_cloth.base.mesh import Points
from warp_cloth.report.judged import Judged

# Of the girth of a neckline: less of the body is above it on a dress form. A head is a third of it high, or more.
HEADLESS = 0.25
SLAB = 0.04  # [m], between heights at which a trunk's outline is read
# Of the widest of the shoulders above it: how far out a trunk's outline is at the waist, or farther in; 0.72 of a
# mannequin without arms. Arms that hang, grown together with it or not, are as far out there as the shoulders.
WAISTED = 0.85


def has_no_limb(judged: Judged, empty: Opening, own: Sequence[Opening]) -> bool:
    """Whether a body has no limb for an opening of a garment; where its limbs are not known, nothing is as far out.

    A dress form has no head, and nothing on the opening's side at its height or above. A mannequin with a head has
    nothing that far out on any side, and its outline narrows below the shoulder, where an arm would hang.
    """
    body, filled = judged.of.body, [opening for opening in own if opening.filled]
    wearing = judged.of.outfit.wearing[judged.index]
    if wearing is not None:
        pairs = zip(wearing.openings, wearing.limbs, strict=True)
        limbs = {limb for opening, limbs in pairs if empty.vertices[0] in opening.loop for limb in limbs}
        return bool(limbs) and limbs <= set(wearing.skeleton.lacks)
    if body is None or not filled:
        return False
    centres = [judged.points[opening.vertices].mean(axis=0) for opening in filled]
    neck, neckline = max(zip(centres, filled, strict=True), key=lambda pair: float(pair[0][1]))
    centre = judged.points[empty.vertices].mean(axis=0)
    height, out = body.points[:, 1], (centre - neck) * [1.0, 0.0, 1.0]
    level = body.points[height > centre[1] - empty.girth] - neck  # with it, or above
    if height.max() - neck[1] <= HEADLESS * neckline.girth:
        return bool((level @ out < out @ out).all())
    reach = np.linalg.norm(level[:, [0, 2]], axis=1)
    return bool((reach < np.linalg.norm(out)).all()) and _is_waisted(level, out)


def _is_waisted(level: Points, out: Points) -> bool:
    """Whether a trunk's outline on the side ``out`` narrows from the shoulder down.

    ``level``: its vertices about the middle of its neck [m], shape [N, 3].
    """
    below = level[level[:, 1] < 0.0]
    if not len(below) or not out.any():
        return False
    slab = (-below[:, 1] / SLAB).astype(np.int64)
    outline = np.full(slab.max() + 1, -np.inf)
    np.maximum.at(outline, slab, below @ out / np.linalg.norm(out))
    widest = np.maximum.accumulate(outline)
    return bool((np.isfinite(outline) & (outline < WAISTED * widest)).any())
