"""A motion on its path, given by its nodes."""

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from selfmotion.basics import Array, Counts, Flags, Ints, read_only
from selfmotion.model.motion import Trajectory
from selfmotion.planning.formulation import (
    BoundConditions,
    CurveSamples,
    Formulation,
    SampledMotion,
    sampled,
)
from selfmotion.planning.nodes.charts import Centred, Charts, Manifolds, Place
from selfmotion.planning.nodes.ends import NodeEnds
from selfmotion.planning.nodes.kernels import follow
from selfmotion.planning.nodes.objective import NodeCost
from selfmotion.planning.nodes.quadratic import Quadratic
from selfmotion.planning.nodes.rows import NodeRows, is_tolerance, parts_wanted, sampled_curve
from selfmotion.planning.nodes.smoothness import can_be_smoothed, quickness, smoothing_of
from selfmotion.planning.nodes.spline import AT_GAUSS, FINE_POINTS, POINTS, Quintic
from selfmotion.problem.costs import Partials


class NodeGrid:
    """Problem, times and costs that all motions on the same nodes share.

    Parameters
    ----------
    formulation : Formulation
    t : (N + 1,)
        Times of the nodes [s].
    conditions : BoundConditions
        Along the motion, h ≤ 0, and at the ends, c = 0.
    free : bool
        Whether the start may move along its self-motion.
    counts : Counts
        Counters of the work.
    smoothed : bool
        Whether q̈ is penalised everywhere, against oscillation; see `smoothing_of`.
    quick : float
        Share of the usual time in which the self-motion starts and stops, see `smoothing_of`.
    copies : int, optional
        Number of motions that are put one after the other, at times `t` each; see `Manifolds`.

    Attributes
    ----------
    conditions : BoundConditions
    spline : Quintic
    manifolds : Manifolds
    cost : NodeCost
    rows : NodeRows
    ends : NodeEnds
    scale : (3r,)
        Scales that make w [rad]: 1, and the reciprocals of the median step and of its square.
    held : (k,)
        Indices of the coordinates w (N + 1, 3r), flattened, that are constant.
    """

    def __init__(
        self,
        formulation: Formulation,
        t: Array,
        conditions: BoundConditions,
        *,
        free: bool,
        counts: Counts,
        smoothed: bool = False,
        quick: float = 1.0,
        copies: int | None = None,
    ) -> None:
        self.formulation, self.free, self.counts = formulation, free, counts
        self.smoothed, self.quick, self.conditions = smoothed, quick, conditions
        follows, n = formulation.follows, formulation.robot.dof
        self.manifolds = Manifolds(follows, t, copies)
        copies = self.manifolds.copies
        accelerates = any(item.uses_accelerations(n) for item in conditions.points)
        self.spline = Quintic(t, copies, FINE_POINTS if accelerates else POINTS)
        smoothing = smoothing_of(formulation, self.spline, smoothed=smoothed, quick=quick)
        self.cost = NodeCost(formulation, self.spline, smoothing)
        self.ends = NodeEnds(conditions.ends)
        self.rows = NodeRows.of(formulation, self.spline, conditions.limits, conditions.points)
        self._times = t
        r = follows.dof - follows.dimension
        usual = float(np.median(np.diff(t)))
        self.scale = np.repeat([1.0, 1.0 / usual, 1.0 / usual**2], r)
        # Nodes at which q̇ and q̈ are given, by order.
        first = len(t) * np.arange(copies)
        self._resting: list[Ints] = []
        for order in (1, 2):
            resting = [rest >= order for rest in formulation.problem.rest_orders]
            ends = np.array([0, len(t) - 1])[np.array(resting)]
            self._resting.append((ends + first[:, None]).ravel())
        each = np.arange(r)
        held: list[Ints] = [] if free else [each]
        for order, nodes in enumerate(self._resting, 1):
            held.append((3 * r * nodes[:, None] + order * r + each).ravel())
        counts_held = self.manifolds.held.sum(axis=1)
        for node in np.flatnonzero(counts_held).tolist():
            last = 3 * r * node + np.arange(r - counts_held[node], r)
            held += [last, last + r, last + 2 * r]
        self.held = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *held]))

    @property
    def t(self) -> Array:
        """Times of the nodes [s], (N + 1,)."""
        return self.spline.t

    def on(self, t: Array, *, smoothed: bool = False, quick: float | None = None) -> "NodeGrid":
        """Return the grid on other nodes, with `smoothed` and `quick` replaced if given."""
        found = self._other(t, smoothed=smoothed, quick=quick)
        found.rows = self.rows.on(found.spline)
        return found

    def without_rows(self) -> "NodeGrid":
        """Return the grid with conditions on its ends and rows of tolerances alone."""
        own = self.conditions
        limits = tuple(item for item in own.limits if is_tolerance(item))
        points = tuple(item for item in own.points if is_tolerance(item))
        return self.with_conditions(BoundConditions(limits, points, own.ends))

    def with_conditions(self, conditions: BoundConditions) -> "NodeGrid":
        """Return the grid with other conditions."""
        return self._other(self._times, conditions)

    def copied(self, copies: int) -> "NodeGrid":
        """Return the grid of `copies` motions, one after the other, for `Batch`.

        Of these, `NodeMotion` provides places, samples and costs alone.
        """
        return self._other(self._times, copies=copies)

    def _other(
        self,
        t: Array,
        conditions: BoundConditions | None = None,
        *,
        smoothed: bool = False,
        quick: float | None = None,
        copies: int | None = None,
    ) -> "NodeGrid":
        return NodeGrid(
            self.formulation,
            t,
            self.conditions if conditions is None else conditions,
            free=self.free,
            counts=self.counts,
            smoothed=smoothed or self.smoothed,
            quick=self.quick if quick is None else quick,
            copies=copies,
        )

    def near(self, q: Array, qd: Array, qdd: Array | None = None) -> "NodeMotion | None":
        """Return the motion whose nodes are those nearest to q (N + 1, n) at q̇ and q̈.

        By default q̈ follows from differences of q and q̇. None where a node cannot be put onto its
        manifold.
        """
        if qdd is None:
            qdd = hermite_accelerations(self.spline, len(self._times), q, qd)
        found = self.manifolds.near(q, self.rested(qd, 1), self.rested(qdd, 2))
        return None if found is None else self.at(found)

    def around(self, charts: Charts, qd: Array, qdd: Array) -> "NodeMotion | None":
        """Return the motion at z = 0 of charts whose rates are nearest to q̇ and q̈, or None."""
        if self.manifolds.holds:
            q = np.where(self.manifolds.held, 0.0, charts.q)
            charts = replace(charts, q=q, bases=self.manifolds.with_held_last(q, charts.bases))
        none = np.zeros((len(qd), charts.bases.shape[2]))
        found = charts.centred(none, self.rested(qd, 1), self.rested(qdd, 2))
        return None if found is None else self.at(found)

    def rested(self, rates: Array, order: int) -> Array:
        """Return rates with those of resting ends and of held joints set to 0."""
        own = self.manifolds
        found = np.where(own.held, 0.0, rates) if own.holds else rates.copy()
        found[self._resting[order - 1]] = 0.0
        return found

    def motion_towards(
        self, start: Array, wanted: Array, time: float | None = None
    ) -> "NodeMotion | None":
        """Return a motion from a start (n,) whose self-motion goes towards `wanted` (n,).

        It arrives, as far as the path allows, after about `time` [s]; by default at the end, from
        rest to rest. None where the path cannot be followed.
        """
        own = self.manifolds
        q = np.empty((len(self.t), len(start)))
        if time is None:
            # The remaining distance falls as a motion of minimum jerk.
            u = 1.0 - self.t / self.t[-1]
            left = u**3 * (10.0 + u * (6.0 * u - 15.0))
            share = np.append(0.0, 1.0 - left[1:] / left[:-1])
        else:
            share = np.minimum(np.append(0.0, np.diff(self.t)) / time, 1.0)
        # Copies: of read-only arrays numba would compile another kernel.
        ends = np.array(start), np.array(wanted)
        if follow(*ends, share, own.targets, own.chains, own.layout, own.held, q) >= 0:
            return None
        qd = np.asarray(np.gradient(q, self.t, axis=0))
        return self.near(q, qd, np.asarray(np.gradient(qd, self.t, axis=0)))

    def at(self, found: Centred) -> "NodeMotion":
        """Return the motion of nodes at the reference of their charts."""
        return NodeMotion(self, *found)


