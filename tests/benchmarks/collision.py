"""Depth buffers and the exact collider: jumps, residuals, a table of pixels, and what an iteration costs.

    python tests/benchmarks/collision.py jumps|residual|table|cost --device cuda:0 --out collision.json --processes 8

``jumps``: contact fields walked along lines across eight bodies, all over and round silhouette, shoulder, armpit and
crotch. ``residual``: what is left after equal iterations, seven pairs of garment and body, from starts 0.01 mm apart.
``table``: pixels of 0.5 to 8 mm on three poses, the T-shirt sewn in A-pose; "warm" starts where the exact collider
came to rest. ``cost``: an iteration against the triangles of the avatar, whose surface stays the same. Times want a
quiet GPU.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from wearing import BODIES, NEVER, SHARED_SHIRT, dressed, keep, moved_starts, several, shirt, side_by_side

from warp_cloth.avatar.contact import AvatarContact, ContactOptions
from warp_cloth.avatar.error import NearSurface, near_surface
from warp_cloth.avatar.exact import build_exact_collider, penetration
from warp_cloth.avatar.solid import solid_of
from warp_cloth.base.cache import Cache
from warp_cloth.base.mesh import Indices, Mesh, Points
from warp_cloth.base.surface import grid_values, split_quads, surface_nets, without_saddles
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.bench.avatar import named_places, sample_lines
from warp_cloth.fitting.fit import fit
from warp_cloth.fitting.problem import Problem, collider_updates, limit_of, tolerance_of
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.model.result import Status
from warp_cloth.scene import Scene
from warp_cloth.shapes.body import calibrated_form
from warp_cloth.shapes.measures import MannequinMeasures
from warp_cloth.solver.certificate.certifier import Measurement
from warp_cloth.solver.goal import Goal, Outcome
from warp_cloth.solver.loop import BURST, relax_items

SKIN = (0.4, 0.88)  # of a body's height: from below the crotch to the neck
ROOM = 0.1  # [m] of a field round the skin that is walked
ROUND = 300  # samples of the skin nearest to a named place
FINER = 9  # halvings of a step of 50 um: down to 0.1 um
COLLIDERS = ("depth", "auto", "plain", "mesh")
PIXEL, OFFSET, ERROR = 0.002, 0.003, 0.0015  # [m], the defaults

PAIRS = (("shared shirt", "mean_all", "depth"), ("shirt M", "mannequin M", "depth"), ("shirt M", "mean_all", "depth"),
         ("shirt M", "A_pose", "depth"), ("shirt M", "T_pose", "depth"), ("shirt M", "arms_down", "depth"),
         ("shirt M", "arms_down", "auto"))  # fmt: skip
GARMENTS = {"shared shirt": SHARED_SHIRT, "shirt M": shirt()}
AFTER = (500, 1000, 1500, 2000)  # iterations

PIXELS = (0.5, 1.0, 2.0, 4.0, 8.0)  # [mm]
POSES = ("A_pose", "T_pose", "arms_down")

COARSE = 0.022  # [m] between the vertices of the coarsest avatar
SPLITS = (1, 2, 3, 5, 10)  # parts that its edges are cut into
ABOUT_100K = 3
TIMED, ROUNDS = 400, 9  # iterations at a time, and how often


def jumps(body: str, device: str) -> dict[str, Any]:
    """Largest changes that no halving of a step takes away, by collider and place."""
    avatar = load_outfit(dressed(shirt(edge_mm=40.0), body)).avatar
    height = (avatar.points[:, 1] - avatar.points[:, 1].min()) / np.ptp(avatar.points[:, 1])
    skin = avatar.points[(height > SKIN[0]) & (height < SKIN[1])]
    solid = solid_of(avatar).mesh
    lower, upper = skin.min(axis=0) - 0.5 * ROOM, skin.max(axis=0) + 0.5 * ROOM
    surface = near_surface(solid, build_exact_collider(solid, device), skin, lower, upper)
    parts = {"everywhere": surface}
    for name, (place, _) in named_places(surface).items():
        near = np.argsort(np.linalg.norm(surface.points - place, axis=1))[:ROUND]
        parts[name] = NearSurface(surface.points[near], surface.normals[near], 0.0)
    row: dict[str, Any] = {"body": body}
    for kind in COLLIDERS:
        options = ContactOptions(kind, PIXEL, OFFSET, ERROR, device, reach=2.0 * OFFSET)
        contact = AvatarContact(avatar, options)
        contact.collider(skin)
        row[kind] = {name: _jumps_within(contact, part) for name, part in parts.items()}
    return row


def _jumps_within(contact: AvatarContact, part: NearSurface) -> tuple[float, float, float]:
    """Changes of distance [mm] and normal [degrees] within 0.8 um, of the normal within a tenth of that."""
    (_, jump, turn), (_, _, finer) = sample_lines(contact.built, part), sample_lines(contact.built, part, FINER)
    return 1e3 * jump, float(np.degrees(turn)), float(np.degrees(finer))


def tell_jumps(rows: Sequence[dict[str, Any]]) -> None:
    for row in rows:
        for kind in COLLIDERS:
            told = "  ".join(
                f"{name} {jump:.5f} {turn:.2f} {finer:.2f}" for name, (jump, turn, finer) in row[kind].items()
            )
            print(f"jumps {row['body']:22} {kind:6} {told}")
    for kind in COLLIDERS:
        jump, turn, finer = np.max([each for row in rows for each in row[kind].values()], axis=0)
        print(f"jumps at most, {kind}: {jump:.5f} mm, {turn:.3f} degrees; {finer:.3f} within 0.1 um")


def residuals(pair: tuple[str, str, str], starts: int, device: str) -> dict[str, Any]:
    """Relative residuals of a pair by both colliders, shape [AFTER, starts] each."""
    garment, body, kind = pair
    row: dict[str, Any] = {"pair": " ".join(pair)}
    for name, collider in (("depth", kind), ("exact", "mesh")):
        scene = dressed(GARMENTS[garment], body, {"avatar": collider})
        outfit = load_outfit(scene)
        made = several([scene] * starts, [outfit] * starts, device)
        for item, points in enumerate(moved_starts(made.model.points(0), starts)):
            made.model.set_points(points, item)
        left: dict[int, list[float]] = {}

        def told(look: Measurement, _: float, left: dict[int, list[float]] = left) -> None:
            left[look.iteration] = look.relative_rms.tolist()

        relaxed(made, [Goal(NEVER, AFTER[-1])] * starts, told)
        row[name] = [left[iteration] for iteration in AFTER]
    return row


def tell_residuals(rows: Sequence[dict[str, Any]]) -> None:
    depth, exact = (np.array([row[name] for row in rows]) for name in ("depth", "exact"))  # [pairs, AFTER, starts]
    ratio = depth / exact
    for row, own in zip(rows, ratio, strict=True):
        for iteration, each in zip(AFTER, own, strict=True):
            mean, runs = np.exp(np.log(each).mean()), " ".join(f"{value:.2f}" for value in each)
            print(f"residual {row['pair']:28} {iteration}: mean {mean:.2f}, runs {runs}")
    apart = {"depth and exact, one start": np.abs(np.log(ratio))}
    if exact.shape[2] > 1:
        apart["exact and exact, two starts"] = np.abs(np.log(exact / np.roll(exact, 1, axis=2)))
    for name, factor in apart.items():
        for at, iteration in enumerate(AFTER):
            median, most, worst = np.exp(np.percentile(factor[:, at], (50, 90, 100)))
            beyond = f"{(factor[:, at] > np.log(2.0)).sum()} of {factor[:, at].size} beyond 2"
            print(f"residual {name}, {iteration}: median {median:.2f}, 90 % {most:.2f}, most {worst:.2f}; {beyond}")
    print("residual of all, mean ratio:", *(f"{mean:.3f}" for mean in np.exp(np.log(ratio).mean(axis=(0, 2)))))


def relaxed(made: Problem, goals: Sequence[Goal], on_check: Any = None) -> list[Outcome]:
    """The items, run to their goals."""
    return relax_items(made.certifier, goals, follow=collider_updates(made), on_check=on_check)


def posed(pose: str, pixels: Sequence[float], limit: int, device: str) -> dict[str, Any]:
    """Rest shapes of a T-shirt in a pose: by the exact collider; at every pixel anew, and from that one's."""
    exact, depth = _posed_scenes(pose, pixels, limit)
    outfit, cache, start = load_outfit(exact), Cache(), _start(pose, device)
    avatar = outfit.avatar
    assert avatar is not None
    (rest,) = relaxed(several([exact], [outfit], device, [start]), [_goal(exact)])
    (again,) = relaxed(several([exact], [outfit], device, [rest.points]), [_goal(exact)])
    goals, outfits = [_goal(scene) for scene in depth], [outfit] * len(depth)
    cold_made = several(depth, outfits, device, [start] * len(depth), cache)
    cold = relaxed(cold_made, goals)
    rows = [
        {
            "pose": pose,
            "collider": scene.collision.avatar,
            "pixel_mm": scene.collision.pixel_mm,
            "buffers": (contact.report or {})["buffers"],
            "megabytes": (contact.report or {})["megabytes"],
            "held_megabytes": 1e-6 * contact.bytes,
        }
        for scene, contact in zip(depth, cold_made.contacts, strict=True)
    ]
    rows.append({"pose": pose, "collider": "mesh", "pixel_mm": 0.0, "buffers": ["all triangles"]})
    del cold_made
    warm = relaxed(several(depth, outfits, device, [rest.points] * len(depth), cache), goals)
    for row, first, second in zip(rows, [*cold, rest], [*warm, again], strict=True):
        for name, outcome in (("", first), ("warm_", second)):
            depths = penetration(outcome.points, avatar, device)
            row[f"{name}max_mm"], row[f"{name}p999_mm"] = depths.max, depths.p999
            row[f"{name}iterations"] = outcome.iterations
            row[f"{name}at_rest"] = outcome.status is Status.AT_REST
            row[f"{name}rms_mm"] = 1e3 * float(np.sqrt(np.mean(np.sum((outcome.points - rest.points) ** 2, axis=1))))
    return {"rows": rows, "rest": rest.points.tolist()}


