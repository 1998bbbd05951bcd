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
    parts,
    result_json,
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
    print_written,
    stages,
    terminal,
)
from selfmotion.shell.documents import MAYBE, example_texts, json_schema, parse_setting, set_key
from selfmotion.shell.facts import certificate_facts, facts_of_program


@app.command(
    epilog="Example: selfmotion plan panda --path seam.csv --feed 0.05 --out plan.npz --html a.html"
    "; or: selfmotion plan cell.toml --set path.feed=0.04",
    rich_help_panel=PLAN,
)
def plan(
    problem: options.ProblemArgument,
    path: options.PathOption = None,
    feed: options.FeedOption = None,
    frame: options.FrameOption = None,
    task: options.TaskOption = None,
    start: options.StartOption = None,
    tool: options.ToolOption = None,
    settings: options.SetOption = None,
    warm: options.FromOption = None,
    deadline: options.DeadlineOption = None,
    allow_code: options.AllowCodeOption = False,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    force: options.ForceOption = False,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan a motion, check it, and write it.

    Whatever a problem file says can be set: `selfmotion schema` has its keys. With goal=fastest it
    is the fastest motion along the path, whatever its own timing.
    """
    said = documents.Said(settings, path, feed, frame, task, start, tool)
    with held_interruption():
        warm_start = None if warm is None else sm.load_plan(warm)
        begin = None if warm_start is None else warm_start.trajectory.q[0].tolist()
        job = documents.read(problem, said, allow_code, start=begin)
    outputs.check_own(job.outputs, problem, force)
    if job.goal != "parts":
        outputs.check_suffixes([*job.outputs, *(out or [])])
    remarks = job.remarks
    outputs.print_notes(remarks)
    job.check_used(job.goal)
    given = {} if deadline is None else {"deadline": deadline}
    if job.goal == "parts":
        options.refuse_unused({"from": warm, **given}, "a motion in parts")
        parts.finish_parts(job, [*(out or []), *([] if html is None else [html])], as_json, verbose)
    if job.goal == "fastest":
        options.refuse_unused({"from": warm}, "the fastest motion")
        result = _fastest(job, as_json, **given)
    else:
        result = plan_with_progress(job.problem, warm_start=warm_start, **{**job.settings, **given})
        if job.goal == "retimed":
            result = sm.retime(result)
    outputs.finish(result, [*job.outputs, *(out or [])], html, as_json, verbose, remarks=remarks)


def _fastest(job: sm.files.PlanRequest, as_json: bool, **given: float) -> sm.Plan:
    """Return the fastest motion of a job, and print what it is compared with."""
    planned = fastest_with_progress(job, **given)
    if not as_json:
        stages.print(
            f"{planned.duration:.4g} s; lowest cost, retimed: {_time(planned.retimed)}, "
            f"minimum-norm motion retimed: {_time(planned.pseudo_inverse)}; "
            f"{planned.status.message}",
            markup=False,
            soft_wrap=True,
        )
    return planned.plan


def _time(seconds: float) -> str:
    return f"{seconds:.4g} s" if math.isfinite(seconds) else "violates a constraint at any pace"


@app.command(
    epilog="Example: selfmotion init panda; then: selfmotion plan panda.toml; or: selfmotion init "
    "arm.xacro --job --out seams.toml",
    rich_help_panel=FILES,
)
def init(
    robot: options.ProblemArgument,
    out: options.OneOutOption = None,
    tool: options.ToolOption = None,
    settings: options.SetOption = None,
    job: Annotated[bool, typer.Option("--job", help="Of many seams: selfmotion job FILE.")] = False,
    positioner: Annotated[
        bool,
        typer.Option("--positioner", help="Write a cell that has a table that tilts and turns."),
    ] = False,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write a commented problem file to begin with; for an arm from a file it is tried first.

    By default it is ROBOT.toml. What --set may say of the arm is robot.lock, robot.arguments,
    robot.packages, and of its links clearance.disabled, clearance.srdf or clearance=false.
    """
    file = Path(f"{Path(robot).stem}.toml") if out is None else out
    if os.path.exists(file) and not force:
        raise sm.errors.FileFormatError(f"{file}: is there already; give --out or --force")
    texts = example_texts(
        robot, file, tool=tool, job=job, positioner=positioner, **_of_example(settings or [])
    )
    text = next(texts) if robot in sm.NAMED_ARMS else documents.first_that_runs(texts, file, job)
    write_text(file, text)
    if MAYBE in text:
        pairs = [line[2:] for line in text.splitlines() if ": overlap in " in line]
        listed = "; ".join(pairs)
        outputs.print_notes([f"left out in {file}, as these links {MAYBE}: {listed}"])
    print_written([file], as_json)


# Keys of a document that an example takes.
_OF_EXAMPLE = (
    *("robot.lock", "robot.arguments", "robot.packages"),
    *("clearance", "clearance.srdf", "clearance.disabled"),
)


def _of_example(settings: list[str]) -> dict[str, Any]:
    """Return what the shell says of an example, as `example_texts` takes it."""
    document: dict[str, Any] = {"robot": {}, "clearance": {}}
    documents.Said(settings).set_in(document, Path())
    clearance = document["clearance"]
    of_robot, of_links = document["robot"], clearance if isinstance(clearance, dict) else {}
    said = [*document, *(f"robot.{key}" for key in of_robot)]
    said += [f"clearance.{key}" for key in of_links]
    for key in said:
        if key not in ("robot", *_OF_EXAMPLE):
            raise sm.errors.ProblemError(
                f"--set {key}: an example takes {', '.join(_OF_EXAMPLE)}; change the file that is "
                f"written"
            )
    packages = of_robot.get("packages", [])
    of_robot["packages"] = [packages] if isinstance(packages, str) else packages
    return {**of_robot, "clearance": clearance is not False, **of_links}


@app.command(epilog="Example: selfmotion schema --out problem.schema.json", rich_help_panel=FILES)
def schema(out: options.OneOutOption = None) -> None:
    """Write the JSON Schema of problem files, for completion in an editor."""
    text = json.dumps(json_schema(), indent=1)
    if out is None:
        typer.echo(text)
        return
    write_text(out, text + "\n")
    print_written([out])


@app.command(
    epilog="Example: selfmotion check motion.csv --robot panda --path seam.csv --set "
    "constraints.JointAccelerationLimits.limit=10",
    rich_help_panel=LOOK,
)
def check(
    file: options.PlanArgument,
    robot: options.RobotOption = None,
    path: options.PathOption = None,
    feed: options.FeedOption = None,
    frame: options.FrameOption = None,
    task: options.TaskOption = None,
    tool: options.ToolOption = None,
    settings: options.SetOption = None,
    calibration: options.CalibrationOption = None,
    degrees: options.DegreesOption = False,
    tolerance: options.ToleranceOption = None,
    turn: options.TurnOption = None,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Verify a motion by forward kinematics: a saved plan, or one made elsewhere.

    One made elsewhere by what plan keeps: limits of the arm and of its maker, and self-collision.
    What is asked of it can be set, key by key. Without --turn, --tolerance counts for both.
    """
    said = documents.Said(settings, path, feed, frame, task, None, tool)
    within = judging.tolerance_of(tolerance, turn)
    request = judging.Asked(file, robot, said, calibration, degrees, within)
    request.refuse_others()
    if request.is_job:
        parts.check_saved(file, as_json, verbose)
    if request.is_of_program:
        checks.of_program(file, Path(robot or ""), within, as_json, verbose)
    with StageDisplay(stages) as display:
        judged = request.judged(display.stage)
    outputs.print_notes(judged.notes)
    if as_json:
        facts = certificate_facts(judged.certificate, judged.near, judged.arm)
        data = result_json.certificate_json(judged.certificate, judged.near, facts)
        data["remarks"] = [*judged.notes, *data["remarks"]]
        print_json(data | checks.left_to_controller(judged.program))
    else:
        outputs.show_certificate(judged.certificate, judged.near, judged.arm, verbose)
        checks.print_controller_note(judged.program)
    raise typer.Exit(VERIFIED if judged.certificate.verified else NOT_VERIFIED)


@app.command(epilog="Example: selfmotion compare a.npz b.npz", rich_help_panel=LOOK)
def compare(
    plans: options.PlansArgument,
    settings: options.SetOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Compare plans: costs, durations, margins and verdicts, side by side; or programs.

    By --set costs=… all are measured by the same costs; by default each by those that it was made
    for.
    """
    if all(file.suffix == jobs.PROGRAM for file in plans):
        options.refuse({"set": settings}, plans[0], "the program's")
        _compare_programs({str(file): sm.load_program(file) for file in plans}, as_json)
        return
    saved = {str(file): sm.load_plan(file) for file in plans}
    costs = _common_costs(settings or [], next(iter(saved.values())))
    table = sm.compare(saved, costs=costs)
    if as_json:
        told = {name: result_json.plan_json(plan) for name, plan in saved.items()}
        for number, data in enumerate(told.values() if costs else ()):
            data["measured"] = {name: each[number] for name, each in table.costs.items()}
        print_json(told)
    else:
        tables.show_comparison(table, terminal)


def _compare_programs(programs: dict[str, sm.Program], as_json: bool) -> None:
    """Print what is known of programs, side by side."""
    if as_json:
        print_json({name: result_json.program_json(each) for name, each in programs.items()})
    else:
        columns = {name: facts_of_program(each) for name, each in programs.items()}
        tables.show_side_by_side(columns, terminal)


def _common_costs(settings: list[str], plan: sm.Plan) -> list[sm.costs.Cost] | None:
    """Return the costs that all plans are measured by, None where each has its own."""
    document: dict[str, Any] = {}
    for text in settings:
        key, value = parse_setting(text)
        if key.partition(".")[0] != "costs":
            raise sm.errors.ProblemError(f"--set {key}: has no effect, expected costs")
        set_key(document, key, value)
    if not document:
        return None
    return list(documents.changed(plan.problem, documents.Said(settings)).costs)


@app.command(
    epilog="Example: selfmotion replay plan.npz --html replay.html --png 1.5 --gif motion.gif",
    rich_help_panel=LOOK,
)
def replay(
    plans: options.PlansArgument,
    html: options.HtmlOption = Path("replay.html"),
    png: Annotated[
        float | None, typer.Option(help="Also draw the scene at this time (s), beside the page.")
    ] = None,
    gif: Annotated[Path | None, typer.Option(help="Also draw the motion as a GIF.")] = None,
    meshcat: Annotated[
        Path | None,
        typer.Option(help="Also write a page of meshcat's own viewer, of the first plan."),
    ] = None,
    maps: options.MapOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Write an offline page that replays plans of one robot, several side by side, or a program.

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
    for file in maps or []:
        _check_map(file, plans)
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
    page = html or Path("replay.html")
    written = [write_replay(saved, page, labels=labels)]
    if png is not None:
        written.append(render_png(first, page.with_suffix(".png"), t=png))
    if gif is not None:
        with StageDisplay(stages) as display:
            written.append(render_gif(first, gif, progress=display.stage))
    if meshcat is not None:
        written.append(write_meshcat(first, meshcat))
    if maps:
        shown = first.redundancy_map()
        written += [
            shown.save_png(file) if file.suffix == ".png" else shown.save(file) for file in maps
        ]
    print_written(written, as_json)


def _check_map(file: Path, plans: list[Path]) -> None:
    """Refuse a map of several plans or of a program, and files of other kinds."""
    if file.suffix not in (".png", ".npz"):
        raise sm.errors.RenderError(f"--map: {file} is neither a .png nor a .npz file")
    if len(plans) != 1 or plans[0].suffix == jobs.PROGRAM:
        raise sm.errors.RenderError("--map: a redundancy map is of one plan")


@app.command(
    epilog="Example: selfmotion retime plan.npz --acceleration 8 --out fast.npz",
    rich_help_panel=PLAN,
)
def retime(
    file: options.PlanArgument,
    acceleration: options.AccelerationOption = None,
    velocity: options.VelocityOption = None,
    rate: options.RateOption = None,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Retime a plan: the same joint path in the least time within limits."""
    outputs.check_suffixes(out or [])
    planned = sm.load_plan(file)
    with StageDisplay(stages) as display:
        display.stage("retiming", 1, 1)
        a = options.one_or_each(acceleration, "--acceleration")
        v = options.one_or_each(velocity, "--velocity")
        result = sm.retime(planned, a, v, rate)
    outputs.finish(result, out or [], html, as_json, verbose)
