"""Joint torques of a motion, by Pinocchio's recursive Newton-Euler algorithm."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, ProblemError, series
from selfmotion.model.robot.chain_series import ChainSeries
from selfmotion.model.robot.mimic import Coupling
from selfmotion.model.robot.model import RobotModel

# Relative rounding of an inertia: files with nine digits, products of matrices.
_ROUNDING = 1e-9


class Dynamics:
    """τ = M(q)q̈ + C(q, q̇)q̇ + g(q) of an arm that holds something.

    Parameters
    ----------
    robot : RobotModel
        Its URDF must give inertias; gravity is 9.81 m/s² along -z.
    payload : float
        Mass that the tool holds [kg].
    center : (3,)
        Its centre of mass in the tool frame [m].
    inertia : (3, 3), optional
        Its inertia about that centre, along the tool's axes [kg m²]; by default a point mass.
    each : bool
        Whether after the torques of the coordinates come those of each joint that has its
        coordinate together with others (`Coupling.shared`): m numbers instead of n.

    Raises
    ------
    ProblemError
        The URDF gives no masses, or the payload makes no sense.
    """

    def __init__(
        self,
        robot: RobotModel,
        payload: float = 0.0,
        center: npt.ArrayLike = (0.0, 0.0, 0.0),
        inertia: npt.ArrayLike | None = None,
        each: bool = False,
    ) -> None:
        model = robot.model.copy()
        if not has_masses(robot):
            raise ProblemError(
                f"{robot.name}: joint torques are asked for, but its URDF gives no masses; add "
                f"<inertial> to its links"
            )
        _check_weighed(robot)
        if not (np.isfinite(payload) and payload >= 0.0):
            raise ProblemError(f"payload is {payload} kg, expected a number ≥ 0")
        where = np.asarray(center, dtype=np.float64)
        turning = np.zeros((3, 3)) if inertia is None else np.asarray(inertia, dtype=np.float64)
        for name, value, shape in (("center", where, (3,)), ("inertia", turning, (3, 3))):
            if value.shape != shape or not np.all(np.isfinite(value)):
                raise ProblemError(
                    f"payload: {name} is {value.tolist()}, expected {shape} finite numbers"
                )
        # R I Rᵀ is symmetric, and a rod's moment about itself 0, up to rounding.
        scale = _ROUNDING * float(np.abs(turning).max())
        if np.abs(turning - turning.T).max() > scale or np.linalg.eigvalsh(turning)[0] < -scale:
            raise ProblemError(
                f"payload: inertia {turning.tolist()} is not symmetric with moments ≥ 0"
            )
        turning = 0.5 * (turning + turning.T)
        tool = model.frames[robot.chain.tip]
        held = pin.Inertia(float(payload), where, turning)
        model.appendBodyToJoint(tool.parentJoint, held, tool.placement)
        self._model, self._data, self._coupling = model, model.createData(), robot.coupling
        own = np.eye(model.nv)[:, robot.coupling.shared if each else []]
        # A coordinate moves all of its joints: virtual work.
        self._sums = np.hstack([robot.coupling.matrix, own])

    def torques(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Return τ for a motion (K, n) each, (K, m) [Nm, or N of prismatic joints]."""
        rows = zip(*self._of_joints(q, qd, qdd), strict=True)
        found = [pin.rnea(self._model, self._data, *row).copy() for row in rows]
        torques = np.array(found).reshape(len(q), -1)
        return torques if self._coupling.is_plain else np.asarray(torques @ self._sums)

    def _of_joints(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
        """Return a motion (K, n) as that of the model's joints, (K, N)."""
        coupling = self._coupling
        return coupling.spread(q), coupling.rates(qd), coupling.rates(qdd)

    def series(self, chain: ChainSeries) -> Array:
        """Return the torques' majorants, (m, K + 1, I): Newton's and Euler's equations of them.

        In world axes: f = m (c̈ - g) and n = d/dt (R I Rᵀ ω) of each body, summed from the tip.
        """
        model, half, count = self._model, chain.half, self._model.nv
        gravity = float(np.linalg.norm(model.gravity.linear))
        forces, moments = [], []
        for body in range(count + 1):
            inertia, turned = model.inertias[body], chain.turned[body]
            lever = float(np.linalg.norm(inertia.lever)) * turned
            at = chain.places[body] + lever
            pull = series.derivative(series.derivative(at, half), half)
            pull[0] += gravity
            force = inertia.mass * pull
            about = np.linalg.norm(inertia.inertia, 2) * series.product(turned, turned)
            moment = series.derivative(series.product(about, chain.spins[body]), half)
            forces.append(force)
            moments.append(moment + series.product(lever, force))
        found = np.empty((count, *forces[0].shape))
        for joint in reversed(range(count)):
            body, parent = joint + 1, chain.parent(joint)
            carried = moments[body] if chain.is_revolute(joint) else forces[body]
            faster = series.derivative(chain.rate(joint), half)
            found[joint] = series.product(chain.turned[parent], carried)
            found[joint] += model.armature[joint] * faster
            forces[parent] = forces[parent] + forces[body]
            arm = series.product(chain.steps[body], forces[body])
            moments[parent] = moments[parent] + moments[body] + arm
        if self._coupling.is_plain:
            return found
        return np.moveaxis(np.moveaxis(found, 0, -1) @ np.abs(self._sums), -1, 0)

    def derivatives(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
        """Return ∂τ/∂q, ∂τ/∂q̇ and ∂τ/∂q̈ = M, (K, m, n) each."""
        q, qd, qdd = self._of_joints(q, qd, qdd)
        count, n = q.shape
        by_q, by_qd, by_qdd = (np.empty((count, n, n)) for _ in range(3))
        for k in range(count):
            found = pin.computeRNEADerivatives(self._model, self._data, q[k], qd[k], qdd[k])
            by_q[k], by_qd[k], by_qdd[k] = found
        if self._coupling.is_plain:
            return by_q, by_qd, by_qdd
        left, right = self._sums.T, self._coupling.matrix
        return left @ by_q @ right, left @ by_qd @ right, left @ by_qdd @ right


class Energy:
    """Kinetic energy ½ q̇ᵀM(q)q̇ and gravity torques g(q) of an arm as its URDF has it.

    Parameters
    ----------
    robot : RobotModel
    """

    def __init__(self, robot: RobotModel) -> None:
        _check_weighed(robot)
        self._model, self._without_gravity = robot.model, robot.model.copy()
        self._without_gravity.gravity.setZero()
        self._coupling = robot.coupling

    def kinetic(self, q: Array, qd: Array) -> Array:
        """Return the energies of a motion (K, n) each, (K,) [J]."""
        data, coupling = self._without_gravity.createData(), self._coupling
        rows = zip(coupling.spread(q), coupling.rates(qd), strict=True)
        return np.array(
            [pin.computeKineticEnergy(self._without_gravity, data, *row) for row in rows]
        )

    def kinetic_slopes(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return their derivatives ½ q̇ᵀ ∂(Mq̇)/∂q and Mq̇, (K, n) each.

        At rest and without gravity the inverse dynamics are τ = Mq̈, so that both come from its
        derivatives with q̇ in place of q̈.
        """
        data, rest = self._without_gravity.createData(), np.zeros(self._without_gravity.nv)
        q, qd = self._coupling.spread(q), self._coupling.rates(qd)
        by_q, by_qd = np.empty_like(q), np.empty_like(qd)
        for k in range(len(q)):
            found = pin.computeRNEADerivatives(self._without_gravity, data, q[k], rest, qd[k])
            by_q[k], by_qd[k] = 0.5 * (qd[k] @ found[0]), found[2] @ qd[k]
        by_coordinate = self._coupling.columns_by_coordinate
        return by_coordinate(by_q), by_coordinate(by_qd)

    def mass(self, q: Array) -> Array:
        """Return M at q (n,), (n, n)."""
        at = self._coupling.spread(q)
        upper = np.triu(pin.crba(self._without_gravity, self._without_gravity.createData(), at))
        return _reduced(self._coupling, np.asarray(upper + np.triu(upper, 1).T))

    def gravity(self, q: Array) -> Array:
        """Return g at configurations (K, n), (K, n) [Nm, or N]."""
        data, at = self._model.createData(), self._coupling.spread(q)
        found = [pin.computeGeneralizedGravity(self._model, data, x).copy() for x in at]
        return self._coupling.columns_by_coordinate(np.array(found))

    def gravity_slopes(self, q: Array) -> Array:
        """Return ∂g/∂q at configurations (K, n), (K, n, n)."""
        data, at = self._model.createData(), self._coupling.spread(q)
        slopes = pin.computeGeneralizedGravityDerivatives
        found = np.array([slopes(self._model, data, x).copy() for x in at])
        return _reduced(self._coupling, found)


def _reduced(coupling: Coupling, matrices: Array) -> Array:
    """Return CᵀMC of matrices (…, N, N), (…, n, n)."""
    if coupling.is_plain:
        return matrices
    return np.asarray(coupling.matrix.T @ matrices @ coupling.matrix)


def _check_weighed(robot: RobotModel) -> None:
    """Raise ProblemError where a link that moves has an ``<inertial>`` that lacks something."""
    for said, link in robot.urdf.lacking_inertials.items():
        if robot.carrier_of(link)[0] > 0:
            raise ProblemError(f"{robot.name}: {said}; torques and energies need it: add it")


def has_masses(robot: RobotModel) -> bool:
    """Whether the URDF gives any."""
    return any(item.mass > 0.0 for item in list(robot.model.inertias)[1:])
