"""Distances of convex hulls: coal's answers, each held against the bounding boxes."""

import math
import threading
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import coal
import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, CollisionError, Flags
from selfmotion.model.collision.bodies import Body
from selfmotion.model.robot import RobotModel

Ints = npt.NDArray[np.int64]

# Relative accuracy of squared distances. At coal's 1e-6 the closest points wander by some tenths of
# a millimetre between neighbouring configurations, which an optimiser takes for a slope. Below
# about 1e-11 for round bodies, its GJK (3.0.3) does not detect convergence: it takes a flat simplex
# for an overlap, and returns 0 or minus the largest float. Depths of overlap keep coal's accuracy:
# its EPA fails now and then at a smaller one.
TOLERANCE = 1e-9
# Allowance for rounding below the distances of the bounding boxes [m].
_ROUNDING = 1e-5


class BoundingBoxes:
    """A box around the convex hull of each body, along the axes of the body's own frame.

    Parameters
    ----------
    robot : RobotModel
    bodies : sequence of Body
    """

    def __init__(self, robot: RobotModel, bodies: Sequence[Body]) -> None:
        self._tree = robot.tree
        joints = np.array([body.joint for body in bodies], dtype=np.int64)
        turns = np.array([body.place.rotation for body in bodies]).reshape(-1, 3, 3)
        middles = [body.place.act(0.5 * (body.solid.low + body.solid.high)) for body in bodies]
        halves = [0.5 * (body.solid.high - body.solid.low) for body in bodies]
        self._halves = np.array(halves).reshape(-1, 3)
        self._boxes = (joints, turns, np.array(middles).reshape(-1, 3), self._halves)

    def move(self, index: int, body: Body) -> None:
        """Take the place of a body anew."""
        _, turns, middles, _ = self._boxes
        turns[index] = body.place.rotation
        middles[index] = body.place.act(0.5 * (body.solid.low + body.solid.high))

    @property
    def radii(self) -> Array:
        """Half the diagonals of the boxes, (B,) [m]."""
        return np.asarray(np.linalg.norm(self._halves, axis=1))

    def lower_bounds(self, q: Array, pairs: Ints, limit: float = math.inf) -> Array:
        """Return lower bounds of each pair's signed distance, (K, P) [m].

        Parameters
        ----------
        q : (K, n)
        pairs : (P, 2)
            Indices of bodies.
        limit : float
            Bounds at or above this need not be sharp: spheres around the boxes, or their faces, are
            enough [m].
        """
        # Here, because importing numba takes longer than everything else in the package.
        from selfmotion.model.collision import kernels

        return kernels.lower_bounds(q, *self._tree, *self._boxes, pairs, limit)


def _request() -> Any:
    """Return a distance request that is accurate, and a function of the placement alone.

    Pinocchio starts each search at the last result of the pair, by an attribute that coal
    deprecates. Starting at the middles of the bodies' boxes takes a fifth longer.
    """
    request = coal.DistanceRequest()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        request.gjk_tolerance = TOLERANCE
        request.enable_cached_gjk_guess = False
        request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
    return request


# Created on import: filters of warnings belong to the process, not to a thread.
_REQUEST = _request()


@dataclass(frozen=True, eq=False)
class Contacts:
    """Distances of pairs of bodies at samples, where they are, and how they change.

    Attributes
    ----------
    values : (M,)
        Signed distances [m].
    normals : (M, 3)
        Directions from the second body to the first; where they overlap, in which the first has
        to leave.
    points : (M, 3)
        Nearest points of the first body; those of the second are at points - value normal.
    slopes : (M, n)
        Derivatives of the distances by the joints, as if these moved the first body only. Of
        cylinders and cones, whose sides GJK comes near to only, the normal is off by about
        √`TOLERANCE` = 3e-5 rad, and the slopes by that times the lever [m/rad]; of all other bodies
        they are exact up to rounding.
    """

    values: Array
    normals: Array
    points: Array
    slopes: Array


