"""The best motion near others, by Newton's method on the nodes, and how fine it has to be."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.constraints import BoundConstraint
from selfmotion.nodes import NodeGrid, NodeMotion, Optimum, Step, minimise
from selfmotion.optimise import Iteration, Status
from selfmotion.planning.effort import Effort
from selfmotion.planning.for_nodes import most_nodes
from selfmotion.planning.kept_on_nodes import (
    aim_of,
    broken_by,
    cost_of,
    meets_ends,
    nearly_broken,
    too_much,
)
from selfmotion.planning.on_nodes import MotionOnNodes
from selfmotion.planning.settings import (
    COST_AGREEMENT,
    FAR_OFF,
    FEWEST_WITH_ACCELERATIONS,
    MOST_FINER,
    NODE_AGREEMENT,
    NODE_ROUNDS,
    SAME_COST,
    SHORT_STEP,
    TOWARDS_MIDDLE,
)
from selfmotion.problem import Problem

_NO_COLUMNS: Ints = np.zeros(0, dtype=np.int64)
_ARRIVED = (Status.CONVERGED, Status.PRECISION)


class NodeDescent:
    """Looks for the best motion on nodes near the motions that it is given.

    Parameters
    ----------
    problem : Problem
    effort : Effort
    constraints : sequence of BoundConstraint
    free : bool
        Whether the start may move along its self-motion.

    Attributes
    ----------
    history : list of Iteration
    latest : MotionOnNodes or None
        The last motion on the way that keeps the conditions: what an interruption leaves.
    is_hopeless : bool
        Whether even what is best freely costs as much as what is known.
    """

    def __init__(
        self,
        problem: Problem,
        effort: Effort,
        constraints: Sequence[BoundConstraint],
        *,
        free: bool,
    ) -> None:
        self._problem, self._effort = problem, effort
        self._constraints, self._free = constraints, free
        self._first = effort.counts.evaluations
        self.history: list[Iteration] = []
        self.latest: MotionOnNodes | None = None
        self.is_hopeless = False
        self._ended: Status | None = None

    def end(self, status: Status) -> None:
        """Take motions as they are; there is no time for better ones."""
        self._ended = status

    def grid(self, t: Array) -> NodeGrid:
        """Return nodes at some times."""
        return NodeGrid(
            self._problem, t, self._constraints, free=self._free, counts=self._effort.counts
        )

    def near(
        self, motions: Sequence[tuple[Array, Array]], t: Array, dearest: float = np.inf
    ) -> MotionOnNodes | None:
        """Return the best motion near the cheapest of some, on nodes at times t (N + 1,).

        For q and q̇ (N + 1, n) of each there.

        Where what is best freely breaks conditions, also near motions from its start whose
        self-motion goes towards the middle of the joints' limits. None where there is none that
        keeps them, or it would cost more than `dearest`.
        """
        grid = self.grid(t)
        near = [grid.near(q, qd) for q, qd in motions]
        motion = min((one for one in near if one), key=aim_of, default=None)
        return None if motion is None else self.best_near(motion, dearest)

    def best_near(self, motion: NodeMotion, dearest: float = np.inf) -> MotionOnNodes | None:
        """Return the best motion near one of nodes, likewise."""
        grid = motion.grid
        # Of what is infinite, or depends on accelerations in other ways, there is no curvature.
        if not np.isfinite(motion.aim) or grid.cost.bends_by_rates(motion.partials):
            return None
        first = self._at_once(motion)
        freely = self._minimise(motion, first)
        best = self._kept(freely, first)
        if best is not None or self._ended is not None:
            return best
        if freely.motion.cost >= dearest:
            # With conditions it would cost more still.
            self.is_hopeless = True
            return None
        broken = broken_by(freely.motion)
        if too_much(freely.motion, broken):
            return None
        if not self._free and (freely.motion.orders[broken] == 0).any():
            best = self._towards_middle(grid, freely.motion)
        dearest = np.inf if best is None else best.cost
        found = None if self._ended else self._from_free(freely, dearest)
        return min((one for one in (best, found) if one), key=cost_of, default=None)

    def again(self, standing: MotionOnNodes) -> MotionOnNodes | None:
        """Return the optimum near a motion on its nodes."""
        optimum = self._minimise(standing.motion, standing.columns, prices=standing.prices)
        return self._kept(optimum, standing.columns) or self._bound(optimum, standing.columns)

    def settled(self, standing: MotionOnNodes) -> MotionOnNodes:
        """Return the optimum on nodes so near to each other that the cost is right.

        With one more between each two, put onto the path.
        """
        dearest, most = np.inf, most_nodes(self._problem)
        for _ in range(NODE_ROUNDS):
            if self._ended is not None or 2 * standing.steps > most:
                break
            motion = standing.motion
            off, size = abs(motion.exact_cost - motion.cost), abs(motion.exact_cost)
            where = None
            if off <= NODE_AGREEMENT * size:
                finer = standing.refined()
                # That is on the path, also between the nodes.
                ends = motion.ends_of_limits
                is_last = not (ends.any() and self._saves(motion, dearest))
                if is_last and not standing.columns.size:
                    # Where nothing binds, smooth velocities are all there is to look at.
                    smooth = finer.smoothed(motion.exact_cost + SAME_COST * size)
                    if smooth is not None:
                        return smooth
                broken = finer.motion.broken() & self._worth_refining(finer)
                if is_last and not broken.any():
                    return finer.smoothed(finer.cost) or finer
                dearest = motion.cost
                each = broken.reshape(-1, 2).any(axis=1)
                where = np.convolve(each, np.ones(3), "same") > 0.0 if each.any() else ends
            # One halving makes it about a twelfth.
            far = off > FAR_OFF * NODE_AGREEMENT * size
            twice = where is None and far and 4 * standing.steps <= most
            finer = standing.refined(where, 2 if twice else 1)
            if where is not None and broken.any():
                # A limit begins or ends to bind there: that wants to be known well.
                finer = finer.refined(np.repeat(where, 1 + where))
            found = self.again(finer)
            if found is None:
                break
            standing = found
        return standing

    @staticmethod
    def _worth_refining(standing: MotionOnNodes) -> Flags:
        """Return between which nodes more of them may keep the conditions better, (N,).

        Where a tolerance begins and ends to be used fully, velocities have a kink: on very short
        intervals, what Newton's method leaves of it are rates that no limit allows.
        """
        steps = np.diff(standing.motion.grid.t)
        kinks = standing.motion.grid.conditions.any_at_once
        return np.asarray((steps * MOST_FINER > steps.max()) | (not kinks))

    @staticmethod
    def _at_once(motion: NodeMotion) -> Ints:
        """Return the columns of conditions that count from the beginning."""
        motion.h  # noqa: B018  # which columns there are is known then
        return motion.grid.conditions.at_once()

    def _saves(self, motion: NodeMotion, before: float) -> bool:
        """Whether more nodes where limits begin and end to bind may lower the cost."""
        return before - motion.cost > COST_AGREEMENT * abs(motion.cost)

    def _towards_middle(self, grid: NodeGrid, known: NodeMotion) -> MotionOnNodes | None:
        """Return what is best near motions whose self-motion goes towards the limits' middle.

        Not where that is what is known already, and does not keep the conditions.
        """
        robot, start = self._problem.robot, known.place.q[0]
        limited = np.isfinite(robot.lower) & np.isfinite(robot.upper)
        middle = start.copy()
        middle[limited] = 0.5 * (robot.lower[limited] + robot.upper[limited])
        for share in TOWARDS_MIDDLE:
            motion = grid.motion_towards(start, middle, share * self._problem.path.duration)
            if motion is not None and self._ended is None:
                first = self._at_once(motion)
                optimum = self._minimise(motion, first)
                best = self._kept(optimum, first)
                same = abs(optimum.motion.cost - known.cost) <= COST_AGREEMENT * abs(known.cost)
                if best is not None or same:
                    return best
        return None

    def _kept(self, optimum: Optimum, columns: Ints = _NO_COLUMNS) -> MotionOnNodes | None:
        """Return the optimum if it is one, and keeps all conditions."""
        motion = optimum.motion
        none = (
            optimum.status is Status.GRADIENT or not meets_ends(motion) or broken_by(motion).any()
        )
        return None if none else self._standing(optimum, columns)

    def _from_free(self, freely: Optimum, dearest: float) -> MotionOnNodes | None:
        """Return the optimum that keeps all conditions, from one that keeps none."""
        motion = freely.motion
        orders = motion.orders
        if (orders[broken_by(motion)] < 2).all():
            return self._bound(freely, self._at_once(motion), dearest)
        most = self._effort.max_evaluations
        if most is not None and most < FEWEST_WITH_ACCELERATIONS:
            return None
        smooth = motion.grid.continuous.near(motion.place.q, motion.place.qd)
        if smooth is None:
            return None
        motion = self._minimise(smooth, self._at_once(smooth), dearest).motion
        # One such limit leads to the next: all count at once.
        every = (orders == 2) & ~motion.grid.conditions.of_bodies()
        columns = np.flatnonzero(every | broken_by(motion) | nearly_broken(motion))
        columns = np.union1d(columns, self._at_once(motion))
        return self._bound(self._minimise(motion, columns, dearest), columns, dearest)

    def _bound(
        self, optimum: Optimum, columns: Ints, dearest: float = np.inf
    ) -> MotionOnNodes | None:
        """Return the optimum that keeps all conditions, from one that keeps some columns of them.

        None where none is found, or would be dearer than that.
        """
        while self._ended is None and optimum.status in _ARRIVED:
            motion = optimum.motion
            broken = broken_by(motion)
            if not meets_ends(motion):
                return None
            if not broken.any():
                return self._standing(optimum, columns)
            if broken[columns].any():
                return None
            columns = np.union1d(columns, np.flatnonzero(broken | nearly_broken(motion)))
            if too_much(motion, columns):
                return None
            optimum = self._minimise(motion, columns, dearest)
        return None

    def _minimise(
        self,
        motion: NodeMotion,
        columns: Ints,
        dearest: float = np.inf,
        prices: Array | None = None,
    ) -> Optimum:
        def told(step: Step) -> bool:
            # Where another motion is known, a way of short steps is not worth it.
            short = dearest < np.inf and 0.0 < step.length < SHORT_STEP
            return self._told(step) or step.motion.cost > dearest or short

        return minimise(motion, columns, told, prices)

    def _told(self, step: Step) -> bool:
        """Note an iteration; return whether to stop."""
        effort, motion = self._effort, step.motion
        iteration = Iteration(
            x=motion.nu.ravel(),
            cost=motion.cost,
            gradient_norm=step.slope,
            update="newton",
            step=step.length,
            evaluations=effort.counts.evaluations,
        )
        self.history.append(iteration)
        if meets_ends(motion) and (motion.h <= motion.grid.conditions.tolerances).all():
            none = np.zeros((len(motion.h), 0))
            self.latest = MotionOnNodes(motion, Status.STOPPED, _NO_COLUMNS, none, (), None)
        if effort.callback is not None and effort.callback(iteration):
            self._ended = Status.STOPPED
        most = effort.max_evaluations
        if most is not None and effort.counts.evaluations >= self._first + most:
            self._ended = Status.MAX_EVALUATIONS
        return self._ended is not None

    def _standing(self, optimum: Optimum, columns: Ints) -> MotionOnNodes:
        # What keeps the conditions, and leads no further, is as good as it gets.
        arrived = optimum.status if optimum.status in _ARRIVED else Status.PRECISION
        return MotionOnNodes.of(optimum, self._constraints, columns, self._ended or arrived)
