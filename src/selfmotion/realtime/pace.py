"""The pace: at what rate a path is followed, slower where limits or reach hold the arm back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.path import Path, PathSamples
from selfmotion.realtime.chunks import Blended, Chunk
from selfmotion.realtime.reference import Conveyed, MovingPose, resting
from selfmotion.realtime.settings import (
    CATCH_UP,
    CATCHING,
    JUMPED,
    ON_TIME,
    PACE_GROWS,
    PACE_KNOTS,
    PACE_WEIGHT,
    SLOWER,
    SMOOTH,
)

# Tool motions with a time of their own: they are followed as they are, or not at all.
_TIMED = MovingPose, Chunk, Blended


class Times(NamedTuple):
    """Times at which a path is looked at.

    Attributes
    ----------
    t, s, rate : (K,)
        Times on the clock [s], of the path [s], and ds/dt.
    """

    t: Array
    s: Array
    rate: Array


class Sampled(NamedTuple):
    """A path at times.

    Attributes
    ----------
    path : PathSamples
        With the twist at the rate of the times.
    along : (K, 6)
        By how much the twist grows with the rate: the twist by the path's own time.
    """

    path: PathSamples
    along: Array


def sampled(path: Path, times: Times) -> Sampled:
    """Return a path at times; finite, or ValueError.

    Of a path on a conveyor what is carried has the pace.
    """
    if isinstance(path, _TIMED):
        return Sampled(resting(path, times.t), np.zeros((len(times.t), 6)))
    if isinstance(path, Conveyed):
        inner = sampled(path.carried, times)
        return Sampled(path.moved(inner.path), inner.along)
    found = resting(path, times.s)
    if times.s is times.t:
        return Sampled(found, found.twist)
    twist = times.rate[:, None] * found.twist
    return Sampled(PathSamples(times.t, found.translation, found.rotation, twist), found.twist)


class LastPath:
    """Samples a path, or the last one without an error.

    Parameters
    ----------
    patience : float
        For how long that will do [s].

    Attributes
    ----------
    path : Path or None
        The last one without an error.
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self.path: Path | None = None
        self._without = 0.0

    def samples(
        self, path: Path | None, times: Times, waited: float, age: float, reasons: list[str]
    ) -> Sampled | None:
        """Return the path at times; the last one where it fails, and add the reason.

        Also the last one if none is given: targets have their own rate, and chunks are known until
        their last pose. None after too long: `waited` [s] since the last call, and `age` [s] since
        the observation of a given target.
        """
        if path is not None:
            found = _tried(path, times, reasons)
            if found is not None:
                self.path, self._without = path, age
                return found
        until = getattr(self.path, "until", None)
        if path is None and self.path is not None and until is not None:
            if times.t[0] <= until:
                return _tried(self.path, times, reasons)
            reasons.append(f"the last chunk ended {times.t[0] - until:.3g} s ago")
            return None
        self._without += waited
        if self.path is not None and self._without <= self._patience:
            found = None if self.path is path else _tried(self.path, times, reasons)
            if found is not None:
                return found
        if path is None:
            told = f"for {self._without:.3g} s (patience: {self._patience:.3g} s)"
            reasons.append(f"there was no target {told if self.path else 'yet'}")
        return None

    def again(self, times: Times) -> Sampled | None:
        """Return the last path at other times."""
        return None if self.path is None else _tried(self.path, times, [])

    def jumps(self, path: Path | None, times: Times) -> bool:
        """Return whether a path is elsewhere than the last one at the first of the times."""
        if path is None or self.path is None or path is self.path:
            return False
        now = Times(*(each[:1] for each in times))
        before, after = (_tried(each, now, []) for each in (self.path, path))
        if before is None or after is None:
            return before is None
        moved = np.abs(after.path.translation - before.path.translation).max()
        turned = np.abs(after.path.rotation - before.path.rotation).max()
        return bool(max(moved, turned) > JUMPED)

    @property
    def followed(self) -> Path | None:
        """The last path, while it is followed: None after too long without one."""
        return self.path if self._without <= self._patience else None


def _tried(path: Path, times: Times, reasons: list[str]) -> Sampled | None:
    """Return a path at times; None where it fails, with the reason.

    A path is the user's code: its exceptions must not leave the arm without a command.
    """
    try:
        return sampled(path, times)
    except Exception as error:
        reasons.append(f"the path failed: {type(error).__name__}: {error}")
        return None


