"""A motion on its path, given by its nodes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from selfmotion.basics import Array, Flags, Ints, read_only
from selfmotion.constraints import BoundConstraint, BoundEnd
from selfmotion.costs import Partials
from selfmotion.engine import Counts
from selfmotion.motion import Trajectory
from selfmotion.nodes.charts import Charts, Manifolds, Place
from selfmotion.nodes.conditions import NodeConditions
from selfmotion.nodes.ends import NodeEnds
from selfmotion.nodes.hermite import HermiteSamples, QuinticSamples
from selfmotion.nodes.kernels import follow
from selfmotion.nodes.objective import NodeCost
from selfmotion.nodes.smoothness import Continuity, smoothing_at_rest
from selfmotion.nodes.spline import Hermite
from selfmotion.problem import Problem

# A limit binds between two nodes where it is this near [units of h].
_ALONG = 1e-5
# Accelerations that differ from the differences of velocities by more than the largest of these
# times this are those of a pose that is all but singular, and are damped by this much.
_WILD, _DAMPING = 1.0, 1e-2


class NodeGrid:
    """What all motions of a problem on the same nodes share.

    Parameters
    ----------
    problem : Problem
    t : (N + 1,)
        Times of the nodes [s].
    constraints : sequence of BoundConstraint
        Conditions at each node, h ≤ 0, and at the ends, c = 0.
    free : bool
        Whether the start may move along its self-motion.
    counts : Counts
        Where work is added up.
    continuous : bool
        Whether accelerations are kept from jumping at the nodes.
    copies : int, optional
        Of how many motions these are the nodes, one after the other, at times `t` each; see
        `Manifolds`.

    Attributes
    ----------
    spline : Hermite
    manifolds : Manifolds
    cost : NodeCost
    conditions : NodeConditions
    ends : NodeEnds
    is_continuous : bool
        Whether they are kept so at all nodes.
    continuity : Continuity or None
    held : (k,)
        Numbers of the coordinates w (N + 1, 2r), in one row, that stay as they are.
    """

    def __init__(
        self,
        problem: Problem,
        t: Array,
        constraints: Sequence[BoundConstraint],
        *,
        free: bool,
        counts: Counts,
        continuous: bool = False,
        copies: int | None = None,
    ) -> None:
        self.problem, self.free, self.counts = problem, free, counts
        follows = problem.follows
        self.manifolds = Manifolds(follows, t, copies)
        copies = self.manifolds.copies
        self.spline = Hermite(t, copies)
        self.is_continuous = continuous
        self.continuity = None
        if continuous or (follows.edges and copies == 1):
            self.continuity = Continuity(problem, self.spline, everywhere=continuous)
        smoothing = smoothing_at_rest(problem, self.spline)
        self.cost = NodeCost(follows, self.spline, problem.all_costs, smoothing)
        ends = [item for item in constraints if isinstance(item, BoundEnd)]
        self.ends = NodeEnds(ends)
        others = [item for item in constraints if not item.equality]
        self.conditions = NodeConditions(self.spline, others, follows.robot.dof)
        self._constraints = tuple(constraints)
        r = follows.robot.dof - follows.dimension
        held: list[Ints] = [] if free else [np.arange(r)]
        ends = np.array([0, len(t) - 1])[np.array(problem.rests)]
        self._resting = (ends + len(t) * np.arange(copies)[:, None]).ravel()
        held += [2 * r * node + r + np.arange(r) for node in self._resting]
        for node, count in enumerate(self.manifolds.held.sum(axis=1)):
            last = 2 * r * node + np.arange(r - count, r)
            held += [last, last + r] if count else []
        self.held = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *held]))

    @property
    def t(self) -> Array:
        """Times of the nodes [s], (N + 1,)."""
        return self.spline.t

    def on(self, t: Array) -> "NodeGrid":
        """Return the same on other nodes."""
        return self._other(t, continuous=self.is_continuous)

    @property
    def continuous(self) -> "NodeGrid":
        """The same with accelerations that are kept from jumping."""
        return self._other(self.t, continuous=True)

    def copied(self, copies: int) -> "NodeGrid":
        """Return the nodes of so many motions, one after the other, for `Together`.

        Of what belongs to several, `NodeMotion` knows places, samples and costs alone.
        """
        one = self.t[: len(self.t) // self.manifolds.copies]
        return self._other(one, continuous=False, copies=copies)

    def _other(self, t: Array, *, continuous: bool, copies: int | None = None) -> "NodeGrid":
        return NodeGrid(
            self.problem,
            t,
            self._constraints,
            free=self.free,
            counts=self.counts,
            continuous=continuous,
            copies=copies,
        )

    def near(self, q: Array, qd: Array) -> "NodeMotion | None":
        """Return the motion whose nodes are those nearest to q (N + 1, n) at q̇.

        None where a node does not come onto its manifold.
        """
        found = self.manifolds.near(q, self._free(qd))
        return None if found is None else self.at(*found)

    def around(self, charts: Charts, qd: Array) -> "NodeMotion | None":
        """Return the motion at z = 0 of charts whose velocities are nearest to q̇, or None."""
        own = self.manifolds.held
        if own.any():
            q = np.where(own, 0.0, charts.q)
            charts = replace(charts, q=q, bases=self.manifolds.with_held_last(q, charts.bases))
        found = charts.centred(np.zeros((len(qd), charts.bases.shape[2])), self._free(qd))
        return None if found is None else self.at(*found)

    def moving(self, motion: "NodeMotion", qd: Array) -> "NodeMotion":
        """Return the motion through the same nodes whose velocities are nearest to q̇."""
        return self.at(*motion.charts.moving(motion.place, self._free(qd)))

    def _free(self, qd: Array) -> Array:
        """Return what velocities are where the arm does not rest."""
        found = np.where(self.manifolds.held, 0.0, qd)
        found[self._resting] = 0.0
        return found

    def motion_towards(self, start: Array, wanted: Array, time: float) -> "NodeMotion | None":
        """Return a motion from a start (n,) whose self-motion goes towards `wanted` (n,).

        It is there, as far as the path lets it, after about so much time [s]. None where the path
        cannot be followed like that.
        """
        own = self.manifolds
        q = np.empty((len(self.t), len(start)))
        share = np.minimum(np.append(0.0, np.diff(self.t)) / time, 1.0)
        if follow(start, wanted, share, own.targets, own.chains, own.layout, own.held, q) >= 0:
            return None
        return self.near(q, np.asarray(np.gradient(q, self.t, axis=0)))

    def at(self, charts: Charts, nu: Array, place: Place) -> "NodeMotion":
        """Return the motion of a place."""
        samples = HermiteSamples(self.manifolds.follows, self.spline, place.q, place.qd)
        return NodeMotion(self, charts, nu, place, samples)


@dataclass(frozen=True, eq=False)
class NodeMotion:
    """A motion given by its nodes.

    Attributes
    ----------
    grid : NodeGrid
    charts : Charts
    nu : (N + 1, r)
        Null motions there.
    place : Place
    samples : HermiteSamples
    """

    grid: NodeGrid
    charts: Charts
    nu: Array
    place: Place
    samples: HermiteSamples

    @cached_property
    def terms(self) -> dict[str, float]:
        """What each cost contributes."""
        self.grid.counts.evaluated()
        return self.grid.cost.terms(self.samples)

    @property
    def cost(self) -> float:
        """F."""
        return sum(self.terms.values())

    @cached_property
    def exact(self) -> QuinticSamples:
        """The `trajectory`, which is on its path between the nodes, at the spline's samples."""
        grid = self.grid
        return QuinticSamples(grid.problem.follows, grid.spline, self.trajectory)

    @cached_property
    def exact_terms(self) -> dict[str, float]:
        """What each cost contributes along `trajectory`."""
        return self.grid.cost.terms(self.exact)

    @cached_property
    def along(self) -> Flags:
        """On which intervals a condition binds, (N,)."""
        return self.grid.conditions.along(self.samples.checked, _ALONG)

    @property
    def ends_of_limits(self) -> Flags:
        """Near which intervals a limit of accelerations begins or ends to bind, (N,)."""
        changes = np.zeros(len(self.along) + 3, dtype=np.bool_)
        if self.grid.is_continuous:
            changes[2:-2] = self.along[1:] != self.along[:-1]
        # Two intervals before, and two after.
        return changes[:-3] | changes[1:-2] | changes[2:-1] | changes[3:]

    def broken(self) -> Flags:
        """Return on which intervals `trajectory` does not keep the conditions, (N,)."""
        broken = self.grid.conditions.broken(self.exact)[:-1]
        return np.asarray(broken.reshape(len(self.grid.t) - 1, -1).any(axis=1))

    @property
    def exact_cost(self) -> float:
        """F along `trajectory`."""
        return sum(self.exact_terms.values())

    @cached_property
    def aim(self) -> float:
        """What is minimised: F and what keeps the motion smooth."""
        rough, continuity = self.grid.cost.roughness(self.samples), self.grid.continuity
        if continuity is not None:
            rough += 0.5 * float(np.sum(continuity.jumps(self.samples) ** 2))
        return self.cost + rough

    @cached_property
    def partials(self) -> tuple[Partials, ...]:
        """Derivatives of each cost's integrand at the samples."""
        return self.grid.cost.partials(self.samples)

    @cached_property
    def h(self) -> Array:
        """The conditions, (N + 1, C)."""
        return self.grid.conditions.residuals(self.samples.checked)

    @cached_property
    def c(self) -> Array:
        """What is off at the ends, (E,)."""
        return self.grid.ends.residuals(self.samples)

    @cached_property
    def orders(self) -> Ints:
        """The highest derivative of q that each condition depends on, (C,)."""
        return self.grid.conditions.orders(self.samples.checked)

    @property
    def wanted(self) -> Array:
        """The conditions as Newton's method is to keep them, (N + 1, C).

        Half of what they may be beyond is for what is between the nodes.
        """
        return self.h - 0.5 * self.grid.conditions.tolerances

    @property
    def epsilon(self) -> Array:
        """The null motion ε at the nodes, (N + 1, n)."""
        return self.charts.null_motions(self.nu)

    def forget(self) -> None:
        """Let go of what can be computed anew: most of the memory that a long path takes."""
        for name in ("exact", "h", "partials"):
            self.__dict__.pop(name, None)
        self.samples.forget()

    def smoothed(self) -> "NodeMotion":
        """Return the motion through the same nodes, as fast there as a spline through them.

        Where few nodes are, the velocities that are best by the samples of the cost waver about
        those of a smooth motion through the same nodes, which differ by next to nothing in cost.
        """
        from scipy.interpolate import CubicSpline

        t, q, qd = self.grid.t, self.place.q, self.place.qd.copy()
        # Where the path is only C², so is the motion.
        ends = np.searchsorted(t, self.grid.problem.knots)
        for first, last in pairwise(ends.tolist()):
            if last - first > 1:
                part = slice(first, last + 1)
                sides: Any = ((1, qd[first]), (1, qd[last]))
                # The coefficients of first order: the slopes at all nodes but the last.
                qd[first:last] = CubicSpline(t[part], q[part], bc_type=sides).c[2]
        return self.grid.moving(self, qd)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The quintic through the nodes, with q̈ by eq. 4: q̈ = J⁺(ẍ - J̇q̇) + N α.

        α is by differences of q̇. Where a limit begins or ends to bind the self-motion has a kink,
        and α is that of the side along the limit. q̈ is 0 where the arm rests.
        """
        problem, t, place = self.grid.problem, self.grid.t, self.place
        qdd = self.grid.manifolds.accelerations(place)
        along = self.along
        before, after = np.append(False, along), np.append(along, False)
        sides = self.grid.spline.accelerations(self.samples.ends)
        near = 0.5 * (sides[0] + sides[1])
        for which, side in zip((before & ~after, after & ~before), sides, strict=True):
            near[which] = side[which]
        bases = self.charts.bases
        qdd += (bases @ (np.swapaxes(bases, 1, 2) @ near[:, :, None]))[:, :, 0]
        self._calm(qdd, near)
        qdd[self.grid.manifolds.held] = 0.0
        for order, node in zip(problem.rest_orders, (0, -1), strict=True):
            if order > 1:
                qdd[node] = 0.0
        names = problem.robot.joint_names
        return Trajectory(t, read_only(place.q), read_only(place.qd), names, read_only(qdd))

    def _calm(self, qdd: Array, near: Array) -> None:
        """Damp q̈ where a pose is all but singular, so that the quintic does not waver there.

        q̈ = a + J⁺ J (q̈ - a) with the differences a of q̇, `near` (N + 1, n), and the damped J⁺.
        """
        away = np.abs(qdd - near).max(axis=1)
        wild = away > _WILD * np.abs(near).max()
        if wild.any():
            rows = self.grid.problem.follows.jacobians(self.place.q[wild])
            lack = rows @ (qdd - near)[wild][:, :, None]
            gram = rows @ rows.transpose(0, 2, 1) + _DAMPING**2 * np.eye(rows.shape[1])
            qdd[wild] = (
                near[wild] + (rows.transpose(0, 2, 1) @ np.linalg.solve(gram, lack))[:, :, 0]
            )

    def on(self, grid: NodeGrid) -> "NodeMotion | None":
        """Return the motion on other nodes."""
        from scipy.interpolate import CubicHermiteSpline

        t, place = self.grid.t, self.place
        spline = CubicHermiteSpline(t, place.q, place.qd)
        # What is nearly a basis will do for charts to begin with, and turns as those around it do.
        bases = self.charts.bases[np.searchsorted(t, grid.t, side="right") - 1]
        return grid.around(Charts(grid.manifolds, spline(grid.t), bases), spline(grid.t, 1))
