"""Distance of the arm from obstacles and from itself, at all times.

Between two times a and b the distance d of a pair of bodies changes by Σ_j l_j V_j at most, with
V_j the path length of joint j and l_j the pair's lever arm (`CollisionModel.pair_levers_up_to`). So
d(t) ≥ ½ (d(a) + d(b) - Σ_j l_j V_j) in between. Intervals on which this does not decide are
divided, starting with few: distant pairs, and pairs that hardly move, are evaluated a few times.
"""

from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Ints
from selfmotion.certificate.requirement import Extreme, Finding, FinishedMotion, Requirement
from selfmotion.model.collision import Closest, CollisionModel, Obstacle, how_near, srdf_line
from selfmotion.model.motion import Trajectory

# Intervals at the start.
_FIRST = 16
# Halvings of an interval before it counts as undecided …
_DEPTH = 40
# … of which so many are done at once at most, or one where there are more intervals than this.
_AT_ONCE, _MANY = 3, 4096
# Largest number of intervals at once: the others are undecided.
_MAX_INTERVALS = 200_000
# Intervals in one chunk, which bounds memory.
_CHUNK = 4096
# Hulls are used in place of meshes, which are slow, for pairs that more divisions decide: share
# of the distance that is left.
_HULLS_DO = 0.05
# Relative accuracy of the reported smallest distance …
_SHARE = 0.02
# … or absolute [m], whichever is larger.
_SLACK = 1e-4


