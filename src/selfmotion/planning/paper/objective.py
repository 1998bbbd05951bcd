"""From the decision vector to the cost and its gradient: the only place with the chain rule."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from selfmotion.basics import Array, BreakdownError, Counts, ProblemError
from selfmotion.model.motion import Evaluation, Grid, NullMotion, NullMotionTable, Trajectory
from selfmotion.planning.formulation import (
    Formulation,
    require_finite,
    require_finite_values,
)
from selfmotion.planning.rollout import (
    FixedStart,
    FreeStart,
    MinimumNormMotion,
    Rollout,
    Start,
    brought_to_rest,
)
from selfmotion.problem.constraints import BoundConstraint, NodeTangents, linearised, violated
from selfmotion.problem.costs import ERROR, Cost, Samples

# Samples in one chunk, which bounds memory.
_CHUNK = 4096


class _CostIntegrals:
    """∫ Σ G dt over the motions on a grid.

    Parameters
    ----------
    costs : sequence of Cost
        The integrands G.
    grid : Grid
    """

    def __init__(self, costs: Sequence[Cost], grid: Grid) -> None:
        self._costs, self._grid = tuple(costs), grid
        self.names = tuple(cost.name for cost in costs)

    def values(self, samples: Samples) -> dict[str, float]:
        """Return the integral of each cost."""
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in self._costs}

    def cotangents(self, samples: Samples) -> tuple[Array, Array, Array]:
        """Return the derivatives of the sum with respect to q, q̇ and e at the stages.

        Raises
        ------
        ProblemError
            One of them is not finite.
        """
        sampling = self._grid.sampling
        by_q, by_qd = np.zeros_like(samples.q), np.zeros_like(samples.qd)
        by_error = np.zeros_like(samples.error)
        weights, nodes = samples.weights[:, None], sampling.nodes
        for cost in self._costs:
            partials = cost.gradient(samples)
            for total, part in (
                (by_q, partials.q),
                (by_qd, partials.qd),
                (by_error, partials.error),
            ):
                if part is not None:
                    require_finite(cost, "gradient", part, samples.t)
                    total += weights * part
            for order, part in ((1, partials.qdd), (2, partials.qddd)):
                if part is not None:
                    require_finite(cost, "gradient", part, samples.t)
                    by_qd[nodes] += sampling.differentiation(order).T @ (weights * part)
        return by_q, by_qd, by_error

    def curvature(self, by_q: Array, by_qd: Array, by_error: Callable[[], Array]) -> Array:
        """Return ∫ Σ_k (∂q^(k)/∂x)ᵀ W_k (∂q^(k)/∂x) dt, (size, size).

        Over the derivatives q^(k) of q that the costs weigh (that of ½ q̇ᵀq̇ where none does), and
        likewise over the pose error.

        Parameters
        ----------
        by_q, by_qd : (S, n, size)
            ∂q/∂x and ∂q̇/∂x at the stages.
        by_error : callable
            Returns that of the pose error, (S, m, size); called if a cost weighs it.
        """
        (stages, n, size), sampling = by_q.shape, self._grid.sampling
        curvatures = [cost.curvature(n) for cost in self._costs]
        if not any(curvatures):
            curvatures = [{1: np.eye(n)}]
        found = np.zeros((size, size))
        nodes = by_qd[sampling.nodes].reshape(len(sampling.nodes), -1)
        for curvature in curvatures:
            for order, weight in curvature.items():
                table = by_error() if order == ERROR else by_q if order == 0 else by_qd
                for first in range(0, stages, _CHUNK):
                    chunk = slice(first, first + _CHUNK)
                    tangent = table[chunk]
                    if order > 1:
                        operator = sampling.differentiation(order - 1)[chunk]
                        tangent = (operator @ nodes).reshape(tangent.shape)
                    found += _weighted(tangent, weight, sampling.weights[chunk])
        return found


def _weighted(tangent: Array, weight: Array, times: Array) -> Array:
    """Return Σ times tangentᵀ W tangent over samples, (size, size)."""
    flat = tangent.shape[0] * tangent.shape[1], tangent.shape[2]
    # Near singular poses tangents may overflow: see `inverse_metric`.
    with np.errstate(over="ignore", invalid="ignore"):
        weighted = times[:, None, None] * (weight @ tangent)
        return np.asarray(tangent.reshape(flat).T @ weighted.reshape(flat))


class Objective:
    """F = ∫ Σ G(q̇, q, t) dt along the motion of a decision vector, and residuals of its ends.

    The decision vector is [z | x]: where the start is on its self-motion manifold (nothing if it is
    given), and the null motion's coefficients.

    Parameters
    ----------
    rollout : Rollout
        The engine; its grid is that of the null motion.
    null_motion : NullMotionTable
        x → ε at the stages.
    costs : sequence of Cost
    start : Start
        z → q(0).
    ends : sequence of BoundConstraint
        Equalities on the ends of the motion: c(x) = 0.
    counts : Counts
        Where work is added up.

    Raises
    ------
    ProblemError
        One of the ends is no equality.
    """

    def __init__(
        self,
        rollout: Rollout,
        null_motion: NullMotionTable,
        costs: Sequence[Cost],
        start: Start,
        ends: Sequence[BoundConstraint],
        counts: Counts,
    ) -> None:
        for item in ends:
            if not item.equality:
                raise ProblemError(
                    f"constraint '{item.name}' is none on the ends: no limits are kept here"
                )
        self.rollout, self.null_motion, self.start = rollout, null_motion, start
        self.ends, self.counts = tuple(ends), counts
        self._all_costs, self._costs = tuple(costs), _CostIntegrals(costs, rollout.grid)
        self._at: Array | None = None
        # Cached ∂q/∂x and ∂q̇/∂x, gradient and evaluation.
        self._tangents: tuple[Array, Array] | None = None
        self._gradient: Array | None = None
        self._evaluation: Evaluation | None = None
        self._terms: dict[str, float] = {}
        self._first = rollout.first_target
        # Which of the first and the last node neither move nor accelerate.
        self._minimum_norm_ends: list[int] = []
        # Whether the rollout holds the motion of x = 0.
        self._is_rolled = False
        # When the last motion broke down [s].
        self._broken: float | None = None

    @classmethod
    def of(
        cls,
        formulation: Formulation,
        minimum_norm: MinimumNormMotion,
        *,
        grid: Grid | None = None,
        free: bool = False,
        ends: Sequence[BoundConstraint] = (),
        counts: Counts | None = None,
        null_motion: NullMotion | None = None,
        around: Array | None = None,
        rollout: Rollout | None = None,
    ) -> "Objective":
        """Return the objective of a problem around its motion at x = 0.

        Parameters
        ----------
        formulation : Formulation
        minimum_norm : MinimumNormMotion
            The motion at x = 0: its start, and the basis of the null motion, are those of x.
        grid : Grid, optional
            By default that of the minimum-norm motion.
        free : bool
            Whether the start may move along its self-motion.
        ends : sequence of BoundConstraint
            Conditions on the ends.
        counts : Counts, optional
        null_motion : NullMotion, optional
            By default that of the formulation.
        around : (S, n), optional
            The null motion of x = 0; by default that of the minimum-norm motion.
        rollout : Rollout, optional
            That of the minimum-norm motion, on this grid, handed over; by default a new one.
        """
        follows, grid = formulation.follows, grid or minimum_norm.grid
        t = grid.stage_times
        start: Start = (
            FreeStart(follows, minimum_norm.start) if free else FixedStart(minimum_norm.start)
        )
        found = cls(
            rollout or Rollout(follows, grid, damping=formulation.problem.damping_law),
            _null_motion_table(
                formulation, t, minimum_norm, null_motion or formulation.problem.null_motion, around
            ),
            formulation.costs,
            start,
            ends,
            Counts() if counts is None else counts,
        )
        if formulation.problem.damping_law is None:
            orders = zip((0, -1), formulation.problem.rest_orders, strict=True)
            found._minimum_norm_ends = [end for end, order in orders if order > 1]
        found._is_rolled = rollout is not None and not start.size
        return found

    @property
    def grid(self) -> Grid:
        """The grid that motions are integrated on."""
        return self.rollout.grid

    @property
    def size(self) -> int:
        """Number of decision variables."""
        return self.start.size + self.null_motion.size

    @property
    def evaluations(self) -> int:
        """Number of evaluations of F, by all with the same counters."""
        return self.counts.evaluations

    def value(self, x: Array) -> float:
        """Return the cost at x; infinite where the motion breaks down."""
        _run(self, x)
        return total if np.isfinite(total := sum(self._terms.values())) else np.inf

    def gradient(self, x: Array) -> Array:
        """Return the gradient of `value` at x, (size,).

        Exact for the discretised motion; NaN where it breaks down.
        """
        _run(self, x)
        if self._gradient is None:
            self.counts.gradients += 1
            self._gradient = _pulled_back(self, x)
        return self._gradient.copy()

    def slope(self, x: Array, direction: Array) -> float:
        """Return the derivative of `value` at x along `direction`."""
        return float(self.gradient(x) @ direction)

    def terms(self, x: Array) -> dict[str, float]:
        """Return the contribution of each cost to F at x."""
        _run(self, x)
        return dict(self._terms)

    def samples(self, x: Array) -> Samples:
        """Return the motion of x at the stages; its arrays are those of the next run, too."""
        _run(self, x)
        return self.rollout.samples()

    def at(self, x: Array) -> Evaluation:
        """Return the motion of x with its costs."""
        _run(self, x)
        if self._evaluation is None:
            before = self.rollout.jacobian_evaluations
            t, q, qd = self.rollout.polished()
            names = self.rollout.follows.coordinates.names
            qdd = self.grid.derivative(qd)
            # Where the arm comes to rest smoothly that is so by construction; differences are not.
            qdd[self._minimum_norm_ends] = 0.0
            trajectory = Trajectory(t, q, qd, names, qdd)
            self.counts.jacobians += self.rollout.jacobian_evaluations - before
            terms = dict(self._terms)
            self._evaluation = Evaluation(x.copy(), terms, trajectory, self.rollout.damped)
        return self._evaluation

    def metric(self, x: Array) -> Array:
        """Return the Gauss-Newton matrix of quadratic costs, (size, size).

        ∫ Σ_k (∂q^(k)/∂x)ᵀ W_k (∂q^(k)/∂x) dt over the derivatives q^(k) of q that the costs weigh
        (that of ½ q̇ᵀq̇ where none does), and likewise over the pose error. Its inverse starts the
        quasi-Newton method.
        """
        by_q, by_qd = _sensitivities(self, x)
        return self._costs.curvature(by_q, by_qd, lambda: _error_tangent(self, by_q))


def parts_of(objective: Objective, x: Array) -> tuple[Array, Array]:
    """Return the parts of a decision vector: z of the start, and the null motion's coefficients."""
    return x[: objective.start.size], x[objective.start.size :]


