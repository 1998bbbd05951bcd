"""The constraints of a problem as one list of numbers: h ≤ 0 or h = 0, and its derivatives."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.constraints import BoundConstraint, NodeTangents
from selfmotion.costs import Samples
from selfmotion.motion import Grid
from selfmotion.optimise import Residuals

# A constraint whose violation, squared and integrated, is above this counts as much as ten times
# the cost.
_NOTICED = 2e-3


class Conditions:
    """All conditions of some constraints at the nodes of a grid, in one order.

    Parameters
    ----------
    constraints : sequence of BoundConstraint
    grid : Grid
    """

    def __init__(self, constraints: Sequence[BoundConstraint], grid: Grid) -> None:
        self.constraints = tuple(constraints)
        steps = np.diff(grid.nodes)
        self._shares = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))

    def on(self, grid: Grid) -> "Conditions":
        """Return the same on another grid."""
        return Conditions(self.constraints, grid)

    def residuals(self, samples: Samples) -> Residuals:
        """Return h of all conditions, with their tolerances."""
        tables = [item.residual(samples).ravel() for item in self.constraints]
        pairs = list(zip(self.constraints, tables, strict=True))
        none = np.zeros(0)
        return Residuals(
            np.concatenate([none, *tables]),
            np.concatenate([none, *(np.full(len(h), item.tolerance) for item, h in pairs)]),
            np.concatenate([none, *(np.full(len(h), item.equality) for item, h in pairs)]) > 0.0,
        )

    def rows(self, samples: Samples, motion: NodeTangents) -> Array:
        """Return the derivatives of all conditions, (C, d)."""
        size = motion.q.shape[2]
        rows = [item.tangents(samples, motion).reshape(-1, size) for item in self.constraints]
        return np.vstack([np.zeros((0, size)), *rows])

    @property
    def has_equalities(self) -> bool:
        """Whether a constraint is an equality."""
        return any(item.equality for item in self.constraints)

    def penalty(self, samples: Samples) -> float:
        """Return about 10 for each constraint that is violated, 0 where all are kept."""
        total = 0.0
        for item in self.constraints:
            h = item.residual(samples)
            bad = np.abs(h) if item.equality else np.maximum(h, 0.0)
            shares = np.ones(1) if len(h) == 1 else self._shares
            total += 10.0 * min(1.0, float(np.sum(shares[:, None] * bad**2)) / _NOTICED)
        return total

    def violated(self, samples: Samples) -> tuple[str, ...]:
        """Return a message for each constraint that is not kept, on its worst place."""
        messages = []
        for item in self.constraints:
            h = item.residual(samples)
            size = np.abs(h) if item.equality else h
            # Written so that NaN counts as violated.
            if not np.max(size, initial=-np.inf) <= item.tolerance:
                row, column = np.unravel_index(int(np.argmax(size)), h.shape)
                text = item.describe(samples, int(row), int(column))
                messages.append(f"{item.name}: {text}")
        return tuple(messages)
