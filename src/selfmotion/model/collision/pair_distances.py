"""Distances of pairs of bodies: of their hulls first, of the meshes where those do not decide."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import coal
import numpy as np

from selfmotion.basics import Array, CollisionError, Flags
from selfmotion.model.collision.bodies import Body, moved_by
from selfmotion.model.collision.distances import HullDistances, Ints
from selfmotion.model.collision.solids import Solid
from selfmotion.model.robot import RobotModel

# Allowance for rounding of distances of surfaces below those of the hulls [m].
_ROUNDING = 1e-5


class MeshDistances:
    """Signed distances of pairs of bodies, given those of their hulls.

    Parameters
    ----------
    solids : sequence of Solid
        The bodies.
    names : sequence of str
        Their names in messages.
    pairs : (P, 2)
        Indices of bodies.

    Attributes
    ----------
    hulls_decide : list of bool
        Pairs whose hulls alone decide whether the bodies overlap.
    """

    def __init__(self, solids: Sequence[Solid], names: Sequence[str], pairs: Ints) -> None:
        self._solids, self._names = solids, names
        self._pairs: list[tuple[int, int]] = [(i, j) for i, j in pairs.tolist()]
        convex = [solid.is_convex for solid in solids]
        self.hulls_decide = [convex[i] and convex[j] for i, j in self._pairs]
        self._request, self._touch = coal.DistanceRequest(), coal.CollisionRequest()

    def refine(self, places: Any, pair: int, hulls: float, beyond: float = math.inf) -> float:
        """Return the signed distance of a pair [m].

        Parameters
        ----------
        places : sequence of SE3
            Where the bodies are, in world axes.
        pair : int
        hulls : float
            The distance of their hulls.
        beyond : float
            Where it is more than this, another number that is not below this may be returned,
            sooner [m].

        Raises
        ------
        CollisionError
            coal finds the surfaces nearer than the hulls.
        """
        first, second = (self._solids[i] for i in self._pairs[pair])
        if not (first.is_mesh or second.is_mesh):
            return hulls
        if self.overlaps(places, pair, hulls):
            return hulls
        if beyond <= 0.0:
            return 0.0
        surfaces = self._surfaces(places, pair, beyond)
        if hulls > 0.0:
            if not surfaces >= min(hulls, beyond) - _ROUNDING:
                raise CollisionError(
                    f"{self._label(pair)}: coal finds meshes {surfaces} m apart whose convex "
                    f"hulls are {hulls:.6g} m apart; this is an error of coal's: replace the shape "
                    f"of one of them by a simpler one"
                )
            return max(surfaces, min(hulls, beyond))
        return surfaces

    def overlaps(self, places: Any, pair: int, hulls: float) -> bool:
        """Whether the bodies of a pair overlap where they are, given their hulls' distance."""
        if hulls > 0.0 or self.hulls_decide[pair]:
            return hulls <= 0.0
        contact = coal.collide(*self._placed(places, pair), self._touch, coal.CollisionResult())
        return bool(contact) or self._is_nested(places, pair)

    def _surfaces(self, places: Any, pair: int, beyond: float) -> float:
        """Return the distance of the surfaces, or of the solid where there is no mesh."""
        result = coal.DistanceResult()
        # coal searches for distances below its initial value.
        if beyond < math.inf:
            result.min_distance = beyond
        return float(coal.distance(*self._placed(places, pair), self._request, result))

    def points(self, places: Any, pair: int) -> Array:
        """Return the two nearest points of the surfaces of a pair, in world axes, (2, 3) [m]."""
        result = coal.DistanceResult()
        coal.distance(*self._placed(places, pair), self._request, result)
        return np.array([result.getNearestPoint1(), result.getNearestPoint2()])

    def _placed(self, places: Any, pair: int) -> tuple[Any, Any, Any, Any]:
        """Return geometry and placement of both bodies, as coal takes them."""
        first, second = (
            (self._solids[i].geometry, coal.Transform3s(place.rotation, place.translation))
            for i in self._pairs[pair]
            for place in [places[i]]
        )
        return *first, *second

    def _is_nested(self, places: Any, pair: int) -> bool:
        """Whether one body is inside the other, without contact of their surfaces."""
        i, j = self._pairs[pair]
        return self._holds(places, i, j) or self._holds(places, j, i)

    def _holds(self, places: Any, outer: int, inner: int) -> bool:
        relative = places[outer].actInv(places[inner])
        points = self._solids[inner].seeds @ relative.rotation.T + relative.translation
        return self._solids[outer].contains_any(np.asarray(points))

    def _label(self, pair: int) -> str:
        i, j = self._pairs[pair]
        return f"'{self._names[i]}' and '{self._names[j]}'"


