"""What is asked of both ends, on nodes: exact derivatives, met by the optimum, and no dearer."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.follow import null_basis
from selfmotion.planning.formulation import Formulation, bound_conditions
from selfmotion.planning.nodes import Step, minimise
from selfmotion.planning.nodes.ends import NodeEnds
from selfmotion.planning.optimise import Status
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
    turned = end + 0.2 * null_basis(problem.follows, end)[:, 0]
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
    null = null_basis(problem.follows, free.q[end])[:, 0]
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


# The cheapest motion from place to place on a self-motion curve costs what its arc length squared
# does: so do rest at both ends, and what keeps it smooth there.
SHARE_OF_ARC = 5e-3


def self_motion(robot: sm.RobotModel, start: np.ndarray, step: float) -> np.ndarray:
    """Return configurations along a closed self-motion curve, (K, 3), until it is round."""
    goal, q, before = robot.pose(start).translation[:2], start.copy(), None
    found = [q]
    while len(found) < 10 or np.linalg.norm(q - start) > 2.0 * step:
        way = np.linalg.svd(robot.task_jacobian(q, "planar"))[2][-1]
        before = way if before is None or way @ before > 0.0 else -way
        q = q + step * before
        for _ in range(3):
            miss = goal - robot.pose(q).translation[:2]
            q = q + np.linalg.pinv(robot.task_jacobian(q, "planar")) @ miss
        found.append(q)
    return np.array(found)


def test_the_end_is_the_configuration_asked_for_wherever_that_is(planar: sm.RobotModel) -> None:
    """On its self-motion curve, all around: other places on the same plane are none."""
    start = np.array([0.5, 0.8, 0.6])
    curve = self_motion(planar, start, 5e-3)
    lengths = np.cumsum(np.linalg.norm(np.diff(curve, axis=0, append=curve[:1]), axis=1))
    dwell = sm.paths.Dwell(planar.pose(start), 3.0)
    shares = []
    for place in np.linspace(0.0, 1.0, 10)[1:-1]:
        k = int(place * (len(curve) - 1))
        goal = planar.inverse_kinematics(dwell.at, "planar", curve[k])
        limits = [
            sm.constraints.JointPositionLimits(),
            sm.constraints.JointVelocityLimits(),
            sm.constraints.EndConfiguration(goal),
        ]
        given = {"costs": [sm.costs.JointVelocity(1.0)], "constraints": limits}
        plan = sm.plan(sm.Problem(planar, dwell, "planar", start, **given, clearance=None))
        assert plan.certificate.verified, plan.certificate.verdict
        arc = min(lengths[k - 1], lengths[-1] - lengths[k - 1])
        shares.append(plan.report.cost / arc**2)
    assert max(shares) < (1.0 + SHARE_OF_ARC) * min(shares), shares


def test_another_configuration_on_the_same_plane_is_none(planar: sm.RobotModel) -> None:
    start = np.array([0.5, 0.8, 0.6])
    curve = self_motion(planar, start, 5e-3)
    dwell = sm.paths.Dwell(planar.pose(start), 3.0)
    problem = sm.Problem(planar, dwell, "planar", start)
    asked = sm.constraints.EndConfiguration(curve[0]).conditions(problem.robot)
    (end,) = bound_conditions(Formulation.of(problem), asked, start, start).ends
    away = (curve - curve[0]) @ end.null[:, 0]
    (others,) = np.nonzero(np.diff(np.sign(away[100:-100])))
    assert len(others)
    for k in others + 100:
        assert end.elsewhere(start, curve[k]) > 1.0
    for near in (0, 1, 10, 50, -1, -10):
        assert end.elsewhere(start, curve[near]) == 0.0


@pytest.mark.parametrize("share", [1.002, 1.01])
def test_limits_hardly_above_the_mean_speed_are_kept(planar: sm.RobotModel, share: float) -> None:
    """Joint 3 alone tells where the arm is on its curve: any motion of its own will do."""
    start = np.array([0.5, 0.8, 0.6])
    curve = self_motion(planar, start, 5e-3)
    dwell = sm.paths.Dwell(planar.pose(start), 3.0)
    goal = planar.inverse_kinematics(dwell.at, "planar", curve[100])
    mean = np.abs(goal - start).max() / dwell.duration
    limits = [
        sm.constraints.JointVelocityLimits(share * mean, margin=1e-4),
        sm.constraints.EndConfiguration(goal),
    ]
    plan = sm.plan(sm.Problem(planar, dwell, "planar", start, constraints=limits, clearance=None))
    assert plan.certificate.verified, plan.certificate.verdict
    # Nothing goes slower than that.
    limits[0] = sm.constraints.JointVelocityLimits(0.99 * mean)
    slow = sm.plan(sm.Problem(planar, dwell, "planar", start, constraints=limits, clearance=None))
    assert not slow.certificate.verified


def test_an_end_at_another_configuration_is_told(panda: sm.RobotModel) -> None:
    """By how far it is from what is asked for, where its own coordinates do not tell."""
    problem = circle(panda)
    end = np.array(PANDA_HOME)
    own = sm.constraints.EndConfiguration(end).conditions(problem.robot)
    (asked,) = bound_conditions(Formulation.of(problem), own, end, end).ends
    away = 0.3 * problem.follows.jacobian(end)[0] / np.linalg.norm(problem.follows.jacobian(end)[0])
    nodes = np.tile(end, (4, 3, 1))
    assert NodeEnds([asked]).elsewhere(nodes) == {}
    nodes[-1, 0] += away
    assert NodeEnds([asked]).elsewhere(nodes) == {"end configuration": pytest.approx(0.3)}
    nodes[-1, 0] -= away
    nodes[:-1, 0] += away
    assert NodeEnds([asked]).elsewhere(nodes) == {}
