"""How the arm can move while its tool stays: for the slider of a page."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.motion import Trajectory
from selfmotion.problem import Problem
from selfmotion.replay.motion import KeyFrames, clock_of, poses_of
from selfmotion.robot import null_space
from selfmotion.search import Manifold

# Times of a motion at which the arm is moved along its self-motion; steps to either side of it, and
# how far the chosen joint turns in each [rad or m].
_TIMES, _STEPS, _STEP = 41, 10, 0.1
# How far links go is told by steps so short [rad or m].
_SHORT = 1e-3
# What a step may move any joint by, as a multiple of it: beyond, it is another branch.
_FAR = 8.0


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """The arm along its self-motion at several times of a motion.

    Attributes
    ----------
    joint : str
        The joint that turns by even steps.
    frames : tuple of KeyFrames
        Poses of the links over time, one for each step, from the farthest on one side to that on
        the other.
    """

    joint: str
    frames: tuple[KeyFrames, ...]


def self_motion(problem: Problem, trajectory: Trajectory) -> SelfMotion | None:
    """Return the self-motions of an arm along its motion; None where it has none.

    Where several joint motions leave the tool where it is, one is shown: a joint is turned, the
    others move as little as they have to. Steps end where a joint meets its limit.
    """
    follows = problem.follows
    if follows.redundancy < 1 or not follows.is_plain:
        return None
    robot = problem.robot
    times = np.linspace(0.0, trajectory.duration, _TIMES)
    q = trajectory(clock_of(trajectory, times))
    joint = _chosen(problem, q)
    sides = [_stepped(problem, times, q, joint, way * _STEP) for way in (-1.0, 1.0)]
    steps = [*reversed(sides[0]), q, *sides[1]]
    return SelfMotion(
        robot.joint_names[joint], tuple(poses_of(robot, step, times) for step in steps)
    )


def _chosen(problem: Problem, q: Array) -> int:
    """Return the joint by whose self-motions the links of configurations (K, n) go farthest."""
    robot, moved = problem.robot, np.zeros(problem.robot.dof)
    basis, here = null_space(problem.follows.jacobians(q)), robot.joint_poses(q)[..., :3]
    for joint in range(robot.dof):
        along = np.einsum("knr,kr->kn", basis, basis[:, joint])
        speed = np.linalg.norm(along, axis=1, keepdims=True)
        there = robot.joint_poses(q + _SHORT * along / np.maximum(speed, _SHORT))[..., :3]
        # Of a joint that hardly moves itself, steps would be long.
        moved[joint] = (np.linalg.norm(there - here, axis=2).max(axis=1) * speed[:, 0]).mean()
    return int(np.argmax(moved))


def _stepped(problem: Problem, times: Array, q: Array, joint: int, step: float) -> list[Array]:
    """Return configurations (K, n) step by step to one side; those at a limit stay there."""
    robot, follows = problem.robot, problem.follows
    manifold = Manifold(follows, robot.lower, robot.upper)
    targets, held = follows.targets(times), follows.held(times)
    found, moves = list[Array](), np.full(len(q), fill_value=True)
    for _ in range(_STEPS):
        basis = null_space(follows.jacobians(q))
        # The least joint speed at which the joint turns by one: N Nᵀ e / (eᵀ N Nᵀ e).
        along = np.einsum("knr,kr->kn", basis, basis[:, joint])
        share = along[:, joint]
        moves &= share > 1e-6
        ahead = q + step * along / np.where(moves, share, 1.0)[:, None]
        reached, arrived = manifold.project(ahead, targets, held=held)
        inside = np.all((reached >= robot.lower) & (reached <= robot.upper), axis=1)
        near = np.abs(reached - q).max(axis=1) <= _FAR * abs(step)
        moves &= arrived & inside & near
        q = np.where(moves[:, None], reached, q)
        found.append(q)
    return found
