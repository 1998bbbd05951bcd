"""A free start is never worse, and repeats."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.formulation import Formulation, keeps_off_itself
from selfmotion.planning.planner.solution import Solution
from support.arms import robot_named

Circle = Callable[..., sm.Problem]


def test_free_start_is_never_worse_and_repeats(panda_circle: Circle) -> None:
    fixed = sm.plan(panda_circle())
    free = sm.plan(dataclasses.replace(panda_circle(), start="free"))
    again = sm.plan(dataclasses.replace(panda_circle(), start=None))
    assert free.report.cost <= fixed.report.cost
    assert free.certificate.verified
    np.testing.assert_array_equal(free.trajectory.q, again.trajectory.q)


@dataclasses.dataclass(frozen=True)
class Found:
    """A motion of which only this is known."""

    cost: float
    penalty: float
    keeps_off_itself: bool = True

    @property
    def violations(self) -> tuple[str, ...]:
        return ("clearance",) if self.penalty else ()

    def merit(self) -> float:
        return self.cost + self.penalty


def test_of_two_that_violate_constraints_the_nearer_is_kept() -> None:
    """A cheap motion through a body is no better start than a dearer one that touches it."""
    through, touching, free = Found(1.0, 50.0), Found(2.0, 0.1), Found(9.0, 0.0)
    itself = Found(0.5, 0.0, keeps_off_itself=False)
    guess: Any = None
    ranked = [Solution(guess, outcome) for outcome in (through, touching, free, itself)]
    best_first = [solution.outcome for solution in sorted(ranked, key=Solution.score)]
    assert best_first == [free, itself, touching, through]


BANDS = {
    "cone": sm.Relaxation(("rx", "ry"), 0.2),
    "stick-out": sm.Relaxation("z", 5e-3, axes="tool"),
    "turn": sm.Relaxation("rz"),
}


@pytest.mark.parametrize("name", BANDS)
def test_motions_that_begin_beside_a_relaxed_path_are_gone_on_with(
    name: str, panda_circle: Circle
) -> None:
    """Rough optima make use of the bands from the first pose on, and lead to a plan from there."""
    free = dataclasses.replace(panda_circle(), start=None)
    relaxed = dataclasses.replace(free, relaxations=[BANDS[name]])
    plan = sm.plan(relaxed)
    assert plan.certificate.verified, plan.certificate.verdict
    outcomes = {attempt.name: attempt.outcome for attempt in plan.report.attempts}
    assert outcomes["starts"] == "all constraints are met"
    assert "global search" not in outcomes
    # The path itself is one of what is allowed; optima of one valley agree to this.
    assert plan.report.cost <= sm.plan(free).report.cost * (1.0 + 1e-3)


def test_a_motion_that_takes_the_arm_into_itself_is_passed_over_for_another() -> None:
    """A path of which the cheapest motion does: number 41 of `make bench NAME=starts`."""
    start = [
        [0.4700355675781523, 0.8537355921741101, 0.2240582599829922, -0.07655730776130869],
        [-0.07905675572007381, -0.212106666619445, 0.9740435264148128, -0.061082667649131284],
        [0.8790998774806541, -0.4755484209107517, -0.03220411127153957, -0.4265958065050183],
        [0.0, 0.0, 0.0, 1.0],
    ]
    center = [-0.1580378732556933, -0.02460255901258996, -0.3915036403927299]
    normal = [-0.5276985537584152, -0.6121715290793273, -0.5888805102446127]
    ur5 = robot_named("ur5")
    problem = sm.Problem(ur5, sm.paths.Circle(start, center, normal, 4.0), "pointing")
    careless = sm.plan(dataclasses.replace(problem, clearance=None))
    assert not keeps_off_itself(Formulation.of(problem), careless.trajectory.q)
    plan = sm.plan(problem)
    assert plan.certificate.verified, plan.certificate.verdict
    assert plan.report.cost > careless.report.cost
    assert not any("itself" in attempt.name for attempt in plan.report.attempts)


def test_limits_are_kept_that_nobody_spoke_of(panda: sm.RobotModel) -> None:
    """A certificate judges the arm's own limits in any case: asked for, they cost the same."""
    pose = panda.pose(np.array(sm.NAMED_ARMS["panda"].home))
    circle = sm.paths.Circle.around(pose, 0.2, 4.0, normal=(1.0, 0.0, 0.0))
    closed = sm.constraints.ClosedPath()
    limits = sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()
    plans = [
        sm.plan(
            sm.Problem(panda, circle, "position", constraints=asked),
            search=sm.Search(starts=12, finalists=2),
        )
        for asked in ([closed], [*limits, closed])
    ]
    assert all(plan.certificate.verified for plan in plans), plans[0].certificate.verdict
    assert plans[0].report.cost == pytest.approx(plans[1].report.cost, rel=1e-4)
