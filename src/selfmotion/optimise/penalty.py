"""The exact penalty function that steps of sequential quadratic programming are judged by."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.optimise.base import Residuals
from selfmotion.optimise.step import Step

# Violations up to this share of the tolerance do not count in judging a step: the curvature of
# conditions that bind would otherwise shorten every step along them.
IGNORED = 0.85
# The penalty is raised until this share of the violation that a step takes out counts as progress,
# and to this many times the sum of the multipliers.
_STEERING, _PRICES = 0.3, 1.2


@dataclass(frozen=True, eq=False)
class Point:
    """Where F and h are known."""

    x: Array
    cost: float
    at: Residuals

    @property
    def kept(self) -> bool:
        """Whether all conditions are kept."""
        return self.at.worst <= 1.0

    @property
    def excess(self) -> float:
        """The violation that counts."""
        return max(self.at.worst - IGNORED, 0.0)

    def better(self, other: "Point") -> bool:
        """Whether it would be the one to show."""
        if self.kept and other.kept:
            return self.cost < other.cost
        return self.at.worst < other.at.worst


class ExactPenalty:
    """F + π max(0, h₁/tolerance₁, …), with |h| for h of equalities.

    Attributes
    ----------
    weight : float
        π; it only grows.
    """

    def __init__(self) -> None:
        self.weight = 0.0

    def raise_for(self, here: Point, step: Step) -> None:
        """Raise π until the step's share in taking out the violation outweighs what it costs.

        And above the multipliers' sum, where the function is exact.
        """
        needed = [self.weight]
        fall = here.excess - _left(step)
        if fall > 0.0:
            needed.append(-step.gain / ((1.0 - _STEERING) * fall))
        if not step.relaxed:
            prices = np.abs(step.multipliers) * here.at.tolerance
            needed.append(_PRICES * float(prices.sum()))
        self.weight = max(needed)

    def share(self, here: Point, there: Point | None, step: Step) -> float:
        """Return the fall from here to there as a share of the one that the model expects."""
        expected = step.gain + self.weight * (here.excess - _left(step))
        if there is None or not expected > 0.0:
            return -np.inf
        actual = here.cost - there.cost + self.weight * (here.excess - there.excess)
        return float(actual / expected)


def _left(step: Step) -> float:
    return max(step.worst - IGNORED, 0.0)
