"""Which poses are in reach."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import selfmotion as sm
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import reachable
from support.arms import robot_named


@pytest.mark.parametrize(
    ("name", "task"),
    [("panda", "pose"), ("panda", "position"), ("ur5", "pointing"), ("planar_3r", "planar")],
)
def test_what_a_motion_within_the_limits_draws_is_in_reach(name: str, task: str) -> None:
    """Joint motions that hug their limits: no pose of theirs may count as out of reach."""
    robot = robot_named(name)
    lower, upper = robot.finite_limits()
    t = np.linspace(0.0, 4.0, 81)
    for seed in range(8):
        rng = np.random.default_rng(seed)
        # The first ones begin anywhere, the others at limits, where the planar arm is stretched.
        anywhere = seed < 4 or task == "planar"
        share = rng.uniform(0.05, 0.95, robot.dof) if anywhere else rng.integers(0, 2, robot.dof)
        first = lower + (upper - lower) * share
        knots = first + np.cumsum(rng.uniform(-0.6, 0.6, (5, robot.dof)), axis=0)
        rough = make_interp_spline(np.linspace(0.0, 4.0, 5), knots)(t)
        inside = np.pad(np.clip(rough, lower + 1e-3, upper - 1e-3), ((4, 4), (0, 0)), mode="edge")
        q = np.stack([np.convolve(joint, np.ones(9) / 9.0, "valid") for joint in inside.T], axis=1)
        path = sm.paths.Waypoints.from_poses(t, [robot.pose(x) for x in q])
        for start in (None, q[0]):
            problem = sm.Problem(robot, path, task, start, rest=False, clearance=None)
            whole = Formulation.of(problem)
            assert reachable(whole, 48, np.random.default_rng(0)).reason == ""
