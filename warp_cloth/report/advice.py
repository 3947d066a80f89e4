"""Advice and notes of a report: what to change, what was guessed or repaired."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from warp_cloth.loading.raw import counted
from warp_cloth.report.faults import crossing_faces, edges_through, unseen_avatar
from warp_cloth.report.status import falls_as_a_whole, fine_or_stiff

DEEP = 2.0  # [mm]; deeper than half the usual offset, a garment is in the body
LARGE_LID = 0.1  # [m2] of lids over an avatar's holes; those of a bust's neck, arms and waist have less
STRETCHED = 0.5  # strain beyond which a seam is not closed, or a unit is wrong


def notes_of(report: Mapping[str, Any]) -> list[str]:
    """What was guessed or repaired, each note with the name of its garment or the avatar."""
    notes = [f"{garment['name']}: {note}" for garment in report.get("garments") or () for note in garment["notes"]]
    notes += _unused_panels((report.get("settings") or {}).get("garment") or ())
    notes += [f"avatar: {note}" for note in (report.get("avatar") or {}).get("notes", ())]
    contact = report.get("contact") or {}
    sheets, lids = contact.get("sheets_left_out"), contact.get("lids_m2") or 0.0
    if lids > LARGE_LID:
        holes = counted(contact["holes_closed"], "hole")
        notes.append(
            f"avatar: {holes} closed, {lids:.2g} m2 in all: is part of the body missing, such as the half that a "
            "mirror modifier would add?"
        )
    if sheets:
        notes.append(f"avatar: {counted(sheets, 'loose sheet')} (hair, for example) ignored: only solid parts collide")
    return [*notes, *report.get("map_notes", ())]


def _unused_panels(garments: Sequence[Mapping[str, Any]]) -> list[str]:
    """Notes about garments with rest = "mesh" that seem to have panels."""
    notes = []
    for garment in garments:
        if garment["rest"] != "mesh":
            continue
        if garment["uv_units"] != "m":
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


def advice(report: Mapping[str, Any]) -> list[str]:
    """What to change where a fit did not come to rest, or came to rest wrongly; the likeliest cause first."""
    lines: list[str] = []
    strain, depth, collision = report["strain"], report.get("penetration_mm"), report["settings"]["collision"]
    if report["status"] == "diverged":
        lines.append('Use a smaller solver.cap, solver.precision = "float64", or a softer fabric.')
    loss = report.get("unheld")
    if loss:
        lines.append(f"{loss[0].upper()}{loss[1:]}.")
    elif depth is not None and depth["edges"]:
        lines.append(
            f"{edges_through(depth['edges'], 'body')}: start with the body in the pose that the garment was placed "
            "around, and give the pose that you want as avatar.poses; or move panels that reach past another limb "
            "clear of it."
        )
    unseen = unseen_avatar(report.get("contact"), collision["avatar"])
    if unseen:
        lines.append(f"{unseen[0].upper()}{unseen[1:]}.")
    if strain["p99"] is not None and not strain["p99"] <= STRETCHED:
        lines.append(
            "Parts of the garment are stretched by more than half: check garment.rest and garment.uv_units, the "
            "garment's size relative to the body, and that it starts around the body."
        )
    if depth is not None and not depth["max"] <= DEEP:
        lines.append('The garment is inside the body: start it further out, or set collision.avatar = "mesh".')
    crossing = crossing_faces(report["crossings"]["faces"] / max(report["faces"], 1), collision["cloth"])
    if crossing:
        lines.append(f"{crossing}.")
    if report["status"] == "iteration_limit" and not loss:
        lines += _more_iterations(report)
    return lines


def _more_iterations(report: Mapping[str, Any]) -> list[str]:
    """Advice where a fit ran out of iterations, and nothing else is wrong with it."""
    lines = []
    solver, cloth, error = (
        report["settings"]["solver"],
        report["settings"]["collision"]["cloth"],
        report["rest_error_mm"],
    )
    if falls_as_a_whole(solver["method"], cloth, None if error is None else 1e-3 * error):
        lines.append('Use solver.method = "multilevel": the garment is far from rest, and that method moves it whole.')
    elif fine_or_stiff(report["vertices"], _stretches(report), solver["method"], cloth):
        lines.append('Use solver.method = "multilevel", which is faster for fine meshes and stiff cloth.')
    lines.append(f"Raise solver.iterations (now {solver['iterations']:,}): the garment may only need more time.")
    if solver["method"] == "direct":
        lines.append('Use solver.method = "accelerated": the direct method keeps oscillating where cloth is stiff.')
    lines.append("Try a coarser mesh or a softer fabric first, to check that the scene is set up as intended.")
    return lines


def _stretches(report: Mapping[str, Any]) -> list[float]:
    """Stretch of the garments' yarns [N/m]."""
    fabrics = [garment["fabric"] for garment in report["settings"]["garment"]]
    return [fabric[key] for fabric in fabrics for key in ("stretch_warp", "stretch_weft")]
