"""What is said of an arm's own joints, asked of motions with virtual joints after these."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, cast

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, Flags, Ints
from selfmotion.certificate import Column, Quantity
from selfmotion.model.collision import Closest, CollisionModel
from selfmotion.model.follow import AugmentedTaskFrames, Follows
from selfmotion.model.task import ROW_NAMES, Relaxation
from selfmotion.problem.constraints import BoundConstraint, BoundLimits, NodeTangents, easing_of
from selfmotion.problem.constraints.conditions import BoundQuantity, motion_of_order
from selfmotion.problem.costs import Cost, Partials, Samples

# Target share of a band that is left unused; half of it is guaranteed.
_MARGIN = 5e-4
# At least [m or rad]: about the resolution of a certificate.
_LEAST = 6e-7
# Largest such share.
_MOST = 0.5


class _OfArm(Cost):
    """A cost of an arm's own joints.

    Parameters
    ----------
    cost : Cost
    follows : Follows
        What the arm alone follows.
    dof : int
        Of the arm with virtual joints.
    """

    def __init__(self, cost: Cost, follows: Follows, dof: int) -> None:
        self.name, self._cost, self._follows, self._dof = cost.name, cost, follows, dof
        for flag in ("is_quadratic", "is_pointwise"):
            setattr(self, flag, getattr(cost, flag))

    @override
    def value(self, samples: Samples) -> Array:
        return self._cost.value(samples.of(self._follows))

    @override
    def gradient(self, samples: Samples) -> Partials:
        found = self._cost.gradient(samples.of(self._follows))
        names = ("q", "qd", "qdd", "qddd")
        return Partials(**{name: self._filled(getattr(found, name)) for name in names})

    def _filled(self, part: Array | None) -> Array | None:
        if part is None:
            return None
        filled = np.zeros((len(part), self._dof))
        filled[:, : part.shape[1]] = part
        return filled

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        n = self._follows.robot.dof
        found = {}
        for order, weight in self._cost.curvature(n).items():
            found[order] = np.zeros((dof, dof))
            found[order][:n, :n] = weight
        return found


def cost_of_arm(cost: Cost, follows: Follows, dof: int) -> Cost:
    """Return a cost of the joints of an arm, for one with virtual joints besides, dof in all."""
    return _OfArm(cost, follows, dof)


class _Springs(Cost):
    """G = ½ Σ w q²: what virtual joints cost where they are not kept within limits.

    Parameters
    ----------
    weights : (n,)
    """

    name, is_quadratic, is_pointwise = "tolerances", True, True

    def __init__(self, weights: Array) -> None:
        self._weights = weights

    @override
    def value(self, samples: Samples) -> Array:
        return np.asarray(0.5 * samples.q**2 @ self._weights)

    @override
    def gradient(self, samples: Samples) -> Partials:
        return Partials(q=samples.q * self._weights)

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        return {0: np.diag(self._weights)}


def springs(weights: Array) -> Cost:
    """Return the cost ½ Σ w q² of weights (n,)."""
    return _Springs(weights)


class _ArmTangents(NodeTangents):
    """Tangents of an arm's own joints."""

    _whole: NodeTangents
    _dof: int

    def __init__(self, whole: NodeTangents, dof: int) -> None:
        object.__setattr__(self, "_whole", whole)
        object.__setattr__(self, "_dof", dof)
        super().__init__(whole.q[:, :dof], whole.qd[:, :dof], whole.sampling)

    @override
    def picked(self, order: int, nodes: Ints, joints: Ints) -> Array:
        return self._whole.picked(order, nodes, joints)

    @override
    def of_order(self, order: int) -> Array:
        return self._whole.of_order(order)[:, : self._dof]


