"""The global search: curves at all waypoints, nodes on them, the shortest chains of nodes."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    Flags,
    NoSequenceError,
    ProblemError,
    Progress,
    read_only,
    silent,
)
from selfmotion.collision import CollisionModel
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel
from selfmotion.search.chains import best_chains, diverse_chains, unlike, unturned, why_blocked
from selfmotion.search.curves import SPACING, CurveSet, SelfMotion, curves_along
from selfmotion.search.measures import Length, Measure
from selfmotion.search.nodes import Admissible, place_nodes
from selfmotion.search.starts import spread
from selfmotion.search.tighten import FINELY, ROUGHLY, tighten

# Inverse kinematics starts anew at every so manieth waypoint, from so many seeds.
_ANEW_EVERY = 10
_ANEW_SEEDS = 100


@dataclass(frozen=True, eq=False)
class Sequence:
    """Configurations along a path.

    Attributes
    ----------
    t : (W,)
        Times of the waypoints [s].
    q : (W, n)
        Configurations [rad or m], each with the tool on the path.
    length : float
        Σ w|Δq| over waypoints and joints, w being the joints' weights (`RobotModel.joint_weights`).
    cost : float
        What it was chosen by; see `Measure`.
    """

    t: Array
    q: Array
    length: float
    cost: float = np.nan

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", read_only(self.t))
        object.__setattr__(self, "q", read_only(self.q))


@dataclass(frozen=True, eq=False)
class CurveLayers:
    """The self-motion curves at the waypoints of a path, and their free samples.

    Attributes
    ----------
    motion : SelfMotion
    x : (W, 12)
        The tool at the waypoints.
    curves : list of CurveSet
    bounds : Admissible
    samples : list of (K, n)
        Without turns.
    """

    motion: SelfMotion
    x: Array
    curves: list[CurveSet]
    bounds: Admissible
    samples: list[Array]

    @classmethod
    def of(
        cls,
        follows: Follows,
        t: Array,
        limits: tuple[Array, Array],
        bodies: tuple[tuple[CollisionModel, float], ...],
        rng: np.random.Generator | int,
        progress: Progress,
    ) -> "CurveLayers":
        """Return those of a task that leaves redundancy 1; see `best_sequences`."""
        motion = SelfMotion(follows, SPACING)
        bounds = Admissible(*limits, motion.revolute, bodies)
        x = follows.targets(t)
        seeds = list(spread(follows.robot, _ANEW_SEEDS, np.random.default_rng(rng)))
        curves = curves_along(motion, x, seeds, _ANEW_EVERY, progress)
        samples = _free_samples(motion, x, curves, bounds, progress)
        return cls(motion, x, curves, bounds, samples)

    def why_blocked(
        self, i: int, alive: Array, layer: Array, bounds: Admissible, steps: Array
    ) -> str:
        """Return why no chain reaches waypoint i, with what chains reach before it (A, n)."""
        step = steps[max(i - 1, 0)]
        return why_blocked(self.motion, self.x[i], self.curves[i], alive, layer, bounds, step)


def best_sequences(
    follows: Follows,
    t: npt.ArrayLike,
    *,
    lower: npt.ArrayLike,
    upper: npt.ArrayLike,
    largest_step: npt.ArrayLike,
    bodies: Iterable[tuple[CollisionModel, float]] = (),
    count: int = 3,
    measure: Measure | None = None,
    rng: np.random.Generator | int = 0,
    progress: Progress = silent,
) -> list[Sequence]:
    """Return the best joint sequences along a path that are unlike each other.

    At every waypoint all self-motion curves are sampled by numerical continuation, from inverse
    kinematics at many seeds and from the curves of the neighbouring waypoints. The samples inside
    the limits and free of collision are the nodes of a graph; dynamic programming finds the chain
    of least Σ w|Δq|, or of the least of another measure, with every step within `largest_step`:
    the global optimum over samples about 0.1 rad apart. Each is then moved along the curves,
    locally and with finer samples, to where it is better; it stays a few per cent above the
    continuous problem's optimum. Hence several chains, unlike each other by 0.3 rad in some joint
    at a tenth of the waypoints: refine them all and keep the best.

    Parameters
    ----------
    follows : Follows
        Must leave redundancy 1.
    t : (W,)
        Times of the waypoints [s], increasing, within the path.
    lower, upper : (n,)
        Joint limits [rad or m]; ±inf for joints without. An angle is what it is: turns count.
    largest_step : (n,), (W - 1, n) or float
        Largest change of each joint from one waypoint to the next [rad or m].
    bodies : sequence of (CollisionModel, float)
        Bodies to keep apart at the waypoints, and the distance [m].
    count : int
        How many sequences at most.
    measure : Measure, optional
        What they are chosen by; by default their length.
    rng : Generator or int
        Shifts the seeds of the inverse kinematics; the same one gives the same sequences.
    progress : Progress
        Told the waypoint or sequence that is worked on.

    Returns
    -------
    list of Sequence
        The best first, at least one.

    Raises
    ------
    ProblemError
        The task does not leave redundancy 1, or an argument has the wrong shape or sign.
    PathError
        A time is outside the path.
    NoSequenceError
        No chain exists among the samples; tells the waypoint at which the last one ends, and why.
    """
    robot, times = follows.robot, as_times(t)
    limits = [
        as_joint_values(robot, values, name, shape)
        for values, name, shape in (
            (lower, "lower", (robot.dof,)),
            (upper, "upper", (robot.dof,)),
            (largest_step, "largest_step", (len(times) - 1, robot.dof)),
        )
    ]
    check_asked(follows, limits, count)
    lower, upper, steps = limits
    layers = CurveLayers.of(follows, times, (lower, upper), tuple(bodies), rng, progress)
    motion, x, bounds = layers.motion, layers.x, layers.bounds
    rough, turning, measure = _rough_motions(layers, steps, times, count, measure)
    # All of them roughly, to see which are worth the rest.
    for stage, spacings, kept in (
        ("search: optimising sequence", ROUGHLY, len(rough)),
        ("search: optimising finalist", FINELY, count),
    ):
        del rough[kept:]
        for number, q in enumerate(rough):
            progress(stage, number + 1, len(rough))
            rough[number] = tighten(motion, x, q, bounds, steps, measure, spacings)
        best = ranked(times, rough, turning, robot.joint_weights, measure)
        rough = [np.array(sequence.q) for sequence in best]
    return best


def _rough_motions(
    nodes: CurveLayers, steps: Array, times: Array, count: int, asked: Measure | None
) -> tuple[list[Array], Flags, Measure]:
    """Return the best unlike motions (W, n) over samples, whose turns did not count, and by what.

    Turns of joints with room for several are left out at first, and the motion put inside the
    limits as a whole; where it does not fit, it is looked for among all turns of these joints.
    """
    bounds, length = nodes.bounds, Length(nodes.motion.robot.joint_weights)
    if isinstance(asked, Length):
        length = asked
    relaxed = bounds.without_turns()
    while True:
        layers, turning = [relaxed.layer(q) for q in nodes.samples], relaxed.turning
        chains = best_chains(layers, steps, turning, length)
        if chains.blocked is not None:
            i = chains.blocked
            alive = layers[i - 1][np.isfinite(chains.cost[i - 1])] if i else layers[0][:0]
            reason = nodes.why_blocked(i, alive, layers[i], relaxed, steps)
            raise NoSequenceError(
                f"{nodes.motion.robot.name}: no motion along the path passes t = {times[i]:.6g} s: "
                f"{reason}",
                time=float(times[i]),
                reason=reason,
            )
        measure: Measure = length
        if asked is not None and asked is not length:
            shortest = chains.back(len(layers) - 1, int(np.argmin(chains.cost[-1])))
            measure = asked.at_pace_of(connected(layers, shortest, turning))
            chains = best_chains(layers, steps, turning, measure)
        # Unlike chains may become the same one when they are tightened.
        found = diverse_chains(layers, chains, steps, turning, 2 * count, measure)
        rough = [bounds.turned_inside(connected(layers, q, turning)) for q in found]
        beyond = bounds.beyond(rough[0])
        if not np.any(beyond):
            return [q for q in rough if not np.any(bounds.beyond(q))], turning, measure
        relaxed = replace(
            relaxed,
            lower=np.where(beyond, bounds.lower, relaxed.lower),
            upper=np.where(beyond, bounds.upper, relaxed.upper),
        )


def ranked(
    times: Array, motions: list[Array], turning: Flags, weights: Array, measure: Measure
) -> list[Sequence]:
    """Return the sequences, the best first, without those that became like a better one."""
    length = Length(weights)
    sequences = [Sequence(times, q, length.of(q), measure.of(q)) for q in motions]
    kept: list[Sequence] = []
    for sequence in sorted(sequences, key=lambda sequence: sequence.cost):
        if all(unlike(sequence.q, other.q, turning) for other in kept):
            kept.append(sequence)
    return kept


def _free_samples(
    motion: SelfMotion, x: Array, curves: list[CurveSet], bounds: Admissible, progress: Progress
) -> list[Array]:
    """Return the free samples of the curves at every waypoint, without turns."""
    found: list[Array] = []
    before = np.empty((0, motion.robot.dof))
    for number, (target, here) in enumerate(zip(x, curves, strict=True), 1):
        progress("search: sampling waypoint", number, len(x))
        carried, arrived = motion.project_all(before, target)
        before = place_nodes(motion, target, here, carried[arrived], bounds, SPACING)
        found.append(before)
    return found


def connected(layers: list[Array], chain: list[int], turning: Flags) -> Array:
    """Return a chain's configurations (W, n); joints that turn without end do not jump."""
    q = np.array([layer[k] for layer, k in zip(layers, chain, strict=True)])
    steps = unturned(np.diff(q, axis=0), turning)
    return np.where(turning, np.vstack([q[:1], q[0] + np.cumsum(steps, axis=0)]), q)


