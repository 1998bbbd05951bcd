"""The commands `plan` and `retime`."""

import math

import selfmotion as sm
from selfmotion.basics import held_interruption
from selfmotion.shell.cli import documents, options, outputs, parts
from selfmotion.shell.cli.app import (
    PLAN,
    StageDisplay,
    app,
    fastest_with_progress,
    plan_with_progress,
    stages,
)


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

    Every key of a problem file can be set by --set; `selfmotion schema` lists them. goal=fastest
    plans the fastest motion along the path and ignores its timing.
    """
    typed = documents.DocumentOptions(settings, path, feed, frame, task, start, tool)
    with held_interruption():
        warm_start = None if warm is None else sm.load_plan(warm)
        start_configuration = None if warm_start is None else warm_start.trajectory.q[0].tolist()
        request = documents.read(problem, typed, allow_code, start=start_configuration)
    outputs.check_own(request.outputs, problem, force)
    if request.goal != "parts":
        outputs.check_suffixes([*request.outputs, *(out or [])])
    remarks = request.remarks
    outputs.print_notes(remarks)
    request.check_used(request.goal)
    deadline_options = {} if deadline is None else {"deadline": deadline}
    if request.goal == "parts":
        options.refuse_unused({"from": warm, **deadline_options}, "a motion in parts")
        files = [*(out or []), *([] if html is None else [html])]
        # Ends the command.
        parts.finish_parts(request, files, as_json, verbose)
    if request.goal == "fastest":
        options.refuse_unused({"from": warm}, "the fastest motion")
        result = _fastest(request, as_json, **deadline_options)
    else:
        keywords = {**request.settings, **deadline_options}
        result = plan_with_progress(request.problem, warm_start=warm_start, **keywords)
        if request.goal == "retimed":
            result = sm.retime(result)
    files = [*request.outputs, *(out or [])]
    outputs.finish(result, files, html, as_json, verbose, remarks=remarks)


def _fastest(request: sm.files.PlanRequest, as_json: bool, **deadline_options: float) -> sm.Plan:
    """Plan the fastest motion, and print the durations of the retimed alternatives."""
    fastest = fastest_with_progress(request, **deadline_options)
    if not as_json:
        stages.print(
            f"{fastest.duration:.4g} s; lowest cost, retimed: {_duration_text(fastest.retimed)}, "
            f"minimum-norm motion retimed: {_duration_text(fastest.pseudo_inverse)}; "
            f"{fastest.status.message}",
            markup=False,
            soft_wrap=True,
        )
    return fastest.plan


def _duration_text(seconds: float) -> str:
    return f"{seconds:.4g} s" if math.isfinite(seconds) else "violates a constraint at any pace"


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
