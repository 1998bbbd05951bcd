"""What lets a self-motion start and stop costs little, and the unit of costs changes nothing."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.nodes import on_grid, smoothness
from selfmotion.planning.nodes.smoothness import can_be_smoothed, quickness, smoothing_of
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


def held_case(duration: float) -> tuple[Formulation, Quintic]:
    robot, _, start, path = case_of("panda", "pose")
    longer = sm.paths.Line(path.pose(0.0), path.pose(path.duration), duration)
    window = (0.4 * duration, 0.7 * duration)
    held = sm.Relaxation("rz", 0.1, during=window)
    problem = problem_of((robot, "pose", start, longer), relaxations=[held])
    return Formulation.of(problem), Quintic(np.linspace(0.0, duration, 41))


def test_penalties_have_the_units_of_times_to_their_powers() -> None:
    """Of q̈ s², of the jerk s⁴: with twice the duration 4 and 16 times as much."""
    once, twice = (smoothing_of(*held_case(seconds), smoothed=False) for seconds in (2.0, 4.0))
    assert once is not None
    assert twice is not None
    for order, factor in ((2, 4.0), (3, 16.0)):
        np.testing.assert_allclose(twice.shares[order], factor * once.shares[order], rtol=1e-9)


def test_penalties_end_without_a_jump_of_their_second_derivatives() -> None:
    """b falls to 0 as the third power of the distance from where it ends."""
    wide = smoothness._NEAR_REST
    near = [smoothness._faded(np.array([wide - away]), 1.0)[0] for away in (1e-2, 1e-3, 1e-4)]
    np.testing.assert_allclose(np.array(near[1:]) / near[:-1], 1e-3, rtol=0.05)
    assert smoothness._faded(np.array([wide, 2.0 * wide]), 1.0).tolist() == [0.0, 0.0]
    assert smoothness._faded(np.zeros(1), 1.0).tolist() == [1.0]


def test_quickness_and_smoothing_are_decided_by_what_they_add() -> None:
    """The penalty itself decides, up to named shares of the cost."""
    case = case_of("panda", "pose")
    resting = nodes_of(problem_of(case, rest=True))
    problem, samples = resting.grid.formulation, resting.sampled.arm
    added = float(resting.quadratic.smoothing.sum())
    most = added / smoothness._TOO_MUCH
    assert quickness(problem, samples, most * 1.001, 1.0) == 1.0
    assert quickness(problem, samples, most * 0.999, 1.0) < 1.0
    # It has an end, above 0.
    least = [quickness(problem, samples, share * most, 1.0) for share in (1e-12, 1e-15)]
    assert least[0] == least[1] > 0.0
    moving = nodes_of(problem_of(case))
    problem, samples = moving.grid.formulation, moving.sampled.arm
    smoothed = on_grid(moving, moving.grid.on(moving.grid.t, smoothed=True))
    assert smoothed is not None
    most = (smoothed.objective - smoothed.cost) / smoothness._LITTLE
    assert can_be_smoothed(problem, samples, most * 1.001)
    assert not can_be_smoothed(problem, samples, most * 0.999)


def test_costs_without_speeds_take_the_usual_weights() -> None:
    case = case_of("panda", "pose")
    posture = sm.costs.Posture(2.0, posture=case[2])
    problem = Formulation.of(problem_of(case, costs=[posture], rest=True))
    found = smoothing_of(problem, Quintic(np.linspace(0.0, 1.0, 9)), smoothed=False)
    assert found is not None
    usual = np.asarray(sm.costs.JointVelocity.usual(case[0]).weight)
    np.testing.assert_allclose(np.diagonal(found.weight), np.broadcast_to(usual, case[0].dof))


def test_costs_that_are_no_quadratic_forms_have_no_order(case: Case) -> None:
    """Of others it is that of the highest derivative."""
    hill = sm.costs.FunctionCost(lambda qd, q, t: np.sum(q**2, axis=1))
    for costs, order in (
        ([hill], 0),
        ([hill, sm.costs.JointVelocity()], 1),
        ([sm.costs.JointJerk(), sm.costs.JointVelocity()], 3),
    ):
        assert smoothness.highest_order(Formulation.of(problem_of(case, costs=costs))) == order
