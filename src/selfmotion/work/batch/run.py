"""Planning of many problems by processes or an executor, into a folder that a later run resumes."""

import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selfmotion.basics import (
    PlanError,
    ProblemError,
    SelfmotionError,
    as_called,
    as_number,
    as_path,
    as_whole,
    check_executor,
    shown,
    silent,
)
from selfmotion.planning.planner import PlanRequest
from selfmotion.problem.problem import Problem
from selfmotion.work.batch.folder import Folder
from selfmotion.work.batch.items import Item, problem_items
from selfmotion.work.batch.rows import Row
from selfmotion.work.batch.worker import begin_process, plan_described

# Problems submitted per worker, so that none waits for the next one.
_PER_WORKER = 2
# Problems submitted at a time to an executor of unknown size.
_WINDOW = 64
# Environment variables that set the number of threads of linear algebra.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_Result = tuple[dict[str, Any], bytes]


@dataclass(frozen=True)
class BatchProgress:
    """How far a batch is.

    Attributes
    ----------
    done, total : int
        Problems, those of earlier runs among them.
    failed : int
        Those without a plan.
    rate : float
        Problems per second in this run.
    seconds_left : float
        Estimated from the rate; infinite before there is one.
    """

    done: int
    total: int
    failed: int
    rate: float
    seconds_left: float


@dataclass(frozen=True)
class Batch:
    """Results of many problems.

    Attributes
    ----------
    rows : tuple of Row
        In the order of the problems.
    folder : Path
        Has ``table.csv`` and ``index.html``, and the plans in ``plans``.
    resumed : int
        How many of them an earlier run had finished.
    best_files : tuple of Path
        Of each file with a grid, the problem file of its best combination, where one is verified.
    """

    rows: tuple[Row, ...]
    folder: Path
    resumed: int
    best_files: tuple[Path, ...] = ()

    @property
    def best(self) -> Row | None:
        """The verified plan of the lowest cost, or the fastest if that was asked for; or None."""
        verified = [row for row in self.rows if row.verified]
        return min(verified, key=lambda row: row.rank, default=None)


def plan_many(
    problems: Iterable[Problem | PlanRequest],
    executor: Executor | None = None,
    *,
    out: str | Path,
    workers: int | None = None,
    replays: int = 0,
    deadline: float | None = None,
    progress: Callable[[BatchProgress], object] = silent,
    **options: Any,
) -> Batch:
    """Plan many problems, each in one of several processes, into a folder.

    Plans are written as they end. Run again with the same folder, those that are finished are not
    replanned; so a run that was killed goes on where it stopped. A problem that cannot be
    planned, or that kills its worker, does not stop the others: its row says why.

    Parameters
    ----------
    problems : iterable of Problem or PlanRequest
        Files that a job would write are left out: plans go to the folder.
    executor : concurrent.futures.Executor, optional
        Where to run: for example ``distributed.Client(address).get_executor()``, or mpi4py's
        ``MPIPoolExecutor()``. selfmotion must be installed there. By default processes on this
        machine; a script then needs ``if __name__ == "__main__":``.
    out : path
        The folder.
    workers : int, optional
        How many processes on this machine, by default one for each core.
    replays : int
        Of how many of the best plans to write a replay.
    deadline : float, optional
        Time by the clock after which each plan ends with the best so far [s]. Those that it left
        without a verified motion are planned again by the next run with the same folder.
    progress : callable, optional
        Called with a `BatchProgress` whenever a problem is finished.
    options
        Of `plan`, for problems that are no jobs: ``search``, ``optimizer``, ``tolerance``,
        ``max_evaluations``.

    Returns
    -------
    Batch

    Raises
    ------
    ProblemError
        An item is no problem, or an argument is not what it should be, or has no effect.
    PlanError
        The executor that was given broke; what was finished by then is in the folder.
    """
    if not isinstance(problems, Iterable):
        raise ProblemError(f"problems are {shown(problems)}, expected a list of problems")
    items = problem_items(list(problems), options)
    return plan_items(
        items,
        executor,
        out=out,
        workers=workers,
        replays=replays,
        deadline=deadline,
        progress=progress,
    )


def plan_items(
    items: Sequence[Item],
    executor: Executor | None = None,
    *,
    out: str | Path,
    workers: int | None = None,
    replays: int = 0,
    deadline: float | None = None,
    progress: Callable[[BatchProgress], object] = silent,
) -> Batch:
    """Plan items as `plan_many` plans problems."""
    check_executor(executor)
    as_called(progress, "progress")
    replays = as_whole(replays, "replays", 0, 10**9)
    if deadline is not None:
        deadline = as_number(deadline, "deadline", above=0.0)
    if workers is not None:
        workers = as_whole(workers, "workers", 1, 10**6)
        if executor is not None:
            raise ProblemError("workers: has no effect where an executor is given; leave it out")
    folder = Folder(as_path(out))
    run = _Run(folder, items, progress, deadline)
    pending = deque(items)
    if executor is not None:
        if run.run_on(executor, pending, _WINDOW):
            raise PlanError(
                f"the executor broke after {len(run.rows)} of {len(items)} problems; what is "
                f"finished is in '{folder.path}': run again to go on"
            )
    else:
        run.run_on_processes(pending, workers or os.cpu_count() or 1)
    rows = tuple(run.rows[item.name] for item in items)
    folder.write_tables(rows, replays)
    return Batch(rows, folder.path, run.resumed, _write_best(items, run.rows, folder.path))


