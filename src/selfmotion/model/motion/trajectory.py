"""Joint motions over time: interpolation, files, joining and reversal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    FileFormatError,
    as_number,
    as_path,
    digest_of,
    plain_numbers,
    read_only,
    read_table,
    series,
    shown,
)
from selfmotion.model.motion.spline import Spline, differentiated, evaluated, inner_roots, may_pass

# Suffixes of the columns of a joint's rates → the word for several.
_MANY = {"_velocity": "velocities", "_acceleration": "accelerations"}
_RATES = tuple(_MANY)
# A last sample as near as this to the end counts as the end [s].
_MOMENT = 0.5e-9
# Largest number of samples: more do not fit into memory, and no controller takes them.
MAX_SAMPLES = 1e7
# Difference of times that are the same [s].
_INSTANT = 1e-9


def column_names(joint_names: Sequence[str]) -> list[str]:
    """Return the names of the columns of a motion's table: t, and each joint's q, q̇ and q̈."""
    return ["t", *(name + ending for ending in ("", *_RATES) for name in joint_names)]


def read_columns(
    file: str | Path, degrees: bool
) -> tuple[Array, tuple[str, ...], tuple[Array, Array | None, Array | None]]:
    """Return times (N,), the joints' names, and q, q̇, q̈ (N, n) as far as they are given.

    Raises
    ------
    FileFormatError
        The file cannot be read, or a column is missing.
    """
    header, table = read_table(as_path(file))
    column = {name: table[:, i] for i, name in enumerate(header)}
    names = tuple(name for name in header if name != "t" and not name.endswith(_RATES))
    if "t" not in column or not names:
        raise FileFormatError(
            f"{file}: the header is {','.join(header)}, expected t and a column per joint"
        )
    scale = np.pi / 180.0 if degrees else 1.0

    def table_of(ending: str) -> Array:
        return scale * np.stack([column[name + ending] for name in names], axis=1)

    rates: list[Array | None] = [None, None]
    for order, ending in enumerate(_RATES):
        given = {name for name in header if name.endswith(ending)}
        if not given:
            continue
        wanted = {name + ending for name in names}
        if given != wanted:
            raise FileFormatError(
                f"{file}: column '{min(given ^ wanted)}' does not match; {_MANY[ending]} are given "
                f"for all joints or for none, as NAME{ending}"
            )
        rates[order] = table_of(ending)
    if rates[0] is None and rates[1] is not None:
        raise FileFormatError(
            f"{file}: has accelerations but no velocities; give NAME{_RATES[0]} as well"
        )
    return column["t"], names, (table_of(""), rates[0], rates[1])


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Joint motion as a Hermite spline, exact at the samples, as controllers read it.

    Quintic, with continuous acceleration, where accelerations are given; cubic where they are not.

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
    qdd : (N, n), optional
        Joint accelerations [rad/s² or m/s²].

    Raises
    ------
    FileFormatError
        Shapes do not agree, a number is not finite, or times do not increase.
    """

    t: Array
    q: Array
    qd: Array
    joint_names: tuple[str, ...]
    qdd: Array | None = None

    def __post_init__(self) -> None:
        given = ("t", "q", "qd") if self.qdd is None else ("t", "q", "qd", "qdd")
        for name in given:
            values = plain_numbers(getattr(self, name))
            if values is None or (name == "t" and values.ndim != 1):
                found = shown(getattr(self, name))
                raise FileFormatError(f"trajectory: {name} is {found}, expected numbers")
            object.__setattr__(self, name, read_only(values))
        names = self.joint_names
        if not (isinstance(names, list | tuple) and all(isinstance(name, str) for name in names)):
            raise FileFormatError(f"trajectory: joint_names is {shown(names)}, expected texts")
        object.__setattr__(self, "joint_names", tuple(names))
        shape = (len(self.t), len(self.joint_names))
        if len(self.t) < 2 or self.q.shape != shape or self.qd.shape != shape:
            raise FileFormatError(
                f"trajectory: t {self.t.shape}, q {self.q.shape}, qd {self.qd.shape}, "
                f"expected (N,), {shape} and {shape} with N ≥ 2"
            )
        if self.qdd is not None and self.qdd.shape != shape:
            raise FileFormatError(f"trajectory: qdd {self.qdd.shape}, expected {shape}")
        for name in given:
            bad = np.argwhere(~np.isfinite(getattr(self, name)))
            if len(bad):
                raise FileFormatError(f"trajectory: {name}{bad[0].tolist()} is not finite")
        late = np.flatnonzero(np.diff(self.t) <= 0)
        if late.size:
            row = int(late[0]) + 1
            raise FileFormatError(
                f"trajectory: t[{row}] = {self.t[row]} does not come after {self.t[row - 1]}"
            )

    def __repr__(self) -> str:
        """Return one line: samples, times and joints."""
        return (
            f"Trajectory({len(self.t)} samples, {self.t[0]:.6g} to {self.t[-1]:.6g} s, joints "
            f"{', '.join(self.joint_names)})"
        )

    @classmethod
    def from_csv(cls, file: str | Path, *, degrees: bool = False) -> Trajectory:
        """Read a motion of any other tool.

        The columns are ``t`` [s], one per joint for q under the joint's name [rad or m], and
        optionally ``NAME_velocity`` for q̇ and ``NAME_acceleration`` for q̈; in any order, separated
        by comma, semicolon or tab. Without velocities they are those of a cubic spline through the
        positions.

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
        t, names, (q, qd, qdd) = read_columns(file, degrees)
        try:
            given = cls(t, q, q if qd is None else qd, names, qdd)
        except FileFormatError as error:
            raise FileFormatError(f"{file}: {error}") from error
        if qd is not None:
            return given
        from scipy.interpolate import CubicSpline

        return cls(given.t, given.q, CubicSpline(given.t, given.q)(given.t, 1), given.joint_names)

    @cached_property
    def digest(self) -> str:
        """Digest of all numbers and names, which identifies the motion."""
        return digest_of(self.joint_names, self.t, self.q, self.qd, self.qdd)

    def of_joints(self, names: Sequence[str]) -> Trajectory:
        """Return the same motion with its joints in another order.

        Raises
        ------
        FileFormatError
            A joint is missing, or there is an additional one; it is named.
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
        faster = None if self.qdd is None else self.qdd[:, order]
        return Trajectory(self.t, self.q[:, order], self.qd[:, order], wanted, faster)

    @property
    def duration(self) -> float:
        """Time from first to last sample [s]."""
        return float(self.t[-1] - self.t[0])

    def extremes(self, order: int) -> tuple[Array, Array]:
        """Return the least and the largest value of each joint over the whole motion.

        Exact: of each polynomial at both its ends and where its next derivative is 0.

        Parameters
        ----------
        order : {0, 1, 2, 3}
            Of q (0), q̇ (1), q̈ (2) or the jerk (3).

        Returns
        -------
        t, values : (2, n)
            Times and values: the least in the first row, the largest in the second.
        """
        self._check_order(order)
        if order not in self._extremes:
            self._extremes[order] = self._extremes_of(order)
        return self._extremes[order]

    @cached_property
    def _extremes(self) -> dict[int, tuple[Array, Array]]:
        return {}

    def _extremes_of(self, order: int) -> tuple[Array, Array]:
        joints = np.arange(len(self.joint_names))
        t = np.full((2, len(joints)), self.t[0])
        values = np.tile(self._spline.segments(np.zeros(1, dtype=np.intp), order)[0], (2, 1))
        for k in self._spline.chunks():
            segments = self._spline.segments(k, order)
            ends = np.concatenate([values, segments[0], segments.sum(axis=0)])
            both = np.stack([ends.argmin(axis=0), ends.argmax(axis=0)])
            starts = np.concatenate([self.t[:2], self.t[k], self.t[k + 1]])
            before = t[np.minimum(both, 1), joints]
            t, values = np.where(both < 2, before, starts[both]), ends[both, joints]
            # Inner extrema only where the Bernstein hull of a polynomial exceeds all ends.
            some, of = np.nonzero(may_pass(segments, *values))
            chosen = segments[:, some, of]
            roots = inner_roots(differentiated(chosen))
            inner = evaluated(chosen, roots)
            for joint in np.unique(of):
                own = of == joint
                first = k[some[own]]
                within = self.t[first] + (self.t[first + 1] - self.t[first]) * roots[:, own]
                found = inner[:, own].ravel()
                for side, best in enumerate((found.argmin(), found.argmax())):
                    beyond = found[best] - values[side, joint]
                    if beyond > 0.0 if side else beyond < 0.0:
                        values[side, joint], t[side, joint] = found[best], within.flat[best]
        return read_only(t), read_only(values)

    def acceleration_jumps(self) -> tuple[Array, Array]:
        """Return when q̈ of each joint jumps most, and by how much, (n,) each [s], [rad or m/s²].

        Quintics do not jump, cubics do at their samples.
        """
        if self.qdd is not None or len(self.t) < 3:
            return np.full(self.q.shape[1], self.t[0]), np.zeros(self.q.shape[1])
        segments = self._spline.segments(np.arange(len(self.t) - 1), 2)
        jumps = np.abs(segments[0, 1:] - segments[:, :-1].sum(axis=0))
        worst = np.argmax(jumps, axis=0)
        return self.t[1 + worst], jumps[worst, np.arange(jumps.shape[1])]

    def travelled(self, t: Array) -> Array:
        """Return each joint's path length up to times (K,), (K, n) [rad or m]: ∫ |q̇| dt.

        Exact: from one turn, where q̇ = 0, to the next.
        """
        return self._spline.travelled(t)

    def __call__(self, t: npt.ArrayLike, order: int = 0) -> Array:
        """Return q (`order` 0), q̇ (1), q̈ (2) or the jerk (3) at `t`.

        Parameters
        ----------
        t : float or (K,)
            Times within the motion [s].
        order : {0, 1, 2, 3}
            Derivative with respect to time. The last one or two of a cubic, and the jerk of a
            quintic, jump at the samples.

        Returns
        -------
        (n,) or (K, n)

        Raises
        ------
        ValueError
            A time is outside the motion, or `order` is not 0, 1, 2 or 3.
        """
        times = plain_numbers(t)
        if times is None:
            raise ValueError(f"t is {shown(t)}, expected times [s]")
        self._check_order(order)
        # Written so that NaN is outside too.
        if times.size and not (times.min() >= self.t[0] and times.max() <= self.t[-1]):
            raise ValueError(
                f"time {times.min()}..{times.max()} s is outside the motion, "
                f"{self.t[0]}..{self.t[-1]} s"
            )
        return self._spline.at(times, order)

    def within(self, shares: Array, order: int = 0) -> Array:
        """Return a derivative at these shares (S,) of each interval, and at the end, (…, n)."""
        return self._spline.within(shares, order)

    def polynomials(self, middle: Array, half: Array) -> Array:
        """Return the motion on intervals without samples, as polynomials of u, (m, I, n).

        Coefficients of 1, u, u² … with u from -1 to 1 over the interval of this middle and half
        width (I,) [s].
        """
        k, s = self._spline.place(middle)
        share = (half / (self.t[k + 1] - self.t[k]))[:, None]
        return series.recentred(self._spline.segments(k), s[:, None], share)

    def sample_times(self, rate: float) -> Array:
        """Return the times from the start [s] of `rate` samples per second, and of the end, (K,).

        Raises
        ------
        ValueError
            The rate is not positive, or gives too many samples.
        """
        rate = as_number(rate, "rate", above=0.0, error=ValueError)
        if self.duration * rate > MAX_SAMPLES:
            raise ValueError(
                f"rate is {rate:g} samples per second, which are {self.duration * rate:.3g} in "
                f"all; expected at most {MAX_SAMPLES:g}"
            )
        count = int(np.floor(self.duration * rate * (1.0 + 1e-12)))
        t = np.arange(count + 1) / rate
        return np.append(t, self.duration) if self.duration - t[-1] > _MOMENT else t

    def sample(self, rate: float) -> Trajectory:
        """Return the motion at `rate` samples per second [1/s], the last one at its end.

        Raises
        ------
        ValueError
            The rate is not positive, or gives too many samples.
        """
        t = np.minimum(self.t[0] + self.sample_times(rate), self.t[-1])
        t[-1] = self.t[-1]
        return Trajectory(t, self(t), self(t, 1), self.joint_names, self(t, 2))

    def _check_order(self, order: int) -> None:
        if order not in (0, 1, 2, 3):
            raise ValueError(f"order is {shown(order)}, expected 0, 1, 2 or 3")

    @cached_property
    def _spline(self) -> Spline:
        return Spline(self.t, self.q, self.qd, self.qdd)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A motion of the objective, on its own: nothing done later changes it.

    Attributes
    ----------
    x : (size,)
        The decision vector.
    terms : dict
        Contribution of each cost to F.
    trajectory : Trajectory
        Its nodes put onto the path, unless damped.
    damped : bool
        Whether the inverse was damped anywhere.
    """

    x: Array
    terms: dict[str, float]
    trajectory: Trajectory
    damped: bool

    @property
    def cost(self) -> float:
        """F."""
        return sum(self.terms.values())


def joined_motions(motions: Sequence[Trajectory]) -> Trajectory:
    """Return motions one after the other as one, from t = 0 on.

    Each starts in the configuration, and with the velocity and acceleration, in which the one
    before it ends. Cubic where all of them are. Otherwise all become quintic, and the cubics change
    slightly between their samples.
    """
    orders = _orders(motions)
    t, tables = [motions[0].t[:1] * 0.0], [[motions[0](motions[0].t[:1], k)] for k in orders]
    for motion in motions:
        t.append(t[-1][-1] + motion.t[1:] - motion.t[0])
        for order, table in enumerate(tables):
            table.append(motion(motion.t[1:], order))
    q, qd, *faster = (np.concatenate(table) for table in tables)
    return Trajectory(np.concatenate(t), q, qd, motions[0].joint_names, *faster)


def part_of_motion(motion: Trajectory, first: float, last: float) -> Trajectory:
    """Return the part of a motion between two times since its begin [s], from t = 0 on."""
    first, last = motion.t[0] + first, min(motion.t[0] + last, motion.t[-1])
    inside = motion.t[(motion.t > first + _INSTANT) & (motion.t < last - _INSTANT)]
    t = np.concatenate([[first], inside, [last]])
    qdd = None if motion.qdd is None else motion(t, 2)
    return Trajectory(t - first, motion(t), motion(t, 1), motion.joint_names, qdd)


def reversed_motion(motion: Trajectory) -> Trajectory:
    """Return a motion backwards in time, from t = 0 on."""
    t = motion.t
    q, qd, *faster = (motion(t, order)[::-1] for order in _orders([motion]))
    return Trajectory(t[-1] - t[::-1], q, -qd, motion.joint_names, *faster)


def _orders(motions: Sequence[Trajectory]) -> range:
    """Return the orders of derivatives that define motions between their samples."""
    return range(2 if all(motion.qdd is None for motion in motions) else 3)


def slowdown_of(motion: Trajectory, limits: Sequence[Array]) -> float:
    """Return the factor by which a motion has to be slowed to be within limits at all times.

    Of q̇, q̈, … in turn, (n,) each; inf for none. Below 1 it might be faster.
    """
    shares = (
        float((np.abs(motion.extremes(order)[1]) / limit).max()) ** (1.0 / order)
        for order, limit in enumerate(limits, 1)
        if np.isfinite(limit).any()
    )
    return max(shares, default=0.0)
