"""Chunks: timed tool poses for the next seconds, from a policy or a camera, and their blends.

A chunk is blended with the path that was followed before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, Flags, PathError, as_numbers, read_only, restore, shown
from selfmotion.model.motion import differentiated, evaluated, hermite
from selfmotion.model.path import Path, PathSamples, Waypoints, path_pose
from selfmotion.model.task import SE3, exp3, exponentials, log3, products
from selfmotion.realtime.reference import Approach, left_jacobian, resting
from selfmotion.realtime.settings import (
    CHUNK_END,
    DIFFERENCE,
    JOIN_FACTOR,
    JOIN_LONGEST,
    JOIN_SHORTEST,
)

# Shares of a blend's duration at which its rates are compared with their limits.
_SHARES = np.linspace(0.0, 1.0, 33)
# Largest step of the difference at an end, as a share of the chunk's duration.
_MAX_DIFFERENCE_SHARE = 0.25


@dataclass(frozen=True, eq=False)
class Chunk(Path):
    """Timed tool poses on the loop's clock; twists are inferred by interpolation.

    Between the poses it is `Waypoints`: positions by a cubic spline, orientations by a rotation
    spline, both of continuous acceleration. Before the first and after the last pose the tool
    starts from and comes to rest within E = 0.2 s, continuing with the twist and acceleration at
    that pose:

        p(τ) = p + v f₁(τ) + a f₂(τ),  f₁' = 1 - s(τ/E),  f₂' = τ (1 - s(τ/E)),

    with s the quintic from 0 to 1 whose first two derivatives vanish at both ends.

    Parameters
    ----------
    through : Waypoints
        Path through the poses; its time 0 is the first pose.
    begins : float
        Time of the first pose on the loop's clock [s].
    """

    through: Waypoints
    begins: float

    @classmethod
    def of(cls, times: npt.ArrayLike, poses: Sequence[SE3] | npt.ArrayLike) -> Chunk:
        """Return the chunk of poses at times.

        Parameters
        ----------
        times : (K,)
            Times on the clock of the loop [s], increasing; two or more.
        poses : sequence of SE3, or (K, 4, 4)
            Poses of the tool, world axes [m].

        Raises
        ------
        PathError
            Times do not increase or are no finite numbers, a pose is none, or their numbers
            differ.
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
        """Time of the last pose [s]."""
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
        local = np.clip(t - self.begins, 0.0, self.through.duration)
        inside = self.through.samples(local)
        samples = PathSamples(t, inside.translation, inside.rotation, inside.twist)
        for end, sign in ((0.0, -1.0), (self.through.duration, 1.0)):
            samples = self._with_rest(samples, end, sign)
        return samples

    def _with_rest(self, samples: PathSamples, end: float, sign: float) -> PathSamples:
        """Return samples, with those beyond an end on the motion from or to rest there."""
        tau = sign * (samples.t - self.begins - end)
        beyond = tau > 0.0
        if not beyond.any():
            return samples
        f1, f2, f1_rate, f2_rate = (each[:, None] for each in _rest_profile(tau[beyond]))
        twist, acceleration = self._end_derivatives(end, sign)
        offset = sign * f1 * twist + f2 * acceleration
        offset_rate = f1_rate * twist + sign * f2_rate * acceleration
        standing = PathSamples(
            samples.t[beyond],
            samples.translation[beyond],
            samples.rotation[beyond],
            np.zeros_like(offset),
        )
        return _replaced(samples, beyond, _displaced(standing, offset, offset_rate))

    def _end_derivatives(self, end: float, sign: float) -> tuple[Array, Array]:
        """Return the twist (6,) at an end, and its derivative.

        By a one-sided difference of second order.
        """
        h = min(DIFFERENCE, _MAX_DIFFERENCE_SHARE * self.through.duration)
        twist, twist_1, twist_2 = self.through.samples(end - sign * h * np.arange(3.0)).twist
        return twist, sign * (3.0 * twist - 4.0 * twist_1 + twist_2) / (2.0 * h)

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        return cls(**{**values, "through": restore(Path, values["through"])})


def _rest_profile(tau: Array) -> tuple[Array, Array, Array, Array]:
    """Return f₁, f₂ and their derivatives at times τ (K,) beyond an end; see `Chunk`."""
    u = np.minimum(tau / CHUNK_END, 1.0)
    remaining = 1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    f1 = CHUNK_END * (u - u**4 * (2.5 - 3.0 * u + u**2))
    f2 = CHUNK_END**2 * u**2 * (0.5 - u**3 * (2.0 - 2.5 * u + 6.0 / 7.0 * u**2))
    return f1, f2, remaining, CHUNK_END * u * remaining


def _displaced(samples: PathSamples, offset: Array, offset_rate: Array) -> PathSamples:
    """Return samples displaced by an offset (K, 6) with this rate: p + d, exp(φ) R."""
    rotations, angular = exponentials(offset[:, 3:], offset_rate[:, 3:])
    linear = samples.twist[:, :3] + offset_rate[:, :3]
    angular = angular + products(rotations, samples.twist[:, 3:])
    return PathSamples(
        samples.t,
        samples.translation + offset[:, :3],
        rotations @ samples.rotation,
        np.hstack([linear, angular]),
    )


