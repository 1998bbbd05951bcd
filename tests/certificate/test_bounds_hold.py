"""The law of the bound: on 10,000 random intervals it is never below the truth, nor far above."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import BoundedFunction, MotionSegments, Shares
from selfmotion.certificate.bounding import _measured
from selfmotion.certificate.path_error import _PathErrors
from selfmotion.model.follow import BoundTaskFrame
from selfmotion.shell.testing.constraints import check_majorants
from support.arms import robot_named
from support.two_arms import baxter_with_both_arms

ROUNDING = 1e-9
# Intervals of each kind; with ten kinds 10,000 in all.
COUNT = 1000
# Places of each interval at which the truth is looked for.
DENSE = np.linspace(-1.0, 1.0, 41)


def random_motion(robot: sm.RobotModel, rng: np.random.Generator) -> sm.Trajectory:
    """Steps of 5 to 80 ms at speeds of order 1 rad/s, rough where samples meet."""
    t = np.append(0.0, np.cumsum(rng.uniform(0.005, 0.08, COUNT)))
    rate, phase = rng.uniform(1.0, 4.0, robot.dof), rng.uniform(0.0, 6.0, robot.dof)
    turned, size = np.outer(t, rate) + phase, 0.25
    q = robot.dexterous_configuration("pose") + size * np.sin(turned)
    qd = size * rate * np.cos(turned) + rng.normal(0.0, 0.05, q.shape)
    qdd = -size * rate**2 * np.sin(turned) + rng.normal(0.0, 2.0, q.shape)
    return sm.Trajectory(t, q, qd, robot.joint_names, qdd)


class Wide:
    """The same function, with everything allowed."""

    def __init__(self, function: BoundedFunction) -> None:
        self._function = function
        self.blocks, self.of = function.blocks, function.of
        self.allowed = np.full(len(function.of), np.inf)
        self.wanted = np.full(len(function.blocks), 1e-3)

    def __getattr__(self, name: str) -> object:
        return getattr(self._function, name)


def kinds(robot: sm.RobotModel, motion: sm.Trajectory) -> dict[str, BoundedFunction]:
    pose = robot.pose(motion.q[0])
    path = sm.paths.Circle.around(pose, 0.1, float(motion.t[-1]), turns=0.05, turn_tool=True)
    free = (sm.Relaxation("rz", 0.1), sm.Relaxation(("x", "y"), 1e-2, axes="tool"))
    tilted = (sm.Relaxation(("rx", "ry"), 0.1), free[1])
    given, pointing = sm.Tolerance(), sm.Task.POINTING
    follow = BoundTaskFrame(robot.chain, path, sm.Task.POSE)
    if robot.reference is not None:
        limits = sm.constraints.ToolLimits(1.0, 1.0, 10.0, 10.0)
        return {
            "relative": _PathErrors(follow, given, ()),
            "relative rates": Shares(limits.quantity(robot)),
        }
    return {
        "path": _PathErrors(follow, given, ()),
        "pointing": _PathErrors(replace(follow, task=pointing), given, ()),
        "relaxed": _PathErrors(follow, given, free),
        "pointing, relaxed": _PathErrors(replace(follow, task=pointing), given, tilted),
    } | {
        name: Shares(constraint.quantity(robot))
        for name, constraint in {
            "joint": sm.constraints.Band(sm.robot.JointCoordinate(robot.joint_names[2]), 0.1, 0.5),
            "height": sm.constraints.Band(sm.robot.FrameCoordinate(robot.joint_names[4]), 0.2, 0.5),
            "swivel": sm.constraints.Band(sm.robot.SwivelAngle(), 0.2, 0.5),
            "torques": sm.constraints.JointTorqueLimits(30.0, payload=2.0, center=(0.0, 0.1, 0.1)),
            "speed": sm.constraints.ToolLimits(1.0),
            "rates": sm.constraints.ToolLimits(turn_rate=1.0, turn_acceleration=10.0),
            "acceleration": sm.constraints.ToolLimits(acceleration=10.0),
        }.items()
    }


NAMES = [
    "path",
    "pointing",
    "relaxed",
    "pointing, relaxed",
    "joint",
    "height",
    "swivel",
    "torques",
    "speed",
    "rates",
    "acceleration",
    "relative",
    "relative rates",
]


def robot_of(name: str) -> sm.RobotModel:
    """A Panda, or Baxter's left hand as its right one sees it."""
    relative = name.startswith("relative")
    return baxter_with_both_arms("right_gripper") if relative else robot_named("panda")


