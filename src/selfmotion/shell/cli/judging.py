"""What `selfmotion check` judges, and by what: a plan, a problem file, or options."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import selfmotion as sm
from selfmotion.basics import Progress
from selfmotion.certificate import Extreme
from selfmotion.shell.cli import checks, documents, jobs, options
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


@dataclass(frozen=True, eq=False)
class Asked:
    """A file to check, and the options of the command.

    Attributes
    ----------
    file : Path
    given : mapping
        Options by the name of their parameter.
    """

    file: Path
    given: Mapping[str, Any]

    @property
    def is_job(self) -> bool:
        """Whether the file is of several motions, which say themselves what they are judged by."""
        return self.file.suffix in (jobs.PROGRAM, jobs.PARTS)

    @property
    def is_of_program(self) -> bool:
        """Whether it is judged by the program of a job."""
        robot = self.given["robot"]
        return robot is not None and Path(robot).suffix == jobs.PROGRAM

    @property
    def within(self) -> sm.Tolerance | None:
        """The tolerance that is asked for."""
        tolerance = self.given["tolerance"]
        return None if tolerance is None else sm.Tolerance(tolerance, tolerance)

    @cached_property
    def _limits(self) -> tuple[Any, ...]:
        """What is to be kept besides, as `checks.requirements` takes it."""
        names = ("velocity", "acceleration", "joint_limits", "obstacles", "clearance", "srdf")
        return (*(self.given[name] for name in names), self.given["disabled"])

    @cached_property
    def _of_motion(self) -> dict[str, Any]:
        """Options that say what the motion is of, by their names; None where they are not given."""
        typed = {name: self.given[name] for name in ("path", *documents.OF_PATH)}
        typed["flip_normals"] = typed["flip_normals"] or None
        options = {name.replace("_", "-"): value for name, value in typed.items()}
        options |= {name: self.given[name] for name in ("task", "tool", "reference")}
        options |= {name: self.given[name] or None for name in ("lock", "argument", "packages")}
        return options | {"no-self-collision": self.given["no_collision"] or None}

    def refuse_others(self) -> None:
        """Raise ProblemError for options that have no effect, since a file says it."""
        given, file = self.given, self.file
        besides = {"calibration": given["calibration"], "degrees": given["degrees"] or None}
        limits = {"limits": any(self._limits) or None}
        if self.is_job:
            whose = "the program's" if file.suffix == jobs.PROGRAM else "the parts'"
            more = {"robot": given["robot"], "tolerance": given["tolerance"]}
            options.refuse(self._of_motion | besides | more | limits, file, whose)
        elif self.is_of_program:
            options.refuse(self._of_motion | besides | limits, given["robot"], "the program's")

    def judged(self, progress: Progress) -> Judged:
        """Return the certificate of the motion, by whatever says what is asked of it."""
        given, file, robot = self.given, self.file, self.given["robot"]
        if file.suffix == ".npz":
            own = {"robot": robot, "degrees": given["degrees"] or None}
            options.refuse(self._of_motion | own, file, "the plan's")
            return Judged(
                *checks.of_plan(file, self.within, self._limits, progress, given["calibration"])
            )
        if robot is not None and Path(robot).suffix in (".npz", *documents.SUFFIXES):
            whose = "the plan's" if Path(robot).suffix == ".npz" else "the problem's"
            options.refuse(self._of_motion, robot, whose)
            certificate, near, arm, program = checks.of_problem(
                file,
                robot,
                given["degrees"],
                self.within,
                self._limits,
                progress,
                given["calibration"],
            )
            return Judged(certificate, near, arm, program, self._notes(arm))
        return self._by_options(progress)

    def _by_options(self, progress: Progress) -> Judged:
        """Return the certificate of a motion along a path, both of which options name."""
        given, file = self.given, self.file
        if given["robot"] is None or given["path"] is None:
            raise sm.errors.ProblemError(
                f"{file}: a motion is checked against a robot and a path: give --robot and "
                f"--path, or a problem file or a plan (.npz) as --robot (a job's .program "
                f"for its program)"
            )
        arm = sm.load_robot(
            given["robot"],
            tool=given["tool"],
            lock=options.locks(given["lock"]),
            reference=given["reference"],
            arguments=options.arguments(given["argument"]),
            packages=given["packages"] or (),
            calibration=given["calibration"],
        )
        read = checks.read(file, given["degrees"], self.within, arm)
        # Accelerations of a program are the controller's.
        requirements = checks.requirements(
            arm, *self._limits, usual=read.program is None, apart=not given["no_collision"]
        )
        followed = documents.followed(given["path"], given, arm)
        task = given["task"] or "pose"

        def certify(motion: sm.Trajectory) -> sm.Certificate:
            return sm.certify(
                arm, followed, task, motion, read.within, requirements, progress=progress
            )

        certificate, motion = controllers.judged_interpolations(read.ways(followed, arm), certify)
        certificate = checks.with_failures(certificate, read.besides(arm, ()))
        notes = (*self._notes(arm), *arm.urdf.notes, *followed.notes)
        return Judged(certificate, checks.near(arm, motion, requirements), arm, read.program, notes)

    def _notes(self, arm: sm.RobotModel) -> tuple[str, ...]:
        given = self.given
        files = given["joint_limits"], given["obstacles"], given["srdf"]
        return checks.notes_of(self.file, given["degrees"], arm, *files)
