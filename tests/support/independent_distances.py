"""Signed distances of convex bodies by their support functions, without GJK and EPA.

The signed distance of two convex bodies is the largest separation along a unit direction n,
max_n [min over B of n·x - max over A of n·x], negative where they overlap. So every direction gives
a lower bound, and two points, one of each body, give an upper bound of a positive distance.
"""

from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from selfmotion.model.collision import Body, Solid
from selfmotion.model.collision.distances import HullDistances
from selfmotion.model.robot import RobotModel, load_robot

# What a direction separates by may miss, and a nearest point [m]: GJK ends at a relative 1e-9 of
# the squared distance, so directions are right to 3e-5, for bodies and distances of up to 1.5 m.
TOLERANCE = 5e-5

KINDS = ("box", "sphere", "cylinder", "capsule", "hull")

_FREE = """<robot name="free"><link name="world"/>{}</robot>"""
_JOINT = (
    '<link name="l{0}"/><joint name="j{0}" type="{1}"><parent link="{2}"/><child link="l{0}"/>'
    '<axis xyz="{3}"/><limit lower="-4" upper="4" velocity="1" effort="1"/></joint>'
)


def free_body(folder: Any) -> RobotModel:
    """Return a robot whose six joints move its last link anywhere: x, y, z, and three angles."""
    axes = ("1 0 0", "0 1 0", "0 0 1") * 2
    joints = "".join(
        _JOINT.format(k, "prismatic" if k < 3 else "revolute", f"l{k - 1}" if k else "world", axis)
        for k, axis in enumerate(axes)
    )
    file = folder / "free.urdf"
    file.write_text(_FREE.format(joints))
    return load_robot(file)


def random_body(kind: str, rng: np.random.Generator) -> Any:
    """Return a coal geometry of a kind, its sizes between 1 cm and 0.5 m."""
    if kind == "box":
        return coal.Box(*rng.uniform(0.01, 0.5, 3))
    if kind == "sphere":
        return coal.Sphere(rng.uniform(0.01, 0.3))
    if kind == "cylinder":
        return coal.Cylinder(*rng.uniform(0.01, 0.3, 2))
    if kind == "capsule":
        return coal.Capsule(*rng.uniform(0.01, 0.3, 2))
    points = rng.normal(size=(int(rng.integers(5, 200)), 3)) * rng.uniform(0.02, 0.15, 3)
    return mesh_of(points, ConvexHull(points).simplices)


def mesh_of(points: np.ndarray, faces: np.ndarray) -> Any:
    """Return coal's mesh of triangles."""
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(points))
    for face in faces:
        mesh.addTriangle(*points[face])
    mesh.endModel()
    return mesh


def body(name: str, joint: int, place: pin.SE3, geometry: Any) -> Body:
    """Return a geometry as a body."""
    return Body(name, name if joint else "", joint, place, Solid(geometry, name))


@dataclass(frozen=True, eq=False)
class Convex:
    """A convex body: the balls of a radius around a core."""

    kind: str
    sizes: np.ndarray
    points: np.ndarray
    planes: np.ndarray

    @classmethod
    def of(cls, geometry: Any) -> "Convex":
        none = np.empty((0, 4))
        if isinstance(geometry, coal.Box):
            signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
            return cls("box", np.array(geometry.halfSide), signs * geometry.halfSide, none)
        if isinstance(geometry, coal.Sphere):
            return cls("sphere", np.array([geometry.radius, 0.0]), np.empty((0, 3)), none)
        if isinstance(geometry, coal.Capsule | coal.Cylinder):
            kind = "capsule" if isinstance(geometry, coal.Capsule) else "cylinder"
            return cls(
                kind, np.array([geometry.radius, geometry.halfLength]), np.empty((0, 3)), none
            )
        points = np.array(geometry.vertices())
        return cls("hull", np.empty(0), points, ConvexHull(points).equations)

    def support(self, directions: np.ndarray) -> np.ndarray:
        """Return max n·x over the body, for directions (D, 3)."""
        if len(self.points):
            return np.asarray((directions @ self.points.T).max(axis=1))
        radius, half = self.sizes
        along, all_of_it = np.abs(directions[:, 2]), np.linalg.norm(directions, axis=1)
        around = np.hypot(directions[:, 0], directions[:, 1])
        return np.asarray(
            half * along + radius * (around if self.kind == "cylinder" else all_of_it)
        )

    def excess(self, point: np.ndarray) -> float:
        """Return by how much a point is outside, at most 0 inside."""
        if self.kind == "box":
            return float((np.abs(point) - self.sizes).max())
        if self.kind == "hull":
            return float((self.planes[:, :3] @ point + self.planes[:, 3]).max())
        radius, half = self.sizes
        if self.kind == "cylinder":
            return float(max(np.hypot(*point[:2]) - radius, abs(point[2]) - half))
        nearest = np.array([0.0, 0.0, np.clip(point[2], -half, half)])
        return float(np.linalg.norm(point - nearest) - radius)


