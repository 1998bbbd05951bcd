"""Base of costs: an integrand G of samples, with its derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, Saved, as_number, as_numbers, series, shown
from selfmotion.model.follow import Follows
from selfmotion.problem.costs.samples import Samples

# Stands for the pose error e, in the rows of the task, among orders of derivatives.
ERROR = -1


@dataclass(frozen=True, eq=False)
class Partials:
    """Derivatives of an integrand at S samples; None stands for zero.

    Attributes
    ----------
    q, qd, qdd, qddd : (S, n) or None
        ∂G/∂q, ∂G/∂q̇, ∂G/∂q̈ and ∂G/∂q⃛.
    error : (S, 6 F) or None
        ∂G/∂e, e the pose errors of F tips, one after the other; of damped motions alone.
    """

    q: Array | None = None
    qd: Array | None = None
    qdd: Array | None = None
    qddd: Array | None = None
    error: Array | None = None


class Cost(Saved, ABC, family="cost"):
    """An integrand G of the cost F = ∫ G dt. It sees samples, never coefficients.

    A cost of one's own gives `value` and `gradient`; `selfmotion.testing.check_cost` checks it.

    Attributes
    ----------
    name : str
        Name of the cost in reports.
    is_quadratic : bool
        Whether G is of second degree in q and its derivatives, with `curvature` for all that bends:
        Newton's method takes that, and differences of gradients of other costs.
    is_pointwise : bool
        Whether G at a sample depends on that sample alone, so that samples of several motions can
        be evaluated together; no by default. Starts are ranked faster then.
    """

    name: str
    is_quadratic: ClassVar[bool] = False
    is_pointwise: ClassVar[bool] = False

    @abstractmethod
    def value(self, samples: Samples) -> Array:
        """Return G at the samples, (S,)."""

    @abstractmethod
    def gradient(self, samples: Samples) -> Partials:
        """Return the derivatives of G at the samples."""

    def curvature(self, dof: int) -> dict[int, Array]:
        """Return W (n, n) by order of derivative, where G is ½ xᵀWx of q (0), q̇ (1), q̈ (2), q⃛ (3).

        The Gauss-Newton matrix at the start of the optimiser consists of these; {} (the default) if
        G is no quadratic form.
        """
        return {}

    def check(self, follows: Follows) -> None:
        """Raise ProblemError where the cost does not fit an arm and a task; nothing by default."""


def is_quadratic_form(cost: Cost) -> bool:
    """Whether a cost is given by its `curvature`, and by its value and gradient at the origin.

    Where it says so (`Cost.is_quadratic`), but not where a class that derives from one that does is
    evaluated otherwise.
    """
    evaluated = ("value", "gradient", "curvature")
    return cost.is_quadratic and series.holds_for(cost, *evaluated, says="is_quadratic")


def as_weight(weight: float | npt.ArrayLike, name: str) -> Array:
    """Return a weight read-only; ProblemError unless it is positive semidefinite."""
    check_name(name)
    expected = "a number, one for each joint, or a matrix (n, n), finite"
    array = as_numbers(weight, f"cost '{name}': weight", expected)
    if array.ndim > 2 or not array.size:
        raise ProblemError(f"cost '{name}': weight has shape {array.shape}, expected {expected}")
    symmetric = array.ndim < 2 or (
        array.shape[0] == array.shape[1] and np.allclose(array, array.T, atol=1e-12)
    )
    if not symmetric:
        raise ProblemError(f"cost '{name}': weight is not a symmetric matrix")
    smallest = np.linalg.eigvalsh(array)[0] if array.ndim == 2 else array.min()
    if smallest < -1e-12:
        raise ProblemError(
            f"cost '{name}': weight has the negative value {smallest}, expected none below 0"
        )
    return array


def check_weight(weight: Array, dof: int, name: str) -> None:
    """Raise ProblemError unless the weight has one entry per joint."""
    if weight.ndim and weight.shape[0] != dof:
        raise ProblemError(
            f"cost '{name}': weight has shape {weight.shape}, expected one entry per joint ({dof})"
        )


def check_mu(mu: float, name: str) -> None:
    """Raise ProblemError unless the factor is finite and not negative."""
    check_name(name)
    as_number(mu, f"cost '{name}': mu", least=0.0)


def check_name(name: str) -> None:
    """Raise ProblemError unless the name of a cost is a text."""
    if not (isinstance(name, str) and name):
        raise ProblemError(f"cost: name is {shown(name)}, expected a text")


def weight_matrix(weight: Array, dof: int) -> Array:
    """Return a weight (a number, a diagonal or a matrix) as an (n, n) matrix."""
    return weight if weight.ndim == 2 else np.diag(np.broadcast_to(weight, dof))


def weighted(weight: Array, x: Array) -> Array:
    """Return W x for each row of x (S, n)."""
    return np.asarray(x @ weight if weight.ndim == 2 else x * weight)


def half_square(weight: Array, x: Array) -> Array:
    """Return ½ xᵀWx for each row of x (S, n), (S,)."""
    return np.asarray(0.5 * np.einsum("si,si->s", x, weighted(weight, x)))


@dataclass(frozen=True, eq=False)
class Scaled(Cost):
    """Another cost, G times a factor.

    Parameters
    ----------
    cost : Cost
        The other cost.
    factor : float
        Factor of the cost.
    """

    cost: Cost
    factor: float
    name: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.cost.name)

    @override
    def value(self, samples: Samples) -> Array:
        return self.factor * self.cost.value(samples)

    @override
    def gradient(self, samples: Samples) -> Partials:
        found = self.cost.gradient(samples)
        parts = (found.q, found.qd, found.qdd, found.qddd, found.error)
        return Partials(*(None if part is None else self.factor * part for part in parts))

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        own = self.cost.curvature(dof)
        return {order: self.factor * matrix for order, matrix in own.items()}

    @override
    def check(self, follows: Follows) -> None:
        self.cost.check(follows)
