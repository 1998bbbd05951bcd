"""Shortest chains by reweighted least squares, from chains over samples.

The length Σ w|Δq| of a chain, smoothed to Σ √((wΔq)² + δ²) - δ, is never above the quadratic with
the same value and slope whose curvature is w²/√((wΔq)² + δ²) (E. Weiszfeld, "Sur le point pour
lequel la somme des distances de n points donnés est minimum", Tohoku Math. J. 43, 1937). Its
minimum over how far each configuration moves along its self-motion is one block-tridiagonal system;
δ becomes smaller from stage to stage.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.collision import ClearanceModel, CollisionModel
from selfmotion.planning.optimise import Banded
from selfmotion.planning.search.chains import best_chains, connected, in_order
from selfmotion.planning.search.manifold import LONGEST_CORRECTION, OnPath
from selfmotion.planning.search.measures import JointTravel, Measure
from selfmotion.planning.search.search_bounds import AT_LIMIT, SearchBounds

# δ of the stages, as multiples of the chain's mean step.
SMOOTHINGS = (10.0, 3.0, 1.0, 0.3, 0.1)
# Largest number of rounds of each stage or ring …
_ROUNDS = 20
# … which ends at this relative gain.
_GAIN = 1e-3
# Over-relaxation: the quadratics are majorants.
_OVERSHOOT = 1.6
# Rounds in which joints that would leave their limits are held there.
_LIMITS_HELD = 4
# Allowed share of the largest step …
_STEP_KEPT = 0.97
# … and the penalty of the excess, in units of length [1/rad].
_STEPS_STIFF = 30.0
# Clearance in addition to the required one [m] …
_NEAR_BODIES = 1e-4
# … and the penalty of a smaller one, in units of length [1/m²]; also of a joint held at its limit.
_STIFF = 1e6


# Regularisation of directions without any change.
_DAMPING = 1e-3
# Distances saturate within this above the required one [m].
_SATURATED = 1e-9
# Shorter steps of the line search …
_TRIES = 5
# … each by this factor.
_SHORTER = 0.4
# Distances of the rings of samples around a chain [rad or m]. Chains along curves are up to 0.3 %
# longer with 0.01 as the finest (`make bench NAME=suite`).
_ROUGH_RINGS = (0.3, 0.1)
# The same of fine rings.
_FINE_RINGS = (0.03, 0.01, 0.003, 0.001)
# Samples to each side in rough rings …
_ROUGH_SIDE = 2
# … and in fine ones; with fewer, a chain of `make bench NAME=suite-made` is 0.13 % longer.
_FINE_SIDE = 4


class Shortest:
    """Local search for the shortest chains near others, on the same waypoints.

    Parameters
    ----------
    waypoints : OnPath
    bounds : SearchBounds
        Conditions on each configuration.
    largest_step : (W - 1, n)
        No joint may move more from one waypoint to the next [rad or m].
    weights : (n,)
        w.
    """

    def __init__(
        self, waypoints: OnPath, bounds: SearchBounds, largest_step: Array, weights: Array
    ) -> None:
        self._waypoints, self._bounds, self._weights = waypoints, bounds, weights
        self._largest, self._kept = largest_step, _STEP_KEPT * largest_step
        self._models: list[tuple[ClearanceModel, float]] | None = None

    def near(self, q: Array, smoothings: Sequence[float] = SMOOTHINGS) -> Array:
        """Return a shorter chain near q (W, n), which keeps all that q keeps; else q itself.

        In stages with these δ, as multiples of the mean step of q. Configurations of q in collision
        are moved away first where possible, whatever the length.
        """
        self._free = self._bounds.is_admissible(q)
        self._watched = ~self._free
        best, here, reach, free = q, q, LONGEST_CORRECTION, self._free.sum()
        mean = self._length(q) / max(np.diff(q, axis=0).size, 1)
        for smoothing in smoothings:
            blocked = np.zeros(len(q), dtype=bool)
            for _ in range(_ROUNDS):
                before = self._state(here, smoothing * mean)
                after, reach = self._moved(before, blocked, reach)
                if after is None:
                    break
                here = after.q
                if self._free.sum() > free or self._better(best, here):
                    best, free = here, self._free.sum()
                if after.merit > (1.0 - _GAIN) * before.merit:
                    break
        return best

    def _better(self, best: Array, q: Array) -> bool:
        allowed = bool((np.abs(np.diff(q, axis=0)) <= self._largest).all())
        return allowed and self._length(q) < self._length(best)

    def _length(self, q: Array) -> float:
        return float((np.abs(np.diff(q, axis=0)) * self._weights).sum())

    def _moved(
        self, before: "_State", blocked: Flags, reach: float
    ) -> tuple["_State | None", float]:
        """Return a better chain, no joint of which has moved farther than `reach`, and the next.

        Configurations that would collide are left unmoved, become `blocked` (W,) and watched; the
        step is computed again for the others.
        """
        every, step = np.arange(len(before.q)), self._step(before, blocked)
        for _ in range(_TRIES):
            longest = float(np.abs(step).max())
            moved = min(_OVERSHOOT * longest, reach)
            guess = before.q + (moved / longest if longest > 0.0 else 0.0) * step
            q, arrived = self._waypoints.project_each(guess, every)
            arrived &= np.abs(q - guess).max(axis=1) < max(reach, AT_LIMIT)
            free = arrived.copy()
            free[arrived] = self._bounds.is_admissible(q[arrived])
            arrived &= free | ~self._free
            if not (arrived | blocked).all():
                self._watched |= ~arrived
                blocked |= ~arrived
                step = self._step(before, blocked)
                continue
            after = self._state(np.where(arrived[:, None], q, before.q), before.smoothing)
            if after.merit < before.merit:
                self._free = np.where(arrived, free, self._free)
                return after, min(LONGEST_CORRECTION, max(reach, 2.0 * moved))
            reach = _SHORTER * moved
        return None, reach

    def _state(self, q: Array, smoothing: float) -> "_State":
        """Return the smoothed length of a chain, and the penalty of watched conditions."""
        steps = np.diff(q, axis=0)
        lengths = np.hypot(self._weights * steps, smoothing)
        over = np.maximum(np.abs(steps) - self._kept, 0.0) * self._weights
        rows, lack, slopes = self._lacking(q)
        merit = (lengths - smoothing).sum() + 0.5 * _STEPS_STIFF * (over**2).sum()
        merit += 0.5 * _STIFF * (lack**2).sum()
        return _State(q, smoothing, steps, lengths, over, rows, lack, slopes, float(merit))

    def _lacking(self, q: Array) -> tuple[Ints, Array, Array]:
        """Return the missing distances of watched configurations [m], (L,), and ∂/∂q, (L, n).

        With the waypoints at which.
        """
        watched = np.flatnonzero(self._watched)
        found = [(watched[:0], np.empty(0), np.empty((0, q.shape[1])))]
        for model, wanted in self._smooth_models() if len(watched) else ():
            # Virtual joints come after the arm's, and move no bodies.
            own = model.robot.dof
            now = model.clearances(np.ascontiguousarray(q[watched, :own]))
            lack = wanted - now.values[now.rows, now.columns]
            near = lack > 0.0
            slopes = np.zeros((int(near.sum()), q.shape[1]))
            slopes[:, :own] = now.slopes[near]
            found.append((watched[now.rows[near]], lack[near], slopes))
        rows, lacks, slopes = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return rows, lacks, slopes

    def _smooth_models(self) -> list[tuple[ClearanceModel, float]]:
        if self._models is None:
            self._models = [_smooth(model, distance) for model, distance in self._bounds.bodies]
        return self._models

    def _step(self, state: "_State", blocked: Flags) -> Array:
        """Return the step of each configuration, (W, n): the minimiser of the quadratics.

        `blocked` ones (W,) do not move, and joints that would leave their limits stay there; the
        step is computed again for the others.
        """
        bases = self._waypoints.bases(state.q)
        slope, curvature = state.slope(self._weights), state.curvature(self._weights)
        own = np.zeros_like(state.q)
        own[:-1] += curvature
        own[1:] += curvature
        held = np.repeat(blocked[:, None], state.q.shape[1], axis=1)
        step = np.zeros_like(state.q)
        for _ in range(_LIMITS_HELD):
            step = _least(bases, slope, own + _STIFF * held, curvature, state)
            leaving = self._leaving(state.q, step) & ~held
            if not leaving.any():
                break
            held |= leaving
        return step

    def _leaving(self, q: Array, step: Array) -> Flags:
        """Return the mask of joints near a limit that would pass it, (W, n)."""
        lower, upper, ahead = self._bounds.lower, self._bounds.upper, q + step
        above = (ahead > upper) & (q > upper - AT_LIMIT)
        below = (ahead < lower) & (q < lower + AT_LIMIT)
        return np.asarray(above | below)


@dataclass(frozen=True, eq=False)
class _State:
    """A chain q (W, n), its steps (W - 1, n), and its missing distances between bodies."""

    q: Array
    smoothing: float
    steps: Array
    lengths: Array
    over: Array
    rows: Ints
    lack: Array
    slopes: Array
    merit: float

    def slope(self, weights: Array) -> Array:
        """Return the merit's slope by each configuration, (W, n)."""
        pull = weights**2 * self.steps / self.lengths
        pull += _STEPS_STIFF * weights * self.over * np.sign(self.steps)
        slope = np.zeros_like(self.q)
        slope[:-1] -= pull
        slope[1:] += pull
        np.add.at(slope, self.rows, -_STIFF * self.lack[:, None] * self.slopes)
        return slope

    def curvature(self, weights: Array) -> Array:
        """Return that of each step, (W - 1, n)."""
        return np.asarray(weights**2 * (1.0 / self.lengths + _STEPS_STIFF * (self.over > 0.0)))


