"""A joint motion over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, FileFormatError, read_only, read_table

# What follows a joint's name in the header of the column of its velocity.
_VELOCITY = "_velocity"


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

    @classmethod
    def from_csv(cls, file: str | Path, *, degrees: bool = False) -> "Trajectory":
        """Read a motion that something else made.

        The columns are ``t`` [s], one per joint for q under the joint's name [rad or m], and
        optionally ``NAME_velocity`` for q̇; in any order, separated by comma, semicolon or tab.
        Without velocities they are those of a cubic spline through the positions.

        Parameters
        ----------
        file : path
        degrees : bool
            Whether angles are in degrees; then all columns are taken for angles.

        Raises
        ------
        FileFormatError
            The file cannot be read, a column is missing, or a row is wrong; it is named.
        """
        header, table = read_table(Path(file))
        column = {name: table[:, i] for i, name in enumerate(header)}
        rates = [name for name in header if name.endswith(_VELOCITY)]
        names = [name for name in header if name not in ("t", *rates)]
        if "t" not in column or not names:
            raise FileFormatError(
                f"{file}: the header is {','.join(header)}, expected t and a column per joint"
            )
        if rates and set(rates) != {name + _VELOCITY for name in names}:
            odd = set(rates) ^ {name + _VELOCITY for name in names}
            raise FileFormatError(
                f"{file}: column '{min(odd)}' does not match; velocities are given for all joints "
                f"or for none, as NAME{_VELOCITY}"
            )
        t = column["t"]
        q = np.stack([column[name] for name in names], axis=1)
        qd = np.stack([column[name + _VELOCITY] for name in names], axis=1) if rates else q
        try:
            given = cls(t, q, qd, tuple(names))
        except FileFormatError as error:
            raise FileFormatError(f"{file}: {error}") from error
        scale = np.pi / 180.0 if degrees else 1.0
        if rates:
            return cls(given.t, scale * given.q, scale * given.qd, given.joint_names)
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(given.t, scale * given.q)
        return cls(given.t, scale * given.q, spline(given.t, 1), given.joint_names)

    def of_joints(self, names: Sequence[str]) -> "Trajectory":
        """Return the same motion with its joints in another order.

        Raises
        ------
        FileFormatError
            A joint is missing, or there is one more; it is named.
        """
        wanted, own = tuple(names), self.joint_names
        if wanted == own:
            return self
        if len(set(own)) < len(own):
            twice = next(name for name in own if own.count(name) > 1)
            raise FileFormatError(f"trajectory: joint '{twice}' appears twice")
        for name, where, others in (
            *((name, "is missing from the trajectory", own) for name in wanted if name not in own),
            *((name, "is none of the arm's", wanted) for name in own if name not in wanted),
        ):
            raise FileFormatError(f"trajectory: joint '{name}' {where}: {', '.join(others)}")
        order = [own.index(name) for name in wanted]
        return Trajectory(self.t, self.q[:, order], self.qd[:, order], wanted)

    @property
    def duration(self) -> float:
        """Time from first to last sample [s]."""
        return float(self.t[-1] - self.t[0])

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Return the least and the largest value of each joint over the whole motion.

        Exact: of each cubic at both its ends and where its next derivative is 0.

        Parameters
        ----------
        order : {0, 1, 2}
            Of q (0), q̇ (1) or q̈ (2).

        Returns
        -------
        t, values : (2, n)
            When, and what: the least in the first row, the largest in the second.
        """
        s = _stationary(self, order)
        h, start = np.diff(self.t)[:, None, None], self.t[:-1, None, None]
        weights = _HERMITE[order](s, h)
        ends = (self.q[:-1], self.q[1:], self.qd[:-1], self.qd[1:])
        values = sum(weight * end[:, None] for weight, end in zip(weights, ends, strict=True))
        times = np.broadcast_to(start + h * s, np.shape(values))
        flat, when = np.reshape(values, (-1, self.q.shape[1])), times.reshape(-1, self.q.shape[1])
        rows = np.stack([np.argmin(flat, axis=0), np.argmax(flat, axis=0)])
        joints = np.arange(flat.shape[1])
        return when[rows, joints], flat[rows, joints]

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


def _stationary(motion: Trajectory, order: int) -> Array:
    """Return where in [0, 1] each cubic may have an extreme, (N - 1, 2 + k, n): ends, and inside.

    With q(s) = q0 + a s + b s² + c s³, the zeros of a + 2bs + 3cs² for q and of b + 3cs for q̇; q̈ is
    linear.
    """
    if order not in _HERMITE:
        raise ValueError(f"order is {order}, expected 0, 1 or 2")
    h, rise = np.diff(motion.t)[:, None], np.diff(motion.q, axis=0)
    a, z = h * motion.qd[:-1], h * motion.qd[1:]
    b, c = 3.0 * rise - 2.0 * a - z, a + z - 2.0 * rise
    ends = [np.zeros_like(rise), np.ones_like(rise)]
    inner: list[Array] = []
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if order == 1:
            inner = [-b / (3.0 * c)]
        elif order == 0:
            # Without cancellation, also where the cubic is nearly a parabola.
            u = -(b + np.copysign(np.sqrt(np.maximum(b * b - 3.0 * a * c, 0.0)), b))
            inner = [u / (3.0 * c), a / u]
    # NaN and what is outside stand at an end, which is looked at anyway.
    inside = [np.where((s > 0.0) & (s < 1.0), s, 0.0) for s in inner]
    return np.stack([*ends, *inside], axis=1)


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
