"""A tool motion on something that moves, such as a conveyor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, restore
from selfmotion.path import Path, PathSamples


@dataclass(frozen=True, eq=False)
class Conveyed(Path):
    """A path that is carried along at a constant velocity.

    Where the velocity changes, or is measured anew, another one takes over: `Replanner.step` is
    given the path as it is known by then.

    Parameters
    ----------
    carried : Path
        The tool's motion where nothing moves.
    velocity : (3,)
        Of what carries it [m/s].
    offset : (3,)
        How far it would have been carried at time 0 [m].
    """

    carried: Path
    velocity: npt.ArrayLike
    offset: npt.ArrayLike = (0.0, 0.0, 0.0)

    @property
    def duration(self) -> float:  # type: ignore[override]
        """See `Path.duration`."""
        return self.carried.duration

    @property
    def knots(self) -> Array:
        """See `Path.knots`."""
        return self.carried.knots

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        inner, velocity = self.carried.evaluate(t), np.asarray(self.velocity, dtype=np.float64)
        translation = inner.translation + np.asarray(self.offset) + t[:, None] * velocity
        twist = inner.twist + np.concatenate([velocity, np.zeros(3)])
        return PathSamples(t, translation, inner.rotation, twist)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        """See `Saved.from_dict`."""
        return cls(**{**values, "carried": restore(Path, values["carried"])})
