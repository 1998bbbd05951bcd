"""A motion of nodes: what is let go of is the same when it is asked for again."""

import numpy as np

import selfmotion as sm
from selfmotion.basics import Counts
from selfmotion.nodes import NodeGrid
from support.arms import Case
from support.nodes import nodes_of, problem_of
from support.stretching import DURATION, rounded_problem, stretching

# The arm moves at a steady speed [rad/s²].
CALM = 0.1


def test_what_is_forgotten_is_the_same_again(case: Case) -> None:
    limits = (
        sm.constraints.JointPositionLimits(-9.0, 9.0),
        sm.constraints.JointAccelerationLimits(50.0),
    )
    motion = nodes_of(problem_of(case, constraints=limits))

    def known() -> list[np.ndarray]:
        return [
            motion.h,
            motion.checked.qdd,
            motion.samples.qddd,
            motion.curve_ends,
            np.array([motion.cost, motion.aim, motion.violation]),
            motion.broken_between(),
        ]

    before = known()
    motion.forget()
    assert not {*motion.__dict__} & {"h", "partials", "checked", "samples", "curve_ends"}
    for again, once in zip(known(), before, strict=True):
        np.testing.assert_array_equal(again, once)


def test_beside_a_singular_pose_rounding_of_the_path_does_not_accelerate_the_arm() -> None:
    problem = rounded_problem()
    t = np.linspace(0.0, DURATION, 65)
    # At the pose itself nothing may come onto the path.
    t[32] += 0.3 * (t[33] - t[32])
    grid = NodeGrid(problem, t, (), free=True, counts=Counts())
    q = stretching(t)

    motion = grid.near(q, np.gradient(q, t, axis=0))
    assert motion is not None
    assert np.abs(motion.trajectory.qdd).max() < CALM
    assert problem.errors_between(motion.trajectory).max() < 1e-6
