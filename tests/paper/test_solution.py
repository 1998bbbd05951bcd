"""The published method from start to end: the paper's numbers, grids, interruptions."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import minimize

import selfmotion as sm
from selfmotion.basics import Array, Counts
from selfmotion.model.motion import BSplineNullMotion, Grid, NullMotion, PolynomialNullMotion
from selfmotion.planning.formulation import Formulation, bound_conditions
from selfmotion.planning.optimise import Function, Iteration, Minimum, Status
from selfmotion.planning.paper import PublishedMotion
from selfmotion.planning.rollout import MinimumNormMotion, converged_minimum_norm
from selfmotion.problem.constraints import BoundEnd
from support.arms import PANDA_HOME, robot_named, short_line, start_of
from support.published_method import solve

# The notes' costs are of a fine integration, and of optima that steps of 1e-8 of it end at: here
# the cost on a grid agrees with that on the halved one to this share.
AGREEMENT = 1e-4

PUBLISHED = PolynomialNullMotion(3, "joint", "monomial")


def still_of(problem: sm.Problem) -> MinimumNormMotion:
    return converged_minimum_norm(Formulation.of(problem), np.array(problem.given_start))[0]


def solved(problem: sm.Problem, **options) -> PublishedMotion:
    return solve(Formulation.of(problem), still_of(problem), **options)


def closed_circle(**options) -> PublishedMotion:
    robot = robot_named("panda")
    circle = sm.paths.Circle.around(robot.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    cubic = PolynomialNullMotion()
    problem = sm.Problem(robot, circle, "pose", PANDA_HOME, cubic, constraints=(), rest=False)
    minimum_norm = still_of(problem)
    return solve(
        Formulation.of(problem),
        minimum_norm,
        ends=ends_of(minimum_norm, [sm.constraints.ClosedPath()]),
        **options,
    )


def ends_of(
    minimum_norm: MinimumNormMotion, asked: list[sm.constraints.Constraint]
) -> tuple[BoundEnd, ...]:
    robot = minimum_norm.formulation.robot
    own = sm.constraints.Conditions.joined(item.conditions(robot) for item in asked)
    return bound_conditions(
        minimum_norm.formulation, own, minimum_norm.start, minimum_norm.end
    ).ends


@pytest.mark.parametrize(
    ("null_motion", "size", "cost"),
    [
        (PolynomialNullMotion(), 4, 10.5137),
        (PUBLISHED, 12, 10.48497),
        (PolynomialNullMotion(7), 8, 10.4931),
    ],
)
def test_the_sample_problem_costs_what_an_independent_integration_says(
    null_motion: NullMotion, size: int, cost: float
) -> None:
    found = solved(sm.sample_problem(null_motion=null_motion))
    assert found.status is Status.CONVERGED
    assert found.method.formulation.problem.null_motion == null_motion
    assert found.coefficients.shape == (size,)
    assert found.cost == pytest.approx(cost, rel=AGREEMENT)
    minimum_norm = found.minimum_norm_evaluation
    assert minimum_norm.cost == pytest.approx(15.500547, rel=AGREEMENT)
    assert minimum_norm.terms["inverse manipulability"] == pytest.approx(0.085116, rel=1e-3)
    np.testing.assert_allclose(
        minimum_norm.trajectory.q[-1], [-1.582881, 4.814126, -0.269540], atol=1e-4
    )


@pytest.mark.parametrize("null_motion", [PolynomialNullMotion(), PUBLISHED])
@pytest.mark.parametrize(("mu", "duration"), [(50.0, 1.0), (1000.0, 1.0), (1.0, 2.0)])
def test_its_variants_lead_to_optima(mu: float, duration: float, null_motion: NullMotion) -> None:
    """No coefficient changes the cost to first order, relative to what it may be changed by."""
    found = solved(sm.sample_problem(mu, duration, null_motion))
    assert found.status is Status.CONVERGED
    assert found.cost < 0.95 * found.minimum_norm_evaluation.cost
    gradient = found.objective.gradient(found.x)
    step = np.linalg.pinv(found.objective.metric(found.x), rcond=1e-4) @ gradient
    assert gradient @ step < 1e-5 * found.cost


def test_the_cost_agrees_with_that_on_a_finer_grid() -> None:
    for found in (solved(sm.sample_problem(null_motion=PUBLISHED)), closed_circle()):
        finer = found.refined()
        assert finer.steps == 2 * found.steps
        assert finer.cost == pytest.approx(found.cost, rel=AGREEMENT)
        again = finer.optimised()
        assert again.cost <= finer.cost
        # The inverse Hessian is known: nothing is left to learn.
        assert len(again.history) <= len(found.history) + 3


def test_a_solution_knows_its_motion() -> None:
    found = closed_circle(free=True)
    evaluation, minimum_norm = found.evaluation, found.minimum_norm_evaluation
    assert found.nodes.shape == (found.steps + 1, 7)
    assert evaluation.cost == pytest.approx(found.cost, rel=1e-12)
    np.testing.assert_allclose(evaluation.trajectory.q, found.nodes, atol=1e-5)
    np.testing.assert_allclose(minimum_norm.trajectory.q[0], PANDA_HOME, atol=1e-9)
    # A free start moved, and costs less.
    assert np.abs(found.nodes[0] - PANDA_HOME).max() > 1e-2
    assert found.cost < closed_circle().cost
    assert len(found.coefficients) == len(found.x) - 1


def test_the_history_is_of_decision_vectors() -> None:
    told: list[Iteration] = []
    found = closed_circle(callback=told.append)
    assert list(found.history) == told
    last = found.history[-1]
    np.testing.assert_array_equal(last.x, found.x)
    assert last.cost == found.cost
    costs = [item.cost for item in told[:4]]
    assert costs == sorted(costs, reverse=True)


@dataclass(frozen=True)
class Scipy:
    """An optimiser of somebody else's."""

    def minimize(
        self,
        function: Function,
        x0: Array,
        inverse_hessian: Array | None = None,
        *,
        max_evaluations: int | None = None,
        callback: Callable[[Iteration], bool | None] | None = None,
    ) -> Minimum:
        start = np.eye(len(x0)) if inverse_hessian is None else inverse_hessian
        start = 0.5 * (start + start.T)
        found = minimize(
            function.value,
            x0,
            jac=function.gradient,
            method="BFGS",
            options={"hess_inv0": start, "gtol": 1e-7},
        )
        return Minimum(found.x, float(found.fun), found.hess_inv, (), Status.CONVERGED)


