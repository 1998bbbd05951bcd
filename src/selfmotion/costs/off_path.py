"""The price of leaving the path, for motions that damping takes off it."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs.base import ERROR, Cost, Partials
from selfmotion.costs.samples import Samples


@dataclass(frozen=True)
class OffPath(Cost):
    """Distance of the tool from the path: G = ½ w |S e|², e the pose error [m, rad].

    S selects the task's rows. On the path it is 0 and has no gradient. A damped problem has this
    cost besides its own, see `Damping`.

    Parameters
    ----------
    weight : float
        w, such that G has the unit of the other costs.
    rows : int
        Number m of the task's rows.
    """

    weight: float
    rows: int
    name: str = "path error"

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return np.asarray(0.5 * self.weight * np.sum(_selected(samples) ** 2, axis=1))

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`: ∂G/∂e = w SᵀS e."""
        return Partials(error=self.weight * _selected(samples))

    def curvature(self, dof: int) -> dict[int, Array]:
        """See `Cost.curvature`: w I on S e."""
        return {ERROR: self.weight * np.eye(self.rows)}


def _selected(samples: Samples) -> Array:
    """Return the pose errors with 0 in the rows that are free, (S, 6 F) [m, rad].

    Its length is that of S e also for `Task.POINTING`, whose error has no part about the tool's
    axis.
    """
    tasks = [item.task for item in samples.follows.items]
    counts = [
        np.isin(np.arange(6), task.rows) | (task.tool_axes & (np.arange(6) >= 3)) for task in tasks
    ]
    return np.where(np.concatenate(counts), samples.error, 0.0)
