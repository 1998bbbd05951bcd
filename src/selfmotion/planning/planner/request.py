"""A problem, and how to plan it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import ProblemError, as_choice
from selfmotion.certificate import Tolerance
from selfmotion.planning.optimise import Optimizer
from selfmotion.planning.planner.effort import Search
from selfmotion.planning.planner.fastest import Fastest, fastest
from selfmotion.planning.planner.parts import plan_in_parts
from selfmotion.planning.planner.run import plan
from selfmotion.planning.result import Parts, Plan, retime
from selfmotion.problem.problem import Problem

# Goals (see `PlanRequest.goal`), options without effect on them, and their names.
_UNUSED = {
    "best": ("keep", "parts"),
    "retimed": ("keep", "parts"),
    "fastest": ("parts", "optimizer", "max_evaluations"),
    "parts": ("keep", "search", "optimizer", "max_evaluations"),
}
GOALS = tuple(_UNUSED)
_CALLED = {"parts": "a motion in parts"}


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """A problem, and how to plan it: what a problem file says.

    Attributes
    ----------
    problem : Problem
    search : Search or None
    optimizer : Optimizer or None
    tolerance : Tolerance or None
    max_evaluations : int or None
        See `plan`.
    outputs : tuple of Path
        Files to write.
    goal : {"best", "retimed", "fastest", "parts"}
        Goal of `plan`: the best motion by its costs, that at its fastest pace (`retime`), or the
        `fastest` one. Of parts (`plan_in_parts`) it is `in_parts`.
    parts : mapping, optional
        Of parts: ``retreat``, ``axis`` and ``ramp`` of `plan_in_parts`.
    keep : mapping, optional
        Costs that the fastest motion keeps; see `fastest`.
    notes : tuple of str
        What was taken for granted, or passed over, of the files that its own names.
    """

    problem: Problem
    search: Search | None = None
    optimizer: Optimizer | None = None
    tolerance: Tolerance | None = None
    max_evaluations: int | None = None
    outputs: tuple[FilePath, ...] = ()
    goal: str = "best"
    parts: Mapping[str, Any] | None = None
    keep: Mapping[str, float] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        as_choice(self.goal, "goal", GOALS)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes before planning: its own, and `Problem.remarks`."""
        return (*self.notes, *self.problem.remarks)

    @property
    def settings(self) -> dict[str, Any]:
        """Options of `plan` besides the problem."""
        names = ("search", "optimizer", "tolerance", "max_evaluations")
        return {name: getattr(self, name) for name in names}

    def plan(self, **options: Any) -> Plan:
        """Plan it; `options` are further ones of `plan`, or of `fastest` where that is the goal.

        Raises
        ------
        ProblemError
            The goal is a motion in parts, or something that is set has no effect on it.
        """
        if self.goal == "parts":
            raise ProblemError(
                "goal: is 'parts', of which there may be several: PlanRequest.in_parts()"
            )
        self.check_used(self.goal)
        if self.goal == "fastest":
            return self.fastest(**options).plan
        found = plan(self.problem, **{**self.settings, **options})
        return retime(found) if self.goal == "retimed" else found

    def fastest(self, **options: Any) -> Fastest:
        """Return its fastest motion; `options` are further ones of `fastest`.

        Raises
        ------
        ProblemError
            Something that is set has no effect on it: an optimiser, parts.
        """
        self.check_used("fastest")
        given = {"keep": self.keep, "search": self.search, "tolerance": self.tolerance, **options}
        return fastest(self.problem, **given)

    def in_parts(self, **options: Any) -> Parts:
        """Return its motion in the fewest parts; `options` are further ones of `plan_in_parts`.

        Raises
        ------
        ProblemError
            Something that is set has no effect on it: a search, an optimiser, costs to keep.
        """
        self.check_used("parts")
        given = {**(self.parts or {}), "tolerance": self.tolerance, **options}
        return plan_in_parts(self.problem, **given)

    def check_used(self, goal: str) -> None:
        """Raise ProblemError for options that have no effect on a goal."""
        for name in _UNUSED[goal]:
            if getattr(self, name) is not None:
                said = {"optimizer": "optimiser"}.get(name, name)
                called = _CALLED.get(goal, f"the {goal} motion")
                raise ProblemError(f"{said}: has no effect on {called}; leave it out")
