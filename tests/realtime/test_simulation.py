"""Closed loops with a simulated arm keep all laws."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.realtime import Replanner, SimulatedArm
from support import realtime_scenarios as scenarios
from support.arms import PANDA_HOME


@pytest.mark.parametrize("seed", range(12))
def test_random_scenarios_keep_all_laws(panda: sm.RobotModel, seed: int) -> None:
    task = ("pose", "position", "pointing")[seed % 3]
    outcome = scenarios.run(seed, task, panda, Replanner(panda, task))
    assert outcome.faults == []


def test_the_judge_of_scenarios_rejects_a_jump_and_a_broken_limit(
    panda: sm.RobotModel, slow_circle: sm.paths.Circle
) -> None:
    replanner = Replanner(panda)
    arm = SimulatedArm(PANDA_HOME, replanner.cycle)
    arm.write(replanner.step(0.0, PANDA_HOME, np.zeros(7), slow_circle))
    arm.run(0.02)
    assert scenarios.limits_broken(replanner, arm) == []
    good = list(arm.commanded)
    q, qd, qdd = good[5]
    arm.commanded[5] = (q + 1e-6, qd, qdd)
    assert "a jump" in scenarios.limits_broken(replanner, arm)[0]
    arm.commanded[5] = (q, qd, 1.01 * replanner.limits[3])
    assert "acceleration beyond its limit" in scenarios.limits_broken(replanner, arm)
    arm.commanded[5] = (np.full(7, np.nan), qd, qdd)
    assert scenarios.limits_broken(replanner, arm) == ["not finite"]


def test_a_simulated_arm_wants_a_segment() -> None:
    with pytest.raises(sm.errors.ProblemError, match="no segment"):
        SimulatedArm(PANDA_HOME, 1e-3).run(0.1)
