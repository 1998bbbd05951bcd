"""The command line: parse, call, print."""

import sys
import traceback
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

import selfmotion as sm
from selfmotion.cli import options, tables
from selfmotion.cli.stage_display import StageDisplay

app = typer.Typer(
    help="Plan the joint motion of a redundant arm along a tool motion.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
_console = Console(highlight=False)
# Apart from the results, so that these can be piped.
_stages = Console(stderr=True, highlight=False)

VERIFIED, NOT_VERIFIED, BAD_INPUT, FAILED = 0, 1, 2, 3


def main() -> None:
    """Run the command; exit code 2 and one line for bad input, 3 for a fault of ours."""
    try:
        app()
    except sm.SelfmotionError as error:
        _complain(f"error: {error}")
        sys.exit(BAD_INPUT)
    except Exception:
        # Not bad input, and no verdict: whoever reads exit codes must not take it for one.
        traceback.print_exc()
        _complain("selfmotion failed; this is a fault of the program, not of what it was given")
        sys.exit(FAILED)


def _complain(text: str) -> None:
    Console(stderr=True, highlight=False).print(text, style="red", markup=False, soft_wrap=True)


@app.command(
    epilog="Example: selfmotion plan panda --circle 0.15 --duration 4 --out plan.npz --html a.html"
)
def plan(
    robot: options.RobotArgument,
    path: options.PathOption = None,
    circle: options.CircleOption = None,
    line: options.LineOption = None,
    normal: options.NormalOption = "x",
    duration: options.DurationOption = 4.0,
    corners: options.CornersOption = "blend",
    task: options.TaskOption = "pose",
    relax: options.RelaxOption = None,
    start: options.StartOption = None,
    tool: options.ToolOption = None,
    degree: options.DegreeOption = 3,
    mu: options.MuOption = 0.0,
    damped: options.DampedOption = False,
    max_evaluations: options.LimitOption = None,
    search: options.SearchOption = None,
    compare: options.CompareOption = False,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
) -> None:
    """Plan a motion, check it, and write it."""
    _check_suffixes(out or [])
    arm = sm.load_robot(robot, tool=tool)
    rows = sm.Task.of(task)
    configuration = options.numbers(start, "--start") if start is not None else None
    motion: sm.Path
    if sum(option is not None for option in (path, circle, line)) != 1:
        raise sm.ProblemError("give the tool motion by one of --path, --circle and --line")
    if path is not None:
        motion = sm.Waypoints.from_csv(path, corners=corners)
    else:
        if configuration is None:
            configuration = arm.dexterous_configuration(rows)
        pose = arm.pose(configuration)
        if circle is not None:
            axis = np.eye(3)["xyz".index(normal)]
            motion = sm.Circle.around(pose, circle, duration, normal=axis)
        else:
            end = pose.copy()
            end.translation = pose.translation + options.numbers(line or "", "--line", 3)
            motion = sm.Line(pose, end, duration)
    costs: list[sm.Cost] = [sm.JointVelocity()]
    if mu != 0.0:
        costs.append(sm.InverseManipulability(mu))
    problem = sm.Problem(
        arm,
        motion,
        rows,
        configuration,
        sm.PolynomialNullMotion(degree),
        tuple(costs),
        relaxations=[options.relaxation(text) for text in relax or []],
        damping=sm.Damping() if damped else None,
    )
    result = _plan_with_progress(
        problem, max_evaluations=max_evaluations, search=options.search_settings(search, compare)
    )
    tables.show(result, _console)
    _write(result, out or [], html)
    raise typer.Exit(VERIFIED if result.certificate.verified else NOT_VERIFIED)


@app.command(
    epilog="Example: selfmotion check motion.csv --robot panda --path seam.csv --acceleration 10"
)
def check(
    file: options.CheckedArgument,
    robot: options.RobotOption = None,
    path: options.PathOption = None,
    corners: options.CornersOption = "blend",
    task: options.TaskOption = "pose",
    tool: options.ToolOption = None,
    lock: options.LockOption = None,
    degrees: options.DegreesOption = False,
    velocity: options.VelocityOption = None,
    acceleration: options.AccelerationOption = None,
    obstacles: options.ObstaclesOption = None,
    clearance: options.ClearanceOption = 0.0,
    srdf: options.SrdfOption = None,
    tolerance: options.ToleranceOption = 1e-6,
    as_json: options.JsonOption = False,
) -> None:
    """Check a motion by forward kinematics: a saved plan, or one that something else made."""
    if file.suffix == ".npz":
        certificate = sm.load_plan(file).certificate
    else:
        if robot is None or path is None:
            raise sm.ProblemError(
                f"{file}: a motion is checked against a robot and a path: give --robot and --path"
            )
        arm = sm.load_robot(robot, tool=tool, lock=options.locks(lock or []))
        certificate = sm.certify(
            arm,
            sm.Waypoints.from_csv(path, corners=corners),
            task,
            sm.Trajectory.from_csv(file, degrees=degrees),
            sm.Tolerance(tolerance, tolerance),
            options.requirements(arm, velocity, acceleration, obstacles, clearance, srdf),
        )
    if as_json:
        _console.print_json(data=tables.certificate_json(certificate))
    else:
        tables.show_certificate(certificate, _console)
    raise typer.Exit(VERIFIED if certificate.verified else NOT_VERIFIED)


@app.command(
    epilog="Example: selfmotion replay plan.npz --html replay.html --png 1.5 --gif motion.gif"
)
def replay(
    plans: Annotated[list[Path], typer.Argument(help="Plans saved as .npz, of one robot.")],
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("replay.html"),
    png: Annotated[
        float | None, typer.Option(help="Also draw the scene at this time (s), beside the page.")
    ] = None,
    gif: Annotated[Path | None, typer.Option(help="Also draw the motion as a GIF.")] = None,
) -> None:
    """Write a page that replays plans in a browser, offline; several get a switch.

    Pictures need a browser (chromium) on this machine.
    """
    from selfmotion.replay import render_gif, render_png, write_replay

    saved = [sm.load_plan(plan) for plan in plans]
    labels = [plan.stem for plan in plans] if len(plans) > 1 else None
    written = [write_replay(saved, html, labels=labels)]
    if png is not None:
        written.append(render_png(saved[0], html.with_suffix(".png"), t=png))
    if gif is not None:
        written.append(render_gif(saved[0], gif))
    for file in written:
        _console.print(f"wrote {file}", markup=False)


@app.command(epilog="Example: selfmotion robots")
def robots() -> None:
    """List the arms known by name: joints, tool frame, and redundancy for each task."""
    tables.show_robots({name: sm.load_robot(name) for name in sm.NAMED_ARMS}, _console)


@app.command(epilog="Example: selfmotion demo --out out")
def demo(
    out: Annotated[Path, typer.Option(help="Folder for plans and replays.")] = Path("out"),
) -> None:
    """Plan, check and replay the paper's planar arm and a Panda on a circle."""
    panda = sm.load_robot("panda")
    start = np.array(sm.NAMED_ARMS["panda"].home)
    circle = sm.Circle.around(panda.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))
    problems = {
        "planar": sm.sample_problem(),
        "panda": sm.Problem(panda, circle, start=start),
    }
    verified = True
    for name, problem in problems.items():
        _console.rule(name)
        result = _plan_with_progress(problem)
        tables.show(result, _console)
        files = [out / f"{name}.npz", out / f"{name}.csv"]
        _write(result, files, out / f"{name}.html")
        verified = verified and result.certificate.verified
    raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion study --out out/study")
