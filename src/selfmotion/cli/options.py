"""Options of the commands, and what their texts mean."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

import selfmotion as sm
from selfmotion.basics import Array

TaskName = Literal["pose", "position", "pointing", "planar", "planar_pose"]
Corners = Literal["blend", "stop"]
Axis = Literal["x", "y", "z"]
SearchMode = Literal["auto", "local", "global"]

RobotArgument = Annotated[
    str, typer.Argument(help="Name (see `selfmotion robots`) or path of a .urdf file.")
]
PlanArgument = Annotated[Path, typer.Argument(help="A plan saved as .npz.")]

PathOption = Annotated[
    Path | None, typer.Option(help="Waypoints: CSV with t,x,y,z,qw,qx,qy,qz (s, m).")
]
CircleOption = Annotated[float | None, typer.Option(help="Or a circle of this radius (m).")]
LineOption = Annotated[str | None, typer.Option(help="Or a straight line by dx,dy,dz (m).")]
NormalOption = Annotated[Axis, typer.Option(help="Axis of the circle.")]
DurationOption = Annotated[float, typer.Option(help="Of circle or line (s).")]
CornersOption = Annotated[Corners, typer.Option(help="At kinks of the waypoints.")]
TaskOption = Annotated[TaskName, typer.Option(help="What the path prescribes.")]
RelaxOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Rows that may leave the path: ROWS[=BAND]\\[@FROM:TO], rows of x,y,z or of "
        "rx,ry,rz (tool axes), BAND in m or rad (free without), times in s. Examples: z=0.002, "
        "rx,ry=0.2 (a cone), rz@1:2.5. Repeatable."
    ),
]
StartOption = Annotated[
    str | None, typer.Option(help="q1,q2,… (rad or m); default: one that suits the path.")
]
ToolOption = Annotated[str | None, typer.Option(help="Tool frame (a link).")]
DegreeOption = Annotated[int, typer.Option(help="Degree of the null motion's polynomial.")]
MuOption = Annotated[
    float, typer.Option(help="Weight of 1/det(JJᵀ), the distance from singular poses.")
]
DampedOption = Annotated[
    bool,
    typer.Option("--damped", help="Go through singular poses, at the price of the path there."),
]
LimitOption = Annotated[
    int | None, typer.Option(help="Limit on cost evaluations while optimising.")
]
SearchOption = Annotated[
    SearchMode | None,
    typer.Option(
        help="Without --start: from many starts (local), over all self-motions (global), or "
        "the one after the other (auto, the default)."
    ),
]
CompareOption = Annotated[
    bool, typer.Option("--compare", help="Tell the distance from the global optimum.")
]
OutOption = Annotated[
    list[Path] | None, typer.Option(help="Write the plan (.npz) or its motion (.csv).")
]
HtmlOption = Annotated[Path | None, typer.Option(help="Write a replay to open in a browser.")]


def relaxation(text: str) -> sm.Relaxation:
    """Return what --relax describes."""
    rest, _, window = text.partition("@")
    rows, _, band = rest.partition("=")
    try:
        first, last = (float(time) for time in window.split(":")) if window else (0.0, 0.0)
        return sm.Relaxation(
            tuple(rows.split(",")),
            float(band) if band else np.inf,
            (first, last) if window else None,
        )
    except ValueError:
        raise sm.ProblemError(
            f"--relax is '{text}', expected ROWS[=BAND][@FROM:TO] like rx,ry=0.2 or rz@1:2.5"
        ) from None


def search_settings(mode: SearchMode | None, compare: bool) -> sm.Search | None:
    """Return how to search where the user says something about it."""
    if mode is None and not compare:
        return None
    return sm.Search(mode=mode or "auto", compare=compare)


def numbers(text: str, option: str, count: int | None = None) -> Array:
    """Return the numbers of an option, so many if a count is given."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise sm.ProblemError(f"{option} is '{text}', expected numbers like 0,-0.8,1.6") from None
    if count is not None and len(numbers) != count:
        raise sm.ProblemError(f"{option} has {len(numbers)} numbers, expected {count}")
    return numbers
