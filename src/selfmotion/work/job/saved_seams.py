"""Seams as JSON-safe values, in the specification that a program's file carries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from selfmotion.basics import restore
from selfmotion.model.collision import obstacle_from_dict
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Relaxation, Task
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.costs import cost_from_dict
from selfmotion.work.job.seam import Seam


def seam_to_dict(seam: Seam) -> dict[str, Any]:
    """Return JSON-safe values; FileFormatError for values that no file can carry."""
    return {
        "name": seam.name,
        "path": seam.path.to_dict(),
        "task": Task.of(seam.task).value,
        "relaxations": [
            {key: value for key, value in item.to_dict().items() if value != float("inf")}
            for item in seam.relaxations
        ],
        "costs": None if seam.costs is None else [cost.to_dict() for cost in seam.costs],
        "constraints": [item.to_dict() for item in seam.constraints],
        "either_way": seam.either_way,
        "after": list(seam.after),
        "after_any": list(seam.after_any),
        "wait": seam.wait,
        "events": [list(event) for event in seam.events],
        "leaves": [item.to_dict() for item in seam.leaves],
        "may_meet": list(seam.may_meet),
    }


def seam_from_dict(values: Mapping[str, Any], robot: RobotModel) -> Seam:
    """Return the seam of an arm that `seam_to_dict` described."""
    by_name = {field.name: values[field.name] for field in fields(Seam)}
    costs = values["costs"]
    restored = {
        "path": restore(Path, values["path"]),
        "relaxations": [Relaxation(**item) for item in values["relaxations"]],
        "costs": None if costs is None else [cost_from_dict(item, robot) for item in costs],
        "constraints": [restore(Constraint, item) for item in values["constraints"]],
        "leaves": [obstacle_from_dict(item) for item in values["leaves"]],
    }
    return Seam(**{**by_name, **restored})
