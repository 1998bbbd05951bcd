"""The command that writes motions for controllers and simulators."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

import selfmotion as sm
from selfmotion.planning.result import is_move
from selfmotion.shell.cli import file_kinds, jobs, options, outputs, parts
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
from selfmotion.shell.cli.file_verification import (
    Planned,
    is_verified,
    message_rate_text,
    straight_line_text,
    verify_file,
    verify_motion,
)
from selfmotion.shop import controllers
from selfmotion.shop.controllers import FORMS


@app.command(
    epilog="Example: selfmotion export plan.npz --out motion.yaml; or: --out weld.src",
    rich_help_panel=FILES,
)
def export(
    file: options.PlanArgument,
    out: options.OutOption = None,
    rate: options.RateOption = None,
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
    settings: options.SettingsOption = None,
    changes: options.SetOption = None,
    force: options.ForceOption = False,
    verbose: options.VerboseOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write a plan's motion for controllers and simulators, and verify the file.

    By --set, keys of --settings: targets=poses (linear and circular motions in a work object at
    the feed, which can be shifted and touched up; joints; timed-poses, at the plan's times), mass
    [kg], work_object (path, the frame that the path is given in; a link; or a pose, in the frame
    of the controller's link base).
    """
    if not out:
        raise sm.errors.ProblemError("give the file to write: --out motion.yaml")
    asked = outputs.program_settings(settings, changes)
    files = _Files(tuple(out), form, asked, parts, force, verbose or as_json)
    files.check(rate, settings, changes or [])
    planned = _loaded(file, parts=parts)
    _check_verified(planned, force, as_json)
    _print_mimic_joints(planned.robot, out, form)
    outputs.print_base(planned.robot, asked)
    if isinstance(planned, sm.Plan) and files.are_readable:
        planned = _slow_enough(planned, rate)
    coarsest = _coarsest(files, planned, rate)
    each = [files.write(planned, target, rate, coarsest) for target in out]
    sound = all(kept for kept, _ in each)
    verdicts = {name: text for _, written in each for name, text in written.items()}
    streamed = [target for target in out if not files.is_program(target)]
    if all(file_kinds.is_message(target, form) for target in streamed):
        rate = coarsest if rate is None else rate
    if coarsest is not None and not as_json:
        terminal.print(message_rate_text(coarsest), markup=False, soft_wrap=True)
    _print_held(planned.robot)
    _finish(planned, rate, verdicts, sound, as_json, sampled=bool(streamed))


def _coarsest(files: "_Files", planned: Planned, rate: float | None) -> float | None:
    """Return the rate of messages that keeps a plan, where none is asked for; else None."""
    if rate is None and files.are_messages and isinstance(planned, sm.Plan):
        return controllers.coarsest_rate(planned)
    return None


def _loaded(file: Path, *, parts: bool) -> Planned:
    """Return what a file holds: a program, parts, a move or a plan, the one that has `parts`."""
    planned = _read(file)
    if parts and not isinstance(planned, sm.Plan):
        raise sm.errors.ProblemError(
            f"{file}: --parts is of a cell's plan, which this is not; leave it out"
        )
    return planned


def _read(file: Path) -> Planned:
    if file.suffix == jobs.PROGRAM:
        return sm.load_program(file)
    if file.suffix == parts.PARTS:
        return sm.files.load_parts(file)
    return sm.files.load_move(file) if is_move(file) else sm.load_plan(file)


