"""Steps that no motion takes are found, and chains do without them."""

import sys

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import ChainSegment, ChainSegments
from selfmotion.planning.search.segments import jumps_of
from support.arms import robot_named

# Arms and tasks: redundancy 1, by a joint or by a row that is free.
ARMS = [("panda", "pose"), ("xarm7", "pose"), ("ur10", "pointing"), ("planar_3r", "planar")]
COUNT = 30
# Of the path that needs several chains.
WAYPOINTS = 40


def motion(name: str, task: str) -> tuple[sm.Problem, Array, Array]:
    """A problem, times (COUNT,), and a motion that follows the path, (COUNT, n)."""
    robot = robot_named(name)
    start = robot.dexterous_configuration(task)
    pose = robot.pose(start)
    path = sm.paths.Circle.around(pose, 0.08, 6.0, turns=0.6)
    problem = sm.Problem(robot, path, task, start)
    found = sm.plan(problem)
    t = np.linspace(0.0, path.duration, COUNT)
    return problem, t, np.asarray(found.trajectory(t))


def turned_over(problem: sm.Problem, time: float, q: Array) -> Array:
    """A configuration in the pose of q that is far from it, on another branch or far along this."""
    robot, rng = problem.robot, np.random.default_rng(1)
    for _ in range(300):
        seed = rng.uniform(*robot.finite_limits())
        try:
            found = robot.inverse_kinematics(problem.path.pose(time), problem.task, seed)
        except sm.errors.InverseKinematicsError:
            continue
        if np.linalg.norm(found - q) > 1.5:
            return found
    raise AssertionError("no other configuration was found")


@pytest.mark.parametrize(("name", "task"), ARMS)
def test_steps_of_a_motion_are_no_jumps_and_changes_of_branch_are(name: str, task: str) -> None:
    problem, t, q = motion(name, task)
    formulation = Formulation.of(problem)
    assert not jumps_of(formulation, t[:-1], t[1:], q[:-1], q[1:]).any()
    # However fine or coarse the motion is looked at.
    assert not jumps_of(formulation, t[:-3], t[3:], q[:-3], q[3:]).any()
    other = turned_over(problem, t[10], q[10])
    broken = np.array([*q[:10], other, *q[11:]])
    assert jumps_of(formulation, t[:0], t[:0], q[:0], q[:0]).shape == (0,)
    found = jumps_of(formulation, t[:-1], t[1:], broken[:-1], broken[1:])
    assert found[[9, 10]].any()
    assert not np.delete(found, [9, 10]).any()


def wound() -> sm.Problem:
    """The tool goes twice round a Panda in one sense, farther out each time."""
    angles = np.linspace(0.0, 4.0 * np.pi, 140)
    radii = 0.532 + 0.011 * angles / np.pi
    places = np.stack([-radii * np.cos(angles), -radii * np.sin(angles), np.full(140, 0.3)], axis=1)
    down = np.tile([0.0, 1.0, 0.0, 0.0], (len(places), 1))
    path = sm.paths.Feed(sm.paths.Polyline(places, down, tolerance=5e-3), 0.1, acceleration=2.0)
    return sm.Problem(robot_named("panda"), path, "pose")


def test_chains_do_without_jumps(monkeypatch: pytest.MonkeyPatch) -> None:
    # So far apart in time as on a path five times as long.
    def few(formulation: Formulation) -> np.ndarray:
        return np.linspace(0.0, formulation.path.duration, WAYPOINTS)

    monkeypatch.setattr(sys.modules["selfmotion.planning.search.guides"], "waypoint_times", few)
    segments = ChainSegments.of(Formulation.of(wound()))
    # What the samples alone would do.
    assert any(_jumps(segments, item) for item in segments._found(set()))
    found = segments.fewest(set())
    assert not any(_jumps(segments, item) for item in found)
    assert [item.first for item in found[1:]] == [item.last for item in found[:-1]]
    assert (found[0].first, found[-1].last) == (0, len(segments.t) - 1)


def test_chains_are_found_once_where_none_jumps(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, _, _ = motion("planar_3r", "planar")
    segments = ChainSegments.of(Formulation.of(problem.changed(start="free")))
    whole, calls = ChainSegments._found, []

    def noted(self: ChainSegments, forbidden: set[int]) -> list[ChainSegment]:
        calls.append(forbidden)
        return whole(self, forbidden)

    monkeypatch.setattr(ChainSegments, "_found", noted)
    found = segments.fewest({3})
    assert not any(_jumps(segments, item) for item in found)
    assert calls == [{3}]


def _jumps(segments: ChainSegments, item: ChainSegment) -> bool:
    times, q = item.t, item.q
    return bool(jumps_of(segments.formulation, times[:-1], times[1:], q[:-1], q[1:]).any())
