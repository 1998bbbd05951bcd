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
    file.write_text(
        ROBOT.replace('"arm"', '"$(arg name)"')
        + '<xacro:arg name="name" default="arm"/><xacro:arg name="reach" default=""/>'
        + """<xacro:property name="lift" value="${float('$(arg reach)')}"/>"""
        + chain_elements("${lift}")
        + "</robot>"
    )
    return file


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
