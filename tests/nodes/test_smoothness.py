"""What lets a self-motion start and stop costs little, and the unit of costs changes nothing."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.nodes.smoothness import quickness, smoothing_of
from selfmotion.planning.nodes.spline import Quintic
from support.arms import Case, robot_named, short_line, start_of
from support.nodes import nodes_of, problem_of

# Plans are at their optimum to about this share; starting and stopping may cost this share of F.
OPTIMUM, STARTING = 1e-6, 4e-3
# In units of the usual cost.
UNITS = (1e-6, 1e4)
ARMS = [("planar_3r", "planar"), ("panda", "pose"), ("ur5", "pointing")]


def case_of(name: str, task: str) -> Case:
    arm = robot_named(name)
    start = start_of(arm, task)
    return arm, task, start, short_line(arm, start)


def pulled(case: Case, unit: float = 1.0, *, rest: bool = True) -> sm.Plan:
    """Plan a line with a cost that pulls the posture away from the start at once."""
    posture = case[2] + np.resize([0.6, 0.0, -0.6], case[0].dof)
    costs = [sm.costs.JointVelocity(unit), sm.costs.Posture(20.0 * unit, posture=posture)]
    return sm.plan(problem_of(case, costs=costs, rest=rest))


@pytest.mark.parametrize("names", ARMS, ids="-".join)
def test_the_unit_of_costs_changes_nothing(names: tuple[str, str]) -> None:
    case = case_of(*names)
    usual = pulled(case)
    t = np.linspace(0.0, usual.path.duration, 50)
    for unit in UNITS:
        plan = pulled(case, unit)
        assert plan.report.cost / unit == pytest.approx(usual.report.cost, rel=OPTIMUM)
        np.testing.assert_allclose(plan.trajectory(t), usual.trajectory(t), atol=1e-6)


@pytest.mark.parametrize("names", ARMS, ids="-".join)
def test_starting_and_stopping_costs_little(names: tuple[str, str]) -> None:
    """Against a motion that starts at once: none costs less, and no arm can."""
    at_once, smooth = (pulled(case_of(*names), rest=rest).report.cost for rest in (False, True))
    assert at_once <= smooth * (1.0 + OPTIMUM)
    assert smooth <= at_once * (1.0 + STARTING)


def test_a_wait_after_a_line_costs_nothing() -> None:
    """It makes nothing start more slowly: to stand still then is a motion of the line's cost."""
    robot, task, start, line = case_of("panda", "pose")
    waiting = line + sm.paths.Dwell(line.pose(line.duration), 60.0)
    alone, longer = (
        sm.plan(problem_of((robot, task, start, path), rest=True)) for path in (line, waiting)
    )
    assert longer.report.cost <= alone.report.cost * (1.0 + STARTING)


def test_what_starts_too_slowly_for_its_cost_is_quicker(case: Case) -> None:
    motion = nodes_of(problem_of(case, rest=True))
    problem, samples, cost = motion.grid.formulation, motion.sampled.arm, motion.cost
    assert quickness(problem, samples, 1e3 * cost, 1.0) == 1.0
    much = quickness(problem, samples, 1e-3 * cost, 1.0)
    more = quickness(problem, samples, 1e-4 * cost, 1.0)
    assert 0.0 < more <= much < 1.0


def test_what_is_held_for_a_while_begins_and_ends_without_a_jump() -> None:
    """The cost of accelerations is largest where that begins and ends, and nothing far from it."""
    robot, _, start, path = case_of("panda", "pose")
    window = (0.4 * path.duration, 0.7 * path.duration)
    held = sm.Relaxation("rz", 0.1, during=window)
    problem = Formulation.of(problem_of((robot, "pose", start, path), relaxations=[held]))
    t = np.linspace(0.0, path.duration, 201)
    spline = Quintic(t)
    found = smoothing_of(problem, spline, smoothed=False)
    assert found is not None
    times = spline.sampling.t
    for order in (2, 3):
        share = found.shares[order].ravel()
        near = np.min([np.abs(times - edge) for edge in window], axis=0)
        assert (share[near < 1e-3 * path.duration] > 0.9 * share.max()).all()
        assert share[near > 0.1 * path.duration].max() < 0.5 * share.max()
        for edge in window:
            assert share[np.argmin(np.abs(times - edge))] == pytest.approx(share.max(), rel=1e-2)
