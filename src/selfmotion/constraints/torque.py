"""Limits of joint torque, with what the tool holds."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, as_number, per_joint
from selfmotion.certificate import Column, Quantity
from selfmotion.constraints.base import Constraint
from selfmotion.robot import Dynamics, RobotModel


@dataclass(frozen=True, eq=False)
class JointTorqueLimits(Constraint):
    """Joint torques stay below limits: gravity, inertia and Coriolis forces, with a payload.

    Parameters
    ----------
    limit : (n,) or float, optional
        [Nm, or N of prismatic joints]; by default the URDF's efforts.
    payload : float
        Mass that the tool holds [kg].
    center : (3,)
        Its centre of mass in the tool frame [m].
    inertia : (3, 3), optional
        Its inertia about that centre, along the tool's axes [kg m²]; by default a point mass.
    margin : float
        Share of the limit that is aimed to be left unused; at least half of it is.
    """

    limit: npt.ArrayLike | None = None
    payload: float = 0.0
    center: npt.ArrayLike = (0.0, 0.0, 0.0)
    inertia: npt.ArrayLike | None = None
    margin: float = 1e-2

    def __post_init__(self) -> None:
        as_number(self.margin, "joint torque limits: margin", above=0.0, most=1.0)

    def quantity(self, robot: RobotModel) -> Quantity:
        """See `Constraint.quantity`."""
        dynamics = Dynamics(robot, self.payload, self.center, self.inertia)
        units = ["N" if robot.is_prismatic(name) else "Nm" for name in robot.joint_names]
        names, limit = zip(robot.joint_names, units, strict=True), self.of(robot)
        return Quantity(
            "joint torque limits",
            [Column(name, f"torque of joint '{name}'", unit) for name, unit in names],
            dynamics.torques,
            dynamics.derivatives,
            limit=limit,
            of_pace=True,
            series=lambda stretch: dynamics.series(stretch.chain()),
            covers=(_covered(limit),),
        )

    def of(self, robot: RobotModel) -> Array:
        """Return the limits for an arm, (n,) [Nm or N]."""
        if self.limit is None:
            return robot.effort_limit
        what = f"{robot.name}: joint torque limits"
        return per_joint(self.limit, robot.dof, what, positive=True)


def _covered(limit: Array) -> str:
    """Return what a verdict may claim: of some motors nobody may have said what they can."""
    known = int(np.isfinite(limit).sum())
    return "torques" if known == len(limit) else f"torques of {known} of {len(limit)} joints"
