"""Motions that follow a path with limits and quantities of q as rows of the task, in any metric.

Without self-motion an arm violates other conditions, and a motion that has violated one far is no
initial guess for Newton's method: a torch that leans does not become upright by small steps, if a
table has to turn once round for that. Here a condition about to be violated is a row of the task
while it binds,

    q̇ = W⁻¹Aᵀ(A W⁻¹Aᵀ)⁻¹ [ẋ; ḣ],   A = [J; ∂h/∂q of binding conditions],

with a metric W by which some joints are heavy: of all distributions of a motion among the parts of
a cell, the one in which these move least.
"""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.certificate import Quantity
from selfmotion.model.follow import Coordinates, Follows
from selfmotion.planning.search.manifold import Manifold, carry

# Share of its limit from which on a row binds …
_SHARE = 0.9
# … and the distance from that which counts as satisfied.
_MET = 0.02
# Corrections after a step along the path …
_NEAR_ROUNDS = 4
# … and from any configuration …
_FAR_ROUNDS = 40
# … with this largest change [rad or m].
_FARTHEST = 0.3
# Damping as a share of the metric's trace: dependent rows do not stop a motion.
_DAMPED = 1e-9
# Factor of the weight of a heavy joint.
_HEAVY = 100.0
# Range of a joint [rad] from which on it can be wound back by whole turns: no limit binds it.
_WHOLE_TURN = 2.0 * np.pi


