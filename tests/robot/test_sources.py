"""Arms from URDF text, and from Pinocchio's models, are those of the files."""

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.model.robot import Dynamics
from support.arms import robot_named, short_line

# Roundings of angles that are written and read.
WRITTEN = 1e-12
PLANAR = Path(robot_named("planar_3r").urdf.source)


def file_of(robot: sm.RobotModel) -> Path:
    return Path(robot.urdf.source)


def model_of(robot: sm.RobotModel) -> pin.Model:
    return pin.buildModelFromUrdf(str(file_of(robot)))


def poses(robot: sm.RobotModel, q: np.ndarray) -> np.ndarray:
    return np.array([pose.homogeneous for pose in robot.pose(q)])


# Torques of two models of one arm differ by rounding [Nm].
TORQUES = 1e-9


def test_text_is_the_arm_of_its_file(robot: sm.RobotModel) -> None:
    text = "\n  " + file_of(robot).read_text()
    found = sm.load_robot(text, robot.tools, robot.locked)
    from_file = sm.load_robot(file_of(robot), robot.tools, robot.locked)
    q = robot.generic_configurations()
    np.testing.assert_array_equal(poses(found, q), poses(from_file, q))
    assert found.joint_names == from_file.joint_names
    np.testing.assert_array_equal(found.upper, from_file.upper)


def test_a_model_is_the_arm_of_its_file(robot: sm.RobotModel) -> None:
    found = sm.load_robot(model_of(robot), robot.tools, robot.locked)
    from_file = sm.load_robot(file_of(robot), robot.tools, robot.locked)
    assert found.joint_names == from_file.joint_names
    q = robot.generic_configurations()
    np.testing.assert_allclose(poses(found, q), poses(from_file, q), rtol=0, atol=WRITTEN)
    np.testing.assert_allclose(found.jacobian(q), from_file.jacobian(q), rtol=0, atol=WRITTEN)
    for limit in ("lower", "upper", "velocity_limit", "effort_limit"):
        np.testing.assert_array_equal(getattr(found, limit), getattr(from_file, limit))


def test_a_model_keeps_its_masses(robot: sm.RobotModel) -> None:
    """By torques: those of gravity and inertia on both arms, computed by Pinocchio."""
    found = sm.load_robot(model_of(robot), robot.tools, robot.locked)
    from_file = sm.load_robot(file_of(robot), robot.tools, robot.locked)
    rng = np.random.default_rng(0)
    for q in robot.generic_configurations():
        speed, rate = rng.normal(size=(2, from_file.model.nv))
        every = from_file.coupling.spread(q)
        torques = [
            pin.rnea(arm.model, arm.model.createData(), every, speed, rate)
            for arm in (found, from_file)
        ]
        np.testing.assert_allclose(*torques, rtol=1e-9, atol=1e-9)


def test_a_model_keeps_the_inertia_of_its_rotors(panda: sm.RobotModel, tmp_path: Path) -> None:
    """Torques are those of `pinocchio.rnea` of the model that was given, in a cell as well."""
    given = pin.buildModelFromXML(robot_named("ur5").urdf.readable_text)
    given.armature = np.linspace(0.5, 2.0, given.nv)
    data, rng = given.createData(), np.random.default_rng(3)
    rows = rng.uniform(-1.0, 1.0, (3, 6))
    for robot in (
        sm.load_robot(given, tool="tool0"),
        sm.load_robot({"arm": given}, tool="arm/tool0"),
    ):
        found = Dynamics(robot).torques(*(row[None] for row in rows))[0]
        np.testing.assert_allclose(found, pin.rnea(given, data, *rows), atol=TORQUES)


ROTOR = """<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="tip"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="9"/><dynamics {turn}/></joint>
<joint name="held" type="fixed"><parent link="arm"/><child link="tip"/><dynamics {held}/></joint>
</robot>"""


