"""How fast the tool moves and accelerates along a motion, and how that changes with the motion."""

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, series
from selfmotion.robot.chain_series import ChainSeries
from selfmotion.robot.model import RobotModel

_AXES = pin.ReferenceFrame.LOCAL


class ToolRates:
    """[v, ω] of the tool frame and [dv/dt, dω/dt], in tool axes.

    v is the velocity of the frame's origin, dv/dt the acceleration that a sensor there has but for
    gravity: of Pinocchio's spatial acceleration a, dv/dt = a + ω × v.

    Parameters
    ----------
    robot : RobotModel
    """

    def __init__(self, robot: RobotModel) -> None:
        self._model, self._frame = robot.model, robot.chain.tip
        self._data = robot.model.createData()

    def __call__(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array]:
        """Return velocities and accelerations of motions (K, n) each, (K, 6) [m, rad, s]."""
        velocity, acceleration = np.empty((len(q), 6)), np.empty((len(q), 6))
        model, data, frame = self._model, self._data, self._frame
        for k in range(len(q)):
            pin.forwardKinematics(model, data, q[k], qd[k], qdd[k])
            pin.updateFramePlacement(model, data, frame)
            velocity[k] = pin.getFrameVelocity(model, data, frame, _AXES).vector
            acceleration[k] = pin.getFrameClassicalAcceleration(model, data, frame, _AXES).vector
        return velocity, acceleration

    def series(self, chain: ChainSeries) -> tuple[Array, Array, Array, Array]:
        """Return the majorants of v, ω, dv/dt and dω/dt, (K + 1, I) each."""
        turned, spin = chain.orientation(self._frame), chain.spin(self._frame)
        speed = series.derivative(chain.place(self._frame), chain.half)
        rates = speed, spin, *(series.derivative(x, chain.half) for x in (speed, spin))
        v, w, dv, dw = (series.product(rate, turned) for rate in rates)
        return v, w, dv, dw

    def derivatives(
        self, q: Array, qd: Array, qdd: Array
    ) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        """Return ∂/∂q and ∂/∂q̇ of velocities, ∂/∂q, ∂/∂q̇ and ∂/∂q̈ of accelerations, (K, 6, n)."""
        shape = (*q.shape[:1], 6, q.shape[1])
        v_by_q, a_by_q, a_by_qd, jacobians = (np.empty(shape) for _ in range(4))
        model, data, frame = self._model, self._data, self._frame
        for k in range(len(q)):
            pin.computeForwardKinematicsDerivatives(model, data, q[k], qd[k], qdd[k])
            pin.updateFramePlacement(model, data, frame)
            v_by_q[k], a_by_q[k], a_by_qd[k], jacobians[k] = pin.getFrameAccelerationDerivatives(
                model, data, frame, _AXES
            )
            velocity = pin.getFrameVelocity(model, data, frame, _AXES).vector
            # d(ω × v) = dω × v + ω × dv.
            turning, moving = pin.skew(velocity[3:]), pin.skew(velocity[:3])
            for by, of in ((a_by_q, v_by_q), (a_by_qd, jacobians)):
                by[k, :3] += turning @ of[k, :3] - moving @ of[k, 3:]
        return (v_by_q, jacobians), (a_by_q, a_by_qd, jacobians)
