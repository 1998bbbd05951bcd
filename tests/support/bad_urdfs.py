"""URDFs that are no arms: each is a sound one with one thing broken."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import selfmotion as sm
from support.bad_rows import Row

SOUND = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><mass value="2"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<collision><geometry><box size="0.1 0.1 0.4"/></geometry></collision>
<visual><geometry><box size="0.1 0.1 0.4"/></geometry></visual></link>
<link name="lower"/>
<link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="5"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
<origin xyz="0.5 0 0" rpy="0 0 0"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" velocity="1" effort="5"/></joint>
<joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/>
<origin xyz="0.4 0 0" rpy="0 0 0"/></joint>
</robot>
"""

_SHOULDER = '<limit lower="-2" upper="2" velocity="1" effort="5"/>'
_AXIS = '<axis xyz="0 0 1"/>'
_ORIGIN = '<origin xyz="0 0 0.3" rpy="0 0 0"/>'
_MASS = '<mass value="2"/>'
_INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
_COLLISION = '<collision><geometry><box size="0.1 0.1 0.4"/></geometry></collision>'
_TYPE = 'name="shoulder" type="revolute"'
_END = "</robot>"
_FIXED = '<joint name="{}" type="fixed"><parent link="{}"/><child link="{}"/></joint></robot>'


def _limit(**changes: str | None) -> str:
    values = {"lower": "-2", "upper": "2", "velocity": "1", "effort": "5"} | changes
    return "<limit " + " ".join(f'{k}="{v}"' for k, v in values.items() if v is not None) + "/>"


