"""Rates of the tool along a motion, and their derivatives."""

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, series
from selfmotion.model.robot.chain import Chain
from selfmotion.model.robot.chain_series import ChainSeries

_AXES = pin.ReferenceFrame.LOCAL


class ToolRates:
    """[v, ω] of a chain's tip relative to its base and [dv/dt, dω/dt], in tip axes.

    v is the velocity of the frame's origin, dv/dt the acceleration that a sensor there has but for
    gravity: of Pinocchio's spatial acceleration a, dv/dt = a + ω × v.

    Parameters
    ----------
    chain : Chain
    """

    def __init__(self, chain: Chain) -> None:
        self._chain, (self._model, self._frame) = chain, chain.rooted()
        self._data = self._model.createData()
        # Of the chain's joints by coordinates, (c, n).
        self._matrix = chain.coupling.matrix[chain.model_joints]

    def __call__(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array]:
        """Return velocities and accelerations of motions (K, n) each, (K, 6) [m, rad, s]."""
        velocity, acceleration = np.empty((len(q), 6)), np.empty((len(q), 6))
        q, qd, qdd = self._of_joints(q, qd, qdd)
        model, data, frame = self._model, self._data, self._frame
        for k in range(len(q)):
            pin.forwardKinematics(model, data, q[k], qd[k], qdd[k])
            pin.updateFramePlacement(model, data, frame)
            velocity[k] = pin.getFrameVelocity(model, data, frame, _AXES).vector
            acceleration[k] = pin.getFrameClassicalAcceleration(model, data, frame, _AXES).vector
        return velocity, acceleration

    def series(self, chain: ChainSeries) -> tuple[Array, Array, Array, Array]:
        """Return the majorants of v, ω, dv/dt and dω/dt, (K + 1, I) each."""
        place, turned = chain.relative(self._chain)
        spin, speed = chain.relative_spin(self._chain), series.derivative(place, chain.half)
        rates = speed, spin, *(series.derivative(x, chain.half) for x in (speed, spin))
        v, w, dv, dw = (series.product(rate, turned) for rate in rates)
        return v, w, dv, dw

    def derivatives(
        self, q: Array, qd: Array, qdd: Array
    ) -> tuple[tuple[Array, Array], tuple[Array, Array, Array]]:
        """Return ∂/∂q and ∂/∂q̇ of velocities, ∂/∂q, ∂/∂q̇ and ∂/∂q̈ of accelerations, (K, 6, n)."""
        shape = (*q.shape[:1], 6, len(self._matrix))
        v_by_q, a_by_q, a_by_qd, jacobians = (np.empty(shape) for _ in range(4))
        q, qd, qdd = self._of_joints(q, qd, qdd)
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
        v_by_q, a_by_q, a_by_qd, jacobians = (
            part @ self._matrix for part in (v_by_q, a_by_q, a_by_qd, jacobians)
        )
        return (v_by_q, jacobians), (a_by_q, a_by_qd, jacobians)

    def _of_joints(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
        """Return a motion (K, n) as that of the chain's joints, (K, c)."""
        coupling, joints = self._chain.coupling, self._chain.model_joints
        qd, qdd = (np.ascontiguousarray(coupling.rates(x)[:, joints]) for x in (qd, qdd))
        return np.ascontiguousarray(coupling.spread(q)[:, joints]), qd, qdd
