"""The commands about a cell: how wrong it may be, and where to put the part."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import selfmotion as sm
from selfmotion.shell.cli import checks, documents, options, outputs, result_json
from selfmotion.shell.cli.app import (
    LOOK,
    NOT_VERIFIED,
    PLAN,
    VERIFIED,
    StageDisplay,
    app,
    plan_with_progress,
    print_json,
    print_written,
    stages,
    terminal,
)


@app.command(
    epilog="Example: selfmotion margin plan.npz --tolerance 5e-4 --turn 0.02", rich_help_panel=LOOK
)
def margin(
    file: options.PlanArgument,
    tolerance: options.ToleranceOption = None,
    turn: options.TurnOption = None,
    clearance: Annotated[
        float, typer.Option(help="Clearance that must remain between bodies (m).")
    ] = 0.0,
    part: options.PartOption = None,
    tool: Annotated[
        list[str] | None,
        typer.Option(
            help="A body of the tool (may be given several times); by default all on its joint."
        ),
    ] = None,
    center: options.CenterOption = None,
    corrected: Annotated[
        bool,
        typer.Option(
            "--corrected",
            help="Also: how far part and base may be displaced if the motion is planned again.",
        ),
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Measure by how much part, tool and base may be displaced before a plan fails.

    Or each seam of a program. --tolerance and --turn are what the process allows.
    """
    within = options.process_tolerance(tolerance, turn)
    about = None if center is None else options.numbers(center, "--center", 3)
    margin_options: dict[str, Any] = {"clearance": clearance, "center": about}
    margin_options |= {"part": part or None, "tool": tool or None}
    if file.suffix == ".program":
        if corrected:
            raise sm.errors.ProblemError("--corrected is of a single plan (.npz); leave it out")
        _margins_of_seams(sm.load_program(file), within, margin_options, as_json)
        return
    plan = sm.load_plan(file)
    with StageDisplay(stages) as display:
        display.stage("measuring margins", 1, 1)
        margins = sm.margin(plan, within, **margin_options)
    again, refused = [], dict[str, str]()
    if about is not None:
        # Margins have it in the frame of the path, corrections in world axes.
        about = plan.problem.follows.items[0].chain.base_placement.act(np.array(about))
    for of in ("part", "base") if corrected else ():
        moved_body: dict[str, Any] = {"part": part or None, "center": about} if of == "part" else {}
        try:
            with StageDisplay(stages) as display:
                again.append(sm.correction(plan, of=of, progress=display.stage, **moved_body))
        except sm.errors.ProblemError as error:
            # The other one may have an answer all the same.
            refused[of] = str(error)
    if as_json:
        planned = {item.of: _plain(dataclasses.asdict(item)) for item in again}
        planned |= {of: {"refused": why} for of, why in refused.items()}
        print_json(margins_json(margins) | {"corrected": planned})
        return
    whys = (f"not planned again for another place of the {of}: {refused[of]}" for of in refused)
    for told in (margins, *again, *whys):
        terminal.print(str(told), markup=False, soft_wrap=True)


