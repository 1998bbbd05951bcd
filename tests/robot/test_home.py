"""What is home is known of arms by name, and of cells of them."""

import numpy as np
import pytest

import selfmotion as sm

HOMES = [name for name, arm in sm.NAMED_ARMS.items() if arm.home is not None]


@pytest.mark.parametrize("name", HOMES)
def test_home_is_within_limits_and_meets_nothing(name: str) -> None:
    robot = sm.load_robot(name)
    np.testing.assert_array_equal(robot.home, sm.NAMED_ARMS[name].home)
    assert np.all((robot.lower <= robot.home) & (robot.home <= robot.upper))
    assert sm.obstacles.CollisionModel(robot).worst(robot.home[None]).value > 0.0


def test_a_pose_can_be_held_and_left_at_the_home_of_an_arm_of_seven_joints() -> None:
    """Away from singular poses, which zeros of all joints are for an xArm."""
    for name in ("panda", "xarm7"):
        robot = sm.load_robot(name)
        assert np.linalg.svd(robot.jacobian(robot.home), compute_uv=False).min() > 0.1
    circle = sm.paths.Circle.around(robot.pose(robot.home), 0.03, 2.0)
    assert sm.plan(sm.Problem(robot, circle, start=robot.home)).certificate.verified


def test_home_of_a_cell_is_that_of_its_parts() -> None:
    table = np.eye(4)
    table[0, 3] = 0.9
    cell = sm.load_robot(
        {"arm": "ur10", "table": "positioner"}, base={"table": table}, tool="arm/tool0"
    )
    named = dict(zip(cell.joint_names, cell.home, strict=True))
    arm = sm.load_robot("ur10")
    for joint, value in zip(arm.joint_names, arm.home, strict=True):
        assert named[f"arm/{joint}"] == value
    assert all(value == 0.0 for name, value in named.items() if name.startswith("table/"))


def test_who_has_no_home_is_told_so() -> None:
    with pytest.raises(
        sm.errors.RobotError, match="no home configuration is known of this arm, only of panda"
    ):
        _ = sm.load_robot("kinova").home
    pair = sm.load_robot(
        {"left": "panda", "right": "kinova"},
        base={"right": [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
        tool="left/panda_hand_tcp",
        reference="right/j2s6s200_end_effector",
    )
    with pytest.raises(sm.errors.RobotError, match="of part 'right'"):
        _ = pair.home