def study(
    out: Annotated[Path, typer.Option(help="Folder for the report.")] = Path("out/study"),
    reduced: Annotated[
        bool, typer.Option("--reduced", help="Fewer starts, chains and arms: half a minute.")
    ] = False,
) -> None:
    """Re-run the paper: figures, tables and claims, as one HTML page, PNGs and JSON.

    Takes minutes. Needs matplotlib (the extra `plots`).
    """
    from selfmotion.study import PARTS, Scale, run, write

    scale = Scale.reduced() if reduced else Scale.full()
    with StageDisplay(_stages) as display:
        result = run(scale, lambda part: display.stage(part, PARTS.index(part) + 1, len(PARTS)))
    files = write(result, out)
    tables.show_claims(result.claims, _console)
    _console.print(f"wrote {files[0]} and {len(files) - 1} files beside it", markup=False)


def _plan_with_progress(problem: sm.Problem, **options: Any) -> sm.Plan:
    with StageDisplay(_stages) as display:
        return sm.plan(problem, callback=display.iteration, progress=display.stage, **options)


def _write(result: sm.Plan, out: list[Path], html: Path | None) -> None:
    for file in out:
        if file.suffix == ".csv":
            result.to_csv(file)
        else:
            result.save(file)
        _console.print(f"wrote {file}", markup=False)
    if html is not None:
        from selfmotion.replay import write_replay

        write_replay(result, html)
        _console.print(f"wrote {html}", markup=False)


def _check_suffixes(files: list[Path]) -> None:
    for file in files:
        if file.suffix not in (".csv", ".npz"):
            raise sm.FileFormatError(f"{file}: --out writes .npz (the plan) or .csv (its motion)")
