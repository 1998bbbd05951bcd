"""The length of the way in joint space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    ProblemError,
    as_number,
    read_only,
)
from selfmotion.costs.base import (
    Cost,
    Partials,
    check_name,
)
from selfmotion.costs.samples import Samples
from selfmotion.follow import Follows


@dataclass(frozen=True, eq=False)
class PathLength(Cost):
    """Length of the joint path, joint by joint: G = Σ_i w_i (√(q̇_i² + δ²) - δ) [rad/s].

    Its integral is Σ_i w_i ∫ |q̇_i| dt, the sum over joints of what each travels, but smooth where
    a joint turns round.

    Parameters
    ----------
    smoothing : float
        δ [rad/s]; the integral is too small by at most nδT.
    joint_weights : (n,), optional
        w ≥ 0, such as `RobotModel.joint_weights`; 1 for every joint by default, which adds up
        radians only: an arm with prismatic joints has to be given some.
    """

    is_pointwise: ClassVar[bool] = True

    smoothing: float = 1e-2
    joint_weights: npt.ArrayLike | None = None
    name: str = "path length"

    def __post_init__(self) -> None:
        if self.joint_weights is not None:
            object.__setattr__(self, "joint_weights", read_only(self.joint_weights))

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        lengths = np.hypot(samples.qd, self.smoothing) - self.smoothing
        return np.asarray(np.sum(self._w * lengths, axis=1))

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`: w_i q̇_i / √(q̇_i² + δ²)."""
        return Partials(qd=self._w * samples.qd / np.hypot(samples.qd, self.smoothing))

    def check(self, follows: Follows) -> None:
        """See `Cost.check`."""
        robot = follows.robot
        check_name(self.name)
        as_number(self.smoothing, f"cost '{self.name}': smoothing", above=0.0)
        weights = self._w
        if weights.shape not in ((), (robot.dof,)) or not np.all(weights >= 0.0):
            raise ProblemError(
                f"cost '{self.name}': joint_weights are {weights}, expected {robot.dof} numbers ≥ 0"
            )
        slides = [name for name in robot.joint_names if robot.is_prismatic(name)]
        if slides and self.joint_weights is None:
            raise ProblemError(
                f"cost '{self.name}': joint '{slides[0]}' moves in metres, others turn in radians; "
                f"say what they count with joint_weights=robot.joint_weights, or your own"
            )

    @property
    def _w(self) -> Array:
        return np.asarray(1.0 if self.joint_weights is None else self.joint_weights)
