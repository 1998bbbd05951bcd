"""A motion of nodes: what is let go of is the same when it is asked for again."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.engine import Counts
from selfmotion.nodes import NodeGrid, motion as module
from support.arms import Case
from support.nodes import nodes_of, problem_of
from support.stretching import DURATION, rounded_problem, stretching

# Undamped, rounding of the path makes accelerations larger than this many times those damped.
WILDER = 3.0


def test_what_is_forgotten_is_the_same_again(case: Case) -> None:
    limits = (sm.JointPositionLimits(-9.0, 9.0), sm.JointAccelerationLimits(50.0))
    motion = nodes_of(problem_of(case, constraints=limits))

    def known() -> list[np.ndarray]:
        return [
            motion.h,
            motion.samples.checked.qdd,
            motion.samples.qddd,
            motion.exact.q,
            np.array([motion.exact_cost, motion.cost, motion.aim]),
            motion.broken(),
        ]

    before = known()
    motion.forget()
    kept = {*motion.__dict__, *motion.samples.__dict__}
    assert not kept & {"exact", "h", "partials", "checked", "qdd", "qddd"}
    for again, once in zip(known(), before, strict=True):
        np.testing.assert_array_equal(again, once)


def test_beside_a_singular_pose_rounding_of_the_path_does_not_accelerate_the_arm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = rounded_problem()
    t = np.linspace(0.0, DURATION, 65)
    # At the pose itself nothing may come onto the path.
    t[32] += 0.3 * (t[33] - t[32])
    grid = NodeGrid(problem, t, (), free=True, counts=Counts())
    q = stretching(t)

    def largest() -> tuple[float, float]:
        motion = grid.near(q, np.gradient(q, t, axis=0))
        assert motion is not None
        off = problem.errors_between(motion.trajectory)
        return float(np.abs(motion.trajectory.qdd).max()), float(off.max())

    calm, error = largest()
    monkeypatch.setattr(module, "_WILD", np.inf)
    wild, worse = largest()
    assert WILDER * calm < wild
    assert error <= worse
