"""Velocity limits that depend on the position: the maker's, kept and proved at all times."""

import re
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.certificate import BrakingCurves, FinishedMotion, VelocityByPosition
from selfmotion.shell import testing
from support import franka
from support.arms import robot_named, short_line
from support.circles import small_circle
from support.places import ROOT

Limits = sm.constraints.PositionDependentVelocityLimits
# Two ways to write the same formula [rad/s].
ROUNDING = 1e-12
# What may be beyond a limit where a motion rests on it [rad/s].
RESTS = 1e-9


def test_the_curves_of_an_fr3_are_those_of_its_maker() -> None:
    robot = robot_named("fr3")
    curves = Limits().curves(robot)
    q = np.random.default_rng(0).uniform(robot.lower - 0.05, robot.upper + 0.05, (2000, 7))
    lower, upper = (np.clip(x, -robot.velocity_limit, robot.velocity_limit)
                    for x in curves.velocities(q))  # fmt: skip
    expected = franka.velocity_limits(q)
    assert np.abs(lower - expected[0]).max() <= ROUNDING
    assert np.abs(upper - expected[1]).max() <= ROUNDING
    assert np.array_equal(robot.lower, franka.LOWER)
    assert np.array_equal(robot.upper, franka.UPPER)
    assert np.all(robot.acceleration_limit == franka.ACCELERATION)
    assert np.all(robot.jerk_limit == franka.JERK)


@pytest.mark.parametrize("arm", ["fr3", "panda", "ur5", "z1"])
def test_the_constraint_keeps_the_laws(arm: str) -> None:
    robot = robot_named(arm)
    start = robot.dexterous_configuration("position")
    # So near the start, and so hard to stop, that self-motions break it.
    limits = Limits(0.05, 0.02, start - 0.05, start + 0.05)
    path = short_line(robot, start)
    testing.check_constraint(limits, sm.Problem(robot, path, "position", start))


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_plans_keep_what_plans_by_the_urdf_alone_exceed(seed: int) -> None:
    problem = franka.fast_line(robot_named("fr3"), seed)
    alone = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    by_urdf = sm.plan(problem.changed(constraints=alone)).require()
    kept = sm.plan(problem.changed(constraints=[*alone, Limits()])).require()
    t = np.linspace(0.0, problem.path.duration, 20_001)
    assert franka.refusals(by_urdf.trajectory(t), by_urdf.trajectory(t, 1)) > 0
    assert franka.refusals(kept.trajectory(t), kept.trajectory(t, 1), RESTS) == 0
    assert "velocities by position" in kept.certificate.verdict
    requirements = [Limits().requirement(problem.robot)]
    refused = sm.certify(
        problem.robot, problem.path, "position", by_urdf.trajectory, requirements=requirements
    )
    assert not refused.verified
    assert "where its limit at" in refused.verdict
    # Those of the maker are kept by default.
    assert any(isinstance(item, Limits) for item in problem.constraints)


@pytest.mark.site
def test_the_fastest_motion_keeps_off_where_no_joint_may_move() -> None:
    """Its joint path is planned without limits of the pace, but not to where there is no pace."""
    found = sm.fastest(franka.fast_line(robot_named("fr3"), 1)).plan
    assert found.certificate.verified, found.certificate.verdict
    t = np.linspace(0.0, found.trajectory.duration, 20_001)
    assert franka.refusals(found.trajectory(t), found.trajectory(t, 1), RESTS) == 0


def by_position(curves: BrakingCurves) -> VelocityByPosition:
    """Return the requirement of the planar arm."""
    names = tuple(f"joint{k + 1}" for k in range(len(curves.lower)))
    return VelocityByPosition(curves, names, ("rad",) * len(names))


