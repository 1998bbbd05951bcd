"""Integrates eq. 4 with Pinocchio's frame Jacobians, and pulls gradients back through it."""

import numpy as np
import pinocchio as pin

from selfmotion import kernels
from selfmotion.basics import Array
from selfmotion.costs import Samples
from selfmotion.motion import Grid
from selfmotion.path import Path, PathSamples
from selfmotion.robot import RobotModel
from selfmotion.task import DampingLaw, Task, feedback_rate

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

# A Newton correction this small [rad or m] is rounding; quadratic convergence needs few steps.
_POLISHED, _POLISHING_STEPS = 1e-13, 4


class Rollout:
    """Integrates q̇ = J⁺(ẋ + K e) + (I - J⁺J) ε(t) over a grid, from a start configuration.

    Eq. 4 of the paper with pose feedback: e is the pose error (log on SO(3)), zero for the exact
    solution, so that the feedback only takes out what the integration lets in. J⁺ is Jᵀ(JJᵀ)⁻¹,
    near singular poses Jᵀ(JJᵀ + λ²I)⁻¹ where damping is asked for. Classical fourth-order
    Runge-Kutta.

    One object keeps its tables between runs; what `samples` and `pullback` return is that of the
    last `run`.

    Parameters
    ----------
    robot : RobotModel
    path : Path
    task : Task
    grid : Grid
    damping : DampingLaw, optional
        Without it, a singular pose ends the motion.
    """

    def __init__(
        self,
        robot: RobotModel,
        path: Path,
        task: Task,
        grid: Grid,
        *,
        damping: DampingLaw | None = None,
    ) -> None:
        self.robot, self.path, self.task, self.grid = robot, path, task, grid
        self.jacobian_evaluations = 0
        self._data = robot.model.createData()
        self.damping = damping
        # σ0 and λ0; the kernels take a threshold of 0 for none.
        self._law = (0.0, 0.0) if damping is None else (damping.threshold, damping.strength)
        self._gain = feedback_rate(path.duration)
        self._rows = task.rows
        self._angle_kind = kernels.angle_kind(task.rows, task.tool_axes)
        times, n, m = grid.stage_times, robot.dof, task.dimension
        at = kernels.layout(n, m)
        table = self._table = np.zeros((len(times), at.columns))
        self._q, self._qd = table[:, at.q : at.q + n], table[:, at.qd : at.qd + n]
        self._epsilon = table[:, at.epsilon : at.epsilon + n]
        self._target_translation = table[:, at.target_translation : at.target_translation + 3]
        self._target_twist = table[:, at.target_twist : at.target_twist + 6]
        self._translation = table[:, at.translation : at.translation + 3]
        self._error = table[:, at.error : at.error + 6]
        self._fade = table[:, at.damping + 1]
        # Reshaping splits the last axis of a view, hence shares the table's memory.
        self._target_rotation = table[:, at.target_rotation : at.target_twist].reshape(-1, 3, 3)
        self._rotation = table[:, at.rotation : at.error].reshape(-1, 3, 3)
        self._jacobian = table[:, at.jacobian : at.task_jacobian].reshape(-1, 6, n)
        self._task_jacobian = table[:, at.task_jacobian : at.factor].reshape(-1, m, n)
        self.aim(path.samples(times))
        table[:, at.step] = grid.stage_steps
        self._q_rows = list(self._q)

    def aim(self, target: PathSamples) -> None:
        """Follow other poses and twists from now on, given at the stages (S)."""
        self._target_translation[:] = target.translation
        self._target_rotation[:] = target.rotation
        self._target_twist[:] = target.twist

    def run(self, start: Array, epsilon: Array) -> float | None:
        """Integrate from `start` (n,) under null motion `epsilon` (S, n) at the stage times.

        Returns
        -------
        float or None
            None when it arrived; otherwise the time [s] at which the task Jacobian lost rank or a
            number stopped being finite.
        """
        model, data, tool = self.robot.model, self._data, self.robot.tool_id
        jacobians, frame_jacobian = pin.computeJointJacobians, pin.getFrameJacobian
        place, advance, axes = pin.updateFramePlacement, kernels.advance, _AXES
        # These two are views of Pinocchio's own memory: each `place` refreshes them.
        rotation, translation = data.oMf[tool].rotation, data.oMf[tool].translation
        table, rows, angle_kind = self._table, self._rows, self._angle_kind
        gain, (threshold, strength) = self._gain, self._law
        self._epsilon[:] = epsilon
        self._q[0] = start
        for stage, q in enumerate(self._q_rows):
            jacobians(model, data, q)
            jacobian = frame_jacobian(model, data, tool, axes)
            place(model, data, tool)
            if not advance(
                stage,
                jacobian,
                rotation,
                translation,
                table,
                rows,
                angle_kind,
                gain,
                threshold,
                strength,
            ):
                self.jacobian_evaluations += stage + 1
                return float(self.grid.stage_times[stage])
        self.jacobian_evaluations += len(self._q_rows)
        return None

    def polished(self) -> tuple[Array, Array, Array]:
        """Return the nodes of the last run, put exactly onto the path.

        Newton's method q ← q + J⁺e, from errors the size of the integration's; then eq. 4 once
        more for q̇. A motion that was damped anywhere is returned as it is: it is off the path by
        more than that, and its nodes do not come back to it one by one without a jump.

        Returns
        -------
        t, q, qd : (N + 1,), (N + 1, n), (N + 1, n)
        """
        here, n = self.grid.node_stages, self.robot.dof
        if self.damped:
            return self.grid.nodes, self._q[here], self._qd[here]
        model, data, tool = self.robot.model, self._data, self.robot.tool_id
        rotation, translation = data.oMf[tool].rotation, data.oMf[tool].translation
        # A table of its own: the last run stays as it is.
        table, rows, kind = self._table[here], self._rows, self._angle_kind
        q, qd = table[:, :n].copy(), table[:, n : 2 * n]
        for node in range(len(here)):
            for _ in range(_POLISHING_STEPS + 1):
                pin.computeJointJacobians(model, data, q[node])
                jacobian = pin.getFrameJacobian(model, data, tool, _AXES)
                pin.updateFramePlacement(model, data, tool)
                sound = kernels.evaluate(
                    node, jacobian, rotation, translation, table, rows, kind, 0.0, 0.0, 0.0
                )
                step = kernels.newton_step(table[node], n, rows, kind)
                if not sound or np.abs(step).max() < _POLISHED:
                    break
                q[node] += step
        self.jacobian_evaluations += len(here)
        return self.grid.nodes, q, qd

    def sensitivities(
        self, epsilon_matrix: Array, start_matrix: Array, target_matrix: Array | None = None
    ) -> tuple[Array, Array]:
        """Return ∂q/∂x and ∂q̇/∂x at the stages of the last run, (S, n, d) each.

        Parameters
        ----------
        epsilon_matrix : (S, n, d)
            ∂ε/∂x at the stages.
        start_matrix : (n, d)
            ∂q(0)/∂x.
        target_matrix : (S, 12, d), optional
            That of the path's poses [m, world rotation vector] and twists; without it the path is
            fixed.
        """
        if target_matrix is None:
            target_matrix = np.zeros((0, 12, epsilon_matrix.shape[2]))
        epsilon_matrix = np.ascontiguousarray(epsilon_matrix)
        by_q, by_qd = np.empty_like(epsilon_matrix), np.empty_like(epsilon_matrix)
        kernels.sensitivities(
            self._table,
            self._rows,
            self._angle_kind,
            self._gain,
            epsilon_matrix,
            np.ascontiguousarray(start_matrix),
            np.ascontiguousarray(target_matrix),
            by_q,
            by_qd,
        )
        return by_q, by_qd

    @property
    def table_bytes(self) -> int:
        """Memory that the tables take."""
        return int(self._table.nbytes)

    @property
    def error(self) -> Array:
        """Pose error e of the last run at the stages, (S, 6) [m, rad], without copying."""
        return self._error

    @property
    def drift(self) -> Array:
        """Pose error of the last run at the nodes, (N + 1, 6) [m, rad].

        What integration let in, and damping.
        """
        return self._error[self.grid.node_stages]

    @property
    def damped(self) -> bool:
        """Whether the last run was damped at any stage."""
        return bool(np.any(self._fade > 0.0))

    def samples(self) -> Samples:
        """Return the last run at its stages, without copying: valid until the next run."""
        return Samples(
            sampling=self.grid.sampling,
            q=self._q,
            qd=self._qd,
            jacobian=self._jacobian,
            rotation=self._rotation,
            translation=self._translation,
            error=self._error,
            task=self.task,
            task_jacobian=self._task_jacobian,
        )

    def pullback(
        self, q_cotangent: Array, qd_cotangent: Array, error_cotangent: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Pull a gradient with respect to the last run's stages back to what drove it.

        The exact derivative of the discrete scheme: one backward sweep, no finite differences.

        Parameters
        ----------
        q_cotangent, qd_cotangent : (S, n)
            ∂F/∂q and ∂F/∂q̇ at the stages.
        error_cotangent : (S, 6), optional
            ∂F/∂e there, e the pose error; by default 0.

        Returns
        -------
        epsilon_gradient : (S, n)
            ∂F/∂ε at the stages.
        start_gradient : (n,)
            ∂F/∂q(0).
        target_gradient : (S, 12)
            With respect to the path's poses [m, world rotation vector] and twists.
        """
        epsilon_gradient = np.empty_like(self._qd)
        target_gradient = np.empty((len(epsilon_gradient), 12))
        if error_cotangent is None:
            error_cotangent = np.zeros((len(epsilon_gradient), 6))
        start_gradient = kernels.pullback(
            np.ascontiguousarray(q_cotangent),
            np.ascontiguousarray(qd_cotangent),
            np.ascontiguousarray(error_cotangent),
            self._table,
            self._rows,
            self._angle_kind,
            self._gain,
            epsilon_gradient,
            target_gradient,
        )
        return epsilon_gradient, start_gradient, target_gradient
