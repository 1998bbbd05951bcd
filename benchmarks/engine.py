"""An objective on a grid of one's own choice, for measuring single evaluations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.model.motion import Grid
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.paper import Objective
from selfmotion.planning.rollout import MinimumNormMotion


def objective_on(problem: sm.Problem, steps: int) -> Objective:
    """Return the objective of `problem` on a grid of `steps` steps."""
    start = problem.given_start
    if start is None:
        start = problem.robot.inverse_kinematics(problem.path.pose(0.0), problem.task)
    formulation, grid = Formulation.of(problem), Grid.aligned(problem.path.knots, steps)
    minimum_norm = MinimumNormMotion.on(formulation, start, grid)
    return Objective.of(formulation, minimum_norm)


class Measured:
    """Evaluates F, or F and ∇F, at a new point each time, so that nothing is remembered."""

    def __init__(self, objective: Objective, *, gradient: bool) -> None:
        self._objective, self._gradient = objective, gradient
        self._x = 0.05 * np.ones(objective.size)

    def __call__(self) -> None:
        self._x = -self._x
        self._objective.value(self._x)
        if self._gradient:
            self._objective.gradient(self._x)


def pinocchio_loop(objective: Objective) -> Any:
    """Return a bare Python loop of Pinocchio's Jacobians and poses along one rollout.

    The calls that anyone would make; the rollout itself takes the frame's Jacobian from that of the
    joints.
    """
    robot = objective.rollout.robot
    model, data, tool = robot.model, robot.model.createData(), robot.chain.tip
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    configurations = list(objective.samples(np.zeros(objective.size)).q.copy())

    def loop() -> None:
        for q in configurations:
            pin.computeJointJacobians(model, data, q)
            pin.getFrameJacobian(model, data, tool, axes)
            pin.updateFramePlacement(model, data, tool)

    return loop
