"""What was called verified once and is not; what hung, crashed or passed unseen, and is told."""

import sys
import threading
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import PANDA_HOME, robot_named
from support.own_kinematics import Arm

PANDA_POINT = np.array([0.5, 0.0, 0.3])


def still(panda: sm.RobotModel) -> tuple[sm.paths.Path, Array]:
    pose = panda.pose(PANDA_HOME)
    return sm.paths.Waypoints.from_poses([0.0, 1.0], [pose, pose]), PANDA_HOME.copy()


def test_speed_beyond_its_limit_between_two_samples(panda: sm.RobotModel) -> None:
    """From rest to rest: the peak is 1.5 times the mean, at none of five points."""
    path, q = still(panda)
    ends = np.array([q, q])
    ends[1, 6] += panda.velocity_limit[6] / 1.5 * 1.035
    motion = sm.Trajectory([0.0, 1.0], ends, np.zeros((2, 7)), panda.joint_names)
    certificate = sm.certify(panda, path, "pointing", motion)
    assert certificate.velocity_ratio.value == pytest.approx(1.035, rel=1e-9)
    assert "moves at 1.035 times its limit" in certificate.verdict


def test_a_joint_beyond_its_limit_between_two_samples(panda: sm.RobotModel) -> None:
    path, q = still(panda)
    ends, rates = np.array([q, q]), np.zeros((2, 7))
    ends[:, 6] = panda.upper[6] - 0.245
    rates[:, 6] = 1.0, -1.0
    motion = sm.Trajectory([0.0, 1.0], ends, rates, panda.joint_names)
    certificate = sm.certify(panda, path, "pointing", motion)
    assert certificate.limit_margin.value == pytest.approx(-0.005, abs=1e-12)
    assert not certificate.verified


@pytest.mark.parametrize("count", [300, 3000])
def test_one_waypoint_off_by_five_millimetres_is_met_or_missed_by_name(
    panda: sm.RobotModel, count: int
) -> None:
    t = np.linspace(0.0, 20.0, count)
    points = PANDA_POINT + np.outer(np.sin(0.3 * t), [0.02, 0.05, 0.0])
    k = int(0.3123 * count)
    turns = np.tile([0.0, 1.0, 0.0, 0.0], (count, 1))
    smooth = sm.paths.Waypoints(t, points, turns)
    plan = sm.plan(sm.Problem(panda, smooth), max_evaluations=3)
    assert plan.certificate.verified
    spiked = points.copy()
    spiked[k, 2] += 0.005
    certificate = sm.certify(panda, sm.paths.Waypoints(t, spiked, turns), "pose", plan.trajectory)
    assert not certificate.verified
    assert certificate.position_error.value >= 0.005 - 1e-6
    assert certificate.position_error.time == pytest.approx(t[k], abs=1.5 * t[1])


@pytest.mark.parametrize("corners", ["blend", "stop"])
def test_the_tool_rests_in_a_pause(panda: sm.RobotModel, corners: str) -> None:
    poses = [panda.pose(PANDA_HOME).copy() for _ in range(4)]
    for pose, shift in zip(
        poses, ([0, 0, 0], [0, 0.2, 0], [0, 0.2, 0], [0.1, 0.2, 0]), strict=True
    ):
        pose.translation = pose.translation + np.array(shift)
    path = sm.paths.Waypoints.from_poses([0.0, 4.0, 6.0, 10.0], poses, corners=corners)
    ends = [0.0, 10.0] if corners == "stop" else []
    np.testing.assert_array_equal(path.corner_times, sorted([4.0, 6.0, *ends]))
    plan = sm.plan(sm.Problem(panda, path, start=PANDA_HOME), max_evaluations=3).require()
    _, at = Arm(panda).place(panda.tool, plan.trajectory(np.linspace(4.0, 6.0, 101)))
    np.testing.assert_allclose(at, np.tile(poses[1].translation, (101, 1)), atol=1e-6)


@pytest.mark.parametrize("when", [0.5, 0.37, 1.0 / 3.0, 0.9999, 1e-4])
def test_a_velocity_that_jumps_is_refused(panda: sm.RobotModel, when: float) -> None:
    with pytest.raises(sm.errors.PathError, match=r"jumps|not smooth"):
        sm.paths.TwistPath(panda.pose(PANDA_HOME), lambda t: [0.0, 0.1 * (t > when), 0.0], 1.0)


@pytest.fixture(scope="module")
def line_plan() -> sm.Plan:
    panda = robot_named("panda")
    pose = panda.pose(PANDA_HOME)
    end = pose.copy()
    end.translation = end.translation + np.array([0.0, 0.1, 0.0])
    return sm.plan(sm.Problem(panda, sm.paths.Line(pose, end, 2.0), start=PANDA_HOME)).require()


