"""Problems as values that a file can hold, and another process can be sent."""

import dataclasses
import json
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from functools import partial
from operator import methodcaller
from typing import Any

from selfmotion.basics import Saved, restore
from selfmotion.model.follow import Follow
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import Path
from selfmotion.model.robot import LIMITS, RobotModel, rebuild_robot
from selfmotion.model.task import Damping, Relaxation, Task
from selfmotion.problem.constraints import NO_OVERLAP, Constraint, separate_clearances
from selfmotion.problem.costs import cost_from_dict
from selfmotion.problem.problem.problem import Problem


def problem_to_dict(
    problem: Problem,
    describe_robot: Callable[[RobotModel], dict[str, Any]] | None = None,
    describe: Callable[[Saved], dict[str, Any]] = methodcaller("to_dict"),
) -> dict[str, Any]:
    """Return a problem as JSON-safe values: the document of plans' files and of problem files.

    By default with the URDF's text, and without functions of the user's. A problem file names the
    arm instead, and raises for values that it cannot contain.
    """
    start, apart = problem.given_start, [describe(item) for item in problem.clearances]
    document: dict[str, Any] = {
        "task": problem.task.value,
        "start": "free" if start is None else start.tolist(),
        "robot": (describe_robot or _robot_to_dict)(problem.robot),
        "path": describe(problem.path),
        "null_motion": describe(problem.null_motion),
        "costs": [describe(cost) for cost in problem.costs],
        "constraints": [describe(item) for item in problem.constraints],
    }
    if problem.relaxations:
        # Those at their defaults would put an infinite band into JSON.
        document["relaxations"] = [
            {key: value for key, value in item.to_dict().items() if value != float("inf")}
            for item in problem.relaxations
        ]
    if problem.damping is not None:
        document["damping"] = dataclasses.asdict(problem.damping)
    if problem.clearance is not NO_OVERLAP:
        # Key of the first version of plan files.
        document["collision"] = apart if len(apart) > 1 else (*apart, False)[0]
    if not problem.rest:
        document["rest"] = False
    if problem.also:
        document["also"] = [_follow_to_dict(item, describe) for item in problem.also]
    return document


def _follow_to_dict(item: Follow, describe: Callable[[Saved], dict[str, Any]]) -> dict[str, Any]:
    path: Any = item.path
    where = {"tool": item.tool, "reference": item.reference}
    return {
        "task": Task.of(item.task).value,
        **(
            {"path": describe(path)}
            if isinstance(path, Path)
            else {"pose": path.homogeneous.tolist()}
        ),
        **{key: value for key, value in where.items() if value is not None},
    }


def follow_from_dict(values: Mapping[str, Any]) -> Follow:
    """Return the task frame of a problem's document: a frame with a path, or a pose."""
    path = restore(Path, values["path"]) if "path" in values else values["pose"]
    return Follow(path, values["task"], values.get("tool"), values.get("reference"))


def _robot_to_dict(robot: RobotModel) -> dict[str, Any]:
    """Return an arm as JSON-safe values, with its URDF's text; for `rebuild_robot`."""
    return {
        "text": robot.urdf.text,
        "package_dirs": list(robot.urdf.package_dirs),
        "source": robot.urdf.source,
        "continuous": sorted(robot.urdf.continuous()),
        "tool": list(robot.tools),
        "reference": robot.reference,
        "locked": dict(robot.locked),
        "touching": [list(pair) for pair in robot.touching],
        "acceleration_limit": robot.acceleration_limit.tolist(),
        "jerk_limit": robot.jerk_limit.tolist(),
        "limits": {name: getattr(robot, name).tolist() for name in LIMITS},
    }


def problem_from_dict(
    values: Mapping[str, Any], known: MutableMapping[str, Any] | None = None
) -> Problem:
    """Return the problem that `problem_to_dict` described.

    Arms and constraints are put into `known` by their description and taken from it: making their
    bodies takes a good part of a second.
    """
    known = {} if known is None else known
    robot, constraints = arm_and_constraints(values, known)
    damping, given = values.get("damping"), values.get("collision", NO_OVERLAP)
    described = [given] if isinstance(given, Mapping) else given
    if isinstance(described, list):
        given = [_once(known, item, partial(restore, Constraint, item)) for item in described]
    # Files of former versions have clearances among the constraints.
    constraints, clearances = separate_clearances(constraints, given or None)
    return Problem(
        robot,
        restore(Path, values["path"]),
        values["task"],
        values["start"],
        restore(NullMotion, values["null_motion"]),
        tuple(cost_from_dict(item, robot) for item in values["costs"]),
        constraints,
        tuple(Relaxation(**item) for item in values.get("relaxations", ())),
        None if damping is None else Damping(**damping),
        clearances[0] if clearances == (NO_OVERLAP,) else clearances,
        values.get("rest", True),
        tuple(follow_from_dict(item) for item in values.get("also", ())),
    )


def describe_arm(robot: RobotModel, constraints: Sequence[Constraint]) -> dict[str, Any]:
    """Return an arm and its constraints as JSON-safe values, with the URDF's text."""
    return {
        "robot": _robot_to_dict(robot),
        "constraints": [item.to_dict() for item in constraints],
    }


def arm_and_constraints(
    values: Mapping[str, Any], known: MutableMapping[str, Any]
) -> tuple[RobotModel, tuple[Constraint, ...]]:
    """Return the values of `describe_arm`, from a cache of arms or into it."""
    given = values["robot"]
    robot = _once(known, given, lambda: rebuild_robot(**given))
    constraints = tuple(
        _once(known, item, partial(restore, Constraint, item)) for item in values["constraints"]
    )
    return robot, constraints


def _once(
    known: MutableMapping[str, Any], description: Mapping[str, Any], make: Callable[[], Any]
) -> Any:
    key = json.dumps(description, sort_keys=True)
    return known[key] if key in known else known.setdefault(key, make())
