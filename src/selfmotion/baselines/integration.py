"""Integrates joint velocity fields q̇(t, q) along a path, by error control instead of a grid."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, cast

import numpy as np

from selfmotion.basics import Array, BreakdownError
from selfmotion.problem import Problem
from selfmotion.task import feedback_rate

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution

Rate = Callable[[float, Array], Array]

# Of the integrator: far below what a certificate accepts.
_TOLERANCE = 1e-9

# Joint speeds, in path durations per radian, at which a motion counts as broken down.
_RUNAWAY = 1e6


@dataclass(frozen=True, eq=False)
class Here:
    """The kinematics at a time and configuration.

    Attributes
    ----------
    jacobian : (m, n)
        Task Jacobian J.
    gram : (m, m)
        JJᵀ.
    command : (m,)
        ẋ + K e in the task's rows, with pose error e.
    rotation : (3, 3)
        The tool's orientation.
    twist : (6,)
        The path's twist.
    """

    jacobian: Array
    gram: Array
    command: Array
    rotation: Array
    twist: Array


class PoseFeedback:
    """t, q → `Here`: what the arm must do at that time to stay on, or return to, the path."""

    def __init__(self, problem: Problem) -> None:
        self._robot, self._path, self._task = problem.robot, problem.path, problem.task
        self._gain = feedback_rate(problem.path.duration)

    def __call__(self, t: float, q: Array) -> Here:
        """Return the kinematics at time `t` [s] and configuration `q` (n,)."""
        task = self._task
        full, rotation, translation = self._robot.chain.at(q)
        target = self._path.samples(t)
        angular = np.zeros(3)
        if np.any(task.rows >= 3):
            from selfmotion.task import SE3

            pose = SE3(target.rotation[0], target.translation[0])
            angular = task.twist_error(pose, SE3(rotation, translation))[3:]
        error = np.concatenate([target.translation[0] - translation, angular])
        wanted = target.twist[0] + self._gain * error
        jacobian = task.select(full, rotation)
        command = task.select(wanted[:, None], rotation)[:, 0]
        return Here(jacobian, jacobian @ jacobian.T, command, rotation, target.twist[0])


@dataclass(frozen=True, eq=False)
class Integrated:
    """An integrated motion.

    Attributes
    ----------
    at : callable
        t (K,) → q, q̇ (K, n) each.
    rates : int
        Evaluations of the velocity field.
    """

    at: Callable[[Array], tuple[Array, Array]]
    rates: int


def start_of(problem: Problem) -> Array:
    """Return q(0) (n,): the given one, or an inverse-kinematics solution where the start is free.

    Raises
    ------
    InverseKinematicsError
        The start is free and no configuration reaches the start of the path.
    """
    if problem.given_start is not None:
        return problem.given_start
    return problem.robot.inverse_kinematics(problem.path.pose(0.0), problem.task)


def integrate(problem: Problem, rate: Rate) -> Integrated:
    """Integrate q̇ = rate(t, q) from the problem's start by DOP853, piece by piece of the path.

    Raises
    ------
    BreakdownError
        The velocity grows without bound: the field is singular there.
    """
    # Here, because importing it takes as long as the rest of the package.
    from scipy.integrate import solve_ivp

    pieces: list[tuple[float, OdeSolution]] = []
    rates = 0
    q = start_of(problem)
    guarded = _guarded(problem, rate)
    for start, end in pairwise(problem.path.knots):
        solution = solve_ivp(
            guarded,
            (float(start), float(end)),
            q,
            method="DOP853",
            rtol=_TOLERANCE,
            atol=_TOLERANCE,
            dense_output=True,
        )
        if not solution.success:
            raise BreakdownError(
                f"{problem.robot.name}: the motion cannot be integrated beyond "
                f"t = {solution.t[-1]:.4g} s: {solution.message}",
                time=float(solution.t[-1]),
            )
        rates += solution.nfev
        pieces.append((float(end), cast("OdeSolution", solution.sol)))
        q = solution.y[:, -1]
    ends = np.array([end for end, _ in pieces])

    def at(t: Array) -> tuple[Array, Array]:
        which = np.minimum(np.searchsorted(ends, t), len(ends) - 1)
        configurations = np.empty((len(t), len(q)))
        for k, (_, piece) in enumerate(pieces):
            configurations[which == k] = piece(t[which == k]).T
        rows = zip(t, configurations, strict=True)
        return configurations, np.array([rate(float(time), row) for time, row in rows])

    return Integrated(at, rates)


def _guarded(problem: Problem, rate: Rate) -> Rate:
    """Return a rate that breaks down where it grows without bound."""
    fastest = _RUNAWAY / problem.path.duration

    def guarded(t: float, configuration: Array) -> Array:
        velocity = rate(t, configuration)
        if not np.all(np.abs(velocity) < fastest):
            raise BreakdownError(
                f"{problem.robot.name}: joint speeds grow without bound near t = {t:.4g} s; the "
                f"method is singular there",
                time=t,
            )
        return velocity

    return guarded
