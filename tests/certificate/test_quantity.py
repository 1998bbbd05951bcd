"""What a constraint measures is told once: judged with its unit, its share and what helps."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import Column, Quantity, QuantityWithinLimits
from selfmotion.certificate.bounding import Bounds
from support.arms import robot_named
from support.motions import motion_of
from support.two_arms import baxter_with_both_arms


@pytest.mark.parametrize("column", range(4))
def test_the_tools_rates_are_told_with_the_time_they_take(column: int) -> None:
    """The stretched arm turning about its base at 2 rad/s: ω r, ω, ω² r, and no turn faster."""
    robot = robot_named("planar_3r")
    reach = float(np.linalg.norm(robot.pose(np.zeros(3)).translation[:2]))
    motion = motion_of([[0.0] * 3, [2.0, 0.0, 0.0]], [[2.0, 0.0, 0.0]] * 2)
    rates = [2.0 * reach, 2.0, 4.0 * reach, 0.0]
    limit = np.full(4, np.inf)
    limit[column] = rates[column] / 4.0 if column < 3 else 1.0
    requirement = sm.constraints.ToolLimits(*limit.tolist()).requirement(robot)
    found = requirement.judge(motion)
    names = ("speed", "turn rate", "acceleration", "turn acceleration")
    assert requirement.covers == (f"tool {names[column]}",)
    assert found.amount == pytest.approx(4.0 if column < 3 else 0.0, rel=1e-3, abs=1e-6)
    assert found.satisfied is (column == 3)
    if column < 3:
        longer = found.amount if column < 2 else found.amount**0.5
        assert f"{names[column]} of the tool 'tool' is {found.amount * limit[column]:.4g}" in (
            found.text
        )
        assert f"give it {longer:.5g} times the duration" in found.text
        # A pace of one's own is slowed by the number, not by the words.
        assert found.factor == pytest.approx(longer)


def test_whose_eyes_the_tools_rates_are_seen_with_is_told() -> None:
    """A limit of what a part sees is none of what stands beside both."""
    seen = baxter_with_both_arms("right_gripper")
    requirement = sm.constraints.ToolLimits(speed=0.5).requirement(seen)
    assert requirement.covers == ("tool speed seen from 'right_gripper'",)
    q = np.tile(seen.dexterous_configuration("pose"), (2, 1))
    motion = sm.Trajectory([0.0, 1.0], q, 0.0 * q, seen.joint_names)
    text = requirement.judge(sm.certificate.FinishedMotion(seen, motion)).text
    assert "speed of the tool 'left_gripper' seen from 'right_gripper' is 0 m/s" in text


def test_a_band_is_half_its_width_from_its_middle() -> None:
    robot = robot_named("planar_3r")
    name = robot.joint_names[1]
    motion = motion_of([[0.0, 0.2, 0.0], [0.0, 0.5, 0.0]], [[0.0, 0.3, 0.0]] * 2)
    for center, half, share in ((0.1, 0.5, 0.8), (0.1, 0.3, 4.0 / 3.0), (0.7, 1.0, 0.5)):
        band = sm.constraints.Band(sm.robot.JointCoordinate(name), center, half)
        found = band.requirement(robot).judge(motion)
        assert found.amount == pytest.approx(share, rel=1e-3)
        assert found.satisfied is (share <= 1.0)
        assert f"expected {center - half:.4g} to {center + half:.4g}" in found.text


def motion_at_rest(robot: sm.RobotModel) -> sm.Trajectory:
    q = np.tile(robot.dexterous_configuration("pose"), (2, 1))
    return sm.Trajectory([0.0, 1.0], q, 0.0 * q, robot.joint_names)


def test_what_has_no_limit_is_not_covered_and_said() -> None:
    robot = robot_named("panda")
    none = sm.constraints.JointTorqueLimits(np.full(7, np.inf)).requirement(robot)
    assert none.covers == ()
    still = sm.certificate.FinishedMotion(robot, motion_at_rest(robot))
    assert none.judge(still).satisfied
    assert all(name in none.remarks[0] for name in robot.joint_names)
    assert "not limited" in none.remarks[0]
    one = np.full(7, np.inf)
    one[2] = 30.0
    some = sm.constraints.JointTorqueLimits(one).requirement(robot)
    assert some.covers == ("torques of 1 of 7 joints without damping and friction",)
    assert robot.joint_names[2] not in some.remarks[0]


def sum_of(series: bool, reach: float = 1.0) -> Quantity:
    """The sum of two joints, with a majorant or without."""
    return Quantity(
        "sum",
        (Column("sum", "sum", "rad"),),
        lambda q, *_: q[:, :1] + q[:, 1:2],
        lambda q, *_: (np.tile([1.0, 1.0, 0.0], (len(q), 1, 1)),),
        limit=reach,
        series=(lambda segments: segments.chain().joints[:2].sum(axis=0)[None]) if series else None,
    )


@pytest.mark.parametrize("series", [True, False])
def test_a_quantity_without_a_majorant_is_judged_as_measured(series: bool) -> None:
    motion = motion_of([[0.0] * 3, [0.3, 0.5, 0.0]], np.zeros((2, 3)))
    requirement = QuantityWithinLimits(sum_of(series))
    found = requirement.judge(motion)
    assert found.satisfied
    assert found.amount == pytest.approx(0.8, rel=1e-3)
    assert ("checked at samples only" in " ".join(requirement.remarks)) is not series
    assert not QuantityWithinLimits(sum_of(series, 0.7)).judge(motion).satisfied


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_limits_that_make_no_sense_are_refused(limit: float) -> None:
    with pytest.raises(sm.errors.ProblemError, match="expected numbers above 0"):
        sum_of(True, limit)


def test_a_quintic_that_vanishes_where_it_may_be_looked_at_is_caught() -> None:
    """Zero at both samples and at a quarter, the half and three quarters between them."""
    robot, h = robot_named("ur5"), 4.0
    q0 = np.array([0.3, -1.2, 1.5, -1.0, 1.2, 0.4])
    q, qd, qdd = np.tile(q0, (2, 1)), np.zeros((2, 6)), np.zeros((2, 6))
    qd[:, 1] = 0.09375 / h
    qdd[:, 1] = [-1.5625 / h**2, 1.5625 / h**2]
    motion = sm.certificate.FinishedMotion(
        robot, sm.Trajectory([0.0, h], q, qd, robot.joint_names, qdd)
    )
    t = np.linspace(0.0, h, 4001)
    for coordinate in (
        sm.robot.JointCoordinate(robot.joint_names[1]),
        sm.robot.FrameCoordinate("tool0"),
    ):
        center = float(coordinate(robot, q0[None])[0][0])
        away = np.abs(coordinate(robot, motion.trajectory(t))[0] - center).max()
        for share in (0.999, 1.001):
            band = sm.constraints.Band(coordinate, center, away * share)
            assert band.requirement(robot).judge(motion).satisfied is (share > 1.0)


@pytest.mark.parametrize("name", ["lower", "upper"])
def test_a_number_between_two_ends_is_kept_up_to_each(name: str) -> None:
    """What `between` makes of one-dimensional values, slopes and series."""
    lower, upper = -0.1, 0.3
    reach = {"lower": lower, "upper": upper}[name]
    for share, kept in ((0.999, True), (1.001, False)):
        made = Quantity.between(
            "sum",
            lower,
            upper,
            lambda q, *_: q[:, 0] + q[:, 1],
            lambda q, *_: (np.tile([1.0, 1.0, 0.0], (len(q), 1)),),
            lambda segments: segments.chain().joints[0] + segments.chain().joints[1],
            "rad",
        )
        assert made.bounds.tolist() == [0.2]
        assert made.middle.tolist() == [pytest.approx(0.1)]
        assert made.columns == (Column("sum", "sum", "rad"),)
        motion = swung(share * reach)
        q, qd, qdd = (motion.trajectory(np.array([0.5]), order) for order in range(3))
        assert made.values(q, qd, qdd).shape == (1, 1)
        assert made.derivatives(q, qd, qdd)[0].shape == (1, 1, 3)
        found = QuantityWithinLimits(made).judge(motion)
        assert found.satisfied is kept, found.text
        assert QuantityWithinLimits(made).remarks == ()
    for wrong in ((0.3, -0.1), (np.nan, 1.0), (0.0, np.inf)):
        with pytest.raises(sm.errors.ProblemError):
            Quantity.between("sum", *wrong, lambda *_: _[0], lambda *_: ())


def swung(to: float) -> sm.certificate.FinishedMotion:
    """A planar arm whose first two joints add up to a number, in between only."""
    robot = robot_named("planar_3r")
    t, q, qd = np.array([0.0, 0.5, 1.0]), np.zeros((3, 3)), np.zeros((3, 3))
    q[1, :2] = [0.25 * to, 0.75 * to]
    return sm.certificate.FinishedMotion(
        robot, sm.Trajectory(t, q, qd, robot.joint_names, np.zeros((3, 3)))
    )


@pytest.mark.parametrize(
    ("count", "more"), [(1, ""), (2, ", and on 1 more"), (3, ", and on 2 more")]
)
def test_what_is_undecided_of_a_quantity_is_told(
    count: int, more: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where, on how many intervals, and not kept; a limit that is passed is told all the same."""
    motion, requirement = swung(0.1), QuantityWithinLimits(sum_of(True))
    intervals = tuple((0.25 * k, 0.25 * k + 0.1) for k in range(1, count + 1))
    for share, told in ((0.9, True), (1.0, True), (1.1, False)):
        found = Bounds(np.array([share]), np.array([0.5]), intervals, True, 10)
        monkeypatch.setattr("selfmotion.certificate.quantity.bounded", lambda *_, f=found: f)
        judged = requirement.judge(motion)
        assert not judged.satisfied
        assert (judged.amount, judged.allowed) == (share, 1.0)
        words = f"whether sum hold from t = 0.25 to 0.35 s is not decided{more}: no bound"
        assert (words in judged.text) is told
        assert judged.time == (0.25 if told else 0.5)
        if not told:
            assert "1.1 times its limit of 1 rad" in judged.text
