"""When the steps of a program begin and end, and what happens when, as a table."""

from __future__ import annotations

from pathlib import Path

from selfmotion.basics import ProblemError, as_path, shown, write_text
from selfmotion.job.program import Program


def write_timetable(program: Program, file: str | Path) -> None:
    """Write when each step begins and ends, and each event is [s], as CSV; atomically.

    Events at one time are in the order in which they were given.

    Raises
    ------
    ProblemError
        It is no program.
    FileFormatError
        The file cannot be written.
    """
    if not isinstance(program, Program):
        raise ProblemError(f"program is {shown(program)}, expected a Program")
    rows = list[tuple[float, float, str, str]]()
    for begin, step in zip(program.begins, program.steps, strict=True):
        kind = "seam" if step.is_seam else "move"
        rows.append((begin, begin + step.duration, kind, step.name))
        for event, at in step.happenings:
            rows.append((begin + at, begin + at, "event", f"{step.name}: {event}"))
    lines = ["begin,end,kind,name"]
    lines += [
        f'{begin:.6f},{end:.6f},{kind},"{name.replace(chr(34), chr(34) * 2)}"'
        for begin, end, kind, name in rows
    ]
    write_text(as_path(file), "\n".join(lines) + "\n")
