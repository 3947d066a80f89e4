"""The first table of seams of a pattern that states none, as a scene file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from warp_cloth.base.toml_file import toml_text
from warp_cloth.pattern.draft import Part
from warp_cloth.pattern.drafted import Draft
from warp_cloth.pattern.joints import Joint, side_text
from warp_cloth.pattern.kinds import BOTH, PLACES
from warp_cloth.pattern.proposal import SEWN_FROM
from warp_cloth.pattern.sleeves import sleeve_side


def place_of(parts: Sequence[Part], index: int) -> str | None:
    """The place of a part as a scene states it; None: unknown."""
    part = parts[index]
    side = sleeve_side(parts, index) if part.kind == "sleeve" else part.side
    names = [name for name, (kind, of) in PLACES.items() if kind == part.kind and of in (side, BOTH)]
    exact = [name for name in names if PLACES[name][1] == side]
    return next(iter([*exact, *names]), None)


def seam_table(draft: Draft, file: Path, folder: Path, allowance: float) -> str:
    """A scene file with the places of all pieces and the seams, each with its confidence, for people to go on from.

    Args:
        draft: of ``file``.
        file: the pattern; it is named relative to ``folder``, where the scene will be.
        folder: see ``file``.
        allowance: seam allowance that the draft was read with [m].
    """
    pattern_file = _relative(file, folder)
    head = f"""\
# Places and seams as proposed, each seam with its confidence. What you state here is sewn as it stands: check it
# against the drawing. An edge is "PIECE NUMBER"; edges that follow each other are joined by +, in the order in which
# they meet the other side.
[garment]
pattern = {toml_text(pattern_file)}
"""
    head += f"size = {toml_text(draft.size)}\n" if len(draft.sizes) > 1 else ""
    head += f"seam_allowance_mm = {1e3 * allowance:g}\n" if allowance else ""
    lines = [head]
    for index, part in enumerate(draft.parts):
        if part.twin is None or part.twin > index:
            place = place_of(draft.parts, index)
            said = '# place = "front"  # not known' if place is None else f"place = {toml_text(place)}"
            said = 'place = "none"  # small, and sewn to nothing' if index in draft.spare else said
            count = len(part.darts)
            eyes = f"darts = true  # {count} within it cut out and sewn; false: left as lines\n" if count else ""
            lines.append(f"[[garment.piece]]\nname = {toml_text(part.name)}\n{said}\n{eyes}")
    for joint in draft.joints:
        lines.append(_seam(draft, joint, ""))
    if draft.unsewn:
        lines.append(f"# Less sure than {SEWN_FROM:g}: sewn only if you remove the # in front\n")
        lines += [_seam(draft, joint, "# ") for joint in draft.unsewn]
    lines.append('[avatar]\nshape = {kind = "mannequin"}  # or mesh = "BODY.obj"\n')
    return "\n".join(lines)


def _seam(draft: Draft, joint: Joint, mark: str) -> str:
    sides = [side_text(draft.parts, run) for run in (joint.one, joint.other)]
    said = f"{mark}[[garment.seam]]  # {joint.confidence:.2f} {_plain(joint.reason)}\n"
    return said + f"{mark}sew = {toml_text(sides)}\n"


def _plain(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)


def _relative(file: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return file.resolve().as_posix()
