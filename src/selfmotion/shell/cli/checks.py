"""Verification by `selfmotion check`: plans, motions of files, programs of controllers."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import typer

import selfmotion as sm
from selfmotion.basics import Progress
from selfmotion.certificate import Extreme, approaches
from selfmotion.model.collision import srdf_notes
from selfmotion.problem.constraints import NO_OVERLAP
from selfmotion.problem.problem import OF_MAKER
from selfmotion.shell.cli import options
from selfmotion.shell.cli.app import NOT_VERIFIED, VERIFIED, print_json, stages, terminal
from selfmotion.shell.documents import joint_limit_notes, read_joint_limits
from selfmotion.shop import controllers

_Near = Mapping[str, Extreme]


def requirements(
    robot: sm.RobotModel,
    velocity: str | None,
    acceleration: str | None,
    joint_limits: Path | None,
    obstacles: Path | None,
    clearance: float,
    srdf: Path | None,
    disabled: list[str] | None,
    *,
    usual: bool = False,
    apart: bool = False,
) -> tuple[sm.certificate.Requirement, ...]:
    """Return what a motion of others has to keep besides its path and the arm's own limits.

    With what `plan` keeps `usual`ly, accelerations and jerks of the arm's maker, and the arm
    `apart` from itself.
    """
    constraints: list[sm.constraints.Constraint] = []
    if usual:
        constraints += [item for item in OF_MAKER if item.applies(robot)]
    if velocity is not None:
        most = options.one_or_each(velocity, "--velocity")
        constraints.append(sm.constraints.JointVelocityLimits(most))
    if acceleration is not None:
        most = options.one_or_each(acceleration, "--acceleration")
        constraints.append(sm.constraints.JointAccelerationLimits(most))
    if joint_limits is not None:
        constraints += read_joint_limits(joint_limits, robot)
    if obstacles is not None or clearance != 0.0 or srdf is not None or disabled:
        bodies = () if obstacles is None else options.read_obstacles(obstacles)
        pairs = tuple((one, other) for one, other in options.disabled_pairs(disabled))
        constraints.append(sm.constraints.Clearance(bodies, clearance, srdf, pairs))
    elif apart and robot.urdf.has_collisions:
        constraints.append(NO_OVERLAP)
    return tuple(item.requirement(robot) for item in constraints)


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
            *controllers.differing_facts(program, robot, constraints),
        )


def read(file: Path, degrees: bool, within: sm.Tolerance | None, robot: sm.RobotModel) -> Read:
    """Read a motion; of a program, what it may miss its path by is what it states."""
    if degrees or not is_program(file):
        return Read(sm.files.read_motion(file, degrees=degrees, robot=robot), within)
    program = controllers.read_program(file, robot)
    motion = controllers.motion_of_program(file, program)
    if within is None:
        within = controllers.stated_deviation(program)
        if within is not None:
            text = (
                f"note: judged within the {1e3 * within.position:.3g} mm and {within.rotation:.2g} "
                f"rad that the file states; accelerations are the controller's, and not judged"
            )
            stages.print(text, markup=False, soft_wrap=True)
    return Read(motion, within, program)


def notes_of(
    file: Path,
    degrees: bool,
    robot: sm.RobotModel,
    joint_limits: Path | None,
    obstacles: Path | None,
    srdf: Path | None,
) -> tuple[str, ...]:
    """Return what is taken for granted, or passed over, of the files of a check."""
    bodies = () if obstacles is None else options.read_obstacles(obstacles)
    return (
        *([] if is_program(file) else controllers.motion_notes(file, degrees=degrees)),
        *([] if joint_limits is None else joint_limit_notes(joint_limits, robot)),
        *([] if srdf is None else srdf_notes(srdf)),
        *(body.note for body in bodies if isinstance(body, sm.obstacles.Mesh) and body.note),
    )


def is_program(file: Path) -> bool:
    """Whether a file is a program of a controller."""
    return file.suffix.lower() in controllers.READ_PROGRAMS


def with_failures(certificate: sm.Certificate, texts: Sequence[str]) -> sm.Certificate:
    """Return a certificate with what else speaks against a motion."""
    return replace(certificate, failures=(*certificate.failures, *texts))


def left_to_controller(program: controllers.ControllerProgram | None) -> dict[str, str]:
    """Return what a verdict on a program leaves to the controller, for JSON; of others nothing."""
    return {} if program is None else {"not_judged": controllers.controller_note(program)}


def print_controller_note(program: controllers.ControllerProgram | None) -> None:
    """Print what a verdict on a program of seams at their feeds leaves to the controller."""
    if program is not None and program.within is not None:
        terminal.print(controllers.controller_note(program), markup=False, soft_wrap=True)


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
    file: Path,
    within: sm.Tolerance | None,
    judged: tuple[Any, ...],
    progress: Progress,
    calibration: Path | None = None,
) -> tuple[sm.Certificate, _Near, sm.RobotModel]:
    """Return the certificate of a plan, how near bodies come, and the arm."""
    plan = sm.load_plan(file, progress=progress)
    if calibration is not None:
        problem = on_calibrated(plan.problem, calibration)
        besides = requirements(problem.robot, *judged)
        certificate = problem.certify(
            plan.trajectory, within or plan.tolerance, plan.report.ending, besides, progress
        )
        print_difference(problem.robot, plan.trajectory)
        all_requirements = (*problem.requirements, *besides)
        return certificate, near(problem.robot, plan.trajectory, all_requirements), problem.robot
    besides = requirements(plan.robot, *judged)
    close = near(plan.robot, plan.trajectory, (*plan.requirements, *besides))
    if within is None and not any(judged):
        return plan.certificate, close, plan.robot
    return plan.check(within, besides, progress=progress), close, plan.robot


def of_problem(
    file: Path,
    asked: str,
    degrees: bool,
    within: sm.Tolerance | None,
    judged: tuple[Any, ...],
    progress: Progress,
    calibration: Path | None = None,
) -> tuple[sm.Certificate, _Near, sm.RobotModel, controllers.ControllerProgram | None]:
    """Return the same of a motion by all that a problem file or a plan asks.

    And the program that it is.
    """
    problem, tolerance, ending, plan = _asked_by(Path(asked), progress)
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
            problem = slower.problem
    motions, program = content.ways(problem.path, problem.robot), content.program
    against = content.besides(problem.robot, problem.constraints)
    if program is not None:
        problem = controllers.by_targets(problem)
        begin = motions[0].of_joints(problem.robot.joint_names).q[0]
        problem = controllers.as_shifted(problem, program, begin)
        if controllers.shift_note(program):
            stages.print(f"note: {controllers.shift_note(program)}", markup=False, soft_wrap=True)
    if calibration is not None:
        problem = on_calibrated(problem, calibration)
        print_difference(problem.robot, motions[0])
    besides = requirements(problem.robot, *judged)
    allowed, robot = content.within or tolerance, problem.robot

    def certify(motion: sm.Trajectory) -> sm.Certificate:
        return problem.certify(motion, allowed, ending, besides, progress)

    lines = replace(problem, constraints=controllers.constraints_of_lines(problem.constraints))

    def certify_lines(motion: sm.Trajectory) -> sm.Certificate:
        return lines.certify(motion, allowed, ending, besides, progress)

    certificate, motion = controllers.judged_interpolations(motions, certify, certify_lines)
    certificate = with_failures(certificate, against)
    close = near(robot, motion, (*problem.requirements, *besides))
    return certificate, close, robot, program


def _asked_by(
    file: Path, progress: Progress
) -> tuple[sm.Problem, sm.Tolerance | None, str, sm.Plan | None]:
    """Return the problem of a problem file or of a saved plan, its tolerance, how that ended.

    And the plan, where it is one.
    """
    if file.suffix == ".npz":
        plan = sm.load_plan(file, progress=progress)
        return plan.problem, plan.tolerance, plan.report.ending, plan
    job = sm.files.read_job(file)
    return job.problem, job.tolerance, "", None


def near(
    robot: sm.RobotModel, motion: sm.Trajectory, requirements: Sequence[sm.certificate.Requirement]
) -> _Near:
    """Return how near each body comes."""
    return approaches(
        requirements, sm.certificate.FinishedMotion(robot, motion.of_joints(robot.joint_names))
    )


def of_program(
    file: Path, job: Path, within: sm.Tolerance | None, as_json: bool, verbose: bool
) -> NoReturn:
    """Judge a controller's program by the job that it is of, each step and the whole, and end."""
    if not is_program(file):
        raise sm.errors.ProblemError(
            f"{file}: is no program of a controller, which {job} could judge"
        )
    judged = controllers.judged_program(file, sm.load_program(job), within)
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
    raise typer.Exit(VERIFIED if verified else NOT_VERIFIED)