def test_a_urdf_says_the_inertia_of_rotors_of_joints_that_turn(tmp_path: Path) -> None:
    file = tmp_path / "rotor.urdf"
    file.write_text(
        ROTOR.format(turn='damping="0" armature="0.5"', held='damping="0" armature="7"')
    )
    found = Dynamics(sm.load_robot(file)).torques(*np.array([[[0.2]], [[0.0]], [[2.0]]]))
    np.testing.assert_allclose(found, [[2.0 * (1.0 + 0.5)]], atol=TORQUES)


@pytest.mark.parametrize("said", ["x", "nan", "inf", "-1", ""])
@pytest.mark.parametrize("key", ["armature", "damping", "friction"])
def test_what_of_a_joints_dynamics_is_no_number_is_named(
    key: str, said: str, tmp_path: Path
) -> None:
    file = tmp_path / "rotor.urdf"
    file.write_text(ROTOR.format(turn=f'{key}="{said}"', held='damping="0"'))
    with pytest.raises(
        sm.errors.RobotError, match=f"'turn': <dynamics>: {key} is .*expected a num"
    ):
        sm.load_robot(file)


def test_gravity_that_a_urdf_cannot_say_is_refused() -> None:
    given = pin.buildModelFromXML(robot_named("ur5").urdf.readable_text)
    given.gravity.linear = np.array([9.81, 0.0, 0.0])
    with pytest.raises(sm.errors.RobotError, match=r"gravity is \(9.81, 0, 0\).*base="):
        sm.load_robot(given, tool="tool0")


@pytest.mark.parametrize("name", ["panda", "tiago", "z1"])
def test_a_model_with_bodies_collides_as_its_file(name: str) -> None:
    """The same distances between the same links: by meshes, boxes, spheres and cylinders."""
    robot = robot_named(name)
    model, file, folders = model_of(robot), file_of(robot), list(robot.urdf.package_dirs)
    geometry = pin.buildGeomFromUrdf(
        model, str(file), pin.GeometryType.COLLISION, package_dirs=folders
    )
    found = sm.load_robot(model, robot.tools, robot.locked, geometry=geometry)
    from_file = sm.load_robot(file, robot.tools, robot.locked, packages=folders)
    for q in robot.generic_configurations():
        one, other = (sm.obstacles.CollisionModel(arm).worst(q[None]) for arm in (found, from_file))
        assert one.value == pytest.approx(other.value, abs=1e-9)
        assert (one.first, one.second) == (other.first, other.second)


def test_a_frame_that_was_added_is_a_tool(panda: sm.RobotModel) -> None:
    model = model_of(panda)
    at, pen = model.getFrameId("panda_hand_tcp"), pin.SE3(np.eye(3), np.array([0.0, 0.02, 0.1]))
    hand = model.frames[at]
    model.addFrame(
        pin.Frame("pen", hand.parentJoint, at, hand.placement * pen, pin.FrameType.OP_FRAME)
    )
    found = sm.load_robot(model, tool="pen", lock=panda.locked)
    q = panda.generic_configurations()[0]
    expected = panda.pose(q) * pen
    np.testing.assert_allclose(found.pose(q).homogeneous, expected.homogeneous, atol=WRITTEN)


def test_a_plan_of_either_is_saved_with_its_arm(tmp_path: Path, planar: sm.RobotModel) -> None:
    start = [0.3, 0.8, 0.4]
    for number, given in enumerate((PLANAR.read_text(), model_of(planar))):
        arm = sm.load_robot(given, tool="tool")
        plan = sm.plan(sm.Problem(arm, short_line(arm, np.array(start)), "planar", start))
        plan.require().save(tmp_path / f"{number}.npz")
        again = sm.load_plan(tmp_path / f"{number}.npz")
        assert again.certificate.verified
        assert again.certificate.notes == plan.certificate.notes
        assert again.robot.pose(start) == arm.pose(start)
        with pytest.raises(sm.errors.ProblemError, match="load it from there"):
            sm.files.write_problem(plan.problem, tmp_path / "problem.toml")


