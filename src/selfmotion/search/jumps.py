"""Steps between samples that no motion takes: from one branch of a self-motion to another."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.problem import Problem
from selfmotion.search.chains import unturned
from selfmotion.search.edges import near_pairs
from selfmotion.search.measures import Length, cheapest
from selfmotion.search.settings import JUMP_LOOKS, JUMP_SHARE, LEAST_JUMP
from selfmotion.search.waypoints import OnPath


class Jumps:
    """What is known of jumps along a path: chains are looked for again without them.

    Parameters
    ----------
    problem : Problem
    t : (W,)
        Times of the waypoints [s].
    steps : (W - 1, n)
        Largest change of each joint from one waypoint to the next [rad or m].
    """

    def __init__(self, problem: Problem, t: Array, steps: Array) -> None:
        self._problem, self._t, self._steps = problem, t, steps
        # The largest share of these that is no jump, as far as is known.
        self._most = 1.0
        # Waypoints at which each step is looked at, and what was found there.
        self._at: set[int] = set()
        self._known: dict[tuple[int, bytes], tuple[Ints, Ints]] = {}

    def note(self, chains: Sequence[tuple[int, Array]]) -> bool:
        """Note where chains jump: their first waypoints, and configurations (W, n); whether any."""
        jumping: list[float] = []
        others = 0.0
        for first, q in chains:
            steps = self._steps[first : first + len(q) - 1]
            share = (np.abs(np.diff(q, axis=0)) / steps).max(axis=1)
            t = self._t[first : first + len(q)]
            (jumps,) = np.nonzero(jumps_of(self._problem, t[:-1], t[1:], q[:-1], q[1:]))
            jumping += share[jumps].tolist()
            others = max(others, float(np.delete(share, jumps).max(initial=0.0)))
            self._at |= {first + k for k in jumps.tolist()}
        if jumping and max(jumping) > others:
            # The next ones would be much like these, a waypoint earlier or later.
            self._most = 0.5 * (max(others, min(jumping)) + others)
        return bool(jumping)

    def extended(
        self, k: int, length: Length, before: Array, cost: Array, after: Array, turning: Flags
    ) -> tuple[Array, Ints]:
        """Return `Length.extended` from waypoint k to the next, without steps that jump."""
        step = self._most * self._steps[k]
        if k not in self._at:
            return length.extended(k, before, cost, after, step, turning)
        first, second = self._taken(k, before, after, turning)
        moved = unturned(after[second] - before[first], turning)
        price = np.abs(moved) @ length.weights
        price[(np.abs(moved) > step).any(axis=1)] = np.inf
        return cheapest(first, second, price, cost, len(after))

    def _taken(self, k: int, before: Array, after: Array, turning: Flags) -> tuple[Ints, Ints]:
        """Return the steps from waypoint k to the next that are no jumps, (P,), (P,)."""
        key = k, turning.tobytes()
        if key not in self._known:
            step = np.ascontiguousarray(self._most * self._steps[k])
            first, second = near_pairs(before, after, step, turning)
            here = before[first]
            there = here + unturned(after[second] - here, turning)
            early, late = (np.full(len(first), time) for time in self._t[k : k + 2])
            jump = jumps_of(self._problem, early, late, here, there)
            self._known[key] = first[~jump], second[~jump]
        return self._known[key]


def jumps_of(problem: Problem, early: Array, late: Array, here: Array, there: Array) -> Flags:
    """Return which steps from q (K, n) at times (K,) to others, (K, n) at (K,), no motion takes.

    Between its ends a step is put onto the path in a few places, within limits. Where arms can go
    that way, these are about evenly apart; between two branches most of the step is left between
    two of them, or nothing arrives.
    """
    share = np.arange(1, JUMP_LOOKS) / JUMP_LOOKS
    times = (early[:, None] + (late - early)[:, None] * share).ravel()
    straight = here[:, None] + (there - here)[:, None] * share[:, None]
    where = OnPath(problem.follows, times, problem.envelope.lower, problem.envelope.upper)
    n = here.shape[1]
    found, arrived = where.project_each(straight.reshape(-1, n), np.arange(len(times)))
    between = found.reshape(len(here), len(share), n)
    whole = np.concatenate([here[:, None], between, there[:, None]], axis=1)
    parts = np.linalg.norm(np.diff(whole, axis=1), axis=2).max(axis=1)
    most = np.maximum(JUMP_SHARE * np.linalg.norm(there - here, axis=1), LEAST_JUMP)
    return np.asarray((parts > most) | ~arrived.reshape(len(here), -1).all(axis=1))
