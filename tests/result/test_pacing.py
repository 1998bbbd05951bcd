"""Programmes of paces stay as small as their motions, whatever is asked of them."""

from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.robot import Dynamics
from selfmotion.planning.result import Ends, PaceLimits, fastest_pace, pacing, quantities_of_pace
from support.arms import PANDA_HOME, robot_named

# Unknowns of the programmes of so brief a motion: four times those that they may begin with.
MOST = 4 * 2002


@pytest.fixture
def sizes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many unknowns the programmes have that are solved from now on."""
    seen: list[int] = []

    def counted(gradient: np.ndarray, *others: Any) -> tuple[np.ndarray, bool]:
        seen.append(len(gradient))
        return solved(gradient, *others)

    solved = pacing.banded_optimum
    monkeypatch.setattr(pacing, "banded_optimum", counted)
    return seen


@pytest.mark.parametrize("share", [0.7, 3.0])
def test_knots_are_bounded_also_where_no_pace_keeps_the_limits(
    sizes: list[int], share: float
) -> None:
    panda, turn = robot_named("panda"), np.full(7, 0.1)
    t = np.linspace(0.0, 1.0, 9)
    q = PANDA_HOME + t[:, None] * turn
    motion = sm.Trajectory(t, q, np.tile(turn, (9, 1)), panda.joint_names, 0.0 * q)
    # Less than the torque that holds the arm does not; three times as much moves it.
    held = np.abs(Dynamics(panda).torques(q[:1], 0.0 * q[:1], 0.0 * q[:1])).max()
    torques = sm.constraints.JointTorqueLimits(share * held)
    limits = PaceLimits(
        np.full(7, 0.02),
        np.full(7, 5.0),
        np.full(7, 100.0),
        quantities_of_pace([torques.requirement(panda)]),
    )
    pace = fastest_pace(motion, limits, Ends(), 4e-3)
    assert max(sizes) <= MOST
    used = limits.shares(pacing.along(pace, motion))[0]
    assert max(float(table.max()) for table in used[:3]) <= 1.0 + 1e-6
    assert (max(float(table.max()) for table in used) > 1.001) == (share < 1.0)
