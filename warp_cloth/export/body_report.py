"""What was understood of a body, in words and as JSON, with its picture."""

from __future__ import annotations

from pathlib import Path

from warp_cloth.anatomy.measures import DEFINITIONS
from warp_cloth.anatomy.person import Person
from warp_cloth.anatomy.skeleton import LIMBS, Skeleton
from warp_cloth.export.body_picture import write_body_picture
from warp_cloth.export.report import write_report
from warp_cloth.report.rows import note_rows, row

INCH = 0.0254  # [m]


def body_lines(person: Person, with_measures: bool) -> list[str]:
    """What is printed: pose and limbs, or why there are none; and the measures in centimetres and inches."""
    lines = [f"{person.body.name}: {body_sentence(person)}", *note_rows([*person.body.notes, *person.notes])]
    if person.skeleton is not None:
        lines.append(row("found", ", ".join(_limbs(person.skeleton)) or "the trunk"))
    if with_measures and person.measures:
        lines.append(f"  {'measure':<18} {'cm':>6} {'in':>6}")
        for each in person.measures:
            name = each.name.replace("_", " ")
            figures = "     -      -" if each.value is None else f"{100 * each.value:6.1f} {each.value / INCH:6.1f}"
            lines.append(f"  {name:<18} {figures}  {each.reason or DEFINITIONS[each.name]}")
    return lines


def _limbs(skeleton: Skeleton) -> list[str]:
    return [name for limb, name in enumerate(LIMBS) if limb not in skeleton.lacks]


def body_sentence(person: Person) -> str:
    """Height and pose, or why no limbs can be identified."""
    if person.stance is None:
        low, high = person.body.bounds()
        x, y, z = (high - low).tolist()
        return f"no limbs can be identified ({x:.2f} x {y:.2f} x {z:.2f} m): {person.reason}"
    stature = next(each for each in person.measures if each.name == "stature")
    tall = "" if stature.value is None else f"{stature.value:.2f} m tall; "
    return tall + person.stance.in_words()


def save_body(person: Person, folder: Path, *, device: str = "cpu") -> list[Path]:
    """Writes NAME_body.json and NAME_body.png.

    Raises:
        InputError: the folder cannot be written.
    """
    name = person.body.name
    paths = [folder / f"{name}_body.json", folder / f"{name}_body.png"]
    report = {
        "body": name,
        "pose": None if person.stance is None else person.stance.in_words(),
        "limbs": [] if person.skeleton is None else _limbs(person.skeleton),
        "reason": person.reason or None,
        "measures_m": {each.name: each.value for each in person.measures},
        "not_measured": {each.name: each.reason for each in person.measures if each.value is None},
        "definitions": DEFINITIONS if person.measures else {},
        "notes": [*person.body.notes, *person.notes],
    }
    write_report(paths[0], report)
    sentence = body_sentence(person)
    write_body_picture(paths[1], person, title=name, sentence=sentence, device=device)
    return paths
