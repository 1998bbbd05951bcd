"""An objective on a grid of one's own choice, for measuring single evaluations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.grid import Grid
from selfmotion.null_motion import NullMotionTable, TransportedFrame
from selfmotion.objective import Objective
from selfmotion.rollout import Rollout
from selfmotion.start import FixedStart


def objective_on(problem: sm.Problem, steps: int) -> Objective:
    """Return the objective of `problem` on a grid of `steps` steps."""
    grid = Grid.aligned(problem.path.knots, steps)
    rollout = Rollout(problem.robot, problem.path, problem.rows, grid)
    n = problem.robot.dof
    start = problem.given_start
    if start is None:
        start = problem.robot.inverse_kinematics(problem.path.pose(0.0), problem.rows)
    frame, rows = None, n
    if problem.null_motion.space == "null":
        rollout.run(start, np.zeros((len(grid.stage_times), n)))
        jacobians = rollout.samples().task_jacobian[grid.node_stages]
        frame = TransportedFrame(grid.nodes, jacobians)(grid.stage_times)
        rows = frame.shape[2]
    functions = problem.null_motion.functions(grid.stage_times, problem.path.duration)
    table = NullMotionTable(functions, frame, rows)
    return Objective(rollout, table, problem.costs, FixedStart(start))


class Evaluation:
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
    model, data, tool = robot.model, robot.model.createData(), robot.tool_id
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    objective.value(np.zeros(objective.size))
    configurations = list(objective.rollout.samples().q.copy())

    def loop() -> None:
        for q in configurations:
            pin.computeJointJacobians(model, data, q)
            pin.getFrameJacobian(model, data, tool, axes)
            pin.updateFramePlacement(model, data, tool)

    return loop
