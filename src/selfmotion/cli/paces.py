"""The commands that change how fast motions are."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer

import selfmotion as sm
from selfmotion.cli import documents, options, outputs
from selfmotion.cli.app import PLAN, app, fastest_with_progress, stages
from selfmotion.cli.stage_display import StageDisplay


@app.command(
    epilog="Example: selfmotion retime plan.npz --acceleration 8 --out fast.npz",
    rich_help_panel=PLAN,
)
def retime(
    file: Annotated[Path, typer.Argument(help="A plan saved as .npz.")],
    acceleration: options.AccelerationOption = None,
    velocity: options.VelocityOption = None,
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Retime a plan: the same joint path in the least time within limits."""
    outputs.check_suffixes(out or [])
    with StageDisplay(stages) as display:
        display.stage("retiming", 1, 1)
        result = sm.retime(sm.load_plan(file), *_limits(acceleration, velocity))
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
    outputs.check_suffixes([*job.outputs, *(out or [])])
    given = dict(zip(("acceleration", "velocity"), _limits(acceleration, velocity), strict=True))
    if keep:
        pairs = [_factor(text) for text in keep]
        options.refuse_twice("--keep", [kind for kind, _ in pairs])
        given["keep"] = {**(job.keep or {}), **dict(pairs)}
    remarks = job.problem.remarks
    outputs.tell(remarks)
    found = fastest_with_progress(job, deadline=deadline, **given)
    if not as_json:
        stages.print(
            f"{found.duration:.4g} s; lowest cost, retimed: {_time(found.retimed)}, "
            f"minimum-norm motion retimed: {_time(found.pseudo_inverse)}; {found.status.message}",
            markup=False,
            soft_wrap=True,
        )
    outputs.finish(
        found.plan, [*job.outputs, *(out or [])], html, as_json, verbose, remarks=remarks
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
