"""The self-motion over the next seconds: one step of its quadratic programme for each cycle."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import BrakingCurves
from selfmotion.model.follow import Follows
from selfmotion.model.kernels import transport
from selfmotion.model.motion import Grid, NullMotion
from selfmotion.model.path import PathSamples
from selfmotion.model.robot import null_space
from selfmotion.planning.optimise import minimize_quadratic
from selfmotion.planning.rollout import Rollout
from selfmotion.problem.costs import Cost, Samples
from selfmotion.realtime.law import CURVE_LOWER, CURVE_UPPER, DECELERATION
from selfmotion.realtime.moving_clearance import MovingClearance
from selfmotion.realtime.pace import Pace
from selfmotion.realtime.quantities import Quantities
from selfmotion.realtime.settings import (
    BADLY,
    BREAKING,
    BROKEN,
    DISTANCES,
    GUESS_LESS,
    GUESS_MORE,
    MAX_GUESS,
    MIN_GUESS,
    NODE_STEP,
    PIVOT,
    REACH,
    REGULAR,
    ROUNDS,
    WELL,
    WILD,
)


def elastic_step(
    metric: Array, gradient: Array, rows: Array, low: Array, high: Array
) -> tuple[Array, bool]:
    """Return the step p of least cost that keeps low ≤ rows p ≤ high, found by the few that bind.

    The cost is ½ pᵀ metric p + gradientᵀ p. Where rows contradict each other, the step with small
    violations; and whether it has any.

    Raises
    ------
    numpy.linalg.LinAlgError
        The numbers are too large for a solution.
    """
    if not len(gradient):
        return gradient, bool(((low > 0.0) | (high < 0.0)).any())
    reach = np.full(len(gradient), REACH)
    chosen = np.zeros(len(rows), dtype=bool)
    step = np.asarray(np.linalg.solve(metric, -gradient), dtype=np.float64)
    bounded = bool(np.all(np.abs(step) <= reach))
    for _ in range(ROUNDS):
        if not bounded or chosen.any():
            some = rows[chosen], low[chosen], high[chosen]
            found = minimize_quadratic(metric, gradient, *some, reach)
            if found is None:
                return _elastic(metric, gradient, rows, low, high), True
            step, bounded = found[0], True
        value = rows @ step
        broken = (value < low) | (value > high)
        if not (broken & ~chosen).any():
            break
        chosen |= broken
    return step, False


def _elastic(metric: Array, gradient: Array, rows: Array, low: Array, high: Array) -> Array:
    """Return the step of least cost plus squared violations of rows.

    The command keeps the limits: here the motion has to improve.
    """
    width = high - low
    scale = np.where(np.isfinite(width) & (width > 0.0), width, DISTANCES)[:, None]
    weight = BREAKING * np.trace(metric) / len(metric)
    step = np.zeros(len(metric))
    for _ in range(ROUNDS):
        value = rows @ step
        broken = (value < low) | (value > high)
        near = np.clip(value, low, high)[broken]
        scaled = rows[broken] / scale[broken]
        wanted = scaled.T @ (near / scale[broken, 0])
        stiff = metric + weight * (scaled.T @ scaled)
        step = np.linalg.solve(stiff, weight * wanted - gradient)
    return np.asarray(step * min(1.0, REACH / max(float(np.abs(step).max()), 1e-12)))


def model_of(
    costs: Sequence[Cost],
    metrics: Sequence[tuple[int, Array]],
    guess: float,
    samples: Samples,
    by_q: Array,
    by_qd: Array,
) -> tuple[Array, Array]:
    """Return the gradient of the cost and its Gauss-Newton matrix, (d,) and (d, d).

    `metrics` are second derivatives of costs, order of the derivative and weight (n, n); for the
    others, `guess` is a multiple of that of joint speed. Tangents are (S, n, d).
    """
    d, sampling = by_q.shape[-1], samples.sampling
    if not d:
        return np.zeros(0), np.zeros((0, 0))
    weights = samples.weights[:, None]
    nodes = by_qd[sampling.nodes].reshape(len(sampling.nodes), -1)
    flat = {0: by_q.reshape(-1, d), 1: by_qd.reshape(-1, d)}

    def tangent(order: int) -> Array:
        if order not in flat:
            flat[order] = (sampling.differentiation(order - 1) @ nodes).reshape(-1, d)
        return flat[order]

    gradient, metric = np.zeros(d), np.zeros((d, d))
    for cost in costs:
        partials = cost.gradient(samples)
        parts = partials.q, partials.qd, partials.qdd, partials.qddd
        for order, part in enumerate(parts):
            if part is not None:
                gradient += (weights * part).ravel() @ tangent(order)
    for order, weight in (*metrics, *([(1, guess * np.eye(samples.q.shape[1]))] if guess else [])):
        one = tangent(order)
        heavy = weights[:, :, None] * (weight @ one.reshape(*samples.q.shape, d))
        metric += one.T @ heavy.reshape(-1, d)
    return gradient, metric


def is_damped(gram: Array) -> Any:
    """Return whether commands damp the inverse of JJᵀ (…, m, m), by its smallest pivot."""
    try:
        factor = np.linalg.cholesky(gram)
    except np.linalg.LinAlgError:
        return np.ones(gram.shape[:-2], dtype=bool)
    return (np.diagonal(factor, axis1=-2, axis2=-1) ** 2 < PIVOT).any(axis=-1)


def _blend(frames: Array, node: Array, share: Array) -> Array:
    """Return frames between nodes, by a share of the way to the next one."""
    return np.asarray((1.0 - share) * frames[node] + share * frames[node + 1])


def graded(duration: float, steps: int) -> Array:
    """Return nodes from 0 to `duration` [s]: the first ones near each other, later ones farther.

    Even ones if there are enough. The near future is commanded, the rest evaluates it.
    """
    s = np.linspace(0.0, 1.0, steps + 1)
    even = np.clip((NODE_STEP / duration * steps**2 - 1.0) / (steps - 1.0), 0.0, 1.0)
    return np.asarray(duration * (even * s + (1.0 - even) * s * s))


# The self-motion over the next seconds: one Gauss-Newton step for each cycle.
#
# The real-time iteration scheme (M. Diehl, H. Bock, J. Schlöder, "A real-time iteration scheme
# for nonlinear optimization in optimal feedback control", SIAM J. Control Optim. 43, 2005): a
# cycle linearises the motion around the last coefficients, shifted in time, solves one quadratic
# programme, and the next cycle goes on from there.


class Horizon:
    """Plans ε(t) = R(τ) C φ(τ) for times τ from now on.

    C is r × K for K functions φ. Its part along φ(0) is given by the self-motion that the arm has
    now, so that the rate is continuous; the rest is optimised.

    Parameters
    ----------
    follows : Follows
        Its path is another one at each step.
    costs : sequence of Cost
    limits : (8, n)
        Lower, upper, speed, acceleration, and the curves (`law.DEVIATION`): targets.
    null_motion : NullMotion
        φ, in the null space.
    duration : float
        How far ahead it plans [s].
    steps : int
        Runge-Kutta steps.
    commands : (M,)
        Times from now on at which ε is commanded [s].
    clearance : MovingClearance, optional
        Collision constraints.
    quantities : Quantities, optional
        Other constraints.

    Attributes
    ----------
    pace : Pace
        At what rate the path is followed.
    elastic : bool
        Whether the last step could not keep all limits and distances.
    breakdown : float
        When the last motion ran into a singular pose [s]; inf where it did not.
    damped : float
        When it came so near one that commands would leave a path there [s]; likewise.
    """

    def __init__(
        self,
        follows: Follows,
        costs: Sequence[Cost],
        limits: Array,
        null_motion: NullMotion,
        duration: float,
        steps: int,
        commands: Array,
        clearance: MovingClearance | None = None,
        quantities: Quantities | None = None,
    ) -> None:
        self.grid = Grid(graded(duration, steps))
        robot = follows.robot
        self.rollout = Rollout(follows, self.grid)
        self.redundancy = follows.redundancy
        self._costs, self._duration = tuple(costs), duration
        self._null_motion, self._clearance = null_motion, clearance
        self._quantities = quantities
        self.pace = Pace(duration, self.grid.nodes)
        # Made once.
        self.grid.sampling.node_differentiation(1)
        self._along = np.zeros((0, 6))
        t = self.grid.stage_times
        self._functions = null_motion.functions(t, duration)
        self._inverse = np.linalg.pinv(self._functions)
        now = self._functions[0]
        self._first = now / (now @ now)
        self._rest = null_space(now[None])
        self._shifts: dict[float, tuple[Array, tuple[Array, Array]]] = {}
        self._metrics = [item for cost in costs for item in cost.curvature(robot.dof).items()]
        # Costs whose curvature is not known.
        self._guesses = any(not cost.curvature(robot.dof) for cost in costs)
        pace = np.tile(np.concatenate([limits[2], limits[3]])[None], (steps, 1))
        places = np.tile(limits[:2].ravel()[None], (steps, 1)).reshape(steps, 2, -1)
        speeds, hardest = pace[:, : robot.dof], pace[:, robot.dof :]
        self._low = np.stack([places[:, 0], -speeds, -hardest]).ravel()
        self._high = np.stack([places[:, 1], speeds, hardest]).ravel()
        # Speeds that depend on the position, of the joints for which they do.
        some = np.flatnonzero(np.isfinite(limits[CURVE_LOWER]) | np.isfinite(limits[CURVE_UPPER]))
        self._curved, self._curves = some, BrakingCurves(*limits[DECELERATION:, some])
        self._wild = WILD * limits[2]
        self._range = np.where(np.isfinite(self._high - self._low), self._high - self._low, 1.0)
        # The stages' places among the nodes, for frames between them.
        self._stages = self._between(t)
        self._commands, self._at_commands = self._between(commands), self._functions_at(commands)
        self.forget()

    def forget(self) -> None:
        """Restart: without self-motion, in a frame of the next configuration."""
        # None as long as it has no row.
        self._frames = np.zeros((0, self.rollout.robot.dof, self.redundancy))
        self._coefficients = np.zeros((self.redundancy, self._functions.shape[1]))
        self._damping = 1.0
        self.elastic = False
        self.breakdown = self.damped = float(np.inf)

    def start_anew(self) -> None:
        """Restart after a failure, which is still reported."""
        when = self.breakdown
        self.forget()
        self.breakdown = when

    @property
    def size(self) -> int:
        """Number of variables of a cycle's programme."""
        return int(self.redundancy * self._rest.shape[1])

    @property
    def failure(self) -> str:
        """Why the last step of the optimisation found no motion."""
        if self.breakdown < np.inf:
            return "the motion over the horizon runs into a singular pose"
        return "a cost or its derivative is not finite over the horizon"

    def shift(self, seconds: float) -> None:
        """Shift the horizon in time: coefficients and frame are those of the same motion."""
        if seconds <= 0.0 or not len(self._frames):
            return
        if seconds not in self._shifts:
            self._shifts.clear()
            moved = self._functions_at(self.grid.stage_times + seconds)
            between = self._between(self.grid.nodes + seconds)
            self._shifts[seconds] = (self._inverse @ moved).T, between
        matrix, between = self._shifts[seconds]
        self._coefficients = self._coefficients @ matrix
        self._frames = _blend(self._frames, *between)

    @property
    def plan(self) -> tuple[Array, Array]:
        """Frames and coefficients as they are now."""
        return self._frames.copy(), self._coefficients

    def epsilon(self, plan: tuple[Array, Array]) -> Array:
        """Return ε of a plan at the commands (M,), (M, n)."""
        frames, coefficients = plan
        if not len(frames):
            return np.zeros((len(self._at_commands), self.rollout.robot.dof))
        own = _blend(frames, *self._commands)
        return np.asarray((own @ (self._at_commands @ coefficients.T)[:, :, None])[:, :, 0])

    def _functions_at(self, t: Array) -> Array:
        """Return φ at times `t` (M,), (M, K)."""
        return self._null_motion.functions(np.minimum(t, self._duration), self._duration)

    def improve(
        self, q: Array, rate: Array, jacobian: Array, reference: PathSamples, along: Array
    ) -> bool:
        """Make one step from a configuration and rate, along a reference given at the stages.

        Parameters
        ----------
        q, rate : (n,)
        jacobian : (m, n)
            Task Jacobian at q.
        reference : PathSamples
        along : (S, 6)
            By how much its twist grows with the pace; 0 where it has none.

        Returns
        -------
        bool
            Whether there is a motion.
        """
        self._along = along[self.grid.node_stages]
        # Near singular poses numbers may overflow: such motions are rejected.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._improve(q, rate, jacobian, reference)

    def _improve(self, q: Array, rate: Array, jacobian: Array, reference: PathSamples) -> bool:
        self.rollout.aim(reference)
        if not self.redundancy:
            return self._run(q, np.zeros((len(self._functions), len(q)))) and self._paced_alone()
        if not len(self._frames) and not self._begin(q):
            return False
        first = np.empty((1, *self._frames.shape[1:]))
        transport(self._frames[0], jacobian[None], PIVOT, first)
        self._frames[0] = first[0]
        free = self._coefficients @ self._rest
        self._coefficients = np.outer(first[0].T @ rate, self._first) + free @ self._rest.T
        stages = _blend(self._frames, *self._stages)
        outer = stages @ (self._functions @ self._coefficients.T)[:, :, None]
        if not self._run(q, outer[:, :, 0]):
            return False
        basis = self._functions @ self._rest
        by_epsilon = (stages[:, :, :, None] * basis[:, None, None, :]).reshape(
            len(basis), len(q), self.size
        )
        tangents = self.rollout.sensitivities(by_epsilon, np.zeros((len(q), self.size)))
        samples = self.rollout.samples()
        self.damped = self._first_damped(samples)
        cost = self._cost(samples) if self._guesses else 0.0
        found = self._step(samples, *tangents)
        if found is None:
            return False
        step, predicted = found
        here = np.ascontiguousarray(samples.task_jacobian[self.grid.node_stages])
        better = self._coefficients + step.reshape(self.redundancy, -1) @ self._rest.T
        if not self._guesses or self._falls(q, stages, better, cost, predicted):
            self._coefficients = better
        transport(first[0], here, PIVOT, self._frames)
        return True

    def _paced_alone(self) -> bool:
        """Adapt the pace of an arm without self-motion; return whether numbers are finite."""
        samples = self.rollout.samples()
        self.damped = self._first_damped(samples)
        none = np.zeros((*samples.q.shape, 0))
        return self._step(samples, none, none) is not None

    def _first_damped(self, samples: Samples) -> float:
        """Return when the inverse of the task Jacobian is damped first, inf for never.

        Of a path that is followed on time the end tells, until it is not.
        """
        nodes = samples.nodes[-1:] if self.pace.is_on_time else samples.nodes
        jacobian = samples.task_jacobian[nodes]
        near = is_damped(jacobian @ np.swapaxes(jacobian, 1, 2))
        return float(samples.t[nodes[np.argmax(near)]]) if near.any() else np.inf

    def _cost(self, samples: Samples) -> float:
        return float(samples.weights @ sum(cost.value(samples) for cost in self._costs))

    def _falls(self, q: Array, stages: Array, better: Array, cost: float, predicted: float) -> bool:
        """Return whether to take a step with a guessed decrease of the cost; adapt the guess."""
        if predicted <= 0.0:
            # It is for the limits.
            return True
        outer = stages @ (self._functions @ better.T)[:, :, None]
        fall = -np.inf
        if self._run(q, outer[:, :, 0]):
            fall = cost - self._cost(self.rollout.samples())
        # A rejected step does not break down.
        self.breakdown = np.inf
        ratio = fall / predicted if np.isfinite(fall) else -np.inf
        if not ratio >= BADLY:
            self._damping = min(GUESS_MORE * self._damping, MAX_GUESS)
        elif ratio > WELL:
            self._damping = max(GUESS_LESS * self._damping, MIN_GUESS)
        return bool(ratio > 0.0)

    def _begin(self, q: Array) -> bool:
        if not self._run(q, np.zeros((len(self._functions), len(q)))):
            return False
        jacobians = self.rollout.samples().task_jacobian[self.grid.node_stages]
        self._frames = np.empty((len(jacobians), len(q), self.redundancy))
        first, here = null_space(jacobians[0]), np.ascontiguousarray(jacobians)
        transport(first, here, PIVOT, self._frames)
        return True

    def _run(self, q: Array, epsilon: Array) -> bool:
        """Integrate; return whether there is a motion of plausible size."""
        broken = self.rollout.run(q, epsilon)
        self.breakdown = np.inf if broken is None else broken
        wild = (np.abs(self.rollout.samples().qd) > self._wild).any(axis=1)
        if wild.any():
            first = float(self.grid.stage_times[int(np.argmax(wild))])
            self.breakdown = min(self.breakdown, first)
        return self.breakdown == np.inf

    def _between(self, t: Array) -> tuple[Array, Array]:
        """Return between which nodes times lie, and how far: the last one stands for all later."""
        nodes = self.grid.nodes
        node = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, self.grid.steps - 1)
        share = np.minimum((t - nodes[node]) / (nodes[node + 1] - nodes[node]), 1.0)
        return np.asarray(node), share[:, None, None]

    def _step(self, samples: Samples, by_q: Array, by_qd: Array) -> tuple[Array, float] | None:
        """Return the step of the coefficients (d,), and by how much the cost is to fall.

        None where numbers are not finite.
        """
        guess = self._damping if self._guesses else 0.0
        gradient, metric = model_of(self._costs, self._metrics, guess, samples, by_q, by_qd)
        if not (np.all(np.isfinite(gradient)) and np.all(np.isfinite(metric))):
            return None
        d = self.size
        metric[np.diag_indices(d)] += REGULAR * (np.trace(metric) + 1e-12)
        # Where self-motions alone could not keep all limits, or the tool is late.
        paced = bool(self._along.any()) and (self.elastic or not self.pace.is_on_time)
        try:
            if paced:
                step = self._with_pace(metric, gradient, samples, by_q, by_qd)
            else:
                limits = self._conditions(samples, by_q, by_qd)
                step, self.elastic = elastic_step(metric, gradient, *limits)
        except np.linalg.LinAlgError:
            return None
        return step, float(-gradient @ step - 0.5 * step @ metric @ step)

    def _with_pace(
        self, metric: Array, gradient: Array, samples: Samples, by_q: Array, by_qd: Array
    ) -> Array:
        """Return the step of the coefficients (d,), and change the pace, both by one programme.

        The cost is that of the self-motion, and no reason to be late.
        """
        d, pace = self.size, self.pace
        slower, pull, limits = pace.programme(float(np.trace(metric)) / d if d else 1.0)
        more = len(pull)
        tangents = self._by_pace(samples)
        whole = (np.concatenate(pair, axis=2) for pair in zip((by_q, by_qd), tangents, strict=True))
        rows, low, high = self._conditions(samples, *whole)
        paces, least, most = limits
        both = np.block([[metric, np.zeros((d, more))], [np.zeros((more, d)), slower]])
        step, self.elastic = elastic_step(
            both,
            np.append(gradient, pull),
            np.vstack([rows, np.hstack([np.zeros((len(paces), d)), paces])]),
            np.append(low, least),
            np.append(high, most),
        )
        pace.change(step[d:])
        return step[:d]

    def _by_pace(self, samples: Samples) -> tuple[Array, Array]:
        """Return ∂q and ∂q̇ by all rates of the pace but the first at the nodes, (S, n, J) each.

        By δq = J⁺x' δs for the path x(s): what the self-motion changes on the way is left out.
        """
        nodes, n = samples.nodes, samples.q.shape[1]
        jacobian, item = samples.task_jacobian[nodes], samples.follows.items[0]
        slopes = item.task.select_along(self._along[:, :, None], samples.rotation[nodes])
        across = np.swapaxes(jacobian, 1, 2)
        gram = jacobian @ across + PIVOT * np.eye(jacobian.shape[1])
        by_s = (across @ np.linalg.solve(gram, slopes))[:, :, 0]
        turning = samples.sampling.node_differentiation(1) @ by_s
        rates, progress = (part[:, 1:] for part in self.pace.at_nodes)
        by_q, by_qd = (np.zeros((len(samples.q), n, rates.shape[1])) for _ in range(2))
        by_q[nodes] = by_s[:, :, None] * progress[:, None]
        by_qd[nodes] = by_s[:, :, None] * rates[:, None] + turning[:, :, None] * progress[:, None]
        return by_q, by_qd

    def _conditions(
        self, samples: Samples, by_q: Array, by_qd: Array
    ) -> tuple[Array, Array, Array]:
        """Return rows (R, d) of the limits and distances, and their bounds, (R,) each."""
        rows, low, high = self._rows(samples, by_q, by_qd)
        below = []
        if len(self._curved):
            below.append(self._curve_rows(samples, by_q, by_qd))
        if self._clearance is not None:
            below.append(self._clearance.rows(samples, by_q))
        if self._quantities is not None:
            below.append(self._quantities.rows(samples, by_q, by_qd, self.size))
        if not below:
            return rows, low, high
        room = np.concatenate([each for _, each in below])
        rows = np.vstack([rows, *(more for more, _ in below)])
        return rows, np.append(low, np.full(len(room), -np.inf)), np.append(high, room)

    def _rows(self, samples: Samples, by_q: Array, by_qd: Array) -> tuple[Array, Array, Array]:
        """Return the limits at the nodes as rows of the step, with their bounds."""
        nodes, d = samples.nodes, by_q.shape[2]
        pause = np.diff(self.grid.nodes)[:, None]
        qd, moves = samples.qd[nodes], by_qd[nodes]
        value = np.stack([samples.q[nodes[1:]], qd[1:], np.diff(qd, axis=0) / pause]).ravel()
        harder = np.diff(moves, axis=0) / pause[:, :, None]
        rows = np.stack([by_q[nodes[1:]], moves[1:], harder]).reshape(value.size, d)
        slack = BROKEN * self._range
        return rows, self._low - value - slack, self._high - value + slack

    def _curve_rows(self, samples: Samples, by_q: Array, by_qd: Array) -> tuple[Array, Array]:
        """Return the limits of speed by position at the nodes, with their upper bounds."""
        nodes, some, curves = samples.nodes[1:], self._curved, self._curves
        at, moves = by_q[nodes][:, some], by_qd[nodes][:, some]
        qd = samples.qd[nodes][:, some]
        above, below = curves.slopes(qd)
        rows = np.stack([at + above[..., None] * moves, -at + below[..., None] * moves])
        room = -curves.excess(samples.q[nodes][:, some], qd)
        return rows.reshape(room.size, by_q.shape[2]), room.ravel()
