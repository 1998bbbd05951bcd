"""From the decision vector to the cost and its gradient: the only place with the chain rule."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.constraints import BoundConstraint, NodeTangents
from selfmotion.costs import ERROR, Cost, Samples
from selfmotion.engine.conditions import Conditions
from selfmotion.engine.counts import Counts
from selfmotion.engine.deviation import Deviation
from selfmotion.engine.rollout import Rollout
from selfmotion.engine.start import FixedStart, FreeStart, Start
from selfmotion.engine.still import StillMotion, deviation_of
from selfmotion.motion import Grid, NullMotion, NullMotionTable, Trajectory
from selfmotion.optimise import Residuals, Rows
from selfmotion.problem import Problem

# Samples whose tangents are weighed together.
_LOT = 4096


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A motion of the objective, on its own: nothing done later changes it.

    Attributes
    ----------
    x : (size,)
        The decision vector.
    terms : dict
        What each cost contributes to F.
    trajectory : Trajectory
        Its nodes put onto the path, unless damped.
    damped : bool
        Whether the inverse was damped anywhere.
    """

    x: Array
    terms: dict[str, float]
    trajectory: Trajectory
    damped: bool

    @property
    def cost(self) -> float:
        """F."""
        return sum(self.terms.values())


class Objective:
    """F = ∫ Σ G(q̇, q, t) dt along the motion of a decision vector, and the conditions on it.

    The decision vector is [z | x | c]: where the start is on its self-motion manifold (nothing for
    a given start), the null motion's coefficients, and those of the tool's deviation from the path
    (nothing where no row is relaxed). Made by `Objective.of`.

    Parameters
    ----------
    rollout : Rollout
        The engine; its grid is that of the null motion.
    null_motion : NullMotionTable
        x → ε at the stages.
    costs : sequence of Cost
    start : Start
        z → q(0).
    deviation : Deviation
        c → the poses and twists that the tool follows.
    constraints : Conditions
    counts : Counts
        Where work is added up.
    """

    def __init__(
        self,
        rollout: Rollout,
        null_motion: NullMotionTable,
        costs: Sequence[Cost],
        start: Start,
        deviation: Deviation,
        constraints: Conditions,
        counts: Counts,
    ) -> None:
        self.rollout, self.null_motion, self.start = rollout, null_motion, start
        self.constraints, self.counts = constraints, counts
        self._deviation = deviation
        self._costs = tuple(costs)
        self._at: Array | None = None
        # ∂q/∂x and ∂q̇/∂x there, once they were asked for.
        self._tangents: tuple[Array, Array] | None = None
        self._terms: dict[str, float] = {}
        self._first = rollout.first_target

    @classmethod
    def of(
        cls,
        problem: Problem,
        still: StillMotion,
        *,
        grid: Grid | None = None,
        free: bool = False,
        constraints: Sequence[BoundConstraint] = (),
        counts: Counts | None = None,
        null_motion: NullMotion | None = None,
        around: Array | None = None,
        rollout: Rollout | None = None,
    ) -> "Objective":
        """Return the objective of a problem around its motion at x = 0.

        Parameters
        ----------
        problem : Problem
        still : StillMotion
            The motion at x = 0: its start, and the basis of the null motion, are those of x.
        grid : Grid, optional
            By default that of `still`.
        free : bool
            Whether the start may move along its self-motion.
        constraints : sequence of BoundConstraint
            Those that count.
        counts : Counts, optional
        null_motion : NullMotion, optional
            By default that of the problem.
        around : (S, n), optional
            The null motion of x = 0; by default that of `still`.
        rollout : Rollout, optional
            One on this grid that nobody else uses any more; by default a new one.
        """
        follows, grid = problem.follows, grid or still.grid
        t = grid.stage_times
        motion = null_motion or problem.null_motion
        frame = still.frame(t, motion.space)
        if around is None and still.guide is not None:
            around = problem.brought_to_rest(t, still.guide(t))
        table = NullMotionTable(
            problem.null_functions(t, motion),
            frame,
            problem.robot.dof if frame is None else frame.shape[2],
            around,
        )
        start: Start = FreeStart(follows, still.start) if free else FixedStart(still.start)
        return cls(
            rollout or Rollout(follows, grid, damping=problem.damping_law),
            table,
            problem.all_costs,
            start,
            deviation_of(problem, t, still.deviation),
            Conditions(constraints, grid),
            Counts() if counts is None else counts,
        )

    @property
    def grid(self) -> Grid:
        """The grid that motions are integrated on."""
        return self.rollout.grid

    @property
    def size(self) -> int:
        """Number of decision variables."""
        return self.start.size + self.null_motion.size + self._deviation.size

    @property
    def evaluations(self) -> int:
        """How often F was computed, by all that add to the same counts."""
        return self.counts.evaluations

    def parts(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the parts z, x and c of the decision vector."""
        first = self.start.size
        last = first + self.null_motion.size
        return x[:first], x[first:last], x[last:]

    def value(self, x: Array) -> float:
        """Return the cost at x; infinite where the motion breaks down."""
        self._run(x)
        total = sum(self._terms.values())
        return total if np.isfinite(total) else np.inf

    def gradient(self, x: Array) -> Array:
        """Return the gradient of `value` at x, (size,).

        Exact for the discretised motion; NaN where it breaks down.
        """
        self._run(x)
        self.counts.gradients += 1
        if not np.isfinite(sum(self._terms.values())):
            return np.full(self.size, np.nan)
        by_epsilon, by_start, by_target = self.rollout.pullback(*self._cotangents())
        by_z, by_pose = self.start.tangent()
        parts = [by_start @ by_z, self.null_motion.pullback(by_epsilon)]
        if self._deviation.size:
            target, own = self._deviation.matrix(self.parts(x)[2]), by_target[:, :12]
            own[0, :6] += by_start @ by_pose[:, :6]
            parts.append(np.tensordot(own, target, 2))
        return np.concatenate(parts)

    def require_finite(self, x: Array) -> None:
        """Raise ProblemError where a cost or a condition has no finite value at x; says when."""
        samples = self.samples(x)
        if not np.all(np.isfinite(samples.q)):
            return
        for cost in self._costs:
            self._require_finite(f"cost '{cost.name}'", "value", np.asarray(cost.value(samples)))
        for item in self.constraints.constraints:
            h = item.residual(samples)
            if not np.all(np.isfinite(h)):
                raise ProblemError(
                    f"constraint '{item.name}': its residual is not finite on the motion at the "
                    f"start; expected numbers wherever the arm may be"
                )

    def _require_finite(self, what: str, which: str, table: Array) -> None:
        bad = ~np.isfinite(table)
        if bad.any():
            row = int(np.argmax(bad.reshape(len(bad), -1).any(axis=1)))
            raise ProblemError(
                f"{what}: its {which} is {table[row]} at t = {self.grid.stage_times[row]:.6g} s, "
                f"expected finite numbers; selfmotion.testing.check_cost checks a cost"
            )

    def slope(self, x: Array, direction: Array) -> float:
        """Return the derivative of `value` at x along `direction`."""
        return float(self.gradient(x) @ direction)

    def terms(self, x: Array) -> dict[str, float]:
        """Return what each cost contributes to F at x."""
        self._run(x)
        return dict(self._terms)

    def samples(self, x: Array) -> Samples:
        """Return the motion of x at the stages; its arrays are those of the next run, too."""
        self._run(x)
        return self.rollout.samples()

    def at(self, x: Array) -> Evaluation:
        """Return the motion of x with all that is known of it."""
        self._run(x)
        before = self.rollout.jacobian_evaluations
        t, q, qd = self.rollout.polished()
        names = self.rollout.robot.joint_names
        trajectory = Trajectory(t, q, qd, names, self.grid.derivative(qd))
        self.counts.jacobians += self.rollout.jacobian_evaluations - before
        return Evaluation(x.copy(), dict(self._terms), trajectory, self.rollout.damped)

    def violations(self, x: Array) -> tuple[str, ...]:
        """Return what is wrong for each constraint that is not kept at x, on its worst place."""
        return self.constraints.violated(self.samples(x))

    def conditions(self, x: Array) -> Residuals:
        """Return h at x, which inequalities ask to be ≤ 0 and equalities to be 0."""
        return self.constraints.residuals(self.samples(x))

    def condition_rows(self, x: Array) -> Rows:
        """Return ∂h/∂x of all conditions at x; it stays what it is when others are looked at."""
        tangents = self.node_tangents(x)
        return self.constraints.rows(self.samples(x), tangents)

    def metric(self, x: Array) -> Array:
        """Return the Gauss-Newton matrix of quadratic costs, (size, size).

        ∫ Σ_k (∂q^(k)/∂x)ᵀ W_k (∂q^(k)/∂x) dt over the derivatives q^(k) of q that the costs weigh
        (that of ½ q̇ᵀq̇ where none does), and likewise over the pose error; and |∂F/∂c| for what
        keeps a deviation within its band. Its inverse starts the quasi-Newton method.
        """
        self._run(x)
        n, sampling = self.rollout.robot.dof, self.grid.sampling
        by_q, by_qd = self._sensitivities(x)
        curvatures = [cost.curvature(n) for cost in self._costs]
        if not any(curvatures):
            curvatures = [{1: np.eye(n)}]
        metric = np.zeros((self.size, self.size))
        nodes = by_qd[sampling.nodes].reshape(len(sampling.nodes), -1)
        for curvature in curvatures:
            for order, weight in curvature.items():
                error = self._error_tangent(x, by_q) if order == ERROR else None
                for first in range(0, len(by_q), _LOT):
                    lot = slice(first, first + _LOT)
                    if error is not None:
                        tangent = error[lot]
                    elif order > 1:
                        operator = sampling.differentiation(order - 1)
                        tangent = (operator[lot] @ nodes).reshape(by_qd[lot].shape)
                    else:
                        tangent = by_q[lot] if order == 0 else by_qd[lot]
                    metric += self._weighted(tangent, weight, sampling.weights[lot])
        if self._deviation.size:
            # sin s bends as much as it rises: without it, steps would go round many times.
            slope = np.abs(self.parts(self.gradient(x))[2]) * self._deviation.banded
            last = self.size - len(slope)
            metric[last:, last:] += np.diag(slope)
        return metric

    def _weighted(self, tangent: Array, weight: Array, times: Array) -> Array:
        """Return Σ times tangentᵀ W tangent over samples, (size, size)."""
        # Near singular poses tangents may be beyond all numbers: see `inverse_metric`.
        with np.errstate(over="ignore", invalid="ignore"):
            weighted = times[:, None, None] * (weight @ tangent)
            return np.asarray(tangent.reshape(-1, self.size).T @ weighted.reshape(-1, self.size))

    def node_tangents(self, x: Array) -> NodeTangents:
        """Return how the motion at the nodes changes with the decision vector, at x."""
        self._run(x)
        return self._at_nodes(*self._sensitivities(x))

    def _error_tangent(self, x: Array, by_q: Array) -> Array:
        """Return ∂(S e)/∂x = S ∂target/∂x - J ∂q/∂x, (S, m, size).

        Nothing on the path, where the self-motion does not move the tool.
        """
        samples = self.rollout.samples()
        tangent = -(samples.task_jacobian @ by_q)
        if self._deviation.size:
            c = self.parts(x)[2]
            moved = self._deviation.matrix(c)[:, :6]
            rows = samples.task.dimension
            tangent[:, :rows, -len(c) :] += samples.task.select_along(moved, samples.rotation)
        return np.asarray(tangent)

    def _at_nodes(self, by_q: Array, by_qd: Array) -> NodeTangents:
        sampling = self.grid.sampling
        here = sampling.nodes
        return NodeTangents(by_q[here], by_qd[here], sampling)

    def _run(self, x: Array) -> None:
        """Make x the motion that the rollout holds."""
        if self._at is not None and np.array_equal(self._at, x):
            return
        self.counts.evaluated()
        # An interruption on the way must not leave half a motion as that of x.
        self._at = self._tangents = None
        self._terms = {cost.name: np.inf for cost in self._costs}
        before = self.rollout.jacobian_evaluations
        try:
            self._evaluate(x)
        finally:
            self.counts.jacobians += self.rollout.jacobian_evaluations - before
        self._at = x.copy()

    def _evaluate(self, x: Array) -> None:
        z, coefficients, c = self.parts(x)
        first = self._first
        if self._deviation.size:
            self.rollout.aim(self._deviation.target(c))
            first = self.rollout.first_target
        start = self.start.configuration(z, first)
        if start is None:
            return
        if self.rollout.run(start, self.null_motion.epsilon(coefficients)) is not None:
            return
        samples = self.rollout.samples()
        for cost in self._costs:
            self._terms[cost.name] = float(samples.weights @ cost.value(samples))

    def _cotangents(self) -> tuple[Array, Array, Array]:
        """Return the derivatives of `value` with respect to q, q̇ and e at the stages."""
        samples, sampling = self.rollout.samples(), self.grid.sampling
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
                    self._require_finite(f"cost '{cost.name}'", "gradient", part)
                    total += weights * part
            for order, part in ((1, partials.qdd), (2, partials.qddd)):
                if part is not None:
                    self._require_finite(f"cost '{cost.name}'", "gradient", part)
                    by_qd[nodes] += sampling.differentiation(order).T @ (weights * part)
        return by_q, by_qd, by_error

    def _sensitivities(self, x: Array) -> tuple[Array, Array]:
        """Return ∂q/∂[z | x | c] and ∂q̇/∂[z | x | c] at the stages, (S, n, size)."""
        if self._tangents is None:
            self._tangents = self._differentiated(x)
        return self._tangents

    def _differentiated(self, x: Array) -> tuple[Array, Array]:
        first = self.start.size
        last = first + self.null_motion.size
        epsilon_matrix = self.null_motion.matrix(first, self.size - last)
        stages, n, _ = epsilon_matrix.shape
        start_matrix = np.zeros((n, self.size))
        start_matrix[:, :first], by_pose = self.start.tangent()
        if not self._deviation.size:
            return self.rollout.sensitivities(epsilon_matrix, start_matrix)
        # The first tip's path is the one that is relaxed.
        target_matrix = np.zeros((stages, 12 * len(self.rollout.follows.items), self.size))
        target_matrix[:, :12, last:] = self._deviation.matrix(x[last:])
        start_matrix[:, last:] = by_pose[:, :6] @ target_matrix[0, :6, last:]
        return self.rollout.sensitivities(epsilon_matrix, start_matrix, target_matrix)