def test_text_is_a_part_of_a_cell(planar: sm.RobotModel) -> None:
    cell = sm.load_robot({"table": "positioner", "arm": PLANAR.read_text()}, tool="arm/tool")
    assert cell.joint_names == ("arm/joint1", "arm/joint2", "arm/joint3")


def test_a_problem_file_cannot_name_a_part_that_is_text(tmp_path: Path) -> None:
    cell = sm.load_robot({"arm": PLANAR.read_text()}, tool="arm/tool")
    start = np.array([0.3, 0.8, 0.4])
    problem = sm.Problem(cell, short_line(cell, start), "planar", start)
    with pytest.raises(sm.errors.ProblemError, match="part 'arm' is of the URDF text"):
        sm.files.write_problem(problem, tmp_path / "problem.toml")


def composite() -> pin.Model:
    model = pin.buildModelFromUrdf(str(PLANAR), pin.JointModelFreeFlyer())
    model.name = "floating"
    return model


def doubled() -> pin.Model:
    model = pin.buildModelFromUrdf(str(PLANAR))
    model.addFrame(pin.Frame("tool", 1, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("<robot", "the URDF text: is not well-formed XML"),
        ("<robot><xacro:macro/></robot>", "the URDF text: is xacro; give it as a file"),
        (pin.Model(), "has no <link>|no joint moves|end links"),
        (composite(), "'floating': joint 'root_joint' is a JointModelFreeFlyer, expected a revol"),
        (doubled(), "two frames are called 'tool'"),
        (3, "expected a name, the path of a file, the text of a URDF or a pinocchio.Model"),
    ],
)
def test_what_is_no_arm_is_refused(given, message: str) -> None:
    with pytest.raises(sm.errors.RobotError, match=message):
        sm.load_robot(given)


def test_bodies_that_a_urdf_cannot_say_are_refused() -> None:
    model, geometry = model_of(robot_named("planar_3r")), pin.GeometryModel()
    cone = pin.GeometryObject("hat", 1, pin.SE3.Identity(), coal.Cone(0.1, 0.2))
    geometry.addGeometryObject(cone)
    with pytest.raises(sm.errors.RobotError, match="body 'hat' is a Cone, expected a box"):
        sm.load_robot(model, tool="tool", geometry=geometry)
    with pytest.raises(sm.errors.RobotError, match=r"which only a pinocchio\.Model has"):
        sm.load_robot("panda", geometry=geometry)
    with pytest.raises(sm.errors.RobotError, match=r"expected a pinocchio\.GeometryModel"):
        sm.load_robot(model, tool="tool", geometry=3)


@pytest.mark.parametrize(
    ("kind", "limits", "told"),
    [
        (pin.JointModelRZ(), (-np.inf, 3.0), r"'first' may go from -inf to 3 rad, expected limits"),
        (
            pin.JointModelRZ(),
            (-1.0, 1e6),
            r"from -1 to 1e\+06 rad, .* both ends or at neither, as a",
        ),
        (
            pin.JointModelPX(),
            (-np.inf, np.inf),
            "from -inf to inf m, expected limits at both ends,",
        ),
        (pin.JointModelPX(), (0.0, np.inf), "from 0 to inf m, expected limits at both ends, as"),
    ],
)
def test_limits_that_a_urdf_has_not_are_refused(
    kind: object, limits: tuple[float, float], told: str
) -> None:
    """Not dropped: a motion beyond the one that is there would be verified."""
    model, lower, upper = pin.Model(), *(np.array([x]) for x in limits)
    rates = np.array([1.0])
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3]))
    first = model.addJoint(0, kind, place, "first", rates, rates, lower, upper)
    last = model.addJoint(first, pin.JointModelRY(), place, "last", rates, rates, -rates, rates)
    model.addFrame(pin.Frame("tool", last, place, pin.FrameType.OP_FRAME))
    with pytest.raises(sm.errors.RobotError, match=told):
        sm.load_robot(model)