@pytest.mark.parametrize("shift", [5.0, 1.0, -1.0])
def test_a_motion_that_begins_beside_its_path_is_refused(
    panda: sm.RobotModel, shift: float
) -> None:
    """Standing still is right at every time at which both are; half of the path has no motion."""
    path, q = still(panda)
    motion = sm.Trajectory([shift, shift + 1.0], [q, q], np.zeros((2, 7)), panda.joint_names)
    with pytest.raises(sm.errors.ProblemError, match="the motion begins at t ="):
        sm.certify(panda, path, "pose", motion)


def test_a_retimed_path_knows_when_waypoints_are_passed() -> None:
    """Else a certificate would look beside them."""
    t = np.linspace(0.0, 4.0, 30)
    path = sm.paths.Waypoints(t, np.outer(np.sin(t), [1.0, 0.0, 0.5]))
    sigma = np.array([0.0, 1.0, 1.2, 3.0, 4.0])
    slow = sm.paths.Retimed(path, [0.0, 2.0, 3.0, 4.0, 6.0], sigma, [0.0, 0.4, 0.3, 0.9, 0.0])
    passed = slow.pace(slow.marks)
    assert np.abs(passed[:, None] - t).min(axis=0).max() < 1e-12


@pytest.mark.parametrize("size", [1e3, 1e6, 1e12, 1e300])
def test_joints_that_turn_a_thousand_times_come_to_a_verdict(
    panda: sm.RobotModel, size: float
) -> None:
    """Not to a million samples: a whole number of turns at both ends is undecided in between."""
    path, q = still(panda)
    rates = np.zeros((2, 7))
    rates[0, 6] = size
    motion = sm.Trajectory([0.0, 1.0], [q, q], rates, panda.joint_names)
    wide = sm.constraints.JointVelocityLimits(1e301, replace=True).requirement(panda)
    certificate = sm.certify(panda, path, "pointing", motion, requirements=[wide])
    assert certificate.samples < 10**5
    assert not certificate.verified


@dataclass(frozen=True, eq=False)
class Unknown(sm.paths.Path, kind="unknown"):
    """A path that is not a number for a while."""

    path: sm.paths.Path
    duration: float

    @property
    def knots(self) -> Array:
        return np.array([0.0, 0.5, 0.7, self.duration])

    def evaluate(self, t: Array) -> sm.paths.PathSamples:
        samples = self.path.evaluate(t)
        hidden = (t >= 0.5) & (t <= 0.7)
        return replace(samples, translation=np.where(hidden[:, None], np.nan, samples.translation))


def test_a_path_that_is_not_a_number_is_never_kept(line_plan: sm.Plan) -> None:
    """Whatever else has to be looked at more closely, which the coarse motion sees to."""
    motion, path = line_plan.trajectory, Unknown(line_plan.path, line_plan.path.duration)
    keep = np.unique(np.append(np.arange(0, len(motion.t), 3), len(motion.t) - 1))
    coarser = sm.Trajectory(motion.t[keep], motion.q[keep], motion.qd[keep], motion.joint_names)
    for tolerance in np.geomspace(1e-9, 1e-5, 9):
        allowed = sm.Tolerance(float(tolerance), float(tolerance))
        certificate = sm.certify(line_plan.robot, path, "pose", coarser, allowed)
        assert np.isnan(certificate.position_error.value)
        assert not certificate.verified


def test_joints_are_told_by_name(line_plan: sm.Plan) -> None:
    motion, panda = line_plan.trajectory, line_plan.robot
    names = panda.joint_names

    def certified(motion: sm.Trajectory) -> sm.Certificate:
        return sm.certify(panda, line_plan.path, "pose", motion)

    every = motion.q[:, ::-1], motion.qd[:, ::-1], names[::-1], motion.qdd[:, ::-1]
    turned = sm.Trajectory(motion.t, *every)
    assert certified(turned).verified
    swapped = sm.Trajectory(motion.t, motion.q, motion.qd, names[::-1], motion.qdd)
    assert not certified(swapped).verified
    with pytest.raises(sm.errors.FileFormatError, match="joint 'panda_joint7' is missing"):
        certified(sm.Trajectory(motion.t, motion.q, motion.qd, (*names[:-1], "wrist")))


def test_limits_that_cannot_be_meant_are_refused(panda: sm.RobotModel) -> None:
    with pytest.raises(sm.errors.ProblemError, match="expected numbers > 0"):
        sm.constraints.JointVelocityLimits(-np.ones(7)).requirement(panda)
    with pytest.raises(sm.errors.ProblemError, match="limits are in radians"):
        sm.constraints.JointPositionLimits(np.full(7, -170.0), np.full(7, 170.0)).requirement(panda)
    with pytest.raises(sm.errors.RobotError, match="'panda_joint1' at 99 rad, beyond its limits"):
        sm.load_robot("panda", lock={"panda_joint1": 99.0})
    path, q = still(panda)
    q[0] += 2.0 * np.pi
    motion = sm.Trajectory([0.0, 1.0], [q, q], np.zeros((2, 7)), panda.joint_names)
    wide = sm.constraints.JointPositionLimits(np.full(7, -7.0), np.full(7, 7.0)).requirement(panda)
    assert not sm.certify(panda, path, "pose", motion, requirements=[wide]).verified


