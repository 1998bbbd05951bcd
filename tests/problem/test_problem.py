"""Problems whose parts do not fit are refused."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

import selfmotion as sm
from support.arms import robot_named

Circle = Callable[..., sm.Problem]


def test_start_off_the_path_is_refused_with_the_miss(panda_circle: Circle) -> None:
    problem = panda_circle()
    off = np.asarray(problem.start) + np.array([0, 0, 0, 0, 0, 0.01, 0])
    with pytest.raises(sm.errors.StartError, match=r"m and 0\.01 rad off the start") as caught:
        dataclasses.replace(problem, start=off)
    assert caught.value.rotation_miss == pytest.approx(0.01, rel=1e-3)
    assert caught.value.position_miss > 1e-4


def test_a_start_in_degrees_names_the_joint_and_its_limits(panda_circle: Circle) -> None:
    problem = panda_circle()
    beyond = np.asarray(problem.start) + np.array([0, -45.0, 0, 0, 0, 0, 0])
    said = (
        r"'panda_joint2' at -45\.\d+ rad, beyond its limits of -1\.\d+ to 1\.\d+ rad; in degrees\?"
    )
    with pytest.raises(sm.errors.StartError, match=said):
        dataclasses.replace(problem, start=beyond)


def test_limits_far_above_the_arms_own_are_told(panda_circle: Circle) -> None:
    problem = panda_circle()
    for limit, told in ((120.0, 1), (2.0, 0), ([9.0] * 6 + [180.0], 1)):
        found = dataclasses.replace(
            problem, constraints=[sm.constraints.JointVelocityLimits(limit)]
        )
        remarks = [text for text in found.remarks if "in degrees? limit_deg" in text]
        assert len(remarks) == told
    assert (
        "180 rad/s for 'panda_joint7' has no effect"
        in dataclasses.replace(
            problem, constraints=[sm.constraints.JointVelocityLimits([9.0] * 6 + [180.0])]
        ).remarks[-1]
    )


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        (sm.constraints.JointVelocityLimits(120.0, replace=True), "is more than arms do (above 50"),
        (
            sm.constraints.JointAccelerationLimits(400.0, replace=True),
            "is more than arms do (above 200",
        ),
        (
            sm.constraints.JointAccelerationLimits(400.0),
            "has no effect, the arm's own limit is 15 rad/s²",
        ),
        (sm.constraints.JointJerkLimits(1e6), "has no effect, the arm's own limit is 7500 rad/s³"),
        (sm.constraints.JointAccelerationLimits(7.0), ""),
        (sm.constraints.ToolLimits(speed=250.0), "in mm/s? speed_mm"),
        (sm.constraints.ToolLimits(speed=0.25), ""),
    ],
)
def test_limits_that_no_arm_has_are_told(
    panda_circle: Circle, limit: sm.constraints.Constraint, told: str
) -> None:
    remarks = dataclasses.replace(panda_circle(), constraints=[limit]).remarks
    assert len(remarks) == bool(told)
    assert told in "".join(remarks)


def test_values_of_angles_beyond_turns_are_in_degrees(panda_circle: Circle) -> None:
    problem = panda_circle()
    panda = problem.robot
    with pytest.raises(
        sm.errors.ProblemError, match=r"center is 90 rad, more than a turn; in degrees\?"
    ):
        sm.constraints.Band(sm.robot.SwivelAngle(), 90.0, 0.1)
    with pytest.raises(
        sm.errors.ProblemError, match=r"target is 90 rad, more than a turn; in degrees\?"
    ):
        sm.costs.Towards(panda, sm.robot.SwivelAngle(), 90.0)
    with pytest.raises(sm.errors.ProblemError, match=r"'panda_joint4': -135 rad is -21.5 turns"):
        dataclasses.replace(problem, costs=[sm.costs.Posture(posture=[0, 0, 0, -135, 0, 0, 0])])


@pytest.mark.parametrize("shape", ["box", "capsule", "mesh", "away", "on the tool", "held"])
def test_a_path_inside_an_obstacle_is_told_where_the_tool_has_no_body(
    panda_circle: Circle, shape: str, tmp_path: Path
) -> None:
    """An obstacle that rides on a link is where the arm is; a tool with a body is checked."""
    problem = panda_circle()
    place = problem.path.pose(0.0).translation
    trimesh.creation.icosphere(radius=0.02).export(tmp_path / "ball.stl")
    obstacle = {
        "capsule": sm.obstacles.Capsule("it", place, 0.01, 0.02),
        "mesh": sm.obstacles.Mesh("it", place, tmp_path / "ball.stl"),
        "away": sm.obstacles.Box("it", place + np.array([0.0, 0.0, 1.0]), [0.02] * 3),
        "on the tool": sm.obstacles.Box("it", [0.0, 0.0, 0.3], [0.02] * 3, frame="panda_hand_tcp"),
    }.get(shape, sm.obstacles.Box("it", place, [0.02] * 3))
    held = [sm.obstacles.Sphere("tip", [0.0] * 3, 0.005)] if shape == "held" else []
    robot = sm.load_robot("panda", bodies=held) if held else problem.robot
    asked = dataclasses.replace(
        problem, robot=robot, constraints=[], clearance=sm.constraints.Clearance([obstacle])
    )
    told = [text for text in asked.remarks if "nothing is checked there" in text]
    assert len(told) == (shape in ("box", "capsule", "mesh"))
    if told:
        depth = float(told[0].split("the path is ")[1].split(" mm")[0])
        # A sphere's mesh has flat sides.
        assert depth == pytest.approx(20.0 if shape == "mesh" else 10.0, rel=0.05)


def test_missing_start_is_found(panda_circle: Circle) -> None:
    problem = dataclasses.replace(panda_circle(), start=None)
    plan = sm.plan(problem)
    pose = problem.path.pose(0.0)
    assert max(sm.Task.POSE.miss(pose, plan.robot.pose(plan.trajectory.q[0]))) < 1e-9


def test_no_redundancy_is_refused() -> None:
    ur5 = sm.load_robot("ur5")
    pose = ur5.pose(ur5.dexterous_configuration())
    with pytest.raises(
        sm.errors.RedundancyError, match="6 joints and task 'pose' with 6 rows"
    ) as caught:
        sm.Problem(ur5, sm.paths.Circle.around(pose, 0.1, 1.0))
    assert (caught.value.dof, caught.value.rows) == (6, 6)


@pytest.mark.parametrize(
    ("name", "task"), [("planar_3r", "pose"), ("planar_3r", "position"), ("panda", "planar_pose")]
)
def test_rows_the_arm_cannot_move_in_are_refused(name: str, task: str) -> None:
    robot = sm.load_robot(name)
    pose = robot.pose(robot.dexterous_configuration("planar"))
    with pytest.raises(sm.errors.ProblemError, match="choose another task"):
        sm.Problem(robot, sm.paths.Circle.around(pose, 0.1, 1.0), task)


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
        ({"costs": [sm.costs.PathLength(float("inf"))]}, "smoothing is inf"),
        ({"costs": [sm.costs.JointVelocity(), sm.costs.JointVelocity()]}, "two costs are called"),
        ({"costs": [sm.costs.JointVelocity([1.0, 2.0])]}, r"weight has shape \(2,\)"),
        ({"costs": [sm.costs.InverseManipulability(-1.0)]}, "mu is -1.0"),
        ({"costs": [sm.costs.Manipulability(float("nan"))]}, "mu is nan"),
    ],
)
def test_bad_problems_are_refused(
    panda_circle: Circle, change: dict[str, object], message: str
) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        dataclasses.replace(panda_circle(), **change)


def test_one_cost_may_stand_without_a_list(panda_circle: Circle) -> None:
    assert len(panda_circle(costs=sm.costs.JointVelocity()).costs) == 1


def test_one_number_is_a_tolerance_for_both() -> None:
    sample = sm.sample_problem()
    plan = sm.plan(sample, tolerance=1e-5)
    assert plan.tolerance == sm.Tolerance(1e-5, 1e-5)
    found = sm.certify(sample.robot, sample.path, sample.task, plan.trajectory, 1e-5)
    assert found.tolerance == plan.tolerance


def test_a_given_start_in_collision_is_called_that() -> None:
    """Not one that was chosen: whoever plans cannot choose another one."""
    panda = robot_named("panda")
    home = np.array(sm.NAMED_ARMS["panda"].home)
    stay = sm.paths.Dwell(panda.pose(home), 1.0)
    motion = sm.Trajectory([0.0, 1.0], [home] * 2, [0.0 * home] * 2, panda.joint_names)

    def verdict(at: np.ndarray, *, given: bool = True, relaxed: bool = False) -> str:
        ball = sm.obstacles.Sphere("ball", at, 0.05)
        problem = sm.Problem(
            panda,
            stay,
            "position",
            home if given else None,
            constraints=[],
            clearance=sm.constraints.Clearance([ball], distance=0.02),
            relaxations=[sm.Relaxation("z", 0.01)] if relaxed else [],
        )
        found = problem.certify(motion)
        # What is said of the start is no failure besides.
        assert not any("start" in text for text in found.failures)
        return found.verdict

    place = panda.pose(home).translation
    for relaxed in (False, True):
        told = verdict(place, relaxed=relaxed)
        assert "; the given start is in collision: " in told
        assert "ball overlap by" in told
    near = place - np.array([0.0, 0.0, 0.06])
    assert "; the given start is too near already: " in verdict(near)
    for at in (place, near):
        assert "the given start" not in verdict(at, given=False)
    assert "the given start" not in verdict(place + np.array([0.0, 2.0, 0.0]))
