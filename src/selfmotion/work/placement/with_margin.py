"""Motions with a margin for displacements of part, tool or base, and the cost of the margin.

The clearance of the pair of bodies that would collide first is raised by the missing distance. Then
the motion is planned again, and its margin computed (`margins`). So no pair has more clearance than
it needs.
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
from selfmotion.problem.constraints import Clearance, separate_clearances
from selfmotion.problem.problem import Problem, check_problem
from selfmotion.work.margins import Margin, Shortfall, Shortfalls, shortfalls

# Rounds in which the clearances of pairs are adapted.
_ROUNDS = 12
# Clearance beyond the missing margin [m].
_EXTRA_CLEARANCE = 2e-5
# Largest share of the margin by which its proof may fall short.
_PROOF_SHARE = 0.02
# Excess over the required margin that ends the rounds, as a share.
_EXCESS_SHARE = 0.01
# What may be displaced.
_SUBJECTS = ("part", "tool", "base")
# Why the search ended, after Ctrl-C.
_INTERRUPTED = "it was interrupted"


@dataclass(frozen=True, eq=False)
class PlanWithMargin:
    """A motion with a margin, and the cost of the margin.

    Attributes
    ----------
    plan : Plan
        Of the given problem, with its own certificate.
    wanted : Margin
    of : tuple of str
        What may be displaced.
    shortfalls : tuple of Shortfall
        Where the margin is not reached; empty where it is proved.
    cost, cost_without : float
        Of this plan, and of the best one that was found without a margin.
    kept_apart : dict
        Pair of bodies → the clearance that it was planned with [m].
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
        """Whether the margin is proved, of a verified motion."""
        return self.plan.certificate.verified and not self.shortfalls

    @property
    def extra_cost(self) -> float:
        """The added cost as a share of the cost without the margin; 0 if none was needed."""
        return self.cost / self.cost_without - 1.0 if self.cost_without else 0.0

    def __str__(self) -> str:
        """Return whether the margin is reached, and its cost, in words."""
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
    """Plan a motion that stays valid for displacements up to a size; return it with its cost.

    Bands of tolerances (`Relaxation`) are narrowed by what the displacement may use of them.

    Parameters
    ----------
    problem : Problem
        With a clearance.
    margin : Margin
        All displacements up to both of its sizes at once.
    of : str or sequence of str
        ``"part"``, ``"tool"``, ``"base"``: each alone may be displaced by that much.
    part, tool, center, clearance
        As `selfmotion.margin` takes them.
    progress : callable, optional
        Called with ``("margin", round, rounds)``.
    **options
        Of `plan`, for each round: search, tolerance, deadline.

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
        An argument is not what it should be; or a band is narrower than the margin.
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
    margin_options: dict[str, Any] = {
        "part": part,
        "tool": tool,
        "center": about,
        "clearance": clearance,
    }
    first = plan(problem, **options).require()
    # The given warm start is for the first plan only.
    options.pop("warm_start", None)
    search = _MarginSearch(
        problem, first, partial(shortfalls, wanted=margin, of=named, **margin_options)
    )
    search.run(margin, clearance, options, progress)
    result = search.best or search.last
    return PlanWithMargin(
        result.plan,
        margin,
        named,
        result.shortfalls.items,
        result.plan.report.cost,
        search.cost_without,
        result.clearances,
        "" if search.best else search.refused,
    )


class _Trial(NamedTuple):
    """A plan, its shortfalls, and the clearances of pairs that it was planned with [m]."""

    plan: Plan
    shortfalls: Shortfalls
    clearances: dict[tuple[str, str], float]


class _MarginSearch:
    """Rounds with larger clearances of pairs of bodies, until the margin is reached.

    Parameters
    ----------
    problem : Problem
    first : Plan
        Verified, without a margin.
    shortfalls_of : callable
        Plan → its shortfalls.

    Attributes
    ----------
    last : _Trial
        The last plan that was judged.
    best : _Trial or None
        The cheapest one with the margin.
    cost_without : float
        Lowest cost of a verified motion without the margin.
    refused : str
        Why the rounds ended without the margin.
    """

    def __init__(
        self, problem: Problem, first: Plan, shortfalls_of: Callable[[Plan], Shortfalls]
    ) -> None:
        self._problem, self._first, self._shortfalls_of = problem, first, shortfalls_of
        self.last = _Trial(first, shortfalls_of(first), {})
        self.best: _Trial | None = None
        self.cost_without, self.refused = first.report.cost, ""

    def run(
        self, margin: Margin, clearance: float, options: dict[str, Any], progress: Progress
    ) -> None:
        """Go through the rounds."""
        problem, first = self._problem, self._first
        # Before a round: a band that is narrower than the margin is an error.
        narrow = problem.changed(relaxations=_narrowed(problem, margin, self.last.shortfalls.lever))
        if not self.last.shortfalls.items and not problem.relaxations:
            self.best = self.last
            return
        if _is_interrupted(first):
            self.refused = _INTERRUPTED
            return
        for number in range(_ROUNDS):
            progress("margin", number + 1, _ROUNDS)
            clearances = _adjusted(self.last.clearances, self.last.shortfalls, clearance)
            # Clearances of single pairs replace the clearance of the problem for these pairs.
            _, raised_clearances = separate_clearances(
                _pair_clearances(problem, clearances), narrow.clearance
            )
            raised = narrow.changed(clearance=raised_clearances)
            again = plan(raised, warm_start=self.last.plan, **options)
            if not number and not _is_interrupted(again):
                # Past bodies there are several routes; another one may be shorter now.
                again = min(again, plan(raised, **options), key=_by_verdict_and_cost)
            if self._take(again, clearances):
                return
        if self.best is None:
            self.refused = f"{_ROUNDS} rounds were not enough"

    def _take(self, again: Plan, clearances: dict[tuple[str, str], float]) -> bool:
        """Take in the plan of a round; return whether the rounds end with it.

        It is judged by the given problem, and is the best one where it has the margin and is
        cheaper.
        """
        certificate = self._problem.certify(again.trajectory, self._first.tolerance)
        plan_now = replace(again, problem=self._problem, certificate=certificate)
        if certificate.verified:
            # Motions with larger clearances are valid without a margin, too.
            self.cost_without = min(self.cost_without, again.report.cost)
        if not again.certificate.verified:
            self.refused = again.certificate.verdict.removeprefix("not verified: ")
            self._take_refused(plan_now, clearances)
            return True
        last = self.last = _Trial(plan_now, self._shortfalls_of(plan_now), clearances)
        is_reached = not last.shortfalls.items
        if is_reached and (self.best is None or again.report.cost < self.best.plan.report.cost):
            self.best = last
        if _is_interrupted(again):
            self.refused = _INTERRUPTED
            return True
        is_tight = not clearances or last.shortfalls.least <= 1.0 + _EXCESS_SHARE
        return is_reached and is_tight

    def _take_refused(self, plan: Plan, clearances: dict[tuple[str, str], float]) -> None:
        """Take in a plan that does not keep the larger clearances.

        It may still be verified for the given problem, and have more margin than the last plan.
        """
        if plan.certificate.verified:
            found = self._shortfalls_of(plan)
            if found.least > self.last.shortfalls.least:
                self.last = _Trial(plan, found, clearances)


def _is_interrupted(plan: Plan) -> bool:
    return plan.report.status is Status.INTERRUPTED


def _by_verdict_and_cost(plan: Plan) -> tuple[bool, float]:
    """Return the order of plans: verified ones first, then by cost."""
    return not plan.certificate.verified, plan.report.cost


def _adjusted(
    clearances: dict[tuple[str, str], float], shortfalls: Shortfalls, clearance: float
) -> dict[tuple[str, str], float]:
    """Return larger clearances where the margin is missing, smaller ones where it is exceeded.

    To first order the distance that a displacement uses is proportional to its size.
    """
    spare = max(shortfalls.least - 1.0, 0.0)
    adjusted = {pair: far - spare * (far - clearance) for pair, far in clearances.items()}
    raised: dict[tuple[str, str], float] = {}
    for item in shortfalls.items:
        pair = (min(item.pair), max(item.pair))
        far = (
            adjusted[pair] + (1.0 - item.scale) * item.used + _EXTRA_CLEARANCE
            if pair in adjusted
            else clearance + (1.0 + _PROOF_SHARE) * item.used
        )
        # Several clearances may have a pair: it is raised once, by the one that lacks most.
        raised[pair] = max(far, raised.get(pair, far))
    return {**adjusted, **raised}


def _narrowed(problem: Problem, margin: Margin, lever: float) -> tuple[Any, ...]:
    """Return tolerances without what the displacement may use of them."""
    narrowed = []
    for item in problem.relaxations:
        turns = item.rows[0].startswith("r")
        used = margin.rotation if turns else margin.position + lever * margin.rotation
        if item.band <= used:
            raise ProblemError(
                f"plan_with_margin: the band of {', '.join(item.rows)} is {item.band:.3g}, of "
                f"which the margin would use {used:.3g}; ask less, or allow more"
            )
        narrowed.append(replace(item, band=item.band - used))
    return tuple(narrowed)


def _pair_clearances(problem: Problem, clearances: dict[tuple[str, str], float]) -> list[Clearance]:
    """Return clearances of single pairs of bodies."""
    pair_clearances = []
    bodies = {body.name: body for item in problem.clearances for body in item.obstacles}
    for pair, distance in clearances.items():
        obstacles = tuple(bodies[name] for name in pair if name in bodies)
        every = dict.fromkeys(CollisionModel(problem.robot, obstacles).pairs)
        others = tuple(names for names in every if set(names) != set(pair))
        pair_clearances.append(Clearance(obstacles, distance, disabled=others))
    return pair_clearances