def _least(bases: Array, slope: Array, own: Array, between: Array, state: _State) -> Array:
    """Return the least of a quadratic along the bases (W, n, d), (W, n).

    `own` (W, n) and `between` (W - 1, n) are the curvatures of each configuration and of steps.
    """
    count, _, size = bases.shape
    turned = bases.transpose(0, 2, 1)
    blocks = turned @ (own[:, :, None] * bases) + _DAMPING * np.eye(size)
    along = np.einsum("ln,lnd->ld", state.slopes, bases[state.rows])
    np.add.at(blocks, state.rows, _STIFF * along[:, :, None] * along[:, None, :])
    matrix = Banded(count, size, 1)
    matrix.add(0, 0, blocks)
    matrix.add(1, 0, -(turned[:-1] @ (between[:, :, None] * bases[1:])))
    moves = matrix.solve(-np.einsum("wn,wnd->wd", slope, bases).ravel())
    if moves is None:
        return np.zeros_like(slope)
    return np.asarray(np.einsum("wnd,wd->wn", bases, moves.reshape(count, size)))


def _smooth(model: CollisionModel, distance: float) -> tuple[ClearanceModel, float]:
    """Return differentiable distances, and the required one [m]."""
    wanted = distance + _NEAR_BODIES
    return ClearanceModel(model, wanted, width=_SATURATED), wanted


