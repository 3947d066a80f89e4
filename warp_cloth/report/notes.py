"""Notes of a report: what was guessed or repaired on the way in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from warp_cloth.loading.raw import counted
from warp_cloth.report.numbers import short_number

LARGE_LID = 0.1  # [m2] of lids over an avatar's holes; those of a bust's neck, arms and waist have less


def notes_of(report: Mapping[str, Any]) -> list[str]:
    """What was guessed or repaired, each note with the name of its garment or the avatar."""
    notes = [f"{garment['name']}: {note}" for garment in report.get("garments") or () for note in garment["notes"]]
    notes += _unused_panels((report.get("settings") or {}).get("garment") or ())
    notes += [f"avatar: {note}" for note in (report.get("avatar") or {}).get("notes", ())]
    contact = report.get("contact") or {}
    sheets, lids = contact.get("sheets_left_out"), contact.get("lids_m2") or 0.0
    worn = contact.get("worn_parts")
    if worn:
        notes.append(
            f"avatar: {counted(worn, 'part')} of its mesh {'is' if worn == 1 else 'are'} worn by the rest, as clothes "
            "are; cloth lies on them as on the body. If that is not meant, give the body without them"
        )
    if holes := contact.get("holes_closed"):
        is_large = lids > LARGE_LID and not worn
        area = f"{lids:.2g} m2" if is_large else f"{short_number(1e4 * lids)} cm2"
        question = (
            ": is part of the body missing, such as the half that a mirror modifier would add? A scan's holes are "
            "better filled in the scanning software"
        )
        notes.append(f"avatar: {counted(holes, 'hole')} closed, {area} in all{question if is_large else ''}")
    if sheets:
        notes.append(f"avatar: {counted(sheets, 'loose sheet')} (hair, for example) ignored: only solid parts collide")
    return [*notes, *report.get("map_notes", ())]


def _unused_panels(garments: Sequence[Mapping[str, Any]]) -> list[str]:
    """Notes about garments with rest = "mesh" that seem to have panels."""
    notes = []
    for garment in garments:
        if garment["rest"] != "mesh":
            continue
        if garment["uv_units"] not in ("auto", "m"):
            notes.append(
                f'{garment["name"]}: uv_units is not used with rest = "mesh"; if the garment has panels, set '
                'rest = "uv"'
            )
        elif (garment["shape"] or {}).get("kind") == "tshirt":
            notes.append(
                f"{garment['name']}: rest lengths are those of the panels as they are placed around the body, because "
                'rest is "mesh"; for those of the flat panels set rest = "uv"'
            )
    return notes
