"""The distance of a plan to the global optimum: what it tells, and that it is kept and shown."""

import dataclasses
import io
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.shell.cli import tables

# Two optimisers of the same motion agree to the tolerance at which grids are accepted.
SETTLED = 1e-3


# Bends of the elbow: a motion through them changes the family.
ELBOWS = (-1.0, 1.0)


def level(x: float, y: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))


@pytest.fixture(scope="module")
def free() -> sm.Problem:
    """A path inside 3 m, where elbow up and elbow down are families of their own."""
    robot = sm.load_robot("planar_3r")
    path = sm.paths.Line(level(1.0, 0.5), level(1.6, 0.1), 1.0)
    limits = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())
    return sm.Problem(robot, path, "planar", constraints=limits)


def given(free: sm.Problem, elbow: float) -> sm.Problem:
    start = free.robot.inverse_kinematics(
        free.path.pose(0.0), "planar", seed=[-elbow, 2.0 * elbow, 0.3 * elbow]
    )
    assert np.sign(start[1]) == elbow
    return dataclasses.replace(free, start=start)


@pytest.fixture(scope="module")
def compared(free: sm.Problem) -> dict[float, sm.Plan]:
    return {elbow: sm.plan(given(free, elbow), search=sm.Search(compare=True)) for elbow in ELBOWS}


def test_a_plan_in_the_worse_family_is_told_how_much_worse(
    free: sm.Problem, compared: dict[float, sm.Plan]
) -> None:
    best = sm.plan(free, search=sm.Search(mode="global")).report
    assert best.gap is not None
    assert best.gap.cost_excess == 0.0
    for plan in compared.values():
        gap = plan.report.gap
        assert gap is not None
        # The same search, whatever the plan; the excess is that over its best motion.
        assert gap.best_cost == pytest.approx(best.cost, rel=SETTLED)
        assert gap.cost_excess == pytest.approx(plan.report.cost / best.cost - 1.0, abs=SETTLED)
    excesses = sorted(plan.report.gap.cost_excess for plan in compared.values())
    assert excesses[1] > 0.2


def test_a_given_start_is_kept_and_only_compared(
    free: sm.Problem, compared: dict[float, sm.Plan]
) -> None:
    for elbow, plan in compared.items():
        alone = sm.plan(given(free, elbow))
        np.testing.assert_array_equal(alone.trajectory.q, plan.trajectory.q)
        assert alone.report.gap is None


def test_path_lengths_are_compared_like_with_like(free: sm.Problem) -> None:
    """Where the cost is the path length, the plan is about as long as the shortest sequence."""
    costs = [sm.costs.PathLength(smoothing=0.005)]
    motion = sm.motion.BSplineNullMotion(20)
    gap = sm.plan(
        dataclasses.replace(free, costs=costs, null_motion=motion),
        search=sm.Search(mode="global"),
    ).report.gap
    assert gap is not None
    # A sequence is samples, no closer than 3e-3 rad to the optimum at each waypoint.
    assert abs(gap.length_excess) < 0.05


def test_the_gap_is_saved_and_shown(compared: dict[float, sm.Plan], tmp_path: Path) -> None:
    plan = compared[1.0]
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").report.gap == plan.report.gap
    console = Console(file=io.StringIO(), width=120)
    tables.show(plan, console)
    text = console.file.getvalue()
    assert "global search over self-motions sampled 0.1 rad apart" in text
    assert f"{100 * plan.report.gap.cost_excess:+.2f} % from its best motion" in text


def test_other_redundancies_are_refused(panda: sm.RobotModel) -> None:
    start = panda.dexterous_configuration()
    path = sm.paths.Line(panda.pose(start), panda.pose(start + 0.05), 1.0)
    with pytest.raises(
        sm.errors.ProblemError, match="compare: the global search needs redundancy 1"
    ):
        sm.plan(sm.Problem(panda, path, "position", start=start), search=sm.Search(compare=True))
