"""Packages, arguments and cosmetic elements of robots' files, as their makers write them."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.model.robot import Packages, urdf_text
from selfmotion.shell.replay.links import bake
from selfmotion.shell.replay.meshes import Payload
from support.files_of_people import arm, chain_elements, described_package, with_arguments
from support.shell import complaint, invoke, on_circle

UP = [0.0, 0.0, 1.2]
_SHAPE = '<geometry><box size=".05 .05 .05"/></geometry>'


@pytest.fixture(autouse=True)
def without_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH"):
        monkeypatch.delenv(name, raising=False)


def test_find_is_the_folder_above_whose_package_xml_says_so(tmp_path: Path) -> None:
    robot = sm.load_robot(described_package(tmp_path / "any"), tool="l7")
    assert robot.dof == 7
    np.testing.assert_allclose(robot.pose(np.zeros(7)).translation, UP, atol=1e-12)


@pytest.mark.parametrize("way", ["below", "ament", "ros", "given"])
def test_packages_beside_are_found(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The including file is in a package of its own, the included in one elsewhere."""
    top = {
        "below": tmp_path / "work" / "src" / "vendor" / "arm",
        "ament": tmp_path / "elsewhere" / "share" / "arm_description",
        "ros": tmp_path / "elsewhere" / "a" / "b" / "arm",
        "given": tmp_path / "elsewhere" / "a" / "b" / "arm",
    }[way]
    described_package(top)
    file = tmp_path / "work" / "src" / "cell" / "urdf" / "cell.xacro"
    file.parent.mkdir(parents=True)
    (tmp_path / "work" / ".git").mkdir()
    file.write_text((top / "urdf" / "arm.urdf.xacro").read_text())
    given = ()
    if way == "ament":
        monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'elsewhere'}")
    elif way == "ros":
        monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "elsewhere"))
    elif way == "given":
        given = (tmp_path / "elsewhere",)
    robot = sm.load_robot(file, tool="l7", packages=given)
    np.testing.assert_allclose(robot.pose(np.zeros(7)).translation, UP, atol=1e-12)
    if way != "below":
        monkeypatch.undo()
        with pytest.raises(
            sm.errors.RobotError, match=r"package 'arm_description' is in none of .*work"
        ):
            sm.load_robot(file, tool="l7")


def test_the_nearest_package_counts(tmp_path: Path) -> None:
    far, near = tmp_path / "arm_description", tmp_path / "src" / "arm_description"
    for folder in (far, near):
        described_package(folder)
    assert Packages(near / "urdf" / "arm.urdf.xacro").folder("arm_description") == near
    assert Packages(tmp_path / "src" / "a.urdf").folder("arm_description") == near
    assert Packages(near / "a.urdf", (str(far),)).folder("arm_description") == far


def test_a_package_xml_that_says_otherwise_is_another_package(tmp_path: Path) -> None:
    described_package(tmp_path / "arm", "arm_description")
    assert Packages(tmp_path / "arm" / "a.urdf").folder("arm_description") == tmp_path / "arm"
    assert Packages(tmp_path / "arm" / "a.urdf").folder("arm_moveit") is None


@pytest.mark.parametrize(
    "address",
    [
        "package://arm_description/meshes/a.stl",
        "model://arm_description/meshes/a.stl",
        "file:///home/someone/install/arm_description/share/arm_description/meshes/a.stl",
        "/opt/somewhere/arm_description/meshes/a.stl",
        "../meshes/a.stl",
        "meshes/a.stl",
    ],
)
def test_addresses_of_meshes_are_looked_up_alike(address: str, tmp_path: Path) -> None:
    file = described_package(tmp_path / "vendor" / "arm_description").with_name("arm.urdf")
    mesh = tmp_path / "vendor" / "arm_description" / "meshes" / "a.stl"
    mesh.parent.mkdir()
    import trimesh

    trimesh.creation.box([0.1, 0.1, 0.1]).export(mesh)
    shape = f'<geometry><mesh filename="{address}"/></geometry>'
    file.write_text(arm(f"<collision>{shape}</collision>"))
    (body,) = sm.load_robot(file).geometry(pin.GeometryType.COLLISION).geometryObjects
    assert Path(body.meshPath).resolve() == mesh


def test_what_is_not_found_is_named_with_where_it_was_looked_for(tmp_path: Path) -> None:
    file = described_package(tmp_path / "one")
    file.write_text(file.read_text().replace("find arm_description", "find arm_descriptions"))
    with pytest.raises(
        sm.errors.RobotError, match=r"package 'arm_descriptions' .*ROS_PACKAGE_PATH"
    ) as no:
        sm.load_robot(file)
    assert str(tmp_path) in str(no.value)
    assert "robot.packages=DIR" in str(no.value)
    mesh = '<geometry><mesh filename="package://hand/a.stl"/></geometry>'
    file = tmp_path / "arm.urdf"
    file.write_text(arm(f"<collision>{mesh}</collision>"))
    with pytest.raises(
        sm.errors.RobotError, match=r"link 'l4': no such mesh file, package 'hand' is in"
    ):
        sm.obstacles.CollisionModel(sm.load_robot(file))


