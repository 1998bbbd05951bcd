"""A motion of nodes that stands: an optimum that keeps the conditions."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.constraints import Binding, BoundConstraint
from selfmotion.engine import Conditions, Evaluation
from selfmotion.motion import Grid, NodeNullMotion, NullMotion
from selfmotion.nodes import NodeMotion, Optimum
from selfmotion.optimise import Status
from selfmotion.planning.settings import LEAST_SAVING, MOST_UNEVEN
from selfmotion.search import BESIDE


@dataclass(frozen=True, eq=False)
class MotionOnNodes:
    """A motion of nodes that stands: an optimum that keeps the conditions.

    Attributes
    ----------
    motion : NodeMotion
    status : Status
    columns : (c,)
        Of the conditions: those that counted.
    prices : (N + 1, c)
        Of these, on the nodes of the optimum.
    active : tuple of Binding
    remaining : float or None
        What a finer grid and another step might still save [cost]; None where that is not known.
    is_chain : bool
        Whether it is a chain of the global search, which is at its optimum.
    """

    motion: NodeMotion
    status: Status
    columns: Ints
    prices: Array
    active: tuple[Binding, ...]
    remaining: float | None
    is_chain: bool = False

    @classmethod
    def of(
        cls,
        optimum: Optimum,
        constraints: Sequence[BoundConstraint],
        columns: Ints,
        status: Status,
    ) -> "MotionOnNodes":
        """Return what stands at an optimum, for which some columns of the conditions counted."""
        motion: NodeMotion = optimum.motion
        active: tuple[Binding, ...] = ()
        if columns.size or optimum.end_prices.size:
            active = _binding(optimum, constraints, columns)
        promised = optimum.promised if np.isfinite(optimum.promised) else 0.0
        remaining = abs(motion.exact_cost - motion.cost) + promised
        return cls(motion, status, columns, optimum.prices, active, remaining)

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
        return self.motion.exact_cost

    @cached_property
    def keeps_off_itself(self) -> bool:
        """Whether the arm does where only the default asks it to, at the nodes and by meshes."""
        return self.motion.grid.problem.keeps_off_itself(self.motion.place.q)

    @property
    def violations(self) -> tuple[str, ...]:
        """None: nothing else stands on nodes."""
        return ()

    def merit(self) -> float:
        """Return the cost."""
        return self.cost

    def evaluation(self) -> Evaluation:
        """Return the motion with its costs."""
        motion = self.motion
        found = Evaluation(self.coefficients, motion.exact_terms, motion.trajectory, damped=False)
        motion.forget()
        return found

    def smoothed(self, dearest: float) -> "MotionOnNodes | None":
        """Return it with smooth velocities; None where it costs more then, or breaks conditions."""
        motion = self.motion.smoothed()
        if not motion.exact_cost <= dearest or motion.broken().any():
            return None
        motion.forget()
        return replace(self, motion=motion)

    def refined(self, where: Flags | None = None, times: int = 1) -> "MotionOnNodes":
        """Return it with more nodes: all intervals halved so many times, or some (N,) once."""
        t = self.motion.grid.t
        self.motion.forget()
        finer = Grid(t).halved(where).graded(MOST_UNEVEN).nodes
        for _ in range(1, times):
            finer = Grid(finer).halved().nodes
        motion = self.motion.on(self.motion.grid.on(finer))
        if motion is None:
            # Beside a singular pose the path may be out of reach, by next to nothing.
            finer = Grid(t).halved(where, BESIDE).nodes
            motion = self.motion.on(self.motion.grid.on(finer))
        if motion is None:
            return self
        # Prices are of conditions at nodes: the more there are, the less each counts.
        near = np.searchsorted(t, finer, side="right") - 1
        prices = self.prices[near] * (len(t) / len(finer))
        return replace(self, motion=motion, prices=prices)


def _binding(
    optimum: Optimum, constraints: Sequence[BoundConstraint], columns: Ints
) -> tuple[Binding, ...]:
    """Return what kept an optimum from a lower cost, of some columns of the conditions."""
    motion, grid = optimum.motion, optimum.motion.grid
    prices = np.zeros_like(motion.h)
    prices[:, columns] = optimum.prices
    inner = iter(grid.conditions.by_constraint(prices))
    ends = grid.ends.by_item(optimum.end_prices)
    each = [ends[id(item)] if item.equality else next(inner).ravel() for item in constraints]
    return Conditions(constraints, Grid(grid.t)).active(
        motion.samples.checked,
        np.concatenate([np.zeros(0), *each]),
        LEAST_SAVING * abs(motion.cost),
    )
