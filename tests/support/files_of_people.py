"""Small files of the kinds that people have, made for these tests."""

from pathlib import Path

ROBOT = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
_LIMIT = '<limit lower="-2.8" upper="2.8" velocity="2" effort="50"/>'


def chain_elements(height: str = "0.3", in_fourth: str = "") -> str:
    """Return seven joints about z and y in turn, 0.15 m apart, the first at a height."""
    found = ['<link name="l0"/>']
    for k in range(1, 8):
        axis, up = "0 0 1" if k % 2 else "0 1 0", height if k == 1 else "0.15"
        found.append(f'<link name="l{k}">{in_fourth if k == 4 else ""}</link>')
        found.append(
            f'<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="0 0 {up}"/><axis xyz="{axis}"/>{_LIMIT}</joint>'
        )
    return "\n".join(found)


def arm(in_fourth: str = "", more: str = "") -> str:
    """Return a URDF of these joints."""
    return f'<robot name="arm">\n{chain_elements(in_fourth=in_fourth)}\n{more}\n</robot>'


def described_package(folder: Path, name: str = "arm_description") -> Path:
    """Write a package whose arm includes its chain by $(find …); return the arm's file."""
    inside = folder / "urdf"
    inside.mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    (inside / "chain.xacro").write_text(
        f'{ROBOT}<xacro:macro name="chain">{chain_elements()}</xacro:macro></robot>'
    )
    file = inside / "arm.urdf.xacro"
    file.write_text(
        f'{ROBOT}<xacro:include filename="$(find {name})/urdf/chain.xacro"/><xacro:chain/></robot>'
    )
    return file


def with_arguments(folder: Path) -> Path:
    """Write a xacro file whose name and height are arguments; return it."""
    file = folder / "arm.urdf.xacro"
    file.write_text(with_arguments_text())
    return file


def with_arguments_text() -> str:
    """Return its text."""
    return (
        ROBOT.replace('"arm"', '"$(arg name)"')
        + '<xacro:arg name="name" default="arm"/><xacro:arg name="reach" default=""/>'
        + """<xacro:property name="lift" value="${float('$(arg reach)')}"/>"""
        + chain_elements("${lift}")
        + "</robot>"
    )


# Origins (xyz, rpy) and limits of a Kinova Gen3's joints, rounded from its maker's description.
_GEN3 = [
    ("0 0 0.15643", "3.1416 0 0", None),
    ("0 0.005375 -0.12838", "1.5708 0 0", 2.24),
    ("0 -0.21038 -0.006375", "-1.5708 0 0", None),
    ("0 0.006375 -0.21038", "1.5708 0 0", 2.57),
    ("0 -0.20843 -0.006375", "-1.5708 0 0", None),
    ("0 0.000175 -0.10593", "1.5708 0 0", 2.09),
    ("0 -0.10593 -0.000175", "-1.5708 0 0", None),
]


def reaching_arm() -> str:
    """Return an arm whose pose of the largest √det(JJᵀ) is all but stretched."""
    found = ['<robot name="arm7"><link name="l0"/>']
    for k, (xyz, rpy, limit) in enumerate(_GEN3, 1):
        kind = "continuous" if limit is None else "revolute"
        bound = "" if limit is None else f'lower="-{limit}" upper="{limit}" '
        found.append(
            f'<link name="l{k}"/><joint name="q{k}" type="{kind}"><parent link="l{k - 1}"/>'
            f'<child link="l{k}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="0 0 1"/>'
            f'<limit {bound}velocity="1.3" effort="39"/></joint>'
        )
    found.append(
        '<link name="l8"/><joint name="f" type="fixed"><parent link="l7"/><child link="l8"/>'
        '<origin xyz="0 0 -0.0615" rpy="3.1416 0 0"/></joint></robot>'
    )
    return "\n".join(found)


