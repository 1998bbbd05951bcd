"""Which starts are looked at more closely: all are there, unlike ones first."""

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.motion import Grid
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.planner.screening import ONE_VALLEY, most_promising
from selfmotion.planning.search import carried, start_candidates
from support.arms import robot_named
from support.paths import line_of

# Newton's method ends where a correction is below 1e-6, which leaves its square.
ON_PATH = 1e-9


def apart(motion: Array, others: Array) -> Array:
    return np.asarray(np.abs(others - motion).max(axis=(1, 2)))


def test_carried_motions_follow_the_path_and_unlike_ones_come_first() -> None:
    robot = robot_named("panda")
    problem = sm.Problem(robot, line_of(robot, "pose"))
    formulation = Formulation.of(problem)
    grid = Grid.aligned(formulation.knots, 12)
    starts = start_candidates(problem.follows, 24, np.random.default_rng(0))
    motions, arrived = carried(problem.follows, np.array(starts), grid.nodes)
    order = most_promising(formulation, starts, motions, arrived, grid.nodes, apart)
    assert sorted(order) == list(range(len(starts)))
    motions, arrived = motions[order], arrived[order]
    assert arrived.any()
    for motion in motions[arrived]:
        for t, q in zip(grid.nodes, motion, strict=True):
            assert max(sm.Task.POSE.miss(problem.path.pose(float(t)), robot.pose(q))) < ON_PATH
    # Where the first one comes that is near one before, only such or impassable ones follow.
    alone = [
        bool(arrived[k]) and bool((apart(motions[k], motions[:k][arrived[:k]]) > ONE_VALLEY).all())
        for k in range(len(order))
    ]
    assert alone == sorted(alone, reverse=True)
    assert alone[0]
