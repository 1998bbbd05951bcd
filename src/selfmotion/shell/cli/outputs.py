"""The files that a plan is written to, and the settings of what programs say."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

import typer
from rich.console import Console

import selfmotion as sm
from selfmotion import basics
from selfmotion.certificate import Extreme
from selfmotion.model.task import SE3
from selfmotion.shell.cli import file_kinds, result_json, summaries, tables
from selfmotion.shell.cli.app import NOT_VERIFIED, VERIFIED, print_json, stages, terminal
from selfmotion.shell.cli.documents import DocumentOptions
from selfmotion.shell.cli.file_verification import (
    message_rate_text,
    straight_line_text,
    verify_file,
)
from selfmotion.shop import controllers


def program_settings(
    file: Path | None, settings: Sequence[str] | None = None
) -> sm.files.ProgramSettings | None:
    """Return the settings of controllers' programs, of a file and set; None for none."""
    if file is None and not settings:
        return None
    document = {} if file is None else basics.read_document(file)
    DocumentOptions(settings).set_in(document, Path() if file is None else file.parent)
    return controllers.program_settings_of(document, "--set" if file is None else str(file))


def print_base(robot: sm.RobotModel, asked: sm.files.ProgramSettings | None) -> None:
    """Print how the frame that a work object in numbers is counted in is turned from the root."""
    told = controllers.base_rotation_note(robot)
    if told and asked is not None and isinstance(asked.work_object, SE3):
        stages.print(f"note: {told}", markup=False, soft_wrap=True)


# End of the name of a timetable.
TIMETABLE = ".timetable.csv"
# Suffixes of messages that are written as text.
_TEXT_SUFFIXES = (".yaml", ".yml", ".json")
# Size of such a file above which a bag is advised [bytes].
_LARGE_TEXT = 10_000_000


def write(
    result: sm.Plan,
    out: list[Path],
    html: Path | None,
    console: Console,
    *,
    quiet: bool = False,
    whole: bool = False,
) -> bool:
    """Write all files that can be written, and tell; the plan itself in any case.

    Motions are read back, as `export` does; returns whether all are still those of the plan. The
    `whole` verdicts on them, or their summaries.

    Raises
    ------
    FileFormatError
        A file could not be written; says where the plan is.
    """
    written, faults = list[Path](), list[str]()
    reason = objection(result)
    for file in [*out, *([] if html is None else [html])]:
        if reason and is_motion(file):
            print_not_written(file, console, reason, quiet=quiet)
            continue
        try:
            _write_one(result, file, page=file is html)
            written.append(file)
        except sm.SelfmotionError as error:
            faults.append(str(error))
    if faults and not any(file.suffix == ".npz" for file in written):
        rescued = Path(tempfile.mkdtemp(prefix="selfmotion-")) / "plan.npz"
        result.save(rescued)
        written.append(rescued)
    sound = _print_written(result, written, console, quiet=quiet, whole=whole)
    if faults:
        kept = next(file for file in written if file.suffix == ".npz")
        raise sm.errors.FileFormatError(f"{'; '.join(faults)}; the plan is in {kept}")
    return sound


def _print_written(
    result: sm.Plan, files: Sequence[Path], console: Console, *, quiet: bool, whole: bool
) -> bool:
    """Tell which files were written, and what motions in them are when they are read back."""
    sampled = [
        file
        for file in files
        if is_motion(file) and not file_kinds.is_target_program(file, None, None)
    ]
    messages = [file for file in sampled if file_kinds.is_message(file, None)]
    coarsest = controllers.coarsest_rate(result) if messages else None
    sound = True
    for file in files:
        verdict = ""
        if is_motion(file):
            kept, verdict = verify_file(result, file, None, None, None, whole=whole)
            sound &= kept
        if not quiet:
            text = f"wrote {file}{verdict and '; '}{verdict}"
            console.print(text, markup=False, soft_wrap=True)
            print_large(file, console)
    if sampled and not quiet:
        rate = coarsest if messages == sampled else None
        texts = [message_rate_text(coarsest)] if coarsest is not None else []
        texts.append(straight_line_text(controllers.linear_deviation(result, rate)))
        for text in texts:
            console.print(text, markup=False, soft_wrap=True)
    return sound


def print_notes(remarks: Sequence[str]) -> None:
    """Print what is to be known of a problem before it is planned."""
    for remark in remarks:
        stages.print(f"note: {remark}", markup=False, soft_wrap=True)


