"""Problems whose parts do not fit are refused."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest

import selfmotion as sm
from support.arms import robot_named

Circle = Callable[..., sm.Problem]


def test_start_off_the_path_is_refused_with_the_miss(panda_circle: Circle) -> None:
    problem = panda_circle()
    off = np.asarray(problem.start) + np.array([0, 0, 0, 0, 0, 0.01, 0])
    with pytest.raises(sm.StartError, match=r"m and 0\.01 rad off the start") as caught:
        dataclasses.replace(problem, start=off)
    assert caught.value.rotation_miss == pytest.approx(0.01, rel=1e-3)
    assert caught.value.position_miss > 1e-4


def test_a_start_in_degrees_names_the_joint_and_its_limits(panda_circle: Circle) -> None:
    problem = panda_circle()
    beyond = np.asarray(problem.start) + np.array([0, -45.0, 0, 0, 0, 0, 0])
    said = (
        r"'panda_joint2' at -45\.\d+ rad, beyond its limits of -1\.\d+ to 1\.\d+ rad; in degrees\?"
    )
    with pytest.raises(sm.StartError, match=said):
        dataclasses.replace(problem, start=beyond)


def test_limits_far_above_the_arms_own_are_told(panda_circle: Circle) -> None:
    problem = panda_circle()
    for limit, told in ((120.0, 1), (2.0, 0), ([9.0] * 6 + [180.0], 1)):
        found = dataclasses.replace(problem, constraints=[sm.JointVelocityLimits(limit)])
        remarks = [text for text in found.remarks if "in degrees? limit_deg" in text]
        assert len(remarks) == told
    assert (
        "180 rad/s for 'panda_joint7' has no effect"
        in dataclasses.replace(
            problem, constraints=[sm.JointVelocityLimits([9.0] * 6 + [180.0])]
        ).remarks[-1]
    )


def test_missing_start_is_found(panda_circle: Circle) -> None:
    problem = dataclasses.replace(panda_circle(), start=None)
    plan = sm.plan(problem)
    pose = problem.path.pose(0.0)
    assert max(sm.Task.POSE.miss(pose, plan.robot.pose(plan.trajectory.q[0]))) < 1e-9


def test_no_redundancy_is_refused() -> None:
    ur5 = sm.load_robot("ur5")
    pose = ur5.pose(ur5.dexterous_configuration())
    with pytest.raises(sm.RedundancyError, match="6 joints and task 'pose' with 6 rows") as caught:
        sm.Problem(ur5, sm.Circle.around(pose, 0.1, 1.0))
    assert (caught.value.dof, caught.value.rows) == (6, 6)


@pytest.mark.parametrize(
    ("name", "task"), [("planar_3r", "pose"), ("planar_3r", "position"), ("panda", "planar_pose")]
)
def test_rows_the_arm_cannot_move_in_are_refused(name: str, task: str) -> None:
    robot = sm.load_robot(name)
    pose = robot.pose(robot.dexterous_configuration("planar"))
    with pytest.raises(sm.ProblemError, match="choose another task"):
        sm.Problem(robot, sm.Circle.around(pose, 0.1, 1.0), task)


def test_planar_pose_with_three_joints_has_no_freedom(planar: sm.RobotModel) -> None:
    assert planar.can_follow("planar_pose")
    assert planar.redundancy("planar_pose") == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"task": "posture"}, "unknown task 'posture'"),
        ({"costs": ()}, "no cost is given"),
        ({"costs": ["x"]}, "costs: 'x' is no Cost"),
        ({"robot": "panda"}, "expected a RobotModel"),
        ({"path": None}, "expected a Path"),
        ({"null_motion": "cubic"}, "null_motion is 'cubic'"),
        ({"constraints": [3]}, "constraints: 3 is no Constraint"),
        ({"costs": [sm.PathLength(float("inf"))]}, "smoothing is inf"),
        ({"costs": [sm.JointVelocity(), sm.JointVelocity()]}, "two costs are called"),
        ({"costs": [sm.JointVelocity([1.0, 2.0])]}, r"weight has shape \(2,\)"),
        ({"costs": [sm.InverseManipulability(-1.0)]}, "mu is -1.0"),
        ({"costs": [sm.Manipulability(float("nan"))]}, "mu is nan"),
    ],
)
def test_bad_problems_are_refused(
    panda_circle: Circle, change: dict[str, object], message: str
) -> None:
    with pytest.raises(sm.ProblemError, match=message):
        dataclasses.replace(panda_circle(), **change)


def test_one_cost_may_stand_without_a_list(panda_circle: Circle) -> None:
    assert len(panda_circle(costs=sm.JointVelocity()).costs) == 1


def test_one_number_is_a_tolerance_for_both() -> None:
    sample = sm.sample_problem()
    plan = sm.plan(sample, tolerance=1e-5)
    assert plan.tolerance == sm.Tolerance(1e-5, 1e-5)
    found = sm.certify(sample.robot, sample.path, sample.task, plan.trajectory, 1e-5)
    assert found.tolerance == plan.tolerance


def test_a_start_in_collision_is_called_that() -> None:
    panda = robot_named("panda")
    home = np.array(sm.NAMED_ARMS["panda"].home)
    stay = sm.Dwell(panda.pose(home), 1.0)
    motion = sm.Trajectory([0.0, 1.0], [home] * 2, [0.0 * home] * 2, panda.joint_names)

    def verdict(at: np.ndarray) -> str:
        kept = sm.Clearance([sm.Sphere("ball", at, 0.05)], distance=0.02)
        asked = [kept.requirement(panda)]
        return sm.certify(panda, stay, "position", motion, requirements=asked).verdict

    place = panda.pose(home).translation
    assert "the start is in collision: " in verdict(place)
    assert "'ball'" in verdict(place) or "ball overlap by" in verdict(place)
    assert "the start is too near already: " in verdict(place - np.array([0.0, 0.0, 0.06]))
    assert "the start" not in verdict(place + np.array([0.0, 2.0, 0.0]))
