"""Costs of the distance from singular poses; eq. numbers are those of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_numbers, as_whole, read_only, shown
from selfmotion.model.follow import Follows, row_names
from selfmotion.problem.costs.base import Cost, Partials, check_mu
from selfmotion.problem.costs.samples import Samples


@dataclass(frozen=True)
class InverseManipulability(Cost):
    """Distance from singular poses, as used by the paper: G = μ / det(JJᵀ), eq. 12.

    J is the task Jacobian; the unit is that of 1/det(JJᵀ), so μ weighs metres against radians.

    Parameters
    ----------
    mu : float
        μ ≥ 0.
    """

    is_pointwise: ClassVar[bool] = True

    mu: float = 1.0
    name: str = "inverse manipulability"

    @override
    def value(self, samples: Samples) -> Array:
        # Infinite at singular poses, through which damped motions may pass.
        with np.errstate(divide="ignore"):
            return np.asarray(self.mu / samples.gram_determinant)

    @override
    def gradient(self, samples: Samples) -> Partials:
        """∂G = -G ∂log det(JJᵀ)."""
        return Partials(q=-self.value(samples)[:, None] * samples.log_determinant_gradient)

    @override
    def check(self, follows: Follows) -> None:
        check_mu(self.mu, self.name)


@dataclass(frozen=True)
class Manipulability(Cost):
    """Yoshikawa's manipulability, to be large: G = -μ w with w = √det(JJᵀ), eq. 9 to 11.

    Without a velocity term the optimum does not exist: coefficients grow without bound.

    Parameters
    ----------
    mu : float
        μ ≥ 0.
    """

    is_pointwise: ClassVar[bool] = True

    mu: float = 1.0
    name: str = "manipulability"

    @override
    def value(self, samples: Samples) -> Array:
        return -self.mu * np.sqrt(np.maximum(samples.gram_determinant, 0.0))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """∂w = ½ w ∂log det(JJᵀ)."""
        return Partials(q=0.5 * self.value(samples)[:, None] * samples.log_determinant_gradient)

    @override
    def check(self, follows: Follows) -> None:
        check_mu(self.mu, self.name)


@dataclass(frozen=True, eq=False)
class DirectionalManipulability(Cost):
    """Ease of motion along one direction: G = μ uᵀ(JJᵀ)⁻¹u.

    (uᵀ(JJᵀ)⁻¹u)^-½ is the velocity transmission ratio, the length of the manipulability ellipsoid
    along u (S. L. Chiu, "Task compatibility of manipulator postures", IJRR 7(5), 1988).

    Parameters
    ----------
    direction : (m,)
        u, in the task's rows; its length does not matter.
    mu : float
        μ ≥ 0.
    """

    is_pointwise: ClassVar[bool] = True

    direction: npt.ArrayLike
    mu: float = 1.0
    name: str = "directional manipulability"

    def __post_init__(self) -> None:
        what, expected = f"cost '{self.name}': direction", "a vector of length > 0"
        direction = as_numbers(self.direction, what, expected)
        length = float(np.linalg.norm(direction))
        if direction.ndim != 1 or not (np.isfinite(length) and length > 0.0):
            raise ProblemError(f"{what} is {shown(direction)}, expected {expected}")
        object.__setattr__(self, "direction", read_only(direction / length))

    @override
    def value(self, samples: Samples) -> Array:
        return np.asarray(self.mu * (self._solved(samples) @ np.asarray(self.direction)))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """∂G = -2μ ⟨a (Jᵀa)ᵀ, ∂J⟩ with a = (JJᵀ)⁻¹u."""
        a = self._solved(samples)
        back = np.einsum("sm,smn->sn", a, samples.task_jacobian)
        return Partials(q=samples.contract(-2.0 * self.mu * a[:, :, None] * back[:, None, :]))

    @override
    def check(self, follows: Follows) -> None:
        check_mu(self.mu, self.name)
        rows = follows.dimension
        if len(np.asarray(self.direction)) != rows:
            raise ProblemError(
                f"cost '{self.name}': direction has {len(np.asarray(self.direction))} entries, "
                f"expected one per prescribed row ({rows}: {', '.join(row_names(follows))})"
            )

    def _solved(self, samples: Samples) -> Array:
        direction = np.asarray(self.direction)
        stacked = np.broadcast_to(direction[:, None], (len(samples.t), len(direction), 1))
        return np.asarray(np.linalg.solve(samples.gram, stacked)[:, :, 0])


@dataclass(frozen=True)
class SmallestSingularValue(Cost):
    """Distance from the nearest singular pose: G = μ (Σ σ_i^-2p)^(1/2p), about μ / σ_min.

    The p-norm is smooth where singular values meet, unlike σ_min itself; it is above 1/σ_min by at
    most the factor m^(1/2p).

    Parameters
    ----------
    mu : float
        μ ≥ 0.
    power : int
        p ≥ 1; larger is nearer to 1/σ_min.
    """

    is_pointwise: ClassVar[bool] = True

    mu: float = 1.0
    power: int = 4
    name: str = "smallest singular value"

    @override
    def value(self, samples: Samples) -> Array:
        values = np.asarray(np.linalg.eigvalsh(samples.gram), dtype=np.float64)
        return np.asarray(self.mu * self._sum(values) ** (0.5 / self.power))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """∂ Σλ^-p = -2p ⟨(JJᵀ)^(-p-1) J, ∂J⟩ for the eigenvalues λ = σ²."""
        values, vectors = np.linalg.eigh(samples.gram)
        scale = self.mu * self._sum(values) ** (0.5 / self.power - 1.0)
        powers = np.maximum(values, np.finfo(float).tiny) ** (-self.power - 1.0)
        inverse = (vectors * powers[:, None, :]) @ vectors.transpose(0, 2, 1)
        weights = -scale[:, None, None] * (inverse @ samples.task_jacobian)
        return Partials(q=samples.contract(weights))

    @override
    def check(self, follows: Follows) -> None:
        check_mu(self.mu, self.name)
        as_whole(self.power, f"cost '{self.name}': power", 1, 100)

    def _sum(self, values: Array) -> Array:
        return np.asarray(
            np.sum(np.maximum(values, np.finfo(float).tiny) ** -float(self.power), axis=1)
        )
