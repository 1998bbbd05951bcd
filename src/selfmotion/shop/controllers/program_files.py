"""Programs of controllers as files, written and read."""

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory

from selfmotion.basics import FileFormatError, Progress, silent
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.deviations import Deviations
from selfmotion.shop.controllers.krl_reader import KrlReader
from selfmotion.shop.controllers.krl_writer import write_krl
from selfmotion.shop.controllers.plan_deviation import deviation_from_plan
from selfmotion.shop.controllers.program_draft import Draft, Joints, drafted
from selfmotion.shop.controllers.program_reader import ProgramReader
from selfmotion.shop.controllers.program_settings import ProgramSettings
from selfmotion.shop.controllers.rapid_reader import RapidReader
from selfmotion.shop.controllers.rapid_writer import write_rapid
from selfmotion.shop.controllers.urscript import UrscriptReader, write_urscript
from selfmotion.work.job import Program

_WRITERS: Mapping[str, Callable[[FilePath, Draft], None]] = {
    "krl": write_krl,
    "rapid": write_rapid,
    "urscript": write_urscript,
}
_READERS: Mapping[str, type[ProgramReader]] = {
    ".src": KrlReader,
    ".mod": RapidReader,
    ".script": UrscriptReader,
}
# Suffixes of programs of targets; those that are read as such, which linear URScript is as well.
PROGRAMS = {".src": "krl", ".mod": "rapid"}
READ_PROGRAMS = tuple(_READERS)


def write_program(
    plan: Plan | Parts | Move | Program,
    file: FilePath,
    form: str,
    settings: ProgramSettings,
    progress: Progress = silent,
) -> None:
    """Write a motion as a program of a controller; see `write_motion`.

    Poses are written where the file, read again, keeps what it states: else joint targets, of free
    moves first.
    """
    verdict = plan.certificate.verdict if isinstance(plan, Plan) else plan.verdict
    arguments = plan, file.stem, form, settings, verdict, progress
    draft = drafted(*arguments)
    for moves_only in (True, False):
        if draft.frames is None:
            break
        why = _lost(plan, file, form, draft)
        if not why:
            break
        draft = drafted(*arguments, Joints(moves_only, why))
    _WRITERS[form](file, draft)


def _lost(plan: Plan | Parts | Move | Program, file: FilePath, form: str, draft: Draft) -> str:
    """Return why a program of poses, read again, is not the motion, in words; empty where it is."""
    with TemporaryDirectory() as folder:
        trial = FilePath(folder) / file.name
        _WRITERS[form](trial, draft)
        try:
            _, stated, measured = program_deviation(plan, trial)
        except FileFormatError as error:
            return f"read again, {str(error).removeprefix(f'{trial}: ')}"
    if keeps_stated(measured, stated):
        return ""
    return "read again, poses leave the motion: the arm is singular, or nearly so"


def keeps_stated(measured: Deviations, stated: Deviations) -> bool:
    """Whether deviations are at most those that a file states, up to its digits."""
    pairs = zip((*measured.path, *measured.moves), (*stated.path, *stated.moves), strict=True)
    return all(one <= other + 1e-9 for one, other in pairs)


def read_program(file: FilePath, robot: RobotModel | None = None) -> ControllerProgram:
    """Read a program of a controller, by its suffix; tool poses by the robot that moves to them.

    Raises
    ------
    FileFormatError
        The file cannot be read, or says what is not read; the line is named.
    """
    return _READERS[file.suffix.lower()](file, robot).program()


def program_deviation(
    plan: Plan | Parts | Move | Program, file: FilePath, read: ControllerProgram | None = None
) -> tuple[int, Deviations, Deviations]:
    """Return the number of targets of a program file, the deviations it states, and those it has.

    The file is read unless it was `read` before.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is of another motion.
    """
    program = read or read_program(file, plan.robot)
    try:
        return program.targets, program.deviation, deviation_from_plan(program, plan)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