@dataclass(frozen=True, eq=False)
class BoundOfArm:
    """A condition on an arm's own joints.

    Attributes
    ----------
    bound : BoundConstraint
    follows : Follows
        What the arm alone follows.
    """

    bound: BoundConstraint
    follows: Follows

    @property
    def name(self) -> str:
        """See `BoundConstraint.name`."""
        return self.bound.name

    @property
    def equality(self) -> bool:
        """See `BoundConstraint.equality`."""
        return self.bound.equality

    @property
    def tolerance(self) -> float:
        """See `BoundConstraint.tolerance`."""
        return self.bound.tolerance

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        return self.bound.residual(samples.of(self.follows))

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        own = _ArmTangents(motion, self.follows.robot.dof)
        return self.bound.tangents(samples.of(self.follows), own)

    def is_of_accelerations(self, dof: int) -> bool:
        """See `BoundQuantity.is_of_accelerations`."""
        own = getattr(self.bound, "is_of_accelerations", None)
        return own is not None and bool(own(self.follows.robot.dof))

    @property
    def squares(self) -> Callable[[Samples], Array] | None:
        """See `BoundQuantity.squares`."""
        own = getattr(self.bound, "squares", None)
        if own is None:
            return None
        n = self.follows.robot.dof
        return lambda samples: _filled(own(samples.of(self.follows)), samples.q.shape[1] - n)

    def easing(self, column: int) -> tuple[float, str]:
        """See `easing_of`."""
        return easing_of(self.bound, column)

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
        return self.bound.describe(samples.of(self.follows), row, column)


class BodiesOfArm:
    """The bodies of an arm with virtual joints, which move none of them; see `CollisionModel`."""

    def __init__(self, model: CollisionModel) -> None:
        self._model, self._dof = model, model.robot.dof

    @property
    def own(self) -> CollisionModel:
        """The bodies by the arm's own joints, which come first."""
        return self._model

    @property
    def is_all_convex(self) -> bool:
        """See `CollisionModel.is_all_convex`."""
        return self._model.is_all_convex

    def worst(self, q: Array) -> Closest:
        """See `CollisionModel.worst`."""
        return self._model.worst(q[..., : self._dof])

    def distance(self, q: Array) -> Closest:
        """See `CollisionModel.distance`."""
        return self._model.distance(q[..., : self._dof])

    def colliding(self, q: Array, margin: float) -> Flags:
        """See `CollisionModel.colliding`."""
        return self._model.colliding(q[..., : self._dof], margin)


def quantity_of_arm(quantity: Quantity, n: int) -> Quantity:
    """Return a quantity of n joints, of motions of more."""

    def values(*motion: Array) -> Array:
        return quantity.values(*(x[:, :n] for x in motion))

    def derivatives(*motion: Array) -> tuple[Array, ...]:
        more = motion[0].shape[1] - n
        return tuple(_filled(by, more) for by in quantity.derivatives(*(x[:, :n] for x in motion)))

    return replace(quantity, values=values, derivatives=derivatives)


def _filled(by: Array, more: int) -> Array:
    """Return derivatives (…, n) with those by so many more joints, 0."""
    return np.concatenate([by, np.zeros((*by.shape[:-1], more))], axis=-1)


