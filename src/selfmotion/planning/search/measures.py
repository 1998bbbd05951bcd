"""Measures of chains of configurations: their length, or the problem's costs."""

from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from selfmotion.basics import Array, Flags, Ints, kernel
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import Formulation
from selfmotion.problem.costs import Cost, PathLength, Samples

# Steps faster than this many times the mean speed of the shortest chain are sampling noise, which
# the finished motion spreads over more time.
_FAST = 2.0
# Layers with cached kinematics, per waypoint; they bound memory alone.
_LAYERS_KEPT = 3


@kernel
def wrapped(difference: float, revolute: bool) -> float:
    """Return the difference of two coordinates, modulo a turn where the joint is revolute."""
    if revolute:
        turns = np.floor(difference / (2.0 * np.pi) + 0.5)
        return float(difference - 2.0 * np.pi * turns)
    return difference


@kernel
def extend(
    before: Array,
    cost: Array,
    after: Array,
    largest_step: Array,
    turning: Flags,
    weights: Array,
    reach: Array,
    parent: Ints,
) -> None:
    """Set `reach` (M,), the least cost at `after` (M, n) over steps from `before` (N, n).

    The cost of a step is Σ w|Δq| with `weights` (n,); `turning` joints count modulo turns. `before`
    is sorted by its first joint unless that one turns. `parent` is -1 where no step is short
    enough.
    """
    n, many = after.shape[1], before.shape[0]
    for j in range(after.shape[0]):
        reach[j], parent[j] = np.inf, -1
        first = 0
        if not turning[0]:
            first = int(np.searchsorted(before[:, 0], after[j, 0] - largest_step[0]))
        for i in range(first, many):
            if not turning[0] and before[i, 0] > after[j, 0] + largest_step[0]:
                break
            total = cost[i]
            for k in range(n):
                step = abs(wrapped(after[j, k] - before[i, k], turning[k]))
                total += weights[k] * step
                if step > largest_step[k] or total >= reach[j]:
                    total = np.inf
                    break
            if total < reach[j]:
                reach[j], parent[j] = total, i


@kernel
def near_pairs(
    before: Array, after: Array, largest_step: Array, turning: Flags
) -> tuple[Ints, Ints]:
    """Return the pairs of vertices (P,), (P,) from `before` (N, n) to `after` (M, n) that are near.

    No joint may move by more than `largest_step`; otherwise as `extend`.
    """
    n, many = after.shape[1], before.shape[0]
    room = 4 * (many + after.shape[0])
    first, second = np.empty(room, dtype=np.intp), np.empty(room, dtype=np.intp)
    count = 0
    for j in range(after.shape[0]):
        begin = 0
        if not turning[0]:
            begin = int(np.searchsorted(before[:, 0], after[j, 0] - largest_step[0]))
        for i in range(begin, many):
            if not turning[0] and before[i, 0] > after[j, 0] + largest_step[0]:
                break
            near = True
            for k in range(n):
                if abs(wrapped(after[j, k] - before[i, k], turning[k])) > largest_step[k]:
                    near = False
                    break
            if near:
                if count == room:
                    room *= 2
                    longer = np.empty((2, room), dtype=np.intp)
                    longer[0, :count], longer[1, :count] = first, second
                    first, second = longer[0], longer[1]
                first[count], second[count] = i, j
                count += 1
    return first[:count].copy(), second[:count].copy()


@kernel
def lower_to_cheapest(
    first: Ints, second: Ints, price: Array, cost: Array, reach: Array, parent: Ints
) -> None:
    """Lower `reach` (M,) to the least cost over steps with prices (P,), and set `parent`."""
    for k in range(len(first)):
        total = cost[first[k]] + price[k]
        if total < reach[second[k]]:
            reach[second[k]], parent[second[k]] = total, first[k]


