"""The minimum-norm motion: eq. 4 at x = 0, without self-motion."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, BreakdownError
from selfmotion.model.kernels import carried
from selfmotion.model.motion import Grid, fading_window
from selfmotion.model.robot import null_space
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.rollout.rollout import Rollout

# Steps of the first grid, which is halved until …
_MIN_STEPS = 32
# … the minimum-norm motion drifts off the path by less than this, relative to the path's extent.
# Costs then have about the same accuracy.
_DRIFT = 1e-3
# A singularity that three grids in turn place within this share of the motion …
_SAME_PLACE = 1e-3
# … with at least this share of its amount on the first, is the motion's own.
_SAME_AMOUNT = 0.5
# Joint motion of a breakdown near a singular pose [rad or m].
_WILD = 1e3
# Largest number of halvings of the first grid.
MAX_HALVINGS = 8
# Shorter paths [m] count as a point.
_SHORTEST = 1e-3


Guide = Callable[[Array], Array]
"""t (S,) → a null motion (S, n) that stands for x = 0."""


@dataclass(frozen=True, eq=False)
class MinimumNormMotion:
    """A motion at x = 0, integrated on a grid.

    Attributes
    ----------
    formulation : Formulation
    grid : Grid
    guide : Guide or None
        The null motion that stands for x = 0; None for none.
    q, qd : (N + 1, n)
        At the nodes.
    jacobians : (N + 1, m, n)
        Task Jacobians there.
    drift : (N + 1, m)
        How far the tool is off the path in each row, relative to the path's extent (positions) or
        in rad; NaN after a breakdown.
    broken : float or None
        When eq. 4 broke down [s].
    damped : bool
        Whether the inverse was damped anywhere.
    jacobian_evaluations : int
        Number of evaluations.
    rollout : Rollout
        Its integrator: for one objective on the same grid.
    """

    formulation: Formulation
    grid: Grid
    guide: Guide | None
    q: Array
    qd: Array
    jacobians: Array
    drift: Array
    broken: float | None
    damped: bool
    jacobian_evaluations: int
    rollout: Rollout

    @classmethod
    def on(
        cls,
        formulation: Formulation,
        configuration: Array,
        grid: Grid,
        guide: Guide | None = None,
    ) -> "MinimumNormMotion":
        """Integrate from a start configuration (n,) on one grid."""
        rollout = Rollout(formulation.follows, grid, damping=formulation.problem.damping_law)
        t = grid.stage_times
        idle = np.zeros((len(t), formulation.follows.dof))
        own = idle if guide is None else brought_to_rest(formulation, t, guide(t))
        broken = rollout.run(configuration, own)
        samples, drift = rollout.samples(), rollout.drift / _extents(rollout)
        if broken is not None:
            drift = np.where((grid.nodes > broken)[:, None], np.nan, drift)
        nodes = grid.node_stages
        wild = np.abs(samples.q[nodes] - configuration).max(axis=1) > _WILD
        if broken is None and wild.any():
            broken = float(grid.nodes[int(np.argmax(wild))])
        return cls(
            formulation,
            grid,
            guide,
            samples.q[nodes],
            samples.qd[nodes],
            samples.task_jacobian[nodes],
            drift,
            broken,
            rollout.damped,
            rollout.jacobian_evaluations,
            rollout,
        )

    @property
    def start(self) -> Array:
        """Its first configuration, (n,)."""
        return np.array(self.q[0])

    @property
    def end(self) -> Array:
        """Its last configuration, (n,)."""
        return np.array(self.q[-1])

    def off_path(self, allowed: float) -> float | None:
        """Return the first time [s] at which it is off the path by more than that; None if never.

        A breakdown counts, too.
        """
        off = ~(np.abs(self.drift) <= allowed).all(axis=1)
        first = float(self.grid.nodes[int(np.argmax(off))]) if off.any() else None
        times = [time for time in (first, self.broken) if time is not None]
        return min(times) if times else None

    def frame(self, t: Array) -> Array:
        """Return a basis of the null space along this motion at times t (S,), (S, n, r).

        At the nodes carried along, so that it does not turn inside the null space; between them the
        entries follow a cubic spline.
        """
        n = self.formulation.follows.dof
        none = n == self.formulation.follows.dimension
        return np.zeros((len(t), n, 0)) if none else np.asarray(self._frame(t))

    @cached_property
    def _frame(self) -> Callable[[Array], Array]:
        from scipy.interpolate import CubicSpline

        bases = carried(null_space(self.jacobians[0]), self.jacobians)
        return CubicSpline(self.grid.nodes, bases)


def brought_to_rest(formulation: Formulation, t: Array, epsilon: Array) -> Array:
    """Return a null motion (S, n) that fades to nothing where the arm has to be at rest."""
    start, end = formulation.problem.rest_orders
    fading = fading_window(t, formulation.path.duration, (start > 0, end > 0))
    return epsilon * fading[:, None]


def _extents(rollout: Rollout) -> Array:
    """Return the extents of the paths [m], for the rows of positions, and 1 for others, (m,)."""
    extents = [max(float(np.ptp(path, axis=0).max()), _SHORTEST) for path in rollout.targets]
    tasks = [item.task for item in rollout.follows.items]
    return np.concatenate(
        [np.where(task.rows < 3, far, 1.0) for task, far in zip(tasks, extents, strict=True)]
    )


def converged_minimum_norm(
    formulation: Formulation,
    configuration: Array,
    guide: Guide | None = None,
    grid: Grid | None = None,
) -> tuple[MinimumNormMotion, int]:
    """Return the motion at x = 0 on the coarsest grid on which it stays near the path.

    Damping takes it off the path: there, on the first grid that changes the error no more. The
    first one that is tried is `grid`, by default one of few steps.

    Returns
    -------
    minimum_norm : MinimumNormMotion
    jacobian_evaluations : int
        On all grids tried.

    Raises
    ------
    BreakdownError
        It runs into a singular pose.
    """
    steps = max(_MIN_STEPS, formulation.problem.null_motion.fewest_steps)
    grid = grid or Grid.aligned(formulation.knots, steps)
    coarse: Array | None = None
    troubles: list[tuple[float, float]] = []
    evaluations = 0
    for _ in range(MAX_HALVINGS):
        minimum_norm = MinimumNormMotion.on(formulation, configuration, grid, guide)
        evaluations += minimum_norm.jacobian_evaluations
        converged = _converged_grid(minimum_norm, coarse)
        if minimum_norm.broken is None and converged:
            return minimum_norm, evaluations
        coarse = minimum_norm.drift
        trouble = (
            minimum_norm.broken
            if minimum_norm.broken is not None
            else minimum_norm.off_path(_DRIFT)
        )
        time = 0.0 if trouble is None else trouble
        amount = (
            np.inf if minimum_norm.broken is not None else float(np.abs(minimum_norm.drift).max())
        )
        troubles.append((time, amount))
        if not minimum_norm.damped and _stays(troubles, formulation.path.duration):
            break
        grid = grid.halved()
    raise BreakdownError(
        f"{formulation.robot.name}: without self-motion the tool reaches a singular pose near "
        f"t = {time:.4g} s; start elsewhere (start=), or keep the path away from the edge "
        f"of the workspace",
        time=time,
    )


def _converged_grid(minimum_norm: MinimumNormMotion, coarse: Array | None) -> bool:
    if minimum_norm.damped and coarse is not None:
        return bool((np.abs(minimum_norm.drift[::2] - coarse) <= _DRIFT).all())
    return bool((np.abs(minimum_norm.drift) <= _DRIFT).all())


def _stays(troubles: list[tuple[float, float]], duration: float) -> bool:
    """Return whether a singularity (time, amount) is the same on finer grids."""
    if len(troubles) < 3:
        return False
    times, amounts = zip(*troubles[-3:], strict=True)
    in_place = max(times) - min(times) <= _SAME_PLACE * duration
    return bool(in_place and amounts[-1] >= _SAME_AMOUNT * amounts[0])
