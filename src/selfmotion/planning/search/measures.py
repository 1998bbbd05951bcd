"""Additive costs of chains of configurations: joint travel, or the running cost of a problem."""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search.layer_cache import LayerCache
from selfmotion.planning.search.layer_steps import cheapest, near_pairs, relax_steps, unturned
from selfmotion.problem.costs import Cost, PathLength, Samples

# Ratio of a step's speed to the mean speed of the shortest chain above which the step counts as if
# it took longer: such speeds are an artefact of sampling.
_MAX_SPEED_RATIO = 2.0
# Layers per waypoint in a cache; bounds memory only.
_CACHED_LAYERS = 3
# Samples of a random motion that shows on which derivatives costs depend: several, as costs may
# take differences over them.
_PROBE_SAMPLES = 8


@dataclass(frozen=True, eq=False)
class JointTravel:
    """Weighted joint travel Σ w|Δq| of a chain.

    Attributes
    ----------
    weights : (n,)
        w of the joints.
    """

    weights: Array

    def relaxed_layer(
        self,
        k: int,
        before: Array,
        cost: Array,
        after: Array,
        largest_step: Array,
        is_unbounded: Flags,
    ) -> tuple[Array, Ints]:
        """Return the least costs at the vertices of waypoint k + 1, and their predecessors.

        One step of Bellman's recursion.

        Parameters
        ----------
        k : int
            The waypoint before.
        before, cost : (N, n), (N,)
            Its vertices, sorted by the first joint, and the costs of chains to them.
        after : (M, n)
            Vertices of waypoint k + 1.
        largest_step : (n,)
            Largest change of each joint [rad or m].
        is_unbounded : (n,)
            Joints that are compared modulo 2π.

        Returns
        -------
        (M,), (M,)
            inf and -1 where no step is short enough.
        """
        least_cost, parent = np.empty(len(after)), np.empty(len(after), dtype=np.intp)
        step = np.ascontiguousarray(largest_step)
        relax_steps(before, cost, after, step, is_unbounded, self.weights, least_cost, parent)
        return least_cost, parent

    def cost_of(self, q: Array) -> float:
        """Return the cost of a motion (W, n)."""
        return float((np.abs(np.diff(q, axis=0)) * self.weights).sum())

    def reversed(self) -> Self:
        """Return the measure of chains from the last waypoint to the first."""
        return self


class _LayerCost(NamedTuple):
    """Samples of a layer (N, n) at rest, and the costs of these configurations, (N,)."""

    samples: Samples
    cost: Array


class _StepCosts(NamedTuple):
    """Pairs of near vertices of two layers (P,), (P,), and the costs of these steps, (P,)."""

    first: Ints
    second: Ints
    price: Array


