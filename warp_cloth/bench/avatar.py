"""Test of the colliders of a scene's avatar against its exact mesh: errors, and jumps of distance and normal."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.avatar.contact import AvatarContact, ContactOptions
from warp_cloth.avatar.error import NearSurface, Sampled, contact_error, near_surface
from warp_cloth.avatar.exact import ExactCollider, build_exact_collider
from warp_cloth.avatar.solid import closing_of
from warp_cloth.base.errors import InputError
from warp_cloth.base.mesh import Mesh, Points
from warp_cloth.export.files import whole_file
from warp_cloth.export.plots import figure_class
from warp_cloth.export.report import check_writable, write_report

if TYPE_CHECKING:
    from warp_cloth.garment.outfit import Outfit
    from warp_cloth.scene import Scene

Contacts = NDArray[np.float32]  # unit normals and distances [m], shape [N, 4]
KINDS = ("depth", "auto", "plain", "mesh")
LINES = 400  # random lines through the surface that the garment can reach
HALF_LENGTH = 0.02  # [m] of a line: both ends are beyond the contact's reach
STEP = 5e-5  # [m] between samples: a continuous distance changes by as much at most
STEEP_STEPS = 2000  # with the largest changes, which are bisected
HALVINGS = 6  # of those steps, down to 0.8 um: a change that remains is a jump
DEEPEST = 0.005  # [m] below the surface, as deep as cloth gets
PLOTTED = 0.06  # [m] to either side of the named places


@dataclass(frozen=True)
class Findings:
    """Figures of one collider, compared with the exact mesh."""

    kind: str
    buffers: list[str]
    megabytes: float | None  # of the arrays that an iteration reads
    build_seconds: float  # without loading kernels
    p50: float  # of the error of the distance where the garment can lie [mm]
    p99: float
    p999: float
    max: float
    turn_degrees: float  # largest change of the normal in one step along a line
    jump_mm: float  # largest jump of the distance
    jump_degrees: float  # largest jump of the normal


@dataclass(frozen=True, eq=False)
class Walk:
    """Signed distance and normal of every collider along one line."""

    name: str
    along: NDArray[np.float64]  # [m], shape [N]
    contact: dict[str, NDArray[np.float32]]  # normal and distance [m] by collider, shape [N, 4]


@dataclass(frozen=True, eq=False)
class AvatarBench:
    """Test results of an avatar."""

    name: str
    findings: tuple[Findings, ...]
    walks: tuple[Walk, ...]
    unseen: float  # fraction of the near surface that is hidden from front, back and top
    area: float  # of the near surface [m2]


def run_avatar_bench(
    scene: Scene, outfit: Outfit, *, device: str, progress: Callable[[str], None] | None = None
) -> AvatarBench:
    """Builds every collider around a scene's garments as they start, and samples it near the avatar.

    Raises:
        InputError: the scene has no avatar, or one that encloses nothing.
    """
    if outfit.avatar is None:
        raise InputError(scene.name, "the scene has no avatar to test", "add an [avatar]")
    avatar = outfit.starting_avatar or outfit.avatar
    closing = closing_of(avatar)
    avatar = closing.closed(avatar) if closing.encloses else avatar
    garment = np.concatenate([mesh.points for mesh in outfit.meshes])
    offset = scene.collision.offset
    exact = build_exact_collider(avatar, device)
    surface = near_surface(avatar, exact, garment, *_bounds(garment, avatar))
    places = named_places(surface)
    findings, contacts, unseen = [], {}, 0.0
    for kind in KINDS:
        if progress is not None:
            progress(kind)
        options = ContactOptions(
            kind,
            pixel=scene.collision.pixel,
            offset=offset,
            error=scene.collision.error,
            device=device,
        )
        place = scene.avatar.place if scene.avatar is not None else "avatar"
        contact = AvatarContact(avatar, options, place=place)
        contact.collider(garment)  # loads the kernels
        began = time.perf_counter()
        contact.collider(garment)
        seconds = time.perf_counter() - began
        findings.append(_findings(kind, contact, seconds, exact, surface, offset))
        unseen = (contact.report or {}).get("unseen_by_three_views", unseen)
        contacts[kind] = contact
    walks = tuple(_walk(name, *place, contacts) for name, place in places.items())
    return AvatarBench(scene.name, tuple(findings), walks, unseen, surface.area)


def named_places(surface: NearSurface) -> dict[str, tuple[Points, Points]]:
    """Critical places of a contact field on any body: a point [m], and the unit vector of a line through it.

    Silhouette: the leftmost point at the trunk's middle height. Shoulder: the highest point that faces up, away from
    the middle plane. Armpit: the highest that faces down, away from it. Crotch: the lowest that faces down, near it.
    """
    points, normals = surface.points, surface.normals
    found: dict[str, tuple[Points, Points]] = {}
    if not len(points):
        return found
    height = points[:, 1]
    middle = np.abs(height - np.median(height)) < 0.05
    off_centre = np.abs(points[:, 0] - np.median(points[:, 0])) / max(float(np.ptp(points[:, 0])), 1e-9)
    x, _, z = np.eye(3)
    for name, chosen, score, direction in (
        ("silhouette", middle, points[:, 0], z),
        ("shoulder", (normals[:, 1] > 0.7) & (off_centre > 0.1), height, x),
        ("armpit", (normals[:, 1] < -0.6) & (off_centre > 0.1), height, x),
        ("crotch", (normals[:, 1] < -0.6) & (off_centre < 0.05), -height, x),
    ):
        if chosen.any():
            best = np.flatnonzero(chosen)[score[chosen].argmax()]
            found[name] = (points[best] + 0.004 * normals[best], direction)
    return found


def _bounds(garment: Points, avatar: Mesh) -> tuple[Points, Points]:
    lower, upper = avatar.bounds()
    return np.maximum(garment.min(axis=0) - 0.1, lower - 0.1), np.minimum(garment.max(axis=0) + 0.1, upper + 0.1)


def _findings(
    kind: str, contact: AvatarContact, seconds: float, exact: ExactCollider, surface: NearSurface, offset: float
) -> Findings:
    report = contact.report or {}
    error = contact_error(contact.built, exact, surface.worn(exact, offset))
    turn, jump, jump_angle = sample_lines(contact.built, surface)
    return Findings(
        kind,
        report["buffers"],
        report.get("megabytes"),
        seconds,
        **asdict(error),
        turn_degrees=float(np.degrees(turn)),
        jump_mm=1e3 * jump,
        jump_degrees=float(np.degrees(jump_angle)),
    )


def sample_lines(collider: Sampled, surface: NearSurface, halvings: int = HALVINGS) -> tuple[float, float, float]:
    """Largest change of the normal in a step on lines through a surface [rad]; jumps of distance [m], normal [rad].

    A jump is the change that remains in a step that was halved so many times.
    """
    pick = np.linspace(0, len(surface.points) - 1, min(LINES, len(surface.points))).astype(int)
    directions = np.random.default_rng(0).normal(size=(len(pick), 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    steps = np.arange(-HALF_LENGTH, HALF_LENGTH, STEP)
    lines = surface.points[pick][:, None] + directions[:, None] * steps[None, :, None]
    found = collider.sample(lines.reshape(-1, 3)).reshape(len(pick), len(steps), 4)
    near = (found[:, :, 3] > -DEEPEST) & (found[:, :, 3] < 0.99 * collider.reach)
    line, step = np.nonzero(near[:, 1:] | near[:, :-1])
    starts, ends, before, after = lines[line, step], lines[line, step + 1], found[line, step], found[line, step + 1]
    angles, changes = _angle(before, after), _change(before, after, collider.reach)
    jumps = []
    for size, measure in ((changes, lambda a, b: _change(a, b, collider.reach)), (angles, _angle)):
        worst = np.argsort(-size, kind="stable")[:STEEP_STEPS]
        jumps.append(_jump(collider, measure, starts[worst], ends[worst], before[worst], after[worst], halvings))
    finest = STEP * 0.5**halvings
    return float(angles.max(initial=0.0)), max(jumps[0] - finest, 0.0), jumps[1]


def _change(before: Contacts, after: Contacts, reach: float) -> NDArray[np.float64]:
    """Change of the distance [m], within the collider's reach."""
    return np.abs(np.minimum(after[:, 3], reach) - np.minimum(before[:, 3], reach)).astype(np.float64)


