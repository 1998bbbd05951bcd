"""When the search looks at the path."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import completed, single_tip
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import carried, chain_shortening, shortest_along
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.search_times import STRIDE, search_times
from selfmotion.planning.search.shortest import Shortest
from support.arms import PANDA_HOME
from support.stretching import DURATION, rounded_problem, stretching


def level(x: float, y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


@pytest.mark.parametrize("waypoints", [2, 3, 60, 199, 1000])
def test_the_search_looks_at_neither_too_few_nor_too_many_times(waypoints: int) -> None:
    rng = np.random.default_rng(waypoints)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 1.0, waypoints - 1))])
    poses = [level(2.0 + 0.5 * time / times[-1], 1.0) for time in times]
    t = search_times(sm.paths.Waypoints.from_poses(times, poses), 60)
    assert (t[0], t[-1]) == (0.0, times[-1])
    assert 60 <= len(t) <= 401
    assert np.diff(t).min() > 0.0


def test_the_search_looks_as_the_tool_moves_on() -> None:
    """However the path is timed, and whether it moves or turns; at pauses hardly at all."""
    poses = [level(2.0, 1.0), level(4.0, 1.0), level(4.0, 1.0), level(4.0, -1.0)]
    path = sm.paths.Waypoints.from_poses(np.array([0.0, 1.0, 5.0, 9.0]), poses)
    t = search_times(path, 60)
    tool = path.samples(t).translation
    strides = np.linalg.norm(np.diff(tool, axis=0), axis=1)
    # 0.02 m, by interpolation between 2,000 looks.
    assert strides.max() < 0.022
    assert np.sum((t > 1.0) & (t < 5.0)) < 0.1 * len(t)


@pytest.mark.parametrize("strides", [150.01, 199.99, 250.5])
def test_no_stride_of_the_search_is_longer_than_the_longest(strides: float) -> None:
    """And there are no more times than that takes."""
    length = strides * STRIDE
    line = sm.paths.Line(level(0.0, 0.0), level(length, 0.0), 3.0, time_law="constant")
    t = search_times(line, 2)
    assert len(t) == np.ceil(strides) + 1
    assert np.diff(line.samples(t).translation[:, 0]).max() <= STRIDE * (1.0 + 1e-9)


def test_chains_keep_a_little_of_limits_and_speeds_for_what_is_between_waypoints(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = panda.dexterous_configuration()
    path = sm.paths.Circle.around(panda.pose(start), 0.05, 4.0, normal=(1.0, 0.0, 0.0))
    fastest = 0.7
    limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits(fastest)]
    formulation = Formulation.of(sm.Problem(panda, path, constraints=limits, clearance=None))
    noted: list[tuple[SearchBounds, Array]] = []

    class Noted(Shortest):
        def __init__(self, waypoints: OnPath, bounds: SearchBounds, steps: Array, weights: Array):
            noted.append((bounds, steps))
            super().__init__(waypoints, bounds, steps, weights)

    monkeypatch.setattr(chain_shortening, "Shortest", Noted)
    t = np.array([0.0, 1.0, 1.5, 2.0, 3.0, 4.0])
    motions, arrived = carried(formulation.follows, start[None], t)
    assert arrived.all()
    assert shortest_along(formulation, t, motions[0], t, (1.0,)) is not None
    ((bounds, steps),) = noted
    allowed = formulation.envelope
    for kept in (bounds.lower - allowed.lower, allowed.upper - bounds.upper):
        assert (kept > 0.0).all()
        assert kept.max() < 1e-3
    shares = steps / (fastest * np.diff(t)[:, None])
    assert (shares <= 1.0).all()
    assert (shares >= 0.9).all()


def test_a_chain_passes_beside_a_pose_that_rounding_puts_out_of_reach() -> None:
    t = np.linspace(0.0, DURATION, 33)
    problem = Formulation.of(rounded_problem(costs=[sm.costs.PathLength()]))
    found = shortest_along(problem, t, stretching(t), t, (1.0, 0.3))
    assert found is not None
    where, q = found
    moved = where != t
    # A little later than the middle; all else where it was asked for.
    assert np.flatnonzero(moved).tolist() == [16]
    assert t[16] < where[16] < t[17]
    for time, here in zip(where, q, strict=True):
        assert single_tip(problem.follows).miss(problem.path.pose(float(time)), here)[0] < 1e-9


def test_chains_beside_bodies_are_shortened_with_virtual_joints(panda: sm.RobotModel) -> None:
    """These come after the arm's own, and move no bodies."""
    start = panda.dexterous_configuration()
    path = sm.paths.Circle.around(panda.pose(start), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    # Beside the forearm, near enough to be watched.
    ball = sm.constraints.Clearance([sm.obstacles.Sphere("ball", (0.2, 0.25, 0.6), 0.05)], 0.01)
    problem = sm.Problem(
        panda,
        path,
        constraints=[],
        clearance=ball,
        relaxations=[sm.Relaxation("rz", 0.3, during=(1.0, 2.0))],
    )
    formulation = Formulation.of(problem)
    t = np.linspace(0.0, 4.0, 9)
    motions, arrived = carried(
        formulation.follows, completed(formulation.follows, t[:1], start[None]), t
    )
    assert arrived.all()
    found = shortest_along(formulation, t, motions[0], t, (1.0, 0.3))
    assert found is not None
    assert found[1].shape == motions[0].shape


def test_what_is_short_is_searched_as_what_is_alone(panda: sm.RobotModel) -> None:
    """Before a long wait, a motion of a second is looked at where it is alone."""
    a, b = panda.pose(PANDA_HOME), panda.pose(PANDA_HOME)
    b.translation += [0.2, 0.3, -0.2]
    line = sm.paths.Line(a, b, 1.0)
    alone = search_times(line, 8)
    late = search_times(sm.paths.Dwell(a, 5000.0) + line, 8)
    late = late[late > 5000.0] - 5000.0
    assert len(late) >= len(alone) - 1
    # As the tool moves on: between two times it goes as far as alone.
    ways = [
        np.linalg.norm(np.diff(line.samples(t).translation, axis=0), axis=1) for t in (alone, late)
    ]
    assert ways[1].max() < 1.1 * ways[0].max()
