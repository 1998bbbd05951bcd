"""Distances of bodies that stand elsewhere than planned, by Pinocchio and coal alone.

Nothing here is of the package's collision models: bodies are convex hulls that coal makes of the
URDF's meshes, and these themselves where hulls overlap, placed by Pinocchio; what is displaced is
moved before it is measured.
"""

import coal
import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.work.margins import SubjectMargin

# What coal's distances of hulls may miss, and so what the judge forgives [m].
MISSED = 1e-5


class Judge:
    """Measures a plan's pairs of bodies while some of them are displaced."""

    def __init__(self, plan: sm.Plan) -> None:
        self.plan, robot = plan, plan.robot
        self._model, self._data = robot.model, robot.model.createData()
        self._bodies = robot.geometry(pin.GeometryType.COLLISION)
        self.names = [robot.link_of(x.parentFrame) for x in self._bodies.geometryObjects]
        self.joints = [int(x.parentJoint) for x in self._bodies.geometryObjects]
        # Hulls refer to the meshes that they are of, which have to stay.
        self._meshes = [item.geometry for item in self._bodies.geometryObjects]
        for item, mesh in zip(self._bodies.geometryObjects, self._meshes, strict=True):
            if hasattr(mesh, "buildConvexHull"):
                mesh.buildConvexHull(True, "Qt")
                item.geometry = mesh.convex
        for item in plan.obstacles:
            if item.name in self.names:
                continue
            joint, place = 0, item.pose
            if item.frame is not None:
                joint, link = robot.carrier_of(item.frame)
                place = link * item.pose
            self._meshes.append(item.geometry())
            self._bodies.addGeometryObject(
                pin.GeometryObject(item.name, joint, 0, place, item.geometry())
            )
            self.names.append(item.name)
            self.joints.append(joint)
        wanted = {
            frozenset(pair)
            for item in plan.requirements
            if isinstance(item, sm.certificate.Separation)
            for pair in item.model.pairs
        }
        for i, first in enumerate(self.names):
            for j in range(i + 1, len(self.names)):
                if frozenset((first, self.names[j])) in wanted:
                    self._bodies.addCollisionPair(pin.CollisionPair(i, j))
        self._places = self._bodies.createData()

    def moved_by(self, subject: SubjectMargin, shift: Array, turn: Array) -> "Displaced":
        """Return a displacement of a subject: a translation [m], and a rotation vector [rad].

        Of part and base in world axes, of the tool in those of the joint that carries it.
        """
        rotation = pin.exp3(turn)
        center = np.asarray(subject.center)
        return Displaced(subject, pin.SE3(rotation, center + shift - rotation @ center))

    def least(self, displaced: "Displaced", t: Array) -> float:
        """Return the smallest distance of all pairs at times (K,) [m]."""
        least = np.inf
        subject, by = displaced.subject, displaced.by
        for q in self.plan.trajectory(t):
            at = self.plan.robot.coupling.spread(q)
            pin.updateGeometryPlacements(self._model, self._data, self._bodies, self._places, at)
            for k, name in enumerate(self.names):
                place = pin.SE3(self._places.oMg[k])
                if subject.name == "base":
                    # All that hangs on the base goes with it; what stands in the world does not.
                    if not (self.joints[k] == 0 and name in subject.bodies):
                        self._places.oMg[k] = by * place
                elif name in subject.bodies and self.joints[k] == self._joint(subject):
                    carrier = self._data.oMi[self.joints[k]]
                    self._places.oMg[k] = carrier * by * carrier.inverse() * place
            pin.computeDistances(self._bodies, self._places)
            found = [each.min_distance for each in self._places.distanceResults]
            # Hulls may overlap where the meshes do not.
            found = [self._of_meshes(k) if x < 0.0 else x for k, x in enumerate(found)]
            least = min([least, *found])
        return float(least)

    def _of_meshes(self, pair: int) -> float:
        """Return the distance of the bodies of a pair themselves, where they are placed."""
        both = self._bodies.collisionPairs[pair]
        parts = []
        for k in (both.first, both.second):
            place = self._places.oMg[k]
            parts += [self._meshes[k], coal.Transform3s(place.rotation, place.translation)]
        answer = coal.DistanceResult()
        coal.distance(*parts, coal.DistanceRequest(), answer)
        # Of meshes that meet coal knows no depth.
        return float(answer.min_distance) if answer.min_distance > 0.0 else -np.inf

    def _joint(self, subject: SubjectMargin) -> int:
        return next(
            joint
            for joint, name in zip(self.joints, self.names, strict=True)
            if name in subject.bodies
        )


class Displaced:
    """A subject, and what it is moved by, in the frame of what carries it."""

    def __init__(self, subject: SubjectMargin, by: pin.SE3) -> None:
        self.subject, self.by = subject, by


def random_displacement(
    rng: np.random.Generator, position: float, rotation: float
) -> tuple[Array, Array]:
    """Return a translation and a rotation vector of these lengths, in random directions."""
    shift, turn = rng.normal(size=(2, 3))
    return (
        position * shift / np.linalg.norm(shift),
        rotation * turn / np.linalg.norm(turn),
    )


def worst_scale(judge: Judge, subject: SubjectMargin, kind: str, t: Array, most: float) -> float:
    """Return by what the translation or rotation may be multiplied along its worst direction.

    Found by bisection, with the distances at times (K,); at most `most`.
    """
    found = getattr(subject, kind)
    direction = np.asarray(found.direction)
    if subject.name == "tool":
        q = judge.plan.trajectory(found.time)
        poses = judge.plan.robot.joint_poses(q[None])[0]
        joint, _ = judge.plan.robot.carrier_of(judge.plan.robot.tool)
        direction = pin.Quaternion(poses[joint - 1, 3:]).matrix().T @ direction
    low, high = 1.0, most
    for _ in range(12):
        middle = 0.5 * (low + high)
        shift, turn = middle * found.position * direction, middle * found.rotation * direction
        clear = judge.least(judge.moved_by(subject, shift, turn), t) >= 0.0
        low, high = (middle, high) if clear else (low, middle)
    return high
