"""Arms from URDF files or text, from Pinocchio's models, or by name."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import RobotError, is_folder, nearest, read_only, shown
from selfmotion.model.robot.building import build_robot
from selfmotion.model.robot.calibration import calibrated_urdf
from selfmotion.model.robot.cells import composed
from selfmotion.model.robot.model import RobotModel
from selfmotion.model.robot.mounting import (
    CarriedBody,
    with_base,
    with_bodies,
    with_tool_offset,
)
from selfmotion.model.robot.named import NAMED_ARMS, NAMED_PARTS, published, read_named
from selfmotion.model.robot.pinocchio_model import urdf_text_of
from selfmotion.model.robot.urdf import Urdf, UrdfPart, read_urdf, urdf_of_file
from selfmotion.model.robot.urdf_text import Packages
from selfmotion.model.robot.urdf_unsaid import units_unsaid
from selfmotion.model.robot.xacro_text import expand, is_xacro
from selfmotion.model.task import as_pose

# Name of a URDF's text in messages.
_TEXT = "the URDF text"


def load_robot(
    robot: str | Path | pin.Model | Mapping[str, str | Path | pin.Model],
    tool: str | Sequence[str] | None = None,
    lock: Mapping[str, float] | None = None,
    *,
    geometry: pin.GeometryModel | None = None,
    reference: str | None = None,
    base: pin.SE3 | npt.ArrayLike | Mapping[str, pin.SE3 | npt.ArrayLike] | None = None,
    on: Mapping[str, str] | None = None,
    tool_offset: pin.SE3 | npt.ArrayLike | None = None,
    bodies: Sequence[CarriedBody] = (),
    arguments: Mapping[str, Any] | None = None,
    packages: str | Path | Sequence[str | Path] = (),
    calibration: str | Path | Mapping[str, str | Path] | None = None,
) -> RobotModel:
    """Load an arm, or a cell of several robots.

    Parameters
    ----------
    robot : str, Path, pinocchio.Model or dict
        A name from `NAMED_ARMS` (``"panda"``, ``"planar_3r"``, …), ``"positioner"``, or the path of
        a ``.urdf`` or ``.xacro`` file; the text of a URDF, which begins with ``<``, such as ROS's
        ``robot_description``; or a model of Pinocchio's, which brings kinematics, limits and
        inertias, but no visuals, and no bodies without `geometry`.
        Or several of these by name, as one tree: links and joints of part ``"arm"`` are called
        ``arm/NAME`` then.
    tool : str or sequence of str, optional
        Tool frame (a link), or several: the first is the one that paths are for where nothing else
        is said. Default: the named arm's usual one; for a file, its only leaf link; of several
        robots, that of the first.
    lock : dict, optional
        Joints to hold, with their coordinate [rad or m]. Joints that move no tool relative to the
        reference are held anyway, at 0 or the nearest limit unless given here.
    geometry : pinocchio.GeometryModel, optional
        Of a ``pinocchio.Model``: its collision bodies (boxes, spheres, cylinders, meshes of files).
        Without, there is no check of self-collision.
    reference : str, optional
        The link in whose frame poses, twists and paths are given: a part that a table turns, or
        that another hand holds. By default the world.
    base : SE3 or (4, 4), optional
        Pose of the URDF's root link in the world; of several robots a dict, by part.
    on : dict, optional
        Of several robots: part → link of another part (``rail/carriage``) that it stands on, `base`
        being its pose there.
    tool_offset : SE3 or (4, 4), optional
        Pose of the frame that follows the path in that of `tool`: a pen in a gripper.
    bodies : sequence of Obstacle, optional
        Carried bodies: a torch, a camera. Their poses are, as `tool_offset` is, in the frame of
        `tool`, or in that of the link that their `frame=` names. They become links of the arm,
        without masses; shapes of one's own cannot.
    arguments : dict, optional
        Of a xacro file; of several robots a dict of these, by part.
    packages : path or sequence of path, optional
        Folders that are searched first for packages (``package://``, ``$(find …)``). Without, they
        are found in folders above the file and three levels below these, and by
        ``AMENT_PREFIX_PATH`` and ``ROS_PACKAGE_PATH``. Text is as a file in the working folder.
    calibration : path, optional
        File that says where the joints of this very arm are: Universal Robots' kinematics
        (``.yaml``) or ``calibration.conf``; or a ``.yaml`` or ``.toml`` file with ``joints``, for
        each its ``position`` and ``rpy`` in its parent link, and ``offsets``, the position of each
        at its nominal zero [rad or m]. Of several robots a dict, by part.

    Returns
    -------
    RobotModel

    Raises
    ------
    RobotError
        The name, file, frame or joint does not exist or cannot be used.

    Examples
    --------
    >>> load_robot("panda").dof
    7
    """
    if not isinstance(robot, str | Path | pin.Model | Mapping):
        raise RobotError(
            f"robot is {shown(robot)}, expected a name, the path of a file, the text of a URDF or "
            f"a pinocchio.Model"
        )
    for name, given in (("lock", lock), ("arguments", arguments), ("on", on)):
        if not isinstance(given, Mapping | None):
            raise RobotError(f"{name} is {shown(given)}, expected a dict")
    if geometry is not None and not isinstance(robot, pin.Model):
        raise RobotError(
            "geometry is given, which only a pinocchio.Model has; leave it out, since a URDF has "
            "its own"
        )
    if not isinstance(geometry, pin.GeometryModel | None):
        raise RobotError(f"geometry is {shown(geometry)}, expected a pinocchio.GeometryModel")
    folders = _folders(packages)
    source = (
        _parts(robot, base, on, arguments or {}, folders, calibration)
        if isinstance(robot, Mapping)
        else _single(robot, geometry, base, on, arguments or {}, folders, calibration)
    )
    urdf = source.urdf
    if tool is None and source.tool is None:
        tool = _only_leaf(urdf)
        note = f"the tool is '{tool}', the only link with none behind it (else: tool, --tool)"
        urdf = dataclasses.replace(urdf, notes=(*urdf.notes, note))
    elif tool is None:
        tool = source.tool
    frames = _tool_frames(tool, urdf)
    urdf = with_bodies(urdf, frames[0], bodies)
    if tool_offset is not None:
        offset = as_pose(tool_offset, f"{urdf.source}: tool_offset", RobotError)
        urdf, frames[0] = with_tool_offset(urdf, frames[0], offset)
    built = build_robot(urdf, frames, lock or {}, reference)
    acceleration, jerk = (
        read_only([source.limits.get(kind, {}).get(joint, np.inf) for joint in built.joint_names])
        for kind in ("acceleration", "jerk")
    )
    return dataclasses.replace(
        built, touching=source.touching, acceleration_limit=acceleration, jerk_limit=jerk
    )


def _folders(given: Any) -> tuple[str, ...]:
    listed = [given] if isinstance(given, str | Path) else given
    if not isinstance(listed, list | tuple):
        raise RobotError(f"packages is {shown(given)}, expected a folder or several")
    for folder in listed:
        if not isinstance(folder, str | Path) or not is_folder(Path(folder)):
            raise RobotError(f"packages: {shown(folder)} is no folder")
    return tuple(str(Path(folder).resolve()) for folder in listed)


def _tool_frames(tool: Any, urdf: Urdf) -> list[str]:
    frames = [tool] if isinstance(tool, str) else tool
    if not isinstance(frames, list | tuple) or not frames:
        raise RobotError(
            f"{urdf.source}: tool is {shown(tool)}, expected the name of a link, or several"
        )
    return list(frames)


@dataclass(frozen=True)
class _Source:
    """A robot before its joints are chosen.

    Attributes
    ----------
    urdf : Urdf
    tool : str or None
        Its usual tool frame; None where it has none.
    touching : tuple of (str, str)
        See `NamedArm.touching`.
    limits : dict
        Limits that its maker publishes, by kind and joint.
    """

    urdf: Urdf
    tool: str | None
    touching: tuple[tuple[str, str], ...] = ()
    limits: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def _read(
    robot: str | Path | pin.Model,
    arguments: Mapping[str, str],
    packages: tuple[str, ...],
    geometry: Any = None,
) -> _Source:
    known = {**NAMED_ARMS, **NAMED_PARTS}
    source = _called(robot)
    if isinstance(robot, pin.Model) or source == _TEXT:
        _check_no_arguments(source, arguments)
        is_model = isinstance(robot, pin.Model)
        text = urdf_text_of(robot, geometry, source) if is_model else str(robot).strip()
        urdf = urdf_of_file(text, Packages(Path(source), packages))
        return _Source(urdf if is_model else _with_units(urdf), None)
    if isinstance(robot, str) and robot in known:
        _check_no_arguments(robot, arguments)
        arm = known[robot]
        return _Source(read_named(arm), arm.tool, arm.touching, published(robot))
    urdf = _read_file(Path(robot), arguments, str(robot), packages)
    return _Source(_with_units(urdf), None)


def _with_units(urdf: Urdf) -> Urdf:
    """Return a URDF with a note of meshes that say no unit; of arms by name it is known."""
    return dataclasses.replace(urdf, notes=(*urdf.notes, *units_unsaid(urdf.text)))


def _called(robot: str | Path | pin.Model) -> str:
    """Return the name of a given robot in messages and cells."""
    if isinstance(robot, pin.Model):
        return f"pinocchio.Model '{robot.name}'"
    return _TEXT if str(robot).lstrip().startswith("<") else str(robot)


def _single(
    robot: str | Path | pin.Model,
    geometry: Any,
    base: Any,
    on: Mapping[str, str] | None,
    arguments: Mapping[str, str],
    packages: tuple[str, ...],
    calibration: Any,
) -> _Source:
    if isinstance(base, Mapping) or on is not None:
        what = "on" if on is not None else "base"
        raise RobotError(f"{what} is a dict of parts, but there is one robot, '{_called(robot)}'")
    source = _read(robot, arguments, packages, geometry)
    urdf = source.urdf
    if calibration is not None:
        if not isinstance(calibration, str | Path):
            raise RobotError(f"calibration is {shown(calibration)}, expected the path of a file")
        urdf = calibrated_urdf(urdf, calibration)
    if base is not None:
        urdf = with_base(urdf, as_pose(base, f"{urdf.source}: base", RobotError))
    return dataclasses.replace(source, urdf=urdf)


def _parts(
    robots: Mapping[str, str | Path | pin.Model],
    base: Any,
    on: Mapping[str, str] | None,
    arguments: Mapping[str, Any],
    packages: tuple[str, ...],
    calibration: Any,
) -> _Source:
    """Return several robots as one."""
    _check_parts(robots, base, arguments, calibration)
    measured = {} if calibration is None else calibration
    own_arguments = {name: dict(arguments.get(name, {})) for name in robots}
    sources = {name: _read(robot, own_arguments[name], packages) for name, robot in robots.items()}
    for name, file in measured.items():
        urdf = calibrated_urdf(sources[name].urdf, file)
        sources[name] = dataclasses.replace(sources[name], urdf=urdf)
    poses = {
        name: as_pose(at, f"base of '{name}'", RobotError) for name, at in (base or {}).items()
    }
    urdf = composed({name: source.urdf for name, source in sources.items()}, poses, on or {})
    on = on or {}
    parts = tuple(
        UrdfPart(
            name,
            _called(robot),
            poses.get(name),
            on.get(name),
            own_arguments[name],
            sources[name].urdf.calibration,
        )
        for name, robot in robots.items()
    )
    notes = tuple(
        f"{name}: {note}" for name, source in sources.items() for note in source.urdf.notes
    )
    unsaid = tuple(
        f"{name}/{joint}" for name, each in sources.items() for joint in each.urdf.lacking_efforts
    )
    urdf = dataclasses.replace(
        urdf, parts=parts, notes=notes, packages=packages, lacking_efforts=unsaid
    )
    first, source = next(iter(sources.items()))
    own = source.tool
    limits: dict[str, dict[str, float]] = {}
    for name, part in sources.items():
        for kind, values in part.limits.items():
            for joint, value in values.items():
                limits.setdefault(kind, {})[f"{name}/{joint}"] = value
    touching = tuple(
        (f"{name}/{a}", f"{name}/{b}") for name, part in sources.items() for a, b in part.touching
    )
    return _Source(urdf, None if own is None else f"{first}/{own}", touching, limits)


def _check_parts(
    robots: Mapping[str, str | Path | pin.Model],
    base: Any,
    arguments: Mapping[str, Any],
    calibration: Any,
) -> None:
    """Raise RobotError where what is given for parts does not fit them."""
    for name in robots:
        if not (isinstance(name, str) and name.isidentifier()):
            raise RobotError(
                f"robot: a part is called {shown(name)}, expected a name of letters, digits and _"
            )
        if not isinstance(robots[name], str | Path | pin.Model):
            raise RobotError(
                f"robot: part '{name}' is {shown(robots[name])}, expected a name, the path of a "
                f"file, the text of a URDF or a pinocchio.Model"
            )
    if not robots:
        raise RobotError("robot: there is no part, expected names with robots")
    if not isinstance(base, Mapping | None):
        raise RobotError(f"base is {shown(base)}, expected a dict, since there are several robots")
    for name, given in arguments.items():
        if name not in robots or not isinstance(given, Mapping):
            raise RobotError(
                f"arguments: '{name}' is {shown(given)}, expected a dict for each part that is a "
                f".xacro file{nearest(name, robots)}; parts: {', '.join(robots)}"
            )
    measured = {} if calibration is None else calibration
    if not isinstance(measured, Mapping) or not set(measured) <= set(robots):
        raise RobotError(
            f"calibration is {shown(calibration)}, expected a dict of files by part: "
            f"{', '.join(robots)}"
        )


def _read_file(
    path: Path, arguments: Mapping[str, str], given: str, packages: tuple[str, ...]
) -> Urdf:
    if "://" in given:
        raise RobotError(f"{given}: is an address, expected a file: download it first")
    # Some call a file of xacro by what it expands to.
    if path.suffix == ".xacro" or (path.suffix == ".urdf" and is_xacro(path)):
        near = Packages(path, packages)
        return urdf_of_file(expand(path, arguments, near), near)
    _check_no_arguments(given, arguments)
    if path.suffix != ".urdf":
        raise RobotError(
            f"unknown robot '{given}', expected a .urdf or .xacro file or one of: "
            f"{', '.join(NAMED_ARMS)}{nearest(str(path), NAMED_ARMS)}"
        )
    return read_urdf(path, packages)


def _check_no_arguments(given: str, arguments: Mapping[str, Any]) -> None:
    if arguments:
        raise RobotError(f"{given}: arguments are given, which only a .xacro file has")


def _only_leaf(urdf: Urdf) -> str:
    parents = {joint.parent for joint in urdf.joints.values()}
    leaves = [link for link in urdf.links if link not in parents]
    # A fixed frame, as a base's, is no tool.
    leaves = [
        link for link in leaves if any(joint.kind != "fixed" for joint in urdf.chain(link))
    ] or leaves
    if len(leaves) != 1:
        raise RobotError(
            f"{urdf.source}: has {len(leaves)} end links ({', '.join(leaves)}); "
            f"name the tool frame with tool="
        )
    return leaves[0]
