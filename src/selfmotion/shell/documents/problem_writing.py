"""From a problem back to its file."""

import dataclasses
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    ProblemError,
    Saved,
    as_path,
    public_name,
    write_document,
)
from selfmotion.planning.optimise import QuasiNewton
from selfmotion.planning.planner import PlanRequest
from selfmotion.problem.problem import Problem, check_problem, problem_to_dict
from selfmotion.shell.documents.named_files import named_from


def write_problem(problem: Problem | PlanRequest, file: str | FilePath) -> None:
    """Write a problem as TOML or JSON that `read_problem` turns into the same problem.

    Of a `PlanRequest` the settings of the search, its goal and outputs are written as well:
    `read_job` turns the file into the same one.

    Raises
    ------
    ProblemError
        It holds a function, which a file cannot carry, or an arm that is in no URDF file; or a
        search begins with a generator of random numbers, or with an optimiser of one's own.
    FileFormatError
        The file cannot be written.
    """
    path = as_path(file)
    if not isinstance(problem, PlanRequest):
        write_document(path, problem_document(problem, path))
        return
    # Plain keys stand before the first table.
    table = _named_beside({**_settings(problem), **problem_table(problem.problem)}, path)
    write_document(path, dict(sorted(table.items(), key=lambda item: isinstance(item[1], dict))))


def problem_document(problem: Problem, file: FilePath) -> dict[str, Any]:
    """Return what a problem file says of a problem; ProblemError as for `write_problem`."""
    check_problem(problem)
    return _named_beside(problem_table(problem), file)


def _named_beside(table: dict[str, Any], file: FilePath) -> dict[str, Any]:
    """Return a table whose files are named from where its own file is."""
    named: dict[str, Any] = named_from(table, FilePath.cwd(), file.parent.resolve())
    return named


def _settings(job: PlanRequest) -> dict[str, Any]:
    """Return the keys that say how a job is planned."""
    table: dict[str, Any] = {}
    if job.goal != "best":
        table["goal"] = job.goal
    if job.outputs:
        table["outputs"] = [str(name) for name in job.outputs]
    if job.max_evaluations is not None:
        table["max_evaluations"] = job.max_evaluations
    if job.parts:
        table["parts"] = {key: _plain(value) for key, value in job.parts.items()}
    if job.keep:
        table["keep"] = {key: float(factor) for key, factor in job.keep.items()}
    if job.search is not None and not isinstance(job.search.rng, int):
        raise ProblemError("search: rng is a generator, which a file cannot carry; give a number")
    if not isinstance(job.optimizer, QuasiNewton | None):
        raise ProblemError(
            f"optimizer: {type(job.optimizer).__name__} is no QuasiNewton, which a file can carry"
        )
    named = {"search": job.search, "tolerance": job.tolerance, "optimiser": job.optimizer}
    for name, value in named.items():
        if value is not None:
            table[name] = _without_none(dataclasses.asdict(value))
    return table


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()


def problem_table(problem: Problem) -> dict[str, Any]:
    """Return the table of a problem file; see `write_problem`."""
    from selfmotion.shell.documents.robot_tables import RobotTable

    table = problem_to_dict(problem, RobotTable.of, _described)
    if "collision" in table:
        # Plans' files have the name that it had when their format was made.
        table["clearance"] = table.pop("collision")
    apart = table.get("clearance")
    for item in apart if isinstance(apart, list) else [apart]:
        if isinstance(item, dict):
            del item["kind"]
    return {key: _without_none(value) for key, value in table.items()}


def _described(value: Saved) -> dict[str, Any]:
    """Return the description of a value, its class named by module where it is the user's own."""
    described, cls = value.to_dict(), type(value)
    if described["kind"] != cls.kind:
        family = next(base for base in cls.__mro__ if Saved in base.__bases__)
        raise ProblemError(
            f"{cls.__name__} '{getattr(value, 'name', '')}' holds a function, which a file cannot "
            f"carry; derive a class from {public_name(family)}"
        )
    if not cls.__module__.startswith("selfmotion."):
        if cls.__module__ == "__main__":
            raise FileFormatError(
                f"{cls.__name__} is defined in the script that runs; move it into a module, which "
                f"a file can name"
            )
        described["kind"] = f"{cls.__module__}:{cls.__qualname__}"
    return described


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
