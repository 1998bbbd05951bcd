"""Constraints: exact gradients, prices, and what is judged of them."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import EndState, JointLimits
from selfmotion.model.motion import Grid, PolynomialNullMotion
from selfmotion.planning.formulation import Formulation, bound_conditions
from selfmotion.planning.paper import Objective, node_tangents
from selfmotion.planning.rollout import MinimumNormMotion
from selfmotion.problem.constraints import NodeTangents, linearised
from selfmotion.shell.cli.tables import show
from support.arms import PANDA_HOME, central_difference, robot_named, short_line, start_of
from support.followed import standing

Circle = Callable[..., sm.Problem]


LIMITS = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())


# Exact gradients against central differences, relative to the gradient's largest entry.
GRADIENT = 1e-6


def certify_again(plan: sm.Plan, requirements: list[sm.certificate.Requirement]) -> sm.Certificate:
    """Return a plan's certificate with other requirements."""
    return sm.certify(plan.robot, plan.path, plan.task, plan.trajectory, requirements=requirements)


CONSTRAINTS = {
    "position": lambda r: sm.constraints.JointPositionLimits(
        np.full(r.dof, -0.02), np.full(r.dof, 0.02), replace=True
    ),
    "velocity": lambda r: sm.constraints.JointVelocityLimits(np.full(r.dof, 0.02)),
    "acceleration": lambda r: sm.constraints.JointAccelerationLimits(0.05),
    "end": lambda r: sm.constraints.EndConfiguration(np.full(r.dof, 0.3)),
    "end velocity": lambda r: sm.constraints.EndVelocity(),
    "closed": lambda r: sm.constraints.ClosedPath(),
    "closed in position": lambda r: sm.constraints.ClosedPath(velocity=False),
}


def objective_with(
    constraint: sm.constraints.Constraint, name: str, task: str
) -> tuple[Objective, sm.constraints.BoundConstraint]:
    """Return an objective with a free start, and a constraint that is violated."""
    robot, rows = robot_named(name), sm.Task.of(task)
    start = start_of(robot, task)
    path = short_line(robot, start)
    grid = Grid.aligned(path.knots, 12)
    motion = PolynomialNullMotion(1, "joint")
    problem = sm.Problem(robot, path, rows, start, motion, constraints=(), rest=False)
    formulation = Formulation.of(problem)
    minimum_norm = MinimumNormMotion.on(formulation, start, grid)
    # At the start all ends have the same null space.
    at_rest = dataclasses.replace(formulation, follows=standing(robot, rows))
    (bound,) = bound_conditions(at_rest, constraint.conditions(robot), start, start).every
    return Objective.of(formulation, minimum_norm, free=True), bound


def rows_of(objective: Objective, bound: sm.constraints.BoundConstraint, x: Array) -> Array:
    """Return the derivatives of all conditions at x, as programmes ask for them."""
    motion = node_tangents(objective, x)
    known = linearised(bound, objective.samples(x), motion)
    return known.picked(motion, np.arange(known.count))


@pytest.mark.parametrize("constraint", CONSTRAINTS)
@pytest.mark.parametrize(("name", "task"), [("planar_3r", "planar"), ("panda", "pointing")])
def test_rows_equal_central_differences(constraint: str, name: str, task: str) -> None:
    """Of all conditions at once, also of those that are not violated."""
    objective, bound = objective_with(CONSTRAINTS[constraint](robot_named(name)), name, task)
    x = 0.02 * np.random.default_rng(1).normal(size=objective.size)
    h = bound.residual(objective.samples(x))
    assert np.max(np.abs(h) if bound.equality else h) > bound.tolerance
    weights = np.random.default_rng(2).normal(size=h.size)
    exact = weights @ rows_of(objective, bound, x)

    def value(x: Array) -> float:
        return float(weights @ bound.residual(objective.samples(x)).ravel())

    differences = central_difference(value, x, 1e-6)
    assert np.abs(exact - differences).max() <= GRADIENT * np.abs(differences).max()


@pytest.mark.parametrize("constraint", CONSTRAINTS)
def test_tangents_equal_central_differences(constraint: str) -> None:
    made = CONSTRAINTS[constraint](robot_named("panda"))
    objective, bound = objective_with(made, "panda", "pose")
    x = 0.02 * np.random.default_rng(2).normal(size=objective.size)
    tangents: NodeTangents = node_tangents(objective, x)
    exact = bound.tangents(objective.samples(x), tangents)
    for i in (0, 1, objective.size - 1):
        ends = []
        for sign in (1.0, -1.0):
            shift = np.zeros_like(x)
            shift[i] = sign * 1e-5
            ends.append(bound.residual(objective.samples(x + shift)).copy())
        differences = (ends[0] - ends[1]) / 2e-5
        scale = max(1.0, np.abs(differences).max())
        np.testing.assert_allclose(exact[..., i], differences, atol=1e-6 * scale)


