"""A tool motion run through at another pace."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, PathError, as_numbers, restore
from selfmotion.path.base import Path, PathSamples, check_path

# Intervals of the pace are halved so often to find when a time of the original is passed.
_HALVINGS = 52


class Retimed(Path, kind="retimed"):
    """The same geometric path at another pace: pose(t) is that of the original at σ(t).

    σ is a cubic Hermite spline, non-decreasing at its samples.

    Parameters
    ----------
    path : Path
        The original.
    t : (N,)
        New times [s], increasing from 0.
    sigma : (N,)
        Original times [s], from 0 to the original's duration.
    rate : (N,)
        dσ/dt ≥ 0.
    """

    def __init__(
        self, path: Path, t: npt.ArrayLike, sigma: npt.ArrayLike, rate: npt.ArrayLike
    ) -> None:
        self._path = check_path(path, "retimed path")
        self._t, self._sigma, self._rate = (
            as_numbers(values, f"retimed path: {name}", error=PathError)
            for name, values in (("t", t), ("sigma", sigma), ("rate", rate))
        )
        shapes = {self._t.shape, self._sigma.shape, self._rate.shape}
        if len(shapes) > 1 or self._t.ndim != 1 or len(self._t) < 2:
            raise PathError(
                f"retimed path: t, sigma and rate have shapes {self._t.shape}, "
                f"{self._sigma.shape} and {self._rate.shape}, expected (N,) each with N ≥ 2"
            )
        if not (np.all(np.diff(self._t) > 0) and np.all(np.diff(self._sigma) >= 0)):
            raise PathError("retimed path: times must increase and σ must not fall")
        self.duration = float(self._t[-1])

    @property
    def knots(self) -> Array:
        """See `Path.knots`."""
        return self._t

    @property
    def marks(self) -> Array:
        """See `Path.marks`: the samples of the pace, and when the original's are passed."""
        wanted = self._path.marks
        k = np.clip(np.searchsorted(self._sigma, wanted) - 1, 0, len(self._t) - 2)
        early, late = self._t[k], self._t[k + 1]
        for _ in range(_HALVINGS):
            middle = 0.5 * (early + late)
            before = self.pace(middle)[0] < wanted
            early, late = np.where(before, middle, early), np.where(before, late, middle)
        return np.union1d(self._t, late)

    def pace(self, t: Array) -> tuple[Array, Array]:
        """Return σ and dσ/dt at times `t` (K,)."""
        from scipy.interpolate import CubicHermiteSpline

        spline = CubicHermiteSpline(self._t, self._sigma, self._rate)
        sigma = np.clip(spline(t), 0.0, self._path.duration)
        return np.asarray(sigma), np.asarray(spline(t, 1))

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        sigma, rate = self.pace(t)
        original = self._path.samples(sigma)
        twist = original.twist * rate[:, None]
        return PathSamples(t, original.translation, original.rotation, twist)

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        return {
            "kind": self.kind,
            "path": self._path.to_dict(),
            "t": self._t.tolist(),
            "sigma": self._sigma.tolist(),
            "rate": self._rate.tolist(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> "Retimed":
        """See `Saved.from_dict`."""
        return cls(**{**values, "path": restore(Path, values["path"])})