@dataclass(frozen=True, eq=False)
class NodeMotion:
    """A motion given by its nodes.

    Attributes
    ----------
    grid : NodeGrid
    charts : Charts
    nu, alpha : (N + 1, r)
        Null motions and null accelerations there.
    place : Place
    """

    grid: NodeGrid
    charts: Charts
    nu: Array
    alpha: Array
    place: Place

    @cached_property
    def curve_ends(self) -> Array:
        """Y of each interval, (N, 6, n); see `Quintic`."""
        return self.grid.spline.ends(self.place.nodes)

    @cached_property
    def sampled(self) -> SampledMotion:
        """The motion at the Gauss points."""
        grid = self.grid
        every = CurveSamples(grid.manifolds.follows, grid.spline.sampling, partial(_at_gauss, self))
        return sampled(grid.formulation, every)

    @cached_property
    def checked(self) -> SampledMotion:
        """The motion at the collocation points, as constraints see it that are no limits."""
        grid = self.grid
        at = partial(grid.spline.at_points, ends=self.curve_ends)
        every = CurveSamples(grid.manifolds.follows, grid.spline.points, at)
        return sampled(grid.formulation, every)

    @cached_property
    def quadratic(self) -> Quadratic:
        """What is quadratic in the ends of the intervals."""
        return self.grid.cost.quadratic.at(self.curve_ends)

    @cached_property
    def cost(self) -> float:
        """F."""
        self.grid.counts.evaluated()
        total = float(self.quadratic.costs.sum())
        if self.grid.cost.is_quadratic:
            return total
        return total + float(self.grid.cost.bent(self.sampled).sum())

    @cached_property
    def objective(self) -> float:
        """Objective of the optimisation: F and the smoothing."""
        return self.cost + float(self.quadratic.smoothing.sum())

    @cached_property
    def partials(self) -> Partials:
        """Derivatives of the integrands at the samples, of costs that are not quadratic."""
        cost = self.grid.cost
        return Partials() if cost.is_quadratic else cost.partials(self.sampled)

    @cached_property
    def h(self) -> Array:
        """Residuals of all rows, (R,); half of each tolerance is used; see `NodeRows`."""
        return self.grid.rows.residuals(lambda: self.checked, self.curve_ends)

    @cached_property
    def c(self) -> Array:
        """Residuals of the conditions at the ends, (E,)."""
        return self.grid.ends.residuals(self.place.nodes)

    @cached_property
    def elsewhere(self) -> dict[str, float]:
        """Distance of ends from their prescribed configurations where `c` is 0; see `NodeEnds`."""
        return self.grid.ends.elsewhere(self.place.nodes)

    @cached_property
    def violation(self) -> float:
        """Largest excess of a row over its tolerance [units of h]; 0 where all are satisfied."""
        return float(np.max(self.h - self.grid.rows.granted, initial=0.0))

    @cached_property
    def trajectory(self) -> Trajectory:
        """The motion itself: the quintic through the nodes."""
        place, names = self.place, self.grid.formulation.coordinates.names
        q, qd, qdd = (read_only(x) for x in (place.q, place.qd, place.qdd))
        return Trajectory(self.grid.t, q, qd, names, qdd)