@pytest.mark.parametrize("seed", [0, 1])
def test_the_least_time_of_a_path_keeps_them_and_uses_some_limit(seed: int) -> None:
    plan = sm.plan(franka.fast_line(robot_named("fr3"), seed)).require()
    found = sm.retime(plan)
    assert found.certificate.verified, found.certificate.verdict
    t = np.linspace(0.0, found.trajectory.duration, 20_001)
    assert franka.refusals(found.trajectory(t), found.trajectory(t, 1), RESTS) == 0
    used = found.limits_used
    assert used.busy > 0.9
    assert "velocity by position" in str(used)


def random_motion(rng: np.random.Generator, curves: BrakingCurves) -> sm.Trajectory:
    """Return quintics that come near the curves of a few joints."""
    n, t = len(curves.lower), np.linspace(0.0, 1.0, 8)
    lower, upper = curves.resting
    size = rng.choice([0.03, 0.1, 0.3])
    q = size * rng.uniform(lower, upper, (8, n)) + rng.choice([-0.5, 0.0, 0.5])
    qd, qdd = (size * rng.uniform(-x, x, (8, n)) for x in (5.0, 50.0))
    return sm.Trajectory(t, q, qd, tuple(f"joint{k + 1}" for k in range(n)), qdd)


def test_the_proof_agrees_with_dense_samples(planar: sm.RobotModel) -> None:
    rng, verdicts = np.random.default_rng(3), []
    for _ in range(200):
        hard, offset = 10.0 ** rng.uniform(0.0, 3.0, 3), rng.uniform(0.0, 0.4, 3)
        curves = BrakingCurves(hard, offset, np.full(3, -2.0), np.full(3, 2.0))
        motion = random_motion(rng, curves)
        found = by_position(curves).judge(FinishedMotion(planar, motion))
        t = np.linspace(0.0, 1.0, 4001)
        q, qd = motion(t), motion(t, 1)
        lower, upper = curves.velocities(q)
        worst = float(np.maximum(lower - qd, qd - upper).max())
        verdicts.append(found.satisfied)
        # Samples never break what is proved, and what is refused is broken at one.
        assert worst <= RESTS if found.satisfied else worst > -1e-3
        if not found.satisfied:
            assert found.amount > 1.0
    assert 20 < sum(verdicts) < 180


def test_a_violation_between_samples_is_found(planar: sm.RobotModel) -> None:
    t = np.linspace(0.0, 1.0, 3)
    still = np.zeros((3, 3))
    # At the samples it rests; between them it goes there and back.
    q = still.copy()
    q[1] = 1.5
    motion = sm.Trajectory(t, q, still, ("joint1", "joint2", "joint3"), still)
    curves = BrakingCurves(np.full(3, 3.0), np.zeros(3), np.full(3, -2.0), np.full(3, 2.0))
    found = by_position(curves).judge(FinishedMotion(planar, motion))
    assert not found.satisfied
    assert 0.0 < found.time < 0.5
    assert found.of_pace
    # As slow as it says, it is kept.
    assert 1.0 < found.factor < np.inf
    slow = sm.Trajectory(
        found.factor * 1.001 * t, q, still, ("joint1", "joint2", "joint3"), still
    )  # fmt: skip
    assert by_position(curves).judge(FinishedMotion(planar, slow)).satisfied


def test_a_joint_may_stand_and_leave_where_it_may_not_arrive() -> None:
    """The maker's limit is 0 at the end of the range, not less."""
    robot = robot_named("fr3")
    q = np.array(robot.home)
    q[3] = robot.upper[3]
    requirement = Limits().requirement(robot)
    for leaves in (0.0, -0.2, 0.01):
        end = q.copy()
        end[3] += leaves
        still = np.zeros((2, 7))
        motion = sm.Trajectory([0.0, 1.0], np.stack([q, end]), still, robot.joint_names, still)
        assert requirement.judge(FinishedMotion(robot, motion)).satisfied == (leaves <= 0.0)