# Distances of pairs of bodies: of their hulls first, of the meshes where those do not decide.

# Joints that differ by less than this [rad or m] give the same distances, to rounding.
_ALIKE = 1e-9


class PairDistances:
    """Distances of pairs of bodies; the meshes are visited for those alone that may decide.

    Parameters
    ----------
    robot : RobotModel
    bodies : sequence of Body
    pairs : (P, 2)
        Which bodies.

    Attributes
    ----------
    hulls : HullDistances
    meshes : MeshDistances
    """

    def __init__(self, robot: RobotModel, bodies: Sequence[Body], pairs: Ints) -> None:
        self.hulls = HullDistances(robot, bodies, pairs)
        self.meshes = MeshDistances(
            [body.solid for body in bodies], [body.name for body in bodies], pairs
        )
        self._robot, self._bodies, self._pairs = robot, bodies, pairs

    def closest(self, q: Array, bounds: Array, below: float = math.inf) -> tuple[float, int]:
        """Return the smallest distance at q (n,) and its pair, with lower bounds (P,) known.

        `below` and no pair (-1) where none is smaller.
        """
        places = self.hulls.place(q)
        near = np.flatnonzero(bounds < below).tolist()
        found = sorted((self.hulls.distance(pair, bounds[pair]), pair) for pair in near)
        best = below, -1
        for hulls, pair in found:
            if hulls >= best[0]:
                break
            value = self.meshes.refine(places, pair, hulls, best[0])
            if value < best[0]:
                best = value, pair
        return best

    def points(self, q: Array, pair: int) -> Array:
        """Return the two nearest points of a pair at q (n,), in world axes, (2, 3) [m]."""
        return self.meshes.points(self.hulls.place(q), pair)

    def distances(self, q: Array, within: Array, exact_below: Array) -> Array:
        """Return the distances at samples (K, n), (K, P); see `CollisionModel.distances`."""
        values = self.hulls.lower_bounds(q, float(within.max(initial=-math.inf)))
        rows, pairs = np.nonzero(values < within)
        placed, places = -1, None
        for row, pair in zip(rows.tolist(), pairs.tolist(), strict=True):
            if row != placed:
                placed, places = row, self.hulls.place(q[row])
            hulls = self.hulls.distance(pair, values[row, pair])
            far = hulls >= exact_below[row, pair]
            values[row, pair] = hulls if far else self.meshes.refine(places, pair, hulls)
        return values

    def closer(self, q: Array, margin: float) -> Flags:
        """Return at which samples (K, n) a pair is closer than the margin, (K,)."""
        bounds = self.hulls.lower_bounds(q, margin)
        found, open_ = self.hulls.closer(q, bounds, margin, self.meshes.hulls_decide)
        undecided: dict[int, list[tuple[int, float]]] = {}
        for row, pair, hulls in open_:
            undecided.setdefault(pair, []).append((row, hulls))
        # The smallest bound usually decides, and comes first.
        for pair, near in sorted(undecided.items(), key=lambda item: min(h for _, h in item[1])):
            open_rows = [(row, hulls) for row, hulls in near if not found[row]]
            rows = np.array([row for row, _ in open_rows], dtype=np.int64)
            found[rows] = self._by_meshes(pair, q[rows], [hulls for _, hulls in open_rows], margin)
        return found

    def _by_meshes(self, pair: int, q: Array, hulls: Sequence[float], margin: float) -> Flags:
        """Return the mask of a pair whose hulls and meshes are closer than the margin, (K,).

        Configurations (K, n) with the same relative placement of the bodies are computed once:
        along a self-motion the same joints often rest.
        """
        joints = np.round(q[:, self._moving[pair]] / _ALIKE)
        _, once, which = np.unique(joints, axis=0, return_index=True, return_inverse=True)
        closer = [
            self.meshes.refine(self.hulls.place(q[row]), pair, hulls[row], margin) < margin
            for row in once.tolist()
        ]
        return np.array(closer, dtype=bool)[which.reshape(-1)]

    @cached_property
    def _moving(self) -> Flags:
        """Which joints move one body of each pair and not the other, (P, n)."""
        first, second = moved_by(self._bodies, self._robot)[self._pairs.T]
        parted = (first != second).astype(np.float64)
        return np.asarray(self._robot.coupling.bounds(parted) > 0.0)
