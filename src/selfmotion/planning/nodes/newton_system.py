"""Linear system of a step of Newton's method: second-order model of a motion, and the step.

Rows h + s - e = 0 have slacks s, elastic variables e and multipliers λ below a price ρ. Eliminated,
their steps leave a block-tridiagonal matrix of the nodes alone; see `newton`.
"""

from typing import NamedTuple, Self

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.planning.nodes.ends import Border
from selfmotion.planning.nodes.local_model import LocalModel
from selfmotion.planning.nodes.motion import NodeMotion, breaks_hard, slopes_of
from selfmotion.planning.nodes.newton_kernels import eliminate, step_rows
from selfmotion.planning.nodes.node_matrix import EndChanges, NodeMatrix
from selfmotion.planning.nodes.rows import LinearRows
from selfmotion.planning.nodes.settings import SETTINGS


class ElasticRows(NamedTuple):
    """Active rows with their unknowns, (K,) each.

    Attributes
    ----------
    h : (K,)
    slacks, elastics, multipliers : (K,)
        s, e and λ.
    price : float
        ρ.
    active : (R,)
        Mask of the active ones among all rows.
    """

    h: Array
    slacks: Array
    elastics: Array
    multipliers: Array
    price: float
    active: Flags

    @property
    def unknowns(self) -> tuple[Array, Array, Array, Array, float]:
        """Rows and unknowns as kernels take them: h, s, e, λ and ρ."""
        return self.h, self.slacks, self.elastics, self.multipliers, self.price

    def of_all(self, own: Array) -> Array:
        """Return values of active rows, (K,), among those of all rows, (R,)."""
        found = np.zeros(len(self.active))
        found[self.active] = own
        return found


class Model(NamedTuple):
    """Second-order model of a motion.

    Attributes
    ----------
    gradient : (N + 1, 3r)
        ∂F/∂w.
    by : EndChanges
        ∂y/∂w of all intervals.
    around : LocalModel
        Motion of the nodes by their coordinates; curvature along the forces on them.
    curvature : NodeMatrix
        Second derivatives by y of costs, and of rows that are sums of squares.
    rows : LinearRows
    border : Border
    """

    gradient: Array
    by: EndChanges
    around: LocalModel
    curvature: NodeMatrix
    rows: LinearRows
    border: Border

    @classmethod
    def of(cls, motion: NodeMotion, own: ElasticRows, end_multipliers: Array) -> Self | None:
        """Return the model at a motion; None where a neighbour cannot be evaluated.

        `end_multipliers` (E,) are those of the conditions on the ends.
        """
        grid, spline = motion.grid, motion.grid.spline
        grid.counts.gradients += 1
        slopes = slopes_of(motion)
        by_cost = spline.scatter(slopes)
        rows = grid.rows.linearised(lambda: motion.checked, own.active)
        force, multipliers = by_cost, own.of_all(own.multipliers)
        wild = float(np.max(own.h, initial=0.0)) > SETTINGS.gauss_newton_violation
        if not wild and own.multipliers.size:
            force = force + spline.scatter(rows.pulled(multipliers))
        if not wild and len(motion.c):
            force = force + grid.ends.pulled(end_multipliers, len(force))
        around = LocalModel.of(
            motion.charts, motion.nu, motion.alpha, motion.place, force, grid.scale
        )
        if around is None:
            return None
        by = spline.changes(around.changes)
        curvature = NodeMatrix.zeros(*around.curvature.shape[:2])
        grid.cost.add_curvature(curvature, by, motion.sampled, motion.partials)
        # Sums of squares keep their curvature however far they are violated; those of tolerances
        # only while other rows hold.
        without = wild and breaks_hard(motion, SETTINGS.gauss_newton_violation)
        grid.rows.add_bending(
            curvature, by, lambda: motion.checked, multipliers, without_tolerances=without
        )
        gradient = by.pulled(slopes)
        gradient.reshape(-1)[grid.held] = 0.0
        border = grid.ends.border(motion.c, around.changes, grid.held)
        return cls(gradient, by, around, curvature, rows, border)

    def stiffened(self, weights: Array) -> NodeMatrix:
        """Return the curvature with ∂hᵀ D ∂h added, for weights of all rows (R,)."""
        found = self.curvature.copy()
        self.rows.add_squared(found, self.by, weights)
        return found


class Change(NamedTuple):
    """Step of all unknowns, and the decrease of the objective that it predicts."""

    nodes: Array
    slacks: Array
    elastics: Array
    multipliers: Array
    end_multipliers: Array
    promised: float