def test_an_element_of_a_urdf_is_read_as_libfranka_does(tmp_path: Path) -> None:
    text = (ROOT / "robots" / "fr3.urdf").read_text("utf-8")
    text = text.replace(' lower="-2.7501" upper="2.7501"/>', "/>")
    file = tmp_path / "mine.urdf"
    file.write_text(text, encoding="utf-8")
    robot = sm.load_robot(file, tool="fr3_link8")
    # Without ends of its own the curve ends at the limits of the joint.
    assert robot.position_based_limits[:, 0].tolist() == [6.0, 0.3, -2.7437, 2.7437]


# What a URDF has in place of ' deceleration_limit="6.0"' → what is said of it.
BAD = {
    "": "'fr3_joint1': <position_based_velocity_limits>: deceleration_limit is missing",
    ' deceleration_limit="-6"': "deceleration above 0",
    # To Python 60, to libfranka 6.
    ' deceleration_limit="6_0"': 'deceleration_limit is "6_0", expected a number',
    ' deceleration_limit="inf"': 'deceleration_limit is "inf"',
    ' deceleration_limit="6.0" velocity_offset="0.3"/><position_based_velocity_limits': (
        "'fr3_joint1' has 2 <position_based_velocity_limits> elements, expected one"
    ),
}


@pytest.mark.parametrize("given", BAD)
def test_elements_that_are_no_limits_are_refused(given: str, tmp_path: Path) -> None:
    text = (ROOT / "robots" / "fr3.urdf").read_text("utf-8")
    asked = ' deceleration_limit="6.0"' + (' velocity_offset="0.3"' if "velocity" in given else "")
    assert asked in text
    file = tmp_path / "mine.urdf"
    file.write_text(text.replace(asked, given, 1), encoding="utf-8")
    with pytest.raises(sm.errors.RobotError, match=re.escape(BAD[given])):
        sm.Problem(sm.load_robot(file, tool="fr3_link8"), sm.paths.Dwell(np.eye(4), 1.0))


def test_arms_without_known_curves_are_told_so(panda: sm.RobotModel) -> None:
    problem = small_circle(panda, constraints=[Limits()])
    assert not Limits().applies(panda)
    assert any("deceleration = …" in remark for remark in problem.remarks)


def test_plans_and_files_keep_the_numbers(panda: sm.RobotModel, tmp_path: Path) -> None:
    limits = Limits(4.0, 0.1)
    problem = small_circle(panda, constraints=[limits])
    plan = sm.plan(problem)
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").check().verified == plan.certificate.verified
    sm.files.write_problem(problem, tmp_path / "cell.toml")
    again = sm.read_problem(tmp_path / "cell.toml").constraints[0]
    assert (again.deceleration, again.offset, again.margin) == (4.0, 0.1, limits.margin)


def test_other_elements_name_joints_too() -> None:
    """Of controls and transmissions, which descriptions of ROS have beside the joints."""
    robot = robot_named("fr3")
    name = robot.joint_names[0]
    more = f'<ros2_control name="arm"><joint name="{name}"/></ros2_control></robot>'
    found = sm.load_robot(robot.urdf.text.replace("</robot>", more), tool=robot.tool)
    np.testing.assert_array_equal(found.position_based_limits, robot.position_based_limits)


@pytest.mark.parametrize(
    "broken",
    [
        *({"deceleration": value} for value in (0.0, -1.0, np.nan, np.inf)),
        *({"offset": value} for value in (-0.1, np.nan, np.inf)),
        *({"lower": value} for value in (2.0, 3.0, np.nan)),
    ],
)
def test_curves_that_are_none_are_refused(broken: dict[str, float]) -> None:
    """One number of one joint is enough."""
    sound = {"deceleration": 1.0, "offset": 0.1, "lower": -2.0, "upper": 2.0}
    values = {name: np.array([value, value]) for name, value in sound.items()}
    BrakingCurves(**values)
    for name, value in broken.items():
        values[name][1] = value
    with pytest.raises(sm.errors.ProblemError, match="expected decelerations above 0"):
        BrakingCurves(**values)
