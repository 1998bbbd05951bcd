"""Start of a motion, and the minimum-norm motion: x = 0, without self-motion."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from selfmotion.basics import Array, BreakdownError
from selfmotion.model.follow import Follows, kinematics_of, null_basis_at
from selfmotion.model.kernels import carried
from selfmotion.model.motion import Grid, NullMotion, NullMotionTable, fading_window
from selfmotion.model.robot import null_space
from selfmotion.model.task import SE3
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.paper.rollout import Rollout

# Newton steps onto the start of the path; far starts fail with an error.
_STEPS = 20
# Error at which they end: the method is quadratic, and the next error its square.
_ARRIVED = 1e-9
# Steps of the first grid, which is halved until …
_FEWEST_STEPS = 32
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
MOST_HALVINGS = 8
# Shorter paths [m] count as a point.
_SHORTEST = 1e-3


class FixedStart:
    """A given start configuration: q(0) as a function of no variables."""

    size = 0

    def __init__(self, q: Array) -> None:
        self._q = q

    def configuration(self, z: Array, target: Array) -> Array:
        """Return q(0), (n,)."""
        return self._q

    def tangent(self) -> Array:
        """Return ∂q(0)/∂z, (n, 0)."""
        return np.zeros((len(self._q), 0))


class FreeStart:
    """The start moves along the self-motion manifold of the tips' first poses.

    q(0) solves F(q) = x(0) and N0ᵀ(q - q_ref) = z, with N0 an orthonormal null-space basis at the
    reference: coordinates of the manifold, exact and smooth near it.

    Parameters
    ----------
    follows : Follows
    reference : (n,)
        q_ref, on the first poses; z = 0.
    """

    def __init__(self, follows: Follows, reference: Array) -> None:
        self._follows, self._reference = follows, reference
        self._null = null_basis_at(follows, reference)
        self._at = reference
        self._tips = kinematics_of(follows)

    @property
    def size(self) -> int:
        """Number of decision variables z: the redundancy r."""
        return int(self._null.shape[1])

    def configuration(self, z: Array, target: Array) -> Array | None:
        """Return q(0) (n,), or None where no configuration belongs to z and the tips' first poses.

        These are as `Follows.targets` has them, (12 F,).
        """
        q = self._reference + self._null @ z
        for _ in range(_STEPS):
            system, residual = self._error(q, z, target)
            wrong = float(np.abs(residual).max())
            # NaN arrives nowhere.
            if not np.isfinite(wrong):
                return None
            try:
                # B⁻¹ = Bᵀ(BBᵀ)⁻¹: errors of the product are taken out by the next step.
                q = q + system.T @ np.linalg.solve(system @ system.T, residual)
            except np.linalg.LinAlgError:
                return None
            if wrong < _ARRIVED:
                self._at = q
                return q
        return None

    def _error(self, q: Array, z: Array, target: Array) -> tuple[Array, Array]:
        """Return B = [J; N0ᵀ] (m + r, n) and b = [e; z - N0ᵀ(q - q_ref)] at q (n,)."""
        rows, errors = list[Array](), list[Array]()
        places = target.reshape(-1, 12)
        for item, place, *at in zip(self._follows.items, places, *self._tips.at(q), strict=True):
            jacobian, rotation, translation = at
            wanted = SE3(place[3:].reshape(3, 3), place[:3])
            error = item.task.twist_error(wanted, SE3(rotation, translation))
            errors.append(item.task.select(error[:, None], rotation)[:, 0])
            rows.append(item.task.select(jacobian, rotation))
        along = self._null.T
        residual = np.concatenate([*errors, z - along @ (q - self._reference)])
        return np.vstack([*rows, along]), residual

    def tangent(self) -> Array:
        """Return ∂q(0)/∂z at the last q(0), [J; N0ᵀ]⁻¹ [0; I], (n, size)."""
        items, m = self._follows.items, self._follows.dimension
        jacobians, rotations, _ = self._tips.at(self._at)
        rows = [
            item.task.select(jacobian, rotation)
            for item, jacobian, rotation in zip(items, jacobians, rotations, strict=True)
        ]
        right = np.vstack([np.zeros((m, self.size)), np.eye(self.size)])
        return np.asarray(np.linalg.solve(np.vstack([*rows, self._null.T]), right))


Start = FixedStart | FreeStart


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
        own = idle if guide is None else _brought_to_rest(formulation, t, guide(t))
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


def null_motion_table(
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
            np.zeros((len(t), n)) if guide is None else _brought_to_rest(formulation, t, guide(t))
        )
    # Of an arm without redundancy no null motion acts.
    is_joint = motion.space == "joint" and redundancy > 0
    frame, rows = (None, n) if is_joint else (partial(minimum_norm.frame, t), redundancy)
    orders = formulation.problem.rest_orders
    functions = motion.resting(t, formulation.path.duration, orders)
    return NullMotionTable(functions, frame, rows, around)


def _brought_to_rest(formulation: Formulation, t: Array, epsilon: Array) -> Array:
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
    steps = max(_FEWEST_STEPS, formulation.problem.null_motion.fewest_steps)
    grid = grid or Grid.aligned(formulation.knots, steps)
    coarse: Array | None = None
    troubles: list[tuple[float, float]] = []
    evaluations = 0
    for _ in range(MOST_HALVINGS):
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
