"""Costs of the arm's dynamics: kinetic energy, and torques against gravity."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, shown
from selfmotion.model.follow import Follows
from selfmotion.model.robot import Energy, RobotModel, has_masses
from selfmotion.problem.costs.base import (
    Cost,
    Partials,
    as_weight,
    check_mu,
    check_weight,
    half_square,
    weighted,
)
from selfmotion.problem.costs.samples import Samples


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

    is_pointwise: ClassVar[bool] = True

    context: ClassVar[tuple[str, ...]] = ("robot",)

    robot: RobotModel
    mu: float = 1.0
    name: str = "kinetic energy"
    _energy: Energy = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _check_arm(self.robot, self.name)
        object.__setattr__(self, "_energy", Energy(self.robot))

    @override
    def value(self, samples: Samples) -> Array:
        return self.mu * self._energy.kinetic(samples.q, samples.qd)

    @override
    def gradient(self, samples: Samples) -> Partials:
        """∂G/∂q̇ = μMq̇ and ∂G/∂q = μ ½ q̇ᵀ ∂(Mq̇)/∂q."""
        by_q, by_qd = self._energy.kinetic_slopes(samples.q, samples.qd)
        return Partials(q=self.mu * by_q, qd=self.mu * by_qd)

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        """M in the middle of the joint limits."""
        lower, upper = self.robot.finite_limits()
        return {1: self.mu * self._energy.mass(0.5 * (lower + upper))}

    @override
    def check(self, follows: Follows) -> None:
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

    is_pointwise: ClassVar[bool] = True

    context: ClassVar[tuple[str, ...]] = ("robot",)

    robot: RobotModel
    weight: float | npt.ArrayLike = 1.0
    name: str = "gravity torque"

    def __post_init__(self) -> None:
        _check_arm(self.robot, self.name)
        # Refuses arms whose masses are not known.
        Energy(self.robot)
        object.__setattr__(self, "weight", as_weight(self.weight, self.name))

    @override
    def value(self, samples: Samples) -> Array:
        return half_square(np.asarray(self.weight), Energy(self.robot).gravity(samples.q))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """(∂g/∂q)ᵀWg."""
        energy = Energy(self.robot)
        torques = weighted(np.asarray(self.weight), energy.gravity(samples.q))
        return Partials(q=np.einsum("si,sij->sj", torques, energy.gravity_slopes(samples.q)))

    @override
    def check(self, follows: Follows) -> None:
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
    if not has_masses(robot):
        raise ProblemError(f"cost '{name}': the URDF of {robot.name} gives no inertias")
