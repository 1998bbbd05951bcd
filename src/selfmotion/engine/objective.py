"""From the decision vector to the cost and its gradient: the only place with the chain rule."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array
from selfmotion.constraints import NodeTangents
from selfmotion.costs import Cost, Samples
from selfmotion.engine.augmented_lagrangian import AugmentedLagrangian
from selfmotion.engine.deviation import Deviation
from selfmotion.engine.rollout import Rollout
from selfmotion.engine.start import Start
from selfmotion.motion import NullMotionTable
from selfmotion.task import PATH_ERROR


class Objective:
    """F = ∫ Σ G(q̇, q, t) dt along the motion of a decision vector, plus its constraints' terms.

    The decision vector is [z | x | c]: where the start is on its self-motion manifold (nothing for
    a given start), the null motion's coefficients, and those of the tool's deviation from the path
    (nothing where no row is relaxed).

    Parameters
    ----------
    rollout : Rollout
        The engine; its grid is that of the null motion.
    null_motion : NullMotionTable
        x → ε at the stages.
    costs : sequence of Cost
    start : Start
        z → q(0).
    constraints : AugmentedLagrangian, optional
    deviation : Deviation, optional
        c → the poses and twists that the tool follows; without it those of the path.
    path_weight : float
        w of a further term ∫ ½ w |S e|² dt, e the pose error [m, rad]: for motions that damping
        takes off the path.

    Attributes
    ----------
    evaluations, gradient_evaluations : int
        How often F and ∇F were computed.
    """

    def __init__(
        self,
        rollout: Rollout,
        null_motion: NullMotionTable,
        costs: Sequence[Cost],
        start: Start,
        constraints: AugmentedLagrangian | None = None,
        deviation: Deviation | None = None,
        path_weight: float = 0.0,
    ) -> None:
        self.rollout, self.null_motion, self.start = rollout, null_motion, start
        self.constraints, self._deviation = constraints, deviation
        self._first_pose = rollout.path.pose(0.0)
        self._costs = tuple(costs)
        self._path_weight = path_weight
        self.evaluations = 0
        self.gradient_evaluations = 0
        self._at: Array | None = None
        self._terms: dict[str, float] = {}

    @property
    def size(self) -> int:
        """Number of decision variables."""
        deviation = 0 if self._deviation is None else self._deviation.size
        return self.start.size + self.null_motion.size + deviation

    def parts(self, x: Array) -> tuple[Array, Array, Array]:
        """Return the parts z, x and c of the decision vector."""
        first = self.start.size
        last = first + self.null_motion.size
        return x[:first], x[first:last], x[last:]

    def value(self, x: Array) -> float:
        """Return cost and constraints' terms at x; infinite where the motion breaks down."""
        self.run(x)
        total = sum(self._terms.values())
        if not np.isfinite(total):
            return np.inf
        if self.constraints is not None:
            total += self.constraints.value(self.rollout.samples())
        return total if np.isfinite(total) else np.inf

    def gradient(self, x: Array) -> Array:
        """Return the gradient of `value` at x, (size,).

        Exact for the discretised motion; NaN where it breaks down.
        """
        self.run(x)
        self.gradient_evaluations += 1
        if not np.isfinite(sum(self._terms.values())):
            return np.full(self.size, np.nan)
        by_epsilon, by_start, by_target = self.rollout.pullback(*self._cotangents())
        by_z, by_pose = self.start.tangent()
        parts = [by_start @ by_z, self.null_motion.pullback(by_epsilon)]
        if self._deviation is not None:
            target = self._deviation.matrix(self.parts(x)[2])
            by_target[0, :6] += by_start @ by_pose
            parts.append(np.tensordot(by_target, target, 2))
        return np.concatenate(parts)

    def slope(self, x: Array, direction: Array) -> float:
        """Return the derivative of `value` at x along `direction`."""
        return float(self.gradient(x) @ direction)

    def terms(self, x: Array) -> dict[str, float]:
        """Return what each cost contributes to F at x, without the constraints' terms."""
        self.run(x)
        return dict(self._terms)

    def metric(self, x: Array) -> Array:
        """Return the Gauss-Newton matrix of quadratic costs and active constraints, (size, size).

        ∫ Σ_k (∂q^(k)/∂x)ᵀ W_k (∂q^(k)/∂x) dt over the derivatives q^(k) of q that the costs weigh
        (that of ½ q̇ᵀq̇ where none does). Its inverse starts the quasi-Newton method.
        """
        self.run(x)
        n, grid = self.rollout.robot.dof, self.rollout.grid
        by_q, by_qd = self._sensitivities(x)
        curvatures = [cost.curvature(n) for cost in self._costs]
        if not any(curvatures):
            curvatures = [{1: np.eye(n)}]
        metric = np.zeros((self.size, self.size))
        nodes = by_qd[grid.node_stages].reshape(len(grid.nodes), -1)
        for curvature in curvatures:
            for order, weight in curvature.items():
                tangent = by_q if order == 0 else by_qd
                if order > 1:
                    tangent = (grid.differentiation(order - 1) @ nodes).reshape(by_qd.shape)
                weighted = grid.weights[:, None, None] * (weight @ tangent)
                metric += tangent.reshape(-1, self.size).T @ weighted.reshape(-1, self.size)
        if self._path_weight:
            # ∂(S e) = S ∂target - J ∂q: nothing on the path, where the self-motion does not move
            # the tool.
            samples = self.rollout.samples()
            miss = samples.task_jacobian @ by_q
            if self._deviation is not None:
                c = self.parts(x)[2]
                moved = self._deviation.matrix(c)[:, :6]
                miss[:, :, -len(c) :] -= _task_rows(samples, moved)
            miss = miss.reshape(-1, self.size)
            weights = np.repeat(self._path_weight * grid.weights, self.rollout.task.dimension)
            metric += (miss.T * weights) @ miss
        if self.constraints is not None:
            tangents = self._at_nodes(by_q, by_qd)
            metric += self.constraints.curvature(self.rollout.samples(), tangents)
        return metric

    def node_tangents(self, x: Array) -> NodeTangents:
        """Return how the motion at the nodes changes with the decision vector, at x."""
        self.run(x)
        return self._at_nodes(*self._sensitivities(x))

    def _at_nodes(self, by_q: Array, by_qd: Array) -> NodeTangents:
        grid = self.rollout.grid
        here = grid.node_stages
        nodes = by_qd[here]
        faster = grid.differentiation(1)[here] @ nodes.reshape(len(nodes), -1)
        return NodeTangents(by_q[here], nodes, faster.reshape(nodes.shape))

    def run(self, x: Array) -> None:
        """Make x the motion that the rollout holds."""
        if self._at is not None and np.array_equal(self._at, x):
            return
        self.evaluations += 1
        # An interruption on the way must not leave half a motion as that of x.
        self._at = None
        self._terms = {cost.name: np.inf for cost in self._costs}
        if self._path_weight:
            self._terms[PATH_ERROR] = np.inf
        self._evaluate(x)
        self._at = x.copy()

    def _evaluate(self, x: Array) -> None:
        z, coefficients, c = self.parts(x)
        pose = self._first_pose
        if self._deviation is not None:
            target = self._deviation.target(c)
            self.rollout.aim(target)
            pose = pin.SE3(target.rotation[0], target.translation[0])
        start = self.start.configuration(z, pose)
        if start is None:
            return
        epsilon = self.null_motion.epsilon(coefficients)
        if self.rollout.run(start, epsilon) is not None:
            return
        samples = self.rollout.samples()
        for cost in self._costs:
            self._terms[cost.name] = float(samples.weights @ cost.value(samples))
        if self._path_weight:
            square = np.sum(self._task_error() ** 2, axis=1)
            self._terms[PATH_ERROR] = float(samples.weights @ (0.5 * self._path_weight * square))

    def _task_error(self) -> Array:
        """Return the pose error at the stages with 0 in the rows that are free, (S, 6) [m, rad].

        Its length is that of S e also for `Task.POINTING`, whose error has no part about the tool's
        axis.
        """
        task = self.rollout.task
        counts = np.isin(np.arange(6), task.rows) | (task.tool_axes & (np.arange(6) >= 3))
        return np.where(counts, self.rollout.error, 0.0)

    def _cotangents(self) -> tuple[Array, Array, Array | None]:
        """Return the derivatives of `value` with respect to q, q̇ and e at the stages."""
        samples, grid = self.rollout.samples(), self.rollout.grid
        by_q, by_qd = np.zeros_like(samples.q), np.zeros_like(samples.qd)
        weights, nodes = samples.weights[:, None], grid.node_stages
        for cost in self._costs:
            partials = cost.gradient(samples)
            if partials.q is not None:
                by_q += weights * partials.q
            if partials.qd is not None:
                by_qd += weights * partials.qd
            for order, part in ((1, partials.qdd), (2, partials.qddd)):
                if part is not None:
                    by_qd[nodes] += grid.differentiation(order).T @ (weights * part)
        for condition in self.constraints.gradient(samples) if self.constraints else ():
            if condition.q is not None:
                by_q[nodes] += condition.q
            if condition.qd is not None:
                by_qd[nodes] += condition.qd
            if condition.qdd is not None:
                by_qd[nodes] += grid.differentiation(1)[nodes].T @ condition.qdd
        by_error = self._path_weight * weights * self._task_error() if self._path_weight else None
        return by_q, by_qd, by_error

    def _sensitivities(self, x: Array) -> tuple[Array, Array]:
        """Return ∂q/∂[z | x | c] and ∂q̇/∂[z | x | c] at the stages, (S, n, size)."""
        by_coefficients = self.null_motion.matrix()
        first = self.start.size
        last = first + self.null_motion.size
        stages, n, _ = by_coefficients.shape
        epsilon_matrix = np.zeros((stages, n, self.size))
        epsilon_matrix[:, :, first:last] = by_coefficients
        start_matrix = np.zeros((n, self.size))
        start_matrix[:, :first], by_pose = self.start.tangent()
        if self._deviation is None:
            return self.rollout.sensitivities(epsilon_matrix, start_matrix)
        target_matrix = np.zeros((stages, 12, self.size))
        target_matrix[:, :, last:] = self._deviation.matrix(x[last:])
        start_matrix[:, last:] = by_pose @ target_matrix[0, :6, last:]
        return self.rollout.sensitivities(epsilon_matrix, start_matrix, target_matrix)


def _task_rows(samples: Samples, twists: Array) -> Array:
    """Return the prescribed rows of twists (S, 6, k) at the samples, (S, m, k)."""
    angular = twists[:, 3:]
    if samples.task.tool_axes:
        angular = samples.rotation.transpose(0, 2, 1) @ angular
    return np.concatenate([twists[:, :3], angular], axis=1)[:, samples.task.rows]


def inverse_metric(metric: Array, floor: float = 1e-4) -> Array:
    """Return the inverse of a positive semidefinite matrix.

    Directions without curvature (coefficients that do not act, as in the over-specified joint
    space) are given that of `floor` times the largest.
    """
    values, vectors = np.linalg.eigh(metric)
    values = np.maximum(values, floor * max(values[-1], np.finfo(float).tiny))
    return np.asarray((vectors / values) @ vectors.T)
