"""Integrates eq. 4 with Pinocchio's frame Jacobians, and pulls gradients back through it."""

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.model import kernels
from selfmotion.model.follow import Follows, chain_tables, joint_columns, kinematics_of
from selfmotion.model.motion import Grid
from selfmotion.model.path import PathSamples
from selfmotion.model.task import DampingLaw, feedback_rate
from selfmotion.planning.rollout.polishing import polish
from selfmotion.problem.costs import Samples, TipSamples

# Distance of a tool on the path [m, rad].
_POLISHED = 1e-12
# Newton steps to that; few are needed.
_POLISHING_STEPS = 4


class Rollout:
    """Integrates q̇ = J⁺(ẋ + K e) + (I - J⁺J) ε(t) over a grid, from a start configuration.

    Eq. 4 of the paper with pose feedback: e is the pose error (log on SO(3)), zero for the exact
    solution, so that the feedback corrects errors of the integration alone. J⁺ is Jᵀ(JJᵀ)⁻¹, near
    singular poses Jᵀ(JJᵀ + λ²I)⁻¹ with damping. Classical fourth-order Runge-Kutta.

    One object reuses its tables between runs: `samples` and `pullback` are those of the last `run`.

    Parameters
    ----------
    follows : Follows
    grid : Grid
    damping : DampingLaw, optional
        Without it, a singular pose ends the motion.
    """

    def __init__(self, follows: Follows, grid: Grid, *, damping: DampingLaw | None = None) -> None:
        self.follows, self.robot, self.grid = follows, follows.robot, grid
        self.damping = damping
        self.jacobian_evaluations = 0
        self._kinematics = kinematics_of(follows).tips
        self._law = None if damping is None else (damping.threshold, damping.strength)
        self._gain = feedback_rate(follows.duration)
        self._table, self._at, self._tips = _new_table(self, len(grid.stage_times))
        self._space = np.zeros(kernels.space_size(*_sizes(self)[:2]))
        # Cached values of the last run.
        self._samples: Samples | None = None
        for f, item in enumerate(follows.items):
            self.aim(item.target(grid.stage_times), f)
        self._at.step[:, 0] = grid.stage_steps

    def aim(self, target: PathSamples, f: int = 0) -> None:
        """Let tip f follow other poses and twists from now on, given at the stages (S)."""
        self._samples = None
        tip = self._tips[f]
        tip.target_translation[:] = target.translation
        tip.target_rotation[:] = target.rotation
        tip.target_twist[:] = target.twist

    def run(self, start: Array, epsilon: Array) -> float | None:
        """Integrate from `start` (n,) under null motion `epsilon` (S, n) at the stage times.

        Returns
        -------
        float or None
            None when it arrived; otherwise the time [s] at which the task Jacobian lost rank or a
            number stopped being finite.
        """
        self._samples = None
        self._at.epsilon[:] = epsilon
        self._at.q[0] = start
        failed = self._advance(self._table, self._at.q, self._gain)
        if failed is None:
            self.jacobian_evaluations += len(self._table)
            return None
        self.jacobian_evaluations += failed + 1
        return float(self.grid.stage_times[failed])

    def _advance(self, table: Array, q: Array, gain: float) -> int | None:
        """Evaluate eq. 4 at the stages of a table; return the one where it broke down, if any.

        `q` (S, n) is the table's own: each stage writes that of the next.
        """
        first, *others = self._kinematics
        given = table, self.follows.layout, gain, self._law
        return first.march(q, kernels.advance, *given, beside=others)

    def polished(self) -> tuple[Array, Array, Array]:
        """Return the nodes of the last run, put exactly onto the path; the run stays as it is.

        Newton's method q ← q + J⁺e, from errors the size of the integration's, with q̇ by eq. 4
        there. A motion that was damped anywhere is returned as it is: it is off the path by more
        than that, and its nodes do not come back to it one by one without a jump.

        Returns
        -------
        t, q, qd : (N + 1,), (N + 1, n), (N + 1, n)
        """
        here, run = self.grid.node_stages, self._at
        q, qd = run.q[here], run.qd[here]
        if self.damped:
            return self.grid.nodes, q, qd
        parts = [(tip.target_translation[here], tip.target_rotation[here]) for tip in self._tips]
        flat = [part.reshape(len(here), -1) for own in parts for part in own]
        polish(
            self._table[here],
            np.hstack(flat),
            chain_tables(self.follows),
            self.follows.layout,
            _POLISHING_STEPS,
            _POLISHED,
            q,
            qd,
        )
        self.jacobian_evaluations += len(here)
        return self.grid.nodes, q, qd

    def sensitivities(self, epsilon_matrix: Array, start_matrix: Array) -> tuple[Array, Array]:
        """Return ∂q/∂x and ∂q̇/∂x at the stages of the last run, (S, n, d) each.

        Parameters
        ----------
        epsilon_matrix : (S, n, d)
            ∂ε/∂x at the stages.
        start_matrix : (n, d)
            ∂q(0)/∂x.
        """
        epsilon_matrix = np.ascontiguousarray(epsilon_matrix)
        by_q, by_qd = np.empty_like(epsilon_matrix), np.empty_like(epsilon_matrix)
        kernels.sensitivities(
            *_last_run(self),
            np.zeros((len(self._tips), 6)),
            epsilon_matrix,
            np.ascontiguousarray(start_matrix),
            by_q,
            by_qd,
        )
        return by_q, by_qd

    @property
    def first_target(self) -> Array:
        """The poses that the tips follow at the start, as in `Follows.targets`, (12 F,)."""
        parts = [
            part for tip in self._tips for part in (tip.target_translation, tip.target_rotation)
        ]
        return np.concatenate([part[0].ravel() for part in parts])

    @property
    def targets(self) -> list[Array]:
        """Translations that the tips follow at the nodes [m], (N + 1, 3) each."""
        return [tip.target_translation[self.grid.node_stages] for tip in self._tips]

    @property
    def drift(self) -> Array:
        """Pose errors of the last run in the prescribed rows at the nodes, (N + 1, m) [m, rad].

        Errors of the integration, and of damping.
        """
        errors = [tip.error[self.grid.node_stages] for tip in self._tips]
        items = zip(self.follows.items, errors, strict=True)
        return np.concatenate([error[:, item.task.rows] for item, error in items], axis=1)

    @property
    def damped(self) -> bool:
        """Whether the last run was damped at any stage."""
        return bool(np.any(self._at.damping[:, 1] > 0.0))

    def samples(self) -> Samples:
        """Return the last run at its stages, without copying: valid until the next run."""
        if self._samples is None:
            at = self._at
            self._samples = Samples(
                sampling=self.grid.sampling,
                q=at.q,
                qd=at.qd,
                follows=self.follows,
                tips=tuple(
                    TipSamples(tip.jacobian, tip.rotation, tip.translation, tip.error)
                    for tip in self._tips
                ),
                task_jacobian=at.task_jacobian,
            )
        return self._samples

    def pullback(
        self, q_cotangent: Array, qd_cotangent: Array, error_cotangent: Array | None = None
    ) -> tuple[Array, Array]:
        """Pull a gradient with respect to the last run's stages back to its inputs.

        The exact derivative of the discrete scheme: one backward sweep, no finite differences.

        Parameters
        ----------
        q_cotangent, qd_cotangent : (S, n)
            ∂F/∂q and ∂F/∂q̇ at the stages.
        error_cotangent : (S, 6 F), optional
            ∂F/∂e there, e the pose errors of F tips; by default 0.

        Returns
        -------
        epsilon_gradient : (S, n)
            ∂F/∂ε at the stages.
        start_gradient : (n,)
            ∂F/∂q(0).
        """
        count, (n, _, tips) = len(self._table), _sizes(self)
        epsilon_gradient, start_gradient = np.empty((count, n)), np.empty(n)
        if error_cotangent is None:
            error_cotangent = np.zeros((count, 6 * tips))
        kernels.pullback(
            np.ascontiguousarray(q_cotangent),
            np.ascontiguousarray(qd_cotangent),
            _by_tip(self, error_cotangent),
            *_last_run(self),
            epsilon_gradient,
            start_gradient,
        )
        return epsilon_gradient, start_gradient


