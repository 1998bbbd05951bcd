"""Distances of the meshes of pairs of bodies."""

import math
from collections.abc import Sequence
from typing import Any

import coal
import numpy as np

from selfmotion.basics import Array, CollisionError
from selfmotion.model.collision.distances import Ints
from selfmotion.model.collision.solids import Solid

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
