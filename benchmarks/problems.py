"""The problems that the benchmarks measure."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np

import selfmotion as sm
from selfmotion.paper.study.expense import chain as planar_chain

DATA = Path(__file__).parent / "data"
PANDA_HOME = np.array(sm.NAMED_ARMS["panda"].home)


def circle(name: str, task: str, **options: object) -> sm.Problem:
    """Return the problem of an arm on a vertical circle of 0.15 m in 4 s."""
    robot = sm.load_robot(name)
    start = PANDA_HOME if name == "panda" else robot.dexterous_configuration(task)
    path = sm.paths.Circle.around(robot.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.Problem(robot, path, task, start, **options)


def suite_path(name: str, **options: object) -> sm.Problem:
    """Return a Panda problem of `data`, without its obstacles."""
    description = json.loads((DATA / name / "problem.json").read_text())
    robot = sm.load_robot("panda", tool=description["tip_frame"])
    path = sm.paths.Waypoints.from_csv(DATA / name / "path.csv")
    # The start that the peers are given, too.
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0, -0.5, 0, -2, 0, 1.6, 0.8])
    return sm.Problem(robot, path, start=start, **options)


def chain(joints: int, degree: int = 3) -> sm.Problem:
    """Return the problem of a planar chain of unit reach along a short line."""
    return dataclasses.replace(planar_chain(joints), null_motion=sm.PolynomialNullMotion(degree))
