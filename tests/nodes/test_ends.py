"""What is asked of both ends, on nodes: exact derivatives, met by the optimum, and no dearer."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.nodes import Step, minimise
from selfmotion.optimise import Status
from support.arms import PANDA_HOME, Case
from support.nodes import around_of, centred, moved, nodes_of, problem_of, random_step

# Central differences of positions and velocities.
STEP, ALIKE = 1e-5, 1e-7
# The optimum's ends, and what the certificate sees of them between printed digits [rad, rad/s].
MET = 1e-8
SHAPES = ("repeated", "repeated, any speed", "an end", "a speed", "both")


def asked(shape: str, problem: sm.Problem) -> tuple[sm.constraints.Constraint, ...]:
    """Return constraints on the ends, which the motion at x = 0 does not meet."""
    end = nodes_of(problem).place.q[-1]
    conditions = {
        "repeated": (sm.constraints.ClosedPath(),),
        "repeated, any speed": (sm.constraints.ClosedPath(velocity=False),),
        "an end": (sm.constraints.EndConfiguration(end),),
        "a speed": (sm.constraints.EndVelocity(nodes_of(problem).place.qd[-1]),),
    }
    conditions["both"] = conditions["an end"] + conditions["a speed"]
    return conditions[shape]


def there_and_back(case: Case, shape: str, **options) -> sm.Problem:
    """Return a case's problem with conditions on the ends; its path is closed where they are."""
    robot, task, start, path = case
    if shape.startswith("repeated"):
        last = path.duration
        path = path + sm.paths.Line(path.pose(last), path.pose(0.0), last)
    problem = problem_of((robot, task, start, path), **options)
    return replace(problem, constraints=asked(shape, problem))


@pytest.mark.parametrize("shape", SHAPES)
def test_derivatives_are_central_differences(case: Case, shape: str) -> None:
    motion = centred(nodes_of(there_and_back(case, shape)))
    ends, around = motion.grid.ends, around_of(motion)
    assert ends.count == len(motion.c) > 0
    step = random_step(motion, 7)
    above, below = (moved(motion, sign * STEP * step) for sign in (1.0, -1.0))
    expected = (above.c - below.c) / (2.0 * STEP)
    held = motion.grid.held
    found = ends.border(motion.c, around.changes, held).columns.T @ step.ravel()
    np.testing.assert_allclose(found, expected, atol=ALIKE * max(1.0, np.abs(expected).max()))
    multipliers = np.random.default_rng(2).normal(size=ends.count)
    pulled = np.einsum("kon,konw,kw->", ends.pulled(multipliers, len(step)), around.changes, step)
    assert float(pulled) == pytest.approx(
        float(multipliers @ expected), abs=1e2 * ALIKE * max(1.0, float(np.abs(expected).max()))
    )


@pytest.mark.parametrize("free", [False, True])
def test_the_optimum_meets_them_quickly(panda: sm.RobotModel, free: bool) -> None:
    """Quadratically, also where the start is free; and multipliers are what the ends cost."""
    problem = circle(panda, constraints=(sm.constraints.ClosedPath(),))
    misses: list[float] = []

    def told(step: Step) -> bool:
        misses.append(float(np.abs(step.motion.c).max()))
        return False

    optimum = minimise(nodes_of(problem, 24, free=free), told)
    assert optimum.status is Status.CONVERGED
    assert len(misses) <= 12
    assert misses[0] > 1e-2
    assert misses[-1] <= 1e-9
    large = [miss for miss in misses if miss > 1e-9]
    assert misses[len(large)] <= 0.1 * large[-1]
    open_one = minimise(nodes_of(circle(panda), 24, free=free), lambda step: False)
    assert optimum.motion.cost > open_one.motion.cost


@pytest.mark.parametrize("shape", SHAPES[:2])
@pytest.mark.parametrize("free", [False, True])
def test_a_repeated_motion_is_planned_on_nodes(
    panda: sm.RobotModel, shape: str, free: bool
) -> None:
    constraints = asked(shape, circle(panda))
    problem = circle(panda, constraints=constraints, start=None if free else PANDA_HOME)
    plan = sm.plan(problem)
    assert plan.certificate.verified
    assert isinstance(plan.report.null_motion, sm.motion.NodeNullMotion)
    motion = plan.trajectory
    np.testing.assert_allclose(motion.q[-1], motion.q[0], atol=MET)
    if shape == "repeated":
        np.testing.assert_allclose(motion.qd[-1], motion.qd[0], atol=MET)
    assert any(item.constraint == "closed path" for item in plan.report.active)
    spline = sm.plan(replace(problem, null_motion=sm.motion.BSplineNullMotion(32)))
    assert plan.report.cost <= 1.0005 * spline.report.cost


def test_a_given_end_is_reached_on_nodes(panda: sm.RobotModel) -> None:
    """The end of the open motion turned along its self-motion."""
    problem = circle(panda, rest=True)
    end = sm.plan(problem).trajectory.q[-1]
    turned = end + 0.2 * problem.follows.null_basis(end)[:, 0]
    pose = problem.path.pose(problem.path.duration)
    last = panda.inverse_kinematics(pose, "pose", seed=turned)
    assert np.abs(last - end).max() > 0.05
    plan = sm.plan(replace(problem, constraints=(sm.constraints.EndConfiguration(last),)))
    assert plan.certificate.verified
    assert isinstance(plan.report.null_motion, sm.motion.NodeNullMotion)
    np.testing.assert_allclose(plan.trajectory.q[-1], last, atol=MET)


@pytest.mark.parametrize("at_start", [False, True])
def test_a_given_acceleration_at_an_end_is_met_on_nodes(
    panda: sm.RobotModel, at_start: bool
) -> None:
    """The path's own, and some self-motion that is not that of the optimum."""
    problem = circle(panda)
    free = sm.plan(problem).trajectory
    end = 0 if at_start else -1
    null = problem.follows.null_basis(free.q[end])[:, 0]
    wanted = free.qdd[end] + 0.4 * null
    kind = sm.constraints.StartAcceleration if at_start else sm.constraints.EndAcceleration
    rates = (
        ()
        if at_start
        else (sm.constraints.EndVelocity(free.qd[-1]), sm.constraints.EndConfiguration(free.q[-1]))
    )
    first = (sm.constraints.StartVelocity(free.qd[0]),) if at_start else ()
    plan = sm.plan(replace(problem, constraints=(*first, *rates, kind(wanted))))
    assert plan.certificate.verified
    assert isinstance(plan.report.null_motion, sm.motion.NodeNullMotion)
    np.testing.assert_allclose(plan.trajectory.qdd[end], wanted, atol=1e-6)
    assert np.abs(free.qdd[end] - wanted).max() > 0.1


def circle(panda: sm.RobotModel, start=PANDA_HOME, **options) -> sm.Problem:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    return sm.Problem(panda, path, "pose", start, **{"constraints": (), "rest": False, **options})
