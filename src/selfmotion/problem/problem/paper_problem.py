"""The paper's sample problem."""

import numpy as np

from selfmotion.model.motion import NullMotion, PolynomialNullMotion
from selfmotion.model.path import TwistPath
from selfmotion.model.robot import load_robot
from selfmotion.model.task import Task
from selfmotion.problem.costs import InverseManipulability, JointVelocity
from selfmotion.problem.problem.problem import Problem


def sample_problem(
    mu: float = 1.0, duration: float = 1.0, null_motion: NullMotion | None = None
) -> Problem:
    """Return the paper's sample problem (section 3.1): a planar arm through the origin.

    Links of 2, 2 and 1 m; q(0) = [0, π/2, -π/2] (eq. 15); ẋ = [-3π sin πt, -2π sin πt] (eq. 16),
    so that x(t) = (3 cos πt, 2 cos πt); costs ½ q̇ᵀq̇ + μ / det(JJᵀ) (eq. 12).

    Parameters
    ----------
    mu : float
        Weight μ of the singularity term, 1 / det(JJᵀ).
    duration : float
        Duration [s]: 1 for the way there, 2 for the way there and back.
    null_motion : NullMotion, optional
        Default: cubic in the null space. The paper's own is
        ``PolynomialNullMotion(degree=3, space="joint", basis="monomial")``.
    """
    robot = load_robot("planar_3r")
    start = np.array([0.0, np.pi / 2, -np.pi / 2])

    def velocity(t: float) -> list[float]:
        return [-3 * np.pi * np.sin(np.pi * t), -2 * np.pi * np.sin(np.pi * t), 0.0]

    return Problem(
        robot,
        TwistPath(robot.pose(start), velocity, duration),
        Task.PLANAR,
        start=start,
        null_motion=null_motion or PolynomialNullMotion(),
        costs=(JointVelocity(), InverseManipulability(mu)),
        # The paper's arm already moves while the tool is still at rest.
        rest=False,
    )