def test_a_plan_that_was_changed_on_disk_is_not_verified(
    line_plan: sm.Plan, tmp_path: Path
) -> None:
    file = tmp_path / "plan.npz"
    line_plan.save(file)
    assert sm.load_plan(file).require().check().verified
    arrays = dict(np.load(file))
    for change in ({"q": arrays["q"] + 0.1}, {"qd": arrays["qd"] * 1.1}):
        np.savez_compressed(file, **(arrays | change))
        altered = sm.load_plan(file)
        assert not altered.check().verified
        with pytest.raises(sm.errors.PlanError, match="was changed after the plan was written"):
            altered.require()


@pytest.mark.parametrize("argument", ["qd", "q", "t"])
def test_a_cost_that_writes_to_its_arguments_is_told(line_plan: sm.Plan, argument: str) -> None:
    def careless(qd: Array, q: Array, t: Array) -> Array:
        {"qd": qd, "q": q, "t": t}[argument][:] = 0.0
        return np.sum(qd**2, axis=1)

    costs = [sm.costs.JointVelocity(), sm.costs.FunctionCost(careless)]
    with pytest.raises((ValueError, sm.errors.ProblemError), match="read-only"):
        sm.plan(replace(line_plan.problem, costs=costs))


def test_a_pose_may_be_a_matrix(panda: sm.RobotModel) -> None:
    pose = panda.pose(PANDA_HOME)
    expected = panda.inverse_kinematics(pose)
    np.testing.assert_array_equal(panda.inverse_kinematics(pose.homogeneous), expected)


def test_a_robot_may_be_shared_by_threads(panda: sm.RobotModel, line_plan: sm.Plan) -> None:
    """With a switch every microsecond: the same poses and plans as by one thread alone."""
    q = PANDA_HOME + 0.01 * np.arange(50)[:, None]
    poses = [panda.pose(x).homogeneous for x in q]
    problem = replace(line_plan.problem, costs=[sm.costs.JointVelocity()])
    alone = sm.plan(problem, max_evaluations=3).trajectory.q
    wrong: list[str] = []

    def work() -> None:
        for _ in range(20):
            for x, pose in zip(q, poses, strict=True):
                if not np.array_equal(panda.pose(x).homogeneous, pose):
                    wrong.append("pose")
        if not np.array_equal(sm.plan(problem, max_evaluations=3).trajectory.q, alone):
            wrong.append("plan")

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=work) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval)
    assert wrong == []


SLIDER = """<robot name="slider"><link name="l0"/><link name="l1"/>
<joint name="turn" type="revolute"><parent link="l0"/><child link="l1"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="100" effort="1"/></joint>
<link name="l2"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
<joint name="slide" type="prismatic"><parent link="l1"/><child link="l2"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.1" velocity="100" effort="1"/></joint></robot>"""


def test_a_joint_beyond_the_urdfs_limits_lengthens_levers(tmp_path: Path) -> None:
    """The tool is 5 m out where the URDF allows 0.1 m, and passes a plate of 2 mm."""
    (tmp_path / "slider.urdf").write_text(SLIDER)
    robot = sm.load_robot(tmp_path / "slider.urdf", "l2")
    t = np.linspace(0.0, 1.0, 21)
    still = np.zeros_like(t)
    motion = sm.Trajectory(
        t,
        np.column_stack([2.0 * t, still + 5.0]),
        np.column_stack([still + 2.0, still]),
        robot.joint_names,
    )
    path = sm.paths.Circle(
        robot.pose([0.0, 5.0]),
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0],
        1.0,
        turns=1.0 / np.pi,
        turn_tool=True,
        time_law="constant",
    )
    limits = sm.constraints.JointPositionLimits(
        [-3.0, -10.0], [3.0, 10.0], replace=True
    ).requirement(robot)

    def certified(angle: float) -> sm.Certificate:
        place = pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3))
        place.translation = 5.0 * place.rotation[:, 0]
        plate = sm.obstacles.Box("plate", place, [0.1, 0.002, 0.1])
        clearance = sm.constraints.Clearance([plate], 0.001).requirement(robot)
        return sm.certify(
            robot, path, "planar", motion, sm.Tolerance(1e-3, 1e-3), [limits, clearance]
        )

    for angle in (0.77, 1.03, 1.53):
        assert "plate" in " ".join(certified(angle).failures)
    assert certified(2.5).verified
