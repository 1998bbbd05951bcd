"""Finer grids: the one loop of refinement, and its judge by what nodes know."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.planning.formulation import path_errors
from selfmotion.planning.nodes import (
    NodeMotion,
    broken_intervals,
    centred,
    conservatism,
    kinks,
    quickness_of,
    subdivisions,
)
from selfmotion.planning.planner.grids import NOTHING, most_nodes, with_starts
from selfmotion.planning.planner.local_search import LocalSearch
from selfmotion.planning.planner.outcomes import NodeOutcome, is_kept

# Largest path error between nodes [m, rad] …
_NEAR_PATH = 2e-7
# … intervals above which are divided for this one …
_WANTED_NEAR_PATH = 3e-8
# … by this power of the ratio, since the error falls with the fourth power or more …
_FINER_POWER = 0.25
# … into this number of parts at most.
_MAX_PARTS = 8.0
# Refinement rounds.
_NODE_ROUNDS = 14
# Extra clearance [m] at collocation points when the motion between them collides; tried in turn.
_EXTRA_CLEARANCE = (5e-4, 1e-3, 2e-3)
# Relative gain above which nodes are added where limits of q̈ or jerk start or end to bind.
_PAYS = 3e-4


_Found = TypeVar("_Found")


def refined(found: _Found, divide: Callable[[_Found], _Found | None]) -> _Found:
    """Return what is found on grids so fine that a judge has nothing to divide.

    The one loop of refinement: a judge returns what it is given on a finer grid, divided where it
    is worst and solved there, or None where finer grids change nothing. `DividesAtNodes` judges by
    what the nodes know; `judging` by the path between them, and by the certificate.
    """
    while (finer := divide(found)) is not None:
        found = finer
    return found


def settled(search: LocalSearch, known: NodeOutcome) -> NodeOutcome:
    """Return the optimum on nodes so near to each other that more change nothing.

    The curve is on its path between them, control points give hardly anything away, and what
    holds at points holds between them.
    """
    found = refined(known, DividesAtNodes(search))
    return _farther_apart(search, found) or found


class DividesAtNodes:
    """Judges optima by what their nodes know, and optimises them on more where that pays.

    Parameters
    ----------
    search : LocalSearch
    """

    def __init__(self, search: LocalSearch) -> None:
        self._search, self._most = search, most_nodes(search.formulation)
        self._cost, self._has_polished, self._rounds = np.inf, False, _NODE_ROUNDS

    def __call__(self, known: NodeOutcome) -> NodeOutcome | None:
        """Return the optimum on more nodes, or the last one; None where it may not, or need not."""
        search = self._search
        if self._rounds == 0 or search.recorder.ended is not None:
            return None
        self._rounds -= 1
        t = self._wanted(known)
        finer = None if t is None or len(t) > self._most else known.on(t)
        polishes = finer is None
        is_fine = known.optimum is not None and not known.optimum.is_rough
        # Once more on the same nodes gains nothing where that ended by rounding.
        if polishes and (is_fine or self._has_polished):
            return None
        found = search.again(finer or known, roughly=not polishes)
        if found is None:
            return None
        gains = known.cost - found.cost > NOTHING * abs(known.cost)
        if not (found.has_arrived or gains) and search.recorder.ended is None:
            self._rounds = 0
            return self._without_more(known, found, polishes)
        gained = max(known.cost - found.cost, 0.0)
        self._has_polished = polishes
        return replace(found, remaining=(found.remaining or 0.0) + gained)

    def _wanted(self, known: NodeOutcome) -> Array | None:
        """Return times of nodes near enough to each other, or None where these are."""
        t = _finer(self._search, known)
        if self._cost - known.cost > _PAYS * abs(known.cost):
            # Where limits of q̈ or jerk begin and end to bind, the best motion has a kink: finer
            # there, while it pays.
            kinks, self._cost = _at_kinks(known.motion), known.cost
            if kinks is not None:
                return kinks if t is None else np.union1d(t, kinks)
        return t

    def _without_more(self, known: NodeOutcome, found: NodeOutcome, polishes: bool) -> NodeOutcome:
        """Return the last optimum where more nodes lead nowhere.

        Multipliers on the way say nothing. Where the optimum breaks something between its nodes,
        and what is on the way keeps it, that will do.
        """
        breaks = broken_intervals(known.motion).any()
        if not polishes and breaks and _keeps_between(found.motion):
            return found
        again = None if polishes else self._search.again(known)
        if again is not None and again.has_arrived:
            return again
        # Between few nodes it may be off the path: there, what is on the way will do.
        errors = path_errors(self._search.formulation, known.motion.trajectory)
        off = not polishes and again is None and errors.max() > _NEAR_PATH
        return found if off else known


def _keeps_between(motion: NodeMotion) -> bool:
    """Whether a motion keeps everything, between its nodes as well."""
    return is_kept(motion) and not broken_intervals(motion).any()


def _farther_apart(search: LocalSearch, known: NodeOutcome) -> NodeOutcome | None:
    """Return a motion on its nodes that keeps between them what it breaks there; or None.

    Beside corners of bodies more nodes may lead nowhere: on these, bodies are kept farther
    apart at the points.
    """
    grid = known.motion.grid
    own = grid.conditions
    has_bodies = any(item.stricter(0.0) is not None for item in own.points)
    if search.recorder.ended is not None or not (
        has_bodies and broken_intervals(known.motion).any()
    ):
        return None
    for far in _EXTRA_CLEARANCE:
        points = tuple(item.stricter(far) or item for item in own.points)
        stricter = grid.with_conditions(own._replace(points=points))
        optimum = search.minimise(stricter.at(centred(known.motion)))
        found = replace(optimum, motion=grid.at(centred(optimum.motion)))
        if _keeps_between(found.motion):
            return search.outcome(found)
    return None


def _finer(search: LocalSearch, known: NodeOutcome) -> Array | None:
    """Return times of nodes near enough to each other, or None where these are."""
    motion = known.motion
    grid, spline = motion.grid, motion.grid.spline
    errors = path_errors(search.formulation, motion.trajectory).max(axis=1)
    # Where one is too far apart, so is what is nearly so: on the next nodes it would be.
    wanted = _WANTED_NEAR_PATH if errors.max() > _NEAR_PATH else _NEAR_PATH
    parts = np.ceil((errors / wanted) ** _FINER_POWER - 1e-9)
    parts = np.clip(parts, 1.0, _MAX_PARTS).astype(int)
    away = conservatism(grid.rows, known.multipliers, motion.curve_ends)
    least = NOTHING * abs(motion.objective)
    if away.sum() > least:
        parts[(away > least / spline.count) & (parts == 1)] = 2
    parts = np.maximum(parts, subdivisions(motion))
    t = spline.t if (parts == 1).all() else _divided(spline.t, parts)
    if quickness_of(motion) < grid.quick:
        t = with_starts(search.formulation, t, quickness_of(motion))
    return t if len(t) > len(spline.t) else None


def _divided(t: Array, parts: Ints) -> Array:
    """Return times (N + 1,) with each interval in a number of equal parts, (N,)."""
    first = np.repeat(np.cumsum(parts) - parts, parts)
    share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
    inner = np.repeat(t[:-1], parts) + share * np.repeat(np.diff(t), parts)
    return np.append(inner, t[-1])


def _at_kinks(motion: NodeMotion) -> Array | None:
    """Return times with more nodes where limits of q̈ or jerk begin or end to bind, or None."""
    where = kinks(motion.grid.rows, motion.curve_ends)
    if not where.any():
        return None
    wide = np.convolve(where, np.ones(3), "same") > 0.0
    return _divided(motion.grid.t, 1 + wide)
