"""The axis of a controller that each joint is, and the tool on its flange."""

from collections.abc import Sequence
from dataclasses import dataclass

from selfmotion.basics import (
    Array,
    ProblemError,
)
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shop.controllers.program_settings import AXES, ProgramSettings

# Of an arm with seven joints the third is the one that six-axis controllers count apart.
_SEVENTH = 2
_ROBOT = 6
# By the conventions of ROS-Industrial `tool0` is the tool that is all zeros.
_FLANGES = ("tool0", "flange")


@dataclass(frozen=True)
class Axis:
    """An axis of a controller, and the joint that it is.

    Attributes
    ----------
    name : str
        "A1" to "A6", "E1" to "E6".
    joint : str
    slides : bool
        Whether its coordinate is in mm, not degrees.
    """

    name: str
    joint: str
    slides: bool


def axes_of(robot: RobotModel, settings: ProgramSettings) -> tuple[Axis, ...]:
    """Return the axes in the order of the robot's joints.

    Raises
    ------
    ProblemError
        Joints and axes do not fit; a mapping that would is asked for.
    """
    names = dict(settings.axes or {}) or _usual(robot)
    for joint in robot.joint_names:
        if joint not in names:
            raise ProblemError(f"{robot.name}: axes: joint '{joint}' has no axis; give all joints")
    for joint in names:
        if joint not in robot.joint_names:
            joints = ", ".join(robot.joint_names)
            raise ProblemError(f"{robot.name}: axes: '{joint}' is none of its joints: {joints}")
    axis_names = [names[joint] for joint in robot.joint_names]
    twice = next((name for name in axis_names if axis_names.count(name) > 1), None)
    if twice is not None:
        raise ProblemError(f"{robot.name}: axes: two joints are axis {twice}; give each its own")
    axes = tuple(
        Axis(names[joint], joint, robot.is_prismatic(joint)) for joint in robot.joint_names
    )
    slide = next((axis for axis in axes if axis.slides and axis.name.startswith("A")), None)
    if slide is not None:
        raise ProblemError(
            f"{robot.name}: axes: joint '{slide.joint}' slides, and is axis {slide.name}, which "
            f"turns; expected E1 to E6"
        )
    return axes


def _usual(robot: RobotModel) -> dict[str, str]:
    turning = [name for name in robot.joint_names if not robot.is_prismatic(name)]
    parts: dict[str, list[str]] = {}
    for name in turning:
        parts.setdefault(name.rpartition("/")[0], []).append(name)
    arm_joints = max(parts.values(), key=len, default=[])
    _check_one_arm(robot, arm_joints)
    others = [name for name in robot.joint_names if name not in arm_joints]
    if len(arm_joints) == _ROBOT + 1:
        # The arm's own seventh is the first of the others.
        others = [arm_joints[_SEVENTH], *others]
        arm_joints = arm_joints[:_SEVENTH] + arm_joints[_SEVENTH + 1 :]
    if len(arm_joints) > _ROBOT or len(others) > _ROBOT:
        raise ProblemError(
            f"{robot.name}: has {len(arm_joints)} joints that turn and {len(others)} others, "
            f"expected at most 6 and 6; say by axes= which joint is which axis (A1 to A6, E1 to E6)"
        )
    return {name: f"A{k}" for k, name in enumerate(arm_joints, 1)} | {
        name: f"E{k}" for k, name in enumerate(others, 1)
    }


def _check_one_arm(robot: RobotModel, arm_joints: Sequence[str]) -> None:
    """Refuse joints of one URDF of which only some carry the tool: a table is no wrist."""
    carriers = robot.chain_to(robot.tool, None).joints
    carrying = {robot.joint_names[k] for k in carriers.tolist()}
    not_carrying = [name for name in arm_joints if name not in carrying]
    if not_carrying and len(not_carrying) < len(arm_joints):
        arm = [name for name in arm_joints if name in carrying]
        axes = {name: f"A{k}" for k, name in enumerate(arm, 1)}
        axes |= {name: f"E{k}" for k, name in enumerate(not_carrying, 1)}
        raise ProblemError(
            f"{robot.name}: joint '{not_carrying[0]}' does not carry the tool '{robot.tool}', as "
            f"{', '.join(arm)} do: say by axes= which joint is which axis of the controller, for "
            f"example {axes}"
        )


def in_order(axes: Sequence[Axis]) -> list[int]:
    """Return the joints' numbers in the order of their axes."""
    return sorted(range(len(axes)), key=lambda k: AXES.index(axes[k].name))


def tool_from_flange(robot: RobotModel, settings: ProgramSettings) -> SE3:
    """Return the tool's pose in the controller's flange.

    Raises
    ------
    ProblemError
        The flange rides on another link than the tool.
    RobotError
        There is no such link.
    """
    link, tool = flange_of(robot, settings), robot.carrier_of(robot.tool)[1]
    return robot.carrier_of(link)[1].inverse() * tool if link else tool


def flange_of(robot: RobotModel, settings: ProgramSettings) -> str:
    """Return the link that is the controller's flange; empty for that which carries the tool.

    Raises
    ------
    ProblemError
        The flange rides on another link than the tool.
    RobotError
        There is no such link.
    """
    carrier = robot.carrier_of(robot.tool)[0]
    if settings.flange is not None:
        if robot.carrier_of(settings.flange)[0] != carrier:
            raise ProblemError(
                f"{robot.name}: flange '{settings.flange}' does not move with tool '{robot.tool}'"
            )
        return settings.flange
    # In a cell, that of the part which carries the tool.
    part = robot.tool.rpartition("/")[0]
    for name in _FLANGES:
        link = f"{part}/{name}" if part else name
        if link in robot.urdf.links and robot.carrier_of(link)[0] == carrier:
            return link
    return ""


def written(q: Array, axes: Sequence[Axis]) -> list[str]:
    """Return coordinates (n,) as texts: degrees with 5 digits behind the point, or mm with 4."""
    values = zip(q.tolist(), axes, strict=True)
    return [_plain(1e3 * x, 4) if axis.slides else _plain(_DEGREE * x, 5) for x, axis in values]


def _plain(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


_DEGREE = 57.29577951308232