def _replaced(samples: PathSamples, where: Flags, others: PathSamples) -> PathSamples:
    """Return samples with those of a mask (K,) replaced by others."""
    translation, rotation = samples.translation.copy(), samples.rotation.copy()
    twist = samples.twist.copy()
    translation[where], rotation[where] = others.translation, others.rotation
    twist[where] = others.twist
    return PathSamples(samples.t, translation, rotation, twist)


@dataclass(frozen=True, eq=False)
class Blended(Path):
    """A chunk blended with the previously followed path, with continuous acceleration.

    Until `at` it is the previous path. From then on it is the chunk plus an offset. The offset and
    its first two derivatives equal the difference of both paths at `at`, and decay to zero over
    `window` by a quintic.

    Parameters
    ----------
    after : Chunk
    at : float
        Start of the blend [s].
    window : float
        Duration of the blend [s].
    offset : (3, 6)
        Difference of both paths at `at`, of position [m] and as a rotation vector [rad], world
        axes; its derivative, and the second one.
    before : Path, optional
        The previous path, until `at`; None once the blend has begun.
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
        """Time of the last pose of the chunk [s]."""
        return self.after.until

    @property
    @override
    def duration(self) -> float:  # type: ignore[override]
        return max(self.after.duration, self.at + self.window)

    @property
    @override
    def knots(self) -> Array:
        # Without a previous path, the offset chunk is used from the blend's start on.
        before = np.zeros(1) if self.before is None else self.before.knots
        after = self.after.knots
        ends = [0.0, self.at, self.at + self.window, self.duration]
        every = np.concatenate([before[before < self.at], after[after > self.at], ends])
        return np.unique(np.clip(every, 0.0, self.duration))

    @override
    def evaluate(self, t: Array) -> PathSamples:
        offset, rate = _decaying_offset(np.asarray(self.offset), self.window, t - self.at)
        samples = _displaced(resting(self.after, t), offset, rate)
        is_before = t < self.at
        if self.before is None or not is_before.any():
            return samples
        return _replaced(samples, is_before, resting(self.before, t[is_before]))

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        before = values.get("before")
        parts = {"after": restore(Path, values["after"])}
        return cls(**{**values, **parts, "before": before and restore(Path, before)})


def _decaying_offset(offset: Array, window: float, tau: Array) -> tuple[Array, Array]:
    """Return an offset and its rate, (K, 6) each, that decays from `offset` (3, 6) to zero.

    Over `window` by a quintic; constant before τ = 0.
    """
    u = np.clip(tau / window, 0.0, 1.0)[:, None]
    coefficients = hermite(
        np.full((1, 1), window), *((row[None], 0.0 * row[None]) for row in offset)
    )
    value, slope = (
        evaluated(polynomial, u) for polynomial in (coefficients, differentiated(coefficients))
    )
    inside = (tau >= 0.0) & (tau <= window)
    return value, slope * inside[:, None] / window


def blend(previous: Path | None, chunk: Chunk, now: float, approach: Approach) -> Path:
    """Return a chunk blended with the path that is followed until it begins.

    The blend takes the shortest time of a geometric sequence in which its rates are within the
    limits of `approach`. A pending blend that has not begun is replaced.
    """
    at = max(now, chunk.begins)
    if isinstance(previous, Blended) and previous.before is not None:
        previous = previous.before if previous.at > now else replace(previous, before=None)
    if previous is None:
        return chunk
    # The rates' derivative by a central difference.
    t = at + DIFFERENCE * np.array([-1.0, 0.0, 1.0])
    offsets, rates = _offset_between(resting(previous, t), resting(chunk, t))
    second = (rates[2] - rates[0]) / (2.0 * DIFFERENCE)
    offset = np.stack([offsets[1], rates[1], second])
    window = JOIN_SHORTEST
    while window < JOIN_LONGEST and not _is_within_limits(offset, window, approach):
        window *= JOIN_FACTOR
    return Blended(chunk, at, window, offset, previous if at > now else None)


def _offset_between(path: PathSamples, reference: PathSamples) -> tuple[Array, Array]:
    """Return the offset of a path from a reference and its rate, (K, 6) each: as in `Blended`."""
    translation_offset = path.translation - reference.translation
    translation_rate = path.twist[:, :3] - reference.twist[:, :3]
    rotation_vectors = np.array(
        [log3(a @ b.T) for a, b in zip(path.rotation, reference.rotation, strict=True)]
    )
    vector_rates = np.array(
        [
            np.linalg.solve(left_jacobian(phi), twist[3:] - exp3(phi) @ reference_twist[3:])
            for phi, twist, reference_twist in zip(
                rotation_vectors, path.twist, reference.twist, strict=True
            )
        ]
    )
    offset = np.hstack([translation_offset, rotation_vectors])
    return offset, np.hstack([translation_rate, vector_rates])


def _is_within_limits(offset: Array, window: float, approach: Approach) -> bool:
    """Return whether an offset decays within the limits of the approach."""
    _, rates = _decaying_offset(offset, window, window * _SHARES)
    accelerations = np.diff(rates, axis=0) / (window * _SHARES[1])
    limits = (
        (rates[:, :3], approach.speed),
        (rates[:, 3:], approach.turning),
        (accelerations[:, :3], approach.acceleration),
        (accelerations[:, 3:], approach.turning_acceleration),
    )
    return all(float(np.linalg.norm(x, axis=1).max()) <= limit for x, limit in limits)