def hermite_accelerations(spline: Quintic, size: int, q: Array, qd: Array) -> Array:
    """Return q̈ at the nodes (N + 1, n): means of those of the Hermite cubics on both sides.

    Of motions of `size` nodes each, one after the other.
    """
    h = spline.steps[:, None]
    rise, first, second = (q[1:] - q[:-1]) / h, qd[:-1], qd[1:]
    left = (6.0 * rise - 4.0 * first - 2.0 * second) / h
    right = (-6.0 * rise + 2.0 * first + 4.0 * second) / h
    after, before = np.concatenate([left, left[-1:]]), np.concatenate([right[:1], right])
    mean = 0.5 * (before + after)
    mean[::size], mean[size - 1 :: size] = after[::size], before[size - 1 :: size]
    return np.asarray(mean)


def terms_of(motion: NodeMotion) -> dict[str, float]:
    """Return the contribution of each cost."""
    return motion.grid.cost.terms(motion.sampled.arm)


def slopes_of(motion: NodeMotion) -> Array:
    """Return the derivatives of each interval's objective by its ends y, (N, 6, n)."""
    cost, found = motion.grid.cost, motion.quadratic.slopes
    if cost.is_quadratic:
        return found
    pushes = cost.bent_slopes(motion.sampled, motion.partials)
    found = found.copy()
    found[:, :, : pushes.shape[2]] += pushes
    return found


def centred(motion: NodeMotion) -> Centred:
    """Return the nodes at the reference of their charts."""
    return Centred(motion.charts, motion.nu, motion.alpha, motion.place)