class System(NamedTuple):
    """Solved linear system: the step of the nodes for any μ is solved[:, 0] + μ solved[:, 1].

    Attributes
    ----------
    model : Model
    own : ElasticRows
    right : (2, (N + 1) 3r)
        Right sides with their sign changed: without barrier, and per unit of μ.
    stiff : (K,)
        ∂λ/∂h once steps of s and e are eliminated.
    solved : ((N + 1) 3r, 2 + E)
        Solutions for both right sides, and for the columns of the border.
    shift : float
        δ that was added to the diagonal.
    """

    model: Model
    own: ElasticRows
    right: Array
    stiff: Array
    solved: Array
    shift: float

    @classmethod
    def of(
        cls, motion: NodeMotion, model: Model, own: ElasticRows, barrier: float, shift: float
    ) -> Self | None:
        """Solve for any μ; None where the matrix is singular at the present one.

        `shift` is the δ of the last system.
        """
        grid, multipliers = motion.grid, own.multipliers
        gradient, stiffened = model.gradient, model.curvature
        right, stiff = np.zeros((2, gradient.size)), np.empty(len(multipliers))
        right[0] = gradient.ravel()
        if multipliers.size:
            pulls = np.empty((2, len(multipliers)))
            eliminate(*own.unknowns, stiff, pulls)
            for each, pull in zip(right, pulls, strict=True):
                pulled = model.by.pulled(model.rows.pulled(own.of_all(pull))).ravel()
                pulled[grid.held] = 0.0
                each += pulled
            stiffened = model.stiffened(own.of_all(stiff))
        found = _solved(motion, model, stiffened, right, barrier, shift)
        return None if found is None else cls(model, own, right, stiff, *found)

    def step(self, barrier: float) -> Change:
        """Return Newton's step of all unknowns for a μ."""
        own, model = self.own, self.model
        step, end_multipliers = _nodes_of(model, self.solved, barrier)
        right = self.right[0] + barrier * self.right[1]
        promised = float(-(right + model.border.columns @ end_multipliers) @ step)
        nodes = step.reshape(model.gradient.shape)
        along, steps = model.rows.along(model.by.along(nodes)), np.empty((3, len(self.stiff)))
        step_rows(*own.unknowns, barrier, self.stiff, along, steps)
        return Change(nodes, steps[0], steps[1], steps[2], end_multipliers, promised)


def _nodes_of(model: Model, solved: Array, barrier: float) -> tuple[Array, Array]:
    """Return the step of the nodes for a μ, and the multipliers of the ends."""
    own = solved[:, 0] + barrier * solved[:, 1]
    return model.border.met_by(own, solved[:, 2:])


def _solved(
    motion: NodeMotion,
    model: Model,
    stiffened: NodeMatrix,
    right: Array,
    barrier: float,
    last: float,
) -> tuple[Array, float] | None:
    """Return the solutions for two right sides (2, …) and the border's columns; and δ.

    `stiffened` is the model's curvature with the stiffness of its active rows.
    """
    curved, count = model.around.curvature, len(model.gradient)
    largest = float(np.abs(curved).max() + max(np.abs(part).max() for part in stiffened))
    diagonals = np.abs(np.diagonal(stiffened.nodes, axis1=1, axis2=2)).ravel()
    middle = len(diagonals) // 2
    usual = float(np.partition(diagonals, middle)[middle])
    flat, shift, bounds = SETTINGS.flat_share / count**2 * usual, 0.0, np.zeros(0)
    columns = np.column_stack([-right.T, model.border.columns])
    while flat <= SETTINGS.delta_max * largest and shift <= SETTINGS.delta_max:
        matrix = stiffened.banded()
        matrix.add(0, 0, curved)
        matrix.add_diagonal(SETTINGS.flat_factor * flat + shift * bounds if shift else flat)
        matrix.hold(motion.grid.held)
        solved = matrix.solve(columns)
        if solved is not None:
            step, _ = _nodes_of(model, solved, barrier)
            if np.abs(step.reshape(count, 3, -1)[:, 0]).max() <= SETTINGS.max_trusted:
                return solved, shift
        if solved is not None and not shift:
            flat = max(SETTINGS.kappa_plus * flat, SETTINGS.delta_floor * largest)
        else:
            # Most matrices are positive definite without.
            if not bounds.size:
                bounds = _curvature_bounds(model.curvature, curved) + SETTINGS.delta_floor * largest
            shift = max(
                SETTINGS.kappa_plus * shift, SETTINGS.kappa_minus * last, SETTINGS.delta_first
            )
    return None


def _curvature_bounds(curvature: NodeMatrix, curved: Array) -> Array:
    """Return a bound of each coordinate's curvature without rows, (K,).

    For the model's curvature, and that of the nodes' own motion (N + 1, d, d): the absolute sums of
    their rows, scaled by the median curvature of each kind of coordinate. With these on the
    diagonal a matrix is positive definite (Gershgorin).
    """
    own = np.abs(np.diagonal(curvature.nodes, axis1=1, axis2=2))
    usual = np.maximum(np.median(own, axis=0), np.finfo(float).eps * own.max())
    root = np.sqrt(np.maximum(usual, np.finfo(float).tiny))
    pairs = np.abs(curvature.pairs)
    found = ((np.abs(curved) + np.abs(curvature.nodes)) / root).sum(axis=2) * root
    found[:-1] += (pairs / root).sum(axis=2) * root
    found[1:] += (pairs / root[:, None]).sum(axis=1) * root
    return np.asarray(np.maximum(found, usual).ravel())
