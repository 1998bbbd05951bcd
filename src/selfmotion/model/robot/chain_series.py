"""Majorant series of a chain's motion: bounds of all derivatives, and rates along a motion."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, series
from selfmotion.model.robot.chain import WORLD, Chain
from selfmotion.model.robot.model import RobotModel


class ChainSeries:
    """Majorants of a chain's motion over I intervals of time; see `selfmotion.basics.series`.

    A joint's rotation by q is bounded by exp(Q), a product of rotations by the exponential of the
    sum, a position by the sum of products of carried offset and carrier.

    Parameters
    ----------
    robot : RobotModel
    joints : (n, K + 1, I)
        The joints' own series.
    half : (I,)
        Half the width of each interval [s].
    """

    def __init__(self, robot: RobotModel, joints: Array, half: Array) -> None:
        self.robot, self.joints, self.half = robot, joints, half
        coupling, tree = robot.coupling, robot.tree
        self._is_revolute = tree.is_revolute.tolist()
        # Those of the model's joints.
        self._every = joints
        if not coupling.is_plain:
            self._every = np.abs(coupling.scales)[:, None, None] * joints[coupling.coordinates]
            self._every[:, 0] += np.where(tree.is_revolute, 0.0, np.abs(coupling.offsets))[:, None]

    @cached_property
    def turned(self) -> list[Array]:
        """The orientation of the world and of each joint's frame, (K + 1, I) each."""
        sums = [np.zeros_like(self.joints[0])]
        for joint, parent, _ in self._links():
            sums.append(sums[parent] + self._every[joint] * self._is_revolute[joint])
        return [series.exponential(total) for total in sums]

    @cached_property
    def steps(self) -> list[Array]:
        """From the parent's frame to each joint's, world axes [m]; of the world 0."""
        found = [np.zeros_like(self.joints[0])]
        for joint, parent, length in self._links():
            step = length * self.turned[parent]
            if not self._is_revolute[joint]:
                step = step + series.product(self._every[joint], self.turned[parent])
            found.append(step)
        return found

    @cached_property
    def places(self) -> list[Array]:
        """The places of the world and of each joint's frame [m]."""
        found = [self.steps[0]]
        for joint, parent, _ in self._links():
            found.append(found[parent] + self.steps[joint + 1])
        return found

    @cached_property
    def spins(self) -> list[Array]:
        """The angular velocities of the world and of each joint's frame [rad/s]."""
        found = [np.zeros_like(self.joints[0][1:])]
        for joint, parent, _ in self._links():
            spin = found[parent]
            if self._is_revolute[joint]:
                spin = spin + series.product(self.rate(joint), self.turned[parent])
            found.append(spin)
        return found

    def is_revolute(self, joint: int) -> bool:
        """Return whether a joint is revolute."""
        return bool(self._is_revolute[joint])

    def parent(self, joint: int) -> int:
        """Return the parent of a joint, 0 for the world, else 1 + its number."""
        return int(self.robot.model.parents[joint + 1])

    def rate(self, joint: int) -> Array:
        """Return the velocity of a joint of the model."""
        return series.derivative(self._every[joint], self.half)

    def place(self, frame: int) -> Array:
        """Return the position of a frame [m], by its number."""
        at = self.robot.model.frames[frame]
        length = float(np.linalg.norm(at.placement.translation))
        parent = int(at.parentJoint)
        return np.asarray(self.places[parent] + length * self.turned[parent])

    def orientation(self, frame: int) -> Array:
        """Return the orientation of a frame."""
        return self.turned[int(self.robot.model.frames[frame].parentJoint)]

    def spin(self, frame: int) -> Array:
        """Return the angular velocity of a frame [rad/s]."""
        return self.spins[int(self.robot.model.frames[frame].parentJoint)]

    def relative(self, chain: Chain) -> tuple[Array, Array]:
        """Return the position of a chain's tip in its base frame [m], and its orientation there."""
        if chain.base == WORLD:
            return self.place(chain.tip), self.orientation(chain.tip)
        tree, _, last = chain.arrays
        total = np.zeros_like(self.joints[0])
        place = np.zeros_like(total)
        for joint, position in zip(chain.model_joints.tolist(), tree.positions, strict=True):
            turned = series.exponential(total)
            place += float(np.linalg.norm(position)) * turned
            if self._is_revolute[joint]:
                total = total + self._every[joint]
            else:
                place += series.product(self._every[joint], turned)
        turned = series.exponential(total)
        return place + float(np.linalg.norm(last)) * turned, turned

    def relative_spin(self, chain: Chain) -> Array:
        """Return the angular velocity of a chain's tip in its base frame [rad/s]."""
        if chain.base == WORLD:
            return self.spin(chain.tip)
        total, spin = np.zeros_like(self.joints[0]), np.zeros_like(self.joints[0][1:])
        for joint in chain.model_joints.tolist():
            if self._is_revolute[joint]:
                spin = spin + series.product(self.rate(joint), series.exponential(total))
                total = total + self._every[joint]
        return np.asarray(spin)

    def _links(self) -> Iterator[tuple[int, int, float]]:
        """Return each joint with its parent and how far it is from there [m]."""
        placements = list(self.robot.model.jointPlacements)[1:]
        for joint, placement in enumerate(placements):
            yield joint, self.parent(joint), float(np.linalg.norm(placement.translation))


# How fast the tool moves and accelerates along a motion, and how that changes with the motion.

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
