"""From a problem file to a problem, and how to plan it; and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from selfmotion.basics import (
    FileFormatError,
    ProblemError,
    as_path,
    read_document,
    write_document,
)
from selfmotion.planning.planner import PlanRequest
from selfmotion.problem.problem import Problem, check_problem
from selfmotion.shell.documents.named_files import named_from

if TYPE_CHECKING:
    from selfmotion.shell.documents.job_tables import JobFile
    from selfmotion.shell.documents.problem_table import ProblemTable


def read_problem(file: str | FilePath, *, allow_code: bool = False) -> Problem:
    """Return the problem of a problem file; see `read_job`."""
    return read_job(file, allow_code=allow_code).problem


def read_job(file: str | FilePath, *, allow_code: bool = False) -> PlanRequest:
    """Read a problem file: TOML, or the same as JSON.

    Units are SI; keys that end in ``_deg`` or ``_mm`` are in degrees and millimetres. Files that it
    names are looked for beside it. `selfmotion.shell.documents.json_schema` describes all keys.

    Parameters
    ----------
    file : path
    allow_code : bool
        Whether classes and functions that the file names as ``module:attribute`` are imported.

    Raises
    ------
    FileFormatError
        The file cannot be read, or says something that cannot be planned; the message names the
        file and the key, what was found and what was expected.
    """
    path = as_path(file)
    document = read_document(path)
    if "grid" in document:
        raise FileFormatError(
            f"{path}: grid: stands for many problems, which `selfmotion batch` plans "
            f"(documents.grid_items); leave it out for one"
        )
    return plan_request_of(document, path, allow_code=allow_code)


def plan_request_of(
    document: Mapping[str, Any],
    file: FilePath | None = None,
    *,
    allow_code: bool = False,
    cache: dict[str, Any] | None = None,
) -> PlanRequest:
    """Return what a document describes; `file` is where it comes from. See `read_job`.

    Where many documents are read, those with the same arm share it by `cache`.
    """
    # The models take a tenth of a second, which commands without a file are spared.
    from selfmotion.shell.documents.problem_table import ProblemTable

    found: PlanRequest = built(ProblemTable, document, file, allow_code, cache)
    return found


def built(
    model: type[ProblemTable | JobFile],
    document: Mapping[str, Any],
    file: FilePath | None,
    allow_code: bool,
    cache: dict[str, Any] | None,
    notes: Sequence[str] = (),
) -> Any:
    """Return what the table of a document stands for.

    Raises
    ------
    FileFormatError
        The document is not what its model says, or cannot be planned.
    """
    from selfmotion.shell.documents.checking import checked, key_of_joint_degrees
    from selfmotion.shell.documents.own_code import import_own
    from selfmotion.shell.documents.tables import Context

    context = Context(file, cache={} if cache is None else cache, notes=list(notes))
    context.degrees_key = key_of_joint_degrees(document)
    with context.naming():
        if ("seams" in document or "job" in document) and "seams" not in model.model_fields:
            raise ProblemError(
                "has seams, so that it is a job: `selfmotion job` plans it (read_seam_job); of "
                "motions only its own .program is judged by it: `selfmotion check a.program`; of "
                "programs of controllers what was made of that: `check a.src --robot a.program`"
            )
        raw = deepcopy(dict(document))
        context.functions = import_own(raw, context.beside(""), allow_code)
        table = checked(model, raw)
    return table.build(context)


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
    table = problem_document(problem, path)
    if isinstance(problem, PlanRequest):
        # Plain keys stand before the first table.
        table = dict(sorted(table.items(), key=lambda item: isinstance(item[1], dict)))
    write_document(path, table)


def problem_document(problem: Problem | PlanRequest, file: FilePath) -> dict[str, Any]:
    """Return what a problem file says of a problem; ProblemError as for `write_problem`."""
    from selfmotion.shell.documents.problem_table import ProblemTable

    if not isinstance(problem, PlanRequest):
        check_problem(problem)
        problem = PlanRequest(problem)
    # Files are named from where the new one is.
    table = ProblemTable.of(problem)
    named: dict[str, Any] = named_from(table, FilePath.cwd(), file.parent.resolve())
    return named