class Stacked:
    """The rows of a task, and further conditions on configurations as rows.

    Parameters
    ----------
    follows : Follows
    quantities : sequence of Quantity
        Of q alone.
    lower, upper : (n,)
        Joint limits [rad or m].
    weights : (n,)
        How heavy each joint is.
    """

    def __init__(
        self,
        follows: Follows,
        quantities: Sequence[Quantity],
        lower: Array,
        upper: Array,
        weights: Array,
    ) -> None:
        free = np.full(follows.dof, np.inf)
        self._follows, self._quantities = follows, quantities
        self._manifold, self._light = Manifold(follows, -free, free), 1.0 / weights
        turns = follows.coordinates.is_revolute & (upper - lower >= _WHOLE_TURN)
        self._lower, self._upper = np.where(turns, -np.inf, lower), np.where(turns, np.inf, upper)

    def placed(self, q: Array, time: float) -> tuple[Array, Flags]:
        """Return configurations (K, n) on the path at a time [s] that keep everything, and which.

        Each is brought there from where it is.
        """
        t = np.array([time])
        target, held = self._follows.targets(t)[0], self._follows.held(t)[0]
        return self._satisfied(q, target, held, _FAR_ROUNDS)

    def carried(self, starts: Array, t: Array, at: int = 0) -> tuple[Array, Flags]:
        """Return the motions through configurations (K, n), (K, N, n), and which are complete.

        From the one of the times t (N,) [s] of number `at` to both ends.
        """
        follows = self._follows
        targets, helds = follows.targets(t), follows.held(t)

        def follow(q: Array, before: int, k: int) -> tuple[Array, Flags]:
            twist = follows.twists(np.array([0.5 * (t[k] + t[before])]))[0]
            ahead = q + self._step(q, (t[k] - t[before]) * twist)
            return self._satisfied(ahead, targets[k], helds[k], _NEAR_ROUNDS)

        return carry(starts, len(t), at, follow)

    def _satisfied(self, q: Array, target: Array, held: Flags, rounds: int) -> tuple[Array, Flags]:
        """Return configurations near others that are on the path and keep everything, and which."""
        q, on_path = self._manifold.project(q, target, far=rounds == _FAR_ROUNDS, held=held)
        zero = np.zeros(self._follows.dimension)
        for _ in range(rounds):
            broken = self._rows(q)[1].max(axis=1, initial=-np.inf) > _MET
            which = np.flatnonzero(broken & on_path)
            if not which.size:
                break
            step = self._step(q[which], zero)
            size = np.abs(step).max(axis=1, keepdims=True)
            moved = q[which] + step * (_FARTHEST / np.maximum(size, _FARTHEST))
            q[which], on_path[which] = self._manifold.project(moved, target, held=held)
        kept = self._rows(q)[1].max(axis=1, initial=-np.inf) <= _MET
        return q, on_path & kept

    def _step(self, q: Array, along: Array) -> Array:
        """Return the step (K, n) of the task's rows `along` (m,) that takes back rows that bind."""
        rows, beyond = self._rows(q)
        binds = beyond > 0.0
        stacked = np.concatenate(
            [self._follows.jacobians(q), np.where(binds[:, :, None], rows, 0.0)], axis=1
        )
        wanted = np.concatenate(
            [np.broadcast_to(along, (len(q), len(along))), np.where(binds, -beyond, 0.0)], axis=1
        )
        light = stacked * self._light
        gram = light @ stacked.transpose(0, 2, 1)
        count = gram.shape[1]
        # A row that does not bind is decoupled, with right side 0.
        gram[:, range(count), range(count)] += _DAMPED * self._light.sum()
        found = np.linalg.solve(gram, wanted[:, :, None])
        return np.asarray((light.transpose(0, 2, 1) @ found)[:, :, 0])

    def _rows(self, q: Array) -> tuple[Array, Array]:
        """Return rows (K, R, n) of all that may bind, and by how much each does, (K, R).

        In shares of the limits.
        """
        count, n = q.shape
        zero, slopes, beyond = np.zeros_like(q), [], []
        for item in self._quantities:
            some = item.limited
            limits = item.bounds[some]
            away = item.away(q, zero, zero)[:, some]
            by = item.derivatives(q, zero, zero)[0][:, some]
            if away.ndim == 3:
                sizes = np.linalg.norm(away, axis=2)
                units = away / np.maximum(sizes, np.finfo(float).tiny)[:, :, None]
                by = np.einsum("kmc,kmcn->kmn", units, by)
            else:
                sizes, by = np.abs(away), np.sign(away)[:, :, None] * by
            slopes.append(by / limits[:, None])
            beyond.append(sizes / limits - _SHARE)
        eye = np.broadcast_to(np.eye(n), (count, n, n))
        for side, limit in ((1.0, self._upper), (-1.0, self._lower)):
            limited = np.flatnonzero(np.isfinite(limit))
            slopes.append(side * eye[:, limited])
            beyond.append(side * (q - limit)[:, limited])
        return np.concatenate(slopes, axis=1), np.concatenate(beyond, axis=1)


def metrics(coordinates: Coordinates) -> list[Array]:
    """Return weights of the joints (n,): the usual ones first, then each part heavy in turn.

    Parts are those of a cell, and joints that slide where others turn; of a part of few joints each
    joint is heavy by itself as well. One for an arm that has no parts.
    """
    usual = np.asarray(coordinates.weights) ** 2
    groups = _groups(coordinates)
    if len(groups) < 2:
        return [usual]
    largest = max(groups, key=lambda group: int(group.sum()))
    alone = [
        np.arange(coordinates.dof) == joint
        for group in groups
        if group is not largest and group.sum() > 1
        for joint in np.flatnonzero(group)
    ]
    return [usual, *(np.where(heavy, _HEAVY, 1.0) * usual for heavy in [*groups, *alone])]


def _groups(coordinates: Coordinates) -> list[Flags]:
    """Return the joints of each part of a cell, (n,) each; or those that slide, and that turn."""
    names = coordinates.names
    prefixes = [f"{part.name}/" for part in coordinates.robot.urdf.parts]
    found = [np.array([name.startswith(prefix) for name in names]) for prefix in prefixes]
    if len(found) < 2:
        slides = np.array([coordinates.unit(k) == "m" for k in range(len(names))])
        found = [~slides, slides]
    return [group for group in found if group.any()]