class Pace:
    """The path's time s(τ) for times τ from now on, by a rate that is linear between knots.

    Parameters
    ----------
    horizon : float
        How far ahead it is planned [s].
    nodes : (N + 1,)
        Of the horizon [s].

    Attributes
    ----------
    delay : float
        By how much s is behind the clock [s].
    rates : (J + 1,)
        ds/dt at the knots.
    """

    def __init__(self, horizon: float, nodes: Array) -> None:
        self.knots = horizon * np.array(PACE_KNOTS)
        self.at_nodes = self.weights(nodes)
        fine = np.linspace(0.0, horizon, 401)
        hats, integrals = self.weights(fine)
        # Of squared delays: what comes early makes all that follows late.
        squares = integrals.T @ integrals + SMOOTH * horizon**2 * hats.T @ hats
        self._mass = squares * (fine[1] - fine[0]) / horizon**2
        _, self._at_knots = self.weights(self.knots)
        self._even = [1.0] * len(self.knots)
        self.reset()

    def reset(self) -> None:
        """Follow the path on time."""
        self.delay, self.rates = 0.0, np.ones(len(self.knots))
        self.command()

    def command(self) -> None:
        """Let the path go on by these rates until the next step, whatever is planned meanwhile."""
        self._commanded = self.rates.copy()

    @property
    def is_on_time(self) -> bool:
        """Whether the path is followed by the clock."""
        return self.delay == 0.0 and self.rates.tolist() == self._even

    def weights(self, t: Array) -> tuple[Array, Array]:
        """Return the weights of rates in the rate, and in its integral, at times, (K, J + 1)."""
        ones, knots = np.eye(len(self.knots)), self.knots
        hats = np.stack([np.interp(t, knots, one) for one in ones], axis=1)
        steps = np.diff(knots)
        whole = np.vstack([np.zeros(len(knots)), np.cumsum(
            0.5 * steps[:, None] * (ones[:-1] + ones[1:]), axis=0
        )])  # fmt: skip
        k = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 1)
        inside = whole[k] + 0.5 * (t - knots[k])[:, None] * (ones[k] + hats)
        return hats, inside

    def times(self, t: Array, since: Array, weights: tuple[Array, Array]) -> Times:
        """Return times t (K,) on the clock, `since` from now, with the path's own."""
        if self.is_on_time:
            return Times(t, t, np.ones(len(t)))
        hats, integrals = weights
        return Times(t, t - since - self.delay + integrals @ self.rates, hats @ self.rates)

    def shift(self, seconds: float) -> None:
        """Let time pass."""
        if seconds <= 0.0 or (self.is_on_time and self._commanded.tolist() == self._even):
            return
        hats, progress = self.weights(np.array([seconds]))
        self.delay += seconds - float(progress[0] @ self._commanded)
        self.rates = np.interp(self.knots + seconds, self.knots, self.rates)
        self.rates[0] = float(hats[0] @ self._commanded)
        if abs(self.delay) < ON_TIME:
            self.delay = 0.0
            if np.all(np.abs(self.rates - 1.0) < ON_TIME):
                self.reset()

    def anchor(self, ahead: float, rate: float) -> None:
        """Go on from where the tool is: `ahead` of s [s], and at this rate."""
        self.delay = max(self.delay - ahead, 0.0)
        self.rates[0] = min(max(rate, 0.0), 1.0 + CATCH_UP)

    def retreat(self, when: float) -> None:
        """Come to rest before a time at which the motion breaks down [s]."""
        self.rates = self.rates * np.clip(1.0 - self.knots / max(when, 1e-9), 0.0, 1.0)

    def slow_down(self, times: int) -> None:
        """Take all rates but the present one back, by so much more as it did not help before."""
        self.rates[1:] *= SLOWER**times

    @property
    def _late(self) -> Array:
        """By how much s will be behind the clock at the knots [s]."""
        return np.asarray(self.delay + self.knots - self._at_knots @ self.rates)

    def wanted(self) -> Array:
        """Return the rates at the knots that are wanted: 1, or a bit more where it is late."""
        return np.asarray(1.0 + np.clip(CATCHING * self._late, 0.0, CATCH_UP))

    def programme(self, scale: float) -> tuple[Array, Array, tuple[Array, Array, Array]]:
        """Return metric and gradient of changes of all rates but the first, and rows with bounds.

        No rate is negative or grows beyond what is wanted, and the path is not ahead of the clock.
        """
        weight, more = PACE_WEIGHT * scale, self.wanted() - self.rates
        pull, count = -weight * self._mass @ more, len(self.rates) - 1
        rows = np.vstack([np.eye(count), self._at_knots[1:, 1:]])
        low = np.append(-self.rates[1:], np.full(count, -np.inf))
        high = np.append(np.clip(more[1:], 0.0, PACE_GROWS), np.maximum(self._late[1:], 0.0))
        return weight * self._mass[1:, 1:], pull[1:], (rows, low, high)

    def change(self, step: Array) -> None:
        """Change all rates but the first, (J,)."""
        self.rates[1:] = np.clip(self.rates[1:] + step, 0.0, 1.0 + CATCH_UP)
