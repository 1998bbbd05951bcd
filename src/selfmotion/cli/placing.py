"""The commands that look for a place, or for a motion that bears another one."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer

import selfmotion as sm
from selfmotion.batch import processes
from selfmotion.cli import documents, options, outputs
from selfmotion.cli.app import NOT_VERIFIED, PLAN, VERIFIED, app, stages, terminal
from selfmotion.cli.stage_display import StageDisplay

_Range = Annotated[str | None, typer.Option(help="Range of displacements: low,high (m).")]
_Turn = Annotated[str | None, typer.Option(help="Range of rotations: low,high (rad).")]
_PROBLEMS, _PAGES = (".toml", ".json"), (".html", ".png")


@app.command(
    epilog="Example: selfmotion place cell.toml --x=-0.2,0.2 --yaw=-0.5,0.5 --part block --out "
    "placed.toml --map map.html",
    rich_help_panel=PLAN,
)
def place(
    files: Annotated[list[Path], typer.Argument(help="Problem files, of one arm.")],
    x: _Range = None,
    y: _Range = None,
    z: _Range = None,
    roll: _Turn = None,
    pitch: _Turn = None,
    yaw: _Turn = None,
    base: Annotated[
        bool, typer.Option("--base", help="Move the arm's base, not the part.")
    ] = False,
    part: Annotated[
        list[str] | None,
        typer.Option(help="An obstacle that belongs to the part (may be given several times)."),
    ] = None,
    path_alone: Annotated[
        bool, typer.Option("--path-alone", help="No obstacle moves along with the path.")
    ] = False,
    center: Annotated[
        str | None,
        typer.Option(help="Centre of rotation: x,y,z (m); by default the middle of the paths."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Processes; by default this one alone.", min=1)
    ] = None,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            help="Problem file (.toml, .json) or plan (.npz) at the place; of several problems "
            "numbered. Repeatable."
        ),
    ] = None,
    drawn: Annotated[
        list[Path] | None,
        typer.Option("--map", help="Map of places around it, as .html or .png. Repeatable."),
    ] = None,
    points: Annotated[int, typer.Option(help="Points of the map in each direction.", min=2)] = 9,
    settings: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
) -> None:
    """Find the place of the part, or of the arm, at which the motions cost least."""
    if part and path_alone:
        raise sm.errors.ProblemError(
            "--part and --path-alone say different things; give one of them"
        )
    for file in [*(out or []), *(drawn or [])]:
        known = (*_PROBLEMS, ".npz") if file in (out or []) else _PAGES
        if file.suffix not in known:
            raise sm.errors.FileFormatError(
                f"{file}: expected a name that ends in {', '.join(known)}"
            )
    problems = [documents.of_file(file, settings or [], allow_code).problem for file in files]
    named = {"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw}
    within = {
        name: options.numbers(text, f"--{name}", 2)
        for name, text in named.items()
        if text is not None
    }
    given: dict[str, Any] = {"of": "base" if base else "part"}
    if part or path_alone:
        given["part"] = part or ()
    if center is not None:
        given["center"] = options.numbers(center, "--center", 3)
    with ExitStack() as stack:
        display = stack.enter_context(StageDisplay(stages))
        if workers is not None:
            given["executor"] = stack.enter_context(processes(workers))
        found = sm.place(problems, within, progress=display.stage, **given)
    terminal.print(str(found), markup=False, soft_wrap=True)
    for file in out or []:
        _write(found, file)
    if drawn:
        pictured = found.map(points=points) if len(within) > 1 else None
        for file in drawn:
            if file.suffix == ".html":
                sm.files.write_placement(found, file, pictured)
            elif pictured is None:
                raise sm.errors.ProblemError(f"{file}: a picture of places is over two coordinates")
            else:
                pictured.figure().savefig(file)
            terminal.print(f"wrote {file}", markup=False, soft_wrap=True)


@app.command(
    "plan-margin",
    epilog="Example: selfmotion plan-margin cell.toml --position 0.005 --rotation 0.01 --out a.npz",
    rich_help_panel=PLAN,
)
def plan_margin(
    file: Annotated[Path, typer.Argument(help="A problem file.")],
    position: Annotated[float, typer.Option(help="By how much it may be shifted (m).")] = 0.0,
    rotation: Annotated[float, typer.Option(help="By how much it may be turned (rad).")] = 0.0,
    of: Annotated[
        list[str] | None, typer.Option(help="part (the default), tool or base. Repeatable.")
    ] = None,
    part: Annotated[
        list[str] | None,
        typer.Option(help="A body of the part (repeatable); by default all obstacles there."),
    ] = None,
    out: options.OutOption = None,
    settings: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
) -> None:
    """Plan a motion that tolerates displacements of part, tool or base."""
    outputs.check_suffixes(out or [])
    problem = documents.of_file(file, settings or [], allow_code).problem
    with StageDisplay(stages) as display:
        found = sm.plan_with_margin(
            problem,
            sm.Margin(position, rotation),
            of=of or "part",
            part=part or None,
            progress=display.stage,
        )
    terminal.print(str(found), markup=False, soft_wrap=True)
    outputs.write(found.plan, out or [], None, terminal, quiet=False)
    raise typer.Exit(VERIFIED if found.reached else NOT_VERIFIED)


def _write(found: sm.placement.Placement, file: Path) -> None:
    """Write the problems or plans of a place, numbered where they are several."""
    several = len(found.plans) > 1
    for number, plan in enumerate(found.plans):
        named = file.with_stem(f"{file.stem}-{number}") if several else file
        if named.suffix == ".npz":
            plan.save(named)
        else:
            sm.files.write_problem(plan.problem, named)
        terminal.print(f"wrote {named}", markup=False, soft_wrap=True)
