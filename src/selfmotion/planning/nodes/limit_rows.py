"""Rows of joint limits: of the control points of q, q̇, q̈ and the jerk, so of the whole curve."""

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.planning.nodes.spline import AT_CONTROLS, CONTROLS, ORDERS, Quintic, unit_bases
from selfmotion.problem.constraints import BoundLimits, Multipliers

# Rows become active where h is above this [units of h].
_NEAR = -0.3
# A limit with less room than this is in use [units of h].
_USED = 0.01
# A limit whose control point is this near to it binds there [units of h].
_BINDS = 1e-3
# h of control points that two intervals share, on one of the two: it never becomes active.
_SHARED = -1e3
# Shares of an interval at which the curve is compared with the control points.
_FINE = unit_bases(np.linspace(0.0, 1.0, 17))


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

    def residuals(self, ends: Array) -> Array:
        """Return h, minus the part of the tolerance that is used."""
        h = self._at(AT_CONTROLS, ends)
        if self.item.order < ORDERS - 1:
            h[:-1, -1] = _SHARED
        return h - self.item.granted

    def _at(self, tables: tuple[Array, ...], ends: Array) -> Array:
        """Return h by shares of all intervals, (N, P, 2, j)."""
        item = self.item
        x = self._spline.at(tables, item.order, ends)[:, :, self.joints]
        h = np.stack([x - item.upper, item.lower - x], axis=2)
        h /= item.scale
        h += item.margin
        return h

    def near(self, h: Array) -> Flags:
        """Return the mask of nearly violated rows: all of a joint and side."""
        column = (h > _NEAR).any(axis=(0, 1))
        return np.asarray(column & (h > 0.5 * _SHARED))

    def along(self, changes: Array) -> Array:
        """Return ∂h of all rows along changes of y (N, 6, n)."""
        order = self.item.order
        x = self._spline.at(AT_CONTROLS, order, changes)[:, :, self.joints] / self.item.scale
        return np.stack([x, -x], axis=2)

    def pulled(self, multipliers: Array) -> Array:
        """Return Σ multipliers ∂h/∂y of its joints, (N, 6, j)."""
        order = self.item.order
        by = (multipliers[:, :, 0] - multipliers[:, :, 1]) / self.item.scale
        by *= self._spline.rates(order)[:, None, None]
        return np.asarray(AT_CONTROLS[order].T @ by)

    def squared(self, weights: Array) -> Array:
        """Return Σ weights ∂h ∂hᵀ by y of each of its joints, (N, j, 6, 6)."""
        order, spline = self.item.order, self._spline
        each = weights.sum(axis=2) / self.item.scale**2 * spline.rates(2 * order)[:, None, None]
        table = AT_CONTROLS[order]
        outer = (table[:, :, None] * table[:, None, :]).reshape(len(table), 36)
        return np.asarray((np.swapaxes(each, 1, 2) @ outer).reshape(spline.count, -1, 6, 6))

    def multipliers_of(self, multipliers: Array, ends: Array) -> Multipliers:
        """Return the multipliers in the order of time."""
        item = self.item
        once = np.ones(multipliers.shape[:2], dtype=np.bool_)
        if item.order < ORDERS - 1:
            once[:-1, -1] = False
        times = self._spline.times_of(item.order)[once]
        # The control polygon is outside of the curve.
        at = unit_bases(np.linspace(0.0, 1.0, CONTROLS[item.order]))
        used = self._at(at, ends) > item.granted - _USED
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
        share = (spline.times_of(item.order) - old.t[k][:, None]) / old.steps[k][:, None]
        degree = CONTROLS[item.order] - 1
        place = np.clip(np.rint(share * degree), 0, degree).astype(np.int64)
        density = (spline.steps / old.steps[k])[:, None, None, None]
        return np.asarray(each[k[:, None], place] * density)
