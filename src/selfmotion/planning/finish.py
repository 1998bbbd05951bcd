"""The motion of a session on the first grid that holds the tolerance, with its certificate."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Progress
from selfmotion.certificate import Certificate, Requirements, Tolerance, certify
from selfmotion.motion import Trajectory
from selfmotion.optimise import Status
from selfmotion.planning.largest_part import Part
from selfmotion.planning.session import MOST_HALVINGS, Session
from selfmotion.plans import Problem


class Checked(NamedTuple):
    """A motion, the one at x = 0 on the same grid, what they cost, and the check."""

    terms: dict[str, float]
    trajectory: Trajectory
    certificate: Certificate
    initial_terms: dict[str, float]
    initial_trajectory: Trajectory
    damped: bool
    tolerance: Tolerance


def checked_motion(
    problem: Problem, part: Part, tolerance: Tolerance, progress: Progress
) -> Checked:
    """Return what there is on the first grid on which the motion holds the tolerance."""
    session, requirements = part.session, replace(problem.requirements, ending=part.ending)
    checked = coarse = None
    misses: list[float] = []
    for _ in range(MOST_HALVINGS):
        try:
            progress("checking", 1, 1)
            checked = _check(problem, session, tolerance, requirements)
            certificate, trajectory = checked.certificate, checked.trajectory
            errors = certificate.position_error.value, certificate.rotation_error.value
            # Accelerations of the cubics come near those of the motion as the square of the step.
            ratio = certificate.acceleration_ratio
            rough = ratio is not None and ratio.value > 1.0 and not session.violations
            if within(errors, tolerance) and not rough:
                break
            # What damping costs stays on any grid: there, the motion stands when the tool does.
            if coarse is not None and within(
                _largest_change(problem, coarse, trajectory), tolerance
            ):
                break
            coarse = trajectory if checked.damped else None
            # What is out of reach is so on any grid.
            misses.append(sum(errors))
            if coarse is None and len(misses) > 2 and misses[-1] > 0.5 * misses[-3]:
                break
            session.refine()
        except KeyboardInterrupt:
            session.end(Status.INTERRUPTED)
            break
    # No plan goes without a certificate, interrupted or not.
    return checked or _check(problem, session, tolerance, requirements)


def within(errors: tuple[float, float], tolerance: Tolerance) -> bool:
    """Return whether errors [m, rad] are within a tolerance."""
    return errors[0] <= tolerance.position and errors[1] <= tolerance.rotation


def _largest_change(problem: Problem, coarse: Trajectory, fine: Trajectory) -> tuple[float, float]:
    """Return how far apart two motions put the tool in the prescribed rows, at most [m, rad]."""
    robot, task = problem.robot, problem.rows
    pairs = zip(coarse(fine.t), fine.q, strict=True)
    misses = np.array([task.miss(robot.pose(first), robot.pose(second)) for first, second in pairs])
    position, rotation = misses.max(axis=0)
    return float(position), float(rotation)


def _check(
    problem: Problem, session: Session, tolerance: Tolerance, requirements: Requirements
) -> Checked:
    terms, trajectory, damped = session.terms(), session.trajectory(), session.damped
    certificate = certify(
        problem.robot, problem.path, problem.rows, trajectory, tolerance, requirements
    )
    initial_terms = session.initial_terms()
    initial_trajectory = session.trajectory()
    return Checked(
        terms, trajectory, certificate, initial_terms, initial_trajectory, damped, tolerance
    )