@dataclass(frozen=True, eq=False)
class Separation(Requirement):
    """Bodies have a minimum distance from each other.

    Attributes
    ----------
    model : CollisionModel
        The bodies, and which pairs of them count.
    distance : float
        Smallest distance [m].
    """

    model: CollisionModel
    distance: float
    name: str = "clearance"

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return the closest pair, to a fiftieth of its distance."""
        stuck = self.model.stuck
        if stuck is not None:
            names, time = f"{stuck.first} - {stuck.second}", float(motion.trajectory.t[0])
            text = (
                f"joints that are held, or places of parts, put {names} "
                f"{-stuck.value * 1e3:.2f} mm into each other: if they are meant to be there, give "
                f"disabled= the pair, or srdf= a file with {srdf_line(stuck.first, stuck.second)}"
            )
            near = stuck.value
            return Finding(self.name, names, time, near, self.distance, False, text, unit="m")
        found = closest_at_all_times(self.model, motion.trajectory, self.distance)
        text = self._message(found)
        if found.open_until is not None:
            text = (
                f"whether {found.names} keep {self.distance * 1e3:.2f} mm from t = "
                f"{found.time:.6g} to {found.open_until:.6g} s is not decided: they come to "
                f"{found.closest.value * 1e3:.4f} mm"
            )
        selected = found.open_until is None and bool(found.closest.value >= self.distance)
        near = found.closest.value
        return Finding(
            self.name, found.names, found.time, near, self.distance, selected, text, unit="m"
        )

    @override
    def approaches(self, motion: FinishedMotion) -> dict[str, Extreme]:
        """Each to a fiftieth of its distance."""
        found = {
            name: closest_at_all_times(model, motion.trajectory, 0.0)
            for name, model in self.model.groups.items()
        }
        return {
            name: Extreme(each.closest.value, each.time, each.names) for name, each in found.items()
        }

    @property
    @override
    def covers(self) -> tuple[str, ...]:
        links = ("self-collision",) if self.model.checks_links else ()
        return (*links, "obstacles") if self.model.checks_obstacles else links

    @property
    @override
    def obstacles(self) -> tuple[Obstacle, ...]:
        return self.model.obstacles

    @property
    @override
    def remarks(self) -> tuple[str, ...]:
        """Pairs that are left out and why, and open meshes."""
        left_out = [
            f"{x.first} - {x.second} ({x.extent})"
            for x in self.model.overlapping
            if not x.is_checked
        ]
        said = []
        if left_out:
            said.append(f"links that overlap by design, not checked: {', '.join(left_out)}")
        if self.model.held:
            held = ", ".join(
                f"{x.first} - {x.second} (by {-1e3 * x.value:.1f} mm)" for x in self.model.held
            )
            said.append(
                f"links that overlap, which no joint of this motion moves against each other, not "
                f"checked: {held}"
            )
        if not self.model.pairs:
            said.append("no pair of bodies that can meet: nothing was measured")
        said += [item.hint for item in self.obstacles if item.hint]
        if self.model.disabled:
            disabled = ", ".join(" - ".join(pair) for pair in self.model.disabled)
            said.append(f"pairs not checked, as asked: {disabled}")
        if self.model.open_meshes:
            open_ = ", ".join(self.model.open_meshes)
            said.append(f"open meshes, in which a body wholly inside may be missed: {open_}")
        return tuple(said)

    def of_given_start(self, q: Array) -> str:
        """Return in words that a start (n,) that was given is too near; "" where it is not.

        Nor of links that overlap by design, or by placement: no other start helps.
        """
        start = self.model.distance(q)
        lengths = [{pair.first, pair.second} for pair in self.model.overlapping]
        is_by_design = self.model.stuck is not None or {start.first, start.second} in lengths
        if start.value >= self.distance or is_by_design:
            return ""
        pair = f"{start.first} - {start.second} {how_near(start.value)}"
        what = "too near already" if start.value > 0.0 else "in collision"
        return f"the given start is {what}: {pair}: choose another one"

    def _message(self, found: "Approach") -> str:
        text = (
            f"{found.names} {how_near(found.closest.value)} at t = {found.time:.3f} s (wanted: "
            f"{self.distance * 1e3:.2f} mm)"
        )
        for pair in self.model.overlapping:
            if {pair.first, pair.second} == {found.closest.first, found.closest.second}:
                return f"{text}; {pair.remedy}"
        return text


@dataclass(frozen=True)
class Approach:
    """Smallest distance of two bodies on a motion, at all times.

    Attributes
    ----------
    closest : Closest
        The smallest distance found.
    time : float
        Its time [s]; where something is undecided, the start of that.
    open_until : float or None
        End of the undecided interval [s]; None where all is decided.
    """

    closest: Closest
    time: float
    open_until: float | None = None

    @property
    def names(self) -> str:
        """The two bodies."""
        return f"{self.closest.first} - {self.closest.second}" if self.closest.first else "nothing"


def closest_at_all_times(
    model: CollisionModel, trajectory: Trajectory, distance: float
) -> Approach:
    """Return the closest approach of all pairs; no time is left out.

    No pair comes nearer than `distance` [m] at any time unless the one returned does, or is
    undecided; and none nearer than it by more than a fiftieth or 0.1 mm.
    """
    length_at, lever_arms = trajectory.travelled, _lever_arms(model, trajectory)
    edges = np.linspace(trajectory.t[0], trajectory.t[-1], _FIRST + 1)
    best = model.worst(trajectory(edges))
    approach = Approach(best, float(edges[best.index]))
    if not model.pairs:
        return approach
    intervals, lengths = (
        np.stack([each[:-1], each[1:]], axis=1) for each in (edges, length_at(edges))
    )
    budget = (lengths[:, 1] - lengths[:, 0]) @ lever_arms.T
    goal = _goal(best, distance)
    need = np.maximum(np.pad(budget, ((0, 1), (0, 0))), np.pad(budget, ((1, 0), (0, 0))))
    values = model.distances(trajectory(edges), goal + need, goal + _HULLS_DO * need)
    sides, pairs = np.stack([values[:-1], values[1:]], axis=1), np.arange(len(model.pairs))
    for _ in range(_DEPTH):
        # Written so that NaN settles nothing.
        chunks = _chunks(len(sides))
        each = [_bounds(lengths[chunk], sides[chunk], lever_arms) >= goal for chunk in chunks]
        decided = np.concatenate(each)
        rows, some = (np.flatnonzero(~decided.all(axis=axis)) for axis in (1, 0))
        if not rows.size or approach.closest.value < distance:
            return approach
        if len(rows) > _MAX_INTERVALS:
            break
        # Decided pairs need no number.
        pairs, lever_arms = pairs[some], lever_arms[some]
        known = decided[np.ix_(rows, some)]
        intervals, lengths, sides = intervals[rows], lengths[rows], sides[rows][:, :, some]
        np.copyto(sides, np.inf, where=known[:, None])
        left = _halvings_left(intervals, float(edges[1] - edges[0]))
        parts = 2 ** np.minimum(_halvings(lengths, sides, lever_arms, goal), left)
        if parts.max() == 1:
            break
        row, share = _inner(parts)
        inner = intervals[row, 0] + share * (intervals[row, 1] - intervals[row, 0])
        between = length_at(inner)
        lengths = _divided(lengths, between, parts)
        ways = lengths[:, 1] - lengths[:, 0]
        after = np.arange(len(row)) + row + 1
        found = np.empty((len(row), sides.shape[2]))
        for chunk in _chunks(len(row)):
            before, behind = ways[after[chunk] - 1], ways[after[chunk]]
            need = np.maximum(before @ lever_arms.T, behind @ lever_arms.T)
            exact_below = goal + _HULLS_DO * need
            settled = known[row[chunk]]
            wanted, exact = np.full((2, len(need), len(model.pairs)), -np.inf)
            wanted[:, pairs], exact[:, pairs] = np.where(settled, -np.inf, goal + need), exact_below
            values = model.distances(trajectory(inner[chunk]), wanted, exact)[:, pairs]
            found[chunk] = np.where(settled, np.inf, values)
            approach = _nearer(approach, model, pairs, inner[chunk], found[chunk], exact_below)
        intervals, sides = _divided(intervals, inner, parts), _divided(sides, found, parts)
        goal = _goal(approach.closest, distance)
    bounds = _bounds(lengths, sides, lever_arms)
    return _undecided(model, approach, pairs, intervals, sides[:, 0], bounds, distance)


def _chunks(count: int) -> list[slice]:
    """Return slices of `count` in chunks: intermediate values need more memory than results."""
    return [slice(first, first + _CHUNK) for first in range(0, count, _CHUNK)]


def _halvings(lengths: Array, sides: Array, lever_arms: Array, goal: float) -> Ints:
    """Return how often intervals (I,) are halved, at least once, so that this may decide.

    It does where bodies are in between as far apart as at both ends.
    """
    room = sides[:, 0] + sides[:, 1] - 2.0 * goal
    ways = (lengths[:, 1] - lengths[:, 0]) @ lever_arms.T
    wanted = np.max(ways / np.where(room > 0.0, room, np.inf), axis=1)
    # Written so that NaN asks for no more than one.
    few = np.log2(np.where(wanted > 2.0, wanted, 2.0))
    most = _AT_ONCE if len(sides) <= _MANY else 1
    return np.asarray(np.ceil(np.minimum(few, most)), dtype=np.int64)


def _halvings_left(intervals: Array, longest: float) -> Ints:
    """Return how often intervals (I, 2) may be halved, of which the first were `longest` [s]."""
    shares = np.maximum(intervals[:, 1] - intervals[:, 0], np.finfo(float).tiny) / longest
    return np.asarray(np.maximum(np.rint(np.log2(shares)) + _DEPTH, 0.0), dtype=np.int64)


def _inner(parts: Ints) -> tuple[Ints, Array]:
    """Return of which interval each inner edge of parts is, and how far into it, (E,)."""
    row = np.repeat(np.arange(len(parts)), parts - 1)
    first = np.cumsum(parts - 1) - (parts - 1)
    return row, (np.arange(len(row)) - first[row] + 1) / parts[row]


def _divided(sides: Array, inner: Array, parts: Ints) -> Array:
    """Return values at both ends of the parts of intervals, for theirs (I, 2, …) and inner ones."""
    last = np.cumsum(parts + 1) - 1
    every = np.empty((last[-1] + 1, *sides.shape[2:]))
    is_inner = np.ones(len(every), dtype=np.bool_)
    is_inner[last] = is_inner[last - parts] = False
    every[last - parts], every[last], every[is_inner] = sides[:, 0], sides[:, 1], inner
    left = np.delete(np.arange(len(every)), last)
    return np.stack([every[left], every[left + 1]], axis=1)


def _bounds(lengths: Array, sides: Array, lever_arms: Array) -> Array:
    """Return lower bounds (I, P) for path lengths (I, 2, n) and distances at both ends."""
    bounds: Array = sides[:, 0] + sides[:, 1]
    bounds -= (lengths[:, 1] - lengths[:, 0]) @ lever_arms.T
    bounds *= 0.5
    return bounds


def _lever_arms(model: CollisionModel, trajectory: Trajectory) -> Array:
    """Return the pairs' lever arms (P, n), also beyond the URDF's joint limits."""
    return model.pair_levers_up_to(np.abs(trajectory.extremes(0)[1]).max(axis=0))


def _goal(best: Closest, distance: float) -> float:
    """Return the distance down to which all has to be known [m]."""
    return max(distance, best.value - max(_SLACK, _SHARE * best.value))


def _nearer(
    approach: Approach,
    model: CollisionModel,
    pairs: Ints,
    t: Array,
    values: Array,
    exact_below: Array,
) -> Approach:
    """Return the smaller of an approach and distances (K, P) at times (K,), where exact."""
    known = np.where(values < exact_below, values, np.inf)
    row, pair = np.unravel_index(int(np.argmin(known)), known.shape)
    if not known[row, pair] < approach.closest.value:
        return approach
    near = Closest(float(known[row, pair]), *model.pairs[int(pairs[pair])])
    return Approach(near, float(t[row]))


def _undecided(
    model: CollisionModel,
    approach: Approach,
    pairs: Ints,
    intervals: Array,
    first: Array,
    bounds: Array,
    distance: float,
) -> Approach:
    """Return the approach that no division decides, unless it only concerns the report.

    Pairs (P) have lower bounds `bounds` (I, P) on intervals (I, 2), and distances `first` (I, P) at
    their starts.
    """
    # Written so that NaN is open.
    if np.all(bounds >= distance) or approach.closest.value < distance:
        return approach
    least = int(np.argmin(np.where(np.isnan(bounds), -np.inf, bounds)))
    row, pair = np.unravel_index(least, bounds.shape)
    near = Closest(float(first[row, pair]), *model.pairs[int(pairs[pair])])
    start, end = intervals[row]
    return Approach(near, float(start), float(end))
