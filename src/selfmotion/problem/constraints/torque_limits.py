"""Limits of joint torque, with a payload."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_number, per_joint
from selfmotion.certificate import Column, Quantity
from selfmotion.model.robot import Dynamics, RobotModel
from selfmotion.problem.constraints.base import Constraint

# Clause of a message about joints that mimic others.
_WITH = " and of those that mimic it"


@dataclass(frozen=True, eq=False)
class JointTorqueLimits(Constraint):
    """Joint torques stay below limits: gravity, inertia and Coriolis forces, with a payload.

    τ = M(q) q̈ + C(q, q̇) q̇ + g(q), by the recursive Newton-Euler algorithm (R. Featherstone, "Rigid
    Body Dynamics Algorithms", 2008, ch. 5).

    Whether one motor drives all joints that mimic one, or each has its own, is not in a URDF. Both
    limits apply: the common torque at the mimicked joint (Cᵀτ) is below its effort, and the torque
    of each (τ) below its own. Limits given here are those of the former alone.

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
    margin: float = 1e-3

    def __post_init__(self) -> None:
        as_number(self.margin, "joint torque limits: margin", above=0.0, most=1.0)

    @override
    def quantity(self, robot: RobotModel) -> Quantity:
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
            series=lambda segments: dynamics.series(segments.chain()),
            covers=(_claim(robot, self.of(robot)),),
        )

    @override
    def applies(self, robot: RobotModel) -> bool:
        shared = np.asarray(robot.model.upperEffortLimit)[robot.coupling.shared]
        each = self.limit is None and bool((shared > 0.0).any())
        return each or bool(np.isfinite(self.of(robot)).any())

    @override
    def for_controller(self, *, lines: bool = False) -> Constraint | None:
        # Torques are judged along the smooth curve.
        return None if lines else self

    @property
    @override
    def load(self) -> tuple[float, Array]:
        return float(self.payload), np.asarray(self.center, dtype=np.float64).reshape(3)

    def of(self, robot: RobotModel) -> Array:
        """Return the limits for an arm, (n,) [Nm or N]."""
        if self.limit is None:
            lacking = [name for name in robot.joint_names if name in robot.urdf.lacking_efforts]
            if lacking:
                raise ProblemError(
                    f"{robot.name}: joint torque limits: joint '{lacking[0]}' has a <limit> "
                    f"without effort; add it to the URDF, or give limit = …"
                )
            return robot.effort_limit
        what = f"{robot.name}: joint torque limits"
        return per_joint(self.limit, robot.dof, what, positive=True)


def _claim(robot: RobotModel, limit: Array) -> str:
    """Return what a verdict claims: for how many joints, as some limits may be unknown.

    Torques are those of rigid bodies: where a URDF has damping or friction, the verdict says so.
    """
    known = int(np.isfinite(limit).sum())
    claim = "torques" if known == len(limit) else f"torques of {known} of {len(limit)} joints"
    model = robot.model
    losses = np.any(model.damping) or np.any(model.upperDryFrictionLimit)
    return f"{claim} without damping and friction" if losses else claim
