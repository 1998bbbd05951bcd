"""Many motions at once: rough optima of all, by Newton's method on the nodes of all.

The motions are independent: they are put one after the other, with gaps between them, into one
motion of many nodes, so that compiled kernels and array operations handle all of them in one pass.
Each has its own step length. Constraints are left out: an optimum that satisfies them all the same
is the best near it; the cost of one that does not is a lower bound of the constrained optimum's.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.planning.nodes.charts import Centred, Charts, Place
from selfmotion.planning.nodes.local_model import LocalModel
from selfmotion.planning.nodes.motion import NodeGrid, NodeMotion, slopes_of, stepped
from selfmotion.planning.nodes.node_matrix import NodeMatrix
from selfmotion.planning.nodes.settings import SETTINGS

# A motion is finished when a step predicts less than this share of its cost.
_ENOUGH = 1e-3
# Shares of Newton's step that are tried in turn.
_SHARES = (1.0, 0.25, 0.0625)
# Added to the diagonal, as a share of its median entry.
_FLAT = 1e-11
# Inertia correction: its first value, as a share of the largest entry.
_DELTA_FIRST = 1e-6
# Fields of `Place`.
_PLACE = ("q", "qd", "qdd", "tangents", "table")
_LEAVES = "a motion that cannot be evaluated is to leave the others valid"


@dataclass(frozen=True, eq=False)
class Batch:
    """Motions on the same nodes, side by side.

    Attributes
    ----------
    motion : NodeMotion
        All motions, one after the other.
    costs : (K,)
        F of each; inf where the motion could not be evaluated.
    going : (K,)
        Whether Newton's method goes on.
    promised : (K,)
        Twice the decrease that the last step predicted; inf before the first.
    """

    motion: NodeMotion
    costs: Array
    going: Flags
    promised: Array

    @classmethod
    def near(cls, grid: NodeGrid, motions: Array) -> "Batch":
        """Return motions without self-motion whose nodes are those nearest to q (K, N + 1, n)."""
        many, q = grid.copied(len(motions)), motions.reshape(-1, motions.shape[2])
        started = many.manifolds.near(q, np.zeros_like(q), np.zeros_like(q))
        if started is None:
            raise RuntimeError(_LEAVES)
        count = len(motions)
        return cls._of(many.at(started), np.ones(count, dtype=np.bool_), np.full(count, np.inf))

    @classmethod
    def _of(cls, motion: NodeMotion, going: Flags, promised: Array) -> "Batch":
        """Return the motions of nodes, with costs of those that go on evaluated."""
        grid, count = motion.grid, len(going)
        # This also checks the deadline.
        grid.counts.evaluated()
        grid.counts.evaluations += int(going.sum()) - 1
        each = motion.quadratic.costs
        if not grid.cost.is_quadratic:
            each = each + grid.cost.bent(motion.sampled)
        costs = np.append(each, 0.0)
        costs = costs.reshape(count, -1).sum(axis=1)
        return cls(motion, np.where(np.isfinite(costs), costs, np.inf), going, promised)

    @property
    def count(self) -> int:
        """K."""
        return len(self.going)

    @property
    def q(self) -> Array:
        """The motions at their nodes, (K, N + 1, n)."""
        return _each(self, self.motion.place.q)

    @property
    def qd(self) -> Array:
        """Joint velocities at the nodes, (K, N + 1, n)."""
        return _each(self, self.motion.place.qd)

    @property
    def qdd(self) -> Array:
        """Joint accelerations at the nodes, (K, N + 1, n)."""
        return _each(self, self.motion.place.qdd)

    def picked(self, which: Ints) -> "Batch":
        """Return a subset of the motions."""
        motion, whole = self.motion, self.motion.place
        grid = motion.grid.copied(len(which))
        rows = self._rows(which)
        charts = Charts(grid.manifolds, motion.charts.q[rows], motion.charts.bases[rows])
        place = Place(*(np.ascontiguousarray(getattr(whole, name)[rows]) for name in _PLACE))
        some = grid.at(Centred(charts, motion.nu[rows], motion.alpha[rows], place))
        return Batch(some, self.costs[which], self.going[which], self.promised[which])

    def advanced(self) -> "Batch":
        """Return the motions after one Newton step of each that goes on."""
        which = np.flatnonzero(self.going)
        if len(which) == self.count:
            return self._stepped()
        return self._with(which, self.picked(which)._stepped()) if len(which) else self

    def _with(self, which: Ints, others: "Batch") -> "Batch":
        """Return the motions with some replaced by others."""
        mine, own = self.motion, others.motion
        rows = self._rows(which)

        def joined(before: Any, after: Any, where: Ints = rows) -> Any:
            found = before.copy()
            found[where] = after
            return found

        charts = Charts(
            mine.grid.manifolds,
            joined(mine.charts.q, own.charts.q),
            joined(mine.charts.bases, own.charts.bases),
        )
        place = Place(
            *(joined(getattr(mine.place, name), getattr(own.place, name)) for name in _PLACE)
        )
        nu, alpha = joined(mine.nu, own.nu), joined(mine.alpha, own.alpha)
        return Batch(
            mine.grid.at(Centred(charts, nu, alpha, place)),
            joined(self.costs, others.costs, which),
            joined(self.going, others.going, which),
            joined(self.promised, others.promised, which),
        )

    def _rows(self, which: Ints) -> Ints:
        """Return the numbers of the nodes of some motions."""
        size = len(self.motion.nu) // self.count
        return np.asarray((which[:, None] * size + np.arange(size)).ravel())

    def _stepped(self) -> "Batch":
        motion, grid = self.motion, self.motion.grid
        grid.counts.gradients += self.count
        # A gap's slopes may be NaN.
        spline = grid.spline
        slopes = slopes_of(motion).copy()
        slopes[spline.gaps] = 0.0
        force = spline.scatter(slopes)
        around = LocalModel.of(
            motion.charts, motion.nu, motion.alpha, motion.place, force, grid.scale
        )
        if around is None:
            raise RuntimeError(_LEAVES)
        by = spline.changes(around.changes)
        gradient = by.pulled(slopes)
        gradient.reshape(-1)[grid.held] = 0.0
        curvature = NodeMatrix.zeros(*gradient.shape)
        grid.cost.add_curvature(curvature, by, motion.sampled, motion.partials)
        matrix = curvature.banded()
        matrix.add(0, 0, around.curvature)
        matrix.hold(grid.held)
        step, rights = np.zeros((self.count, gradient.size // self.count)), -gradient
        rights = rights.reshape(step.shape)
        sound = self.going & np.isfinite(rights).all(axis=1)
        for k in np.flatnonzero(sound).tolist():
            solved = matrix.part_solved(
                k, self.count, rights[k], (_FLAT, _DELTA_FIRST, SETTINGS.kappa_plus)
            )
            if solved is None:
                sound[k] = False
            else:
                step[k] = solved
        promised = np.where(sound, (rights * step).sum(axis=1), np.inf)
        going = sound & (promised > _ENOUGH * np.abs(self.costs))
        if not going.any():
            return Batch(self.motion, self.costs, going, promised)
        return self._moved(step, promised, going)

    def _moved(self, step: Array, promised: Array, going: Flags) -> "Batch":
        """Line search: move each motion along its step until the cost falls as predicted."""
        motion, r, due = self.motion, self.motion.nu.shape[1], np.where(going, promised, 0.0)
        by_node = step.reshape(self.count, -1, 3, r)
        farthest = np.abs(by_node[:, :, 0]).max(axis=(1, 2))
        allowed = SETTINGS.max_change
        most = np.where(going, allowed / np.maximum(farthest, allowed), 0.0)
        left, length = going.copy(), most.copy()
        for share in (*_SHARES, 0.0):
            length[left] = share * most[left]
            found = stepped(motion, (length[:, None, None, None] * by_node).reshape(-1, 3 * r))
            if found is None:
                raise RuntimeError(_LEAVES)
            new = Batch._of(found, going & (length > 0.0), promised)
            left[left] = ~(new.costs <= self.costs - SETTINGS.armijo * length * due)[left]
            if not left.any():
                break
        return new


def _each(batch: Batch, table: Array) -> Array:
    return table.reshape(batch.count, -1, table.shape[1])
