"""A joint motion over time."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, FileFormatError, read_only


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Joint motion as a cubic Hermite spline: exact in q and q̇ at the samples, C¹ between them.

    Attributes
    ----------
    t : (N,)
        Sample times [s], strictly increasing.
    q : (N, n)
        Joint coordinates [rad or m].
    qd : (N, n)
        Joint velocities [rad/s or m/s].
    joint_names : tuple of str
        Names of the n joints.

    Raises
    ------
    FileFormatError
        Shapes do not agree, a number is not finite, or times do not increase.
    """

    t: Array
    q: Array
    qd: Array
    joint_names: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("t", "q", "qd"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        shape = (len(self.t), len(self.joint_names))
        if len(self.t) < 2 or self.q.shape != shape or self.qd.shape != shape:
            raise FileFormatError(
                f"trajectory: t {self.t.shape}, q {self.q.shape}, qd {self.qd.shape}, "
                f"expected (N,), {shape} and {shape} with N ≥ 2"
            )
        for name in ("t", "q", "qd"):
            bad = np.argwhere(~np.isfinite(getattr(self, name)))
            if len(bad):
                raise FileFormatError(f"trajectory: {name}{bad[0].tolist()} is not finite")
        late = np.flatnonzero(np.diff(self.t) <= 0)
        if late.size:
            row = int(late[0]) + 1
            raise FileFormatError(
                f"trajectory: t[{row}] = {self.t[row]} does not come after {self.t[row - 1]}"
            )

    @property
    def duration(self) -> float:
        """Time from first to last sample [s]."""
        return float(self.t[-1] - self.t[0])

    def accelerations(self) -> tuple[Array, Array]:
        """Return all extremes of q̈: times (2N - 2,) and q̈ (2N - 2, n) there.

        Between two samples q̈ is linear, so that its extremes are those at both ends.
        """
        inner = self.t[1:] - 1e-9 * np.diff(self.t)
        times = np.stack([self.t[:-1], inner], axis=1).ravel()
        return times, self(times, order=2)

    def __call__(self, t: npt.ArrayLike, order: int = 0) -> Array:
        """Return q (`order` 0), q̇ (1), q̈ (2) at `t`.

        Parameters
        ----------
        t : float or (K,)
            Times within the motion [s].
        order : {0, 1, 2}
            Derivative with respect to time. q̈ is that of the cubic: it jumps at the samples.

        Returns
        -------
        (n,) or (K, n)

        Raises
        ------
        ValueError
            A time is outside the motion, or `order` is not 0, 1 or 2.
        """
        times = np.asarray(t, dtype=np.float64)
        if order not in _HERMITE:
            raise ValueError(f"order is {order}, expected 0, 1 or 2")
        if not (np.all(times >= self.t[0]) and np.all(times <= self.t[-1])):
            raise ValueError(
                f"time {times.min()}..{times.max()} s is outside the motion, "
                f"{self.t[0]}..{self.t[-1]} s"
            )
        k = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.t) - 2)
        h = self.t[k + 1] - self.t[k]
        s = (times - self.t[k]) / h
        start, end, start_slope, end_slope = _HERMITE[order](s, h)
        return np.asarray(
            start[..., None] * self.q[k]
            + end[..., None] * self.q[k + 1]
            + start_slope[..., None] * self.qd[k]
            + end_slope[..., None] * self.qd[k + 1]
        )


_Weights = tuple[Array, Array, Array, Array]


def _value(s: Array, h: Array) -> _Weights:
    rest = 1.0 - s
    end = s * s * (3.0 - 2.0 * s)
    return 1.0 - end, end, h * s * rest * rest, -h * s * s * rest


def _slope(s: Array, h: Array) -> _Weights:
    end = 6.0 * s * (1.0 - s) / h
    return -end, end, (1.0 - s) * (1.0 - 3.0 * s), s * (3.0 * s - 2.0)


def _curvature(s: Array, h: Array) -> _Weights:
    end = (6.0 - 12.0 * s) / h**2
    return -end, end, (6.0 * s - 4.0) / h, (6.0 * s - 2.0) / h


_HERMITE = {0: _value, 1: _slope, 2: _curvature}
