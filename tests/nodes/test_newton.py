"""Newton's method on nodes: quadratic, as quick on many nodes as on few, and right at limits."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.nodes import Step, minimise
from selfmotion.planning.optimise import Status
from selfmotion.problem.costs import Partials, Samples
from support.arms import PANDA_HOME, Case
from support.nodes import nodes_of, problem_of
from support.splines import best_spline

# A joint whose place costs nothing is moved as a whole, to the accuracy of an optimum [rad].
CONSTANT = 1e-7
# By this share of what the others go, at most: how far is for rounding to decide, which is another
# one on each processor. Where nothing holds the joint it may go as far as the others.
FOLLOWED = 0.2


def never(step: Step) -> bool:
    return False


def slopes_of(problem: sm.Problem, count: int, *, free: bool = False) -> list[float]:
    slopes: list[float] = []

    def told(step: Step) -> bool:
        slopes.append(step.slope)
        return False

    optimum = minimise(nodes_of(problem, count, free=free), told)
    assert optimum.status is Status.CONVERGED
    return slopes


@pytest.mark.parametrize("free", [False, True])
def test_convergence_is_quadratic(case: Case, free: bool) -> None:
    slopes = slopes_of(problem_of(case), 16, free=free)
    # Where rounding does not show: the last two steps from there.
    above = [slope for slope in slopes if slope > 1e-7 * slopes[0]]
    below = [slope for slope in slopes if slope <= 1e-7 * slopes[0]]
    if len(above) < 2 or not below:
        return
    first, second, third = above[-2], above[-1], below[0]
    if second < 1e-2 * slopes[0] and third > 1e-10 * slopes[0]:
        assert np.log(third / second) / np.log(second / first) > 1.8
    else:
        assert third / second <= 1e-2


def test_another_step_gains_nothing_where_it_ends(case: Case) -> None:
    """Also where that is told by the step before."""
    optimum = minimise(nodes_of(problem_of(case), 16), never)
    cost = optimum.motion.cost
    assert optimum.promised <= 1e-8 * cost
    # From there it knows no step before.
    again = minimise(optimum.motion, never)
    assert again.promised <= 1e-8 * cost
    assert abs(again.motion.cost - cost) <= 1e-8 * cost


def test_what_costs_nothing_stays_as_it_is(panda: sm.RobotModel) -> None:
    """The tool's origin is on the last joint's axis: wherever that stands, costs are the same."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    begin = nodes_of(problem_of((panda, "position", PANDA_HOME, path)), 64, free=True)
    found = minimise(begin, never)
    assert found.status is Status.CONVERGED
    moved = found.motion.place.q - begin.place.q
    others, last = np.abs(moved[:, :6]).max(), np.abs(moved[:, 6]).max()
    # What the joint gains in speed costs; where it stands is left to rounding, and hardly followed.
    assert np.ptp(moved[:, 6]) <= CONSTANT
    assert last < FOLLOWED * others


