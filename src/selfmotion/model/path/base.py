"""Base of tool motions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, overload

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import (
    Array,
    PathError,
    Saved,
    as_number,
    as_numbers,
    plain_numbers,
    read_only,
    restore,
    series,
    shown,
)
from selfmotion.model.path.feed_profile import FeedProfile
from selfmotion.model.task import SE3, Task, as_pose, skew

# Excess of a last time such as 50 * 0.02 that counts as rounding, relative.
_TIME_SLACK = 1e-9
# Stands for a zero duration in divisions.
_TINY = np.finfo(float).tiny
# Longer motions than this [s] are typing errors.
_LONGEST = 1e9


@dataclass(frozen=True, eq=False)
class PathSamples:
    """A tool motion at K times, world axes.

    Attributes
    ----------
    t : (K,)
        Times [s].
    translation : (K, 3)
        Position of the tool frame's origin [m].
    rotation : (K, 3, 3)
        Orientation of the tool frame.
    twist : (K, 6)
        [v, ω]: velocity of the origin [m/s], angular velocity [rad/s].
    """

    t: Array
    translation: Array
    rotation: Array
    twist: Array


class PathSeries(NamedTuple):
    """Majorants of a tool motion over I intervals of time; see `selfmotion.basics.series`.

    Attributes
    ----------
    translation, rotation : (K + 1, I)
        Of the position [m], from its first derivative on, and of the orientation.
    """

    translation: Array
    rotation: Array


class Path(Saved, ABC, family="path"):
    """A tool motion over [0, duration]; poses and twists in world axes.

    A path of one's own gives `duration` and `evaluate`, and `knots` where it is not smooth
    throughout; `selfmotion.testing.check_path` checks it. As a dataclass it saves and loads like
    ours.

    Attributes
    ----------
    duration : float
        Length of the motion [s].
    """

    duration: float

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes before it is followed, in words."""
        return tuple(self.__dict__.get("_notes", ()))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.duration:.6g} s)"

    @property
    def oriented(self) -> bool:
        """Whether orientations are prescribed, or stand there only because a pose has one."""
        return True

    @property
    def knots(self) -> Array:
        """Times [s] between which the motion is C² or better, first 0, last `duration`."""
        return read_only([0.0, self.duration])

    @property
    def marks(self) -> Array:
        """Times [s] between which the motion is smooth to any order, the knots among them.

        Times of given waypoints, if any: a certificate evaluates them, whatever is between.
        """
        return self.knots

    @property
    def rounded(self) -> Array:
        """Intervals of rounded corners: first and last times [s], (C, 2)."""
        return np.zeros((0, 2))

    @property
    def feeds(self) -> tuple[FeedProfile, ...]:
        """Feeds of the path with their own errors; a certificate judges them."""
        return ()

    @property
    def original(self) -> Path | None:
        """The path that it is made of: at another pace, in another frame; None for others."""
        return None

    @abstractmethod
    def evaluate(self, t: Array) -> PathSamples:
        """Return the motion at times (K,) known to lie in [0, duration].

        The twist must be the time derivative of the pose.
        """

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """Return bounds of all derivatives, for proofs; None where they are not known.

        For intervals of these middles and half widths (I,) [s], none of which contains a mark. A
        path without is checked at samples only, and the verdict says so.
        """
        return None

    def samples(self, t: npt.ArrayLike) -> PathSamples:
        """Return the motion at times `t` (K,) [s].

        Raises
        ------
        PathError
            A time is outside [0, duration].
        """
        return self.evaluate(self._given_times(t)[0])

    def _given_times(self, t: npt.ArrayLike) -> tuple[Array, bool]:
        """Return times (K,) within [0, duration], and whether `t` is a single one."""
        given = plain_numbers(t)
        if given is None or given.ndim > 1:
            raise PathError(f"t is {shown(t)}, expected times [s]")
        times = np.atleast_1d(given)
        slack = _TIME_SLACK * self.duration
        if not (np.all(times >= -slack) and np.all(times <= self.duration + slack)):
            raise PathError(
                f"{_said(times)} s is outside the path, which lasts from 0 to {self.duration:.6g} s"
            )
        return np.clip(times, 0.0, self.duration), given.ndim == 0

    def noted(self, notes: Iterable[str]) -> Path:
        """Give the path notes, unless there are none; return it."""
        found = tuple(notes)
        if found:
            # Paths may be frozen; notes are no part of their value.
            object.__setattr__(self, "_notes", found)
        return self

    def at_constant_speed(self) -> Path:
        """Return the same path at a pace without rests, if it has one."""
        return self

    def __add__(self, other: Path) -> Path:
        """Return this path and then the other one; see `Joined`."""
        if not isinstance(other, Path):
            return NotImplemented
        # By its registered kind: its file imports this one.
        joined: Callable[[Sequence[Path]], Path] = Path.kinds()["joined"]
        return joined([self, other])

    @overload
    def pose(self, t: float) -> SE3: ...

    @overload
    def pose(self, t: Array | Sequence[float]) -> list[SE3]: ...

    def pose(self, t: npt.ArrayLike) -> SE3 | list[SE3]:
        """Return the tool's pose at time `t` [s]; at times (K,) a list of K.

        Raises
        ------
        PathError
            A time is outside [0, duration].
        """
        samples = self.samples(t)
        poses = [SE3(*item) for item in zip(samples.rotation, samples.translation, strict=True)]
        return poses[0] if np.ndim(t) == 0 else poses

    def twist(self, t: npt.ArrayLike) -> Array:
        """Return [v, ω] at time `t` [s], (6,) in [m/s, rad/s]; at times (K,) (K, 6).

        Raises
        ------
        PathError
            A time is outside [0, duration].
        """
        twists: Array = self.samples(t).twist
        return twists[0] if np.ndim(t) == 0 else twists


