"""Judges motions of the suite by a folder's criteria, sharing no code with the planner.

Kinematics are those of the tests' independent judge (yourdfpy reads the URDF, NumPy places the
links); whether bodies meet is asked of coal, of the URDF's own bodies, pair by pair.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.basics import Array

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.own_kinematics import Arm


@dataclass(frozen=True)
class Judged:
    """What a folder's criteria say about a motion at the waypoints.

    Attributes
    ----------
    reason : str
        What is wrong; "" for a valid motion.
    length_rad, length_m : float
        Σ|Δq| of revolute and of prismatic joints.
    position_error, rotation_error_deg : float
        Largest of all waypoints [m, deg].
    step_deg, step_m : float
        Largest of a revolute and of a prismatic joint.
    limit_margin : float
        Smallest [rad or m].
    """

    reason: str
    length_rad: float
    length_m: float
    position_error: float
    rotation_error_deg: float
    step_deg: float
    step_m: float
    limit_margin: float


class SuiteJudge:
    """Judges motions of one arm among boxes.

    Parameters
    ----------
    robot : RobotModel
    boxes : sequence of (size, pose)
        Lengths (3,) [m] and a pinocchio.SE3 each.
    disabled : set of frozenset of str
        Pairs of links that are not judged.
    criteria : dict
        As in problem.json.
    free_axis : str or None
        The tip's axis about which turning is free: "z".
    """

    def __init__(
        self,
        robot: sm.RobotModel,
        boxes: list[tuple[Array, Any]],
        disabled: set[frozenset[str]],
        criteria: dict[str, Any],
        free_axis: str | None,
    ) -> None:
        self._robot, self._criteria, self._free_axis = robot, criteria, free_axis
        self._arm = Arm(robot)
        self._prismatic = np.array([robot.is_prismatic(name) for name in robot.joint_names])
        self._bodies = robot.geometry(pin.GeometryType.COLLISION)
        full = pin.buildModelFromXML(robot.urdf.text)
        # Read before boxes are added, which moves all bodies to another place in memory.
        links = [
            (_link(full, item.name), int(item.parentJoint)) for item in self._bodies.geometryObjects
        ]
        for k, (size, pose) in enumerate(boxes):
            box = pin.GeometryObject(f"box {k}", 0, 0, pose, coal.Box(*np.asarray(size)))
            self._bodies.addGeometryObject(box)
        # Pairs that at most one joint moves: not judged, so that planners need not ask it.
        self.neighbours: list[tuple[str, str]] = []
        for i, (name, joint) in enumerate(links):
            for j, (other, above) in enumerate(links[:i]):
                if self._joints_between(joint, above) <= 1:
                    self.neighbours.append((other, name))
                elif frozenset((name, other)) not in disabled:
                    self._bodies.addCollisionPair(pin.CollisionPair(j, i))
            # What no joint moves is where it is.
            for k in range(len(boxes)) if joint else ():
                self._bodies.addCollisionPair(pin.CollisionPair(i, len(links) + k))

    def judge(self, targets: list[Any], q: Array) -> Judged:
        """Return what the criteria say of q (W, n), the tool's poses being `targets`."""
        robot, wanted = self._robot, self._criteria
        position, rotation = self._misses(targets, q)
        steps = np.abs(np.diff(q, axis=0))
        turns = np.abs((steps[:, ~self._prismatic] + np.pi) % (2 * np.pi) - np.pi)
        slides = steps[:, self._prismatic]
        step_deg, step_m = (float(x.max(initial=0.0)) for x in (np.degrees(turns), slides))
        margin = float(np.minimum(q - robot.lower, robot.upper - q).min())
        meeting = self._first_meeting(q) if wanted["collision_free"] else ""
        checks = {
            f"{position * 1e3:.3f} mm off the path": position < wanted["position_m"],
            f"{rotation:.3f}° off the path": rotation < wanted["rotation_deg"],
            f"a joint step of {step_deg:.2f}°": step_deg < wanted["joint_step_deg"],
            f"a joint step of {step_m:.4f} m": step_m < wanted.get("prismatic_step_m", np.inf),
            f"{-margin:.3g} rad or m beyond a joint limit": margin >= 0.0,
            meeting: not meeting,
        }
        reason = "; ".join(text for text, kept in checks.items() if not kept)
        lengths = float(turns.sum()), float(slides.sum())
        return Judged(reason, *lengths, position, rotation, step_deg, step_m, margin)

    def _misses(self, targets: list[Any], q: Array) -> tuple[float, float]:
        """Return the largest miss in position [m] and rotation [deg]."""
        turn, at = self._arm.place(self._arm.tool, q)
        if self._robot.reference is not None:
            base, origin = self._arm.place(self._robot.reference, q)
            at = np.einsum("kji,kj->ki", base, at - origin)
            turn = np.einsum("kji,kjl->kil", base, turn)
        wanted = np.array([pose.rotation for pose in targets])
        position = np.linalg.norm(at - [pose.translation for pose in targets], axis=1)
        if self._free_axis is None:
            relative = np.einsum("kji,kjl->kil", wanted, turn)
            angle = Rotation.from_matrix(relative).magnitude()
        else:
            axis = "xyz".index(self._free_axis)
            chord = np.linalg.norm(turn[:, :, axis] - wanted[:, :, axis], axis=1)
            angle = 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
        return float(position.max()), float(np.degrees(angle.max()))

    def _first_meeting(self, q: Array) -> str:
        """Return which bodies meet where first; "" for none."""
        model, data = self._robot.model, self._robot.model.createData()
        places = self._bodies.createData()
        for row, x in enumerate(q):
            if pin.computeCollisions(model, data, self._bodies, places, x, True):
                met = [result.isCollision() for result in places.collisionResults].index(True)
                pair = self._bodies.collisionPairs[met]
                names = [self._bodies.geometryObjects[i].name for i in (pair.first, pair.second)]
                return f"'{names[0]}' meets '{names[1]}' at waypoint {row}"
        return ""

    def _joints_between(self, first: int, second: int) -> int:
        """Return how many joints move one link relative to another."""
        above: list[set[int]] = []
        for joint in (first, second):
            chain = set()
            while joint:
                chain.add(joint)
                joint = int(self._robot.model.parents[joint])
            above.append(chain)
        return len(above[0] ^ above[1])


def _link(model: Any, body: str) -> str:
    """Return the link that a body is named after: LINK_0, LINK_1, …"""
    index = model.getFrameId(body.rpartition("_")[0], pin.FrameType.BODY)
    return str(model.frames[index].name)
