"""Where constraints cannot be met from x = 0, other null motions lead there."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from support.places import DATA

# How far the last joint may be from the motion that it has to follow [rad].
WIDTH = 0.02


POSES = DATA / "panda__1cube" / "path.csv"


@dataclass(frozen=True, eq=False)
class Corridor(sm.Constraint):
    """The last joint within `WIDTH` of a known motion's."""

    motion: sm.Trajectory

    def bind(self, follows: sm.Follows, start: Array, end: Array) -> "Nodes":
        return Nodes(self.motion)

    def requirement(self, robot: sm.RobotModel) -> sm.Requirement:
        return Judge(self.motion)


@dataclass(frozen=True, eq=False)
class Nodes:
    motion: sm.Trajectory
    name: str = "corridor"
    equality: bool = False
    tolerance: float = 1e-2

    def _off(self, samples: sm.Samples) -> Array:
        nodes = samples.nodes
        return np.asarray(samples.q[nodes, -1] - self.motion(samples.t[nodes])[:, -1])

    def residual(self, samples: sm.Samples) -> Array:
        return (np.abs(self._off(samples)) / WIDTH - 1.0)[:, None]

    def tangents(self, samples: sm.Samples, motion: sm.NodeTangents) -> Array:
        side = np.sign(self._off(samples))[:, None]
        return np.asarray(side * motion.q[:, -1] / WIDTH)[:, None]

    def describe(self, samples: sm.Samples, row: int, column: int) -> str:
        return f"{self._off(samples)[row]:.3f} rad off"


@dataclass(frozen=True, eq=False)
class Judge(sm.Requirement):
    motion: sm.Trajectory
    name: str = "corridor"

    def judge(self, motion: sm.FinishedMotion) -> sm.Finding:
        off = np.abs(motion.q[:, -1] - self.motion(motion.t)[:, -1])
        worst = int(np.argmax(off))
        time, most = float(motion.t[worst]), float(off[worst])
        kept = bool(most <= 1.05 * WIDTH)
        return sm.Finding(self.name, "joint 3", time, most, WIDTH, kept, f"{most:.3f} rad off")


@pytest.fixture(scope="module")
def winding() -> sm.Problem:
    """A corridor that bends more often than a cubic can."""
    free = sm.sample_problem()

    def pulled(qd: Array, q: Array, t: Array) -> Array:
        return 50.0 * (q[:, -1] - free.given_start[-1] - 0.15 * np.sin(3.0 * np.pi * t)) ** 2

    spline = sm.BSplineNullMotion(16)
    problem = sm.Problem(
        free.robot, free.path, free.task, free.given_start, spline, [sm.FunctionCost(pulled)]
    )
    known = sm.plan(problem).trajectory
    return sm.Problem(
        free.robot,
        free.path,
        free.task,
        free.given_start,
        costs=[sm.JointVelocity()],
        constraints=[Corridor(known)],
    )


def test_what_a_cubic_cannot_meet_the_default_meets_with_more_freedom(winding: sm.Problem) -> None:
    cubic = replace(winding, null_motion=sm.PolynomialNullMotion())
    assert not sm.plan(cubic).certificate.verified
    found = sm.plan(winding)
    assert found.certificate.verified
    assert isinstance(found.report.null_motion, sm.NodeNullMotion)


@pytest.mark.parametrize(
    "motion",
    [sm.BSplineNullMotion(24), sm.BSplineNullMotion(7, degree=2), sm.BSplineNullMotion(5, 1)],
)
def test_a_detour_leads_to_motions_that_the_null_motion_has(motion: sm.NullMotion) -> None:
    t = np.linspace(0.0, 2.0, 301)
    for other in motion.detours(1):
        table = other.functions(t, 2.0)
        own = motion.functions(t, 2.0)
        np.testing.assert_allclose(own @ np.linalg.lstsq(own, table)[0], table, atol=1e-9)


def test_one_polynomial_has_no_detour_and_the_default_refines() -> None:
    assert sm.PolynomialNullMotion().detours(1) == ()
    assert sm.BSplineNullMotion(1).detours(1) == ()
    assert [one.intervals for one in sm.RefinedNullMotion().detours(1)] == [8, 16]
    assert [one.intervals for one in sm.RefinedNullMotion(most=8).detours(1)] == [8]


def test_the_default_takes_more_freedom_before_it_restores(monkeypatch: pytest.MonkeyPatch) -> None:
    """200 poses that a Panda can follow within its limits, but not by a cubic near x = 0."""

    def unwanted(*given: object) -> None:
        raise AssertionError("restored")

    robot = sm.load_robot("panda", tool="panda_hand")
    path = sm.Waypoints.from_csv(POSES)
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
    cubic = sm.plan(sm.Problem(robot, path, start=start, null_motion=sm.PolynomialNullMotion()))
    monkeypatch.setattr("selfmotion.optimise.sqp_state.restored", unwanted)
    default = sm.plan(sm.Problem(robot, path, start=start))
    assert default.certificate.verified
    assert default.report.cost < cubic.report.cost


def too_fast(motion: sm.NullMotion) -> sm.Plan:
    """Plan a path that is twice as fast as its limit, whatever the joints do."""
    free = sm.sample_problem()
    times = np.linspace(0.0, free.path.duration, 2001)
    speed = np.linalg.norm(free.path.samples(times).twist[:, :3], axis=1).max()
    limits = sm.ToolLimits(speed=0.5 * speed)
    return sm.plan(replace(free, null_motion=motion, constraints=[limits]))


def test_where_nothing_can_be_met_the_default_is_no_worse_than_the_cubic() -> None:
    for motion in (sm.PolynomialNullMotion(), sm.RefinedNullMotion(), sm.BSplineNullMotion(32)):
        plan = too_fast(motion)
        assert not plan.certificate.verified
        assert "2 times its limit" in plan.certificate.verdict


def test_a_fine_spline_is_approached_through_a_rough_one_and_ends_where_it_would(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    free = replace(sm.sample_problem(), null_motion=sm.BSplineNullMotion(8))
    easy = sm.plan(free)
    peaks = np.abs(easy.trajectory.qd).max(axis=0)
    assert np.any(np.abs(easy.initial_trajectory.qd).max(axis=0) > 1.05 * peaks)
    bound = replace(free, constraints=[sm.JointVelocityLimits(1.02 * peaks)])
    assert sm.BSplineNullMotion(15).rough == sm.BSplineNullMotion(15)
    assert sm.BSplineNullMotion(64, 1, "joint").rough == sm.BSplineNullMotion(8, 3, "joint")
    assert sm.PolynomialNullMotion().rough == sm.PolynomialNullMotion()
    sizes, costs = [], []
    for direct in (False, True):
        if direct:
            monkeypatch.setattr(sm.BSplineNullMotion, "rough", property(lambda own: own))
        plan = sm.plan(replace(bound, null_motion=sm.BSplineNullMotion(48)))
        assert plan.certificate.verified
        sizes.append(list(dict.fromkeys(len(step.x) for step in plan.report.history)))
        costs.append(plan.report.cost)
    assert sizes == [[11, 51], [51]]
    assert costs[0] == pytest.approx(costs[1], rel=1e-4)