def separation(
    first: Convex, at: pin.SE3, second: Convex, there: pin.SE3, directions: np.ndarray
) -> np.ndarray:
    """Return the separation along unit directions (D, 3), from the second body to the first."""
    low = directions @ at.translation - first.support(-directions @ at.rotation)
    high = directions @ there.translation + second.support(directions @ there.rotation)
    return np.asarray(low - high)


def fault(
    first: Convex,
    at: pin.SE3,
    second: Convex,
    there: pin.SE3,
    contact: tuple[float, np.ndarray, np.ndarray],
    rng: np.random.Generator,
) -> str:
    """Return what is wrong with (distance, normal, nearest point of the first), or nothing."""
    value, normal, point = contact
    if not (np.isfinite(value) and np.all(np.isfinite(normal))):
        return f"distance {value}, normal {normal}"
    if abs(np.linalg.norm(normal) - 1.0) > 1e-6:
        return f"normal of length {np.linalg.norm(normal)}"
    along = separation(first, at, second, there, normal[None])[0]
    if along < value - TOLERANCE:
        return f"distance {value}, but its normal separates by {along} only"
    if value > 0.0:
        ends = (first, at, point), (second, there, point - value * normal)
        for body, place, end in ends:
            if body.excess(place.actInv(end)) > TOLERANCE:
                return f"distance {value}, but a nearest point is outside its {body.kind}"
        return ""
    # Normals nearby and far away: none may separate by more.
    tries = np.vstack([normal + 0.1 * rng.normal(size=(150, 3)), rng.normal(size=(150, 3))])
    tries /= np.linalg.norm(tries, axis=1)[:, None]
    best = max(along, separation(first, at, second, there, tries).max())
    if best > value + TOLERANCE:
        return f"depth {-value}, but a direction separates by {best}"
    return ""


@dataclass(frozen=True, eq=False)
class Trial:
    """Bodies that a robot moves against others that stand still."""

    distances: HullDistances
    moving: list[Convex]
    still: list[Convex]
    places: list[pin.SE3]

    @classmethod
    def made(cls, robot: RobotModel, rng: np.random.Generator, each: int) -> "Trial":
        """Return `each` bodies of every kind that move, and as many that do not."""
        shapes = [[random_body(kind, rng) for kind in KINDS for _ in range(each)] for _ in range(2)]
        places = [
            pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform(-0.3, 0.3, 3)) for _ in shapes[1]
        ]
        bodies = [body("moving", 6, pin.SE3.Identity(), shape) for shape in shapes[0]]
        bodies += [
            body("still", 0, place, shape) for place, shape in zip(places, shapes[1], strict=True)
        ]
        count = len(shapes[0])
        pairs = np.array([(i, count + j) for i in range(count) for j in range(count)])
        model = HullDistances(robot, bodies, pairs)
        return cls(model, *([Convex.of(shape) for shape in side] for side in shapes), places)

    def faults(
        self, robot: RobotModel, rng: np.random.Generator, count: int, wander: float
    ) -> list[str]:
        """Return what is wrong in `count` poses of all pairs, one some way from the one before."""
        q, found = np.empty((count, 6)), []
        for k in range(count):
            fresh = np.concatenate([rng.uniform(-0.6, 0.6, 3), rng.uniform(-3.0, 3.0, 3)])
            if k % 10 == 0:
                # Parallel faces and edges are the hard ones.
                fresh[3:] = 0.5 * np.pi * rng.integers(-1, 2, 3)
            far = k == 0 or rng.uniform() < 0.3
            q[k] = fresh if far else q[k - 1] + wander * rng.normal(size=6)
        pairs = self.distances.pairs
        rows = np.repeat(np.arange(count), len(pairs))
        columns = np.tile(np.arange(len(pairs)), count)
        bounds = self.distances.lower_bounds(q)
        contacts = self.distances.contacts(q, rows, columns, bounds.ravel())
        for m, (row, column) in enumerate(zip(rows, columns, strict=True)):
            i, j = pairs[column][0], pairs[column][1] - len(self.moving)
            contact = contacts.values[m], contacts.normals[m], contacts.points[m]
            at = robot.pose(q[row])
            wrong = fault(self.moving[i], at, self.still[j], self.places[j], contact, rng)
            if not wrong and bounds[row, column] > contact[0] + 1e-9:
                wrong = f"distance {contact[0]}, but boxes bound it by {bounds[row, column]}"
            if wrong:
                found.append(f"{self.moving[i].kind} - {self.still[j].kind}: {wrong}")
        return found