def test_another_optimizer_leads_to_the_same_optimum() -> None:
    problem = sm.sample_problem()
    own, other = solved(problem), solved(problem, optimizer=Scipy())
    assert other.cost == pytest.approx(own.cost, rel=1e-6)
    assert closed_circle(optimizer=Scipy()).cost == pytest.approx(closed_circle().cost, rel=1e-6)


def test_evaluations_are_counted_and_limited() -> None:
    counts = Counts(evaluations=100)
    found = solved(sm.sample_problem(null_motion=PUBLISHED), counts=counts, most=10)
    assert found.status is Status.MAX_EVALUATIONS
    # The limit is looked at between steps.
    assert 110 <= counts.evaluations <= 113
    assert found.cost < found.minimum_norm_evaluation.cost


def test_a_callback_stops() -> None:
    found = closed_circle(callback=lambda iteration: iteration.cost < 1.92)
    assert found.status is Status.STOPPED
    assert found.cost < 1.92
    assert found.steps == still_of(found.method.formulation.problem).grid.steps


class Interruption:
    """Ctrl-C at an iteration."""

    def __init__(self, number: int) -> None:
        self.left = number

    def __call__(self, iteration: Iteration) -> None:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


@pytest.mark.parametrize("number", [1, 3, 5])
def test_interrupted_it_returns_the_best_so_far(number: int) -> None:
    for run in (closed_circle, lambda **given: solved(sm.sample_problem(), **given)):
        found = run(callback=Interruption(number))
        assert found.status is Status.INTERRUPTED
        assert len(found.history) == number
        assert found.cost == min(item.cost for item in found.history)
        np.testing.assert_array_equal(found.x, found.history[-1].x)


class InterruptedCounts(Counts):
    """Ctrl-C at an evaluation of the cost."""

    left = 0

    def evaluated(self) -> None:
        super().evaluated()
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


@pytest.mark.parametrize("number", [2, 6, 12, 16])
def test_interrupted_at_any_evaluation_there_is_a_motion(number: int) -> None:
    whole = closed_circle()
    counts = InterruptedCounts()
    counts.left = number
    found = closed_circle(counts=counts)
    assert found.status is Status.INTERRUPTED
    assert found.cost == found.objective.value(found.x)
    assert len(found.history) <= len(whole.history)
    assert np.isfinite(found.evaluation.trajectory.q).all()


