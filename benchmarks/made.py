"""Makes path problems of the suite's form whose answer is known: `python benchmarks/made.py`.

The tool's motion is that of a random smooth joint motion, which is then forgotten: it is within the
limits and clear of the boxes around it, so that there is a valid motion, and its length bounds that
of the shortest. Every second problem is a Panda, the others a Fetch arm.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import pinocchio as pin
import typer
from rich.console import Console
from scipy.interpolate import PchipInterpolator

import selfmotion as sm
from selfmotion.basics import Array, write_csv

DATA = Path(__file__).parent / "data"
DURATION = 10.0
CRITERIA = {
    "position_m": 1e-4,
    "rotation_deg": 0.1,
    "joint_step_deg": 7.0,
    "joint_limits": True,
    "collision_free": True,
}
# Share of the largest joint step that the motion takes, and distance it keeps from limits [rad].
STEP_SHARE, EDGE = 0.95, 0.02
# Boxes are at least and at most this far from the motion [m].
CLEAR, NEAR = 2e-3, 2e-2


# Pairs of links that are not looked at.
Pairs = tuple[tuple[str, str], ...]


def joint_motion(
    robot: sm.RobotModel, disabled: Pairs, rng: np.random.Generator, waypoints: int
) -> Array:
    """Return a random smooth motion (W, n) within limits and steps, clear of itself."""
    lower, upper = robot.finite_limits()
    size, knots = rng.uniform(0.3, 1.2), int(rng.integers(4, 8))
    largest = STEP_SHARE * np.radians(CRITERIA["joint_step_deg"])
    model = sm.obstacles.CollisionModel(robot, (), disabled)
    while True:
        first = lower + (upper - lower) * rng.uniform(0.05, 0.95, robot.dof)
        moves = np.cumsum(rng.uniform(-size, size, (knots, robot.dof)), axis=0)
        corners = np.clip(first + moves, lower + EDGE, upper - EDGE)
        q = PchipInterpolator(np.linspace(0.0, 1.0, knots), corners)(np.linspace(0, 1, waypoints))
        if np.abs(np.diff(q, axis=0)).max() > largest:
            continue
        if model.worst(q).value >= CLEAR:
            return np.asarray(q)


def boxes_around(
    robot: sm.RobotModel, disabled: Pairs, q: Array, rng: np.random.Generator, count: int
) -> list[tuple[Array, Array]]:
    """Return centres and sizes of boxes that the motion passes closely but does not touch."""
    found: list[tuple[Array, Array]] = []
    for _ in range(3000):
        if len(found) == count:
            break
        center = np.array([*rng.uniform(-0.8, 0.8, 2), rng.uniform(0.05, 1.1)])
        size = rng.uniform(0.05, 0.3, 3)
        model = sm.obstacles.CollisionModel(
            robot, [sm.obstacles.Box("box", center, size)], disabled
        )
        if model.worst(q[::4]).value < NEAR and model.worst(q).value > CLEAR:
            found.append((center, size))
    return found


def write(
    folder: Path, robot: sm.RobotModel, template: str, q: Array, boxes: list[tuple[Array, Array]]
) -> None:
    """Write path.csv and problem.json; the arm is described as in a folder of `data`."""
    t = np.linspace(0.0, DURATION, len(q))
    poses = [robot.pose(x) for x in q]
    quaternions = np.array([pin.Quaternion(pose.rotation).coeffs()[[3, 0, 1, 2]] for pose in poses])
    flips = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=1))
    quaternions[1:] *= np.cumprod(flips)[:, None]
    table = np.column_stack([t, [pose.translation for pose in poses], quaternions])
    write_csv(folder / "path.csv", ["t", "x", "y", "z", "qw", "qx", "qy", "qz"], table)
    description = json.loads((DATA / template / "problem.json").read_text())
    description |= {
        "name": folder.name,
        "origin": "made by benchmarks/made.py from a random joint motion",
        "duration_s": DURATION,
        "waypoints": len(q),
        "boxes": [
            {"size_m": size.tolist(), "center_m": center.tolist(), "rpy_rad": [0.0, 0.0, 0.0]}
            for center, size in boxes
        ],
        "criteria": CRITERIA,
        "reference_path_length_rad": float(np.abs(np.diff(q, axis=0)).sum()),
    }
    (folder / "problem.json").write_text(json.dumps(description, indent=1))


def main(
    out: Annotated[Path, typer.Option(help="Where the folders go.")] = Path("out/made"),
    count: Annotated[int, typer.Option(help="How many problems.")] = 12,
    seed: Annotated[int, typer.Option(help="Of the first problem.")] = 0,
) -> None:
    """Write problem folders for `benchmarks/suite.py --folder`."""
    panda = sm.load_robot("panda", tool="panda_hand")
    fetch = sm.load_robot(DATA / "fetch.urdf", tool="gripper_link", lock={"torso_lift_joint": 0.0})
    for number in range(seed, seed + count):
        rng = np.random.default_rng(number)
        robot, template = (fetch, "fetch_arm__circle") if number % 2 else (panda, "panda__1cube")
        listed = json.loads((DATA / template / "problem.json").read_text()).get(
            "disabled_pairs", ()
        )
        disabled = tuple((first, second) for first, second in listed)
        q = joint_motion(robot, disabled, rng, int(rng.integers(60, 400)))
        boxes = boxes_around(robot, disabled, q, rng, int(rng.integers(4, 12)))
        write(out / f"made_{number:03d}", robot, template, q, boxes)
        Console().print(f"wrote {out / f'made_{number:03d}'}: {len(boxes)} boxes", markup=False)


if __name__ == "__main__":
    typer.run(main)
