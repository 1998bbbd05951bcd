"""Rough motions from many starts on nodes, in one pass, and the ranking of these starts."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Flags, Ints, Progress
from selfmotion.model.follow import Coordinates
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.planning.formulation import BoundConditions, Formulation
from selfmotion.planning.nodes import Batch, NodeGrid, NodeMotion, minimise
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import ABOUT_AS_GOOD, NOTHING, UNKEPT, resolves, rough_grid
from selfmotion.planning.search import carried
from selfmotion.problem.constraints import penalised
from selfmotion.problem.costs import Samples

# Newton iterations of rough motions.
_ROUGH_ROUNDS = 30
# Relative difference of the costs of mirror images; also rounding of limits, as a share of a turn.
_SAME_TO_DIGITS = 1e-9
# Relative difference of the violations of images of one motion.
_SAME_VIOLATION = 1e-6
# Largest number of rough motions.
ROUGH_MOTIONS = 16
# Newton iterations with constraints after these.
_WITH_CONDITIONS = 12
# Largest number of rough motions that are feasible from the start.
_WITHIN = 6
# Distance of motions at x = 0 [rad or m] in one valley of the cost, as a rule.
ONE_VALLEY = 0.6
# Distance of rough optima that are the same.
_SAME_OPTIMUM = 0.1
# A whole turn [rad].
_TURN = 2.0 * np.pi


def far_from_usual(coordinates: Coordinates, motions: Array) -> Array:
    """Return the mean distances of motions (K, N, n) from the usual posture, (K,) [rad]."""
    away = np.abs(motions - coordinates.usual()) @ coordinates.weights
    return np.asarray(away.mean(axis=1))


def wound_back(coordinates: Coordinates, motion: Array) -> Array:
    """Return a motion (N, n) with joints turned by whole turns, as near to usual as limits allow.

    The tool's motion is the same. Joints outside of their limits at any turn are put in the middle.
    """
    lowest, highest = motion.min(axis=0), motion.max(axis=0)
    middle, shift = 0.5 * (lowest + highest), np.zeros(coordinates.dof)
    usual = coordinates.usual()
    for joint in np.flatnonzero(coordinates.is_revolute):
        lower, upper = coordinates.lower[joint], coordinates.upper[joint]
        wanted = round((usual[joint] - middle[joint]) / _TURN)
        # Rounding must not take a joint that stands on its limit round to the other side.
        least = np.ceil((lower - lowest[joint]) / _TURN - _SAME_TO_DIGITS)
        most = np.floor((upper - highest[joint]) / _TURN + _SAME_TO_DIGITS)
        if least <= most:
            shift[joint] = np.clip(wanted, least, most)
        elif np.isfinite(lower) and np.isfinite(upper):
            shift[joint] = round((0.5 * (lower + upper) - middle[joint]) / _TURN)
    return np.asarray(motion + _TURN * shift)


Distance = Callable[[Array, Array], Array]
"""How far a motion (N, n) is from each of others (K, N, n), (K,) [rad or m]."""


class Ranking:
    """Ranks starts by rough optima on nodes.

    All starts in one pass first, without constraints: if the cheapest motion satisfies them all the
    same, it is the best. If none does for sure, a few iterations with constraints rank the cheapest
    ones by feasibility and cost.

    Parameters
    ----------
    formulation : Formulation
    effort : Effort
    progress : Progress
    """

    def __init__(self, formulation: Formulation, effort: Effort, progress: Progress) -> None:
        self._formulation, self._effort, self._progress = formulation, effort, progress
        self._free = formulation.given_start is None
        # Whole turns depend on the required limits, not on the arm's own.
        allowed = formulation.envelope
        self._coordinates = formulation.coordinates.within(allowed.lower, allowed.upper)
        self._distances = distance_of(formulation.coordinates)
        self._t = rough_grid(formulation).nodes
        self._found: Batch | None = None
        self._ranked: list[NodeMotion] = []
        # Motions at the starts, of which the ranked ones came.
        self._carried: list[Array] = []

    @property
    def ranked(self) -> list[NodeMotion]:
        """The motions so far, the best first."""
        if not self._ranked and self._found is not None:
            # After an interruption, the cheapest feasible one.
            near = (self._motion(self._found, k) for k in _cheapest(self._found))
            motions = [motion for motion in near if motion is not None]
            feasible = (one for one in motions if one.violation <= 0.0)
            best = next((one for one in feasible if self._clear(one)), next(iter(motions), None))
            return [] if best is None else [best]
        return self._ranked

    def run(self, starts: Sequence[Array], finalists: int, at: int = 0) -> bool:
        """Leave the best `finalists` of the starts (n,), or fewer where they became the same.

        The motions are at them where `at` of their times is, by default at the start of the path.

        Returns whether the ranking is complete.
        """
        formulation = self._formulation
        motions, arrived = carried(formulation.follows, np.array(starts), self._t, at)
        if not arrived.any():
            return False
        order = most_promising(formulation, starts, motions, arrived, self._t, self._distances)
        self._carried = [motions[k] for k in order]
        free: list[NodeMotion] = []
        if self._is_pointwise():
            optima = self._freely(motions[arrived], finalists)
            if optima is None:
                return False
            free = optima
        if not self._ranked:
            # Unconstrained optima may be elsewhere than feasible motions.
            started = self._feasible_starts(max(ROUGH_MOTIONS, finalists))
            self._ranked = self._with_conditions(free, started, finalists)
        return bool(self._ranked)

    def left_aside(self, known: Sequence[Trajectory], finalists: int) -> list[NodeMotion]:
        """Return rough motions with conditions, unlike those that are known, the best first.

        For the case that none of the best becomes feasible: a body may be met between rough nodes,
        so that the ranking was wrong.
        """
        near = (self._near(motion(self._t)) for motion in known)
        others = [motion for motion in near if motion is not None]
        started, found = self._feasible_starts(ROUGH_MOTIONS), list[NodeMotion]()
        for number, motion in enumerate(started, 1):
            self._progress("start", number, len(started))
            better = self._roughly(motion)
            if not _is_image(better, [*others, *found]):
                found.append(better)
        return sorted(found, key=self._rank)[:finalists]

    def _feasible_starts(self, count: int) -> list[NodeMotion]:
        """Return `count` motions at starts with constraints, none an image of another one."""
        found = list[NodeMotion]()
        for carried_on in self._carried:
            motion = self._near(carried_on)
            if motion is not None and not _is_image(motion, found):
                found.append(motion)
            if len(found) == count:
                break
        return found

    def run_along(self, motions: Array, t: Array, finalists: int) -> bool:
        """Leave the best `finalists` of motions (K, N, n) on the path at times t (N,) [s].

        Of different ones the cheapest, with their violations; after some iterations with
        constraints. Returns whether there is one.
        """
        from scipy.interpolate import CubicSpline

        formulation, sampling = self._formulation, Sampling.trapezoidal(t)
        if self._free:
            motions = np.array([wound_back(self._coordinates, motion) for motion in motions])
        curves = [CubicSpline(t, motion) for motion in motions]
        each = [formulation.sampled_along(sampling, q(t), q(t, 1)) for q in curves]
        costs = np.array([formulation.cost_of(motion) for motion in each])
        cheapest = np.argsort(costs, kind="stable")
        alone = unlike(motions, cheapest, self._distances, ONE_VALLEY)[0][:ROUGH_MOTIONS]
        merits = dict[int, float]()
        for k in alone:
            own = formulation.conditions(*motions[k, [0, -1]], apart=False)
            merits[k] = penalised(float(costs[k]), each[k].with_conditions(own.every))
        found = list[NodeMotion]()
        chosen = sorted(alone, key=lambda k: merits[k])[:_WITHIN]
        for number, k in enumerate(chosen, 1):
            self._progress("start", number, len(chosen))
            started = self._near(*(curves[k](self._t, order) for order in range(3)))
            found += [] if started is None else [self._roughly(started)]
            self._ranked = self._different(sorted(found, key=self._rank))[:finalists]
        return bool(self._ranked)

    def _roughly(self, started: NodeMotion) -> NodeMotion:
        """Return the rough optimum near a motion, or that itself where it keeps more."""
        found = minimise(
            started, lambda _: False, roughly=True, max_iterations=_ROUGH_ROUNDS
        ).motion
        return min(found, started, key=self._rank)

    def _is_pointwise(self) -> bool:
        """Whether costs are pointwise, and there is no condition on ends.

        Not where accelerations cost: few nodes say little of them.
        """
        formulation, dof = self._formulation, self._formulation.robot.dof
        costs = formulation.costs
        if not all(cost.is_pointwise and max(cost.curvature(dof), default=0) < 2 for cost in costs):
            return False
        q = formulation.coordinates.generic()[0]
        return not formulation.conditions(q, q, apart=False).ends

    def _freely(self, motions: Array, finalists: int) -> list[NodeMotion] | None:
        """Return the rough optima near motions (K, N + 1, n), the cheapest first.

        Those that are the best for sure are ranked. None if none can be evaluated.
        """
        formulation = self._formulation
        nodes = self._grid(formulation)
        total = 1 + _ROUGH_ROUNDS
        self._progress("screening start", 1, total)
        found = self._found = Batch.near(nodes, motions)
        soft = formulation.with_springs(float(found.costs.min()))
        if soft is not formulation:
            found = self._found = Batch.near(self._grid(soft), motions)
        alone, near = unlike(found.q, _cheapest(found), self._distances, ONE_VALLEY)
        which = [*alone, *near][: max(ROUGH_MOTIONS, finalists)]
        if not which:
            return None
        found = self._found = found.picked(np.array(which, dtype=np.int64))
        for number in range(2, total + 1):
            self._progress("screening start", number, total)
            if _hopeful(found).any():
                found = self._found = found.advanced()
        self._ranked = self._decisive(found, finalists)
        order = unlike(found.q, self._expected(found), self._distances, _SAME_OPTIMUM)[0]
        each = [] if self._ranked else [self._motion(found, k) for k in order]
        return [motion for motion in each if motion is not None]

    def _grid(self, formulation: Formulation) -> NodeGrid:
        counts = self._effort.counts
        none = BoundConditions()
        return NodeGrid(formulation, self._t, none, free=self._free, counts=counts, smoothed=True)

    def _decisive(self, found: Batch, finalists: int) -> list[NodeMotion]:
        """Return the cheapest motion that keeps all, then others about as cheap; or none.

        None is the cheapest for sure where it is not at its optimum yet, or the nodes are too few.
        """
        feasible: list[NodeMotion] = []
        others: list[NodeMotion] = []
        dearest = np.inf
        for k in unlike(found.q, self._expected(found), self._distances, _SAME_OPTIMUM)[0]:
            if found.costs[k] > dearest or len(feasible) + len(others) == finalists:
                break
            motion = self._motion(found, k)
            # Equal costs to the last digits are mirror images.
            if motion is None or any(_same(motion.cost, one.cost) for one in feasible):
                continue
            if found.going[k] or not resolves(motion):
                return []
            # One without progress may improve as well.
            stuck = found.promised[k] > ABOUT_AS_GOOD * abs(motion.cost)
            if stuck or motion.breaks_hard():
                others.append(motion)
            elif self._clear(motion):
                feasible.append(motion)
            else:
                # An optimum that takes the arm into itself goes on doing that.
                continue
            cost = float(found.costs[k])
            dearest = min(dearest, cost + ABOUT_AS_GOOD * abs(cost))
        return [*feasible, *others] if feasible and not _hopeful(found).any() else []

    def _with_conditions(
        self, free: Sequence[NodeMotion], others: Sequence[NodeMotion], finalists: int
    ) -> list[NodeMotion]:
        """Return the best results of a few iterations with constraints, different ones.

        Of optima without conditions, the cheapest first; and of others where none of these keeps
        everything.
        """
        found: list[tuple[tuple[bool, float], NodeMotion]] = []
        total = len(free) + len(others)
        tried = list[NodeMotion]()
        for number, motion in enumerate([*free, *others], 1):
            if _is_image(motion, tried):
                continue
            tried.append(motion)
            if free and number > len(free) and found and found[0][1].violation <= 0.0:
                break
            if number <= len(free) and found and (False, motion.cost) >= found[0][0]:
                # With constraints it would cost more still.
                continue
            self._progress("start", number, total)
            # Motions without self-motion are far from optima.
            most = _WITH_CONDITIONS if number <= len(free) else _ROUGH_ROUNDS
            better = minimise(motion, lambda _: False, roughly=True, max_iterations=most).motion
            found = sorted([*found, (self._rank(better), better)], key=lambda each: each[0])
            self._ranked = [one for _, one in found]
        return self._different(self._ranked)[:finalists]

    def _different(self, motions: Sequence[NodeMotion]) -> list[NodeMotion]:
        """Return motions without those that are near one before them."""
        q = np.array([motion.place.q for motion in motions])
        alone, _ = unlike(q, np.arange(len(q)), self._distances, _SAME_OPTIMUM)
        return [motions[k] for k in alone]

    def _rank(self, motion: NodeMotion) -> tuple[bool, float]:
        """Return the sort key of motions, the best first: violations have a penalty."""
        cost = motion.cost
        return not self._clear(motion), cost + UNKEPT * abs(cost) * motion.violation

    def _motion(self, found: Batch, k: int) -> NodeMotion | None:
        """Return one of the motions, with its constraints.

        Its joints are turned by whole turns towards the usual posture. Without limits they may have
        gone far beyond them, and the tool's motion is the same.
        """
        q = found.q[k]
        motion = self._near(wound_back(self._coordinates, q), found.qd[k], found.qdd[k])
        # Costs may depend on whole turns.
        if motion is not None and motion.cost <= (1.0 + _SAME_TO_DIGITS) * found.costs[k]:
            return motion
        return self._near(self._turned_inside(q), found.qd[k], found.qdd[k])

    def _expected(self, found: Batch) -> Ints:
        """Return the numbers of motions, the cheapest first; of about as cheap ones the usual."""
        order = _cheapest(found)
        if not order.size:
            return order
        own, costs = self._coordinates, found.costs[order]
        # Each motion belongs to the cheapest one of about the same cost.
        group, first = np.zeros(len(order), dtype=np.int64), 0
        for k in range(1, len(order)):
            if costs[k] - costs[first] > NOTHING * abs(costs[first]):
                first = k
            group[k] = first
        far = far_from_usual(own, np.array([wound_back(own, found.q[k]) for k in order]))
        return np.asarray(order[np.lexsort((far, group))])

    def _turned_inside(self, q: Array) -> Array:
        """Return a motion (N + 1, n) with joints beyond their limits turned back by whole turns."""
        own = self._coordinates
        beyond = ((q > own.upper) | (q < own.lower)).any(axis=0)
        return np.where(beyond, wound_back(own, q), q)

    def _near(
        self, q: Array, qd: Array | None = None, qdd: Array | None = None
    ) -> NodeMotion | None:
        """Return the motion nearest to one, with the conditions; by default without self-motion."""
        formulation, minimum_norm = self._formulation, np.zeros_like(q)
        bound = formulation.conditions(q[0], q[-1], apart=self._effort.apart)
        counts = self._effort.counts
        grid = NodeGrid(formulation, self._t, bound, free=self._free, counts=counts, smoothed=True)
        return grid.near(
            q, minimum_norm if qd is None else qd, minimum_norm if qdd is None else qdd
        )

    def _clear(self, motion: NodeMotion) -> bool:
        return self._formulation.keeps_off_itself(motion.place.q)


def _cheapest(found: Batch) -> Ints:
    """Return the numbers of motions, the cheapest first, without those of infinite cost."""
    order = np.argsort(found.costs, kind="stable")
    return np.asarray(order[np.isfinite(found.costs[order])])


def _hopeful(found: Batch) -> Flags:
    """Return the mask of motions that go on, and may become cheaper than the finished ones."""
    least = found.costs[~found.going].min(initial=np.inf)
    dearest = least + ABOUT_AS_GOOD * abs(least) if np.isfinite(least) else least
    return np.asarray(found.going & (found.costs - found.promised < dearest))


def _is_image(motion: NodeMotion, others: Sequence[NodeMotion]) -> bool:
    """Whether one of others costs and violates the same to the last digits.

    Those that differ by a rotation of the tool about its free axis, or by a mirror.
    """
    return any(
        _same(motion.cost, one.cost)
        and abs(motion.violation - one.violation) <= _SAME_VIOLATION * (1.0 + one.violation)
        for one in others
    )


def _same(a: float, b: float | None) -> bool:
    return b is not None and abs(a - b) <= _SAME_TO_DIGITS * abs(a)


def most_promising(
    formulation: Formulation,
    starts: Sequence[Array],
    motions: Array,
    arrived: Flags,
    t: Array,
    apart: Distance,
) -> list[int]:
    """Return numbers of starts, the best first, and those last that are near a better one.

    By the cost of the motions that follow the path from them without self-motion, and their
    violations: the start of one near a better one moves there by itself. Starts that cannot follow
    the path come last.

    Parameters
    ----------
    formulation : Formulation
    starts : sequence of (n,)
    motions : (K, N, n)
        The motions from them, at few times t (N,) [s].
    arrived : (K,)
        Mask of those that follow the path to its end.
    distance : callable
        Distance of motions.
    """
    merits = np.full(len(starts), np.inf)
    twists = formulation.follows.twists(t)
    sampling = Sampling.trapezoidal(t)
    for k in np.flatnonzero(arrived):
        merits[k] = _merit(formulation, motions[k], twists, sampling)
    order = np.argsort(merits, kind="stable")
    followed = order[arrived[order]]
    valleys, slopes = unlike(motions, followed, apart, ONE_VALLEY)
    return [*valleys, *slopes, *order[~arrived[order]].tolist()]


def _merit(formulation: Formulation, q: Array, twists: Array, sampling: Sampling) -> float:
    """Return the cost of a motion q (N, n) along the path, with a penalty of violations.

    `twists` (N, m) are those of the path at the grid's nodes, which are the samples.
    """
    minimum_norm = Samples.along(formulation.follows, sampling, q, np.zeros_like(q))
    J = minimum_norm.task_jacobian
    gram = J @ J.transpose(0, 2, 1)
    try:
        qd = np.einsum("smn,sm->sn", J, np.linalg.solve(gram, twists[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.inf
    samples = replace(minimum_norm, qd=qd)
    own, motion = formulation.conditions(q[0], q[-1], apart=False), formulation.sampled(samples)
    return penalised(formulation.cost_of(motion), motion.with_conditions(own.every))


def distance_of(coordinates: Coordinates) -> Distance:
    """Return the largest distance of motions, modulo whole turns, as a function."""
    turning, sizes = coordinates.is_revolute, coordinates.sizes

    def apart(motion: Array, others: Array) -> Array:
        difference = others - motion
        turns = np.round(difference / (2.0 * np.pi))
        away = sizes * np.abs(difference - 2.0 * np.pi * turns * turning)
        return np.asarray(away.max(axis=(1, 2)))

    return apart


def unlike(
    motions: Array, order: Ints, apart: Distance, least: float
) -> tuple[list[int], list[int]]:
    """Return those of motions (K, N, n) that are not near one earlier in an order, and the others.

    Numbers of motions, in that order; farther apart than `least` is not near.
    """
    alone: list[int] = []
    near: list[int] = []
    for k in order.tolist():
        is_alone = bool((apart(motions[k], motions[alone]) > least).all())
        (alone if is_alone else near).append(k)
    return alone, near