# What is broken, the text that is replaced, and by what.
EDITS: list[tuple[str, str, str]] = [
    ("a limit without lower", _SHOULDER, _limit(lower=None)),
    ("a limit without upper", _SHOULDER, _limit(upper=None)),
    ("a revolute joint without a limit", _SHOULDER, ""),
    ("a limit without attributes", _SHOULDER, "<limit/>"),
    ("two limits", _SHOULDER, _SHOULDER + _limit(lower="-1")),
    *(
        (f'{key}="{value}" in a limit', _SHOULDER, _limit(**{key: value}))
        for key in ("lower", "upper", "velocity", "effort")
        for value in ("inf", "nan", "", " ", "2,5", "1 2", "fast", "1_0", "0x1")
    ),
    ("reversed limits", _SHOULDER, _limit(lower="2", upper="-2")),
    ("a negative velocity limit", _SHOULDER, _limit(velocity="-1")),
    ("a negative effort limit", _SHOULDER, _limit(effort="-1")),
    ("limits of 1e300", _SHOULDER, _limit(lower="-1e300", upper="1e300")),
    ("a zero axis", _AXIS, '<axis xyz="0 0 0"/>'),
    ("an axis of two numbers", _AXIS, '<axis xyz="0 1"/>'),
    ("an axis of four numbers", _AXIS, '<axis xyz="0 0 1 0"/>'),
    ("an axis with NaN", _AXIS, '<axis xyz="0 nan 1"/>'),
    ("an axis with infinity", _AXIS, '<axis xyz="0 inf 1"/>'),
    ("an axis with commas", _AXIS, '<axis xyz="0, 0, 1"/>'),
    ("an axis of words", _AXIS, '<axis xyz="z"/>'),
    ("an empty axis", _AXIS, '<axis xyz=""/>'),
    ("an axis without xyz", _AXIS, "<axis/>"),
    ("two axes", _AXIS, _AXIS + '<axis xyz="0 1 0"/>'),
    ("an origin of two numbers", _ORIGIN, '<origin xyz="0 0.3" rpy="0 0 0"/>'),
    ("an origin with NaN", _ORIGIN, '<origin xyz="0 0 nan" rpy="0 0 0"/>'),
    ("an origin with infinity", _ORIGIN, '<origin xyz="0 0 inf" rpy="0 0 0"/>'),
    ("an origin with commas", _ORIGIN, '<origin xyz="0,0,0.3" rpy="0 0 0"/>'),
    ("an origin with units", _ORIGIN, '<origin xyz="0 0 0.3m" rpy="0 0 0"/>'),
    ("an empty origin", _ORIGIN, '<origin xyz="" rpy="0 0 0"/>'),
    ("an rpy of two numbers", _ORIGIN, '<origin xyz="0 0 0.3" rpy="0 0"/>'),
    ("an rpy with NaN", _ORIGIN, '<origin xyz="0 0 0.3" rpy="0 nan 0"/>'),
    ("two origins", _ORIGIN, _ORIGIN + _ORIGIN),
    ("an origin far away", _ORIGIN, '<origin xyz="0 0 1e300" rpy="0 0 0"/>'),
    ("an unknown joint type", _TYPE, 'name="shoulder" type="hinge"'),
    ("a joint type in capitals", _TYPE, 'name="shoulder" type="Revolute"'),
    ("an empty joint type", _TYPE, 'name="shoulder" type=""'),
    ("a joint without a type", _TYPE, 'name="shoulder"'),
    ("a joint without a name", _TYPE, 'type="revolute"'),
    ("a joint with an empty name", _TYPE, 'name="" type="revolute"'),
    ("a floating joint", _TYPE, 'name="shoulder" type="floating"'),
    ("a spherical joint", _TYPE, 'name="shoulder" type="spherical"'),
    ("a joint without a parent", '<parent link="base"/><child', "<child"),
    ("a joint without a child", '<child link="upper"/>', ""),
    ("a parent without a link", '<parent link="base"/>', "<parent/>"),
    ("an empty child", '<child link="upper"/>', '<child link=""/>'),
    ("two parents in a joint", '<parent link="base"/>', '<parent link="base"/><parent link="x"/>'),
    ("an unknown parent", '<parent link="base"/>', '<parent link="bse"/>'),
    ("an unknown child", '<child link="upper"/>', '<child link="uper"/>'),
    ("a joint from a link to itself", '<parent link="base"/>', '<parent link="upper"/>'),
    ("two joints of one name", 'name="elbow"', 'name="shoulder"'),
    ("two links of one name", '<link name="lower"/>', '<link name="lower"/><link name="lower"/>'),
    ("a link without a name", '<link name="lower"/>', '<link name="lower"/><link/>'),
    ("a link with an empty name", '<link name="lower"/>', '<link name="lower"/><link name=""/>'),
    ("two roots", _END, '<link name="island"/></robot>'),
    ("a link that has two parents", _END, _FIXED.format("second", "base", "tool")),
    ("a loop without a root", _END, _FIXED.format("back", "tool", "base")),
    (
        "a loop beside the arm",
        _END,
        '<link name="a"/><link name="b"/>'
        + _FIXED.format("ab", "a", "b").removesuffix(_END)
        + _FIXED.format("ba", "b", "a"),
    ),
    ("a joint called universe", 'name="shoulder"', 'name="universe"'),
    ("a negative mass", _MASS, '<mass value="-2"/>'),
    ("a mass that is NaN", _MASS, '<mass value="nan"/>'),
    ("an infinite mass", _MASS, '<mass value="inf"/>'),
    ("an empty mass", _MASS, '<mass value=""/>'),
    ("a mass with a unit", _MASS, '<mass value="2 kg"/>'),
    ("an inertia with NaN", _INERTIA, _INERTIA.replace('ixx="1"', 'ixx="nan"')),
    ("an inertia with words", _INERTIA, _INERTIA.replace('ixx="1"', 'ixx="one"')),
    ("a negative inertia", _INERTIA, _INERTIA.replace('ixx="1"', 'ixx="-1"')),
    ("a collision without geometry", _COLLISION, "<collision/>"),
    ("a capsule as collision", _COLLISION, _COLLISION.replace("box", "capsule")),
    ("a collision box of two sizes", _COLLISION, _COLLISION.replace("0.1 0.1 0.4", "0.1 0.4")),
    ("a collision box of size 0", _COLLISION, _COLLISION.replace("0.1 0.1 0.4", "0 0.1 0.4")),
    ("a collision box with NaN", _COLLISION, _COLLISION.replace("0.1 0.1 0.4", "nan 1 1")),
    (
        "a collision mesh without a file",
        _COLLISION,
        "<collision><geometry><mesh/></geometry></collision>",
    ),
    (
        "a collision mesh of scale 0",
        _COLLISION,
        '<collision><geometry><mesh filename="a.stl" scale="0 1 1"/></geometry></collision>',
    ),
    ("a collision outside of the links", _END, _COLLISION + _END),
    ("a mimic of no joint", _SHOULDER, '<mimic joint="wrist"/>' + _SHOULDER),
    ("a mimic of itself", _SHOULDER, '<mimic joint="shoulder"/>' + _SHOULDER),
    ("a mimic without a joint", _SHOULDER, "<mimic/>" + _SHOULDER),
    (
        "a mimic whose limits leave no position",
        _SHOULDER,
        '<mimic joint="elbow" offset="9"/>' + _SHOULDER,
    ),
    (
        "a mimic with a multiplier of NaN",
        _SHOULDER,
        '<mimic joint="elbow" multiplier="nan"/>' + _SHOULDER,
    ),
    (
        "a mimic with a word for offset",
        _SHOULDER,
        '<mimic joint="elbow" offset="some"/>' + _SHOULDER,
    ),
    ("no end tag", _END, ""),
    ("two root elements", _END, "</robot><robot/>"),
    ("an unescaped &", 'name="arm"', 'name="arm & hand"'),
    ("a xacro macro", _END, '<xacro:include filename="a"/></robot>'),
    ("a xacro expression left over", '"0 0 0.3"', '"0 0 ${height}"'),
    ("a xacro argument left over", 'name="arm"', 'name="$(arg name)"'),
    ("no joint", SOUND[SOUND.index("<joint") :], "</robot>"),
    ("only fixed joints", 'type="revolute"', 'type="fixed"'),
    ("several ends and no tool", _END, '<link name="eye"/>' + _FIXED.format("n", "lower", "eye")),
]

