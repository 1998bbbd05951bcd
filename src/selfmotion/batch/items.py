"""What a batch plans: problems with names, or what is wrong with them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError, ProblemError, SelfmotionError, read_document
from selfmotion.costs import FunctionCost
from selfmotion.documents import Job, grid_documents, job_of
from selfmotion.problem import Problem, problem_to_dict
from selfmotion.result import files_of, key_of, own_modules, told

# What `plan` may be given besides each problem.
OPTIONS = ("search", "optimizer", "tolerance", "max_evaluations")


@dataclass(frozen=True, eq=False)
class Item:
    """One of many problems.

    Attributes
    ----------
    name : str
        Of its files.
    make : callable
        Returns the job; may raise what is wrong with it.
    settings : dict
        What tells it from the others: keys of the grid and their values.
    file : Path or None
        The problem file whose grid it is of.
    """

    name: str
    make: Callable[[], Job]
    settings: Mapping[str, Any] = field(default_factory=dict)
    file: Path | None = None

    @cached_property
    def task(self) -> dict[str, Any]:
        """What a worker is sent.

        Raises
        ------
        SelfmotionError
            The problem is none, or cannot be sent.
        """
        job = self.make()
        lost = [cost.name for cost in job.problem.costs if isinstance(cost, FunctionCost)]
        if lost:
            raise ProblemError(
                f"cost '{lost[0]}' is a function, which cannot be sent to another process; derive "
                f"a class from selfmotion.costs.Cost"
            )
        problem = problem_to_dict(job.problem)
        # A class in a script that is run is known to processes that begin with it alone.
        modules = [name for name in own_modules(problem) if name != "__main__"]
        options = {**job.settings, "goal": job.goal, "keep": job.keep, "parts": job.parts}
        files = files_of(job.problem.robot, job.problem.all_constraints, {})
        return {"problem": problem, "options": options, "modules": modules, "files": files}

    def forget(self) -> None:
        """Let go of the task, which is large and not needed any more."""
        self.__dict__.pop("task", None)

    @cached_property
    def key(self) -> str:
        """A digest of all that decides the plan."""
        try:
            task = self.task
        except SelfmotionError as error:
            return f"error: {error}"
        return key_of((task["problem"], told(task["options"])), task["files"])


def grid_items(file: Path, *, allow_code: bool = False) -> list[Item]:
    """Return an item for each problem of a file's ``[grid]``, or the one of a file without.

    Raises
    ------
    FileFormatError
        The file cannot be read, or its grid is none. What is wrong with single problems is said
        by their rows.
    """
    memory: dict[str, Any] = {}
    document = read_document(file)
    try:
        found = grid_documents(document)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
    digits = len(str(len(found) - 1))

    def maker(document: dict[str, Any]) -> Callable[[], Job]:
        return lambda: job_of(document, file, allow_code=allow_code, memory=memory)

    return [
        Item(f"{file.stem}-{k:0{digits}d}" if settings else file.stem, maker(one), settings, file)
        for k, (one, settings) in enumerate(found)
    ]


def problem_items(problems: list[Problem | Job], options: Mapping[str, Any]) -> list[Item]:
    """Return an item for each problem; ProblemError for what is none."""
    for name in options:
        if name not in OPTIONS:
            raise ProblemError(f"{name}: is no option of a batch; expected {', '.join(OPTIONS)}")
        if problems and all(isinstance(given, Job) for given in problems):
            raise ProblemError(f"{name}: has no effect: each problem is a Job, which says its own")
    digits = len(str(max(len(problems) - 1, 0)))
    items = []
    for k, given in enumerate(problems):
        if not isinstance(given, Problem | Job):
            raise ProblemError(f"problems[{k}] is {given!r}, expected a Problem or a Job")
        job = given if isinstance(given, Job) else Job(given, **options)
        items.append(Item(f"plan-{k:0{digits}d}", lambda job=job: job))  # type: ignore[misc]
    return items
