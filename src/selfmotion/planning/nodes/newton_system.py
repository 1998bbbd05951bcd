"""The linear system of a step of Newton's method: what a motion is like near by, and the step.

Rows h + s - e = 0 have slacks s, elastic variables e and multipliers λ below a price ρ. Eliminated,
their steps leave a block-tridiagonal matrix of the nodes alone; see `newton`.
"""

from typing import NamedTuple, Self

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.planning.nodes.ends import Border
from selfmotion.planning.nodes.motion import NodeMotion
from selfmotion.planning.nodes.objective import LocalModel
from selfmotion.planning.nodes.rows import LinearRows
from selfmotion.planning.optimise import Banded

# While a row is broken by more than this, its own curvature is none to trust: Gauss-Newton.
WILD = 1e-2
# Motions that cost nothing, as of a joint whose axis the tool is on, are left alone: the matrix has
# this share of its usual entry, over the square of the number of nodes, more on the diagonal: above
# what differences leave there, and below what slow motions cost.
_FLAT = 2.5e-5
# So many times that where it is not positive definite: there rounding may say anything.
_FLATTER = 16.0
# One that is not positive definite gets on the diagonal this share of how each coordinate bends
# without rows, or a third of what the last one needed; then more by this factor, up to the last
# one. The same for all would stop some of them: with costs of jerks they differ by 1e9.
_SHIFT, _LESS, _MORE, _MOST_SHIFT = 1e-6, 1.0 / 3.0, 8.0, 1e6
# Or this share of the largest entry of all, where nothing else bends.
_LEAST_SHIFT = 1e-18
# Nodes that would go farther than this [rad or m] are none of a matrix that says something.
_TRUSTED = 5.0


class ElasticRows(NamedTuple):
    """The rows that count, with their unknowns, (K,) each.

    Attributes
    ----------
    h : (K,)
    slacks, elastics, multipliers : (K,)
        s, e and λ.
    price : float
        ρ.
    kept : (R,)
        Which of all rows count.
    """

    h: Array
    slacks: Array
    elastics: Array
    multipliers: Array
    price: float
    kept: Flags

    @property
    def left(self) -> Array:
        """ρ - λ, (K,)."""
        return self.price - self.multipliers

    @property
    def stiff(self) -> Array:
        """How much a change of h changes multipliers, (K,)."""
        return 1.0 / (self.slacks / self.multipliers + self.elastics / self.left)

    def of_all(self, own: Array) -> Array:
        """Return what belongs to rows that count, (K,), in a row of all, (R,)."""
        found = np.zeros(len(self.kept))
        found[self.kept] = own
        return found


