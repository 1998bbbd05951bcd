"""Chunks: poses for the next seconds, from a policy or a camera, each joined to the last one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, PathError, as_numbers, read_only, restore, shown
from selfmotion.model.motion import differentiated, evaluated, hermite
from selfmotion.model.path import Path, PathSamples, Waypoints, path_pose
from selfmotion.model.task import SE3, exp3, log3, turning
from selfmotion.realtime.reference import Approach, left_jacobian, resting
from selfmotion.realtime.settings import (
    CHUNK_END,
    DIFFERENCE,
    JOIN_FACTOR,
    JOIN_LONGEST,
    JOIN_SHORTEST,
)

# Shares of the time of a join at which its rates are held against their limits.
_SHARES = np.linspace(0.0, 1.0, 33)


@dataclass(frozen=True, eq=False)
class Chunk(Path):
    """Poses of the tool at times of the loop's clock, for some seconds, with twists inferred.

    Between the poses it is `Waypoints`: positions by a cubic spline, orientations by a rotation
    spline, both of continuous acceleration. Before the first and after the last pose the tool comes
    from rest and comes to rest within 0.2 s, on the twist and the acceleration that it has there:

        p(τ) = p + v f₁(τ) + a f₂(τ),  f₁' = 1 - s(τ/E),  f₂' = τ (1 - s(τ/E)),

    with s the quintic from 0 to 1 whose first two derivatives vanish at both ends.

    Parameters
    ----------
    through : Waypoints
        The poses; its time 0 is that of the first one.
    begins : float
        When that is, on the clock of the loop [s].
    """

    through: Waypoints
    begins: float

    @classmethod
    def of(cls, times: npt.ArrayLike, poses: Sequence[SE3] | npt.ArrayLike) -> Chunk:
        """Return the chunk of poses at times.

        Parameters
        ----------
        times : (K,)
            On the clock of the loop [s], increasing; two or more.
        poses : sequence of SE3, or (K, 4, 4)
            Of the tool, world axes [m].

        Raises
        ------
        PathError
            Times do not increase or are no finite numbers, a pose is none, or there is another
            number of them.
        """
        listed: Any = poses
        if not isinstance(listed, Sequence | np.ndarray) or isinstance(listed, str):
            raise PathError(f"chunk: poses is {shown(poses)}, expected a list of poses")
        count = len(listed)
        if count < 2:
            raise PathError(f"chunk: has {count} poses, expected two or more")
        what = f"{count} finite numbers, one for each pose [s]"
        t = as_numbers(times, "chunk: times", what, (count,), PathError)
        late = np.flatnonzero(np.diff(t) <= 0.0)
        if late.size:
            k = int(late[0])
            raise PathError(
                f"chunk: times[{k + 1}] = {t[k + 1]:.6g} s does not come after times[{k}] = "
                f"{t[k]:.6g} s, expected times that increase"
            )
        frames = [path_pose(pose, f"chunk: poses[{k}]") for k, pose in enumerate(listed)]
        return cls(Waypoints.from_poses(t, frames), float(t[0]))

    @property
    def until(self) -> float:
        """When the last pose is [s]."""
        return self.begins + self.through.duration

    @property
    @override
    def duration(self) -> float:  # type: ignore[override]
        return max(self.until + CHUNK_END, CHUNK_END)

    @property
    @override
    def knots(self) -> Array:
        inner = self.begins + self.through.knots
        every = [0.0, self.begins - CHUNK_END, *inner, self.duration]
        return np.unique(np.clip(every, 0.0, self.duration))

    @override
    def evaluate(self, t: Array) -> PathSamples:
        own = t - self.begins
        inside = np.clip(own, 0.0, self.through.duration)
        found = self.through.samples(inside)
        translation, rotation, twist = found.translation, found.rotation, found.twist
        for at, sign, outside in (
            (0.0, -1.0, own < 0.0),
            (self.through.duration, 1.0, own > self.through.duration),
        ):
            if not outside.any():
                continue
            first, second, slope, bend = _fading(sign * (own[outside] - at))
            rate, change = self._end(at, sign)
            way = sign * first[:, None] * rate + second[:, None] * change
            rates = slope[:, None] * rate + sign * bend[:, None] * change
            turned, angular = turning(way[:, 3:], rates[:, 3:])
            translation, rotation, twist = translation.copy(), rotation.copy(), twist.copy()
            translation[outside] += way[:, :3]
            rotation[outside] = turned @ rotation[outside]
            twist[outside] = np.hstack([rates[:, :3], angular])
        return PathSamples(t, translation, rotation, twist)

    def _end(self, at: float, sign: float) -> tuple[Array, Array]:
        """Return the twist and its derivative (6,) at an end, by differences to the inside."""
        h = min(DIFFERENCE, 0.25 * self.through.duration)
        one, two, three = self.through.samples(at - sign * h * np.arange(3.0)).twist
        return one, sign * (3.0 * one - 4.0 * two + three) / (2.0 * h)

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        return cls(**{**values, "through": restore(Path, values["through"])})


def _fading(tau: Array) -> tuple[Array, Array, Array, Array]:
    """Return f₁, f₂, f₁' and f₂' at times (K,) beyond an end [s], see `Chunk`."""
    u = np.minimum(tau / CHUNK_END, 1.0)
    left = 1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    first = CHUNK_END * (u - u**4 * (2.5 - 3.0 * u + u**2))
    second = CHUNK_END**2 * u**2 * (0.5 - u**3 * (2.0 - 2.5 * u + 6.0 / 7.0 * u**2))
    return first, second, left, CHUNK_END * u * left


@dataclass(frozen=True, eq=False)
class Blended(Path):
    """A chunk that is joined to what was followed before, without a jump in acceleration.

    Up to `at` it is the path before; from there on the chunk, plus an offset of position and
    rotation that is, with its first two derivatives, the difference of both paths at `at`, and
    fades to zero, with both, by a quintic over `window`.

    Parameters
    ----------
    after : Chunk
    at : float
        When the join begins [s].
    window : float
        How long it takes [s].
    offset : (3, 6)
        The difference at `at`, of position [m] and as a rotation vector [rad], world axes; its
        derivative, and the second one.
    before : Path, optional
        What is followed up to `at`; None where that is over.
    """

    after: Chunk
    at: float
    window: float
    offset: npt.ArrayLike
    before: Path | None = None

    def __post_init__(self) -> None:
        what = "3 × 6 finite numbers"
        values = as_numbers(self.offset, "offset", what, (3, 6), PathError)
        object.__setattr__(self, "offset", read_only(values))

    @property
    def until(self) -> float:
        """When the last pose of the chunk is [s]."""
        return self.after.until

    @property
    @override
    def duration(self) -> float:  # type: ignore[override]
        return max(self.after.duration, self.at + self.window)

    @property
    @override
    def knots(self) -> Array:
        before = np.zeros(1) if self.before is None else self.before.knots
        # Where `before` is over, it is this path from its join on.
        later = self.after.knots
        own = [0.0, self.at, self.at + self.window, self.duration]
        every = np.concatenate([before[before < self.at], later[later > self.at], own])
        return np.unique(np.clip(every, 0.0, self.duration))

    @override
    def evaluate(self, t: Array) -> PathSamples:
        found = resting(self.after, t)
        translation, rotation, twist = found.translation, found.rotation, found.twist
        way, rates = quintic(np.asarray(self.offset), self.window, t - self.at)
        turned, angular = turning(way[:, 3:], rates[:, 3:])
        translation = translation + way[:, :3]
        angular = angular + np.einsum("kij,kj->ki", turned, twist[:, 3:])
        rotation, twist = turned @ rotation, np.hstack([twist[:, :3] + rates[:, :3], angular])
        early = t < self.at
        if self.before is not None and early.any():
            held = resting(self.before, t[early])
            translation[early], rotation[early] = held.translation, held.rotation
            twist[early] = held.twist
        return PathSamples(t, translation, rotation, twist)

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        before = values.get("before")
        parts = {"after": restore(Path, values["after"])}
        return cls(**{**values, **parts, "before": before and restore(Path, before)})


def quintic(offset: Array, window: float, tau: Array) -> tuple[Array, Array]:
    """Return an offset (3, 6), which fades to zero in a time, and its rate, (K, 6) each.

    0 after `window`; before τ = 0 that at 0.
    """
    u = np.clip(tau / window, 0.0, 1.0)[:, None]
    coefficients = hermite(
        np.full((1, 1), window), *((row[None], 0.0 * row[None]) for row in offset)
    )
    way, slope = (evaluated(each, u) for each in (coefficients, differentiated(coefficients)))
    inside = (tau >= 0.0) & (tau <= window)
    return way, slope * inside[:, None] / window


def joined(last: Path | None, chunk: Chunk, now: float, approach: Approach) -> Path:
    """Return a chunk joined to the path that is followed, which holds until the chunk begins.

    In the least time, from a table, in which the offset keeps the limits of the approach. A chunk
    that was to be joined later and is not yet gives way to this one.
    """
    at = max(now, chunk.begins)
    if isinstance(last, Blended) and last.before is not None:
        last = last.before if last.at > now else replace(last, before=None)
    if last is None:
        return chunk
    # The rates' derivative by a central difference.
    near = at + DIFFERENCE * np.array([-1.0, 0.0, 1.0])
    ways, rates = _difference(resting(last, near), resting(chunk, near))
    second = (rates[2] - rates[0]) / (2.0 * DIFFERENCE)
    offset = np.stack([ways[1], rates[1], second])
    window = JOIN_SHORTEST
    while window < JOIN_LONGEST and not _is_gentle(offset, window, approach):
        window *= JOIN_FACTOR
    return Blended(chunk, at, window, offset, last if at > now else None)


def _difference(one: PathSamples, other: PathSamples) -> tuple[Array, Array]:
    """Return the offset of one path from another and its rate, (K, 6) each: as in `Blended`."""
    linear = one.translation - other.translation, one.twist[:, :3] - other.twist[:, :3]
    turns = [a @ b.T for a, b in zip(one.rotation, other.rotation, strict=True)]
    vectors = np.array([log3(turn) for turn in turns])
    rates = np.array(
        [
            np.linalg.solve(left_jacobian(phi), a[3:] - exp3(phi) @ b[3:])
            for phi, a, b in zip(vectors, one.twist, other.twist, strict=True)
        ]
    )
    return np.hstack([linear[0], vectors]), np.hstack([linear[1], rates])


def _is_gentle(offset: Array, window: float, approach: Approach) -> bool:
    """Return whether an offset fades within the limits of the approach."""
    _, rates = quintic(offset, window, window * _SHARES)
    changes = np.diff(rates, axis=0) / (window * _SHARES[1])
    limits = (
        (rates[:, :3], approach.speed),
        (rates[:, 3:], approach.turning),
        (changes[:, :3], approach.acceleration),
        (changes[:, 3:], approach.turning_acceleration),
    )
    return all(float(np.linalg.norm(x, axis=1).max()) <= most for x, most in limits)
