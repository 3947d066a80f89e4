"""What a report has to tell beside its figures: what was guessed or mended, and what to change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from warp_cloth.loading.raw import counted
from warp_cloth.report.status import crossed, drawn_through, falls_as_a_whole, fine_or_stiff, hidden

DEEP = 2.0  # [mm]; deeper than half the usual offset, a garment is in the body
LARGE_LID = 0.1  # [m2] of lids over an avatar's holes; those of a bust's neck, arms and waist have less
STRETCHED = 0.5  # strain beyond which a seam is not closed, or a unit is wrong


def notes_of(report: Mapping[str, Any]) -> list[str]:
    """What was guessed or mended, each with whose it is."""
    notes = [f"{garment['name']}: {note}" for garment in report.get("garments") or () for note in garment["notes"]]
    notes += _unused_panels((report.get("settings") or {}).get("garment") or ())
    notes += [f"avatar: {note}" for note in (report.get("avatar") or {}).get("notes", ())]
    contact = report.get("contact") or {}
    sheets, lids = contact.get("sheets_left_out"), contact.get("lids_m2") or 0.0
    if lids > LARGE_LID:
        told = counted(contact["holes_closed"], "hole")
        notes.append(
            f"avatar: {told} closed, {lids:.2g} m2 in all: is part of the body missing, as its other half before a "
            "mirror modifier is applied?"
        )
    if sheets:
        told = counted(sheets, "loose sheet")
        notes.append(f"avatar: {told}, as of hair, left out: cloth meets only what has an inside")
    return [*notes, *report.get("map_notes", ())]


def _unused_panels(garments: Sequence[Mapping[str, Any]]) -> list[str]:
    """What panels would say of garments whose natural lengths are as modelled, where something speaks for panels."""
    notes = []
    for garment in garments:
        if garment["rest"] != "mesh":
            continue
        if garment["uv_units"] != "m":
            notes.append(
                f'{garment["name"]}: uv_units is not used, as rest is "mesh"; if it has panels, say rest = "uv"'
            )
        elif (garment["shape"] or {}).get("kind") == "tshirt":
            placed = 'its natural lengths are those of the panels as they are placed round the body, as rest is "mesh"'
            notes.append(f'{garment["name"]}: {placed}; for those of the flat panels say rest = "uv"')
    return notes


def advice(report: Mapping[str, Any]) -> list[str]:
    """What to change where a fit did not come to rest, or came to rest wrongly; the likeliest first."""
    lines: list[str] = []
    strain, depth, solver = report["strain"], report.get("penetration_mm"), report["settings"]["solver"]
    if report["status"] == "diverged":
        lines.append('Use a smaller solver.cap, solver.precision = "float64", or a softer fabric.')
    loss = report.get("unheld")
    if loss:
        lines.append(f"{loss[0].upper()}{loss[1:]}.")
    elif depth is not None and depth["edges"]:
        lines.append(
            f"{drawn_through(depth['edges'], 'body')}: begin with it in the pose that the garment is placed round, and "
            "give the wanted pose as avatar.poses; or place panels that reach beyond another limb clear of it."
        )
    unseen = hidden(report.get("contact"), report["settings"]["collision"]["avatar"])
    if unseen:
        lines.append(f"{unseen[0].upper()}{unseen[1:]}.")
    if strain["p99"] is not None and not strain["p99"] <= STRETCHED:
        lines.append(
            "Parts of the garment are stretched by more than half: check garment.rest and garment.uv_units, "
            "the garment's size against the body's, and that it starts round the body."
        )
    if depth is not None and not depth["max"] <= DEEP:
        lines.append('The garment lies in the body: start it further out, or set collision.avatar = "mesh".')
    passed = crossed(report["crossings"]["faces"] / max(report["faces"], 1), report["settings"]["collision"]["cloth"])
    if passed:
        lines.append(f"{passed}.")
    if report["status"] == "iteration_limit" and not loss:
        error = report["rest_error_mm"]
        cloth = report["settings"]["collision"]["cloth"]
        if falls_as_a_whole(solver["method"], cloth, None if error is None else 1e-3 * error):
            lines.append('Use solver.method = "multilevel": the garment is far from rest, and falls as a whole by it.')
        elif fine_or_stiff(report["vertices"], _stretches(report), solver["method"], cloth):
            lines.append('Use solver.method = "multilevel", made for fine meshes and stiff cloth.')
        lines.append(f"Raise solver.iterations (now {solver['iterations']:,}): forces may only need longer.")
        if solver["method"] == "direct":
            lines.append('Use solver.method = "accelerated": the direct rule chatters where cloth is stiff.')
        lines.append("Take a coarser mesh or a softer fabric first, to see whether the scene is sound.")
    return lines


def _stretches(report: Mapping[str, Any]) -> list[float]:
    """Stretch of the garments' threads [N/m]."""
    fabrics = [garment["fabric"] for garment in report["settings"]["garment"]]
    return [fabric[thread] for fabric in fabrics for thread in ("stretch_warp", "stretch_weft")]
