"""Options of commands that write programs of controllers."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import selfmotion as sm
from selfmotion.task import SE3, exp3

SettingsOption = Annotated[
    Path | None,
    typer.Option(
        help="File with settings of a controller's program: deviation, axes, signals, "
        "flange, mass, center, approach, targets, work_object, positioner (TOML)."
    ),
]
TargetsOption = Annotated[
    str | None,
    typer.Option(
        help="Of controllers' programs: joints, or poses (linear motions in a work object, which "
        "can be shifted and touched up)."
    ),
]
WorkObjectOption = Annotated[
    str | None,
    typer.Option(
        help="Work object of the poses: a link, or x,y,z,rx,ry,rz \\[m, and rotation vector in "
        "rad] in the frame of the arm's base; with --targets poses.",
        metavar="NAME|X,Y,Z,RX,RY,RZ",
    ),
]
MassOption = Annotated[
    float | None,
    typer.Option(help="Of controllers' programs: mass of what the flange carries \\[kg]."),
]


def program_settings(
    file: Path | None, targets: str | None, wobj: str | None, mass: float | None
) -> sm.files.ProgramSettings | None:
    """Return the settings of controllers' programs: those of a file, and of options; None for none.

    Raises
    ------
    ProblemError
        A work object is neither a name nor six numbers.
    """
    given: dict[str, Any] = {} if targets is None else {"targets": targets}
    if mass is not None:
        given["mass"] = mass
    if wobj is not None:
        given["work_object"] = _work_object(wobj)
    if file is not None:
        return sm.files.read_program_settings(file, **given)
    return sm.files.ProgramSettings(**given) if given else None


def _work_object(text: str) -> str | SE3:
    """Return the link or the pose that an option says."""
    parts = text.split(",")
    if len(parts) == 1:
        return text
    try:
        values = [float(part) for part in parts]
    except ValueError:
        values = []
    if len(values) != 6 or not np.isfinite(values).all():
        raise sm.errors.ProblemError(
            f"--wobj: '{text}' is neither the name of a link nor six numbers x,y,z,rx,ry,rz "
            f"[m, rad]"
        )
    return SE3(exp3(np.array(values[3:])), np.array(values[:3]))