def _at_gauss(motion: NodeMotion, order: int) -> Array:
    n = motion.place.q.shape[1]
    return motion.grid.spline.at(AT_GAUSS, order, motion.curve_ends).reshape(-1, n)


def breaks_hard(motion: NodeMotion, most: float = 0.0) -> bool:
    """Whether a row that is none of a tolerance is violated by more than `most`."""
    rows = motion.grid.rows
    beyond = rows.split(motion.h - rows.granted)
    return any(
        not np.max(own, initial=0.0) <= most
        for each, own in zip(rows.families, beyond, strict=True)
        if not is_tolerance(each.item)
    )


def may_be_smoothed(motion: NodeMotion) -> bool:
    """Whether q̈ may be penalised everywhere, see `smoothing_of`."""
    return can_be_smoothed(motion.grid.formulation, motion.sampled.arm, motion.cost)


def quickness_of(motion: NodeMotion) -> float:
    """Share of the usual time in which it should start and stop, see `quickness`."""
    return quickness(motion.grid.formulation, motion.sampled.arm, motion.cost, motion.grid.quick)


def null_motion_of(motion: NodeMotion) -> Array:
    """Return the null motion ε = N0 ν at the nodes, (N + 1, n)."""
    return motion.charts.spread(motion.nu)


def stepped(motion: NodeMotion, step: Array) -> "NodeMotion | None":
    """Return the motion at a step (N + 1, 3r) of scaled coordinates; None where it is none.

    Each node on its own: rates do as the coordinates say, whatever the nodes beside it do.
    """
    r = motion.nu.shape[1]
    z, nu, alpha = np.split(step * motion.grid.scale, [r, 2 * r], axis=1)
    epsilon, a = motion.charts.spread(motion.nu + nu), motion.charts.spread(motion.alpha + alpha)
    found = motion.charts.centred(z, epsilon, a)
    return None if found is None else motion.grid.at(found)


def moved_along(motion: NodeMotion, step: Array, changes: Array) -> "NodeMotion | None":
    """Return the motion next to where a step leads to first order; None where it is none.

    A step (N + 1, 3r) moves the curve by `changes` (N + 1, 3, n, 3r) times it, which is what
    linear rows know; from there it comes onto the path by a correction c(t) that is smooth in
    time. Rates take its derivatives along: where each node's rates were their own, they would
    contradict the places of those beside it, by the step squared, and the jerk between nodes
    that are near to each other would be that over the square of the time between them.
    """
    grid, nodes, r = motion.grid, motion.place.nodes, motion.nu.shape[1]
    count, size = step.shape
    moved = (changes.reshape(count, -1, size) @ step[:, :, None]).reshape(nodes.shape)
    line, z = nodes + moved, step[:, :r] * grid.scale[:r]
    q = motion.charts.places(z)
    if q is None:
        return None
    rate, bend = grid.spline.differences(q - line[:, 0])
    qd, qdd = grid.rested(line[:, 1] + rate, 1), grid.rested(line[:, 2] + bend, 2)
    found = replace(motion.charts, q=q).centred(np.zeros_like(z), qd, qdd)
    return None if found is None else grid.at(found)


def subdivisions(motion: NodeMotion) -> Ints:
    """Return into how many parts intervals have to be divided, (N,); see `NodeRows`."""
    grid = motion.grid
    curve = sampled_curve(grid.formulation, grid.spline, motion.curve_ends)
    return parts_wanted(grid.rows, curve)


def broken_intervals(motion: NodeMotion) -> Flags:
    """Return on which intervals something is broken between the points, or nearly so, (N,)."""
    return np.asarray(subdivisions(motion) > 1)


def forget(motion: NodeMotion) -> None:
    """Drop cached values."""
    for name in ("sampled", "checked", "quadratic", "partials", "h", "curve_ends"):
        motion.__dict__.pop(name, None)


def on_grid(motion: NodeMotion, grid: NodeGrid) -> "NodeMotion | None":
    """Return the motion on other nodes."""
    curve = motion.trajectory
    q, qd, qdd = (curve(grid.t, order) for order in range(3))
    # Approximate bases suffice as a start, and rotate like the ones around.
    last = np.searchsorted(motion.grid.t, grid.t, side="right") - 1
    return grid.around(Charts(grid.manifolds, q, motion.charts.bases[last]), qd, qdd)
