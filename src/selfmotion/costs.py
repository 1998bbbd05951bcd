"""Integrands G(q̇, q, t) of the cost F = ∫ G dt; eq. numbers are those of the paper."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from selfmotion.arrays import Array, read_only
from selfmotion.errors import ProblemError
from selfmotion.samples import Samples


@dataclass(frozen=True, eq=False)
class Partials:
    """Derivatives of an integrand at S samples; None stands for zero.

    Attributes
    ----------
    q, qd : (S, n) or None
        ∂G/∂q and ∂G/∂q̇.
    """

    q: Array | None = None
    qd: Array | None = None


class Cost(Protocol):
    """An integrand. It sees samples, never coefficients."""

    @property
    def name(self) -> str:
        """What to call the cost in reports."""

    def value(self, samples: Samples) -> Array:
        """Return G at the samples, (S,)."""

    def gradient(self, samples: Samples) -> Partials:
        """Return ∂G/∂q and ∂G/∂q̇ at the samples."""

    def check(self, dof: int) -> None:
        """Raise ProblemError where the cost does not fit an arm of `dof` joints."""


@dataclass(frozen=True, eq=False)
class JointVelocity:
    """Joint speed: G = ½ q̇ᵀWq̇ [rad²/s²], the first term of eq. 11 and 12.

    Parameters
    ----------
    weight : float, (n,) or (n, n)
        W: a multiple of the identity, a diagonal, or a symmetric positive semidefinite matrix.
    """

    weight: float | npt.ArrayLike = 1.0
    name: str = "joint velocity"

    def __post_init__(self) -> None:
        object.__setattr__(self, "weight", _weight(self.weight, self.name))

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return np.asarray(0.5 * np.einsum("si,si->s", samples.qd, self._times(samples.qd)))

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`."""
        return Partials(qd=self._times(samples.qd))

    def check(self, dof: int) -> None:
        """See `Cost.check`."""
        _check_weight(np.asarray(self.weight), dof, self.name)

    def matrix(self, dof: int) -> Array:
        """Return W as an (n, n) matrix."""
        weight = np.asarray(self.weight)
        return weight if weight.ndim == 2 else np.diag(np.broadcast_to(weight, dof))

    def _times(self, qd: Array) -> Array:
        weight = np.asarray(self.weight)
        return np.asarray(qd @ weight if weight.ndim == 2 else qd * weight)


@dataclass(frozen=True)
class InverseManipulability:
    """Distance from singular poses, as used by the paper: G = μ / det(JJᵀ), eq. 12.

    J is the task Jacobian; the unit is that of 1/det(JJᵀ), so μ weighs metres against radians.

    Parameters
    ----------
    mu : float
        μ ≥ 0.
    """

    mu: float = 1.0
    name: str = "inverse manipulability"

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return self.mu / samples.gram_determinant

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`: ∂G = -G ∂log det(JJᵀ)."""
        return Partials(q=-self.value(samples)[:, None] * samples.log_determinant_gradient)

    def check(self, dof: int) -> None:
        """See `Cost.check`."""
        _check_mu(self.mu, self.name)


@dataclass(frozen=True)
class Manipulability:
    """Yoshikawa's manipulability, to be large: G = -μ w with w = √det(JJᵀ), eq. 9 to 11.

    Without a velocity term the optimum does not exist: coefficients grow without bound.

    Parameters
    ----------
    mu : float
        μ ≥ 0.
    """

    mu: float = 1.0
    name: str = "manipulability"

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return -self.mu * np.sqrt(np.maximum(samples.gram_determinant, 0.0))

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`: ∂w = ½ w ∂log det(JJᵀ)."""
        return Partials(q=0.5 * self.value(samples)[:, None] * samples.log_determinant_gradient)

    def check(self, dof: int) -> None:
        """See `Cost.check`."""
        _check_mu(self.mu, self.name)


Integrand = Callable[[Array, Array, Array], npt.ArrayLike]
IntegrandGradient = Callable[[Array, Array, Array], tuple[npt.ArrayLike, npt.ArrayLike]]


@dataclass(frozen=True)
class FunctionCost:
    """Any integrand G(q̇, q, t), the paper's general form.

    Parameters
    ----------
    g : callable
        ``g(qd, q, t)`` with qd, q (S, n) and t (S,) → (S,), vectorised over samples.
    g_gradient : callable, optional
        ``g_gradient(qd, q, t)`` → (∂G/∂q̇, ∂G/∂q), each (S, n). Without it both are taken by
        central differences, 4n calls of `g`.
    """

    g: Integrand
    g_gradient: IntegrandGradient | None = None
    name: str = "function"

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return self._call(samples.qd, samples.q, samples.t)

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`."""
        qd, q, t = samples.qd, samples.q, samples.t
        if self.g_gradient is not None:
            by_qd, by_q = (np.asarray(part, dtype=float) for part in self.g_gradient(qd, q, t))
            for part in (by_qd, by_q):
                if part.shape != q.shape:
                    raise ProblemError(
                        f"cost '{self.name}': its gradient has shape {part.shape}, "
                        f"expected {q.shape} for both ∂G/∂q̇ and ∂G/∂q"
                    )
            return Partials(q=by_q, qd=by_qd)
        return Partials(
            q=self._difference(q, lambda shifted: self._call(qd, shifted, t)),
            qd=self._difference(qd, lambda shifted: self._call(shifted, q, t)),
        )

    def check(self, dof: int) -> None:
        """See `Cost.check`."""

    def _call(self, qd: Array, q: Array, t: Array) -> Array:
        value = np.asarray(self.g(qd, q, t), dtype=np.float64)
        if value.shape != t.shape:
            raise ProblemError(
                f"cost '{self.name}' returned shape {value.shape} for {len(t)} samples, "
                f"expected {t.shape}"
            )
        return value

    @staticmethod
    def _difference(x: Array, function: Callable[[Array], Array]) -> Array:
        gradient = np.empty_like(x)
        for i in range(x.shape[1]):
            # The cube root of the rounding error balances it against the truncation error.
            step = np.cbrt(np.finfo(float).eps) * np.maximum(1.0, np.abs(x[:, i]))
            above, below = x.copy(), x.copy()
            above[:, i] += step
            below[:, i] -= step
            gradient[:, i] = (function(above) - function(below)) / (above[:, i] - below[:, i])
        return gradient


def _weight(weight: float | npt.ArrayLike, name: str) -> Array:
    array = read_only(weight)
    if not np.all(np.isfinite(array)) or array.ndim > 2:
        raise ProblemError(f"cost '{name}': weight is {array}, expected finite numbers")
    symmetric = array.ndim < 2 or (
        array.shape[0] == array.shape[1] and np.allclose(array, array.T, atol=1e-12)
    )
    if not symmetric:
        raise ProblemError(f"cost '{name}': weight is not a symmetric matrix")
    smallest = np.linalg.eigvalsh(array)[0] if array.ndim == 2 else array.min()
    if smallest < -1e-12:
        raise ProblemError(f"cost '{name}': weight has the negative value {smallest}")
    return array


def _check_weight(weight: Array, dof: int, name: str) -> None:
    if weight.ndim and weight.shape[0] != dof:
        raise ProblemError(
            f"cost '{name}': weight has shape {weight.shape}, expected one entry per joint ({dof})"
        )


def _check_mu(mu: float, name: str) -> None:
    if not (np.isfinite(mu) and mu >= 0.0):
        raise ProblemError(f"cost '{name}': mu is {mu}, expected a finite number ≥ 0")
