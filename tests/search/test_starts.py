"""Starts: on the path at any time, and carried from there to both of its ends."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.follow import Follows, within_limits
from selfmotion.planning.search import carried, start_candidates
from selfmotion.planning.search.chains import UNLIKE
from support.arms import Case, robot_named
from support.paths import line_of
from support.two_arms import both_arms

# Newton's method ends at this [m].
ON_PATH = 1e-6
TIMES = np.linspace(0.0, 1.0, 9)


def misses(problem: sm.Problem, q: np.ndarray, t: np.ndarray) -> float:
    """Return how far the tool is from the path at most, in what the task prescribes [m]."""
    (item,) = problem.follows.items
    there = zip(q, t, strict=True)
    return max(item.miss(problem.path.pose(at), one)[0] for one, at in there)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_starts_are_on_the_path_at_their_time(case: Case, share: float) -> None:
    robot, task, _, path = case
    problem = sm.Problem(robot, path, task, clearance=None)
    time = share * path.duration
    starts = start_candidates(problem.follows, 8, np.random.default_rng(3), time=time)
    assert starts
    assert misses(problem, np.array(starts), np.full(len(starts), time)) <= ON_PATH
    assert all((q >= robot.lower).all() and (q <= robot.upper).all() for q in starts)


@pytest.mark.parametrize(("name", "task"), [("ur5", "pose"), ("panda", "position")])
def test_no_two_starts_are_near_each_other(name: str, task: str) -> None:
    """Where self-motions are no curves; of an arm without one the same solutions come often."""
    robot = robot_named(name)
    follows = Follows.of(robot, line_of(robot, task), task)
    # Within one turn.
    most = np.full(robot.dof, np.pi)
    follows = within_limits(follows, np.maximum(robot.lower, -most), np.minimum(robot.upper, most))
    starts = np.array(start_candidates(follows, 40, np.random.default_rng(0)))
    assert len(starts) > 2
    apart = np.linalg.norm(starts[:, None] - starts, axis=2)
    assert (apart[~np.eye(len(starts), dtype=bool)] > UNLIKE).all()


@pytest.mark.parametrize("at", [0, 4, 8])
def test_they_are_carried_to_both_ends(case: Case, at: int) -> None:
    robot, task, start, path = case
    problem = sm.Problem(robot, path, task, start, clearance=None)
    t = TIMES * path.duration
    way, arrived = carried(problem.follows, np.array(start)[None], t)
    assert arrived.all()
    motions, arrived = carried(problem.follows, way[:, at], t, at)
    assert arrived.all()
    np.testing.assert_array_equal(motions[:, at], way[:, at])
    assert misses(problem, motions[0], t) <= ON_PATH
    # Back along the same way, as far as steps of finite length know it.
    assert np.abs(motions - way).max() <= 0.2


@pytest.mark.parametrize("number", [0, 8, 10, 21])
def test_within_narrow_limits_there_are_some_as_well(number: int) -> None:
    """Of two arms at once, whose hands hold on to each other: within limits around a motion."""
    follows, start = both_arms("pose", "pose")
    rng = np.random.default_rng(number)
    below, above = rng.uniform(0.0, 0.5, (2, len(start)))
    lower, upper = start - below, start + above
    starts = start_candidates(within_limits(follows, lower, upper), 8, np.random.default_rng(0))
    assert starts
    # None is near another one.
    apart = np.linalg.norm(np.array(starts)[:, None] - starts, axis=2)
    assert (apart[~np.eye(len(starts), dtype=bool)] > UNLIKE).all()
    for q in starts:
        assert ((q >= lower) & (q <= upper)).all()
        for item in follows.items:
            assert max(item.miss(item.path.pose(0.0), q)) <= ON_PATH