@dataclass(frozen=True, eq=False)
class WithinBand(BoundQuantity):
    """The rows of a relaxation stay within their band, in its window.

    Attributes
    ----------
    window : (float, float)
        First and last time [s].
    """

    window: tuple[float, float] = (-np.inf, np.inf)
    counts_at_once: ClassVar[bool] = True

    def _squares(self, samples: Samples) -> Array:
        found = super()._squares(samples)
        found[self._outside(samples)] = 0.0
        return found

    @classmethod
    def of(cls, item: Relaxation, follows: AugmentedTaskFrames) -> "WithinBand":
        """Return that of a relaxation with a band, for an arm with virtual joints."""
        first, last = item.window(follows.duration)
        return cls(_band(item, follows), _margin(item), (first, last))

    def _outside(self, samples: Samples) -> npt.NDArray[np.bool_]:
        t = samples.sampling.node_times
        return np.asarray((t < self.window[0]) | (t > self.window[1]))

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`; -1 outside of the window."""
        found = super().residual(samples)
        found[self._outside(samples)] = -1.0
        return found

    @override
    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        found = super().tangents(samples, motion)
        found[self._outside(samples)] = 0.0
        return found


@dataclass(frozen=True, eq=False)
class RowWithinBand(BoundLimits):
    """One row stays within its band: its virtual joint stays within limits.

    Outside of its window that is held at 0.

    Attributes
    ----------
    labels : tuple of str
        What each joint's coordinate says, in words.
    bands : (j,)
        How far that is where the coordinate is at its limit [rad or m].
    """

    labels: tuple[str, ...]
    bands: Array
    counts_at_once: ClassVar[bool] = True

    @classmethod
    def of_row(cls, item: Relaxation, follows: AugmentedTaskFrames) -> "RowWithinBand | None":
        """Return that of a relaxation.

        None where no joint's coordinate is its deviation, or that has other bands in other windows.
        """
        joint = follows.virtual.joint_of(item)
        shared = [each for each in follows.virtual.relaxations if item.indices[0] in each.indices]
        if joint is None or len(shared) > 1:
            return None
        number, scale = joint
        k = follows.robot.dof - len(follows.virtual.each) + number
        bound = np.array([item.band / scale])
        return cls(
            name=f"relaxation {item.label}",
            order=0,
            joints=np.array([k]),
            joint_names=(follows.robot.joint_names[k],),
            units=("rad" if item.angular else "m",),
            lower=-bound,
            upper=bound,
            scale=bound,
            margin=_margin(item),
            labels=(f"deviation {item.label}",),
            bands=np.array([item.band]),
        )

    @classmethod
    def of_each(cls, item: Relaxation, follows: AugmentedTaskFrames) -> "RowWithinBand | None":
        """Return limits of each of the joints of a relaxation's rows, which bands imply.

        None where a joint is its one row's deviation, or all rows are free at some time.

        Near its path the length of several rows has no slope: only limits tell a step how far the
        band goes. They hold at all times: of bands in several windows the widest one counts.
        """
        bounds = follows.limits_within(item)
        joints = np.flatnonzero(np.isfinite(bounds))
        if follows.virtual.joint_of(item) is not None or not joints.size:
            return None
        each = follows.virtual.each
        rows = [cast(int, each[k - follows.robot.dof + len(each)].row) for k in joints]
        return cls(
            name=f"relaxation {item.name}, each row",
            order=0,
            joints=joints,
            joint_names=tuple(follows.robot.joint_names[k] for k in joints),
            units=("rad" if item.angular else "m",) * len(joints),
            lower=-bounds[joints],
            upper=bounds[joints],
            scale=bounds[joints],
            # None: the band itself binds first.
            margin=0.0,
            labels=tuple(f"deviation {ROW_NAMES[row]}" for row in rows),
            bands=np.array([follows.virtual.widest([row]) for row in rows]),
        )

    def easing(self, column: int) -> tuple[float, str]:
        """See `easing_of`: 2 % of the band."""
        return 0.02, f"2 % more room for the deviation {self.name.removeprefix('relaxation ')}"

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`: as the deviation, which a coordinate is in proportion."""
        k = column % len(self.joints)
        band, unit = self.bands[k], self.units[k]
        share = motion_of_order(samples, 0)[row, self.joints[k]] / self.upper[k]
        return (
            f"{self.labels[k]} is {share * band:.4g} {unit} at t = "
            f"{samples.sampling.node_times[row]:.3f} s, {abs(share):.5g} times its limit of "
            f"{band:.4g} {unit}"
        )


def _margin(item: Relaxation) -> float:
    """Return the share of a band that is aimed to be left unused."""
    return min(max(_MARGIN, _LEAST / item.band), _MOST)


def widest_band(item: Relaxation, follows: AugmentedTaskFrames) -> Quantity:
    """Return how far rows are off the path, within the widest band that they have at any time."""
    return replace(_band(item, follows), limit=follows.virtual.widest(item.indices))


def _band(item: Relaxation, follows: AugmentedTaskFrames) -> Quantity:
    """Return how far rows are off the path: one number, or the length of several."""
    virtual, dof = follows.virtual, follows.robot.dof
    first = dof - len(virtual.each)
    several = len(item.rows) > 1

    def values(q: Array, *rates: Array) -> Array:
        rows = virtual.rows_of(item, q[:, first:])[0]
        return rows[:, None, :] if several else rows

    def derivatives(q: Array, *rates: Array) -> tuple[Array, ...]:
        by = virtual.rows_of(item, q[:, first:])[1]
        found = np.zeros((len(q), len(item.rows), dof))
        found[:, :, first:] = by
        return (found[:, None] if several else found,)

    label, unit = f"deviation {item.label}", "rad" if item.angular else "m"
    return Quantity(
        f"relaxation {item.label}",
        (Column(item.name, label, unit),),
        values,
        derivatives,
        limit=item.band,
        components=len(item.rows),
    )
