"""How far a motion keeps what is asked of it, in words and as one number."""

from collections.abc import Sequence

import numpy as np

from selfmotion.constraints.conditions import BoundConstraint
from selfmotion.costs import Samples

# A constraint whose violation, squared and integrated, is above this counts as much as ten times
# the cost.
_NOTICED = 2e-3


def violated(constraints: Sequence[BoundConstraint], samples: Samples) -> tuple[str, ...]:
    """Return a message for each constraint that is not kept, on its worst place."""
    messages = []
    for item in constraints:
        h = item.residual(samples)
        size = np.abs(h) if item.equality else h
        # Written so that NaN counts as violated.
        if not np.max(size, initial=-np.inf) <= item.tolerance:
            row, column = np.unravel_index(int(np.argmax(size)), h.shape)
            text = item.describe(samples, int(row), int(column))
            messages.append(f"{item.name}: {text}")
    return tuple(messages)


def penalised(cost: float, constraints: Sequence[BoundConstraint], samples: Samples) -> float:
    """Return a cost, much larger where constraints are violated: for ranking motions."""
    return cost + max(abs(cost), 1e-3) * penalty(constraints, samples)


def penalty(constraints: Sequence[BoundConstraint], samples: Samples) -> float:
    """Return up to 10 for each constraint that is violated, 0 where all are kept."""
    steps, total = np.diff(samples.sampling.node_times), 0.0
    shares = 0.5 * (np.append(steps, 0.0) + np.append(0.0, steps))
    for item in constraints:
        h = item.residual(samples)
        bad = np.abs(h) if item.equality else np.maximum(h, 0.0)
        weights = np.ones(1) if len(h) == 1 else shares
        total += 10.0 * min(1.0, float(np.sum(weights[:, None] * bad**2)) / _NOTICED)
    return total
