"""The commands around one plan: parse, call, print."""

import json
import math
import os
from pathlib import Path
from typing import Annotated, Any

import typer

import selfmotion as sm
from selfmotion.basics import held_interruption, write_text
from selfmotion.shell.cli import (
    checks,
    documents,
    jobs,
    judging,
    options,
    outputs,
    summaries,
    tables,
)
from selfmotion.shell.cli.app import (
    FILES,
    LOOK,
    NOT_VERIFIED,
    PLAN,
    VERIFIED,
    StageDisplay,
    app,
    fastest_with_progress,
    plan_with_progress,
    print_json,
    stages,
    terminal,
)
from selfmotion.shell.documents import MAYBE, example_texts, json_schema


@app.command(
    epilog="Example: selfmotion plan panda --circle 0.15 --duration 4 --out plan.npz --html a.html"
    "; or: selfmotion plan cell.toml",
    rich_help_panel=PLAN,
)
@options.of_table(documents.Shell, after="problem")
def plan(
    context: typer.Context,
    problem: options.ProblemArgument,
    warm: options.FromOption = None,
    settings: options.SetOption = None,
    max_evaluations: options.LimitOption = None,
    deadline: options.DeadlineOption = None,
    search: options.SearchOption = None,
    compare: options.CompareOption = False,
    allow_code: options.AllowCodeOption = False,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    force: options.ForceOption = False,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan a motion, check it, and write it."""
    with held_interruption():
        warm_start = None if warm is None else sm.load_plan(warm)
        job = documents.read(context, problem, settings or [], allow_code, warm_start)
    outputs.check_own(job.outputs, problem, force)
    if job.goal != "parts":
        outputs.check_suffixes([*job.outputs, *(out or [])])
    choices = {
        "max_evaluations": max_evaluations,
        "search": options.search_of(search, compare, job.search),
        "deadline": deadline,
    }
    chosen = {key: value for key, value in choices.items() if value is not None}
    remarks = job.remarks
    outputs.print_notes(remarks)
    job.check_used(job.goal)
    if job.goal == "parts":
        options.refuse_unused({"from": warm, **chosen}, "a motion in parts")
        jobs.finish_parts(job, [*(out or []), *([] if html is None else [html])], as_json, verbose)
    if job.goal == "fastest":
        options.refuse_unused({"from": warm, **chosen}, "the fastest motion")
        result = fastest_with_progress(job).plan
    elif job.goal == "retimed":
        planned = plan_with_progress(
            job.problem, warm_start=warm_start, **{**job.settings, **chosen}
        )
        result = sm.retime(planned)
    else:
        result = plan_with_progress(
            job.problem, warm_start=warm_start, **{**job.settings, **chosen}
        )
    outputs.finish(result, [*job.outputs, *(out or [])], html, as_json, verbose, remarks=remarks)


@app.command(
    epilog="Example: selfmotion init panda; then: selfmotion plan panda.toml; or: selfmotion init "
    "arm.xacro --job --out seams.toml",
    rich_help_panel=FILES,
)
def init(
    robot: Annotated[
        str, typer.Argument(help="Name (see `selfmotion robots`), or a .urdf or .xacro file.")
    ],
    out: Annotated[Path | None, typer.Option(help="File; by default ROBOT.toml.")] = None,
    tool: options.ToolOption = None,
    lock: options.LockOption = None,
    argument: options.ArgumentOption = None,
    packages: options.PackagesOption = None,
    job: Annotated[bool, typer.Option("--job", help="Of many seams: selfmotion job FILE.")] = False,
    positioner: Annotated[
        bool,
        typer.Option("--positioner", help="Write a cell that has a table that tilts and turns."),
    ] = False,
    no_collision: options.NoCollisionOption = False,
    srdf: options.SrdfOption = None,
    disabled: options.DisabledOption = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file.")] = False,
) -> None:
    """Write a commented problem file to begin with; for an arm from a file it is tried first."""
    file = Path(f"{Path(robot).stem}.toml") if out is None else out
    if os.path.exists(file) and not force:
        raise sm.errors.FileFormatError(f"{file}: is there already; give --out or --force")
    texts = example_texts(
        robot,
        file,
        tool=tool,
        job=job,
        positioner=positioner,
        lock=options.locks(lock),
        arguments=options.arguments(argument),
        packages=packages or (),
        clearance=not no_collision,
        srdf=srdf,
        disabled=options.disabled_pairs(disabled),
    )
    text = next(texts) if robot in sm.NAMED_ARMS else documents.first_that_runs(texts, file, job)
    write_text(file, text)
    if MAYBE in text:
        pairs = [line[2:] for line in text.splitlines() if ": overlap in " in line]
        listed = "; ".join(pairs)
        outputs.print_notes([f"left out in {file}, as these links {MAYBE}: {listed}"])
    terminal.print(f"wrote {file}", markup=False, soft_wrap=True)


@app.command(epilog="Example: selfmotion schema --out problem.schema.json", rich_help_panel=FILES)
def schema(
    out: Annotated[Path | None, typer.Option(help="File; by default the terminal.")] = None,
) -> None:
    """Write the JSON Schema of problem files, for completion in an editor."""
    text = json.dumps(json_schema(), indent=1)
    if out is None:
        typer.echo(text)
        return
    write_text(out, text + "\n")
    terminal.print(f"wrote {out}", markup=False, soft_wrap=True)


@app.command(
    epilog="Example: selfmotion check motion.csv --robot panda --path seam.csv --acceleration 10",
    rich_help_panel=LOOK,
)
@options.of_table(documents.Shell, after="robot", names=("path", *documents.OF_PATH))
def check(
    context: typer.Context,
    file: options.CheckedArgument,
    robot: options.RobotOption = None,
    task: options.CheckedTaskOption = None,
    tool: options.ToolOption = None,
    reference: options.ReferenceOption = None,
    lock: options.LockOption = None,
    argument: options.ArgumentOption = None,
    packages: options.PackagesOption = None,
    calibration: options.CalibrationOption = None,
    degrees: options.DegreesOption = False,
    velocity: options.VelocityOption = None,
    acceleration: options.AccelerationOption = None,
    joint_limits: options.JointLimitsOption = None,
    obstacles: options.ObstaclesOption = None,
    clearance: options.ClearanceOption = 0.0,
    srdf: options.SrdfOption = None,
    disabled: options.DisabledOption = None,
    no_collision: options.NoCollisionOption = False,
    tolerance: options.ToleranceOption = None,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Verify a motion by forward kinematics: a saved plan, or one made elsewhere.

    One made elsewhere by what plan keeps: limits of the arm and of its maker, and self-collision.
    """
    # With their types, those of the signature; options of the path are the context's alone.
    request = judging.Asked(file, context.params | locals())
    request.refuse_others()
    if request.is_job:
        jobs.check(file, as_json, verbose)
    if request.is_of_program:
        checks.of_program(file, Path(robot or ""), request.within, as_json, verbose)
    with StageDisplay(stages) as display:
        judged = request.judged(display.stage)
    outputs.print_notes(judged.notes)
    if as_json:
        data = summaries.certificate_json(judged.certificate, judged.near)
        data["remarks"] = [*judged.notes, *data["remarks"]]
        print_json(data | checks.left_to_controller(judged.program))
    else:
        outputs.show_certificate(judged.certificate, judged.near, judged.arm, verbose)
        checks.print_controller_note(judged.program)
    raise typer.Exit(VERIFIED if judged.certificate.verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion compare a.npz b.npz", rich_help_panel=LOOK)
def compare(
    plans: Annotated[list[Path], typer.Argument(help="Plans saved as .npz.")],
    cost: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME[=WEIGHT] that all are measured by, such as JointAcceleration=0.1. "
            "Repeatable; by default each by the costs that it was made for."
        ),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Compare plans: costs, durations, margins and verdicts, side by side."""
    saved = {str(file): sm.load_plan(file) for file in plans}
    robots = [plan.robot for plan in saved.values()]
    table = sm.compare(saved, costs=documents.costs_of(cost, robots[0]) if cost else None)
    if as_json:
        told = {name: summaries.plan_json(plan) for name, plan in saved.items()}
        for number, data in enumerate(told.values() if cost else ()):
            data["measured"] = {name: each[number] for name, each in table.costs.items()}
        print_json(told)
    else:
        tables.show_comparison(table, terminal)


@app.command(
    epilog="Example: selfmotion replay plan.npz --html replay.html --png 1.5 --gif motion.gif",
    rich_help_panel=LOOK,
)
def replay(
    plans: Annotated[
        list[Path], typer.Argument(help="Plans saved as .npz, of one robot; or one .program.")
    ],
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("replay.html"),
    png: Annotated[
        float | None, typer.Option(help="Also draw the scene at this time (s), beside the page.")
    ] = None,
    gif: Annotated[Path | None, typer.Option(help="Also draw the motion as a GIF.")] = None,
    meshcat: Annotated[
        Path | None,
        typer.Option(help="Also write a page of meshcat's own viewer, of the first plan."),
    ] = None,
    redundancy: Annotated[
        Path | None,
        typer.Option("--map", help="Also write a plan's redundancy map: .png, or .npz with all."),
    ] = None,
) -> None:
    """Write an offline page that replays plans in a browser, several side by side.

    Pictures of the scene need a browser (chromium) on this machine.
    """
    from selfmotion.shell.replay import (
        check_pictures,
        render_gif,
        render_png,
        write_meshcat,
        write_replay,
    )

    if png is not None or gif is not None:
        check_pictures()
    if redundancy is not None:
        _check_map(redundancy, plans)
    if len(plans) == 1 and plans[0].suffix == jobs.PROGRAM:
        saved: Any = sm.load_program(plans[0])
        first = saved
    else:
        saved = [sm.load_plan(plan) for plan in plans]
        first = saved[0]
    if png is not None and not 0.0 <= png <= first.trajectory.duration:
        lasts = f"the motion lasts {first.trajectory.duration:.6g} s"
        raise sm.errors.RenderError(f"--png: there is no picture at t = {png:g} s: {lasts}")
    labels = [plan.stem for plan in plans] if len(plans) > 1 else None
    written = [write_replay(saved, html, labels=labels)]
    if png is not None:
        written.append(render_png(first, html.with_suffix(".png"), t=png))
    if gif is not None:
        with StageDisplay(stages) as display:
            written.append(render_gif(first, gif, progress=display.stage))
    if meshcat is not None:
        written.append(write_meshcat(first, meshcat))
    if redundancy is not None:
        shown = first.redundancy_map()
        write = shown.save_png if redundancy.suffix == ".png" else shown.save
        written.append(write(redundancy))
    for file in written:
        terminal.print(f"wrote {file}", markup=False, soft_wrap=True)


def _check_map(file: Path, plans: list[Path]) -> None:
    """Refuse a map of several plans or of a program, and files of other kinds."""
    if file.suffix not in (".png", ".npz"):
        raise sm.errors.RenderError(f"--map: {file} is neither a .png nor a .npz file")
    if len(plans) != 1 or plans[0].suffix == jobs.PROGRAM:
        raise sm.errors.RenderError("--map: a redundancy map is of one plan")


# The commands that change how fast motions are.


@app.command(
    epilog="Example: selfmotion retime plan.npz --acceleration 8 --out fast.npz",
    rich_help_panel=PLAN,
)
def retime(
    file: Annotated[Path, typer.Argument(help="A plan saved as .npz.")],
    acceleration: options.AccelerationOption = None,
    velocity: options.VelocityOption = None,
    rate: Annotated[
        float | None,
        typer.Option(
            help="Samples per second that a controller takes: limits are kept between these."
        ),
    ] = None,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Retime a plan: the same joint path in the least time within limits."""
    outputs.check_suffixes(out or [])
    with StageDisplay(stages) as display:
        display.stage("retiming", 1, 1)
        a, v = _limits(acceleration, velocity)
        result = sm.retime(sm.load_plan(file), a, v, rate)
    outputs.finish(result, out or [], html, as_json, verbose)


@app.command(
    epilog="Example: selfmotion fastest cell.toml --deadline 60 --out fast.npz",
    rich_help_panel=PLAN,
)
def fastest(
    problem: Annotated[str, typer.Argument(help="A problem file (.toml, .json).")],
    acceleration: options.AccelerationOption = None,
    velocity: options.VelocityOption = None,
    deadline: Annotated[
        float, typer.Option(help="Stop after so many seconds, with the best so far.")
    ] = 60.0,
    keep: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=FACTOR", help="Most that a cost may be, as a multiple of its optimum."
        ),
    ] = None,
    settings: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    force: options.ForceOption = False,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Find the fastest motion along a path, whatever its own timing; Ctrl-C keeps the best."""
    if Path(problem).suffix not in documents.SUFFIXES:
        raise sm.errors.ProblemError(
            f"{problem}: expected a problem file ({', '.join(documents.SUFFIXES)}); "
            f"selfmotion init writes one"
        )
    job = documents.of_file(Path(problem), settings or [], allow_code)
    outputs.check_own(job.outputs, problem, force)
    outputs.check_suffixes([*job.outputs, *(out or [])])
    limits = dict(zip(("acceleration", "velocity"), _limits(acceleration, velocity), strict=True))
    if keep:
        pairs = [_factor(text) for text in keep]
        options.refuse_twice("--keep", [kind for kind, _ in pairs])
        limits["keep"] = {**(job.keep or {}), **dict(pairs)}
    remarks = job.remarks
    outputs.print_notes(remarks)
    planned = fastest_with_progress(job, deadline=deadline, **limits)
    if not as_json:
        stages.print(
            f"{planned.duration:.4g} s; lowest cost, retimed: {_time(planned.retimed)}, "
            f"minimum-norm motion retimed: {_time(planned.pseudo_inverse)}; "
            f"{planned.status.message}",
            markup=False,
            soft_wrap=True,
        )
    outputs.finish(
        planned.plan, [*job.outputs, *(out or [])], html, as_json, verbose, remarks=remarks
    )


def _time(seconds: float) -> str:
    return f"{seconds:.4g} s" if math.isfinite(seconds) else "violates a constraint at any pace"


def _factor(text: str) -> tuple[str, float]:
    kind, _, factor = text.partition("=")
    try:
        return kind, float(factor)
    except ValueError:
        raise sm.errors.ProblemError(
            f"--keep {text}: expected a cost and a factor, such as JointVelocity=1.1"
        ) from None


def _limits(acceleration: str | None, velocity: str | None) -> tuple[Any, ...]:
    named = ((acceleration, "--acceleration"), (velocity, "--velocity"))
    return tuple(None if text is None else options.one_or_each(text, name) for text, name in named)
