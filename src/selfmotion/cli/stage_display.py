"""Which stage is running: a bar on a terminal, a line per stage in a log."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TextColumn,
    TimeElapsedColumn,
)

from selfmotion.optimise import Iteration

# Of shorter stages it is not said how long they will last [s].
_WORTH_SAYING = 2.0


class Display:
    """A bar on a terminal, gone when it ends; what a log shows instead is for who derives it.

    Parameters
    ----------
    console : Console
    columns : ProgressColumn
        Of the bar.
    """

    def __init__(self, console: Console, *columns: ProgressColumn) -> None:
        self._console = console
        # A log would get the bar once, when all is over.
        self._progress = Progress(
            *columns, console=console, transient=True, disable=not console.is_terminal
        )
        self._bar = self._progress.add_task("", total=None)

    def __enter__(self) -> Self:
        """Begin to show."""
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave the terminal as it was."""
        self._progress.stop()


class StageDisplay(Display):
    """Shows what `plan` tells: its `stage` is a progress callback, its `iteration` the other one.

    Parameters
    ----------
    console : Console
    """

    def __init__(self, console: Console) -> None:
        super().__init__(
            console,
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TimeElapsedColumn(),
        )
        self._stage = self._about = self._count = self._cost = self._left = ""
        self._began = 0.0

    def stage(self, stage: str, done: int, total: int) -> None:
        """Show that number `done` of `total` in a stage has begun; of 0, news that stay.

        How long the others will last, if as long as those before.
        """
        if total == 0:
            self._console.print(stage, markup=False, highlight=False, soft_wrap=True)
            return
        stage, quote, about = stage.partition(" '")
        if stage != self._stage:
            self._stage, self._cost, self._began = stage, "", time.monotonic()
            if not self._console.is_terminal:
                self._console.print(f"{stage} 1 of {total}" if total > 1 else stage, markup=False)
        self._about = quote + about
        self._count = f" {done} of {total}" if total > 1 else ""
        spent = time.monotonic() - self._began
        left = spent * (total - done + 1) / (done - 1) if done > 1 else 0.0
        told = f", {spent:.0f} s so far, about {left:.0f} s to go"
        self._left = told if spent + left > _WORTH_SAYING else ""
        self._progress.update(self._bar, completed=done - 1, total=total if total > 1 else None)
        self._describe()

    def iteration(self, iteration: Iteration) -> None:
        """Show the cost so far."""
        self._cost = f", cost {iteration.cost:.6g}"
        self._describe()

    def _describe(self) -> None:
        said = self._stage + self._count + self._about + self._left + self._cost
        self._progress.update(self._bar, description=said)
