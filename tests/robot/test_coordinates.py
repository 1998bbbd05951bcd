"""Elbow, joints and links by name: coordinates and their gradients."""

import numpy as np
import pytest

import selfmotion as sm
from support.arms import robot_named
from support.circles import small_circle
from support.coordinates import COORDINATES

# Central differences of coordinates.
DIFFERENCE = 1e-7


@pytest.mark.parametrize("name", COORDINATES)
def test_gradients_equal_central_differences(panda: sm.RobotModel, name: str) -> None:
    coordinate, rng, h = COORDINATES[name], np.random.default_rng(0), 1e-6
    q = rng.uniform(panda.lower, panda.upper, (20, 7))
    _, gradient = coordinate(panda, q)
    for joint in range(7):
        step = h * np.eye(7)[joint]
        late, early = (coordinate(panda, q + sign * step)[0] for sign in (1.0, -1.0))
        difference = coordinate.away(late - early, 0.0) / (2.0 * h)
        np.testing.assert_allclose(gradient[:, joint], difference, atol=DIFFERENCE, rtol=1e-6)


def test_the_swivel_is_that_of_points_turned_about_a_line() -> None:
    """An arm turned as a whole about the line from shoulder to wrist swivels by that angle."""
    panda = robot_named("panda")
    swivel = sm.robot.SwivelAngle()
    joints = [panda.joint_names[k] for k in (1, 3, 5)]
    frames = [sm.robot.FrameCoordinate(joint, axis) for joint in joints for axis in np.eye(3)]
    for q in np.random.default_rng(1).uniform(panda.lower, panda.upper, (10, 7)):
        points = np.array([float(frame(panda, q[None])[0][0]) for frame in frames]).reshape(3, 3)
        shoulder, elbow, wrist = points
        axis = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
        up = np.array([0.0, 0.0, 1.0])
        zero = up - axis * (axis @ up)
        side = np.cross(axis, zero)
        arm = elbow - shoulder
        angle = np.arctan2(arm @ side, arm @ zero)
        assert swivel(panda, q[None])[0][0] == pytest.approx(angle, abs=1e-12)


def test_sides_are_those_of_who_looks_along_the_arm() -> None:
    panda = robot_named("panda")
    # The wrist ahead in x; the base turned against the third joint moves the elbow aside.
    q = np.array([0.6, 0.7, -0.6, -1.8, 0.0, 1.6, 0.8])
    left = sm.robot.FrameCoordinate("panda_joint4", [0.0, 1.0, 0.0])
    wrist = sm.robot.FrameCoordinate("panda_joint6", [0.0, 1.0, 0.0])
    for state in (q, q * np.array([-1, 1, -1, 1, 1, 1, 1])):
        at, line = left(panda, state[None])[0][0], wrist(panda, state[None])[0][0]
        swivel = sm.robot.SwivelAngle()(panda, state[None])[0][0]
        # The line from shoulder to wrist is in the plane y = x line / |x|: half way it is at half.
        assert np.sign(swivel) == -np.sign(at - 0.5 * line)
    for side, height in (("up", 1.0), ("down", -1.0)):
        band = sm.constraints.Band.of_elbow(side)
        elbow = sm.robot.FrameCoordinate("panda_joint4")
        above = elbow(panda, q[None])[0][0] - 0.333
        inside = abs(band.coordinate.away(band.coordinate(panda, q[None])[0], band.center)[0])
        assert (inside <= band.half) == (np.sign(above) == height)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda r: sm.constraints.Band(sm.robot.JointCoordinate("panda_joint9"), 0.0, 1.0),
            "no joint 'panda_joint9'",
        ),
        (
            lambda r: sm.constraints.Band(sm.robot.FrameCoordinate("hand"), 0.0, 1.0),
            "no link or joint 'hand'",
        ),
        (
            lambda r: sm.constraints.Band(
                sm.robot.FrameCoordinate("panda_hand", [0, 0, 0]), 0.0, 1.0
            ),
            "is zero",
        ),
        (
            lambda r: sm.constraints.Band(sm.robot.FrameCoordinate("panda_link0"), 0.0, 1.0),
            "no joint changes place of 'panda_link0'",
        ),
        (
            lambda r: sm.constraints.Band(sm.robot.FrameCoordinate("panda_link1"), 0.0, 1.0),
            "no joint changes place of 'panda_link1'",
        ),
        (lambda r: sm.constraints.Band("elbow", 0.0, 1.0), "coordinate is 'elbow'"),
        (lambda r: sm.constraints.Band(sm.robot.SwivelAngle(), 0.0, 4.0), "half is 4.0"),
        (lambda r: sm.constraints.Band(sm.robot.SwivelAngle(), 0.0, 0.0), "half is 0.0"),
        (lambda r: sm.constraints.Band.of_elbow("above"), "side is 'above', expected one of: up"),
        (lambda r: sm.costs.Towards(r, sm.robot.SwivelAngle(), np.nan), "target is nan"),
        (
            lambda r: sm.costs.Towards(r, sm.robot.SwivelAngle(elbow="x"), 0.0),
            "no link or joint 'x'",
        ),
        (lambda r: sm.robot.SwivelAngle([0, 0, 0]), "reference is zero"),
    ],
)
def test_what_cannot_be_a_coordinate(panda: sm.RobotModel, make, message: str) -> None:
    with pytest.raises(sm.errors.ProblemError, match=message):
        small_circle(panda, constraints=[make(panda)])


def test_an_arm_of_other_joints_has_to_be_told_its_elbow() -> None:
    arm = robot_named("ur5")
    with pytest.raises(sm.errors.ProblemError, match="name them: SwivelAngle"):
        sm.robot.SwivelAngle()(arm, np.zeros((1, 6)))
    named = sm.robot.SwivelAngle(
        shoulder="shoulder_lift_joint", elbow="elbow_joint", wrist="wrist_1_joint"
    )
    assert np.isfinite(named(arm, np.full((1, 6), 0.3))[0]).all()
