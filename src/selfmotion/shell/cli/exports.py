"""The command that writes motions for controllers and simulators."""

from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

import selfmotion as sm
from selfmotion.planning.result import is_move
from selfmotion.shell.cli import jobs, options, outputs, reread
from selfmotion.shell.cli.app import (
    FILES,
    NOT_VERIFIED,
    VERIFIED,
    StageDisplay,
    app,
    print_json,
    stages,
    terminal,
)
from selfmotion.shop import controllers
from selfmotion.shop.controllers import FORMS


@app.command(
    epilog="Example: selfmotion export plan.npz --out motion.yaml; or: --out weld.src",
    rich_help_panel=FILES,
)
def export(
    file: Annotated[
        Path, typer.Argument(help="A plan or a move saved as .npz, a .program or .parts.")
    ],
    out: Annotated[
        list[Path],
        typer.Option(
            help="File: .csv, .npz, .json, .yaml (ROS 2 JointTrajectory), .mcap (ROS 2 bag), .xml "
            "(MuJoCo keyframes), .script (URScript), .src (KUKA), .mod (ABB). Repeatable."
        ),
    ],
    rate: Annotated[
        float | None,
        typer.Option(
            help="Samples per second; by default the plan's own: few, joined by quintics."
        ),
    ] = None,
    form: Annotated[
        str | None,
        typer.Option("--format", help=f"Format, whatever the suffix: {', '.join(FORMS)}."),
    ] = None,
    parts: Annotated[
        bool,
        typer.Option(
            "--parts",
            help="For a cell: also a file for each part (not of programs).",
        ),
    ] = False,
    settings: outputs.SettingsOption = None,
    targets: outputs.TargetsOption = None,
    wobj: outputs.WorkObjectOption = None,
    mass: outputs.MassOption = None,
    force: Annotated[
        bool,
        typer.Option("--force", help="Write it even if it is not verified, or moves at an end."),
    ] = False,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write a plan's motion for controllers and simulators, and verify the file."""
    asked = outputs.program_settings(settings, targets, wobj, mass)
    if rate is not None and all(reread.is_program(target, form, asked) for target in out):
        raise sm.errors.ProblemError(
            "--rate has no effect on programs, which have the targets that they need"
        )
    if parts and all(reread.is_program(target, form, asked) for target in out):
        raise sm.errors.ProblemError(
            "--parts has no effect on programs of controllers, which move all joints of a cell; "
            "leave it out, or give a file of another kind as well"
        )
    if settings is not None and not any(reread.is_of_controller(target, form) for target in out):
        raise sm.errors.ProblemError(
            "--settings has no effect: it is of controllers' programs (.script, .src, .mod)"
        )
    typed = {"targets": targets, "wobj": wobj, "mass": mass}
    if any(typed.values()) and not any(reread.is_of_controller(target, form) for target in out):
        names = ", ".join(f"--{name}" for name, value in typed.items() if value)
        raise sm.errors.ProblemError(
            f"{names}: of controllers' programs (.script, .src, .mod), of which none is asked for"
        )
    made: reread.Made
    if file.suffix == jobs.PROGRAM:
        made = sm.load_program(file)
    elif file.suffix == jobs.PARTS:
        made = sm.files.load_parts(file)
    elif is_move(file):
        made = sm.files.load_move(file)
    else:
        made = sm.load_plan(file)
    if parts and not isinstance(made, sm.Plan):
        raise sm.errors.ProblemError(
            f"{file}: --parts is of a cell's plan, which this is not; leave it out"
        )
    _check_verified(made, force, as_json)
    _tell_followers(made.robot, out, form)
    outputs.tell_base(made.robot, asked)
    if isinstance(made, sm.Plan) and any(reread.is_readable(target, form) for target in out):
        made = _slow_enough(made, rate)
    verdicts: dict[str, str] = {}
    # Which what is only of these is said for.
    programs = any(reread.is_program(target, form, asked) for target in out)
    messages = any(reread.is_message(target, form) for target in out)
    coarsest = None
    if messages and rate is None and isinstance(made, sm.Plan):
        coarsest = controllers.coarsest_rate(made)
    sound = True
    for target in out:
        given: dict[str, Any] = {"format": form, "force": force}
        if not reread.is_program(target, form, asked):
            given["rate"] = coarsest if rate is None and reread.is_message(target, form) else rate
        together: dict[str, Path] = {}
        if parts and isinstance(made, sm.Plan) and not reread.is_program(target, form, asked):
            together = sm.files.write_parts(made, target, **given)
        with StageDisplay(stages) as display:
            own = asked if reread.is_of_controller(target, form) else None
            if own is not None and not reread.is_program(target, form, asked) and programs:
                own = own.streamed
            sm.files.write_motion(made, target, settings=own, progress=display.stage, **given)
        kept, verdicts[str(target)] = reread.read_back(
            made, target, form, rate, asked, whole=verbose or as_json
        )
        sound &= kept
        if together:
            names = ", ".join(map(str, together.values()))
            verdicts[names] = ""
            if reread.is_readable(target, form) and isinstance(made, sm.Plan):
                kept, verdicts[names] = reread.judged(
                    made, sm.files.read_parts(together), whole=verbose or as_json
                )
                sound &= kept
    streamed = [target for target in out if not reread.is_program(target, form, asked)]
    if all(reread.is_message(target, form) for target in streamed):
        rate = coarsest if rate is None else rate
    if coarsest is not None and not as_json:
        terminal.print(
            reread.told_coarsest(coarsest),
            markup=False,
            soft_wrap=True,
        )
    _tell_held(made.robot)
    _finish(made, rate, verdicts, sound, as_json, sampled=bool(streamed))


def _slow_enough(plan: sm.Plan, rate: float | None) -> sm.Plan:
    """Return a plan as its samples at a rate keep limits, and print how much longer that takes."""
    found = controllers.within_limits_at(plan, rate)
    if found is not plan:
        before, now = plan.trajectory.duration, found.trajectory.duration
        stages.print(
            f"note: between samples at {rate:g} Hz the accelerations of this retimed plan would "
            f"pass limits: the motion takes {now:.6g} s instead of {before:.6g} s, "
            f"{now / before:.4f} times as long (retime --rate {rate:g} makes a plan of it)",
            markup=False,
            soft_wrap=True,
        )
    return found


def _tell_followers(robot: sm.RobotModel, out: list[Path], form: str | None) -> None:
    """Print which joints are in no file, because they mimic others."""
    following = controllers.followers(robot)
    if following and any(
        (form or controllers.SUFFIXES.get(file.suffix)) != "mujoco" for file in out
    ):
        pairs = ", ".join(f"'{name}' '{other}'" for name, other in following.items())
        stages.print(
            f"note: joints that mimic others are left out ({pairs}): controllers of ROS and MoveIt "
            f"command none; RobotModel.all_joints gives their positions",
            markup=False,
            soft_wrap=True,
        )


def _tell_held(robot: sm.RobotModel) -> None:
    """Print which joints have to stand where while the motion runs."""
    text = controllers.held_in_words(robot)
    if text:
        stages.print(f"note: {text}", markup=False, soft_wrap=True)


def _check_verified(made: reread.Made, force: bool, as_json: bool) -> None:
    """End with one line where a motion is not verified, or moves at an end, and is not forced."""
    if force:
        return
    if reread.verified(made):
        verdict = controllers.moving_ends(made)
        if not verdict:
            return
    else:
        verdict = made.certificate.verdict if isinstance(made, sm.Plan) else made.verdict
    if as_json:
        print_json({"verified": False, "written": {}, "verdict": verdict})
    else:
        text = f"nothing is written: {verdict}; --force writes it all the same"
        terminal.print(text, markup=False, soft_wrap=True)
    raise typer.Exit(NOT_VERIFIED)


def _finish(
    made: reread.Made,
    rate: float | None,
    verdicts: dict[str, str],
    sound: bool,
    as_json: bool,
    *,
    sampled: bool,
) -> NoReturn:
    """Print what was written, and end."""
    miss = None
    if sampled and isinstance(made, sm.Plan):
        miss = controllers.linear_miss(made, rate)
    if as_json:
        data: dict[str, Any] = {"verified": sound, "written": verdicts}
        print_json(data if miss is None else data | {"linear_miss": miss._asdict()})
        raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)
    for name, verdict in verdicts.items():
        terminal.print(f"wrote {name}{verdict and '; '}{verdict}", markup=False, soft_wrap=True)
        outputs.tell_large(Path(name), terminal, given_rate=rate is not None)
    if miss is not None:
        terminal.print(
            reread.told_straight(miss),
            markup=False,
            soft_wrap=True,
        )
    raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)