def _start(pose: str, device: str) -> Points | None:
    """Where a T-shirt starts that is sewn in A-pose and carried to another; None: where it is sewn."""
    if pose == POSES[0]:
        return None
    avatar = {**BODIES[POSES[0]], "poses": [BODIES[pose]["mesh"]]}
    return (
        fit({"garment": shirt(), "avatar": avatar, "collision": {"avatar": "auto"}}, device=device).garments[0].points
    )


def _posed_scenes(pose: str, pixels: Sequence[float], limit: int) -> tuple[Scene, list[Scene]]:
    """A T-shirt in a pose on the exact collider, and on buffers."""
    garment = shirt()
    several_pixels = [
        dressed(garment, pose, {"avatar": kind, "pixel_mm": pixel}, iterations=limit)
        for kind in ("auto", "depth")
        for pixel in pixels
    ]
    return dressed(garment, pose, {"avatar": "mesh"}, iterations=limit), several_pixels


def _goal(scene: Scene) -> Goal:
    return Goal(tolerance_of(scene), limit_of(scene))


def add_times(rows: Sequence[dict[str, Any]], rest: Points, pixels: Sequence[float], device: str) -> None:
    """Microseconds of an iteration of worn cloth, alone on the device, written to each row of a pose."""
    exact, depth = _posed_scenes(rows[0]["pose"], pixels, 1)
    outfit = load_outfit(exact)
    for row, scene in zip(rows, [*depth, exact], strict=True):
        (row["microseconds"],) = microseconds([several([scene], [outfit], device, [rest])])


