"""Bodies of many shapes and poses, made by anny, for the pairs of ``designs/fit_designs.py --bodies``.

    pip install anny torch      # not a dependency of warp_cloth; its first start takes ten minutes
    python tests/benchmarks/bodies/make.py FOLDER [--only NAME ...]

Writes FOLDER/NAME.obj (metres, y up, feet on the floor) of each body in ``BODIES``, and FOLDER/measures.csv with what
anny measures of them at rest, for ``measures.py``. ``shape`` are anny's phenotypes
(0 to 1), ``pose`` turns bones [degrees] about the axes of the person: x to the left, y up, z to the front. What is
stated for the left side is mirrored to the right, unless a bone of the right side is stated as well.
"""

from __future__ import annotations

import argparse
import csv
import math
from dataclasses import dataclass, field
from pathlib import Path

import anny
import numpy as np
import torch
from anny.anthropometry import Anthropometry

Turns = dict[str, tuple[float, float, float]]  # degrees about x, y, z, by bone


@dataclass(frozen=True)
class Body:
    """How a body looks and stands."""

    gender: float = 0.0  # 0 male, 1 female
    age: float = 0.67  # 0 newborn, 1/3 child, 2/3 adult, 1 old
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.38  # 1.65 m and 1.78 m
    arms: float | None = 45.0  # degrees below the horizontal, None: as ``pose`` has them
    pose: Turns = field(default_factory=dict)


SIT: Turns = {"upperleg01.L": (-88.0, 0.0, 0.0), "lowerleg01.L": (85.0, 0.0, 0.0)}
WALK: Turns = {
    "upperleg01.L": (-25.0, 0.0, 0.0),
    "upperleg01.R": (18.0, 0.0, 0.0),
    "lowerleg01.L": (10.0, 0.0, 0.0),
    "lowerleg01.R": (25.0, 0.0, 0.0),
}
BODIES: dict[str, Body] = {
    "f_avg": Body(1.0),
    "m_avg": Body(0.0),
    "f_thin": Body(1.0, weight=0.1, muscle=0.4),
    "m_thin": Body(0.0, weight=0.1, muscle=0.4),
    "f_heavy": Body(1.0, weight=0.8),
    "m_heavy": Body(0.0, weight=0.8),
    "f_very_heavy": Body(1.0, age=0.8, weight=1.0, muscle=0.1),
    "m_very_heavy": Body(0.0, age=0.8, weight=1.0, muscle=0.1),
    "f_tall": Body(1.0, height=0.55),
    "m_tall": Body(0.0, height=0.55),
    "f_short": Body(1.0, height=0.25),
    "m_short": Body(0.0, height=0.25),
    "m_muscular": Body(0.0, muscle=1.0, weight=0.6),
    "f_old": Body(1.0, age=0.95),
    "m_old": Body(0.0, age=0.95, weight=0.6),
    "f_teen": Body(1.0, age=0.5),
    "m_teen": Body(0.0, age=0.5),
    "f_t_pose": Body(1.0, arms=0.0),
    "m_t_pose": Body(0.0, arms=0.0),
    "f_i_pose": Body(1.0, arms=78.0),
    "m_i_pose": Body(0.0, arms=78.0),
    "f_arms_touch": Body(1.0, arms=83.0),
    "m_arms_touch": Body(0.0, weight=0.7, arms=83.0),
    "f_feet_together": Body(1.0, pose={"upperleg01.L": (0.0, 0.0, -5.0)}),
    "f_arms_up": Body(1.0, arms=-60.0),
    "f_one_arm_up": Body(1.0, arms=None, pose={"upperarm01.L": (0.0, 0.0, 95.0), "upperarm01.R": (0.0, 0.0, 20.0)}),
    "f_walk": Body(1.0, arms=70.0, pose=WALK),
    "m_walk": Body(0.0, arms=70.0, pose=WALK),
    "f_sit": Body(1.0, arms=60.0, pose=SIT),
    "m_sit": Body(0.0, arms=60.0, pose=SIT),
    "f_bow": Body(1.0, arms=60.0, pose={"spine05": (20.0, 0.0, 0.0), "spine03": (15.0, 0.0, 0.0)}),
    "f_hands_on_hips": Body(
        1.0, arms=45.0, pose={"lowerarm01.L": (0.0, 0.0, -75.0), "upperarm02.L": (-15.0, 0.0, 0.0)}
    ),
    "f_elbows_bent": Body(1.0, arms=70.0, pose={"lowerarm01.L": (-70.0, 0.0, 0.0)}),
    "f_stride": Body(1.0, pose={"upperleg01.L": (0.0, 0.0, 22.0)}),
    "child_7": Body(0.5, age=0.3),
    "child_10": Body(0.5, age=0.4),
}
# the person's axes in anny's: x to the left, z up, y to the back
TO_PERSON = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def turn(degrees: tuple[float, float, float]) -> np.ndarray:
    """(4, 4) of a turn about the person's x, then y, then z, in anny's axes."""
    found = np.eye(3)
    for axis, angle in enumerate(degrees):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        a, b = (axis + 1) % 3, (axis + 2) % 3
        about = np.eye(3)
        about[a, a] = about[b, b] = c
        about[a, b], about[b, a] = -s, s
        found = about @ found
    whole = np.eye(4)
    whole[:3, :3] = TO_PERSON.T @ found @ TO_PERSON
    return whole


