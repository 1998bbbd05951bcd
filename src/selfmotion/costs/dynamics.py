"""Costs of the arm's dynamics, by Pinocchio's mass matrix and gravity torques."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, ProblemError, shown
from selfmotion.costs.base import (
    Cost,
    Partials,
    as_weight,
    check_mu,
    check_weight,
    half_square,
    weighted,
)
from selfmotion.costs.samples import Samples
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel


@dataclass(frozen=True, eq=False)
class KineticEnergy(Cost):
    """Kinetic energy of the arm: G = μ ½ q̇ᵀM(q)q̇ [J].

    The integral of it is the action of the arm without gravity: its optimum moves the arm as if
    coasting.

    Parameters
    ----------
    robot : RobotModel
        The arm; its URDF must give inertias.
    mu : float
        μ ≥ 0.
    """

    context: ClassVar[tuple[str, ...]] = ("robot",)

    robot: RobotModel
    mu: float = 1.0
    name: str = "kinetic energy"
    _model: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _check_arm(self.robot, self.name)
        model = self.robot.model.copy()
        model.gravity.setZero()
        object.__setattr__(self, "_model", model)

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        data = self._model.createData()
        energies = [
            pin.computeKineticEnergy(self._model, data, q, qd)
            for q, qd in zip(samples.q, samples.qd, strict=True)
        ]
        return self.mu * np.array(energies)

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`: ∂G/∂q̇ = μMq̇ and ∂G/∂q = μ ½ q̇ᵀ ∂(Mq̇)/∂q.

        At rest and without gravity the inverse dynamics are τ = Mq̈, so that both come from its
        derivatives with q̇ in place of q̈.
        """
        data, rest = self._model.createData(), np.zeros(self.robot.dof)
        by_q, by_qd = np.empty_like(samples.q), np.empty_like(samples.qd)
        for s, (q, qd) in enumerate(zip(samples.q, samples.qd, strict=True)):
            torque_by_q, _, mass = pin.computeRNEADerivatives(self._model, data, q, rest, qd)
            by_q[s] = 0.5 * self.mu * (qd @ torque_by_q)
            by_qd[s] = self.mu * (mass @ qd)
        return Partials(q=by_q, qd=by_qd)

    def curvature(self, dof: int) -> dict[int, Array]:
        """See `Cost.curvature`: M in the middle of the joint limits."""
        lower, upper = self.robot.finite_limits()
        mass = np.triu(pin.crba(self._model, self._model.createData(), 0.5 * (lower + upper)))
        return {1: self.mu * (mass + np.triu(mass, 1).T)}

    def check(self, follows: Follows) -> None:
        """See `Cost.check`."""
        robot = follows.robot
        check_mu(self.mu, self.name)
        _check_robot(self.robot, robot, self.name)


@dataclass(frozen=True, eq=False)
class GravityTorque(Cost):
    """Torque that holds the arm against gravity: G = ½ gᵀWg [N²m²].

    Parameters
    ----------
    robot : RobotModel
        The arm; its URDF must give inertias, gravity acts along -z.
    weight : float, (n,) or (n, n)
        W; for example 1 / robot torque limit² as a diagonal.
    """

    context: ClassVar[tuple[str, ...]] = ("robot",)

    robot: RobotModel
    weight: float | npt.ArrayLike = 1.0
    name: str = "gravity torque"

    def __post_init__(self) -> None:
        _check_arm(self.robot, self.name)
        object.__setattr__(self, "weight", as_weight(self.weight, self.name))

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        model = self.robot.model
        data = model.createData()
        torques = np.array([pin.computeGeneralizedGravity(model, data, q) for q in samples.q])
        return half_square(np.asarray(self.weight), torques)

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`: (∂g/∂q)ᵀWg."""
        model = self.robot.model
        data = model.createData()
        by_q = np.empty_like(samples.q)
        for s, q in enumerate(samples.q):
            derivative = pin.computeGeneralizedGravityDerivatives(model, data, q)
            torque = pin.computeGeneralizedGravity(model, data, q)
            by_q[s] = weighted(np.asarray(self.weight), torque[None])[0] @ derivative
        return Partials(q=by_q)

    def check(self, follows: Follows) -> None:
        """See `Cost.check`."""
        robot = follows.robot
        check_weight(np.asarray(self.weight), robot.dof, self.name)
        _check_robot(self.robot, robot, self.name)


def _check_arm(robot: RobotModel, name: str) -> None:
    if not isinstance(robot, RobotModel):
        raise ProblemError(f"cost '{name}': robot is {shown(robot)}, expected a RobotModel")


def _check_robot(made_for: RobotModel, robot: RobotModel, name: str) -> None:
    if made_for.joint_names != robot.joint_names:
        raise ProblemError(
            f"cost '{name}' is made for {made_for.name} with joints "
            f"{', '.join(made_for.joint_names)}, but the problem's arm is {robot.name} with "
            f"{', '.join(robot.joint_names)}"
        )
    if not any(inertia.mass > 0 for inertia in robot.model.inertias):
        raise ProblemError(f"cost '{name}': the URDF of {robot.name} gives no inertias")