def improved_by(
    waypoints: OnPath, bounds: SearchBounds, largest_step: Array, measure: Measure
) -> Callable[[Array, bool], Array]:
    """Return a better chain near q (W, n), never a worse one; shorter ones also roughly.

    Where something else than length counts, Newton's method goes on from there, and chains only
    have to be near enough.
    """
    arguments = waypoints, bounds, largest_step, measure
    if not isinstance(measure, JointTravel):
        return lambda q, _: _cheaper(*arguments, q, _ROUGH_RINGS, _ROUGH_SIDE)
    shortest = Shortest(waypoints, bounds, largest_step, measure.weights)

    def shorter(q: Array, roughly: bool) -> Array:
        q = shortest.near(q, SMOOTHINGS[:1] if roughly else SMOOTHINGS)
        # Along curves samples are few: they pass obstacles that the quadratics do not.
        is_last = roughly or waypoints.redundancy > 1
        return q if is_last else _cheaper(*arguments, q, _FINE_RINGS, _FINE_SIDE)

    return shorter


def _cheaper(
    waypoints: OnPath,
    bounds: SearchBounds,
    largest_step: Array,
    measure: Measure,
    q: Array,
    rings: Sequence[float],
    side: int,
) -> Array:
    """Return a cheaper chain by dynamic programming over samples around q (W, n), ever nearer."""
    fixed = np.zeros(q.shape[1], dtype=bool)
    cost = measure.cost_of(q)
    for ring in rings:
        for _ in range(_ROUNDS):
            layers = _around(waypoints, bounds, q, ring * np.arange(1.0, side + 1.0))
            chains = best_chains(layers, largest_step, fixed, measure)
            before, cost = cost, float(chains.cost[-1].min())
            chain = chains.back(len(q) - 1, int(np.argmin(chains.cost[-1])))
            q = connected(layers, chain, fixed)
            if cost > before - _GAIN * abs(before):
                break
    return q


def _around(waypoints: OnPath, bounds: SearchBounds, q: Array, away: Array) -> list[Array]:
    """Return q (W, n) and the free samples around it at each waypoint, each (K, n).

    At distances `away` (S,) to both sides along each axis of a null-space basis that is carried
    along q: so a chain can be displaced as a whole, without zigzag.
    """
    basis = waypoints.bases(q)
    offsets = np.concatenate([-away[::-1], away])
    moves = np.einsum("wnr,k->wrkn", basis, offsets).reshape(len(q), -1, q.shape[1])
    guesses = q[:, None] + moves
    flat = guesses.reshape(-1, q.shape[1])
    found, arrived = waypoints.project_each(flat, np.repeat(np.arange(len(q)), moves.shape[1]))
    # Far corrections lead elsewhere.
    arrived &= np.linalg.norm(found - flat, axis=1) < 1.5 * away[0]
    arrived[arrived] = bounds.is_admissible(found[arrived])
    found, kept = found.reshape(guesses.shape), arrived.reshape(guesses.shape[:2])
    layers = [
        np.concatenate([here[None], near[free]])
        for here, near, free in zip(q, found, kept, strict=True)
    ]
    return [in_order(layer) for layer in layers]
