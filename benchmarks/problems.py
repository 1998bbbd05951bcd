"""The problems that the benchmarks measure."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import selfmotion as sm

DATA = Path(__file__).parent / "data"
PANDA_HOME = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])


def circle(name: str, task: str, **options: object) -> sm.Problem:
    """Return the problem of an arm on a vertical circle of 0.15 m in 4 s."""
    robot = sm.load_robot(name)
    start = PANDA_HOME if name == "panda" else robot.dexterous_configuration(task)
    path = sm.Circle.around(robot.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.Problem(robot, path, task, start, **options)


def suite_path(name: str, **options: object) -> sm.Problem:
    """Return a Panda problem of `data`, without its obstacles."""
    description = json.loads((DATA / name / "problem.json").read_text())
    robot = sm.load_robot("panda", tool=description["tip_frame"])
    path = sm.Waypoints.from_csv(DATA / name / "path.csv")
    return sm.Problem(robot, path, **options)


def chain(joints: int, degree: int = 3) -> sm.Problem:
    """Return the problem of a planar chain of unit reach along a short line."""
    robot = sm.load_robot(_chain_urdf(joints))
    start = np.full(joints, 1.2 / joints)
    start[0] = -0.6
    pose = robot.pose(start)
    end = pose.copy()
    end.translation = pose.translation + np.array([-0.15, 0.1, 0.0])
    return sm.Problem(
        robot,
        sm.Line(pose, end, 1.0),
        "planar",
        start,
        null_motion=sm.PolynomialNullMotion(degree),
    )


def _chain_urdf(joints: int) -> Path:
    """Write the URDF of a chain of `joints` equal links, total length 1 m, and return its path."""
    folder = Path(__file__).parent.parent / "out" / "chains"
    folder.mkdir(parents=True, exist_ok=True)
    parts = ['<robot name="chain">', '<link name="link0"/>']
    for k in range(1, joints + 1):
        offset = 0.0 if k == 1 else 1.0 / joints
        parts.append(
            f'<joint name="joint{k}" type="revolute"><parent link="link{k - 1}"/>'
            f'<child link="link{k}"/><origin xyz="{offset} 0 0"/><axis xyz="0 0 1"/>'
            f'<limit lower="-3" upper="3" velocity="10" effort="1"/></joint><link name="link{k}"/>'
        )
    parts.append(
        f'<joint name="end" type="fixed"><parent link="link{joints}"/><child link="tool"/>'
        f'<origin xyz="{1.0 / joints} 0 0"/></joint><link name="tool"/></robot>'
    )
    file = folder / f"chain_{joints}.urdf"
    file.write_text("\n".join(parts))
    return file
