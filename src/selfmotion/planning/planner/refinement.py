"""How fine the nodes of an optimum have to be."""

from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.planning.nodes import NodeMotion
from selfmotion.planning.planner.grids import NOTHING, most_nodes, with_starts
from selfmotion.planning.planner.local_search import LocalSearch
from selfmotion.planning.planner.outcomes import NodeOutcome, is_kept

# Largest path error between nodes [m, rad] …
_NEAR_PATH = 2e-7
# … intervals above which are divided for this one …
_WANTED_NEAR_PATH = 1e-7
# … by this power of the ratio, since the error falls with the third power or more …
_FINER_POWER = 0.3
# … into this number of parts at most.
_MOST_PARTS = 8.0
# Refinement rounds.
_NODE_ROUNDS = 14
# Extra clearance [m] at collocation points when the motion between them collides; tried in turn.
_EXTRA_CLEARANCE = (5e-4, 1e-3, 2e-3)
# Relative gain above which nodes are added where limits of q̈ or jerk start or end to bind.
_PAYS = 3e-4


def settled(search: LocalSearch, known: NodeOutcome) -> NodeOutcome:
    """Return the optimum on nodes so near to each other that more change nothing.

    The curve is on its path between them, control points give hardly anything away, and what
    holds at points holds between them.
    """
    found = _resolved(search, known)
    return _farther_apart(search, found) or found


def _resolved(search: LocalSearch, known: NodeOutcome) -> NodeOutcome:
    """Return the optimum on nodes so near to each other that more change nothing, if it may."""
    before, most, is_rough = np.inf, most_nodes(search.formulation), True
    for _ in range(_NODE_ROUNDS):
        if search.recorder.ended is not None:
            break
        t = _finer(search, known)
        if before - known.cost > _PAYS * abs(known.cost):
            # Where limits of q̈ or jerk begin and end to bind, the best motion has a kink: finer
            # there, while it pays.
            kinks, before = _at_kinks(known.motion), known.cost
            if kinks is not None:
                t = kinks if t is None else np.union1d(t, kinks)
        finer = None if t is None or len(t) > most else known.on(t)
        polishes = finer is None
        if polishes and not is_rough:
            break
        found = search.again(finer or known, roughly=not polishes)
        if found is None:
            break
        gains = known.cost - found.cost > NOTHING * abs(known.cost)
        if not (found.has_arrived or gains) and search.recorder.ended is None:
            # More nodes lead nowhere, and multipliers on the way say nothing.
            again = None if polishes else search.again(known)
            if again is not None and again.has_arrived:
                return again
            # Between few nodes it may be off the path: there, what is on the way will do.
            errors = search.formulation.errors_between(known.motion.trajectory)
            off = not polishes and again is None and errors.max() > _NEAR_PATH
            return found if off else known
        gained = max(known.cost - found.cost, 0.0)
        remaining = (found.remaining or 0.0) + gained
        known, is_rough = replace(found, remaining=remaining), not polishes
    return known


def _farther_apart(search: LocalSearch, known: NodeOutcome) -> NodeOutcome | None:
    """Return a motion on its nodes that keeps between them what it breaks there; or None.

    Beside corners of bodies more nodes may lead nowhere: on these, bodies are kept farther
    apart at the points.
    """
    grid = known.motion.grid
    own = grid.conditions
    has_bodies = any(item.stricter(0.0) is not None for item in own.points)
    if search.recorder.ended is not None or not (
        has_bodies and known.motion.broken_intervals().any()
    ):
        return None
    for far in _EXTRA_CLEARANCE:
        points = tuple(item.stricter(far) or item for item in own.points)
        stricter = grid.with_conditions(own._replace(points=points))
        optimum = search.minimise(stricter.at(known.motion.centred))
        found = replace(optimum, motion=grid.at(optimum.motion.centred))
        if is_kept(found.motion) and not found.motion.broken_intervals().any():
            return search.outcome(found)
    return None


def _finer(search: LocalSearch, known: NodeOutcome) -> Array | None:
    """Return times of nodes near enough to each other, or None where these are."""
    motion = known.motion
    grid, spline = motion.grid, motion.grid.spline
    errors = search.formulation.errors_between(motion.trajectory).max(axis=1)
    # Where one is too far apart, so is what is nearly so: on the next nodes it would be.
    wanted = _WANTED_NEAR_PATH if errors.max() > _NEAR_PATH else _NEAR_PATH
    parts = np.ceil((errors / wanted) ** _FINER_POWER - 1e-9)
    parts = np.clip(parts, 1.0, _MOST_PARTS).astype(int)
    away = grid.rows.conservatism(known.multipliers, motion.curve_ends)
    least = NOTHING * abs(motion.objective)
    if away.sum() > least:
        parts[(away > least / spline.count) & (parts == 1)] = 2
    parts = np.maximum(parts, motion.subdivisions())
    t = spline.t if (parts == 1).all() else _divided(spline.t, parts)
    if motion.quickness < grid.quick:
        t = with_starts(search.formulation, t, motion.quickness)
    return t if len(t) > len(spline.t) else None


def _divided(t: Array, parts: Ints) -> Array:
    """Return times (N + 1,) with each interval in a number of equal parts, (N,)."""
    first = np.repeat(np.cumsum(parts) - parts, parts)
    share = (np.arange(parts.sum()) - first) / np.repeat(parts, parts)
    inner = np.repeat(t[:-1], parts) + share * np.repeat(np.diff(t), parts)
    return np.append(inner, t[-1])


def _at_kinks(motion: NodeMotion) -> Array | None:
    """Return times with more nodes where limits of q̈ or jerk begin or end to bind, or None."""
    where = motion.grid.rows.kinks(motion.curve_ends)
    if not where.any():
        return None
    wide = np.convolve(where, np.ones(3), "same") > 0.0
    return _divided(motion.grid.t, 1 + wide)
