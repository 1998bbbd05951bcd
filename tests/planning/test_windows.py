"""Bands in several windows: each holds in its own, and allowing more never costs more."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import completed, with_tolerances
from selfmotion.planning.formulation import Formulation

# Two optima of one problem, found from different nodes, differ by so much of their cost.
SAME_OPTIMUM = 5e-4
# What certificates count as on the path [m or rad].
ON_PATH = 1e-6

R = sm.Relaxation
EARLY, LATE = (0.0, 1.5), (2.0, 4.0)
# What is relaxed late, and what is so early besides, by less.
PAIRS = {
    "z": (R("z", 8e-3, LATE), R("z", 1e-3, EARLY)),
    "cone": (R(("rx", "ry"), 0.2, LATE), R(("rx", "ry"), 0.02, EARLY)),
    "rz": (R("rz", during=LATE), R("rz", 0.02, EARLY)),
    "some of them": (R(("x", "y", "z"), 0.01, LATE), R(("x", "y"), 1e-3, EARLY)),
}


def deviations(plan: sm.Plan, t: Array) -> Array:
    """Return x, y, z [m] in world axes and rx, ry, rz [rad] in those of the path's tool, (N, 6)."""
    found = []
    for time, q in zip(t, plan.trajectory(t), strict=True):
        path, tool = plan.path.pose(time), plan.robot.pose(q)
        turn = pin.log3(path.rotation.T @ tool.rotation)
        found.append(np.concatenate([tool.translation - path.translation, turn]))
    return np.array(found)


@pytest.mark.parametrize(
    ("rows", "given"), [*((rows, True) for rows in PAIRS), ("z", False), ("rz", False)]
)
def test_a_band_in_one_more_window_costs_no_more(
    panda_circle: Callable, rows: str, given: bool
) -> None:
    late, early = PAIRS[rows]
    problem = panda_circle(relaxations=[late])
    problem = problem if given else dataclasses.replace(problem, start=None)
    one = sm.plan(problem)
    both = sm.plan(dataclasses.replace(problem, relaxations=[early, late]))
    assert one.certificate.verified, one.certificate.verdict
    assert both.certificate.verified, both.certificate.verdict
    assert both.report.cost <= one.report.cost * (1.0 + SAME_OPTIMUM)
    # Each is made use of, and no more than that.
    t = np.linspace(0.0, 4.0, 201)
    away = deviations(both, t)
    for item in (early, late):
        first, last = item.during
        sizes = np.linalg.norm(away[(t >= first) & (t <= last)][:, item.indices], axis=1)
        assert 0.9 * min(item.band, 0.3) < sizes.max() <= item.band + ON_PATH
    between = (t > EARLY[1]) & (t < LATE[0])
    assert np.abs(away[between]).max() < ON_PATH
    # What is said of them tells one from the other.
    told = {found.name for found in both.certificate.deviations}
    assert told == {f"{early.name} at 0 to 1.5 s", f"{late.name} at 2 to 4 s"}
    assert {item.constraint for item in both.report.active} <= {f"relaxation {x}" for x in told}
    # The judge tells the windows apart: the early band at all times is not kept.
    if np.isfinite(late.band):
        narrow = dataclasses.replace(late, band=early.band)
        asked = dataclasses.replace(both.problem, relaxations=[early, narrow])
        check = dataclasses.replace(both, problem=asked).check()
        assert "off the path, beyond its tolerances, at t = " in check.verdict


def test_the_widest_band_says_what_a_pose_may_be() -> None:
    """Where no time is known: by all sets of bands that hold together at some time."""
    robot = sm.load_robot("panda")
    pose = robot.pose(robot.dexterous_configuration())
    cones = [R(("rx", "ry"), 0.02, EARLY), R(("rx", "ry"), 0.2, LATE)]
    slides = [R(("x", "y"), 3e-3, EARLY), R(("y", "z"), 4e-3, LATE)]
    problem = sm.Problem(robot, sm.paths.Dwell(pose, 4.0), relaxations=[*cones, *slides])
    virtual = with_tolerances(problem.follows, problem.relaxations).virtual
    wanted = {(3, 4): 0.2, (0, 1): 4e-3, (1, 2): 4e-3, (0,): 3e-3, (1,): 4e-3, (0, 2): 4e-3}
    found = {rows: virtual.widest(rows) for rows in wanted}
    assert found == pytest.approx(wanted)
    # Poses of the arm tilted about the tool's x axis are admitted up to the wider cone, not beyond.
    formulation = Formulation.of(problem)
    admits = formulation.envelope.admits
    tilted = [robot.inverse_kinematics(pose * tilt(angle)) for angle in (0.1, 0.199, 0.21)]
    q = completed(formulation.follows, np.full(3, 3.0), np.array(tilted))
    assert admits(q).tolist() == [True, True, False]


def tilt(angle: float) -> pin.SE3:
    return pin.SE3(pin.exp3(np.array([angle, 0.0, 0.0])), np.zeros(3))
