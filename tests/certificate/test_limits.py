"""Joint limits and rates: margins, shares, and what a pace would change."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import AtRest, ClosedMotion, EndState, JointLimits
from support.motions import motion_of

ROUNDING = 1e-12


def test_margins_are_those_of_the_nearest_side() -> None:
    """A cubic from 0 to 0 with speeds ± 4 reaches 1 in the middle."""
    motion = motion_of([[0.0, 0.2, 0.0]] * 2, [[4.0, 0.0, -4.0], [-4.0, 0.0, 4.0]])
    infinite = np.full(3, np.inf)
    for lower, upper, joint, amount, time, limit in (
        (-infinite, np.array([1.5, 1.0, np.inf]), 0, 0.5, 0.5, 1.5),
        (-infinite, np.array([0.75, 1.0, np.inf]), 0, -0.25, 0.5, 0.75),
        (np.array([-np.inf, -np.inf, -0.9]), infinite, 2, -0.1, 0.5, -0.9),
        (np.array([-0.3, -0.05, -9.0]), np.array([9.0, 0.3, 9.0]), 1, 0.1, 0.0, 0.3),
    ):
        found = JointLimits(0, lower, upper).judge(motion)
        assert found.subject == motion.robot.joint_names[joint]
        assert (found.amount, found.allowed) == (pytest.approx(amount), 0.0)
        assert found.satisfied is (amount >= 0.0)
        # No pace helps a joint that is where it may not be.
        assert not found.of_pace
        assert found.time == pytest.approx(time)
        near = f"as near as {amount:.3g} rad to its"
        told = near if amount >= 0 else f"is {-amount:.3g} rad beyond its"
        assert f"{told} limit of {limit:g} rad at t = {time:.3f} s" in found.text
    kept = JointLimits(0, np.array([0.0, 0.0, -1.0]), np.array([1.0, 1.0, 0.0])).judge(motion)
    assert (kept.satisfied, kept.amount) == (True, pytest.approx(0.0, abs=ROUNDING))


@pytest.mark.parametrize(("order", "longer"), [(1, 2.0), (2, 2.0**0.5), (3, 2.0 ** (1.0 / 3.0))])
def test_shares_of_rates_say_how_much_longer_it_takes(order: int, longer: float) -> None:
    """From rest to rest by 1 in 1 s: 1.5 of speed, 6 of acceleration, 12 of jerk at most."""
    most = {1: 1.5, 2: 6.0, 3: 12.0}[order]
    motion = motion_of([[0.0] * 3, [0.0, -1.0, 0.0]], np.zeros((2, 3)))
    limit = np.array([1e-3, 0.5 * most, np.inf])
    limits = JointLimits(order, -limit, limit)
    found = limits.judge(motion)
    assert (found.subject, found.allowed, found.satisfied) == (
        motion.robot.joint_names[1],
        1.0,
        False,
    )
    assert found.amount == pytest.approx(2.0)
    assert f"{found.amount:.5g} times its limit of " in found.text
    assert f"give it {longer:.5g} times the duration" in found.text
    assert found.factor == pytest.approx(longer)
    known = ("speeds", "accelerations", "jerks")[order - 1]
    # Not of all joints, so that no more is said to have been checked.
    assert limits.covers == (f"{known} of some joints",)
    assert limits.remarks == (f"{limits.name}: 1 of 3 joints are not limited",)
    exact = JointLimits(order, np.full(3, -most), np.full(3, most))
    assert exact.covers == (known,)
    assert exact.judge(motion).amount == pytest.approx(1.0)
    one_sided = JointLimits(order, np.full(3, -0.5 * most), np.full(3, 9.0 * most)).judge(motion)
    # The jerk of such a motion has one sign.
    assert one_sided.amount == pytest.approx(2.0 if order < 3 else 1.0 / 9.0)


def test_a_jump_of_acceleration_breaks_any_limit_of_jerk() -> None:
    """Two cubics from rest to rest: from -6 to 6 at the middle sample."""
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], np.zeros((3, 3)))
    wide = np.full(3, 1e3)
    found = JointLimits(3, -wide, wide).judge(motion)
    assert (found.satisfied, found.subject, found.time) == (False, motion.robot.joint_names[0], 1.0)
    assert found.amount == pytest.approx(12.0 / (1e-6 * 1e3))
    assert "jumps by 12" in found.text
    assert (found.allowed, found.of_pace) == (1.0, True)
    assert JointLimits(3, -1e8 * wide, 1e8 * wide).judge(motion).satisfied
    # A jump just beyond what a limited jerk does in an instant, and just within.
    for share in (1.01, 0.99):
        narrow = np.full(3, 12.0 / (1e-6 * share))
        found = JointLimits(3, -narrow, narrow).judge(motion)
        assert found.satisfied is (share < 1.0)


@pytest.mark.parametrize(("order", "power"), [(2, 0.5), (3, 1.0 / 3.0)])
def test_slow_rates_say_how_much_shorter_it_could_take(order: int, power: float) -> None:
    motion = motion_of([[0.0] * 3, [0.0, -1.0, 0.0]], np.zeros((2, 3)))
    limit = np.full(3, {2: 6.0, 3: 12.0}[order] / 0.25)
    found = JointLimits(order, -limit, limit).judge(motion)
    assert f"give it {0.25**power:.5g} times the duration" in found.text


@pytest.mark.parametrize(
    ("order", "lower", "upper"),
    [
        (4, -1.0, 1.0),
        (0, 1.0, -1.0),
        (0, np.nan, 1.0),
        (1, 0.0, 1.0),
        (1, -1.0, 0.0),
        (2, 0.5, 1.0),
    ],
)
def test_limits_that_cannot_be_kept_are_refused(order: int, lower: float, upper: float) -> None:
    with pytest.raises(sm.errors.ProblemError, match="expected"):
        JointLimits(order, np.full(3, lower), np.full(3, upper))
    assert JointLimits(0, np.zeros(3), np.zeros(3)).order == 0
    with pytest.raises(sm.errors.ProblemError, match="expected"):
        JointLimits(0, np.zeros(3), np.ones(2))


# What is asked of both ends of a motion.


@pytest.mark.parametrize("miss", [0.9e-6, 1.1e-6, -1.1e-6])
def test_ends_are_judged_to_a_micrometre(miss: float) -> None:
    rest = np.zeros((2, 3))
    q = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    motion, kept = motion_of(q, rest), abs(miss) <= 1e-6
    off, far = np.array([0.0, miss, 0.0]), 9.0 * np.ones(3)
    cases: list[tuple[sm.certificate.Requirement, sm.certificate.FinishedMotion, float]] = [
        (EndState(0, q[1] + off), motion, 1.0),
        (EndState(0, q[0] + off, at_start=True), motion, 0.0),
        (EndState(1, off), motion, 1.0),
        (EndState(1, off, at_start=True), motion, 0.0),
        (AtRest(True, True), motion_of(q, [off, 0.0 * off]), 0.0),
        (AtRest(False, True), motion_of(q, [9.0 * np.ones(3), off]), 1.0),
        (AtRest(True, False), motion_of(q, [off, 9.0 * np.ones(3)]), 0.0),
        (ClosedMotion(False), motion_of([q[0], q[1], q[0] + off], [off, off, far]), 2.0),
        (ClosedMotion(True), motion_of([q[0], q[1], q[0]], [q[0], off, q[0] + off]), 2.0),
    ]
    for requirement, given, time in cases:
        found = requirement.judge(given)
        assert found.satisfied is kept, requirement
        assert (found.subject, found.time) == (given.robot.joint_names[1], time)
        assert (found.amount, found.allowed) == (pytest.approx(abs(miss), rel=1e-6), 1e-6)
        where = ("ends", "at the end") if time else ("starts", "at the start")
        assert any(words in found.text for words in where)
    given = motion_of([q[0], q[0] + 1e-3], [q[0], q[0]])
    told = ClosedMotion(True).judge(given).text
    joint = given.robot.joint_names[0]
    assert told == f"joint '{joint}' ends 0.001 rad away from the start (1e-06 allowed)"


@pytest.mark.parametrize(
    ("order", "words"), [(0, "away from where it should"), (1, "off the one asked for")]
)
def test_ends_are_told_in_words_of_their_own(order: int, words: str) -> None:
    motion = motion_of(np.zeros((2, 3)), np.zeros((2, 3)))
    assert words in EndState(order, np.ones(3)).judge(motion).text


def test_end_accelerations_are_judged_less_closely() -> None:
    motion = motion_of([[0.0] * 3, [1.0, 0.0, 0.0]], np.zeros((2, 3)))
    for miss, kept in ((0.9e-4, True), (1.1e-4, False)):
        found = EndState(2, np.array([-6.0, miss, 0.0])).judge(motion)
        assert (found.satisfied, found.allowed) == (kept, 1e-4)
        assert "with an acceleration" in found.text
    assert EndState(2, np.array([6.0, 0.0, 0.0]), at_start=True).judge(motion).satisfied


def test_rest_covers_the_ends_that_it_is_asked_for() -> None:
    assert AtRest(True, True).covers == ("rest at both ends",)
    assert AtRest(True, False).covers == ("rest at the start",)
    assert AtRest(False, True).covers == ("rest at the end",)
