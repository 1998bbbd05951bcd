"""What the optimisations of one plan share: optimiser, callback, limits, and the clock."""

import time
from dataclasses import dataclass

from selfmotion.basics import Counts, Progress, as_called, obey_interruption
from selfmotion.optimise import Callback, Optimizer


@dataclass
class Deadline(Counts):
    """Counts of work that look at the clock: when it is over, the best so far has to do.

    It interrupts once, at an evaluation of the cost or between two stages: what is left to do then,
    such as judging the motion, is done.

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
        """Return the one so many seconds from now; None for none."""
        return cls() if seconds is None else cls(end=time.perf_counter() + seconds)

    def evaluated(self) -> None:
        """See `Counts.evaluated`; KeyboardInterrupt where the deadline has passed."""
        super().evaluated()
        self.check()

    def check(self) -> None:
        """Raise KeyboardInterrupt, once, if it is over; also where Ctrl-C was pressed."""
        obey_interruption()
        if not self.passed and time.perf_counter() >= self.end:
            self.passed = True
            raise KeyboardInterrupt

    def checked_by(self, progress: Progress) -> Progress:
        """Return a progress that looks at the clock as well; ProblemError for no function."""
        as_called(progress, "progress")

        def told(stage: str, done: int, total: int) -> None:
            progress(stage, done, total)
            self.check()

        return told


@dataclass(frozen=True)
class Effort:
    """What all candidates of a plan share.

    Attributes
    ----------
    optimizer : Optimizer or None
        Of the published method, where one is asked for.
    callback : callable or None
        Called with each `Iteration`.
    max_evaluations : int or None
        Limit on evaluations of each candidate.
    counts : Counts
        Where work is added up.
    apart : bool
        Whether the optimisation keeps the arm apart from itself where only the default asks for it.
    """

    optimizer: Optimizer | None
    callback: Callback | None
    max_evaluations: int | None
    counts: Counts
    apart: bool = False