@dataclass(frozen=True, eq=False)
class RunningCost:
    """Running cost ∫ G dt of a problem, as a sum over the steps of a chain.

    A step from q to q + Δq in Δt costs ½Δt (G(0, q) + G(0, q + Δq)) of costs of the configuration
    alone. Of costs with a velocity it costs Δt G(0, q + ½Δq) for the configuration and
    τ (G(Δq/τ, q + ½Δq) - G(0, q + ½Δq)) for the motion, with the tips of q, τ = max(Δt, |Δq| / v)
    and v twice the mean speed of the shortest chain. Samples are farther apart than a slow
    self-motion moves in one interval; a step is therefore counted as if it took τ. Costs of
    accelerations and jerks are left out.

    Attributes
    ----------
    formulation : Formulation
    t : (W,)
        Times of the waypoints [s].
    static_costs : tuple of Cost
        Costs of the configuration alone.
    kinetic_costs : tuple of Cost
        Costs of configuration and velocity.
    weights : (n,)
        Of the joints in |Δq|.
    speed : float
        v [rad/s].
    is_backwards : bool
        Whether chains go from the last waypoint to the first.
    """

    formulation: Formulation
    t: Array
    static_costs: tuple[Cost, ...]
    kinetic_costs: tuple[Cost, ...]
    weights: Array
    _layer_costs: LayerCache[_LayerCost]
    _step_costs: LayerCache[_StepCosts]
    speed: float = np.inf
    is_backwards: bool = False

    @classmethod
    def of(cls, formulation: Formulation, t: Array) -> "RunningCost":
        """Return the running cost of a formulation over waypoints at times t (W,)."""
        robot = formulation.robot
        lower, upper = robot.finite_limits()
        shares = np.random.default_rng(0).uniform(0.3, 0.7, (_PROBE_SAMPLES, robot.dof))
        q = lower + (upper - lower) * shares
        sampling = Sampling.trapezoidal(np.linspace(t[0], t[-1], len(q)))
        probe = Samples.along(formulation.problem.follows, sampling, q, 0.1 * q)
        static_costs: list[Cost] = []
        kinetic_costs: list[Cost] = []
        for cost in formulation.costs:
            partials = cost.gradient(probe)
            if partials.qdd is not None or partials.qddd is not None:
                continue
            (static_costs if partials.qd is None else kinetic_costs).append(cost)
        cached = _CACHED_LAYERS * len(t)
        return cls(
            formulation,
            t,
            tuple(static_costs),
            tuple(kinetic_costs),
            formulation.coordinates.weights,
            LayerCache(cached),
            LayerCache(cached),
        )

    def relaxed_layer(
        self,
        k: int,
        before: Array,
        cost: Array,
        after: Array,
        largest_step: Array,
        is_unbounded: Flags,
    ) -> tuple[Array, Ints]:
        """See `JointTravel.relaxed_layer`."""
        if self.is_backwards:
            k = len(self.t) - 2 - k
            steps = self._steps(k, after, before, largest_step, is_unbounded)
            return cheapest(steps.second, steps.first, steps.price, cost, len(after))
        steps = self._steps(k, before, after, largest_step, is_unbounded)
        return cheapest(steps.first, steps.second, steps.price, cost, len(after))

    def _steps(
        self, k: int, before: Array, after: Array, largest_step: Array, is_unbounded: Flags
    ) -> _StepCosts:
        """Return the steps that are short enough from waypoint k to the next, with their costs."""
        steps = self._step_costs.get(before, after)
        if steps is None:
            step = np.ascontiguousarray(largest_step)
            first, second = near_pairs(before, after, step, is_unbounded)
            price = self._prices(k, before, after, first, second, is_unbounded)
            steps = _StepCosts(first, second, price)
            self._step_costs.put(steps, before, after)
        return steps

    def cost_of(self, q: Array) -> float:
        """See `JointTravel.cost_of`."""
        no_turns, first_index = np.zeros(q.shape[1], dtype=bool), np.zeros(1, dtype=np.intp)
        steps = (
            self._prices(k, q[k : k + 1], q[k + 1 : k + 2], first_index, first_index, no_turns)[0]
            for k in range(len(q) - 1)
        )
        return float(sum(steps))

    def reversed(self) -> Self:
        """See `JointTravel.reversed`."""
        return replace(self, is_backwards=True)

    def with_speed_of(self, q: Array) -> Self:
        """Return the measure with v set by the shortest motion (W, n)."""
        moved = np.linalg.norm(self.weights * np.diff(q, axis=0), axis=1).sum()
        mean = float(moved) / (self.t[-1] - self.t[0])
        speed = _MAX_SPEED_RATIO * mean if mean > 0.0 else np.inf
        return replace(self, speed=speed, _step_costs=self._step_costs.emptied())

    def _prices(
        self, k: int, before: Array, after: Array, first: Ints, second: Ints, is_unbounded: Flags
    ) -> Array:
        """Return the costs of the steps between pairs of vertices, (P,)."""
        duration = float(self.t[k + 1] - self.t[k])
        at_before, at_after = self._layer_cost(k, before), self._layer_cost(k + 1, after)
        price = 0.5 * duration * (at_before.cost[first] + at_after.cost[second])
        if not self.kinetic_costs or not len(first):
            return price
        difference = unturned(after[second] - before[first], is_unbounded)
        moved = np.linalg.norm(self.weights * difference, axis=1)
        duration_counted = np.maximum(duration, moved / self.speed)
        joints = difference[:, : self.formulation.robot.dof]
        samples = replace(
            at_before.samples,
            sampling=Sampling.trapezoidal(np.full(len(first), self.t[k] + 0.5 * duration)),
            q=at_before.samples.q[first] + 0.5 * joints,
            qd=joints / duration_counted[:, None],
            # The kinematics hardly change within a step.
            tips=tuple(tip.at(first) for tip in at_before.samples.tips),
            task_jacobian=at_before.samples.task_jacobian[first],
        )
        at_rest = replace(samples, qd=np.zeros_like(joints))
        moving = sum(cost.value(samples) - cost.value(at_rest) for cost in self.kinetic_costs)
        resting = sum(cost.value(at_rest) for cost in self.kinetic_costs)
        return np.asarray(price + duration_counted * moving + duration * resting)

    def _layer_cost(self, k: int, q: Array) -> _LayerCost:
        """Return the samples of a layer (N, n) of waypoint k, and the costs of them alone."""
        layer_cost = self._layer_costs.get(q)
        if layer_cost is None:
            sampling = Sampling.trapezoidal(np.full(len(q), self.t[k]))
            # Costs are functions of the arm's joints, which come first.
            joints = q[:, : self.formulation.robot.dof]
            follows = self.formulation.problem.follows
            samples = Samples.along(follows, sampling, joints, np.zeros_like(joints))
            cost = sum((cost.value(samples) for cost in self.static_costs), np.zeros(len(q)))
            layer_cost = _LayerCost(samples, cost)
            self._layer_costs.put(layer_cost, q)
        return layer_cost


Measure = JointTravel | RunningCost
"""A cost of chains that is a sum over their steps."""


def measure_of(formulation: Formulation, t: Array, weights: Array) -> Measure:
    """Return the measure of chains over waypoints at times t (W,).

    Joint travel with `weights` (n,) where path length is the only cost, or no cost depends on q and
    q̇ alone; else the running cost.
    """
    running_cost = RunningCost.of(formulation, t)
    is_length = all(isinstance(cost, PathLength) for cost in formulation.costs)
    # Virtual joints have no length.
    is_travel = is_length and formulation.coordinates.virtual is None
    if is_travel or not (running_cost.static_costs or running_cost.kinetic_costs):
        return JointTravel(weights)
    return running_cost


def is_joint_travel(formulation: Formulation) -> bool:
    """Whether chains are measured by their joint travel."""
    t = np.array([0.0, formulation.path.duration])
    return isinstance(measure_of(formulation, t, joint_weights(formulation)), JointTravel)


def joint_weights(formulation: Formulation) -> Array:
    """Return the weight of each joint's unit, (n,): that of the path's length, if it is a cost."""
    coordinates = formulation.coordinates
    virtual = coordinates.weights[formulation.robot.dof :]
    for cost in formulation.costs:
        if isinstance(cost, PathLength) and cost.joint_weights is not None:
            return np.append(np.asarray(cost.joint_weights, dtype=np.float64), virtual)
    return coordinates.weights
