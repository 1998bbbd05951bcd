"""What a page shows of a file, by what the file is."""

from dataclasses import replace
from pathlib import Path

from selfmotion.basics import ProblemError, SelfmotionError
from selfmotion.planning.result import Parts, load_parts, load_plan
from selfmotion.shell.documents import plan_request_of
from selfmotion.shell.replay import PlanReplay, SequenceReplay
from selfmotion.shell.view.document import EditedPlan
from selfmotion.shell.view.edit_session import EditSession
from selfmotion.shell.view.motions import shown_as_written, shown_program
from selfmotion.shell.view.page_session import PageSession
from selfmotion.shell.view.requests import Outcome, Request
from selfmotion.shop import controllers
from selfmotion.work.job import Program, load_program

# What nothing asks for is of no document.
_NOTHING = Request(0, {})
# Number of steps that are not verified and are named.
_TOLD = 3


def opened(file: Path, *, allow_code: bool = False, job: Path | None = None) -> PageSession:
    """Return the page of a problem file, a job file, a plan, a program or a motion in parts.

    Plans, programs and parts are judged anew, as `selfmotion check` does.

    Parameters
    ----------
    file : Path
        .toml, .json, .yaml; .npz; .program; .parts; or a controller's program.
    allow_code : bool
        Whether code that a document names is run.
    job : Path, optional
        The .program that a controller's program was made of.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is nothing that a page can show.
    ProblemError
        A controller's program without its job, or a job beside anything else.
    """
    is_written = file.suffix.lower() in controllers.READ_PROGRAMS
    if is_written != (job is not None):
        expected = "is a controller's program: give the .program that it was made of as --robot"
        unused = "has no use for --robot, which is for programs of controllers"
        raise ProblemError(f"{file}: {expected if is_written else unused}")
    if job is not None:
        return _of_written(file, load_program(job))
    if file.suffix == ".npz":
        return _of_plan(file, allow_code)
    if file.suffix == ".program":
        return _of_made(file, load_program(file))
    if file.suffix == ".parts":
        return _of_made(file, load_parts(file))
    return EditSession(file, allow_code=allow_code)


def _of_plan(file: Path, allow_code: bool) -> PageSession:
    plan = load_plan(file)
    try:
        edited = EditedPlan(file, plan)
        plan_request_of(edited.document, file, allow_code=allow_code)
    except SelfmotionError as error:
        text = str(error).removeprefix(f"{file}: ")
        session = PageSession(file, f"the plan is shown as it is, its problem is no file's: {text}")
        verdict = plan.certificate.verdict
        session.open(Outcome(_NOTHING, "whole", verdict, PlanReplay(plan), is_brief=False))
        return session
    return EditSession(file, edited, allow_code=allow_code)


def _of_written(file: Path, program: Program) -> PageSession:
    """Return the page of a controller's program: as it is judged, and moves by its first way."""
    judged = controllers.judge_program(file, program)
    parts = controllers.step_motions(file, controllers.read_program(file, program.robot), program)
    wrong = [step for step in judged.steps if not step.verified]
    told = [f"'{step.name}': {step.verdict}" for step in wrong[:_TOLD]]
    words = "; ".join([judged.verdict, *told])
    replayed = shown_as_written(program, [ways[0] for ways in parts.motions], words)
    replayed = replace(replayed, verified=judged.verified)
    seams = program.plans
    unmade = tuple(seams[step.name].path for step in wrong if step.name in seams)
    session = PageSession(file, f"{file.name} is shown as it is, and judged by its job")
    session.open(Outcome(_NOTHING, "whole", words, replayed, unmade=unmade, is_brief=False))
    return session


def _of_made(file: Path, made: Program | Parts) -> PageSession:
    what = "the program" if isinstance(made, Program) else "the motion"
    source = "its job file" if isinstance(made, Program) else "its problem file"
    session = PageSession(file, f"{what} is shown as it is; `selfmotion view` changes {source}")
    replayed = shown_program(made) if isinstance(made, Program) else SequenceReplay.of(made)
    session.open(Outcome(_NOTHING, "whole", made.verdict, replayed, made, is_brief=False))
    return session