@dataclass(frozen=True, eq=False)
class Length:
    """Σ w|Δq|.

    Attributes
    ----------
    weights : (n,)
        w of the joints.
    """

    weights: Array

    def extended(
        self, k: int, before: Array, cost: Array, after: Array, step: Array, turning: Flags
    ) -> tuple[Array, Ints]:
        """Return the least costs at the vertices of waypoint k + 1, and their predecessors.

        Parameters
        ----------
        k : int
            The waypoint before.
        before, cost : (N, n), (N,)
            Its vertices, sorted by the first joint, and the costs of chains to them.
        after : (M, n)
        step : (n,)
            No joint may move more.
        turning : (n,)
            Joints that count modulo turns.

        Returns
        -------
        (M,), (M,)
            inf and -1 where no step is short enough.
        """
        reach, source = np.empty(len(after)), np.empty(len(after), dtype=np.intp)
        longest = np.ascontiguousarray(step)
        extend(before, cost, after, longest, turning, self.weights, reach, source)
        return reach, source

    def of(self, q: Array) -> float:
        """Return the cost of a motion (W, n)."""
        return float((np.abs(np.diff(q, axis=0)) * self.weights).sum())

    def backwards(self) -> Self:
        """Return that of the same path from its end to its start."""
        return self


@dataclass(frozen=True, eq=False)
class RunningCost:
    """∫ G dt of a problem's costs, as far as it is a function of chains of samples.

    A step from q to q + Δq within Δt costs ½Δt (G(0, q) + G(0, q + Δq)) for its place, and τ
    (G(Δq/τ, q + ½Δq) - G(0, q + ½Δq)) for its motion, with τ = max(Δt, |Δq| / v). v is twice the
    mean speed of the shortest chain: samples are as far apart as many intervals of a slow drift
    along the self-motion, so that a change from one sample to the next counts as if it were spread
    over the time it takes. Costs of accelerations and jerks are left out.

    Attributes
    ----------
    formulation : Formulation
    t : (W,)
        Times of the waypoints [s].
    placed : tuple of Cost
        Those of q alone.
    moving : tuple of Cost
        The others.
    weights : (n,)
        Of the joints in |Δq|.
    speed : float
        v [rad/s].
    is_backwards : bool
        Whether chains go from the last waypoint to the first.
    """

    formulation: Formulation
    t: Array
    placed: tuple[Cost, ...]
    moving: tuple[Cost, ...]
    weights: Array
    speed: float = np.inf
    is_backwards: bool = False
    _places: dict[int, "_Places"] = field(default_factory=dict, repr=False)
    _steps: dict[tuple[int, int], "_Steps"] = field(default_factory=dict, repr=False)

    @classmethod
    def by(cls, formulation: Formulation, t: Array) -> "RunningCost":
        """Return that of the costs over waypoints at times t (W,)."""
        robot = formulation.robot
        lower, upper = robot.finite_limits()
        # Several times, since costs may take differences over them.
        q = lower + (upper - lower) * np.random.default_rng(0).uniform(0.3, 0.7, (8, robot.dof))
        sampling = Sampling.trapezoidal(np.linspace(t[0], t[-1], len(q)))
        probe = Samples.along(formulation.problem.follows, sampling, q, 0.1 * q)
        placed: list[Cost] = []
        moving: list[Cost] = []
        for cost in formulation.costs:
            partials = cost.gradient(probe)
            if partials.qdd is not None or partials.qddd is not None:
                continue
            (placed if partials.qd is None else moving).append(cost)
        weights = formulation.coordinates.weights
        return cls(formulation, t, tuple(placed), tuple(moving), weights)

    def extended(
        self, k: int, before: Array, cost: Array, after: Array, step: Array, turning: Flags
    ) -> tuple[Array, Ints]:
        """See `Length.extended`."""
        if self.is_backwards:
            steps = self.steps(len(self.t) - 2 - k, after, before, step, turning)
            return cheapest(steps.second, steps.first, steps.price, cost, len(after))
        steps = self.steps(k, before, after, step, turning)
        return cheapest(steps.first, steps.second, steps.price, cost, len(after))

    def steps(self, k: int, before: Array, after: Array, step: Array, turning: Flags) -> "_Steps":
        """Return the steps that are short enough from waypoint k to the next; see `extended`."""
        known = self._steps.get((id(before), id(after)))
        if known is None or known.before is not before or known.after is not after:
            longest = np.ascontiguousarray(step)
            first, second = near_pairs(before, after, longest, turning)
            price = self._prices(k, before, after, first, second, turning)
            known = _Steps(before, after, first, second, price)
            _note(self._steps, (id(before), id(after)), known, _LAYERS_KEPT * len(self.t))
        return known

    def of(self, q: Array) -> float:
        """See `Length.of`."""
        fixed, one = np.zeros(q.shape[1], dtype=bool), np.zeros(1, dtype=np.intp)
        steps = (
            self._prices(k, q[k : k + 1], q[k + 1 : k + 2], one, one, fixed)[0]
            for k in range(len(q) - 1)
        )
        return float(sum(steps))

    def backwards(self) -> Self:
        """See `Length.backwards`."""
        return replace(self, is_backwards=True)

    def at_pace_of(self, q: Array) -> "RunningCost":
        """Return that for motions about as fast as the shortest one, (W, n)."""
        moved = np.linalg.norm(self.weights * np.diff(q, axis=0), axis=1).sum()
        mean = float(moved) / (self.t[-1] - self.t[0])
        return replace(self, speed=_FAST * mean if mean > 0.0 else np.inf, _steps={})

    def _prices(
        self, k: int, before: Array, after: Array, first: Ints, second: Ints, turning: Flags
    ) -> Array:
        """Return the costs of the steps between pairs of vertices, (P,)."""
        duration = float(self.t[k + 1] - self.t[k])
        here, there = self._at(k, before), self._at(k + 1, after)
        price = 0.5 * duration * (here.cost[first] + there.cost[second])
        if not self.moving or not len(first):
            return price
        difference = after[second] - before[first]
        turn = 2.0 * np.pi
        difference -= np.where(turning, turn * np.round(difference / turn), 0.0)
        moved = np.linalg.norm(self.weights * difference, axis=1)
        lasting = np.maximum(duration, moved / self.speed)
        sampling = Sampling.trapezoidal(np.full(len(first), self.t[k] + 0.5 * duration))
        own = difference[:, : self.formulation.robot.dof]
        samples = replace(
            here.samples,
            sampling=sampling,
            q=here.samples.q[first] + 0.5 * own,
            qd=own / lasting[:, None],
            # The kinematics hardly change within a step.
            tips=tuple(tip.at(first) for tip in here.samples.tips),
            task_jacobian=here.samples.task_jacobian[first],
        )
        at_rest = replace(samples, qd=np.zeros_like(own))
        moving = sum(cost.value(samples) - cost.value(at_rest) for cost in self.moving)
        resting = sum(cost.value(at_rest) for cost in self.moving)
        return np.asarray(price + lasting * moving + duration * resting)

    def _at(self, k: int, q: Array) -> "_Places":
        known = self._places.get(id(q))
        if known is None or known.q is not q:
            sampling = Sampling.trapezoidal(np.full(len(q), self.t[k]))
            # Costs are functions of the arm's joints, which come first.
            own = q[:, : self.formulation.robot.dof]
            follows = self.formulation.problem.follows
            samples = Samples.along(follows, sampling, own, np.zeros_like(own))
            cost = sum((cost.value(samples) for cost in self.placed), np.zeros(len(q)))
            known = _Places(q, samples, cost)
            _note(self._places, id(q), known, _LAYERS_KEPT * len(self.t))
        return known


