"""Many motions at once: rough optima of all, by Newton's method on the nodes of all.

The motions know nothing of each other: one after the other, with gaps between them, they are one
motion of many nodes, so that what is compiled and what is an array sees all of them in one pass.
Each takes steps of its own. What conditions forbid is weighed instead of forbidden: a rough optimum
tells which start is worth more, and no more than that.
"""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.nodes.charts import Charts, Place
from selfmotion.nodes.motion import NodeGrid, NodeMotion
from selfmotion.nodes.objective import Around, scattered
from selfmotion.optimise import Banded

# A motion is left alone when a step promises less than this share of what it costs.
_ENOUGH = 1e-3
# What breaks conditions weighs this many times the cost, for each unit of ∫ h² dt [s]; in a ranking
# no more than this for each of them.
_HEAVY, _MOST = 5e3, 10.0
# Shares of Newton's step that are tried, what each has to do of what it promises, and how far nodes
# go in one [rad or m].
_SHARES, _DONE, _FARTHEST = (1.0, 0.25, 0.0625), 1e-4, 0.5
# More of a matrix's diagonal, as in `newton`: this share of its usual entry; where it is not
# positive definite this one of its largest entry, and so many times more.
_FLAT, _SHIFT, _MORE = 1e-11, 1e-6, 8.0
# Samples of an interval; what a place is made of.
_EACH, _PLACE = 4, ("q", "qd", "tangents", "table")


