"""Verification by `selfmotion check`: plans, motions of files, programs of controllers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import selfmotion as sm
from selfmotion.basics import Progress
from selfmotion.certificate import Extreme, approaches
from selfmotion.shell.cli import documents
from selfmotion.shell.cli.app import print_json, stages, terminal
from selfmotion.shop import controllers

_Near = Mapping[str, Extreme]


class Wanted(NamedTuple):
    """What a motion is judged by.

    Attributes
    ----------
    problem : Problem
    tolerance : Tolerance or None
    ending : str
        Of a plan, why it ended before its path.
    plan : Plan or None
        The plan that it comes from.
    notes : tuple of str
    said : DocumentOptions
        What is asked besides.
    task : Task or None
        In place of the problem's, where that leaves no joint to spare.
    """

    problem: sm.Problem
    tolerance: sm.Tolerance | None = None
    ending: str = ""
    plan: sm.Plan | None = None
    notes: tuple[str, ...] = ()
    said: documents.DocumentOptions = documents.DocumentOptions()
    task: sm.Task | None = None


class Read(NamedTuple):
    """A motion of a file, what it may miss its path by, and the program that it is of, if any.

    Of a program the motion has to be judged by each way in which a controller may make it.
    """

    motion: sm.Trajectory
    within: sm.Tolerance | None
    program: controllers.ControllerProgram | None = None

    def ways(self, path: sm.paths.Path, robot: sm.RobotModel) -> list[sm.Trajectory]:
        """Return the motions that are judged along a path."""
        motions = [self.motion] if self.program is None else self.program.motions(path)
        return [controllers.without_mimic_joints(motion, robot) for motion in motions]

    def besides(
        self, robot: sm.RobotModel, constraints: Sequence[sm.constraints.Constraint]
    ) -> tuple[str, ...]:
        """Return what speaks against a program besides its motion."""
        program = self.program
        if program is None:
            return ()
        return (
            *([program.start_fault] if program.start_fault else []),
            *controllers.switching_faults(program, None),
            *controllers.header_faults(program, robot, constraints),
        )


def read(file: Path, degrees: bool, within: sm.Tolerance | None, robot: sm.RobotModel) -> Read:
    """Read a motion; of a program, what it may miss its path by is what it states."""
    if degrees or not is_program(file):
        return Read(sm.files.read_motion(file, degrees=degrees, robot=robot), within)
    program = controllers.read_program(file, robot)
    motion = controllers.motion_of_program(file, program)
    if within is None:
        within = controllers.stated_tolerance(program)
        if within is not None:
            text = (
                f"note: judged within the {1e3 * within.position:.3g} mm and {within.rotation:.2g} "
                f"rad that the file states; accelerations are the controller's, and not judged"
            )
            stages.print(text, markup=False, soft_wrap=True)
    return Read(motion, within, program)


def is_program(file: Path) -> bool:
    """Whether a file is a program of a controller."""
    return file.suffix.lower() in controllers.READ_PROGRAMS


def with_failures(certificate: sm.Certificate, texts: Sequence[str]) -> sm.Certificate:
    """Return a certificate with what else speaks against a motion."""
    return replace(certificate, failures=(*certificate.failures, *texts))


def left_to_controller(program: controllers.ControllerProgram | None) -> dict[str, str]:
    """Return what a verdict on a program leaves to the controller, for JSON; of others nothing."""
    return {} if program is None else {"not_judged": controllers.unjudged_note(program)}


def print_controller_note(program: controllers.ControllerProgram | None) -> None:
    """Print what a verdict on a program of seams at their feeds leaves to the controller."""
    if program is not None and program.feed_tolerance is not None:
        terminal.print(controllers.unjudged_note(program), markup=False, soft_wrap=True)


def on_calibrated(problem: sm.Problem, calibration: Path) -> sm.Problem:
    """Return what a motion that was planned for the arm as drawn is judged by on a calibrated one.

    Where the motion begins is then a question of the path.
    """
    return sm.calibrated(replace(problem, start="free"), calibration)


def print_difference(robot: sm.RobotModel, motion: sm.Trajectory) -> None:
    """Print how far the tool of a calibrated arm is from where the arm as drawn has it."""
    position, rotation = sm.off_nominal(robot, motion)
    text = (
        f"calibrated arm: '{position.name}' is up to {position.value * 1e3:.3g} mm (at "
        f"{position.time:.4g} s) and {np.degrees(rotation.value):.3g}° (at {rotation.time:.4g} s) "
        f"from where the arm as drawn has it"
    )
    stages.print(text, markup=False, soft_wrap=True)


def of_plan(
    plan: sm.Plan,
    said: documents.DocumentOptions,
    within: sm.Tolerance | None,
    progress: Progress,
    calibration: Path | None,
) -> tuple[sm.Certificate, _Near, sm.RobotModel]:
    """Return the certificate of a plan, how near bodies come, and the arm."""
    problem = documents.changed(plan.problem, said)
    if calibration is not None:
        problem = on_calibrated(problem, calibration)
        print_difference(problem.robot, plan.trajectory)
    close = near(problem.robot, plan.trajectory, problem.requirements)
    if problem is not plan.problem:
        certificate = problem.certify(
            plan.trajectory, within or plan.tolerance, plan.report.ending, (), progress
        )
    else:
        certificate = plan.certificate if within is None else plan.check(within, progress=progress)
    return certificate, close, problem.robot


def of_problem(
    file: Path,
    asked: Wanted,
    degrees: bool,
    within: sm.Tolerance | None,
    progress: Progress,
    calibration: Path | None,
) -> tuple[sm.Certificate, _Near, sm.RobotModel, controllers.ControllerProgram | None]:
    """Return the same of a motion by all that a problem asks, and the program that it is."""
    problem, tolerance, ending, plan = asked[:4]
    content = read(file, degrees, within, problem.robot)
    if plan is not None and content.program is None:
        slower = controllers.slowed_as(plan, content.motion)
        if slower is not plan:
            times = slower.trajectory.duration / plan.trajectory.duration
            text = (
                f"note: judged by the plan as slow as its samples at this rate need, {times:.4f} "
                f"times as long, as export --rate writes it"
            )
            stages.print(text, markup=False, soft_wrap=True)
            problem = documents.changed(slower.problem, asked.said)
    motions, program = content.ways(problem.path, problem.robot), content.program
    against = content.besides(problem.robot, problem.constraints)
    if program is not None:
        problem = controllers.problem_of_targets(problem)
        ends = motions[0].of_joints(problem.robot.joint_names).q[[0, -1]]
        shifted = controllers.as_shifted(problem, program, ends[0])
        is_moved = plan is not None or not controllers.is_nearer(problem, shifted, ends)
        problem = shifted if is_moved else problem
        obstacles = any(item.obstacles for item in problem.requirements)
        note = controllers.shift_note(program, moved=is_moved, obstacles=obstacles)
        if note:
            stages.print(f"note: {note}", markup=False, soft_wrap=True)
    if calibration is not None:
        problem = on_calibrated(problem, calibration)
        print_difference(problem.robot, motions[0])
    allowed, robot = content.within or tolerance, problem.robot

    def certify(each: sm.Problem, motion: sm.Trajectory) -> sm.Certificate:
        if asked.task is None:
            return each.certify(motion, allowed, ending, (), progress)
        all_asked = each.requirements
        return sm.certify(
            robot, each.path, asked.task, motion, allowed, all_asked, progress=progress
        )

    certificate, motion = controllers.worst_certificate(problem, motions, certify)
    certificate = with_failures(certificate, against)
    return certificate, near(robot, motion, problem.requirements), robot, program


def near(
    robot: sm.RobotModel, motion: sm.Trajectory, requirements: Sequence[sm.certificate.Requirement]
) -> _Near:
    """Return how near each body comes."""
    return approaches(
        requirements, sm.certificate.FinishedMotion(robot, motion.of_joints(robot.joint_names))
    )


def check_program(
    file: Path, job: Path, within: sm.Tolerance | None, as_json: bool, verbose: bool
) -> bool:
    """Judge a controller's program by its job, print the verdict, and return whether it holds."""
    if not is_program(file):
        raise sm.errors.ProblemError(
            f"{file}: is no program of a controller, which {job} could judge"
        )
    judged = controllers.judge_program(file, sm.load_program(job), within)
    steps, verified = judged.steps, judged.verified
    if as_json:
        data = {
            "verified": verified,
            "verdict": judged.verdict,
            "failures": list(judged.failures),
            "steps": [step._asdict() for step in steps],
        }
        print_json(data)
    else:
        for step in steps if verbose else [step for step in steps if not step.verified]:
            style = None if step.verified else "bold red"
            text = f"{step.name}: {step.verdict}"
            terminal.print(text, style=style, markup=False, soft_wrap=True)
        terminal.print(judged.verdict, markup=False, soft_wrap=True)
    return verified