# Layers are keys of a cache by identity, and kept alive, so that no other one gets their id.
@dataclass(frozen=True, eq=False)
class _Places:
    """A layer (N, n), its samples at rest, and the costs of q alone there, (N,)."""

    q: Array
    samples: Samples
    cost: Array


@dataclass(frozen=True, eq=False)
class _Steps:
    """Two layers, the pairs of near vertices (P,), (P,), and the costs of these steps, (P,)."""

    before: Array
    after: Array
    first: Ints
    second: Ints
    price: Array


def _note(known: dict[Any, Any], key: Any, value: Any, most: int) -> None:
    if len(known) >= most:
        known.clear()
    known[key] = value


def cheapest(
    first: Ints, second: Ints, price: Array, cost: Array, count: int
) -> tuple[Array, Ints]:
    """Return the result of `Length.extended` for pairs of vertices (P,), (P,) with given costs."""
    reach, source = np.full(count, np.inf), np.full(count, -1, dtype=np.intp)
    lower_to_cheapest(first, second, price, cost, reach, source)
    return reach, source


Measure = Length | RunningCost
"""Adds up along chains of configurations, from one waypoint to the next."""


def measure_of(formulation: Formulation, t: Array, weights: Array) -> Measure:
    """Return the measure of chains over waypoints at times t (W,).

    The costs, or the length with `weights` (n,) where it is all that they ask for.
    """
    own = RunningCost.by(formulation, t)
    has_length = all(isinstance(cost, PathLength) for cost in formulation.costs)
    # Virtual joints have no length.
    if (has_length and formulation.coordinates.virtual is None) or not (own.placed or own.moving):
        return Length(weights)
    return own
