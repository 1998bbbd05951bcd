"""Motions side by side are each what they are alone, and become rough optima."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, Counts
from selfmotion.model.follow import null_basis
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.nodes import Batch, NodeGrid, NodeMotion, Step, batch, minimise
from selfmotion.planning.nodes.motion import stepped
from selfmotion.planning.nodes.settings import SETTINGS
from support.arms import PANDA_HOME, Case
from support.nodes import problem_of

# Side by side, solvers and sums take another order.
ROUNDING = 1e-9
# Of a rough optimum: the next step promised less than 1e-3 of it.
ROUGH = 2e-3
INTERVALS, ROUNDS = 8, 6


def grid_of(problem: sm.Problem) -> NodeGrid:
    start = np.array(problem.given_start)
    t = np.linspace(0.0, problem.path.duration, INTERVALS + 1)
    formulation = Formulation.of(problem)
    bound = formulation.conditions(start, start)
    return NodeGrid(formulation, t, bound, free=True, counts=Counts())


def motions_of(problem: sm.Problem, count: int = 4, size: float = 0.15) -> Array:
    """Return motions near the path, each somewhere else on the self-motions, (K, N + 1, n)."""
    robot, start = problem.robot, np.array(problem.given_start)
    rng = np.random.default_rng(3)
    found = []
    for _ in range(count):
        null = null_basis(problem.follows, start)
        q = start + null @ rng.normal(scale=size, size=null.shape[1])
        found.append(np.tile(q, (INTERVALS + 1, 1)))
    assert robot.dof == found[0].shape[1]
    return np.array(found)


def advanced(found: Batch, rounds: int = ROUNDS) -> Batch:
    for _ in range(rounds):
        found = found.advanced()
    return found


def agrees(together: Batch, motions: Array, grid: NodeGrid, rounds: int) -> bool:
    for k in range(len(motions)):
        alone = advanced(Batch.near(grid, motions[[k]]), rounds)
        mine, own = together.costs[k], alone.costs[0]
        if not abs(mine - own) <= ROUNDING * abs(own):
            return False
        if np.abs(together.q[k] - alone.q[0]).max() > 1e3 * ROUNDING:
            return False
    return True


@pytest.mark.parametrize("rounds", [0, 3])
def test_each_is_what_it_is_alone(case: Case, rounds: int) -> None:
    """Whatever is beside it, before Newton's method and after some of its steps."""
    problem = problem_of(case)
    grid, motions = grid_of(problem), motions_of(problem)
    together = advanced(Batch.near(grid, motions), rounds)
    assert agrees(together, motions, grid, rounds)
    # In another order they are others: the law says something.
    if rounds == 0 and problem.follows.redundancy and len(np.unique(together.costs.round(9))) > 1:
        assert not agrees(together, motions[::-1], grid, rounds)


@pytest.mark.parametrize("rest", [False, True])
def test_each_is_what_it_is_alone_with_other_costs(panda: sm.RobotModel, rest: bool) -> None:
    """Of costs that are no quadratic forms, also of accelerations; each step lowers them."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    for more in (sm.costs.InverseManipulability(1e-3), sm.costs.JointAcceleration(1e-2)):
        problem = sm.Problem(
            *(panda, path, "position", PANDA_HOME),
            constraints=(),
            costs=[sm.costs.JointVelocity(), more],
            rest=rest,
            clearance=None,
        )
        grid, motions = grid_of(problem), motions_of(problem, size=0.4)
        before = Batch.near(grid, motions)
        after = advanced(before, 3)
        assert agrees(after, motions, grid, 3)
        assert (after.costs <= before.costs).all()
        assert (after.costs < before.costs).any()


def test_ends_at_rest_stay_at_rest(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problem = problem_of((panda, "position", PANDA_HOME, path), rest=True)
    before = Batch.near(grid_of(problem), motions_of(problem))
    after = advanced(before, 2)
    assert (after.costs < before.costs).all()
    for rates in (after.qd, after.qdd):
        assert np.abs(rates[:, [0, -1]]).max() <= ROUNDING * np.abs(rates).max()


def test_rough_optima_are_near_those_of_newtons_method(case: Case) -> None:
    problem = problem_of(case)
    grid, motions = grid_of(problem), motions_of(problem, 3, 0.1)
    rough = advanced(Batch.near(grid, motions), 2 * ROUNDS)
    found = rough.motion.grid.copied(1)
    for k in np.flatnonzero(~rough.going):
        motion = found.near(rough.q[k], rough.qd[k], rough.qdd[k])
        assert motion is not None
        assert motion.cost == pytest.approx(rough.costs[k], rel=1e-7)

        def never(step: Step) -> bool:
            return False

        optimum = minimise(motion, never)
        assert optimum.motion.cost >= (1.0 - ROUGH) * rough.costs[k]


def test_one_that_is_not_to_be_had_leaves_the_others(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0)
    problem = sm.Problem(*(panda, path, "pose", PANDA_HOME), constraints=(), clearance=None)
    grid, motions = grid_of(problem), motions_of(problem)
    alone = advanced(Batch.near(grid, np.delete(motions, 1, axis=0)), 2)
    motions[1, 3] = np.nan
    found = Batch.near(grid, motions)
    assert np.isinf(found.costs[1])
    assert np.isfinite(np.delete(found.costs, 1)).all()
    beside = advanced(found, 2)
    np.testing.assert_allclose(np.delete(beside.costs, 1), alone.costs, rtol=ROUNDING)
    assert np.isinf(beside.costs[1])


def test_some_of_them_are_what_they_were(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0)
    problem = sm.Problem(*(panda, path, "position", PANDA_HOME), constraints=(), clearance=None)
    grid, motions = grid_of(problem), motions_of(problem)
    found = advanced(Batch.near(grid, motions), 1)
    some = found.picked(np.array([3, 1]))
    np.testing.assert_array_equal(some.costs, found.costs[[3, 1]])
    np.testing.assert_array_equal(some.q, found.q[[3, 1]])
    np.testing.assert_allclose(
        advanced(some, 2).costs, advanced(found, 2).costs[[3, 1]], rtol=ROUNDING
    )


def changes_of(problem: sm.Problem, monkeypatch: pytest.MonkeyPatch, rounds: int) -> list[float]:
    """Return the largest change of a coordinate by each step that is tried."""
    begin = Batch.near(grid_of(problem), motions_of(problem))
    changes: list[float] = []

    def seen(motion: NodeMotion, step: Array) -> NodeMotion | None:
        changes.append(float(np.abs(step[:, : motion.nu.shape[1]]).max()))
        return stepped(motion, step)

    monkeypatch.setattr(batch, "stepped", seen)
    advanced(begin, rounds)
    return changes


def test_no_coordinate_changes_more_in_one_step_than_allowed(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    far = sm.costs.Posture(100.0, posture=PANDA_HOME + 1.5)
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 4.0)
    problem = problem_of((panda, "position", PANDA_HOME, path), costs=[far])
    # Whole steps would be longer.
    assert max(changes_of(problem, monkeypatch, 2)) == pytest.approx(SETTINGS.max_change)


def test_where_costs_curve_down_steps_are_long_all_the_same(
    panda: sm.RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No more is added to a matrix that is not positive definite than it needs."""
    hill = sm.costs.FunctionCost(lambda qd, q, t: -0.5 * np.sum(q**2, axis=1))
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 4.0)
    costs = [sm.costs.JointVelocity(), hill]
    problem = problem_of((panda, "position", PANDA_HOME, path), costs=costs)
    changes = changes_of(problem, monkeypatch, 2)
    assert max(changes) == pytest.approx(SETTINGS.max_change)