class Model(NamedTuple):
    """What a motion is like near by, to second order.

    Attributes
    ----------
    gradient : (N + 1, 3r)
        ∂F/∂w.
    both : (N, n, 6, 6r)
        ∂y/∂w of both ends of each interval.
    around : LocalModel
        How the nodes move, to second order along what pulls at them.
    intervals : (N, 6r, 6r)
        What bends by costs.
    rows : LinearRows
    border : Border
    """

    gradient: Array
    both: Array
    around: LocalModel
    intervals: Array
    rows: LinearRows
    border: Border

    @classmethod
    def of(cls, motion: NodeMotion, own: ElasticRows, end_multipliers: Array) -> Self | None:
        """Look around a motion; None where a neighbour is not to be had.

        `end_multipliers` (E,) are those of what is asked of the ends.
        """
        grid, spline = motion.grid, motion.grid.spline
        grid.counts.gradients += 1
        slopes = grid.cost.slopes(motion.samples, motion.curve_ends, motion.partials)
        by_cost = spline.scattered(slopes)
        rows = grid.rows.linearised(motion.checked, own.kept)
        force, multipliers = by_cost, own.of_all(own.multipliers)
        wild = float(np.max(own.h, initial=0.0)) > WILD
        if not wild and own.multipliers.size:
            force = force + spline.scattered(rows.pulled(multipliers))
        if not wild and len(motion.c):
            force = force + grid.ends.pulled(end_multipliers, len(force))
        around = LocalModel.of(motion.charts, motion.nu, motion.alpha, motion.place, force)
        if around is None:
            return None
        around = around.scaled(grid.scale)
        both = spline.changes(around.changes)
        intervals = grid.cost.curvature(motion.samples, motion.partials, both)
        # Squares bend as they do, however far they are broken; those of tolerances not past others.
        apart = wild and motion.breaks_hard(WILD)
        bending = grid.rows.bending(motion.checked, multipliers, both, without_tolerances=apart)
        if bending is not None:
            intervals = intervals + bending
        gradient = around.pulled(by_cost)
        gradient.reshape(-1)[grid.held] = 0.0
        border = grid.ends.border(motion.c, around.changes, grid.held)
        return cls(gradient, both, around, intervals, rows, border)

    def stiffness(self, weights: Array) -> Array:
        """Return ∂hᵀ D ∂h on each interval for weights of all rows (R,), (N, 6r, 6r)."""
        count, n, _, size = self.both.shape
        found = np.zeros((count, size, size))
        of_limits = self.rows.squared(weights)
        if of_limits is not None:
            flat = self.both.reshape(count, 6 * n, size)
            turned = (of_limits @ self.both).reshape(count, 6 * n, size)
            found += np.swapaxes(flat, 1, 2) @ turned
        of_points = self.rows.squared_points(weights, self.both)
        return found if of_points is None else found + of_points

    def along(self, step: Array) -> Array:
        """Return how y changes along a step of the nodes (N + 1, 3r), (N, 6, n)."""
        count, n, _, size = self.both.shape
        pair = np.concatenate([step[:-1], step[1:]], axis=1)
        changes = self.both.reshape(count, n * 6, size) @ pair[:, :, None]
        return np.asarray(np.swapaxes(changes.reshape(count, n, 6), 1, 2))


class Change(NamedTuple):
    """A step of all unknowns, and by how much it would lower what is minimised."""

    nodes: Array
    slacks: Array
    elastics: Array
    multipliers: Array
    end_multipliers: Array
    promised: float


class System(NamedTuple):
    """A model, and the step of its nodes for any barrier μ: solved[:, 0] + μ solved[:, 1].

    Attributes
    ----------
    model : Model
    own : ElasticRows
    right : (2, (N + 1) 3r)
        What pulls at the nodes, without barrier and by each unit of it.
    solved : ((N + 1) 3r, 2 + E)
        Also of what is asked of the ends.
    shift : float
        What the matrix needed on its diagonal.
    """

    model: Model
    own: ElasticRows
    right: Array
    solved: Array
    shift: float

    @classmethod
    def of(
        cls, motion: NodeMotion, model: Model, own: ElasticRows, barrier: float, shift: float
    ) -> Self | None:
        """Solve for any barrier; None where the matrix says nothing for the present one.

        `shift` is what the last one needed on its diagonal.
        """
        grid, multipliers = motion.grid, own.multipliers
        gradient, intervals = model.gradient, model.intervals
        right = np.stack([gradient.ravel(), np.zeros(gradient.size)])
        if multipliers.size:
            stiff = own.stiff
            by_barrier = stiff * (1.0 / multipliers - 1.0 / own.left)
            for k, pulls in enumerate((multipliers + stiff * own.h, by_barrier)):
                push = model.rows.pulled(own.of_all(pulls))
                pulled = model.around.pulled(grid.spline.scattered(push))
                pulled.reshape(-1)[grid.held] = 0.0
                right[k] += pulled.ravel()
            intervals = intervals + model.stiffness(own.of_all(stiff))
        found = _solved(motion, model, intervals, right, barrier, shift)
        return None if found is None else cls(model, own, right, *found)

    def step(self, barrier: float) -> Change:
        """Return Newton's step of all unknowns for a barrier."""
        own, model = self.own, self.model
        slacks, elastics, multipliers, left = own.slacks, own.elastics, own.multipliers, own.left
        step, end_multipliers = _nodes_of(model, self.solved, barrier)
        right = self.right[0] + barrier * self.right[1]
        promised = float(-(right + model.border.columns @ end_multipliers) @ step)
        nodes = step.reshape(model.gradient.shape)
        off = own.h + barrier / multipliers - barrier / left
        by_multipliers = own.stiff * (model.rows.along(model.along(nodes)) + off)
        by_slacks = barrier / multipliers - slacks - slacks / multipliers * by_multipliers
        by_elastics = barrier / left - elastics + elastics / left * by_multipliers
        return Change(nodes, by_slacks, by_elastics, by_multipliers, end_multipliers, promised)


