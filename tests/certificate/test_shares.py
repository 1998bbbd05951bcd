"""The largest share of a limit between samples."""

import numpy as np
import pytest

from selfmotion.basics import Array
from selfmotion.certificate.shares import largest_share, too_far
from support.motions import motion_of

ROUNDING = 1e-12


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("most", [0.5, 0.99, 0.9999, 1.0001, 1.01, 3.0])
def test_the_largest_share_is_bounded_and_hardly_more(most: float, sign: float) -> None:
    """Of forces that swing ten times, with a peak between all samples."""
    motion = motion_of([[0.0] * 3, [0.0, 6.2, 0.0]], [[0.0, 6.2, 0.0]] * 2).trajectory

    def shares(q: Array, qd: Array, qdd: Array) -> Array:
        swing = sign * most * np.cos(10.0 * (q[:, 1] - 2.345)) * np.exp(-((q[:, 1] - 2.345) ** 2))
        return np.stack([0.0 * swing, swing], axis=1)

    found = largest_share(motion, shares)
    assert found is not None
    assert most - ROUNDING <= found.share <= 1.05 * most
    assert (found.share <= 1.0) is (most <= 1.0)
    assert found.column == 1
    assert motion(np.array([found.time]))[0, 1] == pytest.approx(2.345, abs=0.05)


def test_a_corner_is_cut_to_a_few_thousandths_of_an_interval() -> None:
    """A peak just below 1 that no polynomial follows is over-estimated by what is left of it."""
    motion = motion_of([[0.0] * 3, [0.0, 1.0, 0.0]], [[0.0, 1.0, 0.0]] * 2).trajectory
    found = largest_share(motion, lambda q, *_: 1.0 - 1e-9 - np.abs(q[:, 1:2] - 1.0 / 3.0))
    assert found is not None
    assert found.share - 1.0 == pytest.approx(1.6e-7, rel=0.2)


def test_what_is_not_a_number_is_no_share() -> None:
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0]], np.zeros((2, 3))).trajectory
    found = largest_share(motion, lambda q, qd, qdd: np.where(q > 0.99, np.nan, 0.1))
    assert found is not None
    assert not found.share <= 1.0


def test_joints_that_go_too_far_are_not_looked_at() -> None:
    far = motion_of([[0.0] * 3, [0.0, 1e6, 3.0]], np.zeros((2, 3)))
    assert largest_share(far.trajectory, lambda *state: state[0]) is None
    found = too_far("it", far)
    assert (found.kept, found.subject) == (False, far.robot.joint_names[1])
    assert "travels 1e+06 rad" in found.text
    assert (found.time, found.amount, found.allowed) == (far.trajectory.t[0], np.inf, 1.0)
