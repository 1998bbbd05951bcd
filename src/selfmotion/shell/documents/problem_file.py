"""From a problem file to a problem, and how to plan it, and back; from a job file to a job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from selfmotion.basics import (
    FORMER_CLEARANCE,
    FileFormatError,
    ProblemError,
    as_path,
    nearest,
    read_document,
    write_document,
)
from selfmotion.planning.planner import PlanRequest
from selfmotion.problem.problem import Problem, check_problem
from selfmotion.shell.documents.named_files import named_from
from selfmotion.shell.documents.seam_job import SeamJob

if TYPE_CHECKING:
    from selfmotion.shell.documents.job_tables import JobFile
    from selfmotion.shell.documents.problem_table import ProblemTable

# Note on a key of a job that is called otherwise by now.
_RENAMED = (
    "job: 'deadline', seconds of the processor for each move, is called 'move_seconds' by now; "
    "--deadline ends the whole job"
)


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


def read_seam_job(file: str | FilePath, *, allow_code: bool = False) -> SeamJob:
    """Read a job file: a problem file with seams instead of a path; TOML, or the same as JSON.

    Tables ``[robot]``, ``[[constraints]]``, ``[[costs]]``, ``[[relaxations]]`` and ``task`` are
    those of a problem file (`read_job`), and hold for all seams. ``[job]`` has the settings of
    `plan_job`. Seams are a list ``[[seams]]``, each with a ``name``, a ``path``, and what a `Seam`
    may say besides; or one table ``[seams]`` that names a ``file`` of poses with a column ``seam``,
    as `read_path` reads them, with a ``feed`` or ``duration``, and what else all of them have. That
    may be a program of a machine tool, whose cuts are seams. Rows with an ``event``, and cuts, are
    made one way only, unless ``either_way = true`` is said: then events are as long after the start
    from the end on, too, which is at other poses. With ``run_up = true`` seams with a feed are made
    longer at both ends, so that they keep it from begin to end (`with_run_ups`), and ``feed =
    "highest"`` asks for the highest one at which all are kept (`highest_feed`), up to
    ``most_feed``.

    Parameters
    ----------
    file : path
    allow_code : bool
        As for `read_job`.

    Raises
    ------
    FileFormatError
        The file cannot be read, or says something that cannot be planned; file and key are named.
    """
    path = as_path(file)
    return seam_job_of(read_document(path), path, allow_code=allow_code)


def seam_job_of(
    document: Mapping[str, Any],
    file: FilePath,
    *,
    allow_code: bool = False,
    cache: dict[str, Any] | None = None,
) -> SeamJob:
    """Return the job that a document of a file describes. See `read_seam_job`.

    Where many documents are read, those with the same arm share it by `cache`.
    """
    from selfmotion.shell.documents.job_tables import JobFile
    from selfmotion.shell.documents.problem_table import SharedTable

    seams, settings = document.get("seams"), document.get("job", {})
    if "path" in document or not isinstance(seams, dict | list) or not seams:
        raise FileFormatError(
            f"{file}: expected seams, a list [[seams]] or a table [seams] with a file, and no path "
            f"beside them"
        )
    shared = tuple(SharedTable.model_fields)
    for key in document:
        if key not in (*JobFile.model_fields, FORMER_CLEARANCE):
            raise FileFormatError(
                f"{file}: {key}: has no effect on a job{nearest(key, shared)}; leave it out; what "
                f"holds for all seams is {', '.join(shared)}; the rest is of [job], or of a seam"
            )
    is_former = isinstance(settings, Mapping) and "deadline" in settings
    if is_former and "move_seconds" not in settings:
        settings = {
            "move_seconds" if key == "deadline" else key: value for key, value in settings.items()
        }
        document = {**document, "job": settings}
    notes = (_RENAMED,) if is_former else ()
    found: SeamJob = built(JobFile, document, file, allow_code, cache, notes)
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