def microseconds(made: Sequence[Problem]) -> list[float]:
    """Medians of an iteration's time in each set-up, which take turns."""
    for one in made:
        one.relaxation.restart()
        one.relaxation.update_anisotropy(np.zeros(1))  # as worn cloth iterates
        one.relaxation.run(10 * BURST)

    def timed(one: Problem) -> float:
        wp.synchronize_device(one.model.device)
        began = time.perf_counter()
        for _ in range(TIMED // BURST):
            one.relaxation.run(BURST)
        wp.synchronize_device(one.model.device)
        return 1e6 * (time.perf_counter() - began) / TIMED

    return np.median([[timed(one) for one in made] for _ in range(ROUNDS)], axis=0).tolist()


def tell_table(rows: Sequence[dict[str, Any]]) -> None:
    print(
        "pose       collider pixel   max  p99.9 iterations | warm max  p99.9  rms mm iterations | us  field MB  held MB"
    )
    for row in rows:
        rest, warm = (" " if row[name] else "*" for name in ("at_rest", "warm_at_rest"))  # *: not at rest
        print(
            f"{row['pose']:10} {row['collider']:6} {row['pixel_mm']:6.1f} {row['max_mm']:6.3f} {row['p999_mm']:6.3f} "
            f"{row['iterations']:8}{rest} | {row['warm_max_mm']:8.3f} {row['warm_p999_mm']:6.3f} "
            f"{row['warm_rms_mm']:7.3f} {row['warm_iterations']:8}{warm} | {row.get('microseconds', 0.0):8.2f} "
            f"{row.get('megabytes', 0.0):8.1f} {row.get('held_megabytes', 0.0):8.1f} {', '.join(row['buffers'])}"
        )


def coarse_body() -> Mesh:
    """A mannequin of about 10,000 triangles."""
    form = calibrated_form(MannequinMeasures())
    values, origin = grid_values(form.value, *form.bounds, COARSE)
    points, quads = surface_nets(without_saddles(values), origin, COARSE)
    points[:, 1] -= form.bounds[0][1]
    return Mesh("mannequin", points, split_quads(points, quads))


def split(mesh: Mesh, parts: int) -> Mesh:
    """The same surface, every edge cut into so many parts, every triangle into their square."""
    steps = [(i, j, parts - i - j) for i in range(parts + 1) for j in range(parts + 1 - i)]
    place = {step[:2]: number for number, step in enumerate(steps)}
    faces = [(place[i, j], place[i + 1, j], place[i, j + 1]) for i, j, k in steps if k > 0]
    faces += [(place[i + 1, j], place[i + 1, j + 1], place[i, j + 1]) for i, j, k in steps if k > 1]
    order = np.argsort(mesh.triangles, axis=1)  # both sides of an edge come to the same bits
    corners = mesh.points[np.take_along_axis(mesh.triangles, order, axis=1)]
    points = np.einsum("sc,fcx->fsx", np.array(steps, dtype=float), corners) / parts
    odd = np.linalg.det(np.eye(3)[order]) < 0.0
    own: Indices = np.array(faces, dtype=np.int32)
    cut = np.where(odd[:, None, None], own[:, ::-1], own) + len(steps) * np.arange(len(corners))[:, None, None]
    kept, number = np.unique(points.reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(mesh.name, kept, number.ravel()[cut.reshape(-1, 3)].astype(np.int32))


def cost(device: str, splits: Sequence[int]) -> dict[str, Any]:
    """Microseconds of an iteration of a worn T-shirt by the triangles of its avatar; of one without, and exact."""
    depth = dressed(shirt(), "mannequin M")
    outfit, base = load_outfit(depth), coarse_body()
    worn_by = [replace(outfit, avatar=split(base, parts)) for parts in splits]
    (rest,) = relaxed(several([depth], worn_by[:1], device), [_goal(depth)])
    exact = dressed(shirt(), "mannequin M", {"avatar": "mesh"})
    none = dressed(shirt(), "mannequin M", {"avatar": "none"})
    scenes = [depth] * len(splits) + [none]
    made = [
        several([scene], [worn], device, [rest.points]) for scene, worn in zip(scenes, [*worn_by, outfit], strict=True)
    ]
    *spent, without = microseconds(made)
    about = splits.index(ABOUT_100K) if ABOUT_100K in splits else 0
    (dear,) = microseconds([several([exact], [worn_by[about]], device, [rest.points])])
    return {
        "triangles": [worn.avatar.triangle_count for worn in worn_by if worn.avatar is not None],
        "microseconds": spent,
        "without_avatar": without,
        "exact_triangles": worn_by[about].avatar.triangle_count if worn_by[about].avatar is not None else 0,
        "exact": dear,
        "spread": max(spent) / min(spent) - 1.0,
        "times_dearer": dear / spent[about],
        "rest_iterations": rest.iterations,
    }


def main() -> None:
    parse = argparse.ArgumentParser()
    parse.add_argument("what", choices=("jumps", "residual", "table", "cost"))
    parse.add_argument("--device", default="cpu")
    parse.add_argument("--out", type=Path, default=None)
    parse.add_argument("--processes", type=int, default=1)
    parse.add_argument("--bodies", nargs="+", default=list(BODIES))
    parse.add_argument("--pairs", nargs="+", type=int, default=list(range(len(PAIRS))))
    parse.add_argument("--starts", type=int, default=2, help="of residual")
    parse.add_argument("--poses", nargs="+", default=list(POSES))
    parse.add_argument("--pixels", nargs="+", type=float, default=list(PIXELS))
    parse.add_argument("--limit", type=int, default=12_000, help="iterations of a fit, for the table")
    parse.add_argument("--splits", nargs="+", type=int, default=list(SPLITS), help="of the avatar's edges, for cost")
    given = parse.parse_args()
    found: Any
    if given.what == "jumps":
        found = list(side_by_side(partial(jumps, device=given.device), given.bodies, given.processes))
        tell_jumps(found)
    elif given.what == "residual":
        work = partial(residuals, starts=given.starts, device=given.device)
        found = list(side_by_side(work, [PAIRS[number] for number in given.pairs], given.processes))
        tell_residuals(found)
    elif given.what == "table":
        work = partial(posed, pixels=given.pixels, limit=given.limit, device=given.device)
        found = []
        for each in list(side_by_side(work, given.poses, given.processes)):  # all of them before clocks run
            add_times(each["rows"], np.array(each["rest"]), given.pixels, given.device)
            found += each["rows"]
        tell_table(found)
    else:
        found = cost(given.device, given.splits)
        print("cost", " ".join(f"{key}={value}" for key, value in found.items()))
    if given.out is not None:
        keep(given.out, found)


if __name__ == "__main__":
    start_warp()
    main()