@app.command(
    epilog="Example: selfmotion calibrate plan.npz ur5_kinematics.yaml --out measured.npz",
    rich_help_panel=PLAN,
)
def calibrate(
    file: options.PlanArgument,
    calibration: Annotated[
        Path,
        typer.Argument(help="Calibration of the arm; see check."),
    ],
    out: options.OutOption = None,
    html: options.HtmlOption = None,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Check a plan for the arm as drawn on the calibrated arm, and plan again for that arm."""
    outputs.check_suffixes(out or [])
    planned = sm.load_plan(file)
    problem = sm.calibrated(planned.problem, calibration)
    checks.print_difference(problem.robot, planned.trajectory)
    judged = checks.on_calibrated(planned.problem, calibration)
    verdict = judged.certify(planned.trajectory, planned.tolerance, planned.report.ending).verdict
    stages.print(f"as planned, on the calibrated arm: {verdict}", markup=False, soft_wrap=True)
    result = plan_with_progress(problem, warm_start=planned, tolerance=planned.tolerance)
    outputs.finish(result, out or [], html, as_json, verbose)


@app.command(
    epilog="Example: selfmotion sheet plan.npz --tolerance 5e-4 --turn 0.02 -o sheet.html",
    rich_help_panel=LOOK,
)
def sheet(
    file: options.PlanArgument,
    out: options.OneOutOption = Path("sheet.html"),
    tolerance: options.ToleranceOption = None,
    turn: options.TurnOption = None,
    part: options.PartOption = None,
    title: Annotated[str, typer.Option(help="Title; by default arm and task.")] = "",
    number: Annotated[
        list[str] | None,
        typer.Option(help="Number to print: part=4711-B or order=12. Repeatable."),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Write a process sheet: motion, limits kept and margins, to print on A4."""
    within = options.process_tolerance(tolerance, turn)
    margins: sm.margins.Margins | dict[str, sm.margins.Margins] | None = None
    planned: sm.Plan | sm.Program
    printed = _printed(number or [])
    if file.suffix == ".program":
        planned = sm.load_program(file)
        plans = {name: plan for name, plan in planned.plans.items() if _has_margins(plan, within)}
        margins = _measured(plans, within, {"part": part or None})
    else:
        planned = sm.load_plan(file)
        if _has_margins(planned, within):
            with StageDisplay(stages) as display:
                display.stage("measuring margins", 1, 1)
                margins = sm.margin(planned, within, part=part or None)
    written = sm.files.write_sheet(
        planned,
        out or "sheet.html",
        margins,
        title=title,
        part_number=printed.get("part", ""),
        order_number=printed.get("order", ""),
    )
    print_written([written], as_json)


def _printed(numbers: Sequence[str]) -> dict[str, str]:
    """Return the numbers of part and order, by what they are of."""
    found = {}
    for text in numbers:
        name, mark, value = text.partition("=")
        if name not in ("part", "order") or not mark:
            raise sm.errors.ProblemError(
                f"--number is '{text}', expected part=NUMBER or order=NUMBER"
            )
        found[name] = value
    return found


def _has_margins(plan: sm.Plan, within: sm.Tolerance | None) -> bool:
    """Whether a plan has margins: it is verified, with bodies or a tolerance of the process."""
    bodies = any(kind in plan.certificate.covers for kind in ("self-collision", "obstacles"))
    return plan.certificate.verified and (bodies or within is not None)


def _measured(
    plans: Mapping[str, sm.Plan], within: sm.Tolerance | None, options: Mapping[str, Any]
) -> dict[str, sm.margins.Margins]:
    """Return the margins of plans of seams, by their names."""
    margins = {}
    with StageDisplay(stages) as display:
        for number, (name, plan) in enumerate(plans.items(), 1):
            display.stage(f"measuring margins of seam '{name}'", number, len(plans))
            margins[name] = sm.margin(plan, within, **options)
    return margins


def _margins_of_seams(
    program: sm.Program, within: sm.Tolerance | None, options: Mapping[str, Any], as_json: bool
) -> None:
    """Print the margins of each seam; those of moves are not known."""
    margins = _measured(program.plans, within, options)
    if as_json:
        print_json({"seams": {name: margins_json(it) for name, it in margins.items()}})
        return
    for name, each in margins.items():
        terminal.print(f"seam '{name}': {each}\n", markup=False, soft_wrap=True)
    terminal.print("not judged: the moves between the seams", markup=False, soft_wrap=True)


def margins_json(margins: sm.margins.Margins) -> dict[str, Any]:
    """Return margins as JSON-safe values, the sentence first."""
    return {"sentence": margins.sentence, **_plain(dataclasses.asdict(margins))}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    # JSON has no number for what has no time, or no end.
    return None if isinstance(value, float) and not np.isfinite(value) else value


@app.command(
    "plan-margin",
    epilog="Example: selfmotion plan-margin cell.toml --position 0.005 --rotation 0.01 --out a.npz",
    rich_help_panel=PLAN,
)
def plan_margin(
    file: options.DocumentArgument,
    position: Annotated[float, typer.Option(help="By how much it may be shifted (m).")] = 0.0,
    rotation: Annotated[float, typer.Option(help="By how much it may be turned (rad).")] = 0.0,
    of: options.OfOption = None,
    part: options.PartOption = None,
    out: options.OutOption = None,
    settings: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Plan a motion that tolerates displacements of part, tool or base.

    Of a problem file, or of the problem of a plan (.npz).
    """
    outputs.check_suffixes(out or [])
    problem = documents.problem_of(file, documents.DocumentOptions(settings), allow_code)
    with StageDisplay(stages) as display:
        planned = sm.plan_with_margin(
            problem,
            sm.Margin(position, rotation),
            of=of or "part",
            part=part or None,
            progress=display.stage,
        )
    if as_json:
        print_json(result_json.plan_json(planned.plan) | {"reached": planned.reached})
    else:
        terminal.print(str(planned), markup=False, soft_wrap=True)
    outputs.write(planned.plan, out or [], None, terminal, quiet=as_json)
    raise typer.Exit(VERIFIED if planned.reached else NOT_VERIFIED)
