"""How the links of a tree move, and what that takes: written out for who judges motions."""

from typing import Any, NamedTuple

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from support.own_kinematics import Arm

GRAVITY = np.array([0.0, 0.0, -9.81])


class Moving(NamedTuple):
    """A frame that moves, at K times: axes (K, 3, 3), and the rest (K, 3), in world axes."""

    turn: Array
    at: Array
    spin: Array
    speed: Array
    spinning: Array
    speeding: Array

    def carried(self, offset: Array) -> "Moving":
        """Return what is `offset` (K, 3) from its origin and moves along, world axes."""
        across = np.cross(self.spin, offset)
        return self._replace(
            at=self.at + offset,
            speed=self.speed + across,
            speeding=self.speeding + np.cross(self.spinning, offset) + np.cross(self.spin, across),
        )

    def seen_from(self, base: "Moving") -> "Moving":
        """Return the same as somebody sees it who moves along with another frame."""
        away = self.at - base.at
        still = base.carried(away)
        speed, spin = self.speed - still.speed, self.spin - base.spin
        # Coriolis, and the change of the axes that turns are seen in.
        speeding = self.speeding - still.speeding - 2.0 * np.cross(base.spin, speed)
        spinning = self.spinning - base.spinning - np.cross(base.spin, spin)
        rows = (away, spin, speed, spinning, speeding)
        away, spin, speed, spinning, speeding = (
            np.einsum("kji,kj->ki", base.turn, row) for row in rows
        )
        turn = np.einsum("kji,kjl->kil", base.turn, self.turn)
        return Moving(turn, away, spin, speed, spinning, speeding)


class MovingArm(Arm):
    """Velocities and accelerations of every link, and torques of every joint."""

    def __init__(self, robot: sm.RobotModel) -> None:
        super().__init__(robot)
        self._robot = robot

    def moving(self, link: str, motion: tuple[Array, Array, Array]) -> Moving:
        """Return how a link moves, for q, q̇ and q̈ (K, n) each."""
        known: dict[str, Moving] = {}
        return self._link(link, motion, known)

    def _link(
        self, link: str, motion: tuple[Array, Array, Array], known: dict[str, Moving]
    ) -> Moving:
        if link not in known:
            known[link] = self._moved(link, motion, known)
        return known[link]

    def _moved(self, link: str, motion: Any, known: dict[str, Moving]) -> Moving:
        count, zero = len(motion[0]), np.zeros((len(motion[0]), 3))
        if link not in self._above:
            return Moving(np.tile(np.eye(3), (count, 1, 1)), zero, zero, zero, zero, zero)
        joint = self._above[link]
        origin = np.eye(4) if joint.origin is None else joint.origin
        parent = self._link(joint.parent, motion, known)
        frame = parent.carried(parent.turn @ origin[:3, 3])
        frame = frame._replace(turn=frame.turn @ origin[:3, :3])
        if joint.type == "fixed":
            return frame
        axis = np.array([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
        axis = axis / np.linalg.norm(axis)
        column = self.column.get(joint.name)
        x, xd, xdd = (
            (rows[:, column, None] if column is not None else np.full((count, 1), held))
            for rows, held in zip(motion, (self.held.get(joint.name, 0.0), 0.0, 0.0), strict=True)
        )
        along = frame.turn @ axis
        if joint.type == "prismatic":
            slid = frame.carried(along * x)
            fast = 2.0 * np.cross(frame.spin, along) * xd
            return slid._replace(
                speed=slid.speed + along * xd, speeding=slid.speeding + along * xdd + fast
            )
        across = np.cross(axis, np.eye(3)).T
        sine, versine = np.sin(x)[..., None], (1.0 - np.cos(x))[..., None]
        return frame._replace(
            turn=frame.turn @ (np.eye(3) + sine * across + versine * (across @ across)),
            spin=frame.spin + along * xd,
            spinning=frame.spinning + along * xdd + np.cross(frame.spin, along) * xd,
        )

    def torques(self, motion: tuple[Array, Array, Array], payload: float, center: Array) -> Array:
        """Return what joints have to give, (K, n): each body's forces, at each joint below."""
        known: dict[str, Moving] = {}
        found = np.zeros_like(motion[0])
        bodies = [
            (link.name, link.inertial.mass, link.inertial.origin, link.inertial.inertia)
            for link in self._links
            if link.inertial is not None
        ]
        load = np.eye(4)
        load[:3, 3] = center
        bodies.append((self.tool, payload, load, np.zeros((3, 3))))
        for name, mass, origin, inertia in bodies:
            place = np.eye(4) if origin is None else origin
            frame = self._link(name, motion, known)
            body = frame.carried(frame.turn @ place[:3, 3])
            turn = frame.turn @ place[:3, :3]
            about = np.einsum("kij,jl,kml->kim", turn, inertia, turn)
            force = mass * (body.speeding - GRAVITY)
            momentum = np.einsum("kij,kj->ki", about, body.spin)
            moment = np.einsum("kij,kj->ki", about, body.spinning) + np.cross(body.spin, momentum)
            while name in self._above:
                joint = self._above[name]
                if joint.name in self.column:
                    at = self._link(name, motion, known)
                    axis = np.array(joint.axis, dtype=float)
                    axis = at.turn @ (axis / np.linalg.norm(axis))
                    pulled = moment + np.cross(body.at - at.at, force)
                    carried = force if joint.type == "prismatic" else pulled
                    found[:, self.column[joint.name]] += np.einsum("kc,kc->k", axis, carried)
                name = joint.parent
        return found
