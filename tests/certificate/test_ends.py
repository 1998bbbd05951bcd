"""What is asked of both ends of a motion."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import AtRest, ClosedMotion, EndState
from support.motions import motion_of


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
