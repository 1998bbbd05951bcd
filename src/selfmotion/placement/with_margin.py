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
from selfmotion.margins import Margin, Shortfall, Shortfalls, shortfalls
from selfmotion.planning import plan
from selfmotion.problem import Problem, check_problem
from selfmotion.result import Plan

# How often pairs are kept farther apart, or less far; and by how much more than what lacks [m].
_ROUNDS, _MORE = 12, 2e-5
# What is proved of a margin is a share less than it is; that much more than is wanted will do.
_SHARE, _ENOUGH = 0.02, 0.01
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
    apart = dict[tuple[str, str], float]()
    last, best, refused = first, None, ""
    found = shortfalls(first, margin, named, **asked)
    if not found.items and not problem.relaxations:
        best = first, found, dict(apart)
    for number in range(0 if best else _ROUNDS):
        progress("margin", number + 1, _ROUNDS)
        _adjust(apart, found, clearance)
        raised = narrow.changed(constraints=(*narrow.constraints, *_kept(problem, apart)))
        again = plan(raised, warm_start=last, **options)
        if not number:
            # Past bodies there are several ways, and the one of before may have become the longer.
            again = min(again, plan(raised, **options), key=_rank)
        certificate = problem.certify(again.trajectory, first.tolerance)
        made = replace(again, problem=problem, certificate=certificate)
        if not again.certificate.verified:
            refused = again.certificate.verdict.removeprefix("not verified: ")
            # The attempt may be nearer to it all the same.
            if certificate.verified:
                more = shortfalls(made, margin, named, **asked)
                if more.least > found.least:
                    last, found = made, more
            break
        last, found = made, shortfalls(made, margin, named, **asked)
        if found.items:
            continue
        if best is None or made.report.cost < best[0].report.cost:
            best = made, found, dict(apart)
        if not apart or found.least <= 1.0 + _ENOUGH:
            break
    last, found, apart = best or (last, found, apart)
    refused = "" if best else refused
    return PlanWithMargin(
        last, margin, named, found.items, last.report.cost, first.report.cost, apart, refused
    )


def _rank(found: Plan) -> tuple[bool, float]:
    return not found.certificate.verified, found.report.cost


def _adjust(apart: dict[tuple[str, str], float], found: Shortfalls, clearance: float) -> None:
    """Keep pairs farther apart where a margin is missing, and less far where it is more.

    To first order a displacement that is a share larger uses that share more of the distance.
    """
    spare = found.least - 1.0
    for pair in apart if spare > 0.0 else ():
        apart[pair] -= spare * (apart[pair] - clearance)
    for item in found.items:
        pair = (min(item.pair), max(item.pair))
        if pair in apart:
            apart[pair] += (1.0 - item.scale) * item.used + _MORE
        else:
            apart[pair] = clearance + (1.0 + _SHARE) * item.used


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