def _sizes(rollout: Rollout) -> tuple[int, int, int]:
    return rollout.follows.dof, rollout.follows.dimension, len(rollout.follows.items)


def _new_table(rollout: Rollout, stages: int) -> tuple[Array, kernels.Stage, list[kernels.Tip]]:
    """Return a table of kernels for a number of stages, and its views of joints and tips."""
    n, m, count = _sizes(rollout)
    table = np.zeros((stages, kernels.columns(n, m, count)))
    tips = [kernels.tip_of(table, f, n, m) for f in range(count)]
    return table, kernels.stage_of(table, n, m), tips


def _last_run(
    rollout: Rollout,
) -> tuple[Array, Ints, float, kernels.Law | None, kernels.Every | None, Array]:
    """Arguments of the last run for kernels that differentiate it."""
    columns = joint_columns(rollout.follows, rollout._at.q)
    return (
        rollout._table,
        rollout.follows.layout,
        rollout._gain,
        rollout._law,
        columns,
        rollout._space,
    )


def _by_tip(rollout: Rollout, table: Array) -> Array:
    """Return a table (S, k F, …) as one for each tip, (S, F, k, …)."""
    count, columns = len(rollout._tips), table.shape[1]
    shape = (len(table), count, columns // count, *table.shape[2:])
    return np.ascontiguousarray(table).reshape(shape)