def test_a_package_that_is_called_otherwise_is_named(tmp_path: Path) -> None:
    """The file says 'hand', and its folder's package.xml 'hand_description'."""
    package = tmp_path / "hand_repository"
    (package / "urdf").mkdir(parents=True)
    (package / "meshes").mkdir()
    (package / "meshes" / "a.stl").write_text("")
    (package / "package.xml").write_text("<package><name>hand_description</name></package>")
    mesh = '<geometry><mesh filename="package://hand/meshes/a.stl"/></geometry>'
    (package / "urdf" / "arm.urdf").write_text(arm(f"<collision>{mesh}</collision>"))
    with pytest.raises(sm.errors.RobotError) as no:
        sm.obstacles.CollisionModel(sm.load_robot(package / "urdf" / "arm.urdf"))
    said = f"{package} has meshes/a.stl and is called 'hand_description': rename it, or link to it"
    assert said in str(no.value)
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "hand").symlink_to(package)
    linked = sm.load_robot(package / "urdf" / "arm.urdf", packages=tmp_path / "linked")
    assert "hand_repository" in linked.urdf.text or "linked/hand" in linked.urdf.text


def test_what_a_simulator_is_told_is_no_part_of_the_robot(tmp_path: Path) -> None:
    """Contact sensors of Gazebo name their bodies by elements that are called as URDF's are."""
    sensor = "<sensor><contact><collision>l3_collision</collision></contact></sensor>"
    file = tmp_path / "arm.urdf"
    plain = arm()
    file.write_text(plain.replace("</robot>", f'<gazebo reference="l3">{sensor}</gazebo></robot>'))
    assert sm.load_robot(file).dof == 7
    file.write_text(plain.replace("</robot>", "<collision/></robot>"))
    with pytest.raises(sm.errors.RobotError, match="a <collision> is outside of the links"):
        sm.load_robot(file)


def test_a_urdf_that_is_xacro_is_expanded(tmp_path: Path) -> None:
    """Its suffix says what it expands to; arguments are given as those of any xacro file."""
    file = tmp_path / "arm.urdf"
    file.write_text(
        '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<xacro:arg name="up" default="0.3"/><xacro:property name="height" value="$(arg up)"/>'
        f"{chain_elements('${height}')}</robot>"
    )
    assert sm.load_robot(file).pose([0.0] * 7).translation[2] == pytest.approx(0.3 + 6 * 0.15)
    higher = sm.load_robot(file, arguments={"up": 0.5})
    assert higher.pose([0.0] * 7).translation[2] == pytest.approx(0.5 + 6 * 0.15)
    with pytest.raises(sm.errors.RobotError, match="has no argument 'upp'"):
        sm.load_robot(file, arguments={"upp": 0.5})


def test_the_root_of_a_xacro_has_the_defaults_that_the_file_declares_below(tmp_path: Path) -> None:
    """Makers name the robot by an argument of the file, which xacro looks at too late."""
    file = tmp_path / "arm.xacro"
    file.write_text(
        '<robot name="$(arg model)" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        f'<xacro:arg name="model" default="rx7"/>{chain_elements()}</robot>'
    )
    assert sm.load_robot(file).name == "rx7"
    assert sm.load_robot(file, arguments={"model": "rx8"}).name == "rx8"
    file.write_text(file.read_text().replace(' default="rx7"', ""))
    with pytest.raises(sm.errors.RobotError, match=r"model \(no default\)"):
        sm.load_robot(file)


def test_arguments_of_a_xacro_are_given_in_the_shell(tmp_path: Path) -> None:
    file, out = with_arguments(tmp_path), tmp_path / "arm.toml"
    said = complaint("init", file, "--out", out)
    assert 'name (default "arm"), reach (default "")' in said
    assert "robot.arguments.NAME=VALUE" in said
    said = complaint("init", file, "--out", out, "--set", "robot.arguments.name=arm")
    assert 'reach (default "")' in said
    said = complaint("plan", file, *on_circle("0.02"), "--set", "robot.arguments.nam=arm")
    assert "has no argument 'nam'; nearest: 'name'" in said
    given = ("--set", "robot.arguments.name=arm", "--set", "robot.arguments.reach=0.3")
    assert invoke("init", file, "--out", out, *given, "--set", "robot.lock.j3=0.1")[0] == 0
    robot = sm.files.read_job(out).problem.robot
    assert robot.dof == 6
    assert robot.locked == {"j3": 0.1}
    np.testing.assert_allclose(robot.model.jointPlacements[1].translation, [0, 0, 0.3])
    said = complaint("plan", file, "--set", "robot.arguments.reach")
    assert "is 'robot.arguments.reach', expected KEY=VALUE" in said


