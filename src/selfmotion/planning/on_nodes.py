"""A motion of nodes that stands."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.constraints import ActiveConstraint, Priced, active_of, penalised, violated
from selfmotion.motion import Evaluation, Grid, NodeNullMotion, NullMotion
from selfmotion.nodes import NodeMotion, Optimum
from selfmotion.optimise import Status
from selfmotion.planning.settings import ENDS_MET, LEAST_SAVING
from selfmotion.search import BESIDE


@dataclass(frozen=True, eq=False)
class MotionOnNodes:
    """A motion of nodes that stands: the best that was found near a start.

    Attributes
    ----------
    motion : NodeMotion
    status : Status
    prices : (R,)
        Of all rows of its conditions.
    remaining : float or None
        What more nodes and another step might still save [cost]; None where that is not known.
    optimum : Optimum or None
        What it was found as; None of what is none.
    is_chain : bool
        Whether it is a chain of the global search, which is at its optimum.
    """

    motion: NodeMotion
    status: Status
    prices: Array
    remaining: float | None = None
    optimum: Optimum | None = None
    is_chain: bool = False

    @classmethod
    def of(cls, optimum: Optimum, status: Status) -> "MotionOnNodes":
        """Return what stands at an optimum."""
        motion: NodeMotion = optimum.motion
        promised = optimum.promised if np.isfinite(optimum.promised) else 0.0
        away = motion.grid.rows.given_away(optimum.prices, motion.curve_ends)
        return cls(motion, status, optimum.prices, promised + float(away.sum()), optimum)

    @classmethod
    def on_the_way(cls, motion: NodeMotion) -> "MotionOnNodes":
        """Return what stands where a motion has to do that keeps the conditions."""
        return cls(motion, Status.STOPPED, np.zeros(len(motion.h)))

    @cached_property
    def active(self) -> tuple[ActiveConstraint, ...]:
        """What kept the optimum from a lower cost; on the way to one, prices say nothing."""
        return _binding(self.optimum) if self.optimum is not None and self.has_arrived else ()

    @property
    def has_arrived(self) -> bool:
        """Whether it is an optimum, and no motion on the way to one."""
        return self.optimum is None or self.optimum.status in (Status.CONVERGED, Status.PRECISION)

    @property
    def steps(self) -> int:
        """Intervals between the nodes."""
        return len(self.motion.grid.t) - 1

    @property
    def null_motion(self) -> NullMotion:
        """The null motion's functions: of its values at the nodes, for each joint."""
        return NodeNullMotion(tuple(self.motion.grid.t / self.motion.grid.t[-1]))

    @property
    def coefficients(self) -> Array:
        """The null motion at the nodes, joint by joint."""
        return self.motion.epsilon.T.ravel()

    @property
    def cost(self) -> float:
        """F."""
        return self.motion.cost

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the arm does where only the default asks it to, at the nodes and by meshes."""
        return self.motion.grid.problem.keeps_off_itself(self.motion.place.q)

    @cached_property
    def violations(self) -> tuple[str, ...]:
        """See `Standing.violations`."""
        motion = self.motion
        ends = np.abs(motion.c).max(initial=0.0)
        # Written so that NaN is not kept.
        if motion.violation <= 0.0 and ends <= ENDS_MET:
            return ()
        # What control points exceed, the curve may keep.
        return violated(motion.grid.constraints, motion.checked)

    def merit(self) -> float:
        """See `Standing.merit`."""
        motion = self.motion
        if motion.violation <= 0.0:
            return self.cost
        return penalised(self.cost, motion.grid.constraints, motion.checked)

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        motion = self.motion
        found = Evaluation(self.coefficients, motion.terms, motion.trajectory, damped=False)
        motion.forget()
        return found

    def after(self, before: float) -> "MotionOnNodes":
        """Return it as what came of a motion on fewer nodes that cost so much."""
        remaining = (self.remaining or 0.0) + max(before - self.cost, 0.0)
        return replace(self, remaining=remaining)

    def on(self, t: Array) -> "MotionOnNodes | None":
        """Return it on other nodes (N + 1,); None where one of them is out of reach.

        Beside a singular pose the path may be so, by next to nothing: a little later it is not.
        """
        beside, new = t.copy(), ~np.isin(t, self.motion.grid.t)
        beside[new] += BESIDE * np.diff(t, append=t[-1])[new]
        calm = self.motion.would_be_calm()
        for times in (t, beside):
            motion = self.motion.on(self.motion.grid.on(times, calm=calm))
            if motion is not None:
                prices = motion.grid.rows.carried(self.motion.grid.rows, self.prices)
                self.motion.forget()
                return replace(self, motion=motion, prices=prices)
        return None

    def refined(self, where: Flags | None = None) -> "MotionOnNodes":
        """Return it with all intervals halved, or some (N,); as it is where that cannot be."""
        return self.on(Grid(self.motion.grid.t).halved(where).nodes) or self


def _binding(optimum: Optimum) -> tuple[ActiveConstraint, ...]:
    """Return what kept an optimum from a lower cost."""
    if not (optimum.prices.any() or optimum.end_prices.size):
        return ()
    motion, grid = optimum.motion, optimum.motion.grid
    inner = iter(grid.rows.priced(optimum.prices, motion.curve_ends))
    ends = grid.ends.by_item(optimum.end_prices)
    each = []
    for item in grid.constraints:
        if item.equality:
            own = ends[id(item)][None]
            each.append(Priced(item, own, np.zeros(1), np.ones(own.shape, dtype=np.bool_)))
        else:
            each.append(next(inner))
    return active_of(each, grid.t[[0, -1]], LEAST_SAVING * abs(motion.cost))
