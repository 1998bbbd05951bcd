"""Motions of nodes, for the laws of Newton's method."""

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.engine import Counts, settled_still_motion
from selfmotion.motion import Trajectory
from selfmotion.nodes import NodeGrid, NodeMotion
from selfmotion.nodes.objective import Around
from support.arms import Case


def problem_of(case: Case, **options) -> sm.Problem:
    """Return a case's problem, free of limits and of rest unless asked for."""
    robot, task, start, path = case
    return sm.Problem(
        robot, path, task, start, **{"constraints": (), "rest": False, "collision": None, **options}
    )


def nodes_of(problem: sm.Problem, count: int = 12, *, free: bool = False) -> NodeMotion:
    """Return the nodes at x = 0."""
    start = np.array(problem.given_start)
    still, _ = settled_still_motion(problem, start)
    trajectory = Trajectory(still.grid.nodes, still.q, still.qd, problem.robot.joint_names)
    constraints = problem.bind_constraints(start, still.end)
    t = np.linspace(0.0, problem.path.duration, count + 1)
    grid = NodeGrid(problem, t, constraints, free=free, counts=Counts())
    motion = grid.near(trajectory(t), trajectory(t, 1))
    assert motion is not None
    return motion


def moved(motion: NodeMotion, step: Array) -> NodeMotion:
    """Return the nodes at other coordinates w (N + 1, 2r) of the same charts."""
    r = motion.nu.shape[1]
    nu = motion.nu + step[:, r:]
    place = motion.charts.at(step[:, :r], nu)
    assert place is not None
    return motion.grid.at(motion.charts, nu, place)


def centred(motion: NodeMotion) -> NodeMotion:
    """Return the same nodes with charts around them."""
    found = motion.grid.near(motion.place.q, motion.place.qd)
    assert found is not None
    return found


def around_of(motion: NodeMotion, by_node: Array | None = None) -> Around:
    """Return how nodes at the reference of their charts move, for slopes (N + 1, 2, n) or none."""
    count, n, _ = motion.charts.bases.shape
    slopes = np.zeros((count, 2, n)) if by_node is None else by_node
    found = Around.of(motion.charts, motion.nu, slopes)
    assert found is not None
    return found


def random_step(motion: NodeMotion, seed: int, size: float = 1.0) -> Array:
    """Return coordinates w of that size, 0 where they are held."""
    r = motion.nu.shape[1]
    step = size * np.random.default_rng(seed).normal(size=(len(motion.nu), 2 * r))
    step.reshape(-1)[motion.grid.held] = 0.0
    return step