def _write_best(items: Sequence[Item], rows: Mapping[str, Row], folder: Path) -> tuple[Path, ...]:
    """Write the best combination of each file with a grid as a problem file."""
    best: dict[Path, tuple[Row, Callable[[Path], None]]] = {}
    for item in items:
        row = rows[item.name]
        if item.file is not None and item.write is not None and row.verified:
            candidate = row, item.write
            best[item.file] = min(
                best.get(item.file, candidate), candidate, key=lambda each: each[0].rank
            )
    written = []
    for file, (_, write) in best.items():
        target = folder / f"{file.stem}-best{file.suffix}"
        write(target)
        written.append(target)
    return tuple(written)


class _Run:
    """One run of a batch: the rows that are finished, and the progress.

    Attributes
    ----------
    rows : dict
        By the name of the item.
    resumed : int
        How many an earlier run had finished.
    """

    def __init__(
        self,
        folder: Folder,
        items: Sequence[Item],
        progress: Callable[[BatchProgress], object],
        deadline: float | None,
    ) -> None:
        self.rows: dict[str, Row] = {}
        self._folder, self._items, self._progress = folder, items, progress
        self._deadline = deadline
        self._began, self.resumed = time.monotonic(), 0

    def run_on(self, executor: Executor, pending: deque[Item], window: int) -> list[Item]:
        """Run pending items, `window` at a time; return those at work if the executor breaks."""
        running: dict[Future[_Result], Item] = {}
        while pending or running:
            while pending and len(running) < window:
                item = pending.popleft()
                description = self._description(item)
                if description is None:
                    continue
                try:
                    running[executor.submit(plan_described, description)] = item
                except BrokenExecutor:
                    return [*self._record_finished(running), item]
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                error = future.exception()
                if isinstance(error, BrokenExecutor):
                    return self._record_finished(running)
                item = running.pop(future)
                if error is None:
                    self._finish(item, *future.result())
                else:
                    # The executor's own message: a worker was lost more often than it allows.
                    message = f"{type(error).__name__}: {error}"
                    self._finish(item, {"error": message, "fault": True}, b"")
        return []

    def _description(self, item: Item) -> dict[str, Any] | None:
        """Return what a worker needs to plan an item; None if there is nothing to do."""
        row = self._folder.finished(item)
        if row is not None:
            self.rows[item.name] = row
            self.resumed += 1
            item.drop_description()
            return None
        try:
            return {**item.description, "deadline": self._deadline}
        except SelfmotionError as error:
            self._finish(item, {"error": str(error)}, b"")
            return None

    def run_on_processes(self, pending: deque[Item], workers: int) -> None:
        """Run pending items in processes; where one dies, start new ones for the items it left."""
        suspects: deque[Item] = deque()
        while pending or suspects:
            with processes(workers) as pool:
                # One of these killed its worker. Each runs alone: a second death says which one.
                while suspects:
                    suspect = suspects.popleft()
                    if self.run_on(pool, deque([suspect]), 1):
                        message = (
                            "its process died twice, the second time with nothing else at work"
                        )
                        self._finish(suspect, {"error": message, "fault": True}, b"")
                        break
                else:
                    suspects.extend(self.run_on(pool, pending, _PER_WORKER * workers))

    def _record_finished(self, running: dict[Future[_Result], Item]) -> list[Item]:
        """Record the items that had been finished when the executor broke; return the others."""
        lost = []
        for future, item in running.items():
            if future.done() and not future.cancelled() and future.exception() is None:
                self._finish(item, *future.result())
            else:
                lost.append(item)
        return lost

    def _finish(self, item: Item, result: dict[str, Any], archive: bytes) -> None:
        """Record the result of an item in the folder, and report the progress."""
        file = self._folder.plan_file(item.name)
        goal = item.description["options"]["goal"] if archive else "best"
        row = Row(item.name, item.key, file, dict(item.settings), goal=goal, **result)
        self.rows[item.name] = self._folder.record(row, archive)
        item.drop_description()
        done, total = len(self.rows), len(self._items)
        rate = (done - self.resumed) / max(time.monotonic() - self._began, 1e-9)
        failed = sum(bool(row.error) for row in self.rows.values())
        self._progress(BatchProgress(done, total, failed, rate, (total - done) / rate))


@contextmanager
def processes(workers: int) -> Iterator[Executor]:
    """Return processes of this machine, each with one thread for linear algebra."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    # Read by the libraries when they are loaded, in the new processes.
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update({name: value or "1" for name, value in before.items()})
    try:
        with ProcessPoolExecutor(
            workers, multiprocessing.get_context("spawn"), initializer=begin_process
        ) as pool:
            try:
                yield pool
            except BaseException:
                # Whoever stops a batch waits for the plans at work, not for those in line.
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