def _pulled_back(objective: Objective, x: Array) -> Array:
    if not np.isfinite(objective.value(x)):
        return np.full(objective.size, np.nan)
    by_epsilon, by_start = objective.rollout.pullback(
        *objective._costs.cotangents(objective.rollout.samples())
    )
    return np.concatenate(
        [by_start @ objective.start.tangent(), objective.null_motion.pullback(by_epsilon)]
    )


def require_finite_at(objective: Objective, x: Array) -> None:
    """Raise an error that says why and when F is not finite at x, where it is not.

    Raises
    ------
    BreakdownError
        Its motion breaks down.
    ProblemError
        A cost has no finite value.
    """
    samples = objective.samples(x)
    broken = objective._broken
    if broken is not None:
        raise BreakdownError(
            f"{objective.rollout.robot.name}: eq. 4 breaks down near t = {broken:.4g} s, where "
            f"the tool reaches a singular pose",
            time=broken,
        )
    require_finite_values(objective._all_costs, samples)


def residuals(objective: Objective, x: Array) -> Array:
    """Return c at x of E conditions on the ends, (E,): 0 where they are met."""
    samples = objective.samples(x)
    return np.concatenate(
        [np.zeros(0), *(item.residual(samples).ravel() for item in objective.ends)]
    )


def residual_tangents(objective: Objective, x: Array) -> Array:
    """Return ∂c/∂x at x, (E, size)."""
    motion, samples, rows = (
        node_tangents(objective, x),
        objective.samples(x),
        [np.zeros((0, objective.size))],
    )
    for item in objective.ends:
        known = linearised(item, samples, motion)
        rows.append(known.picked(motion, np.arange(known.count)))
    return np.concatenate(rows)


