"""Rows of joint limits: of the control points of q, q̇, q̈ and the jerk, so of the whole curve."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, kernel
from selfmotion.planning.nodes.spline import (
    AT_CONTROLS,
    CONTROLS,
    ORDERS,
    Quintic,
    control_times,
    unit_bases,
)
from selfmotion.problem.constraints import BoundLimits, Multipliers

# A limit with less room than this is in use [units of h].
_USED = 0.01
# A limit whose control point is this near to it binds there [units of h].
_BINDS = 1e-3
# Shares of an interval at which the curve is compared with the control points.
_FINE = unit_bases(np.linspace(0.0, 1.0, 17))

# The curve itself at the shares of the control points of each derivative.
_AT_CONTROL_SHARES = [unit_bases(np.linspace(0.0, 1.0, count)) for count in CONTROLS]


class ControlPointRows:
    """Rows of one constraint's limits, (N, 6 - o, 2, j): by interval, control point, side, joint.

    Parameters
    ----------
    spline : Quintic
    item : BoundLimits
    first : int
        Number of the first coordinate that its joints are counted from.
    """

    def __init__(self, spline: Quintic, item: BoundLimits, first: int) -> None:
        self._spline, self.item, self._first = spline, item, first
        self.joints = first + item.joints
        self.shape = spline.count, CONTROLS[item.order], 2, len(item.joints)

    def on(self, spline: Quintic) -> "ControlPointRows":
        """Return the rows on other nodes."""
        return ControlPointRows(spline, self.item, self._first)

    def _at(self, tables: tuple[Array, ...], ends: Array) -> Array:
        """Return h by shares of all intervals, (N, P, 2, j)."""
        item = self.item
        limits = item.lower, item.upper, item.scale
        rates, table = self._spline.rates[item.order], tables[item.order]
        return _beyond(ends, table, rates, self.joints, *limits, item.margin)

    def multipliers_of(self, multipliers: Array, ends: Array) -> Multipliers:
        """Return the multipliers in the order of time."""
        item = self.item
        once = np.ones(multipliers.shape[:2], dtype=np.bool_)
        if item.order < ORDERS - 1:
            once[:-1, -1] = False
        times = control_times(self._spline, item.order)[once]
        # The control polygon is outside of the curve.
        used = self._at(_AT_CONTROL_SHARES[item.order], ends) > item.granted - _USED
        shape = len(times), -1
        return Multipliers(item, multipliers[once].reshape(shape), times, used[once].reshape(shape))

    def conservatism(self, multipliers: Array, ends: Array) -> Array:
        """Return multipliers times the distance of the control points from the curve, (N,)."""
        h = self._at(_FINE, ends).max(axis=1) - self.item.granted
        found: Array = (multipliers.sum(axis=1) * np.maximum(-h, 0.0)).sum(axis=(1, 2))
        return found

    def kinks(self, ends: Array) -> Flags:
        """Return the mask of intervals next to which the limits start or end to bind, (N,)."""
        h = self._at(AT_CONTROLS, ends) - self.item.granted
        each: Flags = np.asarray(h > -_BINDS)
        each = each.reshape(self._spline.count, CONTROLS[self.item.order], -1)
        binds: Flags = np.asarray(each.any(axis=1))
        found: Flags = np.asarray((binds & ~each.all(axis=1)).any(axis=1))
        change = (binds[1:] != binds[:-1]).any(axis=1)
        found[1:] |= change
        found[:-1] |= change
        return found

    def carried(self, before: "ControlPointRows", multipliers: Array) -> Array:
        """Return the multipliers of these rows by those of the nearest rows before."""
        spline, old, item = self._spline, before._spline, self.item
        middles = 0.5 * (spline.t[:-1] + spline.t[1:])
        k = np.searchsorted(old.t, middles) - 1
        each = multipliers.copy()
        if item.order < ORDERS - 1:
            # The shared control point's, which is not stored here.
            each[:-1, -1] = each[1:, 0]
        share = (control_times(spline, item.order) - old.t[k][:, None]) / old.steps[k][:, None]
        degree = CONTROLS[item.order] - 1
        place = np.clip(np.rint(share * degree), 0, degree).astype(np.int64)
        density = (spline.steps / old.steps[k])[:, None, None, None]
        return np.asarray(each[k[:, None], place] * density)


@kernel
def _beyond(
    ends: Array,
    table: Array,
    rates: Array,
    joints: Ints,
    lower: Array,
    upper: Array,
    scale: Array,
    margin: float,
) -> Array:
    """Return (x - upper)/scale + margin and (lower - x)/scale + margin, (N, P, 2, j).

    Of x = rates · table y, for y = `ends` (N, 6, n) and a table (P, 6) of a derivative.
    """
    (count, places), size = (len(ends), len(table)), len(joints)
    found = np.empty((count, places, 2, size))
    for k in range(count):
        for p in range(places):
            for j in range(size):
                x = 0.0
                for a in range(6):
                    x += table[p, a] * ends[k, a, joints[j]]
                x *= rates[k]
                found[k, p, 0, j] = (x - upper[j]) / scale[j] + margin
                found[k, p, 1, j] = (lower[j] - x) / scale[j] + margin
    return found
