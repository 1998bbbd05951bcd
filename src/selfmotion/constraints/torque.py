"""Limits of joint torque, with what the tool holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, as_number, per_joint
from selfmotion.certificate import Column, Quantity
from selfmotion.constraints.base import Constraint
from selfmotion.robot import Dynamics, RobotModel

_WITH = " and of those that mimic it"


@dataclass(frozen=True, eq=False)
class JointTorqueLimits(Constraint):
    """Joint torques stay below limits: gravity, inertia and Coriolis forces, with a payload.

    Of joints that mimic another one motor may turn all, or each its own, which no URDF says. Both
    are kept: what all of them ask of the joint that they mimic (Cᵀτ) stays below its effort, and
    what each carries (τ) below its own. Limits of one's own are those of the former alone.

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
        each = self.limit is None
        dynamics = Dynamics(robot, self.payload, self.center, self.inertia, each=each)
        limit = self.of(robot)
        names = [(name, f"torque of joint '{name}'") for name in robot.joint_names]
        if each and len(robot.coupling.shared):
            own = [robot.model.names[int(k) + 1] for k in robot.coupling.shared]
            names = [(name, f"{label}{_WITH * (name in own)}") for name, label in names]
            names += [(name, f"torque of joint '{name}' alone") for name in own]
            efforts = np.asarray(robot.model.upperEffortLimit)[robot.coupling.shared]
            limit = np.append(limit, np.where(efforts > 0.0, efforts, np.inf))
        units = ["N" if robot.is_prismatic(name) else "Nm" for name, _ in names]
        return Quantity(
            "joint torque limits",
            [Column(*name, unit) for name, unit in zip(names, units, strict=True)],
            dynamics.torques,
            dynamics.derivatives,
            limit=limit,
            of_pace=True,
            series=lambda stretch: dynamics.series(stretch.chain()),
            covers=(_covered(self.of(robot)),),
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