@dataclass(frozen=True, eq=False)
class Together:
    """Motions on the same nodes, side by side.

    Attributes
    ----------
    motion : NodeMotion
        All of them, one after the other.
    costs : (K,)
        F of each; NaN of one that is not to be had.
    broken : (K,)
        ½ ∫ max(h, 0)² dt of all conditions [s].
    going : (K,)
        Whether Newton's method may still lead somewhere.
    """

    motion: NodeMotion
    costs: Array
    broken: Array
    going: Flags

    @classmethod
    def near(cls, grid: NodeGrid, motions: Array) -> "Together":
        """Return motions without self-motion whose nodes are those nearest to q (K, N + 1, n)."""
        many, q = grid.copied(len(motions)), motions.reshape(-1, motions.shape[2])
        begun = many.manifolds.near(q, np.zeros_like(q))
        if begun is None:
            raise RuntimeError("of several motions, one that is not to be had leaves the others")
        return cls.of(many.at(*begun), np.ones(len(motions), dtype=np.bool_))

    @classmethod
    def of(cls, motion: NodeMotion, going: Flags) -> "Together":
        """Return the motions of nodes."""
        samples, grid, count = motion.samples, motion.grid, len(going)
        grid.counts.evaluations += count
        each = np.sum([cost.value(samples) for cost in grid.problem.all_costs], axis=0)
        shares = (samples.weights * each)[:-1].reshape(-1, _EACH).sum(axis=1)
        costs = np.append(shares, 0.0).reshape(count, -1).sum(axis=1)
        squares = (_weights(motion) * np.maximum(motion.h, 0.0) ** 2).sum(axis=1)
        return cls(motion, costs, 0.5 * squares.reshape(count, -1).sum(axis=1), going)

    @property
    def count(self) -> int:
        """K."""
        return len(self.going)

    @property
    def q(self) -> Array:
        """The motions at their nodes, (K, N + 1, n)."""
        return self._each(self.motion.place.q)

    @property
    def qd(self) -> Array:
        """How fast they are there, (K, N + 1, n)."""
        return self._each(self.motion.place.qd)

    @property
    def merits(self) -> Array:
        """What ranks them, (K,): F, much more where conditions are broken; inf for none."""
        sizes = np.maximum(np.abs(self.costs), 1e-3)
        found = self.costs + sizes * np.minimum(_HEAVY * self.broken, _MOST)
        return np.where(np.isfinite(found), found, np.inf)

    def picked(self, which: Ints) -> "Together":
        """Return some of them."""
        motion, whole = self.motion, self.motion.place
        grid = motion.grid.copied(len(which))
        rows = (which[:, None] * len(self.q[0]) + np.arange(len(self.q[0]))).ravel()
        charts = Charts(grid.manifolds, motion.charts.q[rows], motion.charts.bases[rows])
        place = Place(*(np.ascontiguousarray(getattr(whole, name)[rows]) for name in _PLACE))
        some = grid.at(charts, motion.nu[rows], place)
        return Together(some, self.costs[which], self.broken[which], self.going[which])

    def advanced(self) -> "Together":
        """Return them after one of Newton's steps with each that is on its way."""
        motion, grid = self.motion, self.motion.grid
        gradient, around, prices = self._slopes()
        if around is None:
            return self._ended(~self.going)
        grid.counts.gradients += self.count
        intervals = grid.cost.curvature(motion.samples, motion.partials, around.changes)
        # Where one motion is next to what is not to be had, those beside it know nothing of that.
        intervals[grid.spline.gaps] = 0.0
        columns = np.flatnonzero(prices.any(axis=0))
        matrix = Banded(len(gradient), gradient.shape[1], 2 if columns.size else 1)
        matrix.add(0, 0, around.curvature)
        matrix.add_pairs(0, intervals)
        if columns.size:
            rows = grid.conditions.rows(motion.samples.checked, around.changes, columns)
            above = (prices[:, columns] > 0.0) * self._stiffness[:, columns]
            rows[above == 0.0] = 0.0
            matrix.add_triples(np.swapaxes(rows, 1, 2) @ (above[:, :, None] * rows))
        matrix.hold(grid.held)
        step, rights = np.zeros((self.count, gradient.size // self.count)), -gradient
        rights = rights.reshape(step.shape)
        sound = self.going & np.isfinite(rights).all(axis=1)
        for k in np.flatnonzero(sound).tolist():
            solved = matrix.part_solved(k, self.count, rights[k], (_FLAT, _SHIFT, _MORE))
            if solved is None:
                sound[k] = False
            else:
                step[k] = solved
        promised = (rights * step).sum(axis=1)
        return self._moved(step, promised, sound & (promised > _ENOUGH * np.abs(self.costs)))

    @property
    def _stiffness(self) -> Array:
        """How much a unit of max(h, 0)² / 2 weighs at each node, (K (N + 1), C)."""
        sizes = np.maximum(np.abs(self.costs), 1e-3)
        each = np.repeat(_HEAVY * sizes, len(self.motion.nu) // self.count)
        return _weights(self.motion) * each[:, None]

    def _slopes(self) -> tuple[Array, Around | None, Array]:
        """Return the gradient by w, how nodes move, and the prices of what is broken."""
        motion, grid = self.motion, self.motion.grid
        by = scattered(grid.cost.slopes(motion.samples, motion.partials))
        prices = self._stiffness * np.maximum(motion.h, 0.0)
        if prices.any():
            by = by + grid.conditions.pulled(motion.samples.checked, prices)
        gradient = motion.charts.pulled(motion.place, by[:, 0], by[:, 1])
        gradient.reshape(-1)[grid.held] = 0.0
        return gradient, Around.of(motion.charts, motion.nu, by), prices

    def _moved(self, step: Array, promised: Array, going: Flags) -> "Together":
        """Return them along their steps, each as far as it does what it promises."""
        if not going.any():
            return self._ended(~going)
        motion, r = self.motion, self.motion.nu.shape[1]
        by_node = step.reshape(self.count, -1, 2, r)
        farthest = np.abs(by_node[:, :, 0]).max(axis=(1, 2))
        most = np.where(going, _FARTHEST / np.maximum(farthest, _FARTHEST), 0.0)
        sizes, left, length = np.maximum(np.abs(self.costs), 1e-3), going.copy(), most.copy()
        aim = self.costs + _HEAVY * sizes * self.broken
        for share in (*_SHARES, 0.0):
            length[left] = share * most[left]
            flat = (length[:, None, None, None] * by_node).reshape(-1, 2, r)
            epsilon = motion.charts.null_motions(motion.nu + flat[:, 1])
            found = motion.charts.centred(flat[:, 0], epsilon)
            if found is None:
                break
            new = Together.of(motion.grid.at(*found), going & (length > 0.0))
            # Written so that NaN is no gain.
            gained = aim - new.costs - _HEAVY * sizes * new.broken
            left &= ~(gained >= _DONE * length * promised)
            if not left.any() or share == 0.0:
                return new
        return self._ended(going)

    def _ended(self, which: Flags) -> "Together":
        return Together(self.motion, self.costs, self.broken, self.going & ~which)

    def _each(self, table: Array) -> Array:
        return table.reshape(self.count, -1, table.shape[1])


def _weights(motion: NodeMotion) -> Array:
    """Return the trapezoidal rule over nodes and the middles after them, (K (N + 1), C) [s]."""
    steps = motion.grid.spline.steps.copy()
    steps[motion.grid.spline.gaps] = 0.0
    nodes = 0.25 * (np.append(steps, 0.0) + np.append(0.0, steps))
    middles = 0.5 * np.append(steps, 0.0)
    return np.repeat(np.column_stack([nodes, middles]), motion.h.shape[1] // 2, axis=1)
