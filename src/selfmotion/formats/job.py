"""A problem and how to plan it, as a file says it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import ProblemError
from selfmotion.certificate import Tolerance
from selfmotion.optimise import Optimizer
from selfmotion.planning import Fastest, Search, fastest, plan, plan_in_parts
from selfmotion.problem import Problem
from selfmotion.result import Parts, Plan, retime

# What is looked for; see `Job.goal`.
GOALS = ("best", "retimed", "fastest", "parts")


@dataclass(frozen=True, eq=False)
class Job:
    """What a problem file says: a problem, and how to plan it.

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
        What `plan` looks for: the motion that is best by its costs, that at its fastest pace
        (`retime`), or the `fastest` one. Of parts (`plan_in_parts`) it is `in_parts`.
    parts : mapping, optional
        Of parts: ``retreat``, ``axis`` and ``ramp`` of `plan_in_parts`.
    keep : mapping, optional
        Costs that the fastest motion keeps; see `fastest`.
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

    @property
    def settings(self) -> dict[str, Any]:
        """What `plan` is given besides the problem."""
        names = ("search", "optimizer", "tolerance", "max_evaluations")
        return {name: getattr(self, name) for name in names}

    def plan(self, **options: Any) -> Plan:
        """Plan it; `options` are further ones of `plan`, or of `fastest` where that is the goal.

        Raises
        ------
        ProblemError
            The goal is a motion in parts.
        """
        if self.goal == "parts":
            raise ProblemError("goal: is 'parts', of which there may be several: Job.in_parts()")
        if self.goal == "fastest":
            return self.fastest(**options).plan
        found = plan(self.problem, **{**self.settings, **options})
        return retime(found) if self.goal == "retimed" else found

    def fastest(self, **options: Any) -> Fastest:
        """Return its fastest motion; `options` are further ones of `fastest`.

        Raises
        ------
        ProblemError
            The file has settings of an optimiser, which `fastest` has not.
        """
        self._refuse(("optimizer", "max_evaluations"), "the fastest motion")
        asked = {"keep": self.keep, "search": self.search, "tolerance": self.tolerance, **options}
        return fastest(self.problem, **asked)

    def in_parts(self, **options: Any) -> Parts:
        """Return its motion in the fewest parts; `options` are further ones of `plan_in_parts`.

        Raises
        ------
        ProblemError
            The file has settings of a search or an optimiser, which `plan_in_parts` has not.
        """
        self._refuse(("search", "optimizer", "max_evaluations"), "a motion in parts")
        given = {**(self.parts or {}), "tolerance": self.tolerance, **options}
        return plan_in_parts(self.problem, **given)

    def _refuse(self, names: tuple[str, ...], what: str) -> None:
        for name in names:
            if getattr(self, name) is not None:
                said = {"optimizer": "optimiser"}.get(name, name)
                raise ProblemError(f"{said}: has no effect on {what}; leave it out")
