"""Kinematics of arms and cubics of motions, written out: what the judge of motions stands on."""

import io
from functools import cached_property
from typing import Any

import numpy as np
import yourdfpy

import selfmotion as sm
from selfmotion.basics import Array
from support.solids import Solid, solid_of_link


class Arm:
    """Forward kinematics of every link, as the URDF has its joints."""

    def __init__(self, robot: sm.RobotModel) -> None:
        text = io.BytesIO(robot.urdf.text.encode())
        parsed = yourdfpy.URDF.load(text, load_meshes=False, build_scene_graph=False).robot
        self.column = {name: k for k, name in enumerate(robot.joint_names)}
        self.held, self.tool = dict(robot.locked), robot.tool
        self._joint = {joint.name: joint for joint in parsed.joints}
        self._above = {joint.child: joint for joint in parsed.joints}
        self._links = parsed.links

    @cached_property
    def solids(self) -> list[tuple[str, Solid]]:
        """The bodies of all links, with their names."""
        return [
            (link.name, solid)
            for link in self._links
            for solid in map(solid_of_link, link.collisions)
        ]

    def coordinate(self, name: str, q: Array) -> Array:
        """Return a joint's coordinate for q (K, n), (K,): its own, that it mimics, or held."""
        if name in self.column:
            return q[:, self.column[name]]
        mimic = self._joint[name].mimic
        if mimic is None or name in self.held:
            return np.full(1, self.held.get(name, 0.0))
        factor = 1.0 if mimic.multiplier is None else mimic.multiplier
        return factor * self.coordinate(mimic.joint, q) + (mimic.offset or 0.0)

    def place(
        self, link: str, q: Array, known: dict[str, Any] | None = None
    ) -> tuple[Array, Array]:
        """Return rotations (K, 3, 3) and positions (K, 3) of a link; K may be 1 where it stands."""
        known = {} if known is None else known
        if link not in known:
            known[link] = self._placed(link, q, known)
        return known[link]

    def _placed(self, link: str, q: Array, known: dict[str, Any]) -> tuple[Array, Array]:
        if link not in self._above:
            return np.eye(3)[None], np.zeros((1, 3))
        joint = self._above[link]
        turn, at = self.place(joint.parent, q, known)
        origin = np.eye(4) if joint.origin is None else joint.origin
        at, turn = at + turn @ origin[:3, 3], turn @ origin[:3, :3]
        if joint.type == "fixed":
            return turn, at
        axis = np.array([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
        axis = axis / np.linalg.norm(axis)
        x = self.coordinate(joint.name, q)
        if joint.type == "prismatic":
            return turn, at + x[:, None] * (turn @ axis)
        across = np.cross(axis, np.eye(3)).T  # across @ v = axis × v
        sine, versine = np.sin(x)[:, None, None], 2.0 * np.sin(0.5 * x)[:, None, None] ** 2
        return turn @ (np.eye(3) + sine * across + versine * (across @ across)), at


def along(motion: sm.Trajectory, t: Array, order: int) -> Array:
    """Return q (order 0) or a derivative at times t (K,), (K, n).

    Of the polynomials that meet what is known at both ends of an interval, found by solving for
    their powers: cubics, or quintics where accelerations are known.
    """
    given = [motion.q, motion.qd] if motion.qdd is None else [motion.q, motion.qd, motion.qdd]
    k = np.minimum(np.searchsorted(motion.t, t, side="right") - 1, len(motion.t) - 2)
    h, s = np.diff(motion.t)[:, None], ((t - motion.t[k]) / np.diff(motion.t)[k])[:, None]
    powers = np.arange(2 * len(given))
    rows = [
        _powers(np.array([[end]]), powers, j)[0] for end in (0.0, 1.0) for j in range(len(given))
    ]
    # In units of the interval.
    known = [x[rows_] * h**j for rows_ in (slice(-1), slice(1, None)) for j, x in enumerate(given)]
    coefficients = np.linalg.solve(np.array(rows), np.stack(known).reshape(len(powers), -1))
    coefficients = coefficients.reshape(len(powers), *known[0].shape)
    values = np.einsum("kp,pkn->kn", _powers(s, powers, order), coefficients[:, k])
    return np.asarray(values / h[k] ** order)


def _powers(s: Array, powers: Array, order: int) -> Array:
    """Return the derivatives of s^p for s (K, 1), (K, P)."""
    factor = np.ones(len(powers))
    for j in range(order):
        factor = factor * (powers - j)
    return np.asarray(factor * s ** np.maximum(powers - order, 0))
