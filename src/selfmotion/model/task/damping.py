"""The singularity-robust inverse, and how fast the tool is brought back to its path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, as_number


@dataclass(frozen=True)
class Damping:
    """Damp the pseudo-inverse near singular poses: Jᵀ(JJᵀ + λ²I)⁻¹ there, J⁺ elsewhere.

    Bounded joint speeds at the price of the path: where λ > 0 the tool leaves it. λ depends on the
    smallest singular value σ of the task Jacobian [m, rad],

        λ² = λ0² (1 - σ²/σ0²)²  for σ < σ0,  exactly 0 elsewhere,

    so that q̇ is continuously differentiable; the pose feedback fades out as λ²/λ0² grows to 1. It
    is the variable damping of Y. Nakamura and H. Hanafusa (J. Dyn. Sys. Meas. Control 108, 1986)
    with σ for their manipulability, as A. A. Maciejewski and C. A. Klein (J. Robotic Systems 5,
    1988) and S. Chiaverini, B. Siciliano and O. Egeland (IEEE Trans. Control Systems Technology 2,
    1994) have it.

    A damped motion is optimised by the published method, which keeps no constraints but given ends:
    a term "joint limits passed" of the cost keeps joints within limits of position and speed where
    that can be. The certificate judges everything.

    All three parameters are relative to something of the arm's and the path's own, so that one
    default suits arms of any size.

    Parameters
    ----------
    threshold : float
        σ0 as a share of σ at the arm's dexterous configuration
        (`RobotModel.dexterous_configuration`).
    strength : float
        λ0/σ0. At one half, joint speeds stay below 1.3 times those that the same tool speed takes
        at the threshold.
    path_weight : float
        w of the term "path error" ∫ ½ w |e|² dt of the cost, without which the optimisation would
        go singular to reduce joint motion; as a multiple of (K/σ0)², K the rate [1/s] of the pose
        feedback. At 1, an error costs as much as the joint motion that corrects it at the
        threshold.

    Raises
    ------
    ProblemError
        A parameter is not a finite number > 0.
    """

    threshold: float = 0.2
    strength: float = 0.5
    path_weight: float = 1.0

    def __post_init__(self) -> None:
        for name in ("threshold", "strength", "path_weight"):
            value = as_number(getattr(self, name), f"damping: {name}", above=0.0)
            object.__setattr__(self, name, value)

    def law(self, singular_value: float) -> DampingLaw:
        """Return the damping for an arm with this σ [m, rad] at its dexterous configuration."""
        threshold = self.threshold * singular_value
        return DampingLaw(threshold, self.strength * threshold)


@dataclass(frozen=True)
class DampingLaw:
    """λ² as a function of σ; see `Damping`.

    Attributes
    ----------
    threshold : float
        σ0 [m, rad].
    strength : float
        λ0 [m, rad].
    """

    threshold: float
    strength: float

    def __post_init__(self) -> None:
        for name in ("threshold", "strength"):
            as_number(getattr(self, name), f"damping: {name}", above=0.0)

    def factor(self, singular_value: Array) -> Array:
        """Return λ [m, rad] for smallest singular values σ [m, rad] of any shape."""
        rest = 1.0 - np.square(singular_value / self.threshold)
        return self.strength * np.maximum(rest, 0.0)


# Rate K of the pose feedback, which reduces an error e by K e, times the motion's duration.
_FEEDBACK = 20.0


def feedback_rate(duration: float) -> float:
    """Return the rate K [1/s] of the pose feedback in a motion of that duration [s]."""
    return _FEEDBACK / duration