# Files that are no URDF at all.
TEXTS: list[tuple[str, bytes]] = [
    ("an empty file", b""),
    ("a file of spaces", b"  \n "),
    ("a binary file", b"\x00\xff\xfe\x80" * 20),
    ("a file in Latin-1", SOUND.replace('"arm"', '"möbel"').encode("latin-1")),
    ("an SDF file", b'<sdf version="1.7"><model name="a"/></sdf>'),
    ("a MuJoCo file", b"<mujoco><worldbody/></mujoco>"),
    ("an HTML page (of a failed download)", b"<!DOCTYPE html><html><body>404</body></html>"),
    ("JSON", b'{"robot": 1}'),
    ("a Git LFS pointer", b"version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 2\n"),
    ("a robot without links", b'<robot name="a"/>'),
    ("a single link", b'<robot name="a"><link name="base"/></robot>'),
]


def rows() -> list[Row]:
    """Return a row for each."""
    found = []
    for what, old, new in EDITS:
        if old not in SOUND:
            raise ValueError(f"'{old}' is not in the sound URDF")
        many = -1 if what == "only fixed joints" else 1
        found.append(Row("URDF files", what, _loading(SOUND.replace(old, new, many).encode())))
    return found + [Row("URDF files", what, _loading(text)) for what, text in TEXTS]


def _loading(text: bytes, **options: Any) -> Callable[[Path], object]:
    def load(folder: Path) -> object:
        file = folder / "arm.urdf"
        file.write_bytes(text)
        return sm.load_robot(file, **options)

    return load


def _sound(what: str, **options: Any) -> Row:
    return Row("Loading an arm", what, _loading(SOUND.encode(), **options))


def _named(what: str, name: Any, **options: Any) -> Row:
    return Row("Loading an arm", what, lambda _: sm.load_robot(name, **options))


