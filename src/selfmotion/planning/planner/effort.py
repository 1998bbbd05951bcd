"""Options of a plan besides its problem, shared by all its optimisations."""

import time
from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from selfmotion.basics import (
    Counts,
    Progress,
    as_called,
    as_choice,
    as_number,
    as_whole,
    obey_interruption,
    random_numbers,
)
from selfmotion.planning.optimise import Callback, Optimizer

_MODES = ("auto", "local", "global")


@dataclass(frozen=True)
class Search:
    """Initial guesses of a free start.

    Parameters
    ----------
    starts : int
        Largest number: for redundancy 1 along all self-motions of the first pose, else of the
        solutions of Newton's method from twice as many seeds.
    finalists : int
        Largest number of starts that are optimised to the end: those with the best rough optima on
        few nodes. With as many as `starts`, starts are not screened.
    mode : {"auto", "local", "global"}
        Optimise from many starts (local), or from the best sequences over all self-motions: sampled
        evenly where the redundancy is 1, at random where it is more.
        ``"auto"``: from many starts first, and from
        sequences where none of them leads to a motion that keeps the constraints.
    compare : bool
        Search globally whatever the other search finds, also with a given start, for `Report.gap`:
        the distance of the plan from the best motion of all. Needs redundancy 1.
    rng : Generator or int
        Shifts the seeds; the same one gives the same plan.

    Raises
    ------
    ProblemError
        A number is below 1, or the mode unknown.
    """

    starts: int = 48
    finalists: int = 3
    mode: str = "auto"
    compare: bool = False
    rng: np.random.Generator | int = 0

    def __post_init__(self) -> None:
        for name in ("starts", "finalists"):
            as_whole(getattr(self, name), f"search: {name}", 1, 10**6)
        as_choice(self.mode, "search: mode", _MODES)
        random_numbers(self.rng)


@dataclass
class Deadline(Counts):
    """Counters of work that raise KeyboardInterrupt at the deadline.

    Once, at an evaluation of the cost or between two stages: the work after it, such as the
    judgement of the motion, is done.

    Attributes
    ----------
    end : float
        By the clock `time.perf_counter` [s]; inf for none.
    passed : bool
        Whether it has interrupted.
    """

    end: float = float("inf")
    passed: bool = False

    @classmethod
    def after(cls, seconds: float | None) -> "Deadline":
        """Return the deadline in `seconds` from now, None for none; ProblemError for no time."""
        if seconds is None:
            return cls()
        return cls(end=time.perf_counter() + as_number(seconds, "deadline", above=0.0))

    @override
    def evaluated(self) -> None:
        """KeyboardInterrupt where the deadline has passed."""
        super().evaluated()
        self.check()

    def check(self) -> None:
        """Raise KeyboardInterrupt, once, if it is over; also where Ctrl-C was pressed."""
        obey_interruption()
        if not self.passed and time.perf_counter() >= self.end:
            self.passed = True
            raise KeyboardInterrupt

    def checked_by(self, progress: Progress) -> Progress:
        """Return a progress that checks the deadline as well; ProblemError for no function."""
        as_called(progress, "progress")

        def checked(stage: str, done: int, total: int) -> None:
            progress(stage, done, total)
            self.check()

        return checked


@dataclass(frozen=True)
class Effort:
    """Options that all candidates of a plan share.

    Attributes
    ----------
    optimizer : Optimizer or None
        Of the published method; None where Newton's method on nodes is used.
    callback : callable or None
        Called with each `Iteration`.
    max_evaluations : int or None
        Limit on evaluations of each candidate.
    counts : Counts
        Counters of the work.
    apart : bool
        Whether the default clearance of the arm from itself is a constraint of the optimisation.
    decomposed : bool
        Whether links are convex pieces before obstacles, not hulls.
    """

    optimizer: Optimizer | None
    callback: Callback | None
    max_evaluations: int | None
    counts: Counts
    apart: bool = False
    decomposed: bool = False

    @property
    def keeps_conditions(self) -> bool:
        """Whether all conditions are kept; the published method keeps given ends alone."""
        return self.optimizer is None
