"""A pull of a coordinate towards a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_number, restore, shown
from selfmotion.model.follow import Follows
from selfmotion.model.robot import Coordinate, RobotModel
from selfmotion.problem.costs.base import Cost, Partials, check_name
from selfmotion.problem.costs.samples import Samples


@dataclass(frozen=True, eq=False)
class Towards(Cost):
    """Distance of a coordinate from a value: G = ½ w (c(q) - c*)², the short way round.

    Parameters
    ----------
    robot : RobotModel
    coordinate : Coordinate
        `JointCoordinate`, `FrameCoordinate` or `SwivelAngle`.
    target : float
        c* [rad or m].
    weight : float
        w ≥ 0.
    """

    is_pointwise: ClassVar[bool] = True

    context: ClassVar[tuple[str, ...]] = ("robot",)

    robot: RobotModel
    coordinate: Coordinate
    target: float
    weight: float = 1.0
    name: str = "towards"

    def __post_init__(self) -> None:
        check_name(self.name)
        if not isinstance(self.robot, RobotModel):
            raise ProblemError(
                f"cost '{self.name}': robot is {shown(self.robot)}, expected a "
                f"RobotModel (load_robot)"
            )
        if not isinstance(self.coordinate, Coordinate):
            raise ProblemError(
                f"cost '{self.name}': coordinate is {shown(self.coordinate)}, expected a "
                f"JointCoordinate, FrameCoordinate or SwivelAngle"
            )
        self.coordinate.check_value(self.target, f"cost '{self.name}': target")
        as_number(self.weight, f"cost '{self.name}': weight", least=0.0)
        self.coordinate(self.robot, np.zeros((1, self.robot.dof)))

    @override
    def value(self, samples: Samples) -> Array:
        values, _ = self.coordinate(self.robot, samples.q)
        return 0.5 * self.weight * self.coordinate.away(values, self.target) ** 2

    @override
    def gradient(self, samples: Samples) -> Partials:
        """Return w (c - c*) ∂c/∂q."""
        values, by_q = self.coordinate(self.robot, samples.q)
        return Partials(q=(self.weight * self.coordinate.away(values, self.target))[:, None] * by_q)

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        """Return w ∂c/∂q ∂c/∂qᵀ in the middle of the joint limits."""
        lower, upper = self.robot.finite_limits()
        _, by_q = self.coordinate(self.robot, 0.5 * (lower + upper)[None])
        return {0: self.weight * np.outer(by_q[0], by_q[0])}

    @override
    def check(self, follows: Follows) -> None:
        """Require the same arm."""
        robot = follows.robot
        if robot.joint_names != self.robot.joint_names:
            raise ProblemError(
                f"cost '{self.name}': is made for {self.robot.name}, not {robot.name}"
            )

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Towards:
        coordinate = restore(Coordinate, values["coordinate"])
        return cls(**{**values, "robot": context["robot"], "coordinate": coordinate})