def _angle(before: Contacts, after: Contacts) -> NDArray[np.float64]:
    """Angle between normals [rad]; 0 where one is unknown."""
    known = (np.linalg.norm(before[:, :3], axis=1) > 0.5) & (np.linalg.norm(after[:, :3], axis=1) > 0.5)
    chord = np.linalg.norm(after[:, :3].astype(np.float64) - before[:, :3], axis=1)
    return np.where(known, 2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)), 0.0)


def _jump(
    collider: Sampled,
    measure: Callable[[Contacts, Contacts], NDArray[np.float64]],
    starts: Points,
    ends: Points,
    before: Contacts,
    after: Contacts,
    halvings: int,
) -> float:
    """Largest change that is left after bisecting these steps, each time towards the larger change."""
    if not len(starts):
        return 0.0
    for _ in range(halvings):
        middles = 0.5 * (starts + ends)
        between = collider.sample(middles)
        first = (measure(before, between) >= measure(between, after))[:, None]
        starts, before = np.where(first, starts, middles), np.where(first, before, between)
        ends, after = np.where(first, middles, ends), np.where(first, between, after)
    return float(measure(before, after).max())


def _walk(name: str, place: Points, direction: Points, contacts: dict[str, AvatarContact]) -> Walk:
    along = np.arange(-PLOTTED, PLOTTED, 4.0 * STEP)
    line = place + along[:, None] * direction
    return Walk(name, along, {kind: contact.built.sample(line) for kind, contact in contacts.items()})