@pytest.mark.parametrize("constraint", CONSTRAINTS)
def test_rows_on_demand_are_those_of_all_tangents(constraint: str) -> None:
    """Some of them, and after other motions were looked at."""
    made = CONSTRAINTS[constraint](robot_named("panda"))
    objective, bound = objective_with(made, "panda", "pose")
    rng = np.random.default_rng(4)
    x = 0.02 * rng.normal(size=objective.size)
    tangents, samples = node_tangents(objective, x), objective.samples(x)
    expected = bound.tangents(samples, tangents).reshape(-1, objective.size)
    rows = linearised(bound, samples, tangents)
    # All of one motion is computed once.
    count = objective.evaluations
    objective.value(x), objective.samples(x), objective.gradient(x), objective.metric(x)
    assert objective.evaluations == count
    objective.samples(x + 0.1)
    assert objective.evaluations == count + 1
    which = rng.integers(0, len(expected), 40)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(rows.picked(tangents, which), expected[which], atol=1e-12 * scale)


def test_clearance_rows_equal_central_differences() -> None:
    robot = robot_named("panda")
    pose = robot.pose(start_of(robot, "pose"))
    box = sm.obstacles.Box("box", pose.translation + np.array([0.0, 0.0, 0.25]), [0.1, 0.1, 0.1])
    objective, bound = objective_with(sm.constraints.Clearance((box,), 0.1), "panda", "pose")
    x = 0.01 * np.random.default_rng(3).normal(size=objective.size)

    def excess(x: Array) -> Array:
        return np.maximum(bound.residual(objective.samples(x)).ravel(), 0.0)

    def value(x: Array) -> float:
        return float(np.sum(excess(x) ** 2))

    assert excess(x).any()
    exact = 2.0 * excess(x) @ rows_of(objective, bound, x)
    differences = central_difference(value, x, 1e-7)
    # Closest points jump on flat faces; away from jumps the agreement is that of the differences.
    assert np.abs(exact - differences).max() <= 1e-4 * np.abs(differences).max()


