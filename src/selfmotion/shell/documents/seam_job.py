"""A job as its file states it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from selfmotion.basics import ProblemError, SelfmotionError
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints import NO_OVERLAP, as_clearances
from selfmotion.problem.problem import Problem
from selfmotion.work.job import FASTEST_FEED, Program, Seam, highest_feed, plan_job, problem_of_seam


@dataclass(frozen=True, eq=False)
class SeamJob:
    """A job as its file states it: an arm, seams, and settings of the planner.

    Attributes
    ----------
    robot : RobotModel
    seams : tuple of Seam
    settings : mapping
        What `plan_job` is given besides.
    at_feed : callable or None
        Of a file that asks for the highest feed: feed [m/s] → the job at that one.
    most_feed : float
        How fast that may be at most [m/s].
    unjudged : tuple of str
        What nothing is asked of, as of files of machine tools; programs say it.
    notes : tuple of str
        Of keys that are called otherwise by now, and as of `PlanRequest`.
    """

    robot: RobotModel
    seams: tuple[Seam, ...]
    settings: Mapping[str, Any]
    at_feed: Callable[[float], "SeamJob"] | None = None
    most_feed: float = FASTEST_FEED
    unjudged: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes before planning, see `Problem.remarks`; of alike ones that of the first seam."""
        remarks: dict[str, str] = {}
        for seam in self.seams:
            try:
                problem = self._problem(seam)
            except SelfmotionError:
                # The reason is reported when the seam is planned.
                continue
            for remark in problem.remarks:
                remarks.setdefault(remark.split(" at t =")[0], f"seam '{seam.name}': {remark}")
        return (*self.notes, *remarks.values())

    @cached_property
    def problems(self) -> tuple[Problem, ...]:
        """The problem of each seam alone, without what others leave behind."""
        return tuple(map(self._problem, self.seams))

    def _problem(self, seam: Seam) -> Problem:
        clearances = as_clearances(self.settings.get("clearance", NO_OVERLAP))
        return problem_of_seam(self.robot, seam, self.settings["constraints"], clearances)

    def plan(self, **options: Any) -> Program:
        """Plan it; `options` are further ones of `plan_job`. At the highest feed if that is asked.

        See `highest_feed`.
        """
        at_feed = self.at_feed
        if at_feed is not None:
            if options.get("deadline") is not None:
                raise ProblemError(
                    "deadline: has no effect where the highest feed is looked for, which plans "
                    "several jobs; give a feed, or leave it out"
                )
            return highest_feed(lambda feed: at_feed(feed).plan(**options), self.most_feed).program
        program = plan_job(self.robot, self.seams, **{**self.settings, **options})
        return replace(program, unjudged=self.unjudged)
