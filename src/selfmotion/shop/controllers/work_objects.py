"""Work objects: the frames that controllers express tool poses in, and the links they ride on."""

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
# Largest difference of equal frames [m, parts of quaternions].
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
    """

    carrier: str
    pose: SE3
    name: str

    @classmethod
    def of(
        cls, robot: RobotModel, setting: SE3 | str | None, path_frame: SE3 | None = None
    ) -> "WorkObject":
        """Return what `ProgramSettings.work_object` names.

        A link that no joint moves is as good as the controller's base, in which the work object
        then is; one that an axis moves carries it. `path_frame` is the pose of the path's frame in
        its carrier link, for a work object that is the frame of the path.

        Raises
        ------
        ProblemError
            The work object rides on what carries the tool, or there is no such link.
        """
        base = base_of(robot)
        if isinstance(setting, SE3):
            _check_near(robot, setting)
            return cls(base, SE3(setting), "given")
        inside = SE3.Identity()
        if setting is None:
            if robot.reference is None:
                return cls(base, inside, base)
            link = name = robot.reference
        elif setting == OF_PATH:
            link, name = robot.reference or robot.urdf.root, OF_PATH
            inside = path_frame or inside
        else:
            link = name = setting
            _check_link(robot, link)
        if robot.carrier_of(link)[0] == 0:
            to_link = robot.chain_to(link, None if base == WORLD else base)
            return cls(base, to_link.place(np.zeros(robot.dof)) * inside, name)
        _check_not_on_tool(robot, link)
        return cls(link, inside, name)


def carrier_in_reference(robot: RobotModel, carrier: str) -> SE3 | None:
    """Return the pose of a work object's carrier in the frame of paths; None if it moves."""
    link = robot.urdf.root if carrier == WORLD else carrier
    between = robot.chain_to(link, robot.reference)
    return None if len(between.joints) else between.place(np.zeros(robot.dof))


def base_of(robot: RobotModel) -> str:
    """Return the controller's base frame: the link ``base``, or the world.

    By the conventions of ROS-Industrial ``base`` is the controller's frame.
    """
    part = robot.tool.rpartition("/")[0]
    link = f"{part}/base" if part else "base"
    known = link in robot.urdf.links and robot.carrier_of(link)[0] == 0
    return link if known else WORLD


def turned_base(robot: RobotModel) -> str:
    """Return how the controller's base is rotated from the root, in words; "" if it is not."""
    base = base_of(robot)
    if base == WORLD:
        return ""
    pose = robot.chain_to(base).place(np.zeros(robot.dof))
    angle = float(np.linalg.norm(log3(pose.rotation)))
    if angle < _ANGLE_TOLERANCE:
        return ""
    return (
        f"work objects are counted in '{base}', the controller's frame, which is turned by "
        f"{np.degrees(angle):.4g}° from '{robot.urdf.root}', in which --frame counts; work_object "
        f"{OF_PATH} is the frame of the path"
    )


def frame_of_paths(paths: Sequence[Path]) -> SE3:
    """Return the frame that paths are given in, in the link that they ride on.

    Raises
    ------
    ProblemError
        They are given in several frames.
    """
    frames = [_placed(path) for path in paths] or [SE3.Identity()]
    for frame in frames[1:]:
        if np.abs(frame.homogeneous - frames[0].homogeneous).max() > _FRAME_TOLERANCE:
            raise ProblemError(
                f"work_object '{OF_PATH}': paths are given in several frames, expected one; give "
                f"the name of a link, or a pose"
            )
    return frames[0]


def _placed(path: Path) -> SE3:
    """Return the frame that a path is given in, through all paths that are made of another one."""
    if isinstance(path, Placed):
        return path.frame * _placed(path.original)
    if isinstance(path, Joined):
        return frame_of_paths(path.pieces)
    inner = getattr(path, "original", None)
    return SE3.Identity() if inner is None else _placed(inner)


def _check_near(robot: RobotModel, work: SE3) -> None:
    """Raise ProblemError for a work object that the arm is far from reaching."""
    far = float(np.linalg.norm(work.translation))
    if far > _FAR_IN_REACHES * robot.reach:
        raise ProblemError(
            f"{robot.name}: the work object is {far:.4g} m away, but the arm reaches "
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
    """Refuse a link that moves with the arm, or with what carries it."""
    shared = {*robot.chain_to(link).joints} & {*robot.chain_to(robot.tool).joints}
    if shared:
        joint = robot.joint_names[min(shared)]
        raise ProblemError(
            f"{robot.name}: work_object '{link}' moves with joint '{joint}', which carries the "
            f"tool as well; expected a link that stands still, or that another axis carries"
        )
