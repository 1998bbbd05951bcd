"""The table of the arm in problem files, and of the parts of a cell; read, and written again."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import ProblemError, RobotError, is_file, shown
from selfmotion.model.robot import (
    LIMITS,
    NAMED_ARMS,
    NAMED_PARTS,
    TOOL_JOINT,
    RobotModel,
    UrdfPart,
    load_robot,
    mimic_of,
    mounting_of,
    moving_joints,
    names_of,
)
from selfmotion.shell.documents.body_tables import CarriedBody
from selfmotion.shell.documents.field_types import (
    AnyTable,
    Coordinates,
    File,
    Files,
    Names,
    Text,
    key,
)
from selfmotion.shell.documents.tables import Context, Pose, Table

_KNOWN = {**NAMED_ARMS, **NAMED_PARTS}


class SourceTable(Table):
    """A robot that is known by name, or in a file, and where it stands."""

    name: Text = key("A robot that is known by name; see `selfmotion robots`.")
    file: File = key("Or a URDF or xacro file.")
    arguments: AnyTable = key("Of a xacro file; of parts, each has its own.")
    base: Pose = key(
        "Pose of its root link in the world, or of a part in the link that carries it; of parts, "
        "each has its own."
    )
    calibration: File = key(
        "File that says where the joints of this very arm are: Universal Robots' kinematics "
        "(`.yaml`) or `calibration.conf`; or a `.yaml` or `.toml` file with `joints`, for each "
        "its `position` and `rpy` in its parent link, and `offsets`, the position of each at its "
        "nominal zero [rad or m]. Of parts, each has its own."
    )

    def source(self, context: Context, where: str = "") -> str | FilePath:
        """Return the name of the robot, or its file."""
        if (self.name is None) == (self.file is None):
            raise RobotError(
                f"{where}expected either name (one of {', '.join(NAMED_ARMS)}) or file (.urdf, "
                f".xacro)"
            )
        if self.name is not None and self.name not in _KNOWN:
            raise RobotError(
                f"{where}name: unknown robot '{self.name}', known: {', '.join(NAMED_ARMS)}"
            )
        return self.name if self.file is None else context.beside(self.file)


_OF_PARTS = tuple(SourceTable.model_fields)


class RobotPartTable(SourceTable):
    """A robot of a cell."""

    on: Text = key("The link of another part that carries it.")

    @classmethod
    def of(cls, part: UrdfPart) -> dict[str, Any]:
        """Return what a file says of a part of a cell."""
        is_known, base = part.source in _KNOWN, part.base
        source = part.source if is_known else str(FilePath(part.source).resolve())
        if base is not None:
            base = {"position": base.translation.tolist(), "rotation": base.rotation.tolist()}
        table = {
            "name" if is_known else "file": source,
            "base": base,
            "on": part.on,
            "calibration": part.calibration,
            "arguments": dict(part.arguments) or None,
        }
        return {name: value for name, value in table.items() if value is not None}


class RobotTable(SourceTable):
    """The arm: one known by name, or in a file; or a cell of several of these."""

    tool: Names = key(
        "Tool frame (a link), or several: the first is the one that paths are for where nothing "
        "else is said. By default a named arm's usual one, a file's only leaf link, or of parts "
        "that of the first."
    )
    tool_offset: Pose = key(
        "Pose of the frame that follows the path in that of `tool`: a pen in a gripper."
    )
    reference: Text = key(
        "The link in whose frame poses, twists and paths are given: a part that a table turns, or "
        "that another hand holds. By default the world."
    )
    lock: Coordinates = key(
        "Joints to hold, with their coordinate [rad or m]. Joints that move no tool relative to "
        "the reference are held anyway, at 0 or the nearest limit unless given here."
    )
    packages: Files = key(
        "Folders that are searched first for packages (`package://`, `$(find …)`). Without, they "
        "are found in folders above the file and three levels below these, and by "
        "`AMENT_PREFIX_PATH` and `ROS_PACKAGE_PATH`."
    )
    parts: dict[str, RobotPartTable] = key("Robots that make a cell, by name.")
    bodies: list[CarriedBody] = key("Bodies that links carry, each with the link as its frame.", [])

    def build(self, context: Context) -> RobotModel:
        """Return the arm, or the cell."""
        context.arguments = self.arguments
        context.packages = [context.beside(name) for name in self.packages or ()]
        return context.once(self, lambda: self._loaded(context))  # type: ignore[no-any-return]

    def _loaded(self, context: Context) -> RobotModel:
        values = {
            name: x for name, x in self.given.items() if name not in ("name", "file", "parts")
        }
        values["bodies"] = [body.build(context) for body in self.bodies]
        if self.packages is not None:
            values["packages"] = context.packages
        if self.parts is None:
            if self.calibration is not None:
                values["calibration"] = context.beside(self.calibration)
            return load_robot(self.source(context), **values)
        for name in _OF_PARTS:
            if name in self.given:
                raise RobotError(f"{name}: is given in each of parts, where there are some")
        for name in ("base", "on", "arguments", "calibration"):
            values[name] = {
                part: x.given[name] for part, x in self.parts.items() if name in x.given
            }
        values["calibration"] = {
            part: context.beside(file) for part, file in values["calibration"].items()
        }
        sources = {
            name: part.source(context, f"parts.{name}: ") for name, part in self.parts.items()
        }
        return load_robot(sources, **values)

    @classmethod
    def of(cls, robot: RobotModel) -> dict[str, Any]:
        """Return what a file says of an arm.

        Raises
        ------
        ProblemError
            No file that a problem file could name makes the same arm.
        """
        mounting = mounting_of(robot.urdf, robot.tool)
        tools = [mounting.tool, *robot.tools[1:]]
        offset, base = (
            None if given is None else {"position": given[0], "rpy": given[1]}
            for given in (mounting.tool_offset, mounting.base)
        )
        _check_frames(robot)
        table: dict[str, Any] = {
            "tool": tools[0] if len(tools) == 1 else tools,
            "reference": robot.reference,
            "tool_offset": offset,
            "packages": list(robot.urdf.packages) or None,
            "bodies": mounting.bodies or None,
        }
        if robot.urdf.parts:
            _check_unchanged(robot, tools)
            table["parts"] = {part.name: RobotPartTable.of(part) for part in robot.urdf.parts}
        else:
            table |= _source_of(robot, tools)
            table["base"] = base
        table["lock"] = dict(robot.locked)
        return {name: value for name, value in table.items() if value is not None}


def _source_of(robot: RobotModel, tools: list[str]) -> dict[str, Any]:
    """Return the name of a robot, or its file, and its calibration."""
    source, calibration = FilePath(robot.urdf.source), robot.urdf.calibration
    named = next((name for name in names_of(str(source)) if _is_named(robot, name)), None)
    is_in_file = source.suffix == ".urdf" and is_file(source) and not robot.urdf.has_changed()
    if named is None and not is_in_file:
        raise ProblemError(
            f"{robot.name}: its URDF is not (or no longer) in the file '{source}', which a problem "
            f"file could name; write `robot.urdf.text` to a .urdf file and load it from there"
        )
    now = load_robot(
        named or source,
        tools,
        robot.locked,
        reference=robot.reference,
        packages=robot.urdf.packages,
        calibration=calibration,
    )
    _check_limits(robot, now)
    _check_calibration(robot, now)
    found = {"file": str(source.resolve())} if named is None else {"name": named}
    return found if calibration is None else {**found, "calibration": calibration}


def _check_limits(robot: RobotModel, reloaded: RobotModel) -> None:
    """Refuse an arm that was given other limits than it is loaded with."""
    for name in (*LIMITS, "acceleration_limit", "jerk_limit"):
        if not np.array_equal(getattr(robot, name), getattr(reloaded, name)):
            raise ProblemError(
                f"{robot.name}: its {name} is another than it is loaded with, which a problem file "
                f"cannot carry; ask for limits by constraints (JointVelocityLimits, …)"
            )


def _check_calibration(robot: RobotModel, reloaded: RobotModel) -> None:
    """Refuse an arm whose joints are elsewhere than its calibration file says now."""
    if not robot.urdf.is_calibrated:
        return
    placements = _placements(robot)
    if any(placements[name] != place for name, place in _placements(reloaded).items()):
        raise ProblemError(
            f"{robot.name}: its joints are elsewhere than its calibration file says now, so that "
            f"a problem file would name another arm; load it again"
        )


def _placements(robot: RobotModel) -> dict[str, dict[str, str]]:
    """Return where each joint is in its parent link, as the URDF says it."""
    joints = ElementTree.fromstring(robot.urdf.text).findall("joint")
    origins = {joint.get("name", ""): joint.find("origin") for joint in joints}
    return {name: {} if found is None else found.attrib for name, found in origins.items()}


def _check_unchanged(robot: RobotModel, tools: list[str]) -> None:
    """Refuse a cell whose parts' files are no longer those that it was made of."""
    parts = robot.urdf.parts
    for part in parts:
        if part.source not in _KNOWN and not is_file(FilePath(part.source)):
            raise ProblemError(
                f"{robot.name}: part '{part.name}' is of {part.source}, and in no file that a "
                f"problem file could name; write its URDF to one and load it from there"
            )
    now = load_robot(
        {part.name: part.source for part in parts},
        tools,
        robot.locked,
        reference=robot.reference,
        base={part.name: part.base for part in parts if part.base is not None},
        on={part.name: part.on for part in parts if part.on is not None},
        arguments={part.name: part.arguments for part in parts},
        packages=robot.urdf.packages,
        calibration={part.name: part.calibration for part in parts if part.calibration} or None,
    )
    _check_calibration(robot, now)
    if now.urdf.bare_text() != robot.urdf.bare_text():
        raise ProblemError(
            f"{robot.name}: the files of its parts have changed since it was loaded, so that a "
            f"problem file would name another cell; load it again"
        )
    _check_limits(robot, now)


def _check_frames(robot: RobotModel) -> None:
    """Refuse an arm that was loaded for other frames than those it follows paths with."""
    offset = robot.urdf.joints.get(TOOL_JOINT)
    moving = moving_joints(robot.urdf, robot.tools, robot.reference)
    free = {mimic_of(robot.urdf, joint.name).joint for joint in moving} - set(robot.locked)
    if free != set(robot.joint_names) or (offset is not None and offset.child != robot.tool):
        raise ProblemError(
            f"{robot.name}: was loaded for other frames, so that its joints or its tool_offset "
            f"would be others in a file; load it with tool={shown(list(robot.tools))}, "
            f"reference={robot.reference!r}, as its paths are followed"
        )


def _is_named(robot: RobotModel, name: str) -> bool:
    reloaded = load_robot(name)
    return reloaded.urdf.text == robot.urdf.bare_text() and reloaded.touching == robot.touching
