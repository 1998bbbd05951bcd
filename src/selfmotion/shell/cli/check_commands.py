"""The commands `check`, `compare` and `replay`."""

from pathlib import Path
from typing import Annotated, Any

import typer

import selfmotion as sm
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
    LOOK,
    NOT_VERIFIED,
    VERIFIED,
    StageDisplay,
    app,
    print_json,
    print_written,
    stages,
    terminal,
)
from selfmotion.shell.documents import parse_setting, set_key
from selfmotion.shell.facts import certificate_facts, facts_of_program


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
    """Verify a motion by forward kinematics: a saved plan, or a motion from elsewhere.

    A motion from elsewhere is checked against the arm's limits, its maker's limits and
    self-collision, as `plan` does. --set adds constraints. Without --turn, --tolerance applies to
    position and rotation alike.
    """
    typed = documents.DocumentOptions(settings, path, feed, frame, task, None, tool)
    within = judging.tolerance_of(tolerance, turn)
    request = judging.CheckRequest(file, robot, typed, calibration, degrees, within)
    request.refuse_others()
    if request.is_job:
        verified = parts.check_saved(file, as_json, verbose)
    elif request.is_of_program:
        verified = checks.check_program(file, Path(robot or ""), within, as_json, verbose)
    else:
        verified = _check_motion(request, as_json, verbose)
    raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)


def _check_motion(request: judging.CheckRequest, as_json: bool, verbose: bool) -> bool:
    """Judge a motion, print its certificate, and return whether it is verified."""
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
    return judged.certificate.verified


@app.command(epilog="Example: selfmotion compare a.npz b.npz", rich_help_panel=LOOK)
def compare(
    plans: options.PlansArgument,
    settings: options.SetOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Compare plans: costs, durations, margins and verdicts, side by side; or programs.

    --set costs=… evaluates all plans with the same costs. By default each has its own.
    """
    if all(file.suffix == jobs.PROGRAM for file in plans):
        options.refuse({"set": settings}, plans[0], "the program's")
        _compare_programs({str(file): sm.load_program(file) for file in plans}, as_json)
        return
    saved = {str(file): sm.load_plan(file) for file in plans}
    costs = _common_costs(settings or [], next(iter(saved.values())))
    table = sm.compare(saved, costs=costs)
    if as_json:
        by_name = {name: result_json.plan_json(plan) for name, plan in saved.items()}
        for column, data in enumerate(by_name.values() if costs else ()):
            data["measured"] = {name: row[column] for name, row in table.costs.items()}
        print_json(by_name)
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
    """Return the costs with which all plans are evaluated; None where each has its own."""
    document: dict[str, Any] = {}
    for text in settings:
        key, value = parse_setting(text)
        if key.partition(".")[0] != "costs":
            raise sm.errors.ProblemError(f"--set {key}: has no effect, expected costs")
        set_key(document, key, value)
    if not document:
        return None
    return list(documents.changed(plan.problem, documents.DocumentOptions(settings)).costs)


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
    from selfmotion.shell.replay import check_pictures, write_meshcat, write_replay

    if png is not None or gif is not None:
        check_pictures()
    for file in maps or []:
        _check_map(file, plans)
    if _is_one_program(plans):
        saved: Any = sm.load_program(plans[0])
        first = saved
    else:
        saved = [sm.load_plan(plan) for plan in plans]
        first = saved[0]
    duration = first.trajectory.duration
    if png is not None and not 0.0 <= png <= duration:
        raise sm.errors.RenderError(
            f"--png: there is no picture at t = {png:g} s: the motion lasts {duration:.6g} s"
        )
    labels = [plan.stem for plan in plans] if len(plans) > 1 else None
    page = html or Path("replay.html")
    written = [write_replay(saved, page, labels=labels)]
    written += _write_pictures(first, page.with_suffix(".png"), png, gif)
    if meshcat is not None:
        written.append(write_meshcat(first, meshcat))
    if maps:
        redundancy_map = first.redundancy_map()
        for file in maps:
            save = redundancy_map.save_png if file.suffix == ".png" else redundancy_map.save
            written.append(save(file))
    print_written(written, as_json)


def _is_one_program(plans: list[Path]) -> bool:
    return len(plans) == 1 and plans[0].suffix == jobs.PROGRAM


def _check_map(file: Path, plans: list[Path]) -> None:
    """Raise RenderError for a map of several plans or of a program, and files of other kinds."""
    if file.suffix not in (".png", ".npz"):
        raise sm.errors.RenderError(f"--map: {file} is neither a .png nor a .npz file")
    if len(plans) != 1 or _is_one_program(plans):
        raise sm.errors.RenderError("--map: a redundancy map is of one plan")


def _write_pictures(
    motion: sm.Plan | sm.Program, png_file: Path, png: float | None, gif: Path | None
) -> list[Path]:
    """Draw the scene at time `png` [s] and the motion as a GIF, as asked; return the files."""
    from selfmotion.shell.replay import render_gif, render_png

    files = []
    if png is not None:
        files.append(render_png(motion, png_file, t=png))
    if gif is not None:
        with StageDisplay(stages) as display:
            files.append(render_gif(motion, gif, progress=display.stage))
    return files