def unmet(objective: Objective, x: Array) -> tuple[str, ...]:
    """Return the violated conditions on ends at x, in words."""
    samples = objective.samples(x)
    return violated((item, samples) for item in objective.ends)


def node_tangents(objective: Objective, x: Array) -> NodeTangents:
    """Return the derivatives of the motion at the nodes by the decision vector, at x."""
    by_q, by_qd = _sensitivities(objective, x)
    sampling = objective.grid.sampling
    return NodeTangents(by_q[sampling.nodes], by_qd[sampling.nodes], sampling)


def _error_tangent(objective: Objective, by_q: Array) -> Array:
    """Return ∂(S e)/∂x = -J ∂q/∂x, (S, m, size).

    Nothing on the path, where the self-motion does not move the tool.
    """
    return np.asarray(-(objective.rollout.samples().task_jacobian @ by_q))


def _run(objective: Objective, x: Array) -> None:
    """Make x the motion that the rollout holds."""
    if objective._at is not None and np.array_equal(objective._at, x):
        return
    objective.counts.evaluated()
    # An interruption must not leave half a motion as that of x.
    objective._at = objective._tangents = objective._gradient = objective._evaluation = None
    objective._terms = dict.fromkeys(objective._costs.names, np.inf)
    before = objective.rollout.jacobian_evaluations
    try:
        _evaluate(objective, x)
    finally:
        objective.counts.jacobians += objective.rollout.jacobian_evaluations - before
    objective._at = x.copy()


