"""Separating planes, and distances of bodies after any small displacement of one of them.

A displacement is x → c + d + R (x - c), with |d| and the angle θ of R given, their directions
unknown. Two bounds of the distance that is left hold for all of them at once:

- A point a of the displaced body moves by |d| + θ |a - c| at most. The distance shrinks by no
  more than that with the largest |a - c|, of the one body or, seen from the displaced one, of the
  other.
- A separating plane with normal n between two convex bodies, at rest with the one: a point of
  the other, rotated by θ at most, is at most |a - c| cos(max(0, φ - θ)) along n, φ being the angle
  between a - c and n. To first order that is the distance of the contact's normal from c times θ,
  which is sharp.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import coal
import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, CollisionError
from selfmotion.model.collision.bodies import Body
from selfmotion.model.collision.exact import CollisionModel


@dataclass(frozen=True, eq=False)
class ConvexOutline:
    """A convex body about a point: it is in the hull of balls, or of discs, of one radius.

    Attributes
    ----------
    points : (V, 3)
        Their middles from that point, in world axes [m].
    radius : float
        [m].
    axis : (3,) or None
        Normal of the discs; None of balls.
    """

    points: Array
    radius: float
    axis: Array | None

    @property
    def farthest(self) -> float:
        """Largest distance of a point of it from that point [m]."""
        return float(np.linalg.norm(self.points, axis=1).max()) + self.radius


class SupportFunction:
    """Support function of a convex outline along n, maximised over rotations of at most θ.

    Parameters
    ----------
    outline : Outline
    normal : (3,)
    """

    def __init__(self, outline: ConvexOutline, normal: Array) -> None:
        along = outline.points @ normal
        self._points, self._radius = outline.points, outline.radius
        self._lengths = np.sqrt(np.einsum("vi,vi->v", outline.points, outline.points))
        # A point at the centre is there whatever its angle.
        shares = along / np.maximum(self._lengths, 1e-300)
        self._angles = np.arccos(np.clip(shares, -1.0, 1.0))
        self._upright = 0.5 * np.pi
        if outline.axis is not None:
            self._upright = float(np.arccos(min(abs(float(outline.axis @ normal)), 1.0)))
        self.at_zero = float(along.max()) + self._radius * float(np.sin(self._upright))

    def most(self, angles: Array) -> Array:
        """Return the largest support after rotations by at most these angles (G,), (G,) [m]."""
        heights = self._heights(angles[:, None]).max(axis=1)
        share = np.sin(np.minimum(self._upright + angles, 0.5 * np.pi))
        return np.asarray(heights + self._radius * share)

    def farthest(self, angle: float) -> Array:
        """Return the point (3,) that is highest then."""
        return np.asarray(self._points[int(np.argmax(self._heights(np.array(angle))))])

    def _heights(self, angles: Array) -> Array:
        turned = np.maximum(self._angles - angles, 0.0)
        return np.asarray(self._lengths * np.cos(turned))


class SeparatingPlane:
    """Two convex bodies with a plane between them.

    Parameters
    ----------
    displaced, other : Outline
        About the centre of the displacement.
    normal : (3,)
        Of the plane, from the displaced body to the other, in world axes.
    """

    def __init__(self, displaced: ConvexOutline, other: ConvexOutline, normal: Array) -> None:
        self.normal = normal
        self._displaced, self._other = (
            SupportFunction(displaced, normal),
            SupportFunction(other, -normal),
        )

    def distances(self, angles: Array) -> Array:
        """Return the remaining distance after rotations by at most these angles (G,), (G,) [m]."""
        first, second = self._both(angles)
        return np.maximum(first, second)

    def _both(self, angles: Array) -> tuple[Array, Array]:
        """Return it with a plane at rest with the other body, and with the displaced one."""
        displaced, other = self._displaced, self._other
        return -other.at_zero - displaced.most(angles), -other.most(angles) - displaced.at_zero

    def moment(self, angle: float) -> Array:
        """Return the moment of the rotation that brings them nearest, (3,) [m]."""
        first, second = self._both(np.array([angle]))
        side = self._displaced if first[0] >= second[0] else self._other
        return np.cross(side.farthest(angle), self.normal)


@dataclass(frozen=True, eq=False)
class Separation:
    """Bound of the distance of two bodies while one of them may be displaced.

    Attributes
    ----------
    distance : float
        While it is not [m].
    lever : float
        How far points of the nearer of both bodies are from the centre at most [m].
    parts : tuple of Parted
        Convex bodies that contain both, each with each.
    """

    distance: float
    lever: float
    parts: tuple[SeparatingPlane, ...]

    def least(self, positions: Array, angles: Array) -> Array:
        """Return bounds after displacements by positions (G,) [m] and angles (G,) [rad]."""
        by_points = self.distance - self.lever * angles
        if not angles.any():
            return np.asarray(by_points - positions)
        by_planes = np.min([part.distances(angles) for part in self.parts], axis=0)
        return np.asarray(np.maximum(by_points, by_planes) - positions)

    def nearest(self, angle: float) -> SeparatingPlane:
        """Return the two convex bodies that come nearest to each other."""
        left = [part.distances(np.array([angle]))[0] for part in self.parts]
        return self.parts[int(np.argmin(left))]


class DisplacedBodies:
    """Some bodies on one joint, or in the world, that are displaced together.

    Parameters
    ----------
    model : CollisionModel
    names : iterable of str
        Links and obstacles.
    joint : int
        Index of the joint that carries them, 0 for the world; those of the names that something
        else carries stay.
    center : (3,)
        Centre of the rotations, in the frame of the joint [m].

    Attributes
    ----------
    model : CollisionModel
        That of the P pairs of a body that is displaced and one that is not.
    """

    def __init__(
        self, model: CollisionModel, names: Iterable[str], joint: int, center: Array
    ) -> None:
        chosen = set(names)
        self._is_displaced = [
            body.joint == joint and body.name in chosen for body in model.every_body
        ]
        selected = [
            (i, j)
            for i, j in model.index.tolist()
            if self._is_displaced[i] != self._is_displaced[j]
        ]
        self.model, self._joint, self._center = model.of_pairs(selected), joint, center
        # Of each pair the displaced body, and the other.
        ordered = [(i, j) if self._is_displaced[i] else (j, i) for i, j in selected]
        self._sides = np.array(ordered, dtype=np.int64).reshape(-1, 2)
        self._others, self._other_of = np.unique(self._sides[:, 1], return_inverse=True)
        self._hulls, of = self.model.decomposed()
        self._pieces = [np.flatnonzero(of == pair) for pair in range(len(selected))]

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the pairs, the displaced body first."""
        names = self.model.bodies
        return tuple((names[first], names[other]) for first, other in self._sides.tolist())

    @cached_property
    def lever_arms(self) -> Array:
        """Largest distance of points of each pair's displaced body from the centre, (P,) [m]."""
        bodies = self.model.every_body
        far = {
            index: _outline(bodies[index], bodies[index].place, self._center).farthest
            for index in set(self._sides[:, 0].tolist())
        }
        return np.array([far[index] for index in self._sides[:, 0].tolist()])

    def other_lever_arms(self, q: Array) -> Array:
        """Return upper bounds of the same of the other bodies at q (n,), (P,)."""
        places = self.model.hulls.place(q)
        solids = [self.model.every_body[index].solid for index in self._others.tolist()]
        middles = [
            places[index].act(0.5 * (solid.low + solid.high))
            for index, solid in zip(self._others.tolist(), solids, strict=True)
        ]
        halves = [0.5 * (solid.high - solid.low) for solid in solids]
        away = np.array(middles) - self._center_in_world(q)
        far = np.linalg.norm(away, axis=1) + np.linalg.norm(halves, axis=1)
        return np.asarray(far[self._other_of])

    def _center_in_world(self, q: Array) -> Array:
        """Return the position of the centre at q (n,)."""
        if not self._joint:
            return self._center
        # From a body that the same joint carries.
        index = int(self._sides[0, 0])
        place = self.model.every_body[index].place
        return np.asarray(self.model.hulls.place(q)[index].act(place.inverse().act(self._center)))

    def at(self, q: Array, pair: int) -> Separation:
        """Return the bound of a pair at q (n,).

        Raises
        ------
        CollisionError
            Two bodies' distance contradicts that of their boxes.
        """
        center = self._center_in_world(q)
        rows = self._pieces[pair]
        bounds = self._hulls.lower_bounds(q[None])[0, rows]
        contacts = self._hulls.contacts(q[None], np.zeros(len(rows), dtype=np.int64), rows, bounds)
        places, swapped = self._hulls.place(q), self.model.index[pair, 0] != self._sides[pair, 0]
        parts, farthest = [], 0.0
        for piece, normal in zip(rows.tolist(), contacts.normals, strict=True):
            first, second = self._hulls.pairs[piece].tolist()
            one, other = (
                _outline(self._hulls.bodies[body], places[body], center)
                for body in ((second, first) if swapped else (first, second))
            )
            farthest = max(farthest, other.farthest)
            length = float(np.linalg.norm(normal))
            if not length > 0.0:
                raise CollisionError(
                    f"{' and '.join(self.pairs[pair])}: coal finds no direction between them"
                )
            # Contacts' normals point from the second body to the first.
            parts.append(SeparatingPlane(one, other, (normal if swapped else -normal) / length))
        distance = float(contacts.values.min())
        if not self.model.is_convex(pair):
            wanted = np.full((1, len(self.pairs)), -np.inf)
            wanted[0, pair] = np.inf
            distance = float(self.model.distances(q[None], wanted)[0, pair])
        lever = min(float(self.lever_arms[pair]), farthest)
        return Separation(distance, lever, tuple(parts))


def _outline(body: Body, place: pin.SE3, center: Array) -> ConvexOutline:
    """Return a body that is at a place as an outline about a centre."""
    points, radius = body.solid.outline
    is_round = isinstance(body.solid.hull, coal.Cylinder)
    return ConvexOutline(
        points @ place.rotation.T + place.translation - center,
        radius,
        place.rotation[:, 2] if is_round else None,
    )