def both_sides(pose: Turns) -> Turns:
    """The left side's turns mirrored where the right side has none."""
    found = dict(pose)
    for bone, (x, y, z) in pose.items():
        if bone.endswith(".L"):
            found.setdefault(bone[:-2] + ".R", (x, -y, -z))
    return found


def fall(model: anny.Anny, shape: dict[str, float], pose: Turns) -> float:
    """How far the left arm, from shoulder to wrist, points below the horizontal [degrees]."""
    posed = run(model, shape, pose)
    head = {name: TO_PERSON @ posed["bone_poses"][0, k, :3, 3].numpy() for k, name in enumerate(model.bone_labels)}
    arm = head["wrist.L"] - head["upperarm01.L"]
    return math.degrees(math.atan2(-arm[1], math.hypot(arm[0], arm[2])))


def run(model: anny.Anny, shape: dict[str, float], pose: Turns) -> dict[str, torch.Tensor]:
    """anny's answer for a body in a pose."""
    turns = {bone: torch.tensor(turn(angles), dtype=torch.float64)[None] for bone, angles in both_sides(pose).items()}
    with torch.no_grad():
        return model(pose_parameters=turns or None, phenotype_kwargs=shape, pose_parameterization="local-ref")


def shape_of(body: Body) -> dict[str, float]:
    """anny's phenotype of a body."""
    shape = {name: getattr(body, name) for name in ("gender", "age", "muscle", "weight", "height")}
    return {**shape, "proportions": 0.5}


def stated_measures(model: anny.Anny, body: Body) -> dict[str, float]:
    """anny's own stature and waist of a body at rest [m]."""
    rest, anthropometry = run(model, shape_of(body), {})["rest_vertices"], Anthropometry(model)
    waist = float(anthropometry.waist_circumference(rest)[0])
    return {"height": float(anthropometry.height(rest)[0]), "waist_circumference": waist}


def points_of(model: anny.Anny, body: Body) -> np.ndarray:
    """(V, 3) points [m], y up, feet on the floor."""
    shape = shape_of(body)
    pose = dict(body.pose)
    if body.arms is not None:
        x, y, _ = pose.get("upperarm01.L", (0.0, 0.0, 0.0))
        pose["upperarm01.L"] = (x, y, fall(model, shape, {}) - body.arms)
    points = run(model, shape, pose)["vertices"][0].numpy() @ TO_PERSON.T
    points[:, 1] -= points[:, 1].min()
    return points


def write_obj(path: Path, points: np.ndarray, faces: np.ndarray) -> None:
    """A mesh in metres."""
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    lines += ["f " + " ".join(str(v + 1) for v in face) for face in faces.tolist()]
    path.write_text("\n".join(lines) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=list(BODIES), metavar="NAME")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    model = anny.create_fullbody_model(triangulate_faces=True).to(dtype=torch.float64)
    rows = []
    for name in given.only:
        points = points_of(model, BODIES[name])
        write_obj(given.folder / f"{name}.obj", points, model.faces.numpy())
        rows.append({"name": name, **stated_measures(model, BODIES[name])})
        print(f"{name}.stature {points[:, 1].max():.3f} m", flush=True)
    with (given.folder / "measures.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