class _Derived(Path):
    """A tool motion derived from another one."""

    _path: Path

    @property
    @override
    def original(self) -> Path:
        return self._path

    @abstractmethod
    def when(self, wanted: Array) -> Array:
        """Return when times of the original (K,) are passed, (K,) [s]."""

    @property
    @override
    def notes(self) -> tuple[str, ...]:
        """Those of the original as well."""
        return tuple(dict.fromkeys((*self._path.notes, *super().notes)))

    @property
    @override
    def oriented(self) -> bool:
        """As the original."""
        return self._path.oriented

    def _at_pace(self, t: Array, sigma: Array, rate: Array) -> PathSamples:
        """Return the original at its times σ (K,), run through at dσ/dt (K,), as samples at t."""
        original = self._path.samples(sigma)
        twist = original.twist * rate[:, None]
        return PathSamples(t, original.translation, original.rotation, twist)

    def _series_at(self, sigma: Array, pace: Array) -> PathSeries | None:
        """Return the original's series at its times σ (I,) in the middle, σ having a series."""
        reach = series.after_first(pace)
        known = path_series(self._path, sigma, np.maximum(reach, _TINY))
        share = pace / np.maximum(reach, _TINY)
        return known and PathSeries(*(series.composed(item, share) for item in known))

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        return cls(**{**values, "path": restore(Path, values["path"])})


class _InStep(_Derived):
    """One that is elsewhere than the original, but at the same times."""

    @override
    def when(self, wanted: Array) -> Array:
        """At the same times."""
        return wanted

    @property
    @override
    def knots(self) -> Array:
        return self._path.knots

    @property
    @override
    def marks(self) -> Array:
        return self._path.marks

    @property
    @override
    def rounded(self) -> Array:
        return self._path.rounded

    @property
    @override
    def feeds(self) -> tuple[FeedProfile, ...]:
        return self._path.feeds


def path_series(path: Path, middle: Array, half: Array) -> PathSeries | None:
    """Return `Path.series`, but None where a class derived from ours moves otherwise than ours."""
    moving = ("evaluate", "samples", "knots", "marks")
    return path.series(middle, half) if series.holds_for(path, *moving) else None


def turning(bounds: Array) -> PathSeries:
    """Return the series of a tool that turns by rotation vectors of these bounds, at a place."""
    return PathSeries(np.zeros_like(bounds), series.exponential(bounds))


# Speed below which the tool is at rest [m/s, rad/s]: waypoints and velocity functions rest up to
# rounding.
REST_SPEED = 1e-7


def path_pose(pose: SE3 | npt.ArrayLike, name: str) -> SE3:
    """Return `pose` (an SE3 or a (4, 4) matrix) as an SE3 of its own; PathError otherwise."""
    return as_pose(pose, name, PathError)


def check_path(path: Path, name: str) -> Path:
    """Return `path`; PathError unless it is one."""
    if not isinstance(path, Path):
        raise PathError(f"{name} is {shown(path)}, expected a Path (Line, Circle, Waypoints, …)")
    return path


def check_oriented(path: Path, task: Task) -> None:
    """Raise PathError for a path of positions where a task prescribes orientations."""
    if task.angular and not path.oriented:
        raise PathError(
            f"the path has positions but no orientations, which task '{task.value}' prescribes; "
            f"give quaternions, or take a task that leaves them free (task='position')"
        )


def check_duration(duration: float) -> float:
    """Return `duration` as a float; PathError unless it is positive and finite."""
    return as_number(duration, "duration", above=0.0, most=_LONGEST, error=PathError)


def check_vector(values: npt.ArrayLike, name: str) -> Array:
    """Return `values` as three finite numbers, read-only; PathError otherwise."""
    return as_numbers(values, name, "three finite numbers", (3,), PathError)


def unit(vectors: Array) -> Array:
    """Return `vectors` (…, k) with length 1; those that have it to rounding stay bit for bit."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(np.abs(lengths - 1.0) < 1e-14, vectors, vectors / lengths)


def rotations_about(axis: Array, angles: Array) -> Array:
    """Return exp([axis]× angle) for each of K angles about a unit axis, (K, 3, 3) (Rodrigues)."""
    cross = skew(axis)
    return np.asarray(
        np.eye(3)
        + np.sin(angles)[:, None, None] * cross
        + (1.0 - np.cos(angles))[:, None, None] * (cross @ cross)
    )


def rotvecs(turns: Array) -> Array:
    """Return the rotation vectors from each quaternion (N, 4) to the next, (N - 1, 3) [rad]."""
    from scipy.spatial.transform import Rotation

    rotations = Rotation.from_quat(turns, scalar_first=True)
    return np.asarray((rotations[:-1].inv() * rotations[1:]).as_rotvec())


def _said(times: Array) -> str:
    low, high = f"{np.min(times):.6g}", f"{np.max(times):.6g}"
    return f"time {low}" if low == high else f"times {low} to {high}"
