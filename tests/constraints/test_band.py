"""Bands of coordinates hold at all times."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import FinishedMotion
from selfmotion.shell import testing
from support.arms import PANDA_HOME
from support.circles import coordinate_along, small_circle
from support.coordinates import COORDINATES


@pytest.mark.parametrize("name", COORDINATES)
def test_bands_and_pulls_keep_the_laws(panda: sm.RobotModel, name: str) -> None:
    coordinate = COORDINATES[name]
    value = float(coordinate(panda, PANDA_HOME[None])[0][0])
    problem = small_circle(panda, task="position")
    testing.check_constraint(sm.constraints.Band(coordinate, value + 0.05, 0.1), problem)
    testing.check_cost(sm.costs.Towards(panda, coordinate, value + 0.3), panda)


@pytest.mark.parametrize("name", ["joint", "height", "swivel"])
def test_a_band_is_kept_and_judged_at_all_times(panda: sm.RobotModel, name: str, tmp_path) -> None:
    coordinate = COORDINATES[name]
    free = sm.plan(small_circle(panda, task="position"))
    values = coordinate_along(free, coordinate)
    center, reach = float(values[0]), float(np.abs(values - values[0]).max())
    judged = sm.constraints.Band(coordinate, center, 2.0 * reach).requirement(panda)
    found = judged.judge(FinishedMotion(panda, free.trajectory))
    assert 0.5 <= found.amount <= 0.5 * (1.0 + 1e-4)
    band = sm.constraints.Band(coordinate, center, 0.5 * reach)
    constraints = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits(), band]
    plan = sm.plan(small_circle(panda, task="position", constraints=constraints))
    assert plan.certificate.verified, plan.certificate.verdict
    assert np.abs(coordinate_along(plan, coordinate) - center).max() <= 0.5 * reach
    assert plan.report.cost > free.report.cost
    refused = dict.fromkeys([band.requirement(panda)])
    wrong = sm.certify(panda, free.path, "position", free.trajectory, None, tuple(refused))
    assert wrong.findings[-1].requirement == band.requirement(panda).name
    assert not wrong.findings[-1].satisfied
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").check().verified
    sm.files.write_problem(plan.problem, tmp_path / "cell.toml")
    assert sm.read_problem(tmp_path / "cell.toml").constraints[2].center == center
