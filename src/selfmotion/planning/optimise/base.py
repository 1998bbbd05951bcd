"""Functions, optimisers and their results."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from selfmotion.basics import Array


class Function(Protocol):
    """Objective of an optimiser."""

    @property
    def evaluations(self) -> int:
        """Number of evaluations of F."""

    def value(self, x: Array) -> float:
        """Return F(x), infinite where it is not defined."""

    def gradient(self, x: Array) -> Array:
        """Return ∇F(x)."""

    def slope(self, x: Array, direction: Array) -> float:
        """Return the derivative of F at x along `direction`."""

    def metric(self, x: Array) -> Array:
        """Return the Gauss-Newton matrix at x, (size, size): an approximation of the Hessian."""


class Status(Enum):
    """Reason why an optimisation ended."""

    CONVERGED = "converged"
    PRECISION = "precision"
    MAX_ITERATIONS = "max_iterations"
    MAX_EVALUATIONS = "max_evaluations"
    UNBOUNDED = "unbounded"
    INFEASIBLE = "infeasible"
    GRADIENT = "gradient"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"
    DEADLINE = "deadline"

    @property
    def message(self) -> str:
        """Meaning of the status, and a remedy."""
        return _MESSAGES[self]

    @property
    def is_cut_short(self) -> bool:
        """Whether the user wanted no more: by Ctrl-C, a deadline or the callback."""
        return self in (Status.INTERRUPTED, Status.DEADLINE, Status.STOPPED)


_MESSAGES = {
    Status.CONVERGED: "converged: a further step would lower the cost by less than the tolerance",
    Status.PRECISION: "no step along the search direction decreases the cost any more: converged "
    "to the accuracy of its evaluation",
    Status.MAX_ITERATIONS: "the limit on iterations was reached; raise max_iterations to go on",
    Status.MAX_EVALUATIONS: "the limit on evaluations was reached; raise max_evaluations to go on",
    Status.UNBOUNDED: "the coefficients grow without bound: the cost has no minimum; add a "
    "JointVelocity cost",
    Status.INFEASIBLE: "no step reduces the violation: the constraints contradict each other or "
    "cannot be satisfied from here; relax limits or the null motion, or choose another start",
    Status.GRADIENT: "the cost does not change as its gradient says: it has a kink here, or, of a "
    "cost of one's own, the gradient is wrong (selfmotion.testing.check_cost tells)",
    Status.STOPPED: "the callback asked to stop",
    Status.INTERRUPTED: "interrupted; this is the best found so far",
    Status.DEADLINE: "the deadline has passed; this is the best found so far",
}


@dataclass(frozen=True, eq=False)
class Iteration:
    """One iteration, the first being the start.

    Attributes
    ----------
    x : (size,)
        Where it arrived.
    cost : float
        F(x).
    gradient_norm : float
        |∇F(x)|.
    update : str
        Which formula renewed H afterwards: "bfgs", "dfp", or "none".
    step : float
        α of the line search.
    evaluations : int
        Number of evaluations of F.
    """

    x: Array
    cost: float
    gradient_norm: float
    update: str
    step: float
    evaluations: int


Callback = Callable[[Iteration], bool | None]


@dataclass(frozen=True, eq=False)
class Minimum:
    """Result of an optimiser.

    Attributes
    ----------
    x : (size,)
    cost : float
    inverse_hessian : (size, size)
        The last estimate.
    history : tuple of Iteration
    status : Status
    """

    x: Array
    cost: float
    inverse_hessian: Array
    history: tuple[Iteration, ...]
    status: Status


class Optimizer(Protocol):
    """Minimiser of a function of some variables; `QuasiNewton` is the default.

    One of your own is handed to `plan` as ``optimizer=``; `selfmotion.testing.check_optimizer`
    checks it.
    """

    def minimize(
        self,
        function: Function,
        x0: Array,
        inverse_hessian: Array | None = None,
        *,
        max_evaluations: int | None = None,
        callback: Callback | None = None,
    ) -> Minimum:
        """Return the best point found from `x0`, where F is finite; never worse than `x0`.

        Parameters
        ----------
        function : Function
        x0 : (size,)
        inverse_hessian : (size, size), optional
            An estimate of the inverse Hessian from a similar function. The default is the
            optimiser's own.
        max_evaluations : int, optional
            Limit on `Function.evaluations`.
        callback : callable, optional
            To be called with each `Iteration`; returning True stops.
        """


def inverse_metric(metric: Array, floor: float = 1e-4) -> Array:
    """Return the inverse of a positive semidefinite matrix.

    Directions without curvature (coefficients that do not act, as in the over-specified joint
    space) are given that of `floor` times the largest. A matrix that is not finite, or 0, says
    nothing: then it is the identity.
    """
    if not len(metric):
        return metric
    if not (np.all(np.isfinite(metric)) and np.any(metric)):
        return np.eye(len(metric))
    values, vectors = np.linalg.eigh(metric)
    values = np.maximum(values, max(floor * values[-1], np.finfo(float).tiny))
    return np.asarray((vectors / values) @ vectors.T)