@dataclass(frozen=True)
class _Files:
    """The files that are asked for.

    Attributes
    ----------
    targets : tuple of Path
    form : str or None
        Their format, whatever the suffix.
    asked : ProgramSettings or None
    parts, force : bool
        Whether there is a file for each part; and whether all is written that is not verified.
    whole : bool
        Whether verdicts are printed whole.
    """

    targets: tuple[Path, ...]
    form: str | None
    asked: sm.files.ProgramSettings | None
    parts: bool
    force: bool
    whole: bool

    def check(self, rate: float | None, settings: object, changes: Sequence[str]) -> None:
        """Raise ProblemError for options that are of none of the files."""
        all_programs = all(map(self.is_program, self.targets))
        if rate is not None and all_programs:
            raise sm.errors.ProblemError(
                "--rate has no effect on programs, which have the targets that they need"
            )
        if self.parts and all_programs:
            raise sm.errors.ProblemError(
                "--parts has no effect on programs of controllers, which move all joints of a "
                "cell; leave it out, or give a file of another kind as well"
            )
        if any(file_kinds.is_controller_file(target, self.form) for target in self.targets):
            return
        if settings is not None:
            raise sm.errors.ProblemError(
                "--settings has no effect: it is of controllers' programs (.script, .src, .mod)"
            )
        if changes:
            raise sm.errors.ProblemError(
                f"--set {changes[0]}: is of controllers' programs (.script, .src, .mod), of which "
                f"none is asked for"
            )

    def is_program(self, target: Path) -> bool:
        """Whether a file is a program of targets, which has no rate."""
        return file_kinds.is_target_program(target, self.form, self.asked)

    @property
    def are_messages(self) -> bool:
        """Whether one of them is a message of ROS."""
        return any(file_kinds.is_message(target, self.form) for target in self.targets)

    @property
    def are_readable(self) -> bool:
        """Whether one of them can be read back as a motion."""
        return any(file_kinds.is_readable(target, self.form) for target in self.targets)

    def write(
        self, planned: Planned, target: Path, rate: float | None, coarsest: float | None
    ) -> tuple[bool, dict[str, str]]:
        """Write a file, and one for each part; return whether all is kept, and verdicts by name."""
        given: dict[str, Any] = {"format": self.form, "force": self.force}
        sampled = not self.is_program(target)
        if sampled:
            is_message = file_kinds.is_message(target, self.form)
            given["rate"] = coarsest if rate is None and is_message else rate
        together: dict[str, Path] = {}
        if self.parts and sampled and isinstance(planned, sm.Plan):
            together = sm.files.write_parts(planned, target, **given)
        own = self.asked if file_kinds.is_controller_file(target, self.form) else None
        # What only programs of targets are asked for is not of a stream of samples beside them.
        if own is not None and sampled and any(map(self.is_program, self.targets)):
            own = own.streamed
        with StageDisplay(stages) as display:
            sm.files.write_motion(planned, target, settings=own, progress=display.stage, **given)
        sound, verdict = verify_file(planned, target, self.form, rate, self.asked, whole=self.whole)
        verdicts = {str(target): verdict}
        if together and isinstance(planned, sm.Plan):
            names = ", ".join(map(str, together.values()))
            verdicts[names] = ""
            if file_kinds.is_readable(target, self.form):
                motion = sm.files.read_parts(together)
                kept, verdicts[names] = verify_motion(planned, motion, whole=self.whole)
                sound &= kept
        return sound, verdicts


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


def _print_mimic_joints(robot: sm.RobotModel, out: list[Path], form: str | None) -> None:
    """Print which joints are in no file, because they mimic others."""
    following = controllers.mimic_joints(robot)
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


def _print_held(robot: sm.RobotModel) -> None:
    """Print which joints have to stand where while the motion runs."""
    text = controllers.held_in_words(robot)
    if text:
        stages.print(f"note: {text}", markup=False, soft_wrap=True)


def _check_verified(planned: Planned, force: bool, as_json: bool) -> None:
    """End with one line where a motion is not verified, or moves at an end, and is not forced."""
    if force:
        return
    if is_verified(planned):
        verdict = controllers.moving_ends(planned)
        if not verdict:
            return
    else:
        verdict = planned.certificate.verdict if isinstance(planned, sm.Plan) else planned.verdict
    if as_json:
        print_json({"verified": False, "written": {}, "verdict": verdict})
    else:
        text = f"nothing is written: {verdict}; --force writes it all the same"
        terminal.print(text, markup=False, soft_wrap=True)
    raise typer.Exit(NOT_VERIFIED)


def _finish(
    planned: Planned,
    rate: float | None,
    verdicts: dict[str, str],
    sound: bool,
    as_json: bool,
    *,
    sampled: bool,
) -> NoReturn:
    """Print what was written, and end."""
    deviation = None
    if sampled and isinstance(planned, sm.Plan):
        deviation = controllers.linear_deviation(planned, rate)
    if as_json:
        data: dict[str, Any] = {"verified": sound, "written": verdicts}
        print_json(data if deviation is None else data | {"linear_miss": deviation._asdict()})
        raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)
    for name, verdict in verdicts.items():
        terminal.print(f"wrote {name}{verdict and '; '}{verdict}", markup=False, soft_wrap=True)
        outputs.print_large(Path(name), terminal, given_rate=rate is not None)
    if deviation is not None:
        terminal.print(
            straight_line_text(deviation),
            markup=False,
            soft_wrap=True,
        )
    raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)
