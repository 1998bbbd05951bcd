"""What ends a plan on nodes: a motion whose accelerations do not waver between them."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import selfmotion as sm
from support.arms import PANDA_HOME

# What accelerations change along the way, as a share of those of a spline through few velocities;
# three times as much where velocities at nodes waver.
WAVERING = 1.25


def changes(accelerations: np.ndarray) -> np.ndarray:
    """Return how much each joint's acceleration (K, n) changes in all."""
    return np.abs(np.diff(accelerations, axis=0)).sum(axis=0)


@pytest.mark.parametrize("task", ["position", "pose"])
def test_accelerations_do_not_waver_between_nodes(task: str) -> None:
    panda = sm.load_robot("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0)
    plan = sm.plan(sm.Problem(panda, circle, task, PANDA_HOME)).require()
    motion = plan.trajectory
    # Away from the ends, where the self-motion starts and stops.
    t = np.linspace(0.8, 3.2, 4001)
    few = np.linspace(0.0, 4.0, 33)
    smooth = CubicSpline(few, motion(few, 1))(t, 1)
    moves = changes(smooth) > 0.1 * changes(smooth).max()
    assert np.all((changes(motion(t, 2)) <= WAVERING * changes(smooth))[moves])
