"""Arms that are loaded, and those that are refused."""

import re
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from support.arms import robot_named

PLANAR = Path(sm.load_robot("planar_3r").urdf.source)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', r"joint 'joint1' has axis"),
        ('lower="-6.283185307179586"', 'lower="7"', r"joint 'joint1' has reversed limits"),
        ('<mass value="4"/>', '<mass value="-4"/>', r"link 'link1' has a negative mass"),
        ('<child link="link2"/>', '<child link="link1"/>', r"link 'link1' has two parents"),
        ('<child link="link3"/>', '<child link="link9"/>', r"link 'link9', which does not exist"),
        ('type="revolute"', 'type="hinge"', r"joint 'joint1' has type 'hinge'"),
        ('name="joint2"', 'name="joint1"', r"joint name 'joint1' is used more than once"),
        ("</robot>", "", r"not well-formed XML"),
        ("robot", "model", r"expected <robot>"),
    ],
)
def test_broken_urdfs_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = PLANAR.read_text()
    assert old in text
    file = tmp_path / "broken.urdf"
    file.write_text(text.replace(old, new) if old == "robot" else text.replace(old, new, 1))
    with pytest.raises(sm.errors.RobotError, match=message):
        sm.load_robot(file)


@pytest.mark.parametrize("name", sm.NAMED_ARMS)
def test_named_arms_are_called_by_their_names(name: str) -> None:
    """Also where their URDFs call them otherwise."""
    assert robot_named(name).name == name


def test_other_arms_are_called_as_their_urdfs_say(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(PLANAR.read_text().replace('name="planar_3r"', 'name="mine"', 1))
    assert sm.load_robot(file).name == "mine"


def test_a_sound_copy_is_accepted(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    text = PLANAR.read_text()
    file.write_text(text)
    assert sm.load_robot(file).tool == "tool"
    # What makers add to the base, which no joint moves, is no other end.
    root = re.search(r'<link name="(\w+)"', text)[1]
    file.write_text(
        text.replace(
            "</robot>",
            f'<link name="mark"/><joint name="m" type="fixed"><parent link="{root}"/>'
            f'<child link="mark"/></joint></robot>',
        )
    )
    assert sm.load_robot(file).tool == "tool"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: sm.load_robot("pandaa"), "unknown robot 'pandaa'"),
        (lambda: sm.load_robot("nowhere.urdf"), "no such URDF file"),
        (lambda: sm.load_robot("n" * 300 + ".urdf"), "no such URDF file"),
        (lambda: sm.load_robot("panda", tool="hand"), "no link 'hand'"),
        (lambda: sm.load_robot("panda", lock={"joint9": 0.0}), "'joint9', which is not movable"),
        (
            lambda: sm.load_robot("panda", lock={"panda_joint1": np.nan}),
            r"lock\['panda_joint1'\] is nan",
        ),
        (lambda: sm.load_robot("panda").pose([0.0] * 6), r"shape \(6,\), expected \(7,\)"),
        (lambda: sm.load_robot("panda").pose([np.nan] * 7), "'panda_joint1' is nan"),
        (lambda: sm.load_robot(Path(sm.load_robot("panda").urdf.source)), "3 end links"),
    ],
)
def test_bad_requests_are_refused(call, message: str) -> None:
    with pytest.raises(sm.errors.RobotError, match=message):
        call()