@pytest.mark.parametrize(
    ("element", "said", "shapes"),
    [
        ("visual", None, {"Box"}),
        ("collision", "its collision bodies are drawn instead", {"Box"}),
        ("other", "its joints are drawn instead", {"Cylinder"}),
    ],
)
def test_an_arm_without_visuals_is_drawn(
    element: str, said: str | None, shapes: set[str], tmp_path: Path
) -> None:
    """By its bodies, or by its joints: where they are, and along their axes."""
    file = tmp_path / "arm.urdf"
    file.write_text(arm(f"<{element}>{_SHAPE}</{element}>"))
    robot = sm.load_robot(file)
    geometry, missing = robot.visuals()
    assert {type(item.geometry).__name__ for item in geometry.geometryObjects} == shapes
    assert [note for note in missing if said is None or said not in note] == []
    assert bake(robot, Payload()).visuals
    if element == "other":
        axes = [item for item in geometry.geometryObjects if item.name.startswith("axis")]
        assert [int(item.parentJoint) for item in axes] == list(range(1, 8))
        for k, item in enumerate(axes, 1):
            along = np.abs(item.placement.rotation[:, 2])
            np.testing.assert_allclose(along, [0, 0, 1] if k % 2 else [0, 1, 0], atol=1e-12)


_RED = '<material><color rgba="1 0 0 1"/></material>'


@pytest.mark.parametrize(
    ("in_fourth", "more", "colours"),
    [
        (f"<visual>{_SHAPE}{_RED}</visual>", "", [[1, 0, 0, 1]]),
        ("", _RED, []),
        ("", '<material name="grey"/>', []),
        (f'<visual>{_SHAPE}<material name="none"/></visual>', "", None),
        (f'<visual>{_SHAPE}<material name="a"><texture/></material></visual>', "", None),
        (
            f'<visual>{_SHAPE}<material name="a"><color rgba="0 1 0"/></material></visual>',
            "",
            [[0, 1, 0, 1]],
        ),
        (f'<visual>{_SHAPE}<material name="a"><color rgba="red"/></material></visual>', "", None),
        ("<visual><geometry><capsule/></geometry></visual>", "", []),
        ("<visual/>", "", []),
    ],
)
def test_what_only_colours_an_arm_never_refuses_it(
    in_fourth: str, more: str, colours: list[list[float]] | None, tmp_path: Path
) -> None:
    file, bare = tmp_path / "arm.urdf", tmp_path / "bare.urdf"
    file.write_text(arm(in_fourth, more))
    bare.write_text(arm())
    robot = sm.load_robot(file)
    q = np.linspace(-0.5, 0.7, 7)
    np.testing.assert_array_equal(
        robot.pose(q).homogeneous, sm.load_robot(bare).pose(q).homogeneous
    )
    geometry = robot.geometry(pin.GeometryType.VISUAL)
    found = [item.meshColor.tolist() for item in geometry.geometryObjects]
    assert len(found) == (1 if colours is None else len(colours))
    if colours is not None:
        assert found == colours


@pytest.mark.parametrize(
    "inertial",
    [
        '<mass value="2"/>',
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>',
        '<mass/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>',
        '<mass value="2"/><inertia ixx="1" ixz="0" iyy="1" iyz="0" izz="1"/>',
    ],
)
def test_an_inertial_that_lacks_something_is_missed_only_by_torques(
    inertial: str, tmp_path: Path
) -> None:
    file = tmp_path / "arm.urdf"
    whole = '<mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    text = arm(f"<inertial>{inertial}</inertial>")
    file.write_text(text.replace('name="l5">', f'name="l5"><inertial>{whole}</inertial>'))
    robot = sm.load_robot(file)
    note, tool = robot.urdf.notes
    assert note.startswith("link 'l4': ")
    assert tool.startswith("the tool is '")
    path = sm.paths.Line(robot.pose(np.full(7, 0.3)), robot.pose(np.full(7, 0.31)), 1.0)
    problem = sm.Problem(robot, path, "pose", np.full(7, 0.3))
    assert note in problem.remarks
    for ask in (
        sm.costs.GravityTorque,
        sm.costs.KineticEnergy,
        sm.constraints.JointTorqueLimits(5.0).quantity,
    ):
        with pytest.raises(sm.errors.ProblemError, match=r"link 'l4': .*: add it"):
            ask(robot)


def test_folders_are_looked_at_once_however_many_meshes_there_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a package is nowhere: each folder around is then looked at."""
    for k in range(5):
        (tmp_path / "work" / f"package_{k}" / "meshes").mkdir(parents=True)
    # Nothing above is looked at.
    (tmp_path / "work" / ".git").mkdir()
    file = tmp_path / "work" / "package_0" / "arm.urdf"
    looked: list[Path] = []
    inside = urdf_text._inside

    def counted(folder: Path) -> list[Path]:
        looked.append(folder)
        return inside(folder)

    monkeypatch.setattr(urdf_text, "_inside", counted)
    packages = Packages(file)
    names = ("nowhere_description", "package_3", "elsewhere")
    found = [packages.folder(name) for name in names for _ in range(20)]
    assert found == [*[None] * 20, *[tmp_path / "work" / "package_3"] * 20, *[None] * 20]
    assert len(looked) == len(set(looked)) > 5
