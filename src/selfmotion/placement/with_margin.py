"""Motions that leave room for what may stand elsewhere, and what that room costs.

What would be met first by a part, tool or base that is displaced is kept farther apart, by as much
as it lacks; then the motion is planned again, and judged as any other (`margins`). So no pair is
kept farther apart than it has to be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    ProblemError,
    Progress,
    as_called,
    as_number,
    as_numbers,
    shown,
    silent,
)
from selfmotion.collision import CollisionModel
from selfmotion.constraints import Clearance
from selfmotion.margins import Margin, Shortfall, shortfalls
from selfmotion.planning import plan
from selfmotion.problem import Problem, check_problem
from selfmotion.result import Plan

# How often pairs are kept farther apart; and by how much more than what is lacking [m], [share]:
# what is proved of a margin is a fiftieth less than it is.
_ROUNDS, _MORE, _SHARE = 8, 2e-4, 0.04
_SUBJECTS = ("part", "tool", "base")


@dataclass(frozen=True, eq=False)
class PlanWithMargin:
    """A motion that leaves a margin, and what it costs.

    Attributes
    ----------
    plan : Plan
        Of the problem that was asked, with its own certificate.
    wanted : Margin
    of : tuple of str
        What may be displaced by that much.
    shortfalls : tuple of Shortfall
        What is left to be wished; empty where the margin is there, proved.
    cost, cost_without : float
        Of this plan, and of the best one without a margin.
    kept_apart : dict
        Pair of bodies → distance that they were kept apart by for it [m].
    refused : str
        Why no motion keeps them that far apart; "" where one does.
    """

    plan: Plan
    wanted: Margin
    of: tuple[str, ...]
    shortfalls: tuple[Shortfall, ...]
    cost: float
    cost_without: float
    kept_apart: dict[tuple[str, str], float]
    refused: str = ""

    @property
    def reached(self) -> bool:
        """Whether the margin is there, in a verified motion."""
        return self.plan.certificate.verified and not self.shortfalls

    @property
    def extra_cost(self) -> float:
        """What the margin costs, as a share of the cost without; 0 where it was there anyway."""
        return self.cost / self.cost_without - 1.0 if self.cost_without else 0.0

    def __str__(self) -> str:
        """Return whether the margin is there, and what it costs, in words."""
        wanted = (
            f"{self.wanted.position * 1e3:.3g} mm and {np.degrees(self.wanted.rotation):.3g}° of "
            f"{', '.join(self.of)}"
        )
        if not self.plan.certificate.verified:
            return f"no margin of {wanted}: {self.plan.certificate.verdict}"
        costs = f"cost {self.cost:.6g}, {self.cost_without:.6g} without ({self.extra_cost:+.2%})"
        if self.shortfalls:
            lacks = "; ".join(str(item) for item in self.shortfalls)
            why = f"; no motion keeps more: {self.refused}" if self.refused else ""
            return f"no margin of {wanted}: {lacks}{why}; {costs}"
        return f"margin of {wanted}, proved; {costs}"

    __repr__ = __str__


def plan_with_margin(
    problem: Problem,
    margin: Margin,
    *,
    of: str | Sequence[str] = "part",
    part: Sequence[str] | None = None,
    tool: Sequence[str] | None = None,
    center: npt.ArrayLike | None = None,
    clearance: float = 0.0,
    progress: Progress = silent,
    **options: Any,
) -> PlanWithMargin:
    """Plan a motion that survives displacements of a size, and say what that costs.

    Bands of tolerances (`Relaxation`) are planned with as much less as the displacement may use.

    Parameters
    ----------
    problem : Problem
        One that keeps bodies apart.
    margin : Margin
        All displacements up to both of its sizes at once.
    of : str or sequence of str
        ``"part"``, ``"tool"``, ``"base"``: each alone may be displaced by that much.
    part, tool, center, clearance
        As `selfmotion.margin` takes them.
    progress : callable, optional
        Told the round, as plans tell their stages.
    **options
        For `plan`: search, tolerance, deadline.

    Returns
    -------
    PlanWithMargin
        Also where the margin is not reached: `reached` and `shortfalls` say so.

    Raises
    ------
    PlanError
        There is no verified motion without a margin.
    ProblemError
        An argument is not what it should be; or a band is narrower than what is asked.
    """
    check_problem(problem)
    as_called(progress, "progress")
    if not isinstance(margin, Margin):
        raise ProblemError(f"plan_with_margin: margin is {shown(margin)}, expected a Margin")
    named = (of,) if isinstance(of, str) else tuple(of)
    if not named or not set(named) <= set(_SUBJECTS):
        raise ProblemError(f"plan_with_margin: of is {shown(of)}, expected {', '.join(_SUBJECTS)}")
    as_number(clearance, "plan_with_margin: clearance", least=0.0)
    about = None if center is None else as_numbers(center, "center", "(3,) [m]", (3,))
    asked: dict[str, Any] = {"part": part, "tool": tool, "center": about, "clearance": clearance}
    first = plan(problem, **options).require()
    narrow = problem.changed(
        relaxations=_narrowed(problem, margin, shortfalls(first, margin, named, **asked).lever)
    )
    best, apart, refused = first, dict[tuple[str, str], float](), ""
    found = shortfalls(best, margin, named, **asked)
    for number in range(_ROUNDS):
        if not found.items and (number or not problem.relaxations):
            break
        progress("margin", number + 1, _ROUNDS)
        for item in found.items:
            wanted = clearance + (1.0 + _SHARE) * item.used + _MORE
            pair = (min(item.pair), max(item.pair))
            apart[pair] = max(apart.get(pair, 0.0), wanted)
        raised = narrow.changed(constraints=(*narrow.constraints, *_kept(problem, apart)))
        before = best
        again = plan(raised, warm_start=best, **options)
        best = replace(
            again, problem=problem, certificate=problem.certify(again.trajectory, first.tolerance)
        )
        if not again.certificate.verified:
            refused = again.certificate.verdict.removeprefix("not verified: ")
            if not best.certificate.verified:
                best = before
                break
            # The attempt may be nearer to it all the same.
            more = shortfalls(best, margin, named, **asked)
            if more.least > found.least:
                found = more
            else:
                best = before
            break
        found = shortfalls(best, margin, named, **asked)
    return PlanWithMargin(
        best, margin, named, found.items, best.report.cost, first.report.cost, apart, refused
    )


def _narrowed(problem: Problem, margin: Margin, lever: float) -> tuple[Any, ...]:
    """Return tolerances of which a displacement may use its part."""
    found = []
    for item in problem.relaxations:
        turns = item.rows[0].startswith("r")
        used = margin.rotation if turns else margin.position + lever * margin.rotation
        if item.band <= used:
            raise ProblemError(
                f"plan_with_margin: the band of {', '.join(item.rows)} is {item.band:.3g}, of "
                f"which the margin would use {used:.3g}; ask less, or allow more"
            )
        found.append(replace(item, band=item.band - used))
    return tuple(found)


def _kept(problem: Problem, apart: dict[tuple[str, str], float]) -> list[Clearance]:
    """Return clearances of single pairs of bodies."""
    found = []
    bodies = {
        body.name: body
        for item in (*problem.constraints, problem.clearance)
        if isinstance(item, Clearance)
        for body in item.obstacles
    }
    for pair, distance in apart.items():
        own = tuple(bodies[name] for name in pair if name in bodies)
        every = dict.fromkeys(CollisionModel(problem.robot, own).pairs)
        others = tuple(names for names in every if set(names) != set(pair))
        found.append(Clearance(own, distance, disabled=others))
    return found
