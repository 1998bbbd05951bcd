"""What stops configurations of a redundancy map, and what those cost that nothing stops."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.motion import Sampling
from selfmotion.planning.formulation import Formulation, sampled
from selfmotion.problem.costs import Cost, LostCost, Samples

# Rounding of limits [rad or m, per s]: a motion that stands at one is not beyond it.
ROUNDING = 1e-9
# Rounding of speeds, as a share of their limits: path velocities of plans agree with those of
# their paths within this.
_SPEED_ROUNDING = 1e-6
# Share of the largest smallest singular value of a map below which a pose is near a singular one:
# joints are then twenty times as fast as elsewhere for the same motion of the tool.
NEAR_SINGULAR = 0.05
# Square of a singular value that is none [(m or rad)²].
_NOTHING = 1e-24
# Component of the self-motion below which it does not move a joint [rad or m, of 1].
_STANDS = 1e-9


class Reason(IntEnum):
    """What stops the arm at a configuration: the first of these in the order of checks.

    Attributes
    ----------
    ALLOWED
        Nothing does.
    NO_CONFIGURATION
        The branch of the plan's configurations has none with that value of the coordinate: out of
        reach, or the self-motion turns back before.
    LIMIT
        A joint is beyond a limit of position.
    CONSTRAINT
        Another condition of the problem on the configuration alone is not kept.
    OBSTACLE, ITSELF
        A body is nearer than it may be to an obstacle; to the arm itself.
    SINGULAR
        Near a singular pose: the smallest singular value is below 5 % of the largest on the map.
    SPEED
        The tool's speed there takes a joint beyond its limit of speed, whatever the self-motion
        does. Of one degree of redundancy only.
    """

    ALLOWED = 0
    NO_CONFIGURATION = 1
    LIMIT = 2
    CONSTRAINT = 3
    OBSTACLE = 4
    ITSELF = 5
    SINGULAR = 6
    SPEED = 7


@dataclass(frozen=True, eq=False)
class LocalMotion:
    """Configurations at times of the path, and their motion of least norm along it.

    Attributes
    ----------
    formulation : Formulation
    t : (K,)
        [s].
    z : (K, n)
        In all coordinates.
    """

    formulation: Formulation
    t: Array
    z: Array

    @cached_property
    def _at_rest(self) -> Samples:
        sampling = Sampling.trapezoidal(self.t)
        return Samples.along(self.formulation.follows, sampling, self.z, np.zeros_like(self.z))

    @cached_property
    def _jacobian(self) -> Array:
        """J of the rows, joints that are held left out, (K, m, n)."""
        held = self.formulation.follows.held(self.t)
        return np.asarray(np.where(held[:, None], 0.0, self._at_rest.task_jacobian))

    @cached_property
    def _gram(self) -> tuple[Array, Array]:
        """Eigenvalues (K, m), ascending, and eigenvectors (K, m, m) of JJᵀ."""
        values, vectors = np.linalg.eigh(self._jacobian @ self._jacobian.transpose(0, 2, 1))
        return values, vectors

    @property
    def singular_values(self) -> Array:
        """The smallest singular values of J [m, rad], (K,)."""
        return np.sqrt(np.maximum(self._gram[0][:, 0], 0.0))

    @cached_property
    def rows(self) -> Array:
        """An orthonormal basis of the rows of J, (K, m, n): VᵀJ/σ."""
        values, vectors = self._gram
        sizes = np.sqrt(np.maximum(values, _NOTHING))
        return np.asarray(vectors.transpose(0, 2, 1) @ self._jacobian / sizes[:, :, None])

    @cached_property
    def rates(self) -> Array:
        """J⁺ẋ, (K, n) [rad/s or m/s]."""
        values, vectors = self._gram
        sizes = np.sqrt(np.maximum(values, _NOTHING))
        twists = self.formulation.follows.twists(self.t)
        along = np.einsum("kmi,km->ki", vectors, twists) / sizes
        return np.asarray(np.einsum("ki,kin->kn", along, self.rows))

    @cached_property
    def null(self) -> Array:
        """A unit vector of the self-motion, for one degree of redundancy, (K, n)."""
        left = 1.0 - np.einsum("kin,kin->kn", self.rows, self.rows)
        every, most = np.arange(len(self.z)), np.argmax(left, axis=1)
        found = -np.einsum("kin,ki->kn", self.rows, self.rows[every, :, most])
        found[every, most] += 1.0
        size = np.linalg.norm(found, axis=1, keepdims=True)
        return np.asarray(found / np.maximum(size, np.sqrt(_NOTHING)))

    def cost(self) -> Array:
        """Return the cost density at q with the joint velocities J⁺ẋ, (K,).

        Of costs of q and q̇: those of accelerations and jerks are left out. NaN where one cannot be
        evaluated, as functions that no file has.
        """
        arm = sampled(self.formulation, replace(self._at_rest, qd=self.rates)).arm
        total = np.zeros(len(self.z))
        for cost in self.formulation.costs:
            if isinstance(cost, LostCost):
                return np.full(len(self.z), np.nan)
            if _is_local(cost, arm):
                total += cost.value(arm)
        return total


def _is_local(cost: Cost, samples: Samples) -> bool:
    """Whether a cost depends on neither acceleration nor jerk."""
    few = np.linspace(0.0, 1.0, _PROBES)
    rows = np.linspace(0, len(samples.q) - 1, _PROBES).round().astype(int)
    q, qd = samples.q[rows], samples.qd[rows]
    found = cost.gradient(Samples.along(samples.follows, Sampling.trapezoidal(few), q, qd))
    return found.qdd is None and found.qddd is None


# Samples at which it is looked at what a cost depends on: several, as costs may take differences.
_PROBES = 5


def local_cost(formulation: Formulation, t: Array, z: Array) -> Array:
    """Return `LocalMotion.cost` of configurations z (K, n) at times t (K,)."""
    return LocalMotion(formulation, t, z).cost()


@dataclass
class Judge:
    """Finds what stops configurations, by the problem's own conditions.

    Attributes
    ----------
    formulation : Formulation
    causes : list of str
        In words, what stops some configuration; added to by `judge`.
    """

    formulation: Formulation
    causes: list[str] = field(default_factory=list)
    _state: Ints = field(init=False, repr=False)
    _cause: Ints = field(init=False, repr=False)

    def judge(self, local: LocalMotion, singular_below: float) -> tuple[Ints, Ints]:
        """Return the reasons (K,), and the causes (K,), -1 for none.

        Parameters
        ----------
        local : LocalMotion
        singular_below : float
            Smallest singular values below this are near singular poses [m, rad].
        """
        count = len(local.z)
        self._state = np.full(count, int(Reason.ALLOWED), dtype=np.int64)
        self._cause = np.full(count, -1, dtype=np.int64)
        self._check_limits(local.z)
        self._check_quantities(local.z)
        self._check_bodies(local.z[:, : self.formulation.robot.dof])
        near = self._open & (local.singular_values < singular_below)
        self._note(near, Reason.SINGULAR, "near a singular pose")
        if self.formulation.follows.redundancy == 1:
            self._check_speeds(local)
        return self._state, self._cause

    @property
    def _open(self) -> Flags:
        """Which configurations nothing stops so far."""
        return np.asarray(self._state == Reason.ALLOWED)

    def _note(self, which: Flags, reason: Reason, cause: str) -> None:
        if not which.any():
            return
        if cause not in self.causes:
            self.causes.append(cause)
        self._state[which], self._cause[which] = int(reason), self.causes.index(cause)

    def _check_limits(self, z: Array) -> None:
        envelope, coordinates = self.formulation.envelope, self.formulation.coordinates
        above, below = z - envelope.upper, envelope.lower - z
        worst = np.maximum(above, below)
        which = np.argmax(worst, axis=1)
        beyond = worst[np.arange(len(z)), which] > ROUNDING
        for k in np.unique(which[beyond]).tolist():
            for side, excess in (("upper", above), ("lower", below)):
                here = beyond & (which == k) & (excess[:, k] > ROUNDING)
                self._note(here, Reason.LIMIT, f"{coordinates.label(k)} beyond its {side} limit")

    def _check_quantities(self, z: Array) -> None:
        at_rest = np.zeros_like(z)
        for item in self.formulation.envelope.quantities:
            away = item.away(z, at_rest, at_rest)
            sizes = np.linalg.norm(away, axis=2) if away.ndim == 3 else np.abs(away)
            excess = sizes - item.bounds
            which = np.argmax(excess, axis=1)
            beyond = self._open & (excess[np.arange(len(z)), which] > ROUNDING)
            for k in np.unique(which[beyond]).tolist():
                label = item.columns[k].label
                self._note(beyond & (which == k), Reason.CONSTRAINT, f"{label} beyond its limit")

    def _check_bodies(self, q: Array) -> None:
        """Note the pair of bodies that is nearer than it may be by most."""
        least, is_world = np.zeros(len(q)), np.zeros(len(q), dtype=bool)
        cause = np.full(len(q), "", dtype=object)
        rows = np.flatnonzero(self._open)
        for model, required in self.formulation.envelope.bodies:
            # Whether bodies are too near is known much sooner than how near they are.
            near = rows[model.colliding(q[rows], required)]
            if not len(near):
                continue
            room = model.distances(q[near], required, required) - required
            pair = np.argmin(room, axis=1)
            value = room[np.arange(len(near)), pair]
            worse = (value < least[near]) | (cause[near] == "")
            at = near[worse]
            least[at], is_world[at] = value[worse], model.to_world[pair[worse]]
            said = np.array([_nearness(*names, required) for names in model.pairs], dtype=object)
            cause[at] = said[pair[worse]]
        for text in sorted(set(cause.tolist()) - {""}):
            for reason, side in ((Reason.OBSTACLE, is_world), (Reason.ITSELF, ~is_world)):
                self._note(np.asarray((cause == text) & side), reason, text)

    def _check_speeds(self, local: LocalMotion) -> None:
        """Note where no speed of the self-motion keeps all joints within their limits of speed."""
        envelope, labels = self.formulation.envelope, self.formulation.coordinates.label
        least, most = np.broadcast_to(-envelope.speed, local.z.shape), envelope.speed
        for curves in envelope.curves:
            below, above = curves.velocities(local.z)
            least, most = np.maximum(least, below), np.minimum(most, above)
        share = 1.0 + _SPEED_ROUNDING
        limits = share * least - ROUNDING, share * most + ROUNDING
        lower, upper = speed_range(local.rates, local.null, *limits)
        first, last = np.argmax(lower, axis=1), np.argmin(upper, axis=1)
        every = np.arange(len(local.z))
        conflict = self._open & (lower[every, first] > upper[every, last])
        for i, j in np.unique(np.stack([first, last], axis=1)[conflict], axis=0).tolist():
            names = labels(i) if i == j else f"{labels(min(i, j))} or {labels(max(i, j))}"
            here = conflict & (first == i) & (last == j)
            self._note(here, Reason.SPEED, f"{names} too fast, whatever the self-motion")


def speed_range(rates: Array, null: Array, least: Array, most: Array) -> tuple[Array, Array]:
    """Return the ranges of speeds s of the self-motion with v₁ ≤ a + s b ≤ v₂ for each joint.

    Parameters
    ----------
    rates, null : (K, n)
        a and b.
    least, most : (K, n) or (n,)
        v₁ and v₂; ∓inf for none.

    Returns
    -------
    lower, upper : (K, n)
        Of a joint that the self-motion does not move: ∓inf, or ±inf where it is too fast.
    """
    moves = np.abs(null) > _STANDS
    safe = np.where(moves, null, 1.0)
    ends = np.stack([(least - rates) / safe, (most - rates) / safe])
    lower, upper = ends.min(axis=0), ends.max(axis=0)
    fast = (rates > most) | (rates < least)
    stands = np.where(fast, np.inf, -np.inf)
    return np.where(moves, lower, stands), np.where(moves, upper, -stands)


def _nearness(first: str, second: str, required: float) -> str:
    if required <= 0.0:
        return f"{first} touches {second}"
    return f"{first} is nearer than {1e3 * required:.4g} mm to {second}"
