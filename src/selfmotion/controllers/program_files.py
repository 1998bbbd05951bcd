"""Programs of controllers as files: which suffix is which language."""

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath

from selfmotion.basics import FileFormatError, Progress, silent
from selfmotion.controllers.controller_program import ControllerProgram, Draft, drafted
from selfmotion.controllers.krl import write_krl
from selfmotion.controllers.krl_reader import KrlReader
from selfmotion.controllers.program_lines import ProgramReader
from selfmotion.controllers.program_settings import ProgramSettings
from selfmotion.controllers.rapid import write_rapid
from selfmotion.controllers.rapid_reader import RapidReader
from selfmotion.controllers.stretches import Misses
from selfmotion.controllers.urscript_poses import UrscriptReader, write_urscript
from selfmotion.job import Program
from selfmotion.result import Move, Parts, Plan
from selfmotion.robot import RobotModel

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
    """Write a motion as a program of a controller; see `write_motion`."""
    verdict = plan.certificate.verdict if isinstance(plan, Plan) else plan.verdict
    _WRITERS[form](file, drafted(plan, file.stem, form, settings, verdict, progress))


def read_program(file: FilePath, robot: RobotModel | None = None) -> ControllerProgram:
    """Read a program of a controller, by its suffix; tool poses by the robot that moves to them.

    Raises
    ------
    FileFormatError
        The file cannot be read, or says what is not read; the line is named.
    """
    return _READERS[file.suffix.lower()](file, robot).program()


def program_miss(
    plan: Plan | Parts | Move | Program, file: FilePath, read: ControllerProgram | None = None
) -> tuple[int, Misses, Misses]:
    """Return what a program file holds: targets, the deviations it states, and what it is.

    The file is read unless it was `read` before.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is of another motion.
    """
    found = read or read_program(file, plan.robot)
    try:
        return found.targets, found.miss, found.miss_of(plan)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
