"""Work objects: the frames of a program's tool poses, and the links that carry them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from selfmotion.basics import ProblemError, nearest
from selfmotion.model.path import Joined, Path, Placed
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, log3
from selfmotion.shop.controllers.program_settings import OF_PATH

# Name of the fixed frame, which is no link.
WORLD = "world"
# Smallest angle between frames above rounding [rad].
_ANGLE_TOLERANCE = 1e-6
# Largest difference between entries of equal frames [m, 1].
_FRAME_TOLERANCE = 1e-9
# Distance of a work object that must be in another unit, as a multiple of the arm's reach.
_FAR_IN_REACHES = 20.0


class WorkObject(NamedTuple):
    """A frame that poses are given in.

    Attributes
    ----------
    carrier : str
        The link that it is fixed to, or ``"world"``.
    pose : SE3
        In its carrier.
    name : str
        Name of the link, ``path``, or ``given`` for a pose that the settings give.
    """

    carrier: str
    pose: SE3
    name: str

    @classmethod
    def of(
        cls, robot: RobotModel, setting: SE3 | str | None, path_frame: SE3 | None = None
    ) -> "WorkObject":
        """Return the work object that `ProgramSettings.work_object` names.

        A link that no joint moves is expressed in the controller's base; a link that an axis moves
        carries its work object. `path_frame` is the pose of the path's frame in its link, for a
        work object at the path's frame.

        Raises
        ------
        ProblemError
            The work object is carried by a joint that moves the tool, or there is no such link.
        """
        base = base_of(robot)
        if isinstance(setting, SE3):
            _check_near(robot, setting)
            return cls(base, SE3(setting), "given")
        pose_in_link = SE3.Identity()
        if setting is None:
            if robot.reference is None:
                return cls(base, pose_in_link, base)
            link = name = robot.reference
        elif setting == OF_PATH:
            link, name = robot.reference or robot.urdf.root, OF_PATH
            pose_in_link = path_frame or pose_in_link
        else:
            link = name = setting
            _check_link(robot, link)
        if robot.carrier_of(link)[0] == 0:
            base_to_link = robot.chain_to(link, None if base == WORLD else base)
            return cls(base, base_to_link.place(np.zeros(robot.dof)) * pose_in_link, name)
        _check_not_on_tool(robot, link)
        return cls(link, pose_in_link, name)


def carrier_in_reference(robot: RobotModel, carrier: str) -> SE3 | None:
    """Return the pose of a work object's carrier in the frame of paths; None if it moves."""
    link = robot.urdf.root if carrier == WORLD else carrier
    chain = robot.chain_to(link, robot.reference)
    return None if len(chain.joints) else chain.place(np.zeros(robot.dof))


def base_of(robot: RobotModel) -> str:
    """Return the controller's base frame: the link ``base``, or the world.

    By the conventions of ROS-Industrial ``base`` is the controller's frame.
    """
    part = robot.tool.rpartition("/")[0]
    link = f"{part}/base" if part else "base"
    is_fixed_link = link in robot.urdf.links and robot.carrier_of(link)[0] == 0
    return link if is_fixed_link else WORLD


def base_rotation_note(robot: RobotModel) -> str:
    """Return a note if the controller's base is rotated from the robot's root; else ""."""
    base = base_of(robot)
    if base == WORLD:
        return ""
    pose = robot.chain_to(base).place(np.zeros(robot.dof))
    angle = float(np.linalg.norm(log3(pose.rotation)))
    if angle < _ANGLE_TOLERANCE:
        return ""
    return (
        f"work objects are given in '{base}', the controller's frame, which is rotated by "
        f"{np.degrees(angle):.4g}° from '{robot.urdf.root}', the frame of --frame; work_object "
        f"{OF_PATH} is the frame of the path"
    )


def frame_of_paths(paths: Sequence[Path]) -> SE3:
    """Return the frame that paths are given in, in the link that carries them.

    Raises
    ------
    ProblemError
        They are given in several frames.
    """
    frames = [_frame_of(path) for path in paths] or [SE3.Identity()]
    for frame in frames[1:]:
        if np.abs(frame.homogeneous - frames[0].homogeneous).max() > _FRAME_TOLERANCE:
            raise ProblemError(
                f"work_object '{OF_PATH}': paths are given in several frames, expected one; give "
                f"the name of a link, or a pose"
            )
    return frames[0]


def _frame_of(path: Path) -> SE3:
    """Return the frame that a path is given in, looking through derived paths."""
    if isinstance(path, Placed):
        return path.frame * _frame_of(path.original)
    if isinstance(path, Joined):
        return frame_of_paths(path.pieces)
    return SE3.Identity() if path.original is None else _frame_of(path.original)


def _check_near(robot: RobotModel, work: SE3) -> None:
    """Raise ProblemError for a work object that the arm is far from reaching."""
    distance = float(np.linalg.norm(work.translation))
    if distance > _FAR_IN_REACHES * robot.reach:
        raise ProblemError(
            f"{robot.name}: the work object is {distance:.4g} m away, but the arm reaches "
            f"{robot.reach:.3g} m; in millimetres? It is in m (position_mm in files)"
        )


def _check_link(robot: RobotModel, link: str) -> None:
    links = list(robot.urdf.links)
    if link not in links:
        raise ProblemError(
            f"{robot.name}: work_object '{link}' is none of its links{nearest(link, links)}; "
            f"expected one of {', '.join(links)}, '{OF_PATH}' (the frame of the path), or a pose"
        )


def _check_not_on_tool(robot: RobotModel, link: str) -> None:
    """Raise ProblemError for a link that a joint of the tool's chain moves."""
    shared = {*robot.chain_to(link).joints} & {*robot.chain_to(robot.tool).joints}
    if shared:
        joint = robot.joint_names[min(shared)]
        raise ProblemError(
            f"{robot.name}: work_object '{link}' moves with joint '{joint}', which carries the "
            f"tool as well; expected a link that stands still, or that another axis carries"
        )
