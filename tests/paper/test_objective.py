"""F, its gradient and its metric equal central differences."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Grid, NullMotionTable, PolynomialNullMotion
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.paper import Objective
from selfmotion.planning.rollout import FixedStart, MinimumNormMotion, Rollout
from support.arms import (
    PANDA_HOME,
    Case,
    central_difference,
    objective_of,
    robot_named,
    short_line,
    start_of,
)
from support.random_cells import LEFT, RIGHT, random_cell, random_follows
from support.rollouts import assert_sensitivities, rollout_of


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_metric_is_the_differenced_gauss_newton_matrix(
    panda: sm.RobotModel, order: int
) -> None:
    """∫ (∂q^(k)/∂x)ᵀ W (∂q^(k)/∂x) dt, the derivatives by central differences of motions."""
    cost = (sm.costs.JointVelocity(), sm.costs.JointAcceleration(), sm.costs.JointJerk())[order - 1]
    path = short_line(panda, PANDA_HOME)
    motion = PolynomialNullMotion(3, "joint")
    problem = sm.Problem(panda, path, "pose", PANDA_HOME, motion, costs=[cost], constraints=())
    formulation = Formulation.of(problem)
    objective = Objective.of(
        formulation, MinimumNormMotion.on(formulation, PANDA_HOME, Grid.aligned(path.knots, 12))
    )
    x = 0.05 * np.random.default_rng(0).normal(size=objective.size)
    sampling = objective.grid.sampling

    def derivative(x: Array) -> Array:
        samples = objective.samples(x)
        table = samples.qd if order == 1 else (samples.qdd if order == 2 else samples.qddd)
        return table.copy()

    step = 1e-5
    tangent = np.stack(
        [(derivative(x + e) - derivative(x - e)) / (2 * step) for e in step * np.eye(len(x))],
        axis=2,
    )
    weight = cost.curvature(7)[order]
    expected = np.einsum("s,sid,ij,sje->de", sampling.weights, tangent, weight, tangent)
    metric = objective.metric(x)
    np.testing.assert_allclose(metric, expected, atol=1e-6 * np.abs(expected).max())


# Exact gradients against central differences of F, relative to the gradient's largest entry.
GRADIENT = 1e-6
# The same motion by another rollout [rad].
ROUNDING = 1e-13


def assert_same(q: Array, expected: Array) -> None:
    np.testing.assert_allclose(q, expected, rtol=0, atol=ROUNDING)


COSTS = {
    "velocity": lambda r, t: sm.costs.JointVelocity(),
    "weighted velocity": lambda r, t: sm.costs.JointVelocity(np.arange(1.0, r.dof + 1.0)),
    "full weight": lambda r, t: sm.costs.JointVelocity(np.eye(r.dof) + 0.3),
    "acceleration": lambda r, t: sm.costs.JointAcceleration(),
    "jerk": lambda r, t: sm.costs.JointJerk(),
    "posture": lambda r, t: sm.costs.Posture(np.arange(1.0, r.dof + 1.0), posture=np.ones(r.dof)),
    "joint limits": lambda r, t: sm.costs.JointLimitDistance(r.lower, r.upper),
    "path length": lambda r, t: sm.costs.PathLength(),
    "reversals": lambda r, t: sm.costs.JointReversals(0.5, speed=0.2),
    "inverse manipulability": lambda r, t: sm.costs.InverseManipulability(0.01),
    "manipulability": lambda r, t: sm.costs.Manipulability(0.7),
    "directional": lambda r, t: sm.costs.DirectionalManipulability(np.arange(1.0, t.dimension + 1)),
    "smallest singular value": lambda r, t: sm.costs.SmallestSingularValue(),
    "kinetic energy": lambda r, t: sm.costs.KineticEnergy(r),
    "gravity torque": lambda r, t: sm.costs.GravityTorque(r),
    "function": lambda r, t: sm.costs.FunctionCost(
        lambda qd, q, t: np.sin(q).sum(axis=1) * (qd**2).sum(axis=1) + t * q[:, 0]
    ),
}


@pytest.mark.parametrize("cost", COSTS)
def test_gradient_equals_central_differences(case: Case, cost: str) -> None:
    robot, task, start, path = case
    rollout = rollout_of(case, 8)
    functions = PolynomialNullMotion(2, "joint").functions(rollout.grid.stage_times, path.duration)
    table = NullMotionTable(functions, None, robot.dof)
    objective = objective_of(rollout, table, [COSTS[cost](robot, task)], FixedStart(start))
    x = 0.1 * np.random.default_rng(7).normal(size=objective.size)
    exact = objective.gradient(x)
    differences = central_difference(objective.value, x, 1e-5)
    # Where the self-motion leaves a cost unchanged (UR's last joint), rounding of F remains.
    scale = max(np.abs(differences).max(), 1e-2 * abs(objective.value(x)))
    assert np.abs(exact - differences).max() <= GRADIENT * scale


@pytest.mark.parametrize("seed", range(12))
def test_gradient_with_several_tips_and_moving_frames(seed: int, tmp_path: Path) -> None:
    """Cells made at random: to seven digits, differences extrapolated."""
    rng = np.random.default_rng(seed)
    robot = sm.load_robot(random_cell(rng, tmp_path), tool=(LEFT, RIGHT))
    _, follows, start = random_follows(rng, robot)
    rollout = Rollout(follows, Grid.aligned(follows.items[0].path.knots, 10))
    functions = PolynomialNullMotion(2, "joint").functions(rollout.grid.stage_times, 2.0)
    table = NullMotionTable(functions, None, robot.dof)
    costs = [
        sm.costs.JointVelocity(),
        sm.costs.InverseManipulability(1e-3),
        sm.costs.KineticEnergy(robot),
    ]
    objective = objective_of(rollout, table, costs, FixedStart(start))
    x = 0.05 * rng.normal(size=objective.size)
    exact = objective.gradient(x)
    fine, coarse = (central_difference(objective.value, x, step) for step in (1e-4, 2e-4))
    differences = (4.0 * fine - coarse) / 3.0
    assert np.abs(exact - differences).max() <= 1e-7 * max(np.abs(differences).max(), 1.0)


def test_panda_gradient_to_seven_digits() -> None:
    """50 steps, 6 rows; differences extrapolated so that their own error is far below."""
    robot = robot_named("panda")
    start = start_of(robot, "pose")
    path = sm.paths.Circle.around(robot.pose(start), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    rollout = Rollout(Follows.of(robot, path, sm.Task.POSE), Grid.aligned(path.knots, 50))
    functions = PolynomialNullMotion(3, "joint").functions(rollout.grid.stage_times, 4.0)
    table = NullMotionTable(functions, None, robot.dof)
    costs = [sm.costs.JointVelocity(), sm.costs.InverseManipulability(0.01)]
    objective = objective_of(rollout, table, costs, FixedStart(start))
    x = 0.05 * np.random.default_rng(13).normal(size=objective.size)
    exact = objective.gradient(x)
    coarse = central_difference(objective.value, x, 2e-3)
    fine = central_difference(objective.value, x, 1e-3)
    differences = (4.0 * fine - coarse) / 3.0
    assert np.abs(exact - differences).max() <= 1e-7 * np.abs(differences).max()


def test_sensitivities_equal_central_differences(case: Case) -> None:
    robot, _, start, path = case
    rollout = rollout_of(case, 20)
    functions = PolynomialNullMotion(1, "joint").functions(rollout.grid.stage_times, path.duration)
    table = NullMotionTable(functions, None, robot.dof)
    x = 0.1 * np.random.default_rng(9).normal(size=table.size)
    assert_sensitivities(rollout, table, start, x, GRADIENT)


def test_a_free_start_is_a_variable_and_a_guide_stands_for_no_null_motion() -> None:
    robot = robot_named("panda")
    start = start_of(robot, "pose")
    problem = sm.Problem(robot, short_line(robot, start), "pose", start, rest=False)
    formulation = Formulation.of(problem)
    steps = Grid.aligned(formulation.knots, 12)
    minimum_norm = MinimumNormMotion.on(formulation, start, steps)
    given, free = (Objective.of(formulation, minimum_norm, free=free) for free in (False, True))
    assert free.size == given.size + 1
    zero = np.zeros(given.size)
    assert_same(given.samples(zero).q[steps.node_stages], minimum_norm.q)

    def guide(t: Array) -> Array:
        return np.tile(0.3 * np.eye(7)[0], (len(t), 1))

    guided = MinimumNormMotion.on(formulation, start, steps, guide)
    assert np.abs(guided.q[-1] - minimum_norm.q[-1]).max() > 1e-3
    along = Objective.of(formulation, guided)
    assert_same(along.samples(zero).q[steps.node_stages], guided.q)
    # What is given in its place counts instead.
    around = np.zeros((len(steps.stage_times), 7))
    back = Objective.of(formulation, guided, around=around)
    assert_same(back.samples(zero).q[steps.node_stages], minimum_norm.q)
