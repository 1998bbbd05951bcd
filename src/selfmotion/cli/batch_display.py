"""How far a batch is, and where it runs."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, TextColumn

import selfmotion as sm
from selfmotion.cli.stage_display import Display

if TYPE_CHECKING:
    from selfmotion.batch import BatchProgress


class BatchDisplay(Display):
    """A bar with rate and time left on a terminal, a line per tenth in a log."""

    def __init__(self, console: Console) -> None:
        super().__init__(console, TextColumn("{task.description}", markup=False), BarColumn())
        self._tenth = 0

    def show(self, found: "BatchProgress") -> None:
        """Show how far it is."""
        text = (
            f"{found.done} of {found.total} problems, {found.failed} without a plan, "
            f"{found.rate:.2f} per second, {found.seconds_left:.0f} s left"
        )
        self._progress.update(self._bar, description=text, completed=found.done, total=found.total)
        tenth = 10 * found.done // found.total
        if not self._console.is_terminal and tenth > self._tenth:
            self._console.print(text, markup=False)
        self._tenth = tenth


def check_cluster(address: str | None, workers: int | None) -> None:
    """Raise ProblemError where processes of this machine are asked for beside a cluster."""
    if address is not None and workers is not None:
        raise sm.errors.ProblemError("--workers has no effect beside --dask, whose workers plan")


@contextmanager
def executor_at(address: str | None) -> Iterator[Executor | None]:
    """Give the executor of a Dask cluster; None without an address.

    Raises
    ------
    ProblemError
        distributed is not installed, or no scheduler answers.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise sm.errors.ProblemError(
            "--dask needs the package distributed: pip install 'selfmotion[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise sm.errors.ProblemError(
            f"--dask: no scheduler answers at '{address}': {error}"
        ) from error
    with client:
        yield client.get_executor()
