"""Files of programs, written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from selfmotion.planning.result import (
    write_bundle,
)
from selfmotion.work.job.step import Step

if TYPE_CHECKING:
    from selfmotion.work.job.program import Program

# Version of the format: raised with every change that older versions cannot read.
FORMAT = 2


def write_program(program: Program, file: Path) -> None:
    """Write a program to one file, atomically; see `Program.save`."""
    found = [step for step in program.steps if not step.is_missing]
    specification = program.specification
    troubles = {step.name: step.trouble for step in program.steps if step.is_missing}
    description: dict[str, Any] = {
        "steps": [_step_to_dict(step) for step in found],
        "missing": {**program.missing, **troubles},
        "bound": program.bound,
        "notes": list(program.notes),
        "unjudged": list(program.unjudged),
        "specification": None if specification is None else specification.to_dict(),
    }
    write_bundle(file, "program", FORMAT, description, [step.made for step in found])


def _step_to_dict(step: Step) -> dict[str, Any]:
    return {
        "name": step.name,
        "turned": step.turned,
        "events": [list(event) for event in step.events],
        "leaves": [item.to_dict() for item in step.leaves],
        "may_meet": list(step.may_meet),
    }