def test_many_nodes_take_as_many_iterations(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(
        panda, path, "pose", PANDA_HOME, constraints=(), rest=False, clearance=None
    )
    counts = [len(slopes_of(problem, count)) for count in (50, 500, 5000)]
    # The first steps of many are cut; then it is as quick.
    assert max(counts) - min(counts) <= 4
    assert max(counts) <= 8


def test_it_is_below_the_finest_spline(case: Case) -> None:
    problem = problem_of(case)
    optimum = minimise(nodes_of(problem, 64), never)
    spline = sm.plan(
        sm.Problem(
            *(problem.robot, problem.path, problem.task, problem.given_start),
            null_motion=sm.motion.BSplineNullMotion(32),
            constraints=(),
            rest=False,
            clearance=None,
        )
    )
    assert optimum.motion.cost <= spline.report.cost * (1.0 + 1e-5)


@pytest.mark.parametrize("free", [False, True])
def test_other_costs_take_few_iterations(case: Case, free: bool) -> None:
    """Their curvature is nearly right, so that each step makes the gradient far smaller."""
    costs = (sm.costs.JointVelocity(), sm.costs.InverseManipulability(0.02))
    slopes = slopes_of(problem_of(case, costs=costs), 24, free=free)
    assert len(slopes) <= 12
    if len(slopes) > 1 and slopes[-2] > 1e-9 * slopes[0]:
        assert slopes[-1] <= 0.2 * slopes[-2]


def check_kept(panda: sm.RobotModel, limits, order: int, joint: int, share: float, rest: bool):
    """The optimum is found on nodes, is verified, and no dearer than that of splines.

    Returns the plan, times, and how fast the joint is at them as a share of its limit.
    """
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    free = sm.plan(sm.Problem(panda, path, "pose", PANDA_HOME, constraints=(), rest=rest))
    most = np.abs((free.trajectory.qd, free.trajectory.qdd)[order - 1]).max(axis=0)
    limit = np.where(np.arange(7) == joint, share * most, np.inf)
    constraints = (limits(limit),)
    problem = sm.Problem(panda, path, "pose", PANDA_HOME, constraints=constraints, rest=rest)
    plan = sm.plan(problem)
    assert plan.certificate.verified
    assert isinstance(plan.report.null_motion, sm.motion.NodeNullMotion)
    t = np.linspace(0.0, path.duration, 20001)
    rates = np.abs(plan.trajectory(t, order))
    assert (rates <= limit).all()
    assert plan.report.cost > free.report.cost
    assert plan.report.cost <= 1.0005 * best_spline(problem)
    return plan, t, rates[:, joint] / limit[joint]


@pytest.mark.parametrize(("joint", "share"), [(0, 0.7), (1, 0.95), (3, 0.95), (5, 0.85)])
def test_limits_of_speed_are_kept_at_all_times(
    panda: sm.RobotModel, joint: int, share: float
) -> None:
    check_kept(panda, sm.constraints.JointVelocityLimits, 1, joint, share, rest=False)


@pytest.mark.parametrize("rest", [False, True])
@pytest.mark.parametrize(("joint", "share"), [(0, 0.8), (5, 0.9), (6, 0.85)])
def test_limits_of_acceleration_are_kept_at_all_times(
    panda: sm.RobotModel, joint: int, share: float, rest: bool
) -> None:
    """Where such a limit begins to bind, accelerations would rather jump."""
    plan, t, used = check_kept(
        panda, sm.constraints.JointAccelerationLimits, 2, joint, share, rest=rest
    )
    # Where a limit is said to bind it is used: all but its margin, next to the ends less.
    (binding,) = plan.report.active
    for first, last in binding.spans:
        assert last - first < 0.5 * plan.path.duration
        assert np.median(used[(t >= first - 1e-3) & (t <= last + 1e-3)]) >= 0.98


def largest_jerks(plan: sm.Plan) -> np.ndarray:
    """Return the largest jerk of each joint, by differences."""
    t = np.linspace(0.0, plan.path.duration, 2001)
    return np.abs(np.diff(plan.trajectory(t, 2), axis=0)).max(axis=0) / t[1]


@pytest.mark.parametrize("number", [6, 14])
def test_limits_of_all_jerks_that_the_calmest_motion_nearly_needs_are_kept(
    panda: sm.RobotModel, number: int
) -> None:
    """Little else keeps them than that motion; a rough step beside it breaks them a hundredfold."""
    rng = np.random.default_rng([1, number])
    start, normal = PANDA_HOME + rng.uniform(-0.3, 0.3, 7), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    path = sm.paths.Circle.around(panda.pose(start), rng.uniform(0.06, 0.12), 4.0, normal=normal)
    task = "position" if rng.random() < 0.4 else "pose"
    free = sm.Problem(panda, path, task, start, constraints=[sm.constraints.JointPositionLimits()])
    smoothed = sm.plan(replace(free, costs=[sm.costs.JointJerk()])).require()
    limits = 1.1 * largest_jerks(smoothed)
    assert (largest_jerks(sm.plan(free)) > 1.5 * limits).any()
    asked = [*free.constraints, sm.constraints.JointJerkLimits(limits)]
    plan = sm.plan(replace(free, constraints=asked)).require()
    assert (largest_jerks(plan) <= limits).all()
    assert plan.report.cost <= smoothed.evaluate(sm.costs.JointVelocity())


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_at_limits_prices_tell_what_the_limits_cost(panda: sm.RobotModel, share: float) -> None:
    """The first-order conditions, and dF/dlimit by planning with another limit."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))

    def optimum(upper: float):
        limit = np.where(np.arange(7) == 2, upper, panda.upper)
        constraints = (sm.constraints.JointPositionLimits(upper=limit),)
        problem = sm.Problem(
            panda, path, "pose", PANDA_HOME, constraints=constraints, rest=False, clearance=None
        )
        begin = nodes_of(problem, 24)
        return minimise(begin, never)

    free = optimum(panda.upper[2])
    farthest = free.motion.place.q[:, 2].max()
    here = PANDA_HOME[2] + share * (farthest - PANDA_HOME[2])
    bound, eased = optimum(here), optimum(here + 1e-4)
    assert bound.status is Status.CONVERGED
    assert (bound.multipliers >= 0.0).all()
    assert bound.motion.h.max() <= 1e-6
    # What does not bind costs nothing.
    assert np.abs(bound.multipliers * bound.motion.h).sum() <= 1e-5 * bound.motion.cost
    assert bound.motion.cost > free.motion.cost
    saved = bound.motion.cost - eased.motion.cost
    assert saved == pytest.approx(1e-4 * bound.multipliers.sum(), rel=0.1)


def test_what_cannot_be_kept_is_said_to_be_so(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    slow = (sm.constraints.JointVelocityLimits(0.05),)
    problem = sm.Problem(
        panda, path, "pose", PANDA_HOME, constraints=slow, rest=False, clearance=None
    )
    begin = nodes_of(problem, 24)
    optimum = minimise(begin, never)
    # Elastic rows are as near to being kept as can be: that is an optimum, and says by how much.
    assert optimum.motion.violation > 0.5


@dataclass(frozen=True)
class OnTheMove(sm.constraints.Constraint):
    """Joint 1 turns by no less than a speed [rad/s]."""

    least: float

    def quantity(self, robot: sm.RobotModel) -> sm.certificate.Quantity:
        first = np.eye(robot.dof)[0]
        return sm.certificate.Quantity.between(
            "speed",
            self.least,
            10.0,
            values=lambda q, qd, qdd: qd @ first,
            derivatives=lambda q, qd, qdd: (np.zeros_like(q), np.tile(first, (len(q), 1))),
            series=lambda stretch: stretch.chain().rates[:, 0],
            unit="rad/s",
        )


@pytest.mark.parametrize("radius", [1e-2, 1e-3, 1e-4])
def test_what_costs_next_to_nothing_keeps_what_costs_much(
    panda: sm.RobotModel, radius: float
) -> None:
    """A tool that hardly moves, and a joint that has to: F is up to 35,000 times as high then."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), radius, 4.0, normal=(1.0, 0.0, 0.0))
    moving = (OnTheMove(0.05),)
    case = panda, "position", PANDA_HOME, path
    begin = nodes_of(problem_of(case, constraints=moving))
    optimum = minimise(begin, never)
    assert begin.violation > 0.0
    assert optimum.motion.cost > 2.0 * begin.cost
    assert optimum.status is Status.CONVERGED
    assert optimum.motion.violation <= 0.0


class Backwards(sm.costs.JointVelocity):
    """A cost whose gradient points the wrong way."""

    def gradient(self, samples: Samples) -> Partials:
        return Partials(qd=-samples.qd)


def test_a_wrong_gradient_is_said_to_be_wrong(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(panda, path, "pose", PANDA_HOME, costs=[Backwards()], clearance=None)
    optimum = minimise(nodes_of(problem, 24), never)
    assert optimum.status is Status.GRADIENT
    report = sm.plan(problem).report
    assert report.status is Status.GRADIENT
    assert "check_cost" in report.message


def test_it_stops_where_it_is_told_to(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(
        panda, path, "pose", PANDA_HOME, constraints=(), rest=False, clearance=None
    )
    begin = nodes_of(problem, 24)
    optimum = minimise(begin, lambda step: step.length > 0.0)
    assert optimum.status is Status.STOPPED
    assert optimum.motion.cost < begin.cost


def test_a_start_deep_inside_a_body_is_no_dead_end(panda: sm.RobotModel) -> None:
    """Elastic rows: from 30 mm inside of a ball out of it."""
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    free = sm.plan(sm.Problem(panda, path, "pose", PANDA_HOME, constraints=(), clearance=None))
    # In the middle, where the elbow would be: its bodies are to go aside.
    elbow = panda.chain_to("panda_link4").place(free.trajectory(np.array([2.0]))[0]).translation
    ball = sm.obstacles.Sphere("ball", elbow + np.array([0.092, 0.01, -0.076]), 0.05)
    apart = sm.constraints.Clearance([ball], 0.01)
    problem = sm.Problem(panda, path, "pose", PANDA_HOME, constraints=(), clearance=apart)
    begin = nodes_of(problem, 16)
    # In units of 0.1 m.
    assert begin.violation > 0.25
    optimum = minimise(begin, never)
    assert optimum.status is Status.CONVERGED
    assert optimum.motion.violation <= 0.0
    plan = sm.plan(problem)
    assert plan.certificate.verified
    assert plan.report.cost <= 1.001 * optimum.motion.cost


def test_known_prices_spare_iterations(panda: sm.RobotModel) -> None:
    path = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    # Slow enough to bind; slower motions there are none.
    slow = (sm.constraints.JointVelocityLimits(1.2),)
    problem = sm.Problem(
        panda, path, "pose", PANDA_HOME, constraints=slow, rest=False, clearance=None
    )
    steps: list[list[Step]] = [[], []]
    first = minimise(nodes_of(problem, 16), lambda step: bool(steps[0].append(step)), roughly=True)
    assert first.multipliers.max() > 0.0
    assert first.motion.violation <= 0.0
    again = minimise(first.motion, lambda step: bool(steps[1].append(step)), first.multipliers)
    cold = minimise(nodes_of(problem, 16), never)
    assert again.motion.cost <= cold.motion.cost * (1.0 + 1e-5)
    assert 2 * len(steps[1]) < len(steps[0])


# Costs of freedoms that are not used are equal to this share.
NO_DEARER = 5e-4


@pytest.mark.parametrize("cost", [sm.costs.JointAcceleration, sm.costs.JointJerk])
def test_costs_of_smoothness_are_at_their_optimum_with_and_without_a_tolerance(
    panda: sm.RobotModel, cost: type[sm.costs.Cost]
) -> None:
    """More freedom is cheaper, and from the motion without it nothing better is found."""
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.12, 4.0, normal=(1.0, 0.0, 0.0))
    limits = [sm.constraints.JointPositionLimits()]

    def planned(*tolerances: sm.Relaxation, warm: sm.Plan | None = None) -> sm.Plan:
        problem = sm.Problem(
            panda, circle, "pose", PANDA_HOME, costs=[cost()], constraints=limits,
            relaxations=tolerances,
        )  # fmt: skip
        found = sm.plan(problem, warm_start=warm)
        assert found.report.status is sm.optimise.Status.CONVERGED
        return found

    before = planned()
    for band in (2e-3, 2e-2):
        aside = sm.Relaxation("z", band, axes="tool")
        now = planned(aside)
        assert now.report.cost < before.report.cost
        again = planned(aside, warm=before if band < 1e-2 else now)
        assert again.report.cost >= now.report.cost * (1.0 - NO_DEARER)
        before = now