_MASS = '<inertial><origin xyz="{x} 0.01 0.02"/><mass value="{mass}"/><inertia ixx="0.01" ixy="0" \
ixz="0.001" iyy="0.02" iyz="0" izz="0.015"/></inertial>'
_BODY = '<collision><geometry><sphere radius="0.03"/></geometry></collision>'


def finger(
    limits: str = 'velocity="2" effort="5"',
    mimic: str = 'multiplier="-1"',
    telescope: bool = False,
) -> str:
    """Return an arm whose fourth joint mimics the third; or one that slides, by 0.4 q3 + 0.05."""
    kind = "revolute" if "lower" in limits else "continuous"
    axis = "0 1 0"
    if telescope:
        kind, axis = "prismatic", "1 0 0"
        limits, mimic = f'lower="-1" upper="1" {limits}', 'multiplier="0.4" offset="0.05"'
    joints = [
        ("j1", "revolute", "0 0 0.3", "0 0 1", ""),
        ("j2", "revolute", "0 0 0.1", "0 1 0", ""),
        ("j3", "revolute", "0.3 0 0", "0 1 0", ""),
        ("j4", kind, "0.3 0 0", axis, f'<mimic joint="j3" {mimic}/>'),
        ("j5", "revolute", "0.1 0 0", "1 0 0", ""),
    ]
    found = ['<robot name="finger"><link name="l0"/>']
    for k, (name, own, xyz, along, more) in enumerate(joints, 1):
        bound = limits if name == "j4" else 'lower="-2" upper="2" velocity="2" effort="5"'
        weight = _MASS.format(x=0.05 * k, mass=0.5 + 0.1 * k)
        found.append(
            f'<link name="l{k}">{weight}{_BODY if k in (2, 5) else ""}</link>'
            f'<joint name="{name}" type="{own}"><parent link="l{k - 1}"/><child link="l{k}"/>'
            f'<origin xyz="{xyz}"/><axis xyz="{along}"/><limit {bound}/>{more}</joint>'
        )
    found.append(
        '<link name="tip"/><joint name="f" type="fixed"><parent link="l5"/><child link="tip"/>'
        '<origin xyz="0.1 0 0"/></joint>'
        # Beside the last axis, so that all joints move it.
        '<link name="side"/><joint name="s" type="fixed"><parent link="l5"/><child link="side"/>'
        '<origin xyz="0.1 0.06 0.03"/></joint></robot>'
    )
    return "\n".join(found)


def torso() -> str:
    """Return two arms of seven joints on two joints that turn alike."""
    limit = '<limit lower="-2.9" upper="2.9" velocity="2" effort="100"/>'
    found = ['<robot name="torso"><link name="l0"/>']
    for name, link, more in (("t1", "b1", ""), ("t2", "b2", '<mimic joint="t1"/>')):
        found.append(
            f'<link name="{link}"/><joint name="{name}" type="revolute"><parent link="l0"/>'
            f'<child link="{link}"/><origin xyz="0 0 0.8"/><axis xyz="0 0 1"/>{limit}{more}</joint>'
        )
    for side, base, y in (("left", "b1", 0.25), ("right", "b2", -0.25)):
        for k in range(1, 8):
            parent, xyz = (base, f"0.1 {y} 0") if k == 1 else (f"{side}{k - 1}", "0.15 0 0")
            weight = _MASS.format(x=0.07, mass=1.0)
            found.append(
                f'<link name="{side}{k}">{weight}{_BODY if k in (3, 7) else ""}</link>'
                f'<joint name="{side}_j{k}" type="revolute"><parent link="{parent}"/>'
                f'<child link="{side}{k}"/><origin xyz="{xyz}"/>'
                f'<axis xyz="{"0 1 0" if k % 2 else "0 0 1"}"/>'
                f'<limit lower="-2.8" upper="2.8" velocity="2" effort="50"/></joint>'
            )
    return "\n".join([*found, "</robot>"])
