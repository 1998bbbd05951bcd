"""Limits of joint torque, with what the tool holds."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, per_joint
from selfmotion.certificate import JointTorques
from selfmotion.constraints.base import Constraint, NodeTangents, motion_at_nodes
from selfmotion.costs import Samples
from selfmotion.follow import Follows
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

    def bind(self, follows: Follows, start: Array, end: Array) -> "BoundTorques":
        """See `Constraint.bind`."""
        robot = follows.robot
        if not self.margin > 0.0:
            raise ProblemError(
                f"{robot.name}: joint torque limits: margin is {self.margin}, expected > 0"
            )
        limit = self.of(robot)
        joints = np.flatnonzero(np.isfinite(limit))
        names = tuple(robot.joint_names[k] for k in joints)
        return BoundTorques(self._dynamics(robot), joints, names, limit[joints], self.margin)

    def requirement(self, robot: RobotModel) -> JointTorques:
        """See `Constraint.requirement`."""
        return JointTorques(self._dynamics(robot), self.of(robot))

    def of(self, robot: RobotModel) -> Array:
        """Return the limits for an arm, (n,) [Nm or N]."""
        if self.limit is None:
            return robot.effort_limit
        what = f"{robot.name}: joint torque limits"
        return per_joint(self.limit, robot.dof, what, positive=True)

    def _dynamics(self, robot: RobotModel) -> Dynamics:
        return Dynamics(robot, self.payload, self.center, self.inertia)


@dataclass(frozen=True, eq=False)
class BoundTorques:
    """h = ±τ / limit - 1 + margin for the joints that have a limit."""

    dynamics: Dynamics
    joints: npt.NDArray[np.intp]
    joint_names: tuple[str, ...]
    limit: Array
    margin: float
    name: str = "joint torque limits"
    equality = False

    @property
    def tolerance(self) -> float:
        """See `BoundConstraint.tolerance`: half the margin."""
        return 0.5 * self.margin

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        used = self.dynamics.torques(*motion_at_nodes(samples))[:, self.joints] / self.limit
        return np.hstack([used, -used]) - 1.0 + self.margin

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        changes = self.dynamics.derivatives(*motion_at_nodes(samples))
        pairs = zip(changes, (motion.of_order(k) for k in range(3)), strict=True)
        by = sum(np.einsum("kij,kjd->kid", change[:, self.joints], x) for change, x in pairs)
        above = np.asarray(by) / self.limit[:, None]
        return np.concatenate([above, -above], axis=1)

    def easing(self, column: int) -> tuple[float, str]:
        """See `easing_of`: 2 % of a limit, in both directions."""
        return 0.02, f"2 % more torque for joint '{self.joint_names[column % len(self.joints)]}'"

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
        joint = column % len(self.joints)
        torques = self.dynamics.torques(*(part[row : row + 1] for part in motion_at_nodes(samples)))
        return (
            f"joint '{self.joint_names[joint]}' needs {torques[0, self.joints[joint]]:.4g} Nm or N "
            f"at t = {samples.sampling.node_times[row]:.3f} s, limit {self.limit[joint]:.4g}"
        )
