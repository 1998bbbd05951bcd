"""From a problem back to its file."""

import dataclasses
import xml.etree.ElementTree as ElementTree
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    ProblemError,
    Saved,
    as_path,
    is_file,
    public_name,
    shown,
    write_document,
)
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
from selfmotion.planning.optimise import QuasiNewton
from selfmotion.planning.planner import PlanRequest
from selfmotion.problem.problem import Problem, check_problem, problem_to_dict
from selfmotion.shell.documents.named_files import named_from


def write_problem(problem: Problem | PlanRequest, file: str | FilePath) -> None:
    """Write a problem as TOML or JSON that `read_problem` turns into the same problem.

    Of a `PlanRequest` the settings of the search, its goal and outputs are written as well:
    `read_job` turns the file into the same one.

    Raises
    ------
    ProblemError
        It holds a function, which a file cannot carry, or an arm that is in no URDF file; or a
        search begins with a generator of random numbers, or with an optimiser of one's own.
    FileFormatError
        The file cannot be written.
    """
    path = as_path(file)
    if not isinstance(problem, PlanRequest):
        write_document(path, problem_document(problem, path))
        return
    # Plain keys stand before the first table.
    table = _named_beside({**_settings(problem), **problem_table(problem.problem)}, path)
    write_document(path, dict(sorted(table.items(), key=lambda item: isinstance(item[1], dict))))


def problem_document(problem: Problem, file: FilePath) -> dict[str, Any]:
    """Return what a problem file says of a problem; ProblemError as for `write_problem`."""
    check_problem(problem)
    return _named_beside(problem_table(problem), file)


def _named_beside(table: dict[str, Any], file: FilePath) -> dict[str, Any]:
    """Return a table whose files are named from where its own file is."""
    named: dict[str, Any] = named_from(table, FilePath.cwd(), file.parent.resolve())
    return named


def _settings(job: PlanRequest) -> dict[str, Any]:
    """Return the keys that say how a job is planned."""
    table: dict[str, Any] = {}
    if job.goal != "best":
        table["goal"] = job.goal
    if job.outputs:
        table["outputs"] = [str(name) for name in job.outputs]
    if job.max_evaluations is not None:
        table["max_evaluations"] = job.max_evaluations
    if job.parts:
        table["parts"] = {key: _plain(value) for key, value in job.parts.items()}
    if job.keep:
        table["keep"] = {key: float(factor) for key, factor in job.keep.items()}
    if job.search is not None and not isinstance(job.search.rng, int):
        raise ProblemError("search: rng is a generator, which a file cannot carry; give a number")
    if not isinstance(job.optimizer, QuasiNewton | None):
        raise ProblemError(
            f"optimizer: {type(job.optimizer).__name__} is no QuasiNewton, which a file can carry"
        )
    named = {"search": job.search, "tolerance": job.tolerance, "optimiser": job.optimizer}
    for name, value in named.items():
        if value is not None:
            table[name] = _without_none(dataclasses.asdict(value))
    return table


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()


def problem_table(problem: Problem) -> dict[str, Any]:
    """Return the table of a problem file; see `write_problem`."""
    table = problem_to_dict(problem, _robot, _described)
    if "collision" in table:
        # Plans' files have the name that it had when their format was made.
        table["clearance"] = table.pop("collision")
    apart = table.get("clearance")
    for item in apart if isinstance(apart, list) else [apart]:
        if isinstance(item, dict):
            del item["kind"]
    return {key: _without_none(value) for key, value in table.items()}


def _robot(robot: RobotModel) -> dict[str, Any]:
    mounting, source = mounting_of(robot.urdf, robot.tool), FilePath(robot.urdf.source)
    tools = [mounting.tool, *robot.tools[1:]]
    table: dict[str, Any] = {"tool": tools[0] if len(tools) == 1 else tools}
    if robot.reference is not None:
        table["reference"] = robot.reference
    if mounting.tool_offset is not None:
        position, rpy = mounting.tool_offset
        table["tool_offset"] = {"position": position, "rpy": rpy}
    if robot.urdf.packages:
        table["packages"] = list(robot.urdf.packages)
    if mounting.bodies:
        table["bodies"] = mounting.bodies
    _check_frames(robot)
    if robot.urdf.parts:
        _check_unchanged(robot, tools)
        table["parts"] = {part.name: _part(part) for part in robot.urdf.parts}
        table["lock"] = dict(robot.locked)
        return table
    named = next((name for name in names_of(str(source)) if _is_named(robot, name)), None)
    if named is not None:
        table["name"] = named
    elif source.suffix == ".urdf" and is_file(source) and not robot.urdf.has_changed():
        table["file"] = str(source.resolve())
    else:
        raise ProblemError(
            f"{robot.name}: its URDF is not (or no longer) in the file '{source}', which a problem "
            f"file could name; write `robot.urdf.text` to a .urdf file and load it from there"
        )
    calibration = robot.urdf.calibration
    if calibration is not None:
        table["calibration"] = calibration
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
    if mounting.base is not None:
        table["base"] = {"position": mounting.base[0], "rpy": mounting.base[1]}
    table["lock"] = dict(robot.locked)
    return table


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
        if part.source not in {**NAMED_ARMS, **NAMED_PARTS} and not is_file(FilePath(part.source)):
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


def _part(part: UrdfPart) -> dict[str, Any]:
    is_known_by_name = part.source in {**NAMED_ARMS, **NAMED_PARTS}
    source = part.source if is_known_by_name else str(FilePath(part.source).resolve())
    table: dict[str, Any] = {"name" if is_known_by_name else "file": source}
    if part.base is not None:
        table["base"] = {
            "position": part.base.translation.tolist(),
            "rotation": part.base.rotation.tolist(),
        }
    if part.on is not None:
        table["on"] = part.on
    if part.calibration is not None:
        table["calibration"] = part.calibration
    if part.arguments:
        table["arguments"] = dict(part.arguments)
    return table


def _is_named(robot: RobotModel, name: str) -> bool:
    reloaded = load_robot(name)
    return reloaded.urdf.text == robot.urdf.bare_text() and reloaded.touching == robot.touching


def _described(value: Saved) -> dict[str, Any]:
    """Return the description of a value, its class named by module where it is the user's own."""
    described, cls = value.to_dict(), type(value)
    if described["kind"] != cls.kind:
        family = next(base for base in cls.__mro__ if Saved in base.__bases__)
        raise ProblemError(
            f"{cls.__name__} '{getattr(value, 'name', '')}' holds a function, which a file cannot "
            f"carry; derive a class from {public_name(family)}"
        )
    if not cls.__module__.startswith("selfmotion."):
        if cls.__module__ == "__main__":
            raise FileFormatError(
                f"{cls.__name__} is defined in the script that runs; move it into a module, which "
                f"a file can name"
            )
        described["kind"] = f"{cls.__module__}:{cls.__qualname__}"
    return described


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
