"""A scene's avatar under test: what each collider says of it, beside its exact mesh."""

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
LINES = 400  # walked through the surface that the garment can reach
HALF = 0.02  # [m] to either side of it: the line leaves the contact's reach at both ends
STEP = 5e-5  # [m] between samples: a continuous distance changes by as much, one that jumps by more
STEEP = 2000  # steps with the largest changes that are looked at closer
HALVINGS = 6  # of those steps, down to 0.8 um: what still changes there jumps
DEEPEST = 0.005  # [m] under the surface, down to which a walk is judged: cloth gets no deeper
PLOTTED = 0.06  # [m] to either side of the named places


@dataclass(frozen=True)
class Findings:
    """What one collider says of an avatar, against the exact mesh."""

    kind: str
    buffers: list[str]
    megabytes: float | None  # that an iteration reads from
    build_seconds: float  # kernels loaded
    p50: float  # of the distance error where the garment can lie [mm]
    p99: float
    p999: float
    max: float
    turn_degrees: float  # largest change of the normal in one step of a walk
    jump_mm: float  # largest change of distance within one step that no halving takes away
    jump_degrees: float  # likewise of the normal


@dataclass(frozen=True, eq=False)
class Walk:
    """Signed distance and normal along one line, of every collider."""

    name: str
    along: NDArray[np.float64]  # [m], shape [N]
    contact: dict[str, NDArray[np.float32]]  # normal and distance [m] by collider, shape [N, 4]


@dataclass(frozen=True, eq=False)
class AvatarBench:
    """What is found of an avatar."""

    name: str
    findings: tuple[Findings, ...]
    walks: tuple[Walk, ...]
    unseen: float  # share of the near surface that front, back and top do not see
    area: float  # near surface [m2]


def run_avatar_bench(
    scene: Scene, outfit: Outfit, *, device: str, progress: Callable[[str], None] | None = None
) -> AvatarBench:
    """Builds every collider round a scene's garments as they start, and samples it near the avatar.

    Raises:
        InputError: the scene has no avatar, or one that encloses nothing.
    """
    if outfit.avatar is None:
        raise InputError(scene.name, "the scene has no avatar to look at", "add an [avatar]")
    avatar = outfit.starting_avatar or outfit.avatar
    closing = closing_of(avatar)
    avatar = closing.closed(avatar) if closing.encloses else avatar
    garment = np.concatenate([mesh.points for mesh in outfit.garments])
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
        contact = AvatarContact(avatar, options, friction=0.0, place=place)
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
    """Where contact fields break, and the way across: found by shape, on whatever body it is; [m] and unit vector.

    Silhouette: farthest to the left of the trunk's middle height. Shoulder: the highest that looks up, away from the
    middle. Armpit: the highest that looks down, away from the middle; crotch: the same near the middle.
    """
    points, normals = surface.points, surface.normals
    found: dict[str, tuple[Points, Points]] = {}
    if not len(points):
        return found
    height = points[:, 1]
    middle = np.abs(height - np.median(height)) < 0.05
    aside = np.abs(points[:, 0] - np.median(points[:, 0])) / max(float(np.ptp(points[:, 0])), 1e-9)
    x, _, z = np.eye(3)
    for name, chosen, score, way in (
        ("silhouette", middle, points[:, 0], z),
        ("shoulder", (normals[:, 1] > 0.7) & (aside > 0.1), height, x),
        ("armpit", (normals[:, 1] < -0.6) & (aside > 0.1), height, x),
        ("crotch", (normals[:, 1] < -0.6) & (aside < 0.05), -height, x),
    ):
        if chosen.any():
            best = np.flatnonzero(chosen)[score[chosen].argmax()]
            found[name] = (points[best] + 0.004 * normals[best], way)
    return found


def _bounds(garment: Points, avatar: Mesh) -> tuple[Points, Points]:
    lower, upper = avatar.bounds()
    return np.maximum(garment.min(axis=0) - 0.1, lower - 0.1), np.minimum(garment.max(axis=0) + 0.1, upper + 0.1)


def _findings(
    kind: str, contact: AvatarContact, seconds: float, exact: ExactCollider, surface: NearSurface, offset: float
) -> Findings:
    report = contact.report or {}
    error = contact_error(contact.built, exact, surface.worn(exact, offset))
    turn, jump, jump_angle = walked(contact.built, surface)
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


