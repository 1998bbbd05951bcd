"""Distances of simple bodies by points of the one and the exact distance function of the other.

A body is a box or a segment, rounded by a radius, or a cylinder. Every point looked at belongs to
its body, so that the distance found is an upper bound of the true one: what it refutes is false.
Between a sphere or capsule's points and a body it is exact, or nearly.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

import selfmotion as sm
from selfmotion.basics import Array

# Points along edges, axes and rims; how often points are projected from body to body.
ALONG, PROJECTIONS = 25, 40
# Of so many places at most the distance is taken closely.
MOST = 2048


@dataclass(frozen=True, eq=False)
class Solid:
    """A body in the axes of its link or of the world.

    Attributes
    ----------
    half : (3,)
        Half lengths of its box, or of its segment along z; for a cylinder (radius, radius, half).
    radius : float
        What it is rounded by [m].
    turn, at : (3, 3), (3,)
        Where it is.
    is_round : bool
        Whether it is a cylinder.
    """

    half: Array
    radius: float
    turn: Array = field(default_factory=lambda: np.eye(3))
    at: Array = field(default_factory=lambda: np.zeros(3))
    is_round: bool = False

    @property
    def reach(self) -> float:
        """How far from its middle it reaches at most [m]."""
        return float(np.linalg.norm(self.half)) + self.radius

    @property
    def points(self) -> Array:
        """Points of what is rounded: corners and edges, axis, or rims, (P, 3)."""
        along = np.linspace(-1.0, 1.0, ALONG)
        if self.is_round:
            angle = np.linspace(0.0, 2.0 * np.pi, 2 * ALONG)
            rims = [[np.cos(a), np.sin(a), s] for a in angle for s in (-1.0, 0.0, 1.0)]
            return self.half * np.array([*rims, *([0.0, 0.0, s] for s in along)])
        free = np.flatnonzero(self.half)
        if not len(free):
            return np.zeros((1, 3))
        found = []
        for k in free:
            others = [along if i == k else [-1.0, 1.0] for i in range(3)]
            found.append(np.stack(np.meshgrid(*others), axis=-1).reshape(-1, 3))
        return np.unique(self.half * np.vstack(found), axis=0)

    def excess(self, x: Array) -> Array:
        """Return the signed distance of points (..., 3) in the body's own axes from it."""
        if self.is_round:
            x = np.stack([np.hypot(x[..., 0], x[..., 1]), x[..., 2]], axis=-1)
            over = np.stack([x[..., 0] - self.half[0], np.abs(x[..., 1]) - self.half[2]], axis=-1)
        else:
            over = np.abs(x) - self.half
        outside = np.linalg.norm(np.maximum(over, 0.0), axis=-1)
        return np.asarray(outside + np.minimum(over.max(axis=-1), 0.0) - self.radius)

    def placed(self, place: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return rotation and position of the body, its link being at a place."""
        turn, at = place
        return turn @ self.turn, at + turn @ self.at

    def distance(self, other: "Solid", here: Any, there: Any, below: float = np.inf) -> float:
        """Return the least distance over K places of both, if it is below a bound.

        `here` and `there` are rotations (K, 3, 3) and positions (K, 3) of the links.
        """
        (turn, at), (turned, away) = self.placed(here), other.placed(there)
        gap = at - away
        floor = np.linalg.norm(gap, axis=1) - self.reach - other.reach
        middle = np.einsum("kji,kj->ki", np.broadcast_to(turned, (len(gap), 3, 3)), gap)
        floor = np.maximum(floor, other.excess(middle) - self.reach)
        near = np.flatnonzero(floor < below)
        if not len(near):
            return below
        best, places = below, (turn, at, turned, away)
        # A rough look at all, then a close one at those that seem nearest.
        rough = self._projected(other, *_picked(places, near), 5)
        best = min(best, float(rough.min()))
        order = near[np.argsort(rough)]
        for begin in range(0, min(len(order), MOST), 256):
            rows = order[begin : begin + 256]
            rows = rows[floor[rows] < best]
            if not len(rows):
                continue
            pick = _picked(places, rows)
            best = min(
                best,
                self._closest(other, *pick),
                other._closest(self, *pick[2:], *pick[:2]),
                float(self._projected(other, *pick, PROJECTIONS).min()),
            )
        return best

    def _closest(self, other: "Solid", turn: Array, at: Array, turned: Array, away: Array) -> float:
        """Return the least distance of this body's points from the other body."""
        x = np.einsum("kij,pj->kpi", turn, self.points) + at[:, None] - away[:, None]
        x = np.einsum("kji,kpj->kpi", np.broadcast_to(turned, (len(x), 3, 3)), x)
        return float(other.excess(x).min() - self.radius)

    def _projected(
        self, other: "Solid", turn: Array, at: Array, turned: Array, away: Array, often: int
    ) -> Array:
        """Return distances, (K,), by projecting points from body to body and back."""
        x = 0.5 * (at + away)
        for _ in range(often):
            here = at + _by(turn, self.nearest(_back(turn, x - at)))
            x = away + _by(turned, other.nearest(_back(turned, here - away)))
        return np.asarray(np.linalg.norm(here - x, axis=1) - self.radius - other.radius)

    def nearest(self, x: Array) -> Array:
        """Return the points of what is rounded that are nearest to points (K, 3)."""
        if not self.is_round:
            return np.clip(x, -self.half, self.half)
        length = np.hypot(x[:, 0], x[:, 1])
        share = np.minimum(self.half[0] / np.maximum(length, 1e-300), 1.0)
        along = np.clip(x[:, 2], -self.half[2], self.half[2])
        return np.stack([share * x[:, 0], share * x[:, 1], along], axis=1)


def _picked(places: Any, rows: Any) -> list[Array]:
    return [x if len(x) == 1 else x[rows] for x in places]


def _by(turn: Array, x: Array) -> Array:
    return np.asarray((turn @ x[:, :, None])[:, :, 0])


def _back(turn: Array, x: Array) -> Array:
    return _by(turn.transpose(0, 2, 1), x)


def solid_of_link(collision: Any) -> Solid:
    """Return the body of a URDF's collision element."""
    origin = np.eye(4) if collision.origin is None else collision.origin
    place = {"turn": origin[:3, :3], "at": origin[:3, 3]}
    shape = collision.geometry
    if shape.sphere is not None:
        return Solid(np.zeros(3), float(shape.sphere.radius), **place)
    if shape.box is not None:
        return Solid(0.5 * np.asarray(shape.box.size, dtype=float), 0.0, **place)
    if shape.cylinder is not None:
        size = shape.cylinder
        half = np.array([size.radius, size.radius, 0.5 * size.length], dtype=float)
        return Solid(half, 0.0, **place, is_round=True)
    raise ValueError("the judge knows boxes, spheres and cylinders, no meshes")


def solid_of_obstacle(obstacle: sm.obstacles.Obstacle) -> Solid:
    """Return the body of an obstacle."""
    place = {"turn": obstacle.pose.rotation, "at": obstacle.pose.translation}
    match obstacle:
        case sm.obstacles.Sphere():
            return Solid(np.zeros(3), obstacle.radius, **place)
        case sm.obstacles.Box():
            return Solid(0.5 * obstacle.size, 0.0, **place)
        case sm.obstacles.Capsule():
            return Solid(np.array([0.0, 0.0, 0.5 * obstacle.length]), obstacle.radius, **place)
        case sm.obstacles.Mesh():
            # Meshes here are those of boxes.
            low, high = trimesh.load_mesh(obstacle.file).bounds * obstacle.scale
            place["at"] = place["at"] + place["turn"] @ (0.5 * (low + high))
            return Solid(0.5 * (high - low), 0.0, **place)
        case sm.obstacles.Cylinder():
            half = np.array([obstacle.radius, obstacle.radius, 0.5 * obstacle.length])
            return Solid(half, 0.0, **place, is_round=True)
    raise ValueError(f"the judge knows no {obstacle.label}")