def _evaluate(objective: Objective, x: Array) -> None:
    z, coefficients = parts_of(objective, x)
    start = objective.start.configuration(z, objective._first)
    objective._broken = 0.0 if start is None else None
    if start is None:
        return
    is_rolled, objective._is_rolled = objective._is_rolled and not x.any(), False
    if not is_rolled:
        objective._broken = objective.rollout.run(
            start, objective.null_motion.epsilon(coefficients)
        )
    if objective._broken is not None:
        return
    objective._terms = objective._costs.values(objective.rollout.samples())


def _sensitivities(objective: Objective, x: Array) -> tuple[Array, Array]:
    """Return ∂q/∂[z | x] and ∂q̇/∂[z | x] at the stages, (S, n, size)."""
    _run(objective, x)
    if objective._tangents is not None:
        return objective._tangents
    first = objective.start.size
    epsilon_matrix = objective.null_motion.matrix(first)
    start_matrix = np.zeros((epsilon_matrix.shape[1], objective.size))
    start_matrix[:, :first] = objective.start.tangent()
    objective._tangents = objective.rollout.sensitivities(epsilon_matrix, start_matrix)
    return objective._tangents


def _null_motion_table(
    formulation: Formulation,
    t: Array,
    minimum_norm: MinimumNormMotion,
    motion: NullMotion,
    around: Array | None,
) -> NullMotionTable:
    """Return a null motion at times t (S,), in the basis of a motion at x = 0.

    Around (S, n) is the null motion of x = 0, by default the guide's.
    """
    n = formulation.follows.dof
    redundancy = n - formulation.follows.dimension
    if around is None:
        guide = minimum_norm.guide
        around = (
            np.zeros((len(t), n)) if guide is None else brought_to_rest(formulation, t, guide(t))
        )
    # Of an arm without redundancy no null motion acts.
    is_joint = motion.space == "joint" and redundancy > 0
    frame, rows = (None, n) if is_joint else (partial(minimum_norm.frame, t), redundancy)
    orders = formulation.problem.rest_orders
    functions = motion.resting(t, formulation.path.duration, orders)
    return NullMotionTable(functions, frame, rows, around)
