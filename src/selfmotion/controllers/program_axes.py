"""Which axis of a controller each joint is."""

from collections.abc import Sequence
from dataclasses import dataclass

from selfmotion.basics import Array, ProblemError
from selfmotion.controllers.program_settings import AXES, ProgramSettings
from selfmotion.robot import RobotModel
from selfmotion.task import SE3

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
            known = ", ".join(robot.joint_names)
            raise ProblemError(f"{robot.name}: axes: '{joint}' is none of its joints: {known}")
    found = [names[joint] for joint in robot.joint_names]
    twice = next((name for name in found if found.count(name) > 1), None)
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
    own = max(parts.values(), key=len, default=[])
    _check_one_arm(robot, own)
    others = [name for name in robot.joint_names if name not in own]
    if len(own) == _ROBOT + 1:
        # The arm's own seventh is the first of the others.
        others = [own[_SEVENTH], *others]
        own = own[:_SEVENTH] + own[_SEVENTH + 1 :]
    if len(own) > _ROBOT or len(others) > _ROBOT:
        raise ProblemError(
            f"{robot.name}: has {len(own)} joints that turn and {len(others)} others, expected at "
            f"most 6 and 6; say by axes= which joint is which axis (A1 to A6, E1 to E6)"
        )
    return {name: f"A{k}" for k, name in enumerate(own, 1)} | {
        name: f"E{k}" for k, name in enumerate(others, 1)
    }


def _check_one_arm(robot: RobotModel, own: Sequence[str]) -> None:
    """Refuse joints of one URDF of which only some carry the tool: a table is no wrist."""
    carriers = robot.chain_to(robot.tool, None).joints
    carrying = {robot.joint_names[k] for k in carriers.tolist()}
    beside = [name for name in own if name not in carrying]
    if beside and len(beside) < len(own):
        arm = [name for name in own if name in carrying]
        axes = {name: f"A{k}" for k, name in enumerate(arm, 1)}
        axes |= {name: f"E{k}" for k, name in enumerate(beside, 1)}
        raise ProblemError(
            f"{robot.name}: joint '{beside[0]}' does not carry the tool '{robot.tool}', as "
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
    carrier, tool = robot.carrier_of(robot.tool)
    if settings.flange is not None:
        other, place = robot.carrier_of(settings.flange)
        if other != carrier:
            raise ProblemError(
                f"{robot.name}: flange '{settings.flange}' does not move with tool '{robot.tool}'"
            )
        return place.inverse() * tool
    # In a cell, that of the part which carries the tool.
    part = robot.tool.rpartition("/")[0]
    for name in _FLANGES:
        link = f"{part}/{name}" if part else name
        if link in robot.urdf.links:
            other, place = robot.carrier_of(link)
            if other == carrier:
                return place.inverse() * tool
    return tool


def written(q: Array, axes: Sequence[Axis]) -> list[str]:
    """Return coordinates (n,) as texts: degrees with 5 digits behind the point, or mm with 4."""
    values = zip(q.tolist(), axes, strict=True)
    return [_plain(1e3 * x, 4) if axis.slides else _plain(_DEGREE * x, 5) for x, axis in values]


def _plain(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


_DEGREE = 57.29577951308232
