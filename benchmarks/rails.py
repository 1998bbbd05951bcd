"""What a metre of a rail is to count against a radian: `make bench NAME=rails`.

Arms of Universal Robots on three rails: a fast light one, a usual one, a slow heavy one. Each
follows the same seams along its rail, straight ones and ones with waves across and along. The
weight of a metre is taken from the arm's lever, from the limits of speed, from the masses, and left
at 1. For each: how often joints turn round, how much of their limits of speed they use at the
seam's pace, the least time that the limits of speed leave for the same joint path, the kinetic
energy, and how far the rail goes for each metre of the tool.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parent))

import selfmotion as sm
from selfmotion.basics import Array

URDF = """
<robot name="rail">
  <link name="rail"/>
  <link name="carriage"><inertial><mass value="{mass}"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="slide" type="prismatic">
    <parent link="rail"/> <child link="carriage"/> <axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="{speed}" effort="5000"/>
  </joint>
</robot>"""
# How long seams are [m], how long they take [s], their waves [m] and how many of these.
LENGTH, SECONDS, WAVE, WAVES = 1.6, 8.0, 0.12, 5
# Points of a seam.
POINTS = 161


class Rail(NamedTuple):
    """An arm, and the rail that it stands on: how fast [m/s], and its carriage's mass [kg]."""

    kind: str
    arm: str
    speed: float
    mass: float


RAILS = (
    Rail("light", "ur5", 2.0, 15.0),
    Rail("usual", "ur10", 1.0, 150.0),
    Rail("heavy", "ur10", 0.3, 600.0),
)


class Found(NamedTuple):
    """What is measured of a plan."""

    reversals: float
    speed: float
    least: float
    energy: float
    rail: float


def on_rail(rail: Rail, folder: Path) -> sm.RobotModel:
    """Load an arm on its rail."""
    file = folder / f"{rail.kind}.urdf"
    file.write_text(URDF.format(speed=rail.speed, mass=rail.mass))
    return sm.load_robot(
        {"rail": file, "arm": rail.arm}, on={"arm": "rail/carriage"}, tool="arm/tool0"
    )


def weights(robot: sm.RobotModel) -> dict[str, float]:
    """Return what a metre may count [rad], by where that is taken from."""
    slides = np.array([robot.is_prismatic(name) for name in robot.joint_names])
    limits = robot.velocity_limit
    energy = sm.costs.KineticEnergy(robot)
    matrix = np.diag(inertia(energy, robot.home))
    return {
        "1": 1.0,
        "lever": float(robot.joint_weights[slides][0]),
        "speed": float(np.mean(limits[~slides]) / limits[slides][0]),
        "inertia": float(np.sqrt(matrix[slides][0] / np.mean(matrix[~slides]))),
    }


def inertia(energy: sm.costs.KineticEnergy, q: Array) -> Array:
    """Return M(q), of kinetic energies at unit speeds."""
    n = len(q)
    units = np.eye(n)
    pairs = [units[i] + units[j] for i in range(n) for j in range(n)]
    own = 2.0 * energy._energy.kinetic(np.tile(q, (n, 1)), units)
    both = 2.0 * energy._energy.kinetic(np.tile(q, (n * n, 1)), np.array(pairs)).reshape(n, n)
    return np.asarray(0.5 * (both - own[:, None] - own))


def seams(robot: sm.RobotModel, number: int) -> list[sm.paths.Path]:
    """Return seams along the rail, before the arm."""
    found = []
    for seed in range(number):
        rng = np.random.default_rng(seed)
        x, z = rng.uniform(0.45, 0.65), rng.uniform(0.1, 0.4)
        share = np.linspace(0.0, 1.0, POINTS)
        # Waves begin and end flat.
        waves = np.sin(np.pi * share) ** 2 * np.sin(2.0 * np.pi * WAVES * share)
        size = WAVE * rng.uniform(-1.0, 1.0, 3) * (seed % 2)
        line = np.stack([0.0 * share + x, LENGTH * (share - 0.5), 0.0 * share + z], axis=1)
        down = np.tile([0.0, 1.0, 0.0, 0.0], (POINTS, 1))
        found.append(sm.paths.Polyline(line + waves[:, None] * size, down, tolerance=5e-3))
    return [sm.paths.Feed(path, LENGTH / SECONDS, acceleration=2.0) for path in found]


def measured(plan: sm.Plan) -> Found:
    """Return what is measured of a plan."""
    motion, robot = plan.trajectory, plan.robot
    t = np.linspace(motion.t[0], motion.t[-1], 4001)
    q, qd = motion(t), motion(t, 1)
    use = np.abs(qd) / robot.velocity_limit
    energy = sm.costs.KineticEnergy(robot)._energy.kinetic(q, qd)
    slide = next(k for k, name in enumerate(robot.joint_names) if robot.is_prismatic(name))
    tool = robot.chain.along(q)[2]
    way = np.linalg.norm(np.diff(tool, axis=0), axis=1).sum()
    return Found(
        float(sum(len(times) for times in plan.reversals.times.values())),
        100.0 * float(use.max()),
        float(np.trapezoid(use.max(axis=1), t)),
        float(np.trapezoid(energy, t)) / float(t[-1]),
        float(np.abs(np.diff(q[:, slide])).sum() / way),
    )


def main(number: Annotated[int, typer.Option(help="How many seams.")] = 8) -> None:
    """Plan seams at each weight, and print a table."""
    console = Console(width=120)
    table = Table("rail", "weight from", "1 m as", "reversals", "speed used", "least time",
                  "mean energy", "rail per m", "plans")  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        for rail in RAILS:
            robot = on_rail(rail, Path(name))
            for origin, weight in weights(robot).items():
                slides = [robot.is_prismatic(joint) for joint in robot.joint_names]
                cost = sm.costs.JointVelocity(np.where(slides, weight**2, 1.0))
                found = []
                for path in seams(robot, number):
                    limits = [sm.constraints.JointPositionLimits()]
                    problem = sm.Problem(
                        robot, path, "pointing", start="free", costs=[cost], constraints=limits,
                        clearance=None,
                    )  # fmt: skip
                    plan = sm.plan(problem, search=sm.Search(starts=12, finalists=1))
                    if plan.certificate.verified:
                        found.append(measured(plan))
                median = Found(*np.median(np.array(found), axis=0).tolist())
                table.add_row(
                    f"{rail.kind}: {rail.arm}, {rail.speed:g} m/s, {rail.mass:g} kg",
                    origin,
                    f"{weight:.2f} rad",
                    f"{median.reversals:.0f}",
                    f"{median.speed:.0f} %",
                    f"{median.least:.2f} s",
                    f"{median.energy:.2f} J",
                    f"{median.rail:.2f} m",
                    str(len(found)),
                )
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