def table(bench: AvatarBench) -> list[str]:
    """The results as lines of a table."""
    lines = [
        f"{bench.name}: {bench.area:.2f} m2 of the avatar within the garment's reach; "
        f"{100 * bench.unseen:.1f} % of it is hidden from the front, back and top views",
        "  collider   error mm: median    p99  p99.9    max  kink deg   jump mm  jump deg    MB  build s  buffers",
    ]
    for f in bench.findings:
        size = f"{f.megabytes:.1f}" if f.megabytes is not None else "-"
        buffers = ", ".join(f.buffers) or "all triangles"
        lines.append(
            f"  {f.kind:<10} {f.p50:16.3f} {f.p99:6.2f} {f.p999:6.2f} {f.max:6.2f} {f.turn_degrees:9.1f} "
            f"{f.jump_mm:9.4f} {f.jump_degrees:9.2f} {size:>5} {f.build_seconds:8.2f}  {buffers}"
        )
    return lines


def save_avatar_bench(bench: AvatarBench, folder: Path, *, plots: bool = True) -> list[Path]:
    """Writes NAME_avatar.json and, with ``plots``, NAME_walks.png.

    Raises:
        InputError: the folder cannot be written, or matplotlib is missing.
    """
    check_writable(folder, bench.name)
    paths = [folder / f"{bench.name}_avatar.json"]
    findings = [asdict(found) for found in bench.findings]
    write_report(paths[0], {"near_area_m2": bench.area, "unseen_by_three_views": bench.unseen, "colliders": findings})
    if plots and bench.walks:
        paths.append(folder / f"{bench.name}_walks.png")
        _plot(paths[1], bench)
    return paths


def _plot(path: Path, bench: AvatarBench) -> None:
    """Plots distance and slope of the normal along each line, of every collider."""
    figure = figure_class()(figsize=(4.5 * len(bench.walks), 6.5), layout="constrained")
    rows: Any = figure.subplots(2, len(bench.walks), squeeze=False, sharex=True)
    for column, walk in enumerate(bench.walks):
        distance, normal = rows[0][column], rows[1][column]
        for kind in ("plain", "mesh", "depth", "auto"):
            style = {"plain": "0.7", "mesh": "k", "depth": "C0", "auto": "C3"}[kind]
            contact, wide = walk.contact[kind], 2.5 if kind == "mesh" else 1.2
            known = np.linalg.norm(contact[:, :3], axis=1) > 0.5
            distance_mm = np.where(known, 1e3 * contact[:, 3], np.nan)
            label = "exact" if kind == "mesh" else kind
            distance.plot(1e3 * walk.along, distance_mm, color=style, linewidth=wide, label=label)
            angle = np.degrees(np.arccos(np.clip(contact[:, 1], -1.0, 1.0)))
            normal.plot(1e3 * walk.along, np.where(known, angle, np.nan), color=style, linewidth=wide)
        distance.set_title(walk.name)
        distance.set_ylabel("distance [mm]")
        normal.set_ylabel("normal from the vertical [degrees]")
        normal.set_xlabel("along the line [mm]")
    rows[0][0].legend()
    figure.suptitle(f"{bench.name}: colliders along lines across the avatar")
    with whole_file(path) as place:
        figure.savefig(place, dpi=110)
