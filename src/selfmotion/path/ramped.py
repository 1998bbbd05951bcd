"""A tool motion that is run up to speed, and brought to rest again."""

from typing import Any

import numpy as np

from selfmotion.basics import Array, PathError, as_number, read_only
from selfmotion.path.base import Path, PathSamples, _Derived, check_path


class Ramped(_Derived, kind="ramped"):
    """The same path from rest to rest: only its ends are slower.

    The time τ of the original has dτ/dt = u²(3 - 2u) with u = t / ramp at the start, likewise at
    the end, and 1 in between: velocity and acceleration are continuous, and nothing but the first
    and the last half ramp of the original changes its pace.

    Parameters
    ----------
    path : Path
        The original.
    ramp : float
        How long each ramp lasts [s]; the path takes so much longer. 0.5 s by default.

    Raises
    ------
    PathError
        The ramp is not above 0, or longer than the original.
    """

    def __init__(self, path: Path, ramp: float = 0.5) -> None:
        check_path(path, "ramped path")
        ramp = as_number(ramp, "ramped path: ramp", above=0.0, error=PathError)
        if ramp > path.duration:
            raise PathError(
                f"ramped path: ramp is {ramp} s, expected a time above 0 and up to the path's "
                f"duration, {path.duration:.6g} s"
            )
        self._path, self._ramp = path, float(ramp)
        self.duration = path.duration + self._ramp

    @property
    def knots(self) -> Array:
        """See `Path.knots`."""
        return self._moved(self._path.knots)

    @property
    def marks(self) -> Array:
        """See `Path.marks`."""
        return self._moved(self._path.marks)

    def _moved(self, original: Array) -> Array:
        """Return when times of the original are passed, and the ends of the ramps."""
        from scipy.optimize import brentq

        ramp, duration = self._ramp, self._path.duration
        times = [0.0, ramp, self.duration - ramp, self.duration]
        for tau in original[1:-1].tolist():
            if 0.5 * ramp <= tau <= duration - 0.5 * ramp:
                times.append(tau + 0.5 * ramp)
            else:
                times.append(brentq(lambda t, tau=tau: self.pace(t)[0] - tau, 0.0, self.duration))
        unique = np.unique(times)
        return read_only(unique[np.append(True, np.diff(unique) > 1e-12 * self.duration)])

    def pace(self, t: Array) -> tuple[Array, Array]:
        """Return τ and dτ/dt at times `t` (K,)."""
        ramp = self._ramp
        begun, left = np.minimum(t / ramp, 1.0), np.minimum((self.duration - t) / ramp, 1.0)
        # ∫ u²(3 - 2u) du = u³ - u⁴/2, which is 1/2 at u = 1.
        behind = ramp * begun**3 * (1.0 - 0.5 * begun) + np.maximum(t - ramp, 0.0)
        missing = ramp * left**3 * (1.0 - 0.5 * left)
        tau = np.where(left < 1.0, self._path.duration - missing, behind)
        return tau, begun**2 * (3.0 - 2.0 * begun) * left**2 * (3.0 - 2.0 * left)

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        return self._at_pace(t, *self.pace(t))

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        return {"kind": self.kind, "path": self._path.to_dict(), "ramp": self._ramp}
