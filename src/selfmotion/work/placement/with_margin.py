"""Motions that leave room for what may stand elsewhere, and what that room costs.

What would be met first by a part, tool or base that is displaced is kept farther apart, by as much
as it lacks; then the motion is planned again, and judged as any other (`margins`). So no pair is
kept farther apart than it has to be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

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
from selfmotion.model.collision import CollisionModel
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner import plan
from selfmotion.planning.result import Plan
from selfmotion.problem.constraints import Clearance, said_once
from selfmotion.problem.problem import Problem, check_problem
from selfmotion.work.margins import Margin, Shortfall, Shortfalls, shortfalls

# Rounds in which the clearances of pairs are adapted.
_ROUNDS = 12
# Clearance beyond the missing margin [m].
_MORE = 2e-5
# Share of a margin that its proof may lose.
_SHARE = 0.02
# Excess over the required margin that ends the rounds, as a share.
_ENOUGH = 0.01
_SUBJECTS = ("part", "tool", "base")
# Why there is no more of it, after Ctrl-C.
_INTERRUPTED = "it was interrupted"


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
        Of this plan, and of the best one that was found without a margin.
    kept_apart : dict
        Pair of bodies → distance that they were kept apart by for this plan [m].
    refused : str
        The reason why the margin is not reached; "" if it is.
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
        """The added cost as a share of the cost without the margin; 0 if none was needed."""
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
            why = f"; no more was found: {self.refused}" if self.refused else ""
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
        For `plan`: search, tolerance, deadline, each time.

    Returns
    -------
    PlanWithMargin
        Also where the margin is not reached: `reached` and `shortfalls` say so. After Ctrl-C what
        was found by then.

    Raises
    ------
    PlanError
        There is no verified motion without a margin.
    ProblemError
        An argument is not what it should be; or a band is narrower than what is asked.
    KeyboardInterrupt
        It was interrupted before there was a motion.
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
    given: dict[str, Any] = {"part": part, "tool": tool, "center": about, "clearance": clearance}
    first = plan(problem, **options).require()
    # The given warm start is for the first plan only.
    options.pop("warm_start", None)
    search = _MarginSearch(problem, first, partial(shortfalls, wanted=margin, of=named, **given))
    search.run(margin, clearance, options, progress)
    told = search.best or search.now
    return PlanWithMargin(
        told.plan,
        margin,
        named,
        told.found.items,
        told.plan.report.cost,
        search.without,
        told.apart,
        "" if search.best else search.refused,
    )


class _Made(NamedTuple):
    """A plan, what it lacks, and how far which pairs were kept apart for it [m]."""

    plan: Plan
    found: Shortfalls
    apart: dict[tuple[str, str], float]


class _MarginSearch:
    """Rounds in which pairs of bodies are kept farther apart, until a margin is there.

    Parameters
    ----------
    problem : Problem
    first : Plan
        Verified, without a margin.
    lacks : callable
        Plan → what it lacks of the margin.

    Attributes
    ----------
    now : _Made
        The last plan.
    best : _Made or None
        The cheapest one with the margin.
    without : float
        Least cost that is known of a motion without a margin.
    refused : str
        Why no round came after the last one.
    """

    def __init__(self, problem: Problem, first: Plan, lacks: Callable[[Plan], Shortfalls]) -> None:
        self._problem, self._first, self._lacks = problem, first, lacks
        self.now = _Made(first, lacks(first), {})
        self.best: _Made | None = None
        self.without, self.refused = first.report.cost, ""

    def run(
        self, margin: Margin, clearance: float, options: dict[str, Any], progress: Progress
    ) -> None:
        """Go through the rounds."""
        problem, first = self._problem, self._first
        narrow = problem.changed(relaxations=_narrowed(problem, margin, self.now.found.lever))
        if not self.now.found.items and not problem.relaxations:
            self.best = self.now
            return
        if _is_interrupted(first):
            self.refused = _INTERRUPTED
            return
        for number in range(_ROUNDS):
            progress("margin", number + 1, _ROUNDS)
            apart = _adjusted(self.now.apart, self.now.found, clearance)
            # Pairs of bodies take the place of the default.
            _, kept = said_once(_kept(problem, apart), narrow.clearance)
            raised = narrow.changed(clearance=kept)
            again = plan(raised, warm_start=self.now.plan, **options)
            if not number and not _is_interrupted(again):
                # Past bodies there are several ways, and the one of before may have become longer.
                again = min(again, plan(raised, **options), key=_rank)
            if self._is_done(again, apart):
                break

    def _is_done(self, again: Plan, apart: dict[tuple[str, str], float]) -> bool:
        """Take a round's plan; return whether it was the last one."""
        certificate = self._problem.certify(again.trajectory, self._first.tolerance)
        plan_now = replace(again, problem=self._problem, certificate=certificate)
        if certificate.verified:
            # A motion that keeps pairs farther apart is one without a margin, too.
            self.without = min(self.without, again.report.cost)
        if not again.certificate.verified:
            self.refused = again.certificate.verdict.removeprefix("not verified: ")
            # The attempt may be nearer to it all the same.
            if certificate.verified:
                more = self._lacks(plan_now)
                if more.least > self.now.found.least:
                    self.now = _Made(plan_now, more, apart)
            return True
        now = self.now = _Made(plan_now, self._lacks(plan_now), apart)
        has_it = not now.found.items
        if has_it and (self.best is None or again.report.cost < self.best.plan.report.cost):
            self.best = now
        if _is_interrupted(again):
            self.refused = _INTERRUPTED
            return True
        return has_it and (not apart or now.found.least <= 1.0 + _ENOUGH)


def _is_interrupted(found: Plan) -> bool:
    return found.report.status is Status.INTERRUPTED


def _rank(found: Plan) -> tuple[bool, float]:
    return not found.certificate.verified, found.report.cost


def _adjusted(
    apart: dict[tuple[str, str], float], found: Shortfalls, clearance: float
) -> dict[tuple[str, str], float]:
    """Keep pairs farther apart if a margin is missing, and less far if it is larger than needed.

    To first order a displacement that is a share larger uses that share more of the distance.
    """
    spare = max(found.least - 1.0, 0.0)
    kept = {pair: far - spare * (far - clearance) for pair, far in apart.items()}
    for item in found.items:
        pair = (min(item.pair), max(item.pair))
        if pair in kept:
            kept[pair] += (1.0 - item.scale) * item.used + _MORE
        else:
            kept[pair] = clearance + (1.0 + _SHARE) * item.used
    return kept


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
    bodies = {body.name: body for item in problem.clearances for body in item.obstacles}
    for pair, distance in apart.items():
        own = tuple(bodies[name] for name in pair if name in bodies)
        every = dict.fromkeys(CollisionModel(problem.robot, own).pairs)
        others = tuple(names for names in every if set(names) != set(pair))
        found.append(Clearance(own, distance, disabled=others))
    return found