def loading_rows() -> list[Row]:
    """Return a row for each bad argument of `load_robot`."""
    skewed, nan = np.diag([1.0, 2.0, 1.0, 1.0]), np.eye(4)
    nan[0, 3] = np.nan

    def box(name: str, frame: str | None = None) -> sm.obstacles.Box:
        return sm.obstacles.Box(name, [0.0, 0.0, 0.0], [0.1, 0.1, 0.1], frame=frame)

    return [
        _named("load_robot('pandaa')", "pandaa"),
        _named("load_robot('Panda')", "Panda"),
        _named("load_robot('')", ""),
        _named("load_robot(None)", None),
        _named("load_robot(7)", 7),
        _named("load_robot('nowhere.urdf')", "nowhere.urdf"),
        _named("load_robot('<robot>')", "<robot>"),
        _named("load_robot('<robot/>')", "<robot/>"),
        _named("load_robot(pinocchio.Model())", pin.Model()),
        _named("load_robot(pinocchio.buildSampleModelHumanoid())", pin.buildSampleModelHumanoid()),
        _named("load_robot('nowhere.xacro')", "nowhere.xacro"),
        _named("load_robot('arm.sdf')", "arm.sdf"),
        _named("load_robot('https://host/arm.urdf')", "https://host/arm.urdf"),
        _named("load_robot('panda', tool='panda_hand_tpc')", "panda", tool="panda_hand_tpc"),
        _named("load_robot('panda', tool='world')", "panda", tool="world"),
        _named("load_robot('panda', calibration=3)", "panda", calibration=3),
        _named("load_robot('panda', calibration='no.yaml')", "panda", calibration="no.yaml"),
        _named("load_robot('panda', tool=3)", "panda", tool=3),
        _named("load_robot('panda', tool='panda_link0')", "panda", tool="panda_link0"),
        _sound("tool='tol'", tool="tol"),
        _sound("tool='Tool'", tool="Tool"),
        _sound("tool='elbow', a joint", tool="elbow"),
        _sound("tool='base', which no joint moves", tool="base"),
        _sound("lock={'elbo': 0}", lock={"elbo": 0.0}),
        _sound("lock={'flange': 0}, a fixed joint", lock={"flange": 0.0}),
        _sound("lock={'elbow': nan}", lock={"elbow": np.nan}),
        _sound("lock={'elbow': 'bent'}", lock={"elbow": "bent"}),
        _sound("lock={'elbow': None}", lock={"elbow": None}),
        _sound("lock={'elbow': [0, 1]}", lock={"elbow": [0, 1]}),
        _sound("lock={'elbow': 90}, in degrees", lock={"elbow": 90.0}),
        _sound("lock=['elbow']", lock=["elbow"]),
        _sound("lock='elbow'", lock="elbow"),
        _sound("lock= of all joints", lock={"elbow": 0.0, "shoulder": 0.0}),
        _sound("base=(0, 0, 1)", base=(0, 0, 1)),
        _sound("base='here'", base="here"),
        _sound("base= of shape (3, 4)", base=np.eye(4)[:3]),
        _sound("base= with a skewed rotation", base=skewed),
        _sound("base= with NaN", base=nan),
        _sound("bodies='torch'", bodies="torch"),
        _sound("bodies=[Box] (the class)", bodies=[sm.obstacles.Box]),
        _sound("bodies= on a link that is none", bodies=[box("gun", "uper")]),
        _sound("bodies= with the name of a link", bodies=[box("base")]),
        _sound("tool_offset=0.1", tool_offset=0.1),
        _sound("tool_offset= of shape (4,)", tool_offset=np.zeros(4)),
        _sound("tool_offset= with a mirror", tool_offset=np.diag([1.0, 1.0, -1.0, 1.0])),
        _sound("tool_offset= with NaN", tool_offset=nan),
        _sound("arguments= for a URDF", arguments={"a": "1"}),
        _sound("packages= that is no folder", packages="nowhere"),
        _sound("packages=7", packages=7),
        *(Row("Loading an arm", what, _expanding(text, given)) for what, text, given in _XACROS),
    ]


_NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
_XACROS: list[tuple[str, str, Any]] = [
    ("a xacro file that is empty", "", {}),
    ("a xacro file without end", f'<robot name="a" {_NAMESPACE}>', {}),
    (
        "a xacro property that is not set",
        f'<robot name="a" {_NAMESPACE}><link name="${{who}}"/></robot>',
        {},
    ),
    (
        "a xacro argument that is not given",
        f'<robot name="a" {_NAMESPACE}><xacro:arg name="who"/><link name="$(arg who)"/></robot>',
        {},
    ),
    (
        "a xacro include that is not there",
        f'<robot name="a" {_NAMESPACE}><xacro:include filename="no.xacro"/></robot>',
        {},
    ),
    (
        "a xacro division by 0",
        f'<robot name="a" {_NAMESPACE}><link name="${{1/0}}"/></robot>',
        {},
    ),
    (
        "a xacro macro that is not defined",
        f'<robot name="a" {_NAMESPACE}><xacro:arm/></robot>',
        {},
    ),
    ("a xacro argument that it does not have", f'<robot name="a" {_NAMESPACE}/>', {"side": "left"}),
    (
        "a xacro that finds a package that is not there",
        f'<robot name="a" {_NAMESPACE}><xacro:include filename="$(find nowhere)/a"/></robot>',
        {},
    ),
    ("xacro arguments that are no texts", SOUND, {"side": ["left"]}),
    ("xacro arguments that are a list", SOUND, ["left"]),
]


def _expanding(text: str, arguments: Any) -> Callable[[Path], object]:
    def load(folder: Path) -> object:
        file = folder / "arm.xacro"
        file.write_text(text)
        return sm.load_robot(file, arguments=arguments)

    return load
