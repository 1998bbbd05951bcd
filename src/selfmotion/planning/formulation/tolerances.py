"""Tolerances as conditions on the coordinates δ of virtual joints."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, cast

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array
from selfmotion.certificate import Column, Quantity
from selfmotion.model.follow import Follows, VirtualJoints, joint_of, limits_within
from selfmotion.model.task import ROW_NAMES, Relaxation
from selfmotion.problem.constraints import (
    BoundConstraint,
    BoundLimits,
    BoundQuantity,
    Conditions,
    DependsOn,
    motion_of_order,
)
from selfmotion.problem.costs import Samples

# Target share of a band that is left unused; half of it is guaranteed.
_MARGIN_SHARE = 5e-4
# At least [m or rad]: about the resolution of a certificate.
_MIN_MARGIN = 6e-7
# Largest such share.
_MAX_MARGIN_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class WithinBand(BoundQuantity):
    """The rows of a relaxation stay within their band, in its window.

    Attributes
    ----------
    window : (float, float)
        First and last time [s].
    """

    window: tuple[float, float] = (-np.inf, np.inf)
    depends_on: ClassVar[DependsOn] = DependsOn.TOLERANCES

    @override
    def uses_accelerations(self, dof: int) -> bool:
        return False

    @override
    def squares(self, samples: Samples) -> Array | None:
        found = super().squares(samples)
        if found is not None:
            found[self._outside(samples)] = 0.0
        return found

    @classmethod
    def of(cls, item: Relaxation, follows: Follows) -> "WithinBand":
        """Return that of a relaxation with a band."""
        first, last = item.window(follows.duration)
        return cls(_band(item, follows.virtual), _margin(item), (first, last))

    def _outside(self, samples: Samples) -> npt.NDArray[np.bool_]:
        t = samples.sampling.node_times
        return np.asarray((t < self.window[0]) | (t > self.window[1]))

    @override
    def residual(self, samples: Samples) -> Array:
        # It is -1 outside of the window.
        found = super().residual(samples)
        found[self._outside(samples)] = -1.0
        return found

    @override
    def _slopes(self, samples: Samples) -> tuple[Array, ...]:
        found = super()._slopes(samples)
        for by in found:
            by[self._outside(samples)] = 0.0
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
    depends_on: ClassVar[DependsOn] = DependsOn.TOLERANCES

    @classmethod
    def of_row(cls, item: Relaxation, follows: Follows) -> "RowWithinBand | None":
        """Return that of a relaxation.

        None where no joint's coordinate is its deviation, or that has other bands in other windows.
        """
        joint = joint_of(follows.virtual, item)
        shared = [each for each in follows.virtual.relaxations if item.indices[0] in each.indices]
        if joint is None or len(shared) > 1:
            return None
        number, scale = joint
        bound = np.array([item.band / scale])
        return cls(
            name=f"relaxation {item.label}",
            order=0,
            joints=np.array([number]),
            joint_names=(follows.virtual.each[number].name,),
            units=("rad" if item.angular else "m",),
            lower=-bound,
            upper=bound,
            scale=bound,
            margin=_margin(item),
            labels=(f"deviation {item.label}",),
            bands=np.array([item.band]),
        )

    @classmethod
    def of_each(cls, item: Relaxation, follows: Follows) -> "RowWithinBand | None":
        """Return limits of each of the joints of a relaxation's rows, which bands imply.

        None where a joint is its one row's deviation, or all rows are free at some time.

        Near its path the length of several rows has no slope: only limits tell a step how far the
        band goes. They hold at all times: of bands in several windows the widest one counts.
        """
        bounds = limits_within(follows, item)[follows.robot.dof :]
        joints = np.flatnonzero(np.isfinite(bounds))
        if joint_of(follows.virtual, item) is not None or not joints.size:
            return None
        each = follows.virtual.each
        rows = [cast(int, each[k].row) for k in joints]
        return cls(
            name=f"relaxation {item.name}, each row",
            order=0,
            joints=joints,
            joint_names=tuple(each[k].name for k in joints),
            units=("rad" if item.angular else "m",) * len(joints),
            lower=-bounds[joints],
            upper=bounds[joints],
            scale=bounds[joints],
            # None: the band itself binds first.
            margin=0.0,
            labels=tuple(f"deviation {ROW_NAMES[row]}" for row in rows),
            bands=np.array([follows.virtual.widest([row]) for row in rows]),
        )

    @override
    def easing(self, column: int) -> tuple[float, str]:
        return 0.02, f"2 % more room for the deviation {self.name.removeprefix('relaxation ')}"

    @override
    def describe(self, samples: Samples, row: int, column: int) -> str:
        # As the deviation, to which a coordinate is in proportion.
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
    return min(max(_MARGIN_SHARE, _MIN_MARGIN / item.band), _MAX_MARGIN_SHARE)


def widest_band(item: Relaxation, follows: Follows) -> Quantity:
    """Return how far rows are off the path, of all coordinates, within the widest band.

    That which they have at any time.
    """
    n, own = follows.robot.dof, _band(item, follows.virtual)
    limit = follows.virtual.widest(item.indices)

    def values(*motion: Array) -> Array:
        return own.values(*(x[:, n:] for x in motion))

    def derivatives(*motion: Array) -> tuple[Array, ...]:
        return tuple(_after(n, by) for by in own.derivatives(*(x[:, n:] for x in motion)))

    return replace(own, values=values, derivatives=derivatives, limit=limit)


def of_arm(quantity: Quantity, n: int) -> Quantity:
    """Return a quantity of the n joints of an arm, of all coordinates."""

    def values(*motion: Array) -> Array:
        return quantity.values(*(x[:, :n] for x in motion))

    def derivatives(*motion: Array) -> tuple[Array, ...]:
        more = motion[0].shape[1] - n
        return tuple(_before(more, by) for by in quantity.derivatives(*(x[:, :n] for x in motion)))

    return replace(quantity, values=values, derivatives=derivatives)


def _before(more: int, by: Array) -> Array:
    """Return derivatives (…, n) with those by `more` further coordinates, 0."""
    return np.concatenate([by, np.zeros((*by.shape[:-1], more))], axis=-1)


def _after(more: int, by: Array) -> Array:
    """Return derivatives (…, v) with those by `more` coordinates before, 0."""
    return np.concatenate([np.zeros((*by.shape[:-1], more)), by], axis=-1)


def _band(item: Relaxation, virtual: VirtualJoints) -> Quantity:
    """Return how far rows are off the path, of δ: one number, or the length of several."""
    several = len(item.rows) > 1
    # The last one: values, slopes and curvature are asked for at the same motion.
    known: list[tuple[Array, tuple[Array, Array]]] = []

    def rows_of(s: Array) -> tuple[Array, Array]:
        for at, found in known:
            if np.array_equal(at, s):
                return found
        found = virtual.rows_of(item, s)
        known[:] = [(s.copy(), found)]
        return found

    def values(s: Array, *rates: Array) -> Array:
        rows = rows_of(s)[0]
        return rows[:, None, :] if several else rows

    def derivatives(s: Array, *rates: Array) -> tuple[Array, ...]:
        by = rows_of(s)[1]
        return (by[:, None] if several else by,)

    label, unit = f"deviation {item.label}", "rad" if item.angular else "m"
    return Quantity(
        f"relaxation {item.label}",
        (Column(item.name, label, unit),),
        values,
        derivatives,
        limit=item.band,
        components=len(item.rows),
    )


def band_conditions(follows: Follows, relaxations: Sequence[Relaxation]) -> Conditions:
    """Return the conditions that rows stay within their bands.

    A row that is one joint's coordinate has limits, others are quantities of δ, with limits of each
    joint that these imply.
    """
    limits, points = list[BoundLimits](), list[BoundConstraint]()
    limited = set[frozenset[int]]()
    for item in relaxations:
        if not np.isfinite(item.band):
            continue
        of_row = RowWithinBand.of_row(item, follows)
        if of_row is not None:
            limits.append(of_row)
            continue
        points.append(WithinBand.of(item, follows))
        each = RowWithinBand.of_each(item, follows)
        # Rows with bands in several windows are limited once: nothing is required twice at once.
        rows = frozenset(item.indices)
        if each is not None and rows not in limited:
            limited.add(rows)
            limits.append(each)
    return Conditions(tuple(limits), tuple(points))
