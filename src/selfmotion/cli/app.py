"""The command line: parse, call, print."""

import json
import sys
import traceback
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

import selfmotion as sm
from selfmotion import formats
from selfmotion.cli import documents, options, outputs, tables
from selfmotion.cli.batch_display import BatchDisplay, executor_at
from selfmotion.cli.remedies import in_shell
from selfmotion.cli.showcase import panda_past_a_box
from selfmotion.cli.stage_display import StageDisplay

app = typer.Typer(
    help="Plan the joint motion of a redundant arm along a tool motion.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
_console = tables.console()
# Apart from the results, so that these can be piped.
_stages = Console(stderr=True, highlight=False)

VERIFIED, NOT_VERIFIED, BAD_INPUT, FAILED = 0, 1, 2, 3


def main() -> None:
    """Run the command; exit code 2 and one line for bad input, 3 for a fault of ours."""
    try:
        app()
    except sm.SelfmotionError as error:
        _complain(f"error: {in_shell(str(error))}")
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
    "; or: selfmotion plan cell.toml"
)
def plan(
    context: typer.Context,
    problem: options.ProblemArgument,
    path: options.PathOption = None,
    circle: options.CircleOption = None,
    line: options.LineOption = None,
    normal: options.NormalOption = None,
    duration: options.DurationOption = None,
    feed: options.FeedOption = None,
    jump: options.JumpOption = None,
    frame: options.FrameOption = None,
    ramp: options.RampOption = None,
    corners: options.CornersOption = "blend",
    corner_tolerance: options.CornerToleranceOption = None,
    task: options.PlannedTaskOption = None,
    relax: options.RelaxOption = None,
    start: options.StartOption = None,
    warm: options.FromOption = None,
    tool: options.ToolOption = None,
    lock: options.LockOption = None,
    degree: options.DegreeOption = 3,
    mu: options.MuOption = 0.0,
    cost: options.CostOption = None,
    velocity: options.VelocityOption = None,
    acceleration: options.AccelerationOption = None,
    joint_limits: options.JointLimitsOption = None,
    closed: options.ClosedOption = False,
    obstacles: options.ObstaclesOption = None,
    clearance: options.ClearanceOption = 0.0,
    srdf: options.SrdfOption = None,
    no_collision: options.NoCollisionOption = False,
    damped: options.DampedOption = False,
    settings: options.SetOption = None,
    max_evaluations: options.LimitOption = None,
    search: options.SearchOption = None,
    compare: options.CompareOption = False,
    allow_code: options.AllowCodeOption = False,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Plan a motion, check it, and write it."""
    warm_start = None if warm is None else sm.load_plan(warm)
    job = documents.read(context, problem, settings or [], allow_code, warm_start)
    outputs.check_suffixes([*job.outputs, *(out or [])])
    asked = {"max_evaluations": max_evaluations, "search": options.search_of(search, compare)}
    given = {key: value for key, value in asked.items() if value is not None}
    result = _plan_with_progress(job.problem, warm_start=warm_start, **{**job.settings, **given})
    if as_json:
        _console.print_json(data=tables.plan_json(result))
    else:
        tables.show(result, _console)
    outputs.write(result, [*job.outputs, *(out or [])], html, _console, quiet=as_json)
    raise typer.Exit(VERIFIED if result.certificate.verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion init panda; then: selfmotion plan panda.toml")
def init(
    robot: Annotated[str, typer.Argument(help="Name (see `selfmotion robots`).")],
    out: Annotated[Path | None, typer.Option(help="File; by default ROBOT.toml.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file.")] = False,
) -> None:
    """Write a commented problem file to begin with."""
    file = Path(f"{robot}.toml") if out is None else out
    text = formats.example_text(robot, file.name)
    if file.exists() and not force:
        raise sm.FileFormatError(f"{file}: is there already; give --out or --force")
    formats.write_text(file, text)
    _console.print(f"wrote {file}", markup=False, soft_wrap=True)


@app.command(epilog="Example: selfmotion schema --out problem.schema.json")
def schema(
    out: Annotated[Path | None, typer.Option(help="File; by default the terminal.")] = None,
) -> None:
    """Write the JSON Schema of problem files, for completion in an editor."""
    text = json.dumps(formats.json_schema(), indent=1)
    if out is None:
        typer.echo(text)
        return
    formats.write_text(out, text + "\n")
    _console.print(f"wrote {out}", markup=False, soft_wrap=True)


@app.command(
    epilog="Example: selfmotion check motion.csv --robot panda --path seam.csv --acceleration 10"
)
def check(
    file: options.CheckedArgument,
    robot: options.RobotOption = None,
    path: options.PathOption = None,
    feed: options.FeedOption = None,
    corners: options.CheckedCornersOption = None,
    task: options.CheckedTaskOption = None,
    tool: options.ToolOption = None,
    lock: options.LockOption = None,
    degrees: options.DegreesOption = False,
    velocity: options.VelocityOption = None,
    acceleration: options.AccelerationOption = None,
    joint_limits: options.JointLimitsOption = None,
    obstacles: options.ObstaclesOption = None,
    clearance: options.ClearanceOption = 0.0,
    srdf: options.SrdfOption = None,
    tolerance: options.ToleranceOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Check a motion by forward kinematics: a saved plan, or one that something else made."""
    judged = velocity, acceleration, joint_limits, obstacles, clearance, srdf
    within = None if tolerance is None else sm.Tolerance(tolerance, tolerance)
    if file.suffix == ".npz":
        own: dict[str, Any] = {
            "robot": robot,
            "path": path,
            "feed": feed,
            "corners": corners,
            "task": task,
        }
        own |= {"tool": tool, "lock": lock, "degrees": degrees or None}
        for name, value in own.items():
            if value:
                raise sm.ProblemError(f"{file}: --{name} is the plan's own: leave it out")
        plan = sm.load_plan(file)
        certificate = plan.certificate
        if within is not None or any(judged):
            asked = options.requirements(plan.robot, *judged)
            certificate = plan.check(within, asked)
    else:
        if robot is None or path is None:
            raise sm.ProblemError(
                f"{file}: a motion is checked against a robot and a path: give --robot and --path"
            )
        arm = sm.load_robot(robot, tool=tool, lock=options.locks(lock or []))
        certificate = sm.certify(
            arm,
            formats.read_path(path, feed=feed, corners=corners or "blend"),
            task or "pose",
            sm.read_motion(file, degrees=degrees),
            within,
            options.requirements(arm, *judged),
        )
    if as_json:
        _console.print_json(data=tables.certificate_json(certificate))
    else:
        tables.show_certificate(certificate, _console)
    raise typer.Exit(VERIFIED if certificate.verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion export plan.npz --out motion.yaml --rate 500")
def export(
    file: Annotated[Path, typer.Argument(help="A plan saved as .npz.")],
    out: Annotated[
        list[Path],
        typer.Option(
            help="File: .csv, .npz, .json, .yaml (ROS 2 JointTrajectory), .xml (MuJoCo keyframes), "
            ".script (URScript). Repeatable."
        ),
    ],
    rate: Annotated[
        float | None, typer.Option(help="Samples per second; by default the plan's own.")
    ] = None,
    form: Annotated[
        str | None,
        typer.Option("--format", help=f"Whatever the suffix: {', '.join(formats.FORMS)}."),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Write a plan's motion for controllers and simulators, and check what was written."""
    saved = sm.load_plan(file)
    verified, verdicts = not saved.altered, dict[str, str]()
    for target in out:
        sm.write_motion(saved, target, rate=rate, form=form)
        if form in formats.READABLE or (form is None and target.suffix not in (".xml", ".script")):
            found = saved.problem.certify(
                sm.read_motion(target), saved.tolerance, saved.report.ending
            )
            verified = verified and found.verified
            verdicts[str(target)] = f"read back: {found.verdict}"
        else:
            verified = verified and saved.certificate.verified
            verdicts[str(target)] = ""
    miss = formats.linear_miss(saved, rate)
    if as_json:
        _console.print_json(
            data={"verified": verified, "written": verdicts, "linear_miss": miss._asdict()}
        )
        raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)
    for name, verdict in verdicts.items():
        _console.print(f"wrote {name}{verdict and '; '}{verdict}", markup=False, soft_wrap=True)
    _console.print(
        f"joined by straight lines, the samples stay within {miss.position:.2g} m and "
        f"{miss.rotation:.2g} rad of the motion; --rate {miss.rate:.0f} keeps the plan's tolerance",
        markup=False,
        soft_wrap=True,
    )
    raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion compare a.npz b.npz")
def compare(
    plans: Annotated[list[Path], typer.Argument(help="Plans saved as .npz.")],
    as_json: options.JsonOption = False,
) -> None:
    """Compare plans: costs, durations, margins and verdicts, side by side."""
    saved = {str(file): sm.load_plan(file) for file in plans}
    if as_json:
        _console.print_json(data={name: tables.plan_json(plan) for name, plan in saved.items()})
    else:
        tables.show_comparison(saved, _console)


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
        _console.print(f"wrote {file}", markup=False, soft_wrap=True)


@app.command(epilog="Example: selfmotion batch cell.toml --workers 2 --out out/batch")
def batch(
    files: Annotated[
        list[Path], typer.Argument(help="Problem files; of a [grid], all combinations.")
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for plans and tables; a run that was killed goes on there.")
    ] = Path("out/batch"),
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; by default one for each core.")
    ] = None,
    dask: Annotated[
        str | None, typer.Option(help="Or the address of a Dask scheduler, host:port.")
    ] = None,
    replays: Annotated[
        int, typer.Option(min=0, help="Write replays of so many of the best plans.")
    ] = 3,
    allow_code: options.AllowCodeOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan many problems at once, into a folder with a ranked table."""
    from selfmotion.batch import grid_items, plan_items

    items = [item for file in files for item in grid_items(file, allow_code=allow_code)]
    names = [item.name for item in items]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise sm.ProblemError(f"two problem files are called '{twice}'; rename one of them")
    try:
        with executor_at(dask) as executor, BatchDisplay(_stages) as display:
            result = plan_items(
                items, executor, out=out, workers=workers, replays=replays, progress=display.show
            )
    except KeyboardInterrupt:
        _complain(f"stopped; what is finished is in '{out}': run again to go on")
        raise typer.Exit(NOT_VERIFIED) from None
    if as_json:
        _console.print_json(data=tables.batch_json(result))
    else:
        tables.show_batch(result, _console)
    sound = all(row.verified for row in result.rows)
    raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion robots")
def robots(as_json: options.JsonOption = False) -> None:
    """List the arms known by name: joints, tool frame, and redundancy for each task."""
    arms = {name: sm.load_robot(name) for name in sm.NAMED_ARMS}
    if as_json:
        _console.print_json(data=tables.robots_json(arms))
    else:
        tables.show_robots(arms, _console)


@app.command(epilog="Example: selfmotion demo --out out")
def demo(
    out: Annotated[Path, typer.Option(help="Folder for plans and replays.")] = Path("out"),
) -> None:
    """Plan, check and replay the paper's planar arm, and a Panda that draws circles past a box."""
    problems = {"planar": sm.sample_problem(), "panda": panda_past_a_box()}
    verified = True
    for name, problem in problems.items():
        _console.print(name, style="bold", markup=False)
        result = _plan_with_progress(problem)
        tables.show(result, _console)
        files = [out / f"{name}.npz", out / f"{name}.csv"]
        outputs.write(result, files, out / f"{name}.html", _console)
        verified = verified and result.certificate.verified
    tracked = sm.plan_by(problem, sm.PseudoInverse()).certificate
    _console.print(
        f"the pseudo-inverse on the same problem: {tracked.verdict}", markup=False, soft_wrap=True
    )
    raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion track --seconds 12 --out out/track")
def track(
    task: options.TaskOption = "pose",
    seconds: Annotated[float, typer.Option(help="How long (s).", min=1.0, max=600.0)] = 12.0,
    horizon: Annotated[float, typer.Option(help="Planned ahead (s).", min=0.1)] = 2.0,
    seed: Annotated[int, typer.Option(help="Of the noise.", min=0)] = 0,
    out: Annotated[Path, typer.Option(help="Folder for replay and histogram.")] = Path("out/track"),
) -> None:
    """Plan while the arm moves: a simulated Panda keeps up with a conveyor.

    It answers late, is measured with noise, and is pushed off its command at 3 s; at 6 s a ball
    appears beside its elbow. Exit code 0 if all limits were kept.
    """
    from selfmotion.cli import tracking

    replanner, record, result = tracking.conveyor_run(task, seconds, seed, horizon)
    kept = tracking.show(replanner, record, tracking.least_distance(result), _console)
    for file in tracking.write(record, result, out):
        _console.print(f"wrote {file}", markup=False)
    raise typer.Exit(VERIFIED if kept else NOT_VERIFIED)


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
    from selfmotion.study import PARTS, Scale, require_matplotlib, run, write

    # Before minutes of work that could not be shown.
    require_matplotlib()
    scale = Scale.reduced() if reduced else Scale.full()
    with StageDisplay(_stages) as display:
        result = run(scale, lambda part: display.stage(part, PARTS.index(part) + 1, len(PARTS)))
    files = write(result, out)
    tables.show_claims(result.claims, _console)
    _console.print(f"wrote {files[0]} and {len(files) - 1} files beside it", markup=False)


def _plan_with_progress(problem: sm.Problem, **options: Any) -> sm.Plan:
    with StageDisplay(_stages) as display:
        return sm.plan(problem, callback=display.iteration, progress=display.stage, **options)