def _nodes_of(model: Model, solved: Array, barrier: float) -> tuple[Array, Array]:
    """Return the step of the nodes for a barrier, and the multipliers of the ends."""
    own = solved[:, 0] + barrier * solved[:, 1]
    return model.border.met_by(np.column_stack([own, solved[:, 2:]]))


def _solved(
    motion: NodeMotion,
    model: Model,
    intervals: Array,
    right: Array,
    barrier: float,
    last: float,
) -> tuple[Array, float] | None:
    """Return the steps for two right sides (2, …), and of what is asked of the ends; the shift.

    `intervals` (N, 6r, 6r) are those of the model with what its rows make stiff.
    """
    curved = model.around.curvature
    count, size = model.gradient.shape
    largest = float(np.abs(curved).max() + np.abs(intervals).max())
    diagonals = np.abs(np.diagonal(intervals, axis1=1, axis2=2)).ravel()
    usual = float(np.partition(diagonals, len(diagonals) // 2)[len(diagonals) // 2])
    flat, shift, bends = _FLAT / count**2 * usual, 0.0, np.zeros(0)
    columns = np.column_stack([-right.T, model.border.columns])
    while flat <= _MOST_SHIFT * largest and shift <= _MOST_SHIFT:
        matrix = Banded(count, size, 1)
        matrix.add(0, 0, curved)
        matrix.add_pairs(0, intervals)
        matrix.add_diagonal(_FLATTER * flat + shift * bends if shift else flat)
        matrix.hold(motion.grid.held)
        solved = matrix.solve(columns)
        if solved is not None:
            step, _ = _nodes_of(model, solved, barrier)
            if np.abs(step.reshape(count, 3, -1)[:, 0]).max() <= _TRUSTED:
                return solved, shift
        if solved is not None and not shift:
            flat = max(_MORE * flat, _LEAST_SHIFT * largest)
        else:
            # Most matrices need none of it.
            if not bends.size:
                bends = _bends(model.intervals, curved) + _LEAST_SHIFT * largest
            shift = max(_MORE * shift, _LESS * last, _SHIFT)
    return None


def _bends(intervals: Array, nodes: Array) -> Array:
    """Return how much each coordinate of the nodes bends without rows, (K,).

    For matrices of intervals (N, d, d) by both ends, and of nodes (N + 1, d/2, d/2): the sums of
    their rows, in units of what each kind of coordinate usually bends by. With that on the diagonal
    a matrix is positive definite.
    """
    count, size = len(intervals), intervals.shape[1] // 2
    own = np.abs(np.diagonal(intervals, axis1=1, axis2=2)).reshape(2 * count, size)
    usual = np.maximum(np.median(own, axis=0), np.finfo(float).eps * own.max())
    root = np.sqrt(np.maximum(usual, np.finfo(float).tiny))
    both = np.tile(root, 2)
    sums = (np.abs(intervals) / both).sum(axis=2) * both
    found = (np.abs(nodes) / root).sum(axis=2) * root
    found[:-1] += sums[:, :size]
    found[1:] += sums[:, size:]
    return np.asarray(np.maximum(found, usual).ravel())
