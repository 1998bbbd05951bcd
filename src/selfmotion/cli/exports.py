"""The command that writes motions for controllers and simulators."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, NoReturn

import numpy as np
import typer

import selfmotion as sm
from selfmotion import controllers
from selfmotion.cli import jobs, options, outputs
from selfmotion.cli.app import FILES, NOT_VERIFIED, VERIFIED, StageDisplay, app, stages, terminal
from selfmotion.controllers import FORMS
from selfmotion.result import is_move

_Made = sm.Plan | sm.Parts | sm.Move | sm.Program


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
    if rate is not None and all(_is_program(target, form, asked) for target in out):
        raise sm.errors.ProblemError(
            "--rate has no effect on programs: targets are as many as it takes"
        )
    if parts and all(_is_program(target, form, asked) for target in out):
        raise sm.errors.ProblemError(
            "--parts has no effect on programs of controllers, which move all joints of a cell; "
            "leave it out, or give a file of another kind as well"
        )
    if settings is not None and not any(_is_of_controller(target, form) for target in out):
        raise sm.errors.ProblemError(
            "--settings has no effect: it is of controllers' programs (.script, .src, .mod)"
        )
    typed = {"targets": targets, "wobj": wobj, "mass": mass}
    if any(typed.values()) and not any(_is_of_controller(target, form) for target in out):
        names = ", ".join(f"--{name}" for name, value in typed.items() if value)
        raise sm.errors.ProblemError(
            f"{names}: of controllers' programs (.script, .src, .mod), of which none is asked for"
        )
    made: _Made
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
    verdicts: dict[str, str] = {}
    # Which what is only of these is said for.
    programs = any(_is_program(target, form, asked) for target in out)
    messages = any(_is_message(target, form) for target in out)
    coarsest = None
    if messages and rate is None and isinstance(made, sm.Plan):
        coarsest = controllers.coarsest_rate(made)
    sound = True
    for target in out:
        given: dict[str, Any] = {"format": form, "force": force}
        if not _is_program(target, form, asked):
            given["rate"] = coarsest if rate is None and _is_message(target, form) else rate
        together: dict[str, Path] = {}
        if parts and isinstance(made, sm.Plan) and not _is_program(target, form, asked):
            together = sm.files.write_parts(made, target, **given)
        with StageDisplay(stages) as display:
            own = asked if _is_of_controller(target, form) else None
            if own is not None and not _is_program(target, form, asked) and programs:
                own = own.streamed
            sm.files.write_motion(made, target, settings=own, progress=display.stage, **given)
        kept, verdicts[str(target)] = _read_back(
            made, target, form, rate, asked, whole=verbose or as_json
        )
        sound &= kept
        if together:
            names = ", ".join(map(str, together.values()))
            verdicts[names] = ""
            if _is_readable(target, form) and isinstance(made, sm.Plan):
                kept, verdicts[names] = _judged(
                    made, sm.files.read_parts(together), whole=verbose or as_json
                )
                sound &= kept
    streamed = [target for target in out if not _is_program(target, form, asked)]
    if all(_is_message(target, form) for target in streamed):
        rate = coarsest if rate is None else rate
    if coarsest is not None and not as_json:
        terminal.print(
            f"at {coarsest:g} Hz: the coarsest rate at which straight lines between samples keep "
            f"the plan's tolerance",
            markup=False,
            soft_wrap=True,
        )
    _finish(made, rate, verdicts, sound, as_json, sampled=bool(streamed))


def _is_message(target: Path, form: str | None) -> bool:
    return (form or controllers.SUFFIXES.get(target.suffix.lower())) in controllers.MESSAGES


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


def _check_verified(made: _Made, force: bool, as_json: bool) -> None:
    """End with one line where a motion is not verified, or moves at an end, and is not forced."""
    if force:
        return
    if _verified(made):
        verdict = controllers.moving_ends(made)
        if not verdict:
            return
    else:
        verdict = made.certificate.verdict if isinstance(made, sm.Plan) else made.verdict
    if as_json:
        terminal.print_json(data={"verified": False, "written": {}, "verdict": verdict})
    else:
        text = f"nothing is written: {verdict}; --force writes it all the same"
        terminal.print(text, markup=False, soft_wrap=True)
    raise typer.Exit(NOT_VERIFIED)


def _is_program(target: Path, form: str | None, asked: sm.files.ProgramSettings | None) -> bool:
    """Whether a file is a program of targets, which has no rate."""
    name = form or controllers.SUFFIXES.get(target.suffix.lower())
    linear = asked is not None and asked.by_poses
    return name in controllers.PROGRAMS.values() or (name == "urscript" and linear)


def _is_of_controller(target: Path, form: str | None) -> bool:
    name = form or controllers.SUFFIXES.get(target.suffix.lower())
    return name == "urscript" or name in controllers.PROGRAMS.values()


def _is_readable(target: Path, form: str | None) -> bool:
    return form in controllers.READABLE or (
        form is None and target.suffix.lower() not in (".xml", ".script")
    )


def _read_back(
    made: _Made,
    target: Path,
    form: str | None,
    rate: float | None,
    asked: sm.files.ProgramSettings | None,
    *,
    whole: bool,
) -> tuple[bool, str]:
    """Return whether what was written is still the motion, and what there is to say.

    The `whole` verdict, or its summary.
    """
    if _is_program(target, form, asked) and target.suffix.lower() in controllers.READ_PROGRAMS:
        return _confirmed(made, target)
    if not _is_readable(target, form):
        return _verified(made), ""
    motion = sm.files.read_motion(target)
    match made:
        case sm.Plan():
            return _judged(made, motion, whole=whole)
        case sm.Move():
            read = sm.Move(made.robot, made.constraints, motion.of_joints(made.robot.joint_names))
            return read.verified and made.verified, f"read back: {read.verdict}"
        case sm.Program() | sm.Parts() if rate is not None:
            # Steps meet between its samples: there is no motion of each that rests at its ends.
            return _verified(made), _told_of_samples(made.trajectory, motion, rate)
        case sm.Program():
            found = controllers.judged_motion(motion, made)
            return found.verified, f"read back: {found.verdict}"
    return _judged_parts(made, motion, whole=whole)


def _told_of_samples(motion: sm.Trajectory, read: sm.Trajectory, rate: float) -> str:
    """Return how far a motion leaves the whole that it was sampled from, in words."""
    t = np.append(motion.t, motion.t[:-1] + 0.5 * np.diff(motion.t))
    off = read.of_joints(motion.joint_names)(np.clip(t, None, read.t[-1])) - motion(t)
    return (
        f"at {rate:g} Hz up to {np.abs(off).max():.3g} rad or m off the motion; "
        "its steps are judged only without a rate"
    )


def _judged_parts(made: sm.Parts, motion: sm.Trajectory, *, whole: bool) -> tuple[bool, str]:
    """Return whether a motion is still that of parts, part by part and move by move."""
    every = motion.of_joints(made.robot.joint_names)
    stops = np.append(made.begins, made.trajectory.duration)
    plans, moves = [], []
    for k, (plan, begin) in enumerate(zip(made.plans, made.begins, strict=True)):
        end = begin + plan.trajectory.duration
        read = replace(plan, trajectory=controllers.part_of(every, begin, end))
        plans.append(replace(read, certificate=read.check()))
        if k < len(made.moves):
            after = stops[k + 1]
            part = controllers.part_of(every, end, float(after))
            moves.append(sm.Move(made.robot, made.moves[k].constraints, part))
    found = replace(made, plans=tuple(plans), moves=tuple(moves))
    return found.verified, _told(found, whole)


def _confirmed(made: _Made, target: Path) -> tuple[bool, str]:
    """Return whether a program keeps what it states, and that in words."""
    read = controllers.read_program(target, made.robot)
    count, stated, found = controllers.program_miss(made, target, read)
    told, kept = [], _verified(made) and controllers.keeps_stated(found, stated)
    for miss, said, where in zip(found, stated, ("off the plan", "in free moves"), strict=True):
        if miss.position > 0.0:
            told.append(
                f"{1e3 * miss.position:.3g} mm and {miss.rotation:.2g} rad {where} "
                f"({1e3 * said.position:.3g} mm are stated in the file)"
            )
    switched = controllers.misswitched(read, made) if isinstance(made, sm.Program) else ()
    kept &= not switched
    far = f", between which the tool is at most {', and '.join(told)}" if told else ""
    remark, at_feeds = read.remark, read.within is not None
    targets = "target" if count == 1 else "targets"
    paced = ["seams are at their feeds, with ramps of the controller's own"] if at_feeds else []
    paced += [f"a seam has times all the same: {reason}" for reason in read.timed]
    why = (f"they are joints, as poses do not keep the motion: {remark}",) if remark else ()
    return kept, f"read back: {'; '.join((f'{count} {targets}{far}', *paced, *why, *switched))}"


def _verified(made: _Made) -> bool:
    return made.certificate.verified if isinstance(made, sm.Plan) else made.verified


def _judged(plan: sm.Plan, motion: sm.Trajectory, *, whole: bool) -> tuple[bool, str]:
    found = plan.problem.certify(motion, plan.tolerance, plan.report.ending)
    return found.verified and not plan.altered, _told(found, whole)


def _told(found: sm.Certificate | sm.Parts, whole: bool) -> str:
    return f"read back: {found.verdict if whole else found.summary}"


def _finish(
    made: _Made,
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
        terminal.print_json(data=data if miss is None else data | {"linear_miss": miss._asdict()})
        raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)
    for name, verdict in verdicts.items():
        terminal.print(f"wrote {name}{verdict and '; '}{verdict}", markup=False, soft_wrap=True)
        outputs.tell_large(Path(name), terminal, given_rate=rate is not None)
    if miss is not None:
        terminal.print(
            f"joined by straight lines, the samples stay within {miss.position:.2g} m and "
            f"{miss.rotation:.2g} rad of the motion; --rate {miss.rate:.0f} keeps the plan's "
            f"tolerance",
            markup=False,
            soft_wrap=True,
        )
    raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)
