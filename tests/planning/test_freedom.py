"""Where a cubic meets no constraints, nodes do; where nothing can, that is said."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.problem.constraints import DependsOn
from support.places import DATA

# How far the last joint may be from the motion that it has to follow [rad].
WIDTH = 0.02


POSES = DATA / "panda__1cube" / "path.csv"


@dataclass(frozen=True, eq=False)
class Corridor(sm.constraints.Constraint):
    """The last joint within `WIDTH` of a known motion's."""

    motion: sm.Trajectory

    def conditions(self, robot: sm.RobotModel) -> sm.constraints.Conditions:
        return sm.constraints.Conditions(points=(Nodes(self.motion),))

    def requirement(self, robot: sm.RobotModel) -> sm.certificate.Requirement:
        return Judge(self.motion)


@dataclass(frozen=True, eq=False)
class Nodes(sm.constraints.BoundConstraint):
    motion: sm.Trajectory
    name: str = "corridor"
    equality: bool = False
    tolerance: float = 1e-2

    def _off(self, samples: sm.costs.Samples) -> Array:
        nodes = samples.nodes
        return np.asarray(samples.q[nodes, -1] - self.motion(samples.t[nodes])[:, -1])

    def residual(self, samples: sm.costs.Samples) -> Array:
        return (np.abs(self._off(samples)) / WIDTH - 1.0)[:, None]

    def tangents(self, samples: sm.costs.Samples, motion: sm.constraints.NodeTangents) -> Array:
        side = np.sign(self._off(samples))[:, None]
        return np.asarray(side * motion.q[:, -1] / WIDTH)[:, None]

    def describe(self, samples: sm.costs.Samples, row: int, column: int) -> str:
        return f"{self._off(samples)[row]:.3f} rad off"


@dataclass(frozen=True, eq=False)
class Judge(sm.certificate.Requirement):
    motion: sm.Trajectory
    name: str = "corridor"

    def judge(self, motion: sm.certificate.FinishedMotion) -> sm.certificate.Finding:
        off = np.abs(motion.q[:, -1] - self.motion(motion.t)[:, -1])
        worst = int(np.argmax(off))
        time, most = float(motion.t[worst]), float(off[worst])
        kept = bool(most <= 1.05 * WIDTH)
        return sm.certificate.Finding(
            self.name, "joint 3", time, most, WIDTH, kept, f"{most:.3f} rad off"
        )


@pytest.fixture(scope="module")
def winding() -> sm.Problem:
    """A corridor that bends more often than a cubic can."""
    free = sm.sample_problem()

    def pulled(qd: Array, q: Array, t: Array) -> Array:
        return 50.0 * (q[:, -1] - free.given_start[-1] - 0.15 * np.sin(3.0 * np.pi * t)) ** 2

    spline = sm.motion.BSplineNullMotion(16)
    problem = sm.Problem(
        free.robot, free.path, free.task, free.given_start, spline, [sm.costs.FunctionCost(pulled)]
    )
    known = sm.plan(problem).trajectory
    return sm.Problem(
        free.robot,
        free.path,
        free.task,
        free.given_start,
        costs=[sm.costs.JointVelocity()],
        constraints=[Corridor(known)],
    )


def test_a_condition_at_all_times_is_of_the_joints_alone(winding: sm.Problem) -> None:
    class OfAll(Nodes):
        depends_on = DependsOn.ALL

    class WithAll(Corridor):
        def conditions(self, robot: sm.RobotModel) -> sm.constraints.Conditions:
            return sm.constraints.Conditions(points=(OfAll(self.motion),))

    (known,) = winding.constraints
    assert isinstance(known, Corridor)
    wrong = replace(winding, constraints=[WithAll(known.motion)])
    with pytest.raises(sm.errors.ProblemError, match="'corridor': it is of joints and tolerances"):
        sm.plan(wrong)


def test_what_a_cubic_cannot_meet_the_default_meets_with_more_freedom(winding: sm.Problem) -> None:
    cubic = replace(winding, null_motion=sm.PolynomialNullMotion())
    assert not sm.plan(cubic).certificate.verified
    found = sm.plan(winding)
    assert found.certificate.verified
    assert isinstance(found.report.null_motion, sm.motion.NodeNullMotion)


def test_what_no_cubic_near_x_0_keeps_is_kept() -> None:
    """200 poses that a Panda can follow within its limits, but not by a cubic near x = 0."""
    robot = sm.load_robot("panda", tool="panda_hand")
    path = sm.paths.Waypoints.from_csv(POSES)
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    problem = sm.Problem(robot, path, start=start)
    cubic = sm.plan(replace(problem, null_motion=sm.PolynomialNullMotion()))
    assert not cubic.certificate.verified
    assert "the published method keeps nothing but given ends" in cubic.report.message
    # What is not asked of it is not searched for.
    names = [attempt.name for attempt in cubic.report.attempts]
    assert names == ["given start", "finer grids and proof"]
    assert sm.plan(problem).certificate.verified


def too_fast(motion: sm.motion.NullMotion) -> sm.Plan:
    """Plan a path that is twice as fast as its limit, whatever the joints do."""
    free = sm.sample_problem()
    times = np.linspace(0.0, free.path.duration, 2001)
    speed = np.linalg.norm(free.path.samples(times).twist[:, :3], axis=1).max()
    limits = sm.constraints.ToolLimits(speed=0.5 * speed)
    return sm.plan(replace(free, null_motion=motion, constraints=[limits]))


def test_where_nothing_can_be_met_the_verdict_says_by_how_much() -> None:
    for motion in (
        sm.PolynomialNullMotion(),
        sm.motion.FreeNullMotion(),
        sm.motion.BSplineNullMotion(32),
    ):
        plan = too_fast(motion)
        assert not plan.certificate.verified
        assert "2 times its limit" in plan.certificate.verdict
        # What cannot be kept is not paid for.
        assert plan.report.cost <= plan.report.initial_cost