def test_it_begins_where_it_is_told() -> None:
    problem = sm.sample_problem(null_motion=PUBLISHED)
    first = solved(problem)
    second = solved(problem, x0=first.x)
    assert len(second.history) < 0.5 * len(first.history)
    assert second.cost == pytest.approx(first.cost, rel=AGREEMENT)
    # What is no motion is not begun at.
    nowhere = solved(problem, x0=np.full(12, np.nan))
    np.testing.assert_array_equal(nowhere.history[0].x, np.zeros(12))
    assert nowhere.cost == first.cost


@dataclass(frozen=True)
class NoNullMotion(NullMotion):
    """No functions at all."""

    space: str = "null"

    @property
    def fewest_steps(self) -> int:
        return 1

    def functions(self, t: Array, duration: float) -> Array:
        return np.zeros((len(t), 0))


@pytest.mark.parametrize("space", ["null", "joint"])
@pytest.mark.parametrize("asked", [(), (sm.constraints.EndVelocity(),)])
def test_without_coefficients_there_is_nothing_to_optimise(
    space: str, asked: tuple[sm.constraints.Constraint, ...]
) -> None:
    robot = robot_named("panda")
    start = start_of(robot, "pose")
    motion = NoNullMotion(space)
    problem = sm.Problem(robot, short_line(robot, start), "pose", start, motion, constraints=())
    minimum_norm = still_of(problem)
    ends = ends_of(minimum_norm, asked)
    found = solve(Formulation.of(problem), minimum_norm, ends=ends, optimizer=Scipy())
    # The path does not end at rest by itself in all joints.
    assert found.status is (Status.INFEASIBLE if found.unmet else Status.CONVERGED)
    assert found.coefficients.shape == (0,)
    assert found.evaluation.cost == found.cost
    assert found.refined().optimised().status is found.status


def edge(radius: float, damping: sm.Damping | None) -> sm.Problem:
    """Return a line outwards to a radius, of an arm that reaches 5."""
    robot = robot_named("planar_3r")
    q0 = np.array([-0.5, 0.9, 0.6])
    start = robot.pose(q0)
    end = start.copy()
    end.translation = radius * start.translation / np.linalg.norm(start.translation)
    line, cubic = sm.paths.Line(start, end, 1.0), PolynomialNullMotion()
    return sm.Problem(robot, line, "planar", q0, cubic, damping=damping, constraints=())


def test_a_damped_motion_leaves_the_path() -> None:
    with pytest.raises(sm.errors.BreakdownError, match="reaches a singular pose"):
        still_of(edge(5.2, None))
    found = solved(edge(5.2, sm.Damping()))
    assert found.status is Status.CONVERGED
    assert found.evaluation.damped
    assert found.cost < found.minimum_norm_evaluation.cost
    assert not solved(edge(4.0, sm.Damping())).evaluation.damped


def test_a_motion_that_breaks_down_is_refused_with_the_time() -> None:
    """From the stretched pose outward no q̇ exists."""
    robot, start = robot_named("planar_3r"), np.array([0.3, 0.0, 0.0])
    end = robot.pose(start)
    end.translation = 1.1 * end.translation
    line, cubic = sm.paths.Line(robot.pose(start), end, 1.0), PolynomialNullMotion()
    problem = sm.Problem(robot, line, "planar", start, cubic, constraints=())
    formulation = Formulation.of(problem)
    broken = MinimumNormMotion.on(formulation, start, Grid.aligned(formulation.knots, 32))
    assert broken.broken == 0.0
    with pytest.raises(
        sm.errors.BreakdownError, match=r"eq\. 4 breaks down near t = 0 s"
    ) as caught:
        solve(formulation, broken)
    assert caught.value.time == 0.0


def test_a_cost_without_a_value_is_named() -> None:
    nowhere = sm.costs.FunctionCost(lambda qd, q, t: np.where(t < 0.5, 1.0, np.nan), name="nowhere")
    with pytest.raises(
        sm.errors.ProblemError, match=r"cost 'nowhere': its value is nan at t = 0\.5"
    ):
        solved(replace(sm.sample_problem(), costs=[nowhere]))


def test_splines_that_can_be_more_cost_less() -> None:
    costs = [
        solved(sm.sample_problem(null_motion=BSplineNullMotion(intervals))).cost
        for intervals in (1, 4, 16)
    ]
    assert costs[0] == pytest.approx(10.5137, rel=AGREEMENT)
    assert costs[0] > costs[1] > costs[2]
