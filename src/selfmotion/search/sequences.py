"""The global search: curves at all waypoints, nodes on them, the shortest chains of nodes."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    Flags,
    NoSequenceError,
    ProblemError,
    Progress,
    silent,
)
from selfmotion.collision import CollisionModel
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel
from selfmotion.search.chains import (
    Sequence,
    best_chains,
    connected,
    diverse_chains,
    ranked,
    why_blocked,
)
from selfmotion.search.curves import SPACING, CurveSet, SelfMotion, curves_along
from selfmotion.search.manifold import OnPath
from selfmotion.search.measures import Length, Measure, RunningCost
from selfmotion.search.nodes import Admissible, place_nodes
from selfmotion.search.shortest import improved_by
from selfmotion.search.starts import spread

# Inverse kinematics starts anew at every so manieth waypoint, from so many seeds.
_ANEW_EVERY = 10
_ANEW_SEEDS = 100
# So many chains go through the first stage, after which it shows which are worth the others.
_LOOKED_AT = 8


@dataclass(frozen=True, eq=False)
class Layers:
    """The nodes of a search: free configurations at the waypoints of a path.

    Attributes
    ----------
    waypoints : OnPath
    t : (W,)
        Their times [s].
    steps : (W - 1, n)
        No joint may move more from one waypoint to the next [rad or m].
    bounds : Admissible
    samples : list of (K, n)
        Each at one of its turns.
    why : callable
        Returns why no chain reaches a waypoint, by its number, what chains reach before it (A, n),
        the nodes there (K, n), and the bounds that these keep.
    """

    waypoints: OnPath
    t: Array
    steps: Array
    bounds: Admissible
    samples: list[Array]
    why: Callable[[int, Array, Array, Admissible], str]

    def refused(self, i: int, reason: str, parts: str = "") -> NoSequenceError:
        """Return the error that no motion, in however many parts, passes waypoint i."""
        time = float(self.t[i])
        return NoSequenceError(
            f"{self.waypoints.robot.name}: no motion along the path{parts} passes "
            f"t = {time:.6g} s: {reason}",
            time=time,
            reason=reason,
        )


def curve_layers(
    follows: Follows,
    t: Array,
    steps: Array,
    limits: tuple[Array, Array],
    bodies: tuple[tuple[CollisionModel, float], ...],
    rng: np.random.Generator | int,
    progress: Progress,
) -> Layers:
    """Return the free samples of all self-motion curves of a task that leaves redundancy 1.

    See `best_sequences`.
    """
    motion, x = SelfMotion(follows, SPACING), follows.targets(t)
    bounds = Admissible(*limits, motion.revolute, bodies)
    seeds = list(spread(follows.robot, _ANEW_SEEDS, np.random.default_rng(rng)))
    curves = curves_along(motion, x, seeds, _ANEW_EVERY, progress)
    samples = _free_samples(motion, x, curves, bounds, progress)

    def why(i: int, alive: Array, layer: Array, kept: Admissible) -> str:
        return why_blocked(motion, x[i], curves[i], alive, layer, kept, steps[max(i - 1, 0)])

    return Layers(OnPath(follows, t, *limits), t, steps, bounds, samples, why)


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
    layers = curve_layers(follows, times, steps, (lower, upper), tuple(bodies), rng, progress)
    return sequences_over(layers, count, measure, progress)


def sequences_over(
    layers: Layers, count: int, asked: Measure | None, progress: Progress
) -> list[Sequence]:
    """Return the best chains of nodes that are unlike each other, moved to where they are better.

    By default by their length; see `best_sequences`.
    """
    rough, turning, measure = _rough_motions(layers, asked)
    better = improved_by(layers.waypoints, layers.bounds, layers.steps, measure)
    # What a chain of samples costs says little of the best one near it, a rough look says much.
    for stage, roughly in (
        ("search: optimising sequence", True),
        ("search: optimising finalist", False),
    ):
        for number, q in enumerate(rough):
            progress(stage, number + 1, len(rough))
            rough[number] = better(q, roughly)
        best = ranked(layers.t, rough, turning, layers.waypoints.robot.joint_weights, measure)
        best = best[:count]
        rough = [np.array(sequence.q) for sequence in best]
    return best


def _rough_motions(nodes: Layers, asked: Measure | None) -> tuple[list[Array], Flags, Measure]:
    """Return the best unlike motions (W, n) over samples, whose turns did not count, and by what.

    Turns of joints with room for several are left out at first, and the motion put inside the
    limits as a whole; where it does not fit, it is looked for among all turns of these joints.
    """
    bounds = nodes.bounds
    length = asked if isinstance(asked, Length) else Length(nodes.waypoints.robot.joint_weights)
    relaxed = bounds.without_turns()
    while True:
        layers, turning = [relaxed.layer(q) for q in nodes.samples], relaxed.turning
        chains = best_chains(layers, nodes.steps, turning, length)
        if chains.blocked is not None:
            i = chains.blocked
            alive = layers[i - 1][np.isfinite(chains.cost[i - 1])] if i else layers[0][:0]
            raise nodes.refused(i, nodes.why(i, alive, layers[i], relaxed))
        measure: Measure = length
        if isinstance(asked, RunningCost):
            shortest = chains.back(len(layers) - 1, int(np.argmin(chains.cost[-1])))
            measure = asked.at_pace_of(connected(layers, shortest, turning))
            chains = best_chains(layers, nodes.steps, turning, measure)
        found = diverse_chains(layers, chains, nodes.steps, turning, _LOOKED_AT, measure)
        rough = [bounds.turned_inside(connected(layers, q, turning)) for q in found]
        beyond = bounds.beyond(rough[0])
        if not np.any(beyond):
            return [q for q in rough if not np.any(bounds.beyond(q))], turning, measure
        relaxed = relaxed.counting_turns(beyond, bounds)


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