def walked(collider: Sampled, surface: NearSurface, halvings: int = HALVINGS) -> tuple[float, float, float]:
    """On lines through a surface: largest turn of the normal in one step [rad]; jumps of distance [m], normal [rad].

    A jump is what changes in a step that was halved so often.
    """
    pick = np.linspace(0, len(surface.points) - 1, min(LINES, len(surface.points))).astype(int)
    ways = np.random.default_rng(0).normal(size=(len(pick), 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    steps = np.arange(-HALF, HALF, STEP)
    lines = surface.points[pick][:, None] + ways[:, None] * steps[None, :, None]
    found = collider.sample(lines.reshape(-1, 3)).reshape(len(pick), len(steps), 4)
    near = (found[:, :, 3] > -DEEPEST) & (found[:, :, 3] < 0.99 * collider.reach)
    line, step = np.nonzero(near[:, 1:] | near[:, :-1])
    starts, ends, before, after = lines[line, step], lines[line, step + 1], found[line, step], found[line, step + 1]
    turns, changes = _turn(before, after), _change(before, after, collider.reach)
    jumps = []
    for size, measure in ((changes, lambda a, b: _change(a, b, collider.reach)), (turns, _turn)):
        worst = np.argsort(-size, kind="stable")[:STEEP]
        jumps.append(_jump(collider, measure, starts[worst], ends[worst], before[worst], after[worst], halvings))
    finest = STEP * 0.5**halvings
    return float(turns.max(initial=0.0)), max(jumps[0] - finest, 0.0), jumps[1]


def _change(before: Contacts, after: Contacts, reach: float) -> NDArray[np.float64]:
    """Change of distance [m], as far as it matters."""
    return np.abs(np.minimum(after[:, 3], reach) - np.minimum(before[:, 3], reach)).astype(np.float64)


def _turn(before: Contacts, after: Contacts) -> NDArray[np.float64]:
    """Angle between normals [rad]; 0 where one is not told."""
    told = (np.linalg.norm(before[:, :3], axis=1) > 0.5) & (np.linalg.norm(after[:, :3], axis=1) > 0.5)
    chord = np.linalg.norm(after[:, :3].astype(np.float64) - before[:, :3], axis=1)
    return np.where(told, 2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)), 0.0)


def _jump(
    collider: Sampled,
    measure: Callable[[Contacts, Contacts], NDArray[np.float64]],
    starts: Points,
    ends: Points,
    before: Contacts,
    after: Contacts,
    halvings: int,
) -> float:
    """Largest change that is left after halving these steps again and again, on the side where it is greater."""
    if not len(starts):
        return 0.0
    for _ in range(halvings):
        middles = 0.5 * (starts + ends)
        between = collider.sample(middles)
        first = (measure(before, between) >= measure(between, after))[:, None]
        starts, before = np.where(first, starts, middles), np.where(first, before, between)
        ends, after = np.where(first, middles, ends), np.where(first, between, after)
    return float(measure(before, after).max())


def _walk(name: str, place: Points, way: Points, contacts: dict[str, AvatarContact]) -> Walk:
    along = np.arange(-PLOTTED, PLOTTED, 4.0 * STEP)
    line = place + along[:, None] * way
    return Walk(name, along, {kind: contact.built.sample(line) for kind, contact in contacts.items()})


def table(bench: AvatarBench) -> list[str]:
    """Lines of a table for people."""
    lines = [
        f"{bench.name}: {bench.area:.2f} m2 of the avatar within the garment's reach; "
        f"{100 * bench.unseen:.1f} % of it is seen by none of the front, back and top views",
        "  collider   error mm: median    p99  p99.9    max  turn deg   jump mm  jump deg    MB  build s  buffers",
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
    """Writes NAME_avatar.json and, where plots are wanted, NAME_walks.png.

    Raises:
        InputError: the folder cannot be written, or plots cannot be drawn.
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
    """Distance and one slope of the normal along each walk, of every collider over the exact one."""
    figure = figure_class()(figsize=(4.5 * len(bench.walks), 6.5), layout="constrained")
    rows: Any = figure.subplots(2, len(bench.walks), squeeze=False, sharex=True)
    for column, walk in enumerate(bench.walks):
        distance, normal = rows[0][column], rows[1][column]
        for kind in ("plain", "mesh", "depth", "auto"):
            style = {"plain": "0.7", "mesh": "k", "depth": "C0", "auto": "C3"}[kind]
            contact, wide = walk.contact[kind], 2.5 if kind == "mesh" else 1.2
            told = np.linalg.norm(contact[:, :3], axis=1) > 0.5
            far = np.where(told, 1e3 * contact[:, 3], np.nan)
            label = "exact" if kind == "mesh" else kind
            distance.plot(1e3 * walk.along, far, color=style, linewidth=wide, label=label)
            angle = np.degrees(np.arccos(np.clip(contact[:, 1], -1.0, 1.0)))
            normal.plot(1e3 * walk.along, np.where(told, angle, np.nan), color=style, linewidth=wide)
        distance.set_title(walk.name)
        distance.set_ylabel("distance [mm]")
        normal.set_ylabel("normal against the vertical [degrees]")
        normal.set_xlabel("along the line [mm]")
    rows[0][0].legend()
    figure.suptitle(f"{bench.name}: what the colliders say along lines across the avatar")
    with whole_file(path) as place:
        figure.savefig(place, dpi=110)