class HullDistances:
    """Distances of the convex hulls of pairs of bodies.

    Each thread places the bodies for itself.

    Parameters
    ----------
    robot : RobotModel
    bodies : sequence of Body
    pairs : (P, 2)
        Indices of bodies.

    Attributes
    ----------
    has_moved : bool
        Whether an obstacle was put somewhere else: levers of pairs are those of where it was.
    """

    def __init__(
        self,
        robot: RobotModel,
        bodies: Sequence[Body],
        pairs: Ints,
    ) -> None:
        self.has_moved = False
        self.pairs, self._robot, self._bodies = pairs, robot, tuple(bodies)
        self._boxes = BoundingBoxes(robot, bodies)
        self._sizes = (2.0 * self._boxes.radii[pairs].sum(axis=1) + _ROUNDING).tolist()
        self._model = pin.GeometryModel()
        for i, body in enumerate(bodies):
            item = pin.GeometryObject(str(i), body.joint, 0, body.place, body.solid.hull)
            self._model.addGeometryObject(item)
        for first, second in pairs.tolist():
            self._model.addCollisionPair(pin.CollisionPair(first, second))
        self._per_thread = threading.local()

    @property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies, as `pairs` counts them."""
        return self._bodies

    def lower_bounds(self, q: Array, limit: float = math.inf) -> Array:
        """Return lower bounds of the distances at q (K, n), (K, P); see `BoundingBoxes`."""
        return self._boxes.lower_bounds(q, self.pairs, limit)

    def move(self, obstacle: str, place: pin.SE3) -> None:
        """Put an obstacle somewhere else in the frame of the joint that carries it."""
        self.has_moved = True
        for index, body in enumerate(self._bodies):
            if body.name == obstacle:
                body = replace(body, place=place)
                self._bodies = (*self._bodies[:index], body, *self._bodies[index + 1 :])
                self._model.geometryObjects[index].placement = place
                self._boxes.move(index, body)

    def place(self, q: Array) -> Any:
        """Place the hulls at q (n,), and return their placements in world axes, by body."""
        data, places = self._own()
        at = self._robot.coupling.spread(q)
        pin.updateGeometryPlacements(self._robot.model, data, self._model, places, at)
        return places.oMg

    def _own(self) -> tuple[Any, Any]:
        """Return this thread's data of the chain's placements and of the bodies'."""
        own = self._per_thread.__dict__
        if not own:
            places = self._model.createData()
            for pair in range(len(places.distanceRequests)):
                places.distanceRequests[pair] = _REQUEST
            own["kept"] = self._robot.model.createData(), places
        kept: tuple[Any, Any] = own["kept"]
        return kept

    def distance(self, pair: int, bound: float) -> float:
        """Return the signed distance of a pair as it is placed; its lower bound is known [m].

        Raises
        ------
        CollisionError
            Two different computations contradict the bound.
        """
        _, places = self._own()
        value = pin.computeDistance(self._model, places, pair).min_distance
        # Written so that NaN is computed again, too.
        if not bound - _ROUNDING <= value <= bound + self._sizes[pair]:
            value = self._again(pair, bound).min_distance
        return float(value)

    def closer(
        self,
        q: Array,
        bounds: Array,
        margin: float,
        decide: Sequence[bool],
        travelled: Array | None = None,
    ) -> tuple[Flags, list[tuple[int, int, float]]]:
        """Return at which samples a pair that decides is closer than the margin, (K,).

        Parameters
        ----------
        q : (K, n)
            The samples.
        bounds : (K, P)
            Lower bounds of all distances [m].
        margin : float
            [m].
        decide : sequence of bool
            Which pairs do.
        travelled : (K, P), optional
            How far the bodies of each pair move against each other at most from the first sample
            to each other one, one after the other: where few samples decide, others need none [m].

        Returns
        -------
        met : (K,)
        left : list of (int, int, float)
            Sample, pair and distance of others that are closer, of those computed so far.
        """
        rows, pairs = np.nonzero(bounds < margin)
        least = bounds[rows, pairs]
        # Of each sample the smallest bound first: it usually decides.
        order = np.lexsort((least, rows))
        found, left = np.zeros(len(q), dtype=bool), []
        placed = met = -1
        # How far a pair may have travelled in which it keeps the margin, by its last distance.
        until = [-math.inf] * bounds.shape[1]
        way = np.zeros(len(rows)) if travelled is None else travelled[rows, pairs]
        # Lists: with arrays for each sample Python would take longer than the distances.
        wanted = zip(*(part[order].tolist() for part in (rows, pairs, least, way)), strict=True)
        for row, pair, bound, passed in wanted:
            if row == met or passed <= until[pair]:
                continue
            if row != placed:
                self.place(q[row])
                placed = row
            value = self.distance(pair, bound)
            if travelled is not None:
                until[pair] = passed + value - margin
            if value < margin:
                if decide[pair]:
                    found[row], met = True, row
                else:
                    left.append((row, pair, value))
        return found, left

    def contacts(
        self, q: Array, rows: Ints, pairs: Ints, bounds: Array, within: float = math.inf
    ) -> "Contacts":
        """Return distances with derivatives of several pairs at several samples.

        Parameters
        ----------
        q : (K, n)
            The samples.
        rows, pairs : (M,)
            Sample and pair of each distance; rows in order.
        bounds : (M,)
            Their lower bounds [m].
        within : float
            Of bodies at least this far apart, the distance alone: their normal is 0 [m].

        Raises
        ------
        CollisionError
            See `distance`.
        """
        jacobians, coupling = np.empty((len(q), 6, self._robot.dof)), self._robot.coupling
        values, placed = np.empty(len(rows)), -1
        normals, points = np.zeros((len(rows), 3)), np.zeros((len(rows), 3))
        chain, model = self._robot.model, self._model
        data, places = self._own()
        wanted = zip(rows.tolist(), pairs.tolist(), bounds.tolist(), strict=True)
        for k, (row, pair, bound) in enumerate(wanted):
            if row != placed:
                # For a single joint Pinocchio returns a vector.
                columns = pin.computeJointJacobians(chain, data, coupling.spread(q[row]))
                jacobians[row], placed = coupling.columns_by_coordinate(columns.reshape(6, -1)), row
                pin.updateGeometryPlacements(chain, data, model, places)
            answer = pin.computeDistance(model, places, pair)
            value = answer.min_distance
            if not bound - _ROUNDING <= value <= bound + self._sizes[pair]:
                answer = self._again(pair, bound)
                value = answer.min_distance
            values[k] = value
            if value < within:
                # Copies: coal writes the next answer in the same place.
                normals[k] = answer.normal
                points[k] = answer.getNearestPoint1()
        # coal's normals point from the first body to the second.
        np.negative(normals, out=normals)
        wrenches = np.hstack([normals, np.cross(points, normals)])
        slopes = np.einsum("mi,mij->mj", wrenches, jacobians[rows])
        return Contacts(values, normals, points, slopes)

    def _again(self, pair: int, bound: float) -> Any:
        """Ask once more, with coal's own settings, where an answer contradicts the boxes."""
        first, second = self.pairs[pair].tolist()
        answer = coal.DistanceResult()
        coal.distance(
            *(part for i in (first, second) for part in self._placed(i)),
            coal.DistanceRequest(),
            answer,
        )
        if not bound - _ROUNDING <= answer.min_distance <= bound + self._sizes[pair]:
            raise CollisionError(
                f"'{self._bodies[first].name}' and '{self._bodies[second].name}': coal finds a "
                f"distance of {answer.min_distance} m, but boxes around them are {bound:.6g} m "
                f"apart; this is an error of coal's: replace the shape of one of them by a "
                f"simpler one"
            )
        return answer

    def _placed(self, body: int) -> tuple[Any, Any]:
        _, places = self._own()
        place = places.oMg[body]
        hull = self._bodies[body].solid.hull
        return hull, coal.Transform3s(place.rotation, place.translation)