def finish(
    result: sm.Plan,
    out: list[Path],
    html: Path | None,
    as_json: bool,
    verbose: bool,
    *,
    remarks: Sequence[str] = (),
) -> NoReturn:
    """Print a plan, write its files, and end with what its verdict says.

    Remarks on its problem are in what programs read; others were told before.
    """
    if as_json:
        data = result_json.plan_json(result) | {"remarks": list(remarks)}
        print_json(data)
    else:
        show(result, verbose)
    sound = write(result, out, html, terminal, quiet=as_json, whole=verbose)
    sound &= result.certificate.verified
    sound &= not (objection(result) and any(map(is_motion, out)))
    raise typer.Exit(VERIFIED if sound else NOT_VERIFIED)


def show(result: sm.Plan, verbose: bool) -> None:
    """Print what is to be known of a plan, or all of it."""
    (tables.show if verbose else summaries.show_plan)(result, terminal)


def show_certificate(
    certificate: sm.Certificate,
    approaches: Mapping[str, Extreme],
    robot: sm.RobotModel,
    verbose: bool,
) -> None:
    """Print what is to be known of a certificate, or all of it."""
    if verbose:
        tables.show_certificate(certificate, approaches, robot, terminal)
    else:
        summaries.show_certificate(certificate, approaches, terminal)


def is_timetable(file: Path) -> bool:
    """Whether a file is a timetable of a program: seams and events with their times."""
    return file.name.endswith(TIMETABLE)


def is_motion(file: Path) -> bool:
    """Whether a file is a motion that a controller may be given."""
    is_one = file.suffix in controllers.SUFFIXES and file.suffix != ".npz"
    return is_one and not is_timetable(file)


def objection(planned: sm.Plan | sm.Parts | sm.Program) -> str:
    """Return why a motion must not reach a controller; "" where nothing speaks against it."""
    verified = planned.certificate.verified if isinstance(planned, sm.Plan) else planned.verified
    return controllers.moving_ends(planned) if verified else "it is not verified"


def print_not_written(file: Path, console: Console, reason: str, *, quiet: bool) -> None:
    """Print that a motion was not written, and why."""
    if not quiet:
        console.print(
            f"{file} is not written: {reason}; `selfmotion export --force` writes it",
            markup=False,
            soft_wrap=True,
        )


def print_large(file: Path, console: Console, *, given_rate: bool = False) -> None:
    """Say what is smaller than a large file of text; nothing where it is not large."""
    if (
        file.suffix.lower() in _TEXT_SUFFIXES
        and file.is_file()
        and file.stat().st_size > _LARGE_TEXT
    ):
        fewer = "without --rate it has only those samples that the motion takes; " * given_rate
        console.print(
            f"{file} has {file.stat().st_size / 1e6:.0f} MB: {fewer}a ROS 2 bag takes about a "
            f"third, --out {file.with_suffix('.mcap')}",
            markup=False,
            soft_wrap=True,
        )


def _write_one(result: sm.Plan, file: Path, *, page: bool) -> None:
    if page or file.suffix == ".html":
        _replay(result, file)
    elif file.suffix == ".npz":
        result.save(file)
    else:
        sm.files.write_motion(result, file)


def _replay(result: sm.Plan, file: Path) -> None:
    from selfmotion.shell.replay import write_replay

    write_replay(result, file)


def check_own(files: Sequence[Path], document: str, force: bool) -> None:
    """Refuse outputs that a document names outside of its own folder, unless they are meant.

    Raises
    ------
    FileFormatError
        One is; it is named.
    """
    folder = Path(document).resolve().parent
    for file in files:
        if not force and not file.resolve().is_relative_to(folder):
            raise sm.errors.FileFormatError(
                f"{document}: outputs: '{file}' is outside of the file's own folder; say --force "
                f"if that is meant, or --out"
            )


def check_suffixes(files: Sequence[Path]) -> None:
    """Raise FileFormatError for a file that --out cannot write of a plan."""
    for file in files:
        check_suffix(file, ".npz", ".html", what=".npz (the plan), .html (its replay)")


def check_suffix(file: Path, *suffixes: str, what: str) -> None:
    """Raise FileFormatError for a file of another suffix than these, or than those of motions.

    `what` describes files of these suffixes.
    """
    if file.suffix not in (*suffixes, *controllers.SUFFIXES) and not is_timetable(file):
        raise sm.errors.FileFormatError(
            f"{file}: --out writes {what} or the motion ({', '.join(controllers.SUFFIXES)})"
        )


def write_each(
    planned: sm.Parts | sm.Program,
    files: Sequence[Path],
    write: Callable[[Path], None],
    *,
    quiet: bool,
) -> None:
    """Write each file of parts or of a program, but no motion that a controller must not get."""
    reason = objection(planned)
    for file in files:
        if reason and is_motion(file):
            print_not_written(file, terminal, reason, quiet=quiet)
            continue
        write(file)
        if not quiet:
            terminal.print(f"wrote {file}", markup=False, soft_wrap=True)
            print_large(file, terminal)
