"""A limit on the time that a plan takes, kept as an interruption is."""

import time
from dataclasses import dataclass

from selfmotion.basics import Counts, Progress, as_called, obey_interruption


@dataclass
class Deadline:
    """When the best so far has to do.

    It interrupts once, at an evaluation of the cost or between two stages: what is left to do then,
    such as judging the motion, is done.

    Attributes
    ----------
    end : float
        By the clock `time.perf_counter` [s].
    passed : bool
        Whether it has interrupted.
    """

    end: float
    passed: bool = False

    @classmethod
    def after(cls, seconds: float) -> "Deadline":
        """Return the one so many seconds from now."""
        return cls(time.perf_counter() + seconds)

    def check(self) -> None:
        """Raise KeyboardInterrupt, once, if it is over; also where Ctrl-C was pressed."""
        obey_interruption()
        if not self.passed and time.perf_counter() >= self.end:
            self.passed = True
            raise KeyboardInterrupt

    def telling(self, progress: Progress) -> Progress:
        """Return a progress that looks at the clock as well; ProblemError for no function."""
        as_called(progress, "progress")

        def told(stage: str, done: int, total: int) -> None:
            progress(stage, done, total)
            self.check()

        return told


@dataclass
class TimedCounts(Counts):
    """Counts that look at the clock whenever the cost is evaluated."""

    deadline: Deadline | None = None

    def evaluated(self) -> None:
        """See `Counts.evaluated`; KeyboardInterrupt where the deadline has passed."""
        super().evaluated()
        if self.deadline is not None:
            self.deadline.check()