def test_bad_constraints_are_refused(panda: sm.RobotModel) -> None:
    path = short_line(panda, PANDA_HOME)
    for constraint, message in (
        (
            lambda: sm.constraints.JointPositionLimits(lower=np.zeros(3)),
            "one for each of the 7 joints",
        ),
        (
            lambda: sm.constraints.JointPositionLimits(lower=np.full(7, 9.0)),
            "not below upper",
        ),
        (lambda: sm.constraints.JointVelocityLimits(np.full(7, -1.0)), "expected numbers > 0"),
        (lambda: sm.constraints.JointVelocityLimits(margin=0.0), "margin is 0.0"),
        (
            lambda: sm.constraints.JointAccelerationLimits([1.0, 2.0, 3.0]),
            "one for each of the 7 joints",
        ),
        (lambda: sm.constraints.JointAccelerationLimits(np.nan), "expected numbers > 0"),
        (lambda: sm.constraints.EndVelocity([1.0, 2.0, 3.0]), "one for each of the 7 joints"),
        (lambda: sm.constraints.EndConfiguration(PANDA_HOME), "off the end of the path"),
        (lambda: sm.constraints.Clearance(distance=-1.0), "distance is -1.0"),
        (lambda: sm.constraints.Clearance(distance=np.inf), "distance is inf"),
        (lambda: sm.constraints.Clearance(["x"]), "expected Box, Sphere"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=message):
            sm.plan(sm.Problem(panda, path, start=PANDA_HOME, constraints=[constraint()]))


@pytest.mark.parametrize("tight_first", [True, False])
def test_of_two_constraints_of_a_kind_both_are_judged(
    panda_circle: Circle, tight_first: bool
) -> None:
    """Whatever their order: the loose one does not stand in for the tight one."""
    tight = sm.constraints.JointAccelerationLimits(0.01)
    loose = sm.constraints.JointAccelerationLimits(100.0, replace=True)
    pair = (tight, loose) if tight_first else (loose, tight)
    free = sm.plan(panda_circle())
    asked = dataclasses.replace(free.problem, constraints=(*LIMITS, *pair))
    check = dataclasses.replace(free, problem=asked).check()
    amounts = [f.amount for f in check.findings if f.requirement == "joint acceleration limits"]
    assert len(amounts) == 2
    assert max(amounts) == pytest.approx(1e4 * min(amounts))
    assert not check.verified
    assert check.acceleration_ratio is not None
    assert check.acceleration_ratio.value == max(amounts)
    kept = sm.plan(
        panda_circle(constraints=(*LIMITS, sm.constraints.JointAccelerationLimits(8.0), loose))
    )
    assert kept.certificate.verified, kept.certificate.verdict


def test_saved_plans_keep_what_was_required(panda: sm.RobotModel, tmp_path) -> None:
    path = short_line(panda, PANDA_HOME)
    box = sm.obstacles.Box("far", np.array([0.0, 0.0, 2.0]), [0.1, 0.1, 0.1])
    constraints = (*LIMITS, sm.constraints.JointAccelerationLimits(20.0))
    apart = sm.constraints.Clearance((box,), 0.001)
    plan = sm.plan(
        sm.Problem(panda, path, start=PANDA_HOME, constraints=constraints, clearance=apart)
    )
    assert plan.certificate.verified
    plan.save(tmp_path / "plan.npz")
    loaded = sm.load_plan(tmp_path / "plan.npz")
    assert loaded.certificate == plan.certificate
    assert loaded.check() == plan.certificate
    assert loaded.obstacles[0].name == "far"


def test_broken_motions_fail_what_is_required(panda_circle: Circle) -> None:
    problem = panda_circle(constraints=(*LIMITS, sm.constraints.ClosedPath()))
    plan = sm.plan(problem)
    q: Array = plan.trajectory.q.copy()
    q[-1] += 1e-4
    broken = dataclasses.replace(plan.trajectory, q=q)
    certificate = sm.certify(
        plan.robot, plan.path, plan.task, broken, requirements=plan.requirements
    )
    assert "away from the start" in certificate.verdict
    slow = JointLimits(2, np.full(7, -0.1), np.full(7, 0.1))
    assert "accelerates at" in certify_again(plan, [slow]).verdict
    certificate = certify_again(plan, [slow, EndState(0, PANDA_HOME + 0.1)])
    assert "accelerates at" in certificate.verdict
    assert "away from where it should" in certificate.verdict


# A price is a first derivative: this near to what re-planning saves.
PRICE = 0.2


@pytest.mark.parametrize("kind", ["acceleration", "position"])
def test_prices_are_what_easing_a_limit_saves(panda_circle: Circle, kind: str) -> None:
    """Against plans with a limit that is a little wider."""
    robot = panda_circle().robot
    free = sm.plan(panda_circle("position"))
    assert free.report.active == ()
    highest = float(free.trajectory.q[:, 3].max())

    def limited(eased: float) -> sm.Plan:
        upper = np.array(robot.upper)
        upper[3] = highest - 0.05 + 0.01 * eased
        limits: tuple[sm.constraints.Constraint, ...] = (
            sm.constraints.JointPositionLimits(upper=upper),
            LIMITS[1],
        )
        if kind == "acceleration":
            limits = (*LIMITS, sm.constraints.JointAccelerationLimits(1.2 * (1.0 + 0.02 * eased)))
        return sm.plan(panda_circle("position", constraints=limits))

    tight, wide = limited(0.0), limited(0.2)
    assert tight.certificate.verified
    assert wide.certificate.verified
    saved = tight.report.cost - wide.report.cost
    priced = 0.0
    for item in tight.report.active:
        size, _, words = item.easing.partition(" ")
        # Told of smaller steps where they would save much; here of 0.4 % or of 2 mrad.
        priced += (0.4 if words.startswith("%") else 0.002) / float(size) * item.saving
    assert saved > 0.0
    assert priced == pytest.approx(saved, rel=PRICE)
    first = tight.report.active[0]
    assert first.constraint == f"joint {kind} limits"
    dearest = {"position": "panda_joint4", "acceleration": "panda_joint2"}[kind]
    assert f"joint '{dearest}'" in first.easing
    assert all(0.0 <= a <= b <= 4.0 for a, b in first.spans)


def test_prices_are_saved_and_shown(panda_circle: Circle, tmp_path) -> None:
    limits = (*LIMITS, sm.constraints.JointAccelerationLimits(1.5), sm.constraints.ClosedPath())
    plan = sm.plan(panda_circle("position", constraints=limits))
    assert {"closed path", "joint acceleration limits"} <= {
        item.constraint for item in plan.report.active
    }
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").report.active == plan.report.active
    console = Console(record=True, width=120)
    show(plan, console)
    text = console.export_text()
    assert "2 % more acceleration for joint 'panda_joint" in text
    assert "active constraints" in text


def test_what_is_not_finite_is_named_with_its_time(panda_circle: Circle) -> None:
    """The cost's value, its gradient, and a constraint's residual; without limits and with."""

    def late(t: Array) -> Array:
        return np.where(t > 2.0, np.nan, 1.0)

    value = sm.costs.FunctionCost(
        lambda qd, q, t: late(t), lambda qd, q, t: (0 * qd, 0 * q), "late"
    )
    gradient = sm.costs.FunctionCost(
        lambda qd, q, t: np.sum(q**2, axis=1),
        lambda qd, q, t: (0 * qd, late(t)[:, None] * q),
        "bad",
    )
    tight = sm.constraints.JointVelocityLimits(0.1)
    for constraints in (LIMITS, (*LIMITS, tight)):
        for cost, text in (
            (value, r"cost 'late': its value is nan at t = 2\.0625 s"),
            (gradient, r"cost 'bad': its gradient is .* at t = 2\.0625 s"),
        ):
            with pytest.raises(sm.errors.ProblemError, match=text):
                sm.plan(panda_circle(costs=[cost], constraints=constraints))


def test_a_wrong_gradient_is_no_convergence(panda_circle: Circle) -> None:
    wrong = sm.costs.FunctionCost(
        lambda qd, q, t: np.sum(q**2, axis=1), lambda qd, q, t: (0 * qd, -2 * q), "wrong"
    )
    plan = sm.plan(panda_circle(costs=[wrong], constraints=()))
    assert plan.report.status is sm.optimise.Status.GRADIENT
    assert "check_cost" in plan.report.message