@pytest.mark.parametrize("name", NAMES)
def test_bounds_are_never_below_the_truth_nor_far_above(name: str) -> None:
    robot, rng = robot_of(name), np.random.default_rng(sum(map(ord, name)))
    motion = random_motion(robot, rng)
    function = Wide(kinds(robot, motion)[name])
    # The swivel of a nearly stretched arm is known on short intervals only.
    ends = motion.t[:-1] + np.diff(motion.t) * (0.1 if name == "swivel" else 1.0)
    segments = MotionSegments(robot, motion, np.stack([motion.t[:-1], ends], axis=1))
    found = _measured(function, segments)  # type: ignore[arg-type]  # it has all that is asked for
    truth = _truth(function, segments)
    assert found.proved
    known = np.isfinite(found.values).all(axis=1)
    # Near the stretched arm a swivel has none.
    assert known.mean() >= (0.5 if name == "swivel" else 0.99)
    assert np.all(truth[known] <= found.values[known] + ROUNDING)
    assert np.all(np.median(found.values[known] / np.maximum(truth[known], 1e-6), axis=0) <= 100.0)


def _truth(function: Wide, segments: MotionSegments) -> Array:
    values = function.values(segments, DENSE)  # type: ignore[operator]
    return np.asarray(function.sizes(values, segments).max(axis=1))  # type: ignore[operator]


def standing(robot: sm.RobotModel) -> tuple[sm.Trajectory, sm.paths.Path]:
    """An arm that hardly moves, and a path that turns fast a metre beside it."""
    q = robot.dexterous_configuration("pose")
    start = robot.pose(q)
    start.translation += [0.0, 1.0, 0.0]
    circle = sm.paths.Circle.around(start, 0.1, 20.0, turns=20.0, turn_tool=True)
    t, still = np.linspace(0.0, 20.0, 201), np.zeros((201, robot.dof))
    return sm.Trajectory(t, still + q, still, robot.joint_names, still), circle


@pytest.mark.parametrize("axes", ["world", "tool"])
@pytest.mark.parametrize("angular", [False, True])
def test_majorants_follow_a_path_that_turns(axes: str, angular: bool) -> None:
    robot = robot_named("panda")
    motion, path = standing(robot)
    rows = [sm.Relaxation("x", 0.1, axes=axes)] + [sm.Relaxation("rz", 0.1)] * angular
    follow = BoundTaskFrame(robot.chain, path, sm.Task.POSE)
    segments = MotionSegments(robot, motion, np.stack([motion.t[:-1], motion.t[1:]], axis=1))
    check_majorants(_PathErrors(follow, sm.Tolerance(), rows), segments)


@pytest.mark.parametrize("name", NAMES)
def test_majorants_are_above_all_derivatives(name: str) -> None:
    """What the bound rests on, order by order: sup |∂ᵏf/∂uᵏ| / k! is at most the k-th."""
    robot, rng = robot_of(name), np.random.default_rng(1 + sum(map(ord, name)))
    motion = random_motion(robot, rng)
    ends = motion.t[:-1] + np.diff(motion.t) * (0.1 if name == "swivel" else 1.0)
    segments = MotionSegments(robot, motion, np.stack([motion.t[:-1], ends], axis=1)[::10])
    check_majorants(kinds(robot, motion)[name], segments)


def test_a_bound_without_its_remainder_is_caught() -> None:
    """The law is shown to refuse: with too few nodes and no remainder the truth is above."""
    robot, rng = robot_named("panda"), np.random.default_rng(0)
    motion = random_motion(robot, rng)
    function = Wide(kinds(robot, motion)["path"])
    segments = MotionSegments(robot, motion, np.stack([motion.t[:-1], motion.t[1:]], axis=1))
    coarse = function.sizes(function.values(segments, np.zeros(1)), segments).max(axis=1)  # type: ignore[operator]
    assert np.any(_truth(function, segments) > coarse + 1e-3)
