"""A verdict says what was looked at and what was not, and no more."""

from dataclasses import replace

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import LIMIT_NAMES, DampedStretch, Extreme, Finding
from support.arms import PANDA_HOME, robot_named


def still(*requirements: sm.certificate.Requirement, **given: object) -> sm.Certificate:
    """The certificate of a Panda that stands where it should."""
    robot = robot_named("panda")
    motion = sm.Trajectory([0.0, 1.0], [PANDA_HOME] * 2, np.zeros((2, 7)), robot.joint_names)
    path = sm.paths.Dwell(robot.pose(PANDA_HOME), 1.0)
    return sm.certify(robot, path, "pose", motion, None, requirements, **given)  # type: ignore[arg-type]


def finding(name: str, amount: float) -> Finding:
    return Finding(name, "x", 0.5, amount, 0.0, True, "told")


def test_what_is_relaxed_is_said_where_something_is() -> None:
    assert "tolerances" not in still().verdict
    relaxed = still(relaxations=[sm.Relaxation("x", 1e-3)])
    for text in (relaxed.verdict, relaxed.summary):
        assert "rad off the path, apart from its tolerances, which are kept" in text
    assert [item.name for item in relaxed.deviations] == ["(x)"]


def test_what_is_allowed_is_said_where_it_is_more_than_usual() -> None:
    assert "allowed" not in still().verdict
    usual = still().tolerance
    for name in ("position", "rotation"):
        size = getattr(usual, name)
        larger, smaller = (replace(usual, **{name: by * size}) for by in (2.0, 0.5))
        assert "are allowed" in replace(still(), tolerance=larger).verdict
        assert "allowed" not in replace(still(), tolerance=smaller).verdict


def test_what_was_not_checked_is_said_unless_all_was() -> None:
    one = still()
    assert one.not_checked == ("accelerations", "self-collision")
    assert one.verdict.endswith("; not checked: accelerations, self-collision")
    every = replace(one, covers=(*one.covers, "accelerations", "self-collision"))
    assert every.not_checked == ()
    assert "not checked" not in every.verdict
    assert repr(every) == f"Certificate({every.verdict})"


def test_limits_of_some_joints_are_told_apart_from_those_of_all() -> None:
    some = sm.constraints.JointAccelerationLimits([1.0] + [np.inf] * 6, replace=True)
    every = sm.constraints.JointAccelerationLimits(5.0)
    robot = robot_named("panda")
    part = still(some.requirement(robot))
    assert "accelerations of some joints" in part.covers
    assert part.not_checked == ("accelerations of the other joints", "self-collision")
    whole = still(some.requirement(robot), every.requirement(robot))
    assert "accelerations of some joints" not in whole.covers
    assert whole.not_checked == ("self-collision",)


def test_notes_and_failures_are_told_in_this_order() -> None:
    noted = replace(still(), notes=("one", "two"))
    assert noted.verdict.endswith("self-collision; one; two")
    failed = replace(noted, failures=("first", "second"))
    assert not failed.verified
    assert failed.verdict == "not verified: first; second; one; two"


def test_other_tips_and_damping_are_told() -> None:
    pair = Extreme(2e-7, 0.5, "left"), Extreme(3e-7, 0.5, "left")
    told = replace(still(), others=(pair,))
    assert ", 'left' 0.2 µm and 0.3 µrad off its path" in told.verdict
    damped = replace(still(), damped=(DampedStretch(0.1, 0.2, 1e-3, 2e-2),) * 2)
    assert damped.verdict.count("0.100 to 0.200 s (smallest singular value 0.001") == 2
    assert "; damped 0.100" in damped.verdict
    assert " and 0.100" in damped.verdict


@pytest.mark.parametrize("wrong", [2e-6, np.nan])
@pytest.mark.parametrize("which", range(4))
def test_each_error_of_each_tip_counts(which: int, wrong: float) -> None:
    exact = Extreme(1e-6, 0.0, "x")
    errors = [exact] * 4
    one = replace(still(), position_error=exact, rotation_error=exact, others=((exact, exact),))
    assert one.on_path
    errors[which] = Extreme(wrong, 0.0, "x")
    off = replace(
        one,
        position_error=errors[0],
        rotation_error=errors[1],
        others=((errors[2], errors[3]),),
    )
    assert not off.on_path


def test_the_worst_of_several_findings_is_told() -> None:
    """Of margins and distances the least, of shares the largest; None where nothing was asked."""
    names = (LIMIT_NAMES[0], LIMIT_NAMES[1], LIMIT_NAMES[2], "clearance")
    several = tuple(finding(name, amount) for name in names for amount in (0.2, 0.1, 0.3))
    found = replace(still(), findings=several)
    assert found.limit_margin == Extreme(0.1, 0.5, "x")
    assert found.velocity_ratio.value == 0.3
    assert found.acceleration_ratio is not None
    assert found.acceleration_ratio.value == 0.3
    assert found.clearance is not None
    assert found.clearance.value == 0.1
    plain = still()
    assert plain.clearance is None
    assert plain.acceleration_ratio is None
    with pytest.raises(RuntimeError, match="always judges joint position limits"):
        _ = replace(plain, findings=()).limit_margin


def test_what_takes_the_longest_motion_is_told_first() -> None:
    """Whoever makes it as much longer as the first sentence says has the rest as well."""
    robot = robot_named("panda")
    t = np.linspace(0.0, 0.1, 11)
    share = t / t[-1]
    turned = 0.5 * (10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5)
    rates = 0.5 * (30.0 * share**2 - 60.0 * share**3 + 30.0 * share**4) / t[-1]
    q = np.array([PANDA_HOME] * len(t))
    q[:, 6] += turned
    qd = np.zeros_like(q)
    qd[:, 6] = rates
    motion = sm.Trajectory(t, q, qd, robot.joint_names)
    limits = [
        item.requirement(robot)
        for item in (
            sm.constraints.JointVelocityLimits(),
            sm.constraints.JointAccelerationLimits(),
        )
    ]
    found = sm.certify(
        robot, sm.paths.Dwell(robot.pose(PANDA_HOME), 0.1), "position", motion, None, limits
    )
    broken = [item for item in found.findings if not item.satisfied]
    assert len(broken) == 2
    most = max(broken, key=lambda item: item.factor)
    assert most is not broken[0]
    assert found.summary == f"not verified: {most.text}; and 1 more"


def test_where_the_tool_is_off_digits_of_time_are_not_told() -> None:
    robot = robot_named("panda")
    away = np.array(PANDA_HOME)
    away[3] += 0.01
    motion = sm.Trajectory([0.0, 1.0 + 1e-6], [away] * 2, np.zeros((2, 7)), robot.joint_names)
    found = sm.certify(robot, sm.paths.Dwell(robot.pose(PANDA_HOME), 1.0), "pose", motion)
    assert all("off the path" in text for text in found.failures)
    shorter = replace(motion, t=np.array([0.0, 0.9]), qdd=None)
    found = sm.certify(robot, sm.paths.Dwell(robot.pose(PANDA_HOME), 1.0), "pose", shorter)
    assert any("the motion lasts" in text for text in found.failures)
