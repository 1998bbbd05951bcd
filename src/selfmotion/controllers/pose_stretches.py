"""Tool poses as targets, and the joint motion that a controller makes of them.

Between two poses the position is linear in the path parameter, the orientation turns about one
axis evenly (slerp; Shoemake, "Animating rotation with quaternion curves", 1985), and external axes
are linear; the arm's joints follow by inverse kinematics from where they are. That is what
``MoveL``, ``LIN`` and ``movel`` are documented to do. ``SPLINE`` goes smoothly through all poses.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.controllers.stretches import Stretch, finer
from selfmotion.controllers.tool_frames import ToolFrames

# How often it is looked at what is between two targets: their inverse kinematics bends.
_BETWEEN = np.linspace(0.0, 1.0, 16, endpoint=False)


@dataclass(frozen=True, eq=False, kw_only=True)
class PoseStretch(Stretch):
    """A motion from rest to rest by tool poses.

    Attributes
    ----------
    places, turns : (K + 1, 3), (K + 1, 4)
        The tool in the work object: positions [m], and quaternions x, y, z, w, each on the side of
        the one before.
    frames : ToolFrames
    near : callable
        Times → joint positions (K, n) in the robot's order, from which inverse kinematics begins.
    order : (n,)
        Which of the robot's joints each column of `q` is.
    """

    places: Array
    turns: Array
    frames: ToolFrames
    near: Callable[[Array], Array]
    order: Ints

    def in_order(self, order: Sequence[int]) -> "PoseStretch":
        """See `Stretch.in_order`."""
        return replace(self, q=self.q[:, order], order=self.order[list(order)])

    def looked_at(self) -> Array:
        """See `Stretch.looked_at`."""
        return finer(self.t, _BETWEEN)

    def ways(self, times: Array) -> list[Array]:
        """See `Stretch.ways`: straight lines, rounded corners, a smooth curve; in tool poses.

        Where no joints are known they are not numbers.
        """
        targets = self._rows()
        lines = straight(times, self.t, targets)
        found = [lines]
        if len(self.t) > 2:
            middles = 0.5 * (self.t[:-1] + self.t[1:])
            knots = np.concatenate([self.t[:1], middles, self.t[-1:]])
            found.append(straight(times, knots, straight(knots, self.t, targets)))
            found.append(self._spline(times))
        return [self._joints(rows, times)[:, self.order] for rows in found]

    def smooth(self) -> tuple[Array, Array, Array]:
        """See `Stretch.smooth`."""
        from scipy.interpolate import CubicSpline

        times = self.looked_at()
        q = self._joints(self._spline(times), times)[:, self.order]
        if not np.isfinite(q).all():
            return times, q, q
        return times, q, CubicSpline(times, q, bc_type="clamped")(times, 1)

    def knots(self) -> tuple[Array, Array, Array]:
        """See `Stretch.knots`."""
        return self.smooth()

    def _spline(self, times: Array) -> Array:
        from scipy.interpolate import CubicSpline

        rows: Array = CubicSpline(self.t, self._rows(), bc_type="clamped")(times)
        rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
        return rows

    def _rows(self) -> Array:
        """Return positions, quaternions and external axes, (K + 1, 7 + m)."""
        own = self.q[:, np.argsort(self.order)]
        return np.hstack([self.places, self.turns, own[:, self.frames.external]])

    def _joints(self, rows: Array, times: Array) -> Array:
        q = np.array(self.near(times))
        q[:, self.frames.external] = rows[:, 7:]
        found, arrived = self.frames.solved(rows[:, :3], rows[:, 3:7], q)
        return np.where(arrived[:, None], found, np.nan)


def straight(times: Array, t: Array, rows: Array) -> Array:
    """Return rows (K, 7 + m) at times between those at t: linear, orientations by slerp."""
    k = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    share = ((times - t[k]) / (t[k + 1] - t[k]))[:, None]
    found: Array = (1.0 - share) * rows[k] + share * rows[k + 1]
    first, last = rows[k, 3:7], rows[k + 1, 3:7]
    # Below 90°, as each is on the side of the one before.
    apart, together = (
        np.linalg.norm(each, axis=1, keepdims=True) for each in (first - last, first + last)
    )
    angle = 2.0 * np.arctan2(apart, together)
    sine = np.sin(angle)
    near = sine < _SMALL
    sine = np.where(near, 1.0, sine)
    one, other = np.sin((1.0 - share) * angle) / sine, np.sin(share * angle) / sine
    turned = np.where(near, found[:, 3:7], one * first + other * last)
    found[:, 3:7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return found


# Below this sine of the angle slerp and a straight line are the same.
_SMALL = 1e-9


def on_one_side(turns: Array) -> Array:
    """Return quaternions (K, 4), each on the side of the one before."""
    found = np.array(turns)
    for k in range(1, len(found)):
        if found[k] @ found[k - 1] < 0.0:
            found[k] *= -1.0
    return found
