"""What `selfmotion check` judges, and by what: a plan, a problem file, or a robot and a path."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import selfmotion as sm
from selfmotion.basics import DOCUMENT_SUFFIXES, Progress
from selfmotion.certificate import Extreme
from selfmotion.shell.cli import checks, documents, jobs, options, parts
from selfmotion.shop import controllers


class Judged(NamedTuple):
    """What a check of a motion came to.

    Attributes
    ----------
    certificate : Certificate
    near : mapping
        How near bodies come, by name.
    arm : RobotModel
    program : ControllerProgram or None
        The one that the motion is of.
    notes : tuple of str
        What is taken for granted, or passed over.
    """

    certificate: sm.Certificate
    near: Mapping[str, Extreme]
    arm: sm.RobotModel
    program: controllers.ControllerProgram | None = None
    notes: tuple[str, ...] = ()


def tolerance_of(tolerance: float | None, turn: float | None) -> sm.Tolerance | None:
    """Return the tolerance that is asked for; one number counts for both."""
    if tolerance is None and turn is not None:
        raise sm.errors.ProblemError("--turn is beside --tolerance, which is not given")
    if tolerance is None:
        return None
    return sm.Tolerance(tolerance, tolerance if turn is None else turn)


# Keys of a robot alone: a motion from elsewhere may begin and end while it moves.
_OF_OTHERS = {"start": "free", "rest": False}


@dataclass(frozen=True, eq=False)
class CheckRequest:
    """A file to check, and what it is judged by.

    Attributes
    ----------
    file : Path
    robot : str or None
        A robot, a problem file, a plan, or a job's program.
    said : DocumentOptions
        What else is asked of the motion.
    calibration : Path or None
    degrees : bool
    within : Tolerance or None
    """

    file: Path
    robot: str | None
    said: documents.DocumentOptions
    calibration: Path | None
    degrees: bool
    within: sm.Tolerance | None

    @property
    def is_job(self) -> bool:
        """Whether the file is of several motions, which say themselves what they are judged by."""
        return self.file.suffix in (jobs.PROGRAM, parts.PARTS)

    @property
    def is_of_program(self) -> bool:
        """Whether it is judged by the program of a job."""
        return self.robot is not None and Path(self.robot).suffix == jobs.PROGRAM

    def refuse_others(self) -> None:
        """Raise ProblemError for options that have no effect, since a file says it."""
        besides = {"calibration": self.calibration, "degrees": self.degrees}
        if self.is_job:
            whose = "the program's" if self.file.suffix == jobs.PROGRAM else "the parts'"
            more = {"robot": self.robot, "tolerance": self.within}
            options.refuse(self.said.by_option | besides | more, self.file, whose)
        elif self.is_of_program:
            options.refuse(self.said.by_option | besides, str(self.robot), "the program's")
        elif self.file.suffix == ".npz":
            own = {"robot": self.robot, "degrees": self.degrees}
            options.refuse(own, self.file, "the plan's")

    def judged(self, progress: Progress) -> Judged:
        """Return the certificate of the motion, by whatever says what is asked of it."""
        documents.refuse_costs(self.said)
        if self.file.suffix == ".npz":
            plan = sm.load_plan(self.file, progress=progress)
            return Judged(*checks.of_plan(plan, self.said, self.within, progress, self.calibration))
        asked = self._asked(progress)
        certificate, near, arm, program = checks.of_problem(
            self.file, asked, self.degrees, self.within, progress, self.calibration
        )
        notes = () if program else controllers.motion_notes(self.file, degrees=self.degrees)
        return Judged(certificate, near, arm, program, (*notes, *asked.notes))

    def _asked(self, progress: Progress) -> checks.Wanted:
        """Return what is asked of a motion of others."""
        if self.robot is None:
            raise sm.errors.ProblemError(
                f"{self.file}: a motion is checked against a robot and a path: give --robot and "
                f"--path, or a problem file or a plan (.npz) as --robot (a job's .program "
                f"for its program)"
            )
        if Path(self.robot).suffix == ".npz":
            plan = sm.load_plan(self.robot, progress=progress)
            problem, ending = documents.changed(plan.problem, self.said), plan.report.ending
            return checks.Wanted(problem, plan.tolerance, ending, plan, said=self.said)
        # A file's tolerance is what its motion is judged by.
        documents.refuse_how_to_plan(self.said, besides="tolerance")
        task = None
        try:
            request = documents.read(self.robot, self.said, usual=_OF_OTHERS)
        except sm.errors.RedundancyError:
            # Only planning needs a joint to spare: all else is asked as with fewer rows.
            task = sm.Task.of(self.said.task or "pose")
            request = self._with_fewer_rows(self.robot)
        problem = request.problem
        bodies = (body for each in problem.clearances for body in each.obstacles)
        meshes = (body.note for body in bodies if isinstance(body, sm.obstacles.Mesh))
        notes = (*request.notes, *filter(None, meshes))
        if Path(self.robot).suffix not in DOCUMENT_SUFFIXES:
            notes = (*notes, *problem.robot.urdf.notes, *problem.path.notes)
        return checks.Wanted(problem, request.tolerance, "", None, notes, self.said, task)

    def _with_fewer_rows(self, robot: str) -> sm.files.PlanRequest:
        """Return what is asked of an arm with a joint to spare for fewer rows."""
        with suppress(sm.SelfmotionError):
            return documents.read(robot, replace(self.said, task="position"), usual=_OF_OTHERS)
        return documents.read(robot, replace(self.said, task="planar"), usual=_OF_OTHERS)
