"""What a page shows of a file, by what the file is."""

from pathlib import Path

from selfmotion.basics import SelfmotionError
from selfmotion.planning.result import Parts, load_parts, load_plan
from selfmotion.shell.documents import job_of
from selfmotion.shell.replay.whole import Whole
from selfmotion.shell.view.document import EditedPlan
from selfmotion.shell.view.found import Found, Request
from selfmotion.shell.view.motions import shown_program
from selfmotion.shell.view.session import Session
from selfmotion.shell.view.sitting import Sitting
from selfmotion.work.job import Program, load_program

# What nothing asks for is of no document.
_NOTHING = Request(0, {})


def opened(file: Path, *, allow_code: bool = False) -> Sitting:
    """Return the page of a problem file, a job file, a plan, a program or a motion in parts.

    Plans, programs and parts are judged anew, as `selfmotion check` does.

    Parameters
    ----------
    file : Path
        .toml, .json, .yaml; .npz; .program; .parts.
    allow_code : bool
        Whether code that a document names is run.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is nothing that a page can show.
    """
    if file.suffix == ".npz":
        return _of_plan(file, allow_code)
    if file.suffix == ".program":
        return _of_made(file, load_program(file))
    if file.suffix == ".parts":
        return _of_made(file, load_parts(file))
    return Session(file, allow_code=allow_code)


def _of_plan(file: Path, allow_code: bool) -> Sitting:
    plan = load_plan(file)
    try:
        edited = EditedPlan(file, plan)
        job_of(edited.document, file, allow_code=allow_code)
    except SelfmotionError as error:
        text = str(error).removeprefix(f"{file}: ")
        sitting = Sitting(file, f"the plan is shown as it is, its problem is no file's: {text}")
        sitting.open(Found(_NOTHING, "whole", plan.certificate.verdict, plan, is_brief=False))
        return sitting
    return Session(file, edited, allow_code=allow_code)


def _of_made(file: Path, made: Program | Parts) -> Sitting:
    what = "the program" if isinstance(made, Program) else "the motion"
    source = "its job file" if isinstance(made, Program) else "its problem file"
    sitting = Sitting(file, f"{what} is shown as it is; `selfmotion view` changes {source}")
    whole = shown_program(made) if isinstance(made, Program) else Whole.of(made)
    sitting.open(Found(_NOTHING, "whole", made.verdict, whole.plan, whole, made, is_brief=False))
    return sitting
