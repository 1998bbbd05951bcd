"""Results of a placement: the best place, and a map of costs around it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array, PlanError, as_whole
from selfmotion.model.task import SE3
from selfmotion.planning.result import Plan
from selfmotion.problem.problem import Problem
from selfmotion.work.placement.picture import picture_of
from selfmotion.work.placement.places import Places, Tried, footprint
from selfmotion.work.placement.search import Box

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A coordinate nearer to its bound than this share of the box is on it.
_ON_BOUND = 1e-6
# Distance to either side at which costs are compared, to see whether a coordinate matters [share of
# the box].
_ASIDE = 0.1
# Distance of places to choose from, in some coordinate [share of the box].
_APART = 0.1
# Relative difference of costs below which a coordinate does not matter.
_SAME = 1e-5


@dataclass(frozen=True, eq=False)
class PlaceMap:
    """A map of the costs of places around the best one, over two coordinates.

    Attributes
    ----------
    names : (str, str)
        The coordinates, the first to the right, the second up; the others are as they are at best.
    across, up : (C,), (U,)
        Their values [m or rad].
    costs : (U, C)
        Of all plans together; NaN where a place fails.
    reasons : tuple of tuple of str
        Why it does; "" where it does not.
    best : (B, 2)
        The places to choose from, the cheapest first [m or rad].
    outline : (P, 2)
        What of the part is seen from above, about the best place; empty where the map is not of a
        part in x and y [m].
    """

    names: tuple[str, str]
    across: Array
    up: Array
    costs: Array
    reasons: tuple[tuple[str, ...], ...]
    best: Array
    outline: Array

    def svg(self) -> str:
        """Return an SVG: a cell for each place with its cost, or why it fails as its tooltip."""
        return picture_of(self)

    def figure(self) -> Figure:
        """Return a matplotlib figure (``pip install 'selfmotion[plots]'``).

        Raises
        ------
        PlanError
            matplotlib is not installed.
        """
        try:
            from matplotlib.figure import Figure
        except ImportError as error:
            raise PlanError(
                "a figure of a map needs matplotlib: pip install 'selfmotion[plots]'"
            ) from error
        figure = Figure(figsize=(5.0, 4.2), layout="constrained")
        axes = figure.subplots()
        shown = axes.pcolormesh(self.across, self.up, self.costs, shading="nearest")
        figure.colorbar(shown, label="cost")
        if np.isfinite(self.costs).any():
            i, j = np.unravel_index(int(np.nanargmin(self.costs)), self.costs.shape)
            axes.plot(self.across[j], self.up[i], "r+", markersize=12)
        axes.set(xlabel=_label(self.names[0]), ylabel=_label(self.names[1]))
        return figure


@dataclass(frozen=True, eq=False)
class Placement:
    """The best place that was found for a part, or an arm.

    Attributes
    ----------
    of : str
        ``"part"`` or ``"base"``.
    place : dict
        Coordinate → how far it is moved [m or rad].
    displacement : SE3
        The same as a rigid motion in world axes: of all points of the part, or of the base.
    problems : tuple of Problem
        There: paths and the part's obstacles moved, or the arm.
    plans : tuple of Plan
        Of these, each verified.
    cost : float
        Of all together.
    cost_before : float
        Where it stands now; inf where a motion there is not verified, NaN where that is not in the
        box.
    on_bounds : tuple of str
        The coordinates that are at an end of the box: a larger one would gain.
    tried : tuple of Tried
        All places that were looked at.
    flat : tuple of str
        The coordinates in which nothing changes: to either side of the place the motions cost the
        same.
    """

    of: str
    place: Mapping[str, float]
    displacement: SE3
    problems: tuple[Problem, ...]
    plans: tuple[Plan, ...]
    cost: float
    cost_before: float
    on_bounds: tuple[str, ...]
    tried: tuple[Tried, ...]
    _places: Places = field(repr=False)
    _box: Box = field(repr=False)
    _best: Tried = field(repr=False)
    flat: tuple[str, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether all plans are."""
        return all(plan.certificate.verified for plan in self.plans)

    @property
    def binds(self) -> tuple[str, ...]:
        """What stops the cost from falling further: ends of the box, and active constraints."""
        active = [
            f"{item.constraint}: {item.easing} would save about {item.saving:.3g}"
            for plan in self.plans
            for item in plan.report.active
        ]
        return (*(f"the box in {name}" for name in self.on_bounds), *dict.fromkeys(active))

    def __str__(self) -> str:
        """Return the place, what it gains, and what binds."""
        moved = ", ".join(f"{_label(name)} {value:+.4g}" for name, value in self.place.items())
        turned = [name for name in self.place if name not in ("x", "y", "z")]
        if turned:
            degrees = ", ".join(f"{math.degrees(self.place[name]):+.4g}°" for name in turned)
            about = ", ".join(f"{value:.4g}" for value in self._places.center.tolist())
            moved += f" ({degrees}), turned about ({about}) of the world"
        before = "no verified motion at the present place"
        if math.isnan(self.cost_before):
            before = "the present place is not in the box"
        elif math.isfinite(self.cost_before):
            gain = 1.0 - self.cost / self.cost_before if self.cost_before else 0.0
            before = f"{self.cost_before:.6g} at the present place, {gain:.1%} less"
        failed = sum(not np.isfinite(item.cost) for item in self.tried)
        lines = [
            f"move the {self.of} by {moved}",
            f"cost {self.cost:.6g} ({before}); {len(self.plans)} "
            f"motion{'s' if len(self.plans) > 1 else ''}, {'all' if self.verified else 'not'} "
            f"verified",
            f"{len(self.tried)} places tried, {failed} of them without a verified motion in the "
            f"short time that each has",
            *(f"binds: {text}" for text in self.binds),
            *(f"nothing changes along {name}: any value costs the same" for name in self.flat),
        ]
        return "\n".join(lines)

    __repr__ = __str__

    def best(self, count: int = 3) -> tuple[Tried, ...]:
        """Return the cheapest of the places that were tried, no two of them near each other.

        `place` first. They are apart by a tenth of the box in some coordinate.
        """
        found = list[Tried]()
        for item in (self._best, *sorted(self.tried, key=lambda item: item.cost)):
            share = self._box.share(item.place)
            far = [np.abs(share - self._box.share(other.place)).max() for other in found]
            if np.isfinite(item.cost) and min(far, default=np.inf) >= _APART:
                found.append(item)
            if len(found) == as_whole(count, "count", 1, 100, PlanError):
                break
        return tuple(found)

    def map(self, names: Sequence[str] | None = None, points: int = 9) -> PlaceMap:
        """Return a map of the costs of places around this one, in two coordinates of the box.

        Each is planned from the nearest place that is, and from nothing; where both lead nowhere,
        with all that a plan does, for 10 s of the processor: only what fails then as well is told
        as having no plan.

        Parameters
        ----------
        names : (str, str), optional
            Of the coordinates that vary; by default the first two.
        points : int
            Of each.

        Raises
        ------
        PlanError
            Only one coordinate varies, or a name is none of them.
        """
        every = self._places.names
        chosen = tuple(every[:2] if names is None else names)
        if len(chosen) != 2 or not set(chosen) <= set(every) or len(set(chosen)) < 2:
            raise PlanError(f"a map is over two of {', '.join(every)}, not over {chosen!r}")
        count = as_whole(points, "points", 2, 200, PlanError)
        first, second = (every.index(name) for name in chosen)
        low, high, best = self._box.low, self._box.high, self._best
        across, up = (np.linspace(low[k], high[k], count) for k in (first, second))
        cells = [(i, j) for i in range(count) for j in range(count)]
        at = {cell: best.place.copy() for cell in cells}
        for (i, j), place in at.items():
            place[first], place[second] = across[j], up[i]
        known, found = [best], {}
        # From the best outwards, each from the nearest motions that are known.
        for cell in sorted(cells, key=lambda cell: self._far(at[cell], best)):
            place = at[cell]
            far = [self._far(place, other) for other in known]
            near = known[int(np.argmin(far))].plans
            # Motions near by are proposals: others may cost less there.
            either = self._places.tried(place, near), self._places.tried(place)
            found[cell] = min(either, key=lambda item: item.cost)
            if not np.isfinite(found[cell].cost):
                found[cell] = self._places.surely(place)
            if np.isfinite(found[cell].cost):
                known.append(found[cell])
        costs = np.array([[found[i, j].cost for j in range(count)] for i in range(count)])
        return PlaceMap(
            (chosen[0], chosen[1]),
            across,
            up,
            np.where(np.isfinite(costs), costs, np.nan),
            tuple(tuple(found[i, j].reason for j in range(count)) for i in range(count)),
            np.array([item.place[[first, second]] for item in self.best()]),
            self._outline(chosen),
        )

    def _outline(self, names: Sequence[str]) -> Array:
        """Return the hull of the part from above, (P, 2), its middle at the place [m]."""
        if self.of != "part" or tuple(names) != ("x", "y"):
            return np.empty((0, 2))
        points = footprint(self.problems, self._places.bodies)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        return np.asarray(points - middle + [self.place["x"], self.place["y"]])

    def _far(self, place: Array, other: Tried) -> float:
        return float(np.linalg.norm(self._box.share(place) - self._box.share(other.place)))


def flat_along(places: Places, box: Box, best: Tried) -> tuple[str, ...]:
    """Return the coordinates in which the cost is the same to either side of a place."""
    share, found = box.share(best.place), list[str]()
    for k, name in enumerate(places.names):
        costs = list[float]()
        for aside in (-_ASIDE, _ASIDE):
            there = share.copy()
            # At an end of the box both looks are to one side.
            there[k] += aside if 0.0 <= share[k] + aside <= 1.0 else -0.5 * aside
            costs.append(places.tried(box.at(there), best.plans).cost)
        if all(abs(cost - best.cost) <= _SAME * abs(best.cost) for cost in costs):
            found.append(name)
    return tuple(found)


def on_bounds(places: Places, box: Box, place: Array) -> tuple[str, ...]:
    """Return the coordinates of a place that are at an end of the box."""
    share = box.share(place)
    ends = (share <= _ON_BOUND) | (share >= 1.0 - _ON_BOUND)
    return tuple(name for name, at_end in zip(places.names, ends.tolist(), strict=True) if at_end)


def _label(name: str) -> str:
    return f"{name} [{'m' if name in ('x', 'y', 'z') else 'rad'}]"