def as_times(t: npt.ArrayLike) -> Array:
    """Return increasing times (W,), checked."""
    times = np.asarray(t, dtype=np.float64)
    if times.ndim != 1 or len(times) < 2 or not np.all(np.diff(times) > 0):
        raise ProblemError(f"t has shape {times.shape}, expected at least two increasing times [s]")
    return times


def as_joint_values(
    robot: RobotModel, values: npt.ArrayLike, name: str, shape: tuple[int, ...]
) -> Array:
    """Return numbers for each joint in a shape, given as such, for each joint, or one for all."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (robot.dof,), shape) or np.any(np.isnan(array)):
        raise ProblemError(
            f"{name} has shape {array.shape}, expected a number for each of {robot.dof} joints"
        )
    return np.ascontiguousarray(np.broadcast_to(array, shape))


def check_asked(follows: Follows, limits: list[Array], count: int) -> None:
    """Refuse what the search over curves cannot do; `limits` are lower, upper, largest step."""
    robot, redundancy = follows.robot, follows.redundancy
    if redundancy != 1:
        raise ProblemError(
            f"{robot.name} has redundancy {redundancy} for task '{follows.task.value}'; the search "
            f"over self-motion curves needs 1, use multiple starts instead"
        )
    if np.any(limits[0] > limits[1]):
        k = int(np.flatnonzero(limits[0] > limits[1])[0])
        raise ProblemError(f"joint '{robot.joint_names[k]}' has its lower limit above the upper")
    if not np.all(limits[2] > 0.0):
        raise ProblemError("largest_step has numbers that are not positive")
    if count < 1:
        raise ProblemError(f"count is {count}, expected at least 1")
