"""Problems as values that a file can hold, and another process can be sent."""

import dataclasses
import json
from collections.abc import Callable, Mapping, MutableMapping
from typing import Any

from selfmotion.basics import restore
from selfmotion.constraints import Constraint
from selfmotion.costs import cost_from_dict
from selfmotion.motion import NullMotion
from selfmotion.path import Path
from selfmotion.problem.problem import NO_OVERLAP, Problem
from selfmotion.robot import rebuild_robot
from selfmotion.task import Damping, Relaxation


def problem_to_dict(problem: Problem) -> dict[str, Any]:
    """Return a problem as JSON-safe values, the URDF's text among them; functions are lost."""
    robot, start = problem.robot, problem.given_start
    return {
        "robot": {
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
        },
        "path": problem.path.to_dict(),
        "task": problem.task.value,
        "start": None if start is None else start.tolist(),
        "null_motion": problem.null_motion.to_dict(),
        "costs": [cost.to_dict() for cost in problem.costs],
        "constraints": [item.to_dict() for item in problem.constraints],
        "relaxations": [item.to_dict() for item in problem.relaxations],
        "damping": None if problem.damping is None else dataclasses.asdict(problem.damping),
        "collision": None if problem.collision is None else problem.collision.to_dict(),
        "rest": problem.rest,
    }


def problem_from_dict(
    values: Mapping[str, Any], known: MutableMapping[str, Any] | None = None
) -> Problem:
    """Return the problem that `problem_to_dict` described.

    Arms and constraints are put into `known` by their description and taken from it: making their
    bodies takes a good part of a second.
    """
    known = {} if known is None else known

    def once(description: Mapping[str, Any], make: Callable[[], Any]) -> Any:
        key = json.dumps(description, sort_keys=True)
        return known[key] if key in known else known.setdefault(key, make())

    def constraint(item: Mapping[str, Any]) -> Any:
        return once(item, lambda: restore(Constraint, item))

    robot = once(values["robot"], lambda: rebuild_robot(**values["robot"]))
    damping, collision = values["damping"], values["collision"]
    return Problem(
        robot,
        restore(Path, values["path"]),
        values["task"],
        values["start"],
        restore(NullMotion, values["null_motion"]),
        tuple(cost_from_dict(item, robot) for item in values["costs"]),
        tuple(constraint(item) for item in values["constraints"]),
        tuple(Relaxation(**item) for item in values["relaxations"]),
        None if damping is None else Damping(**damping),
        collision and (NO_OVERLAP if collision == NO_OVERLAP.to_dict() else constraint(collision)),
        values["rest"],
    )
