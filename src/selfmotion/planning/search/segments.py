"""The fewest chains of vertices that together follow a path which no single one follows."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Flags, Ints, NoSequenceError, Progress, silent
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search.chains import best_chains, connected
from selfmotion.planning.search.guides import layers_of
from selfmotion.planning.search.layer_steps import cheapest, near_pairs, unturned
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.measures import JointTravel
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.sequences import Layers
from selfmotion.problem.problem import prescribed_end

# Cost of a change to another configuration: above that of any motion in between.
_BREAK = 1e6
# Points at which a step is projected onto the path, plus one.
_STEP_POINTS = 8
# Largest share of a step between two of these for which an arm can follow …
_JUMP_SHARE = 0.4
# … or the largest distance [rad or m].
_MIN_JUMP = 0.05
# Searches for chains, each without the jumps of the one before.
_JUMP_ROUNDS = 12


class _Jumps:
    """Known jumps along a path: chains are searched again without them.

    Parameters
    ----------
    formulation : Formulation
    t : (W,)
        Times of the waypoints [s].
    steps : (W - 1, n)
        Largest change of each joint from one waypoint to the next [rad or m].
    """

    def __init__(self, formulation: Formulation, t: Array, steps: Array) -> None:
        self._formulation, self._t, self._steps = formulation, t, steps
        # The largest share of these that is no jump, as far as is known.
        self._most = 1.0
        # Waypoints at which steps were checked, and the results.
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
            (jumps,) = np.nonzero(jumps_of(self._formulation, t[:-1], t[1:], q[:-1], q[1:]))
            jumping += share[jumps].tolist()
            others = max(others, float(np.delete(share, jumps).max(initial=0.0)))
            self._at |= {first + k for k in jumps.tolist()}
        if jumping and max(jumping) > others:
            # The next ones would be much like these, a waypoint earlier or later.
            self._most = 0.5 * (max(others, min(jumping)) + others)
        return bool(jumping)

    def relaxed_layer(
        self, k: int, length: JointTravel, before: Array, cost: Array, after: Array, turning: Flags
    ) -> tuple[Array, Ints]:
        """See `JointTravel.relaxed_layer`; without steps that jump."""
        step = self._most * self._steps[k]
        if k not in self._at:
            return length.relaxed_layer(k, before, cost, after, step, turning)
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
            jump = jumps_of(self._formulation, early, late, here, there)
            self._known[key] = first[~jump], second[~jump]
        return self._known[key]


def jumps_of(
    formulation: Formulation, early: Array, late: Array, here: Array, there: Array
) -> Flags:
    """Return the mask of steps from q (K, n) at times (K,) to others that no motion follows.

    A step is projected onto the path at a few points between its ends, within limits. Where arms
    can follow, these are about evenly spaced; between two branches most of the step is between two
    of them, or the projection fails.
    """
    share = np.arange(1, _STEP_POINTS) / _STEP_POINTS
    times = (early[:, None] + (late - early)[:, None] * share).ravel()
    straight = here[:, None] + (there - here)[:, None] * share[:, None]
    where = OnPath(
        formulation.follows, times, formulation.envelope.lower, formulation.envelope.upper
    )
    n = here.shape[1]
    found, arrived = where.project_each(straight.reshape(-1, n), np.arange(len(times)))
    between = found.reshape(len(here), len(share), n)
    whole = np.concatenate([here[:, None], between, there[:, None]], axis=1)
    parts = np.linalg.norm(np.diff(whole, axis=1), axis=2).max(axis=1)
    most = np.maximum(_JUMP_SHARE * np.linalg.norm(there - here, axis=1), _MIN_JUMP)
    # Correct also for no steps at all.
    return np.asarray((parts > most) | ~arrived.reshape(len(here), len(share)).all(axis=1))


@dataclass(frozen=True, eq=False)
class ChainSegment:
    """A chain of configurations along a segment of a path.

    Attributes
    ----------
    first, last : int
        Its waypoints.
    t : (W,)
        Times of the waypoints [s].
    q : (W, n)
        Configurations [rad or m].
    ending : str
        The cause why no chain from its first waypoint is complete; "" for the last one.
    """

    first: int
    last: int
    t: Array
    q: Array
    ending: str


@dataclass(frozen=True, eq=False)
class ChainSegments:
    """Vertices along a path, and the fewest chains over them; made by `ChainSegments.of`."""

    formulation: Formulation
    _layers: Layers
    _jumps: _Jumps

    @property
    def t(self) -> Array:
        """Times of the waypoints [s], (W,)."""
        return self._layers.t

    @classmethod
    def of(
        cls,
        formulation: Formulation,
        rng: np.random.Generator | int = 0,
        progress: Progress = silent,
    ) -> "ChainSegments":
        """Return the vertices of a problem: samples of all self-motions, free and within limits.

        Raises
        ------
        NoSequenceError
            A pose of the path has no vertex at all; with the time and cause.
        """
        layers = layers_of(formulation, formulation.coordinates.weights, rng, progress)
        found = cls(formulation, layers, _Jumps(formulation, layers.t, layers.steps))
        found._pin_ends()
        found._check()
        return found

    def fewest(self, forbidden: set[int]) -> list[ChainSegment]:
        """Return the fewest chains that follow the path one after the other, the shortest such.

        Each starts at the pose at which the one before ends, in another configuration; the motions
        between these count as well. None has a known jump.

        Parameters
        ----------
        forbidden : set of int
            Waypoints at which no chain may end before the last one.

        Raises
        ------
        NoSequenceError
            No number of chains follows the path; with the time and cause.
        """
        for _ in range(_JUMP_ROUNDS):
            found = self._found(forbidden)
            if not self._jumps.note([(item.first, item.q) for item in found]):
                break
        return found

    def _found(self, forbidden: set[int]) -> list[ChainSegment]:
        """Return the fewest chains without the jumps that are known; see `fewest`."""
        bounds = self._layers.bounds
        # Joints with room for several turns turn without end at first: see `best_sequences`.
        any_turn = bounds.with_unbounded_turns()
        while True:
            layers = [any_turn.layer(q) for q in self._layers.samples]
            turning = any_turn.is_unbounded
            chains = self._chains(layers, any_turn, forbidden)
            motions = [
                bounds.centred(connected(layers[first : first + len(chain)], chain, turning))
                for first, chain in chains
            ]
            beyond = np.any([bounds.exceeded(q) for q in motions], axis=0)
            if not np.any(beyond):
                break
            any_turn = any_turn.with_limits_of(bounds, beyond)
        return [
            ChainSegment(
                first,
                first + len(q) - 1,
                self.t[first : first + len(q)],
                q,
                self._ending(first, layers, any_turn) if q is not motions[-1] else "",
            )
            for (first, _), q in zip(chains, motions, strict=True)
        ]

    def _pin_ends(self) -> None:
        """Let nothing but a given start, and a given end, be a vertex there."""
        start, samples = self.formulation.given_start, self._layers.samples
        if start is not None:
            samples[0] = start[None]
        problem = self.formulation.problem
        end = prescribed_end(problem.robot, problem.constraints)
        if end is not None:
            samples[-1] = end[None]
            self._keep_given(-1, "end configuration asked for")
        if start is not None:
            self._keep_given(0, "given start")

    def _keep_given(self, i: int, name: str) -> None:
        q = self._layers.samples[i]
        if np.any(self._layers.bounds.exceeded(q)):
            k = int(np.argmax(self._layers.bounds.exceeded(q)))
            joint = self.formulation.robot.joint_names[k]
            raise self._refused(
                i, f"the {name} has joint '{joint}' at {q[0, k]:.4g}, outside its limits"
            )
        if not self._layers.bounds.is_admissible(q)[0]:
            raise self._refused(i, f"the {name} is in collision, or nearer than asked for")

    def _check(self) -> None:
        for i, samples in enumerate(self._layers.samples):
            if len(samples) == 0:
                raise self._refused(
                    i,
                    self._layers.why(
                        i, samples, samples, self._layers.bounds.with_unbounded_turns()
                    ),
                )

    def _chains(
        self, layers: list[Array], bounds: SearchBounds, forbidden: set[int]
    ) -> list[tuple[int, list[int]]]:
        """Return the first waypoint of each chain, and its vertices, first to last."""
        length, turning = JointTravel(self.formulation.coordinates.weights), bounds.is_unbounded
        anywhere = np.full(len(turning), np.inf)
        cost = np.zeros(len(layers[0]))
        parents: list[Ints] = [np.arange(len(cost))]
        # From which vertex of its own waypoint a vertex is changed to; itself where it is not.
        changes: list[Ints] = [np.arange(len(cost))]
        for i, (before, after) in enumerate(itertools.pairwise(layers), 1):
            cost, parent = self._jumps.relaxed_layer(i - 1, length, before, cost, after, turning)
            if not np.any(np.isfinite(cost)):
                raise self._refused(i, self._layers.why(i, before, after, bounds))
            parents.append(parent)
            change = np.arange(len(cost))
            if i < len(layers) - 1 and i not in forbidden:
                changed, source = length.relaxed_layer(i, after, cost, after, anywhere, turning)
                better = changed + _BREAK < cost
                change = np.where(better, source, change)
                cost = np.where(better, changed + _BREAK, cost)
            changes.append(change)
        return _traced_back(parents, changes, int(np.argmin(cost)))

    def _ending(self, first: int, layers: list[Array], any_turn: SearchBounds) -> str:
        """Return why no chain from a waypoint on follows the rest of the path."""
        chains = best_chains(layers[first:], self._layers.steps[first:], any_turn.is_unbounded)
        if chains.blocked is None:
            return "what goes on from there among the samples did not keep all constraints"
        i = first + chains.blocked
        alive = layers[i - 1][np.isfinite(chains.cost[chains.blocked - 1])]
        reason = self._layers.why(i, alive, layers[i], any_turn)
        return f"no motion from t = {self.t[first]:.6g} s passes t = {self.t[i]:.6g} s: {reason}"

    def _refused(self, i: int, reason: str) -> NoSequenceError:
        return self._layers.refused(i, reason, ", in however many parts,")


def _traced_back(
    parents: list[Ints], changes: list[Ints], vertex: int
) -> list[tuple[int, list[int]]]:
    """Return the chains that end in a vertex of the last waypoint; see `ChainSegments`."""
    chains: list[tuple[int, list[int]]] = []
    chain: list[int] = []
    for i in range(len(parents) - 1, 0, -1):
        chain.append(vertex)
        source = int(changes[i][vertex])
        if source != vertex:
            chains.append((i, chain[::-1]))
            vertex, chain = source, [source]
        vertex = int(parents[i][vertex])
    chains.append((0, [*chain, vertex][::-1]))
    return chains[::-1]


def turned_towards(q: Array, before: Array, turning: Flags) -> Array:
    """Return a motion (W, n), joints that turn without end by the turns that lead it nearest."""
    step = q[0] - before
    return np.asarray(q + (unturned(step, turning) - step))
