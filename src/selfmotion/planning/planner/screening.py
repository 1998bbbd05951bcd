"""The ranking of many starts, by rough motions from them on nodes, in one pass."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Flags, Progress
from selfmotion.model.follow import generic_values
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.planning.formulation import (
    Formulation,
    cost_of_motion,
    sampled,
    sampled_along,
    with_springs,
)
from selfmotion.planning.nodes import Batch, NodeMotion, breaks_hard, minimise
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import ABOUT_AS_GOOD, resolves
from selfmotion.planning.planner.rough import (
    ROUGH_ROUNDS,
    SAME_OPTIMUM,
    Distance,
    RoughMotions,
    cheapest,
    same,
    unlike,
    wound_back,
)
from selfmotion.planning.search import carried
from selfmotion.problem.constraints import penalised
from selfmotion.problem.costs import Samples

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
        self._formulation, self._progress = formulation, progress
        self._rough = RoughMotions(formulation, effort)
        self._found: Batch | None = None
        self._ranked: list[NodeMotion] = []
        # Motions at the starts, of which the ranked ones came.
        self._carried: list[Array] = []

    @property
    def ranked(self) -> list[NodeMotion]:
        """The motions so far, the best first."""
        if not self._ranked and self._found is not None:
            # After an interruption, the cheapest feasible one.
            near = (self._rough.motion(self._found, k) for k in cheapest(self._found))
            motions = [motion for motion in near if motion is not None]
            feasible = (one for one in motions if one.violation <= 0.0)
            best = next(
                (one for one in feasible if self._rough.is_clear(one)), next(iter(motions), None)
            )
            return [] if best is None else [best]
        return self._ranked

    def run(self, starts: Sequence[Array], finalists: int, at: int = 0) -> bool:
        """Leave the best `finalists` of the starts (n,), or fewer where they became the same.

        The motions are at them where `at` of their times is, by default at the start of the path.

        Returns whether the ranking is complete.
        """
        formulation = self._formulation
        motions, arrived = carried(formulation.follows, np.array(starts), self._rough.t, at)
        if not arrived.any():
            return False
        order = most_promising(
            formulation, starts, motions, arrived, self._rough.t, self._rough.apart
        )
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
        near = (self._rough.near(motion(self._rough.t)) for motion in known)
        others = [motion for motion in near if motion is not None]
        started, found = self._feasible_starts(ROUGH_MOTIONS), list[NodeMotion]()
        for number, motion in enumerate(started, 1):
            self._progress("start", number, len(started))
            better = self._rough.roughly(motion)
            if not _is_image(better, [*others, *found]):
                found.append(better)
        return sorted(found, key=self._rough.rank)[:finalists]

    def _feasible_starts(self, count: int) -> list[NodeMotion]:
        """Return `count` motions at starts with constraints, none an image of another one."""
        found = list[NodeMotion]()
        for carried_on in self._carried:
            motion = self._rough.near(carried_on)
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
        if self._rough.free:
            motions = np.array([wound_back(self._rough.coordinates, motion) for motion in motions])
        curves = [CubicSpline(t, motion) for motion in motions]
        each = [sampled_along(formulation, sampling, q(t), q(t, 1)) for q in curves]
        costs = np.array([cost_of_motion(formulation, motion) for motion in each])
        cheapest = np.argsort(costs, kind="stable")
        alone = unlike(motions, cheapest, self._rough.apart, ONE_VALLEY)[0][:ROUGH_MOTIONS]
        merits = dict[int, float]()
        for k in alone:
            own = formulation.conditions(*motions[k, [0, -1]], apart=False)
            merits[k] = penalised(float(costs[k]), each[k].with_conditions(own.every))
        found = list[NodeMotion]()
        chosen = sorted(alone, key=lambda k: merits[k])[:_WITHIN]
        for number, k in enumerate(chosen, 1):
            self._progress("start", number, len(chosen))
            started = self._rough.near(*(curves[k](self._rough.t, order) for order in range(3)))
            found += [] if started is None else [self._rough.roughly(started)]
            self._ranked = self._rough.different(sorted(found, key=self._rough.rank))[:finalists]
        return bool(self._ranked)

    def _is_pointwise(self) -> bool:
        """Whether costs are pointwise, and there is no condition on ends.

        Not where accelerations cost: few nodes say little of them.
        """
        formulation, dof = self._formulation, self._formulation.robot.dof
        costs = formulation.costs
        if not all(cost.is_pointwise and max(cost.curvature(dof), default=0) < 2 for cost in costs):
            return False
        q = generic_values(formulation.coordinates)[0]
        return not formulation.conditions(q, q, apart=False).ends

    def _freely(self, motions: Array, finalists: int) -> list[NodeMotion] | None:
        """Return the rough optima near motions (K, N + 1, n), the cheapest first.

        Those that are the best for sure are ranked. None if none can be evaluated.
        """
        formulation = self._formulation
        nodes = self._rough.grid(formulation)
        total = 1 + ROUGH_ROUNDS
        self._progress("screening start", 1, total)
        found = self._found = Batch.near(nodes, motions)
        soft = with_springs(formulation, float(found.costs.min()))
        if soft is not formulation:
            found = self._found = Batch.near(self._rough.grid(soft), motions)
        alone, near = unlike(found.q, cheapest(found), self._rough.apart, ONE_VALLEY)
        which = [*alone, *near][: max(ROUGH_MOTIONS, finalists)]
        if not which:
            return None
        found = self._found = found.picked(np.array(which, dtype=np.int64))
        for number in range(2, total + 1):
            self._progress("screening start", number, total)
            if _hopeful(found).any():
                found = self._found = found.advanced()
        self._ranked = self._decisive(found, finalists)
        order = unlike(found.q, self._rough.expected(found), self._rough.apart, SAME_OPTIMUM)[0]
        each = [] if self._ranked else [self._rough.motion(found, k) for k in order]
        return [motion for motion in each if motion is not None]

    def _decisive(self, found: Batch, finalists: int) -> list[NodeMotion]:
        """Return the cheapest motion that keeps all, then others about as cheap; or none.

        None is the cheapest for sure where it is not at its optimum yet, or the nodes are too few.
        """
        feasible: list[NodeMotion] = []
        others: list[NodeMotion] = []
        dearest = np.inf
        for k in unlike(found.q, self._rough.expected(found), self._rough.apart, SAME_OPTIMUM)[0]:
            if found.costs[k] > dearest or len(feasible) + len(others) == finalists:
                break
            motion = self._rough.motion(found, k)
            # Equal costs to the last digits are mirror images.
            if motion is None or any(same(motion.cost, one.cost) for one in feasible):
                continue
            if found.going[k] or not resolves(motion):
                return []
            # One without progress may improve as well.
            stuck = found.promised[k] > ABOUT_AS_GOOD * abs(motion.cost)
            if stuck or breaks_hard(motion):
                others.append(motion)
            elif self._rough.is_clear(motion):
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
            most = _WITH_CONDITIONS if number <= len(free) else ROUGH_ROUNDS
            better = minimise(motion, lambda _: False, roughly=True, max_iterations=most).motion
            found = sorted([*found, (self._rough.rank(better), better)], key=lambda each: each[0])
            self._ranked = [one for _, one in found]
        return self._rough.different(self._ranked)[:finalists]


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
        same(motion.cost, one.cost)
        and abs(motion.violation - one.violation) <= _SAME_VIOLATION * (1.0 + one.violation)
        for one in others
    )


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
    own, motion = formulation.conditions(q[0], q[-1], apart=False), sampled(formulation, samples)
    return penalised(cost_of_motion(formulation, motion), motion.with_conditions(own.every))
