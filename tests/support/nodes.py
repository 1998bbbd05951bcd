"""Motions of nodes, for the laws of Newton's method."""

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array, Counts
from selfmotion.model.follow import completed
from selfmotion.model.motion import Trajectory
from selfmotion.planning.formulation import BoundConditions, Formulation
from selfmotion.planning.nodes import NodeGrid, NodeMotion
from selfmotion.planning.nodes.local_model import LocalModel
from selfmotion.planning.rollout import converged_minimum_norm
from support.arms import Case


def problem_of(case: Case, **options) -> sm.Problem:
    """Return a case's problem, free of limits and of rest unless asked for."""
    robot, task, start, path = case
    return sm.Problem(
        robot, path, task, start, **{"constraints": (), "rest": False, "clearance": None, **options}
    )


def nodes_of(problem: sm.Problem, count: int = 12, *, free: bool = False) -> NodeMotion:
    """Return the nodes at x = 0."""
    start = np.array(problem.given_start)
    formulation = Formulation.of(problem)
    minimum_norm, _ = converged_minimum_norm(formulation, _all_of(formulation, start))
    trajectory = Trajectory(
        minimum_norm.grid.nodes, minimum_norm.q, minimum_norm.qd, formulation.coordinates.names
    )
    # Where nothing is asked, these laws are those of motions without any limits.
    ends = minimum_norm.start, minimum_norm.end
    apart = [item for item in problem.clearances if not item.is_no_overlap]
    whole = problem.constraints or apart or problem.relaxations
    conditions = formulation.conditions(*ends) if whole else BoundConditions()
    t = np.linspace(0.0, problem.path.duration, count + 1)
    grid = NodeGrid(formulation, t, conditions, free=free, counts=Counts())
    motion = grid.near(trajectory(t), trajectory(t, 1))
    assert motion is not None
    return motion


def _all_of(formulation: Formulation, q: Array) -> Array:
    return np.asarray(completed(formulation.follows, np.zeros(1), q[None])[0])


def moved(motion: NodeMotion, step: Array) -> NodeMotion:
    """Return the nodes at other coordinates w (N + 1, 3r) of the same charts."""
    z, nu, alpha = np.split(step, 3, axis=1)
    rates = motion.nu + nu, motion.alpha + alpha
    place = motion.charts.at(z, *rates)
    assert place is not None
    return NodeMotion(motion.grid, motion.charts, *rates, place)


def centred(motion: NodeMotion) -> NodeMotion:
    """Return the same nodes with charts around them."""
    place = motion.place
    found = motion.grid.near(place.q, place.qd, place.qdd)
    assert found is not None
    return found


def around_of(motion: NodeMotion, force: Array | None = None) -> LocalModel:
    """Return how nodes at the reference of their charts move, for λ (N + 1, 3, n) or none."""
    force = np.zeros_like(motion.place.nodes) if force is None else force
    scale = np.ones(3 * motion.nu.shape[1])
    found = LocalModel.of(motion.charts, motion.nu, motion.alpha, motion.place, force, scale)
    assert found is not None
    return found


def along(motion: NodeMotion, changes: Array, step: Array) -> Array:
    """Return how y of each interval changes along a step w (N + 1, 3r), (N, 6, n)."""
    return motion.grid.spline.changes(changes).along(step)


def random_step(motion: NodeMotion, seed: int, size: float = 1.0) -> Array:
    """Return coordinates w of that size, 0 where they are held."""
    r = motion.nu.shape[1]
    step = size * np.random.default_rng(seed).normal(size=(len(motion.nu), 3 * r))
    step.reshape(-1)[motion.grid.held] = 0.0
    return step
