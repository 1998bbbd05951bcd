"""An arm of three slides and a turn: its tool is where its joints are."""

from collections.abc import Sequence
from pathlib import Path

import selfmotion as sm

SLIDES = ("prismatic", "prismatic", "prismatic", "revolute")
WIDE = 'lower="-9" upper="9" velocity="99" effort="999"'
_AXES = ("1 0 0", "0 1 0", "0 0 1", "0 0 1")
_BODY = (
    '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    "</inertial>"
)


def gantry(
    folder: Path, limits: Sequence[str] = (WIDE,) * 4, kinds: Sequence[str] = SLIDES
) -> sm.RobotModel:
    """Return the arm, with attributes of joint limits as they are given."""
    parts = ['<robot name="gantry"><link name="world"/>']
    for k, (kind, axis, limit) in enumerate(zip(kinds, _AXES, limits, strict=True)):
        parent = f"l{k - 1}" if k else "world"
        parts.append(
            f'<link name="l{k}">{_BODY}</link><joint name="j{k}" type="{kind}"><parent '
            f'link="{parent}"/><child link="l{k}"/><axis xyz="{axis}"/><limit {limit}/></joint>'
        )
    (folder / "gantry.urdf").write_text("".join([*parts, "</robot>"]))
    return sm.load_robot(folder / "gantry.urdf", "l3")
