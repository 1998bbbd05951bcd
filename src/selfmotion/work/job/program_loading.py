"""Files of programs, read; `program_files` writes them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from selfmotion.basics import (
    FileFormatError,
    SelfmotionError,
    as_path,
)
from selfmotion.model.collision import obstacle_from_dict
from selfmotion.planning.result import (
    Move,
    Plan,
    read_bundle,
)
from selfmotion.work.job.program import Program
from selfmotion.work.job.program_files import FORMAT
from selfmotion.work.job.specification import Specification
from selfmotion.work.job.step import Step


def load_program(file: str | Path) -> Program:
    """Read a program that `Program.save` wrote, and judge all of it anew.

    A file that was changed is never verified.

    Raises
    ------
    FileFormatError
        The file is missing, is no program, lacks something, or was written by another version.
    """
    path = as_path(file)
    description, made, changed = read_bundle(path, "program", FORMAT)
    try:
        pairs = zip(description["steps"], made, strict=True)
        steps = tuple(_step_from_dict(values, item) for values, item in pairs)
        missing = {str(name): str(why) for name, why in description["missing"].items()}
        notes, bound = tuple(map(str, description["notes"])), float(description["bound"])
        unjudged = tuple(map(str, description.get("unjudged", ())))
        values = description["specification"]
        robot = made[0].robot
        specification = None if values is None else Specification.from_dict(values, robot)
        if not math.isfinite(bound):
            raise ValueError(f"bound is {bound}, not finite")
    except (
        SelfmotionError,
        LookupError,
        TypeError,
        ValueError,
        AttributeError,
        OverflowError,
    ) as error:
        raise FileFormatError(f"{path}: is a damaged program: {error!r}") from error
    if changed:
        missing[path.name] = "the file was changed after the program was written"
    return Program(made[0].robot, steps, missing, bound, notes, specification, unjudged=unjudged)


def _step_from_dict(values: Mapping[str, Any], made: Plan | Move) -> Step:
    """Return the step that `_step_to_dict` described."""
    return Step(
        str(values["name"]),
        made,
        bool(values["turned"]),
        tuple((str(name), float(at)) for name, at in values["events"]),
        tuple(obstacle_from_dict(item) for item in values["leaves"]),
        tuple(map(str, values["may_meet"])),
    )
