"""From a file of many seams to a job."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import (
    FORMER_CLEARANCE,
    FileFormatError,
    ProblemError,
    SelfmotionError,
    as_path,
    nearest,
    read_document,
)
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints import NO_OVERLAP, as_clearances
from selfmotion.problem.problem import Problem
from selfmotion.shell.documents.problem_file import built
from selfmotion.work.job import FASTEST_FEED, Program, Seam, highest_feed, plan_job, problem_of_seam

_RENAMED = (
    "job: 'deadline', seconds of the processor for each move, is called 'move_seconds' by now; "
    "--deadline ends the whole job"
)


@dataclass(frozen=True, eq=False)
class SeamJob:
    """A job as its file states it: an arm, seams, and settings of the planner.

    Attributes
    ----------
    robot : RobotModel
    seams : tuple of Seam
    settings : mapping
        What `plan_job` is given besides.
    at_feed : callable or None
        Of a file that asks for the highest feed: feed [m/s] → the job at that one.
    most_feed : float
        How fast that may be at most [m/s].
    unjudged : tuple of str
        What nothing is asked of, as of files of machine tools; programs say it.
    notes : tuple of str
        Of keys that are called otherwise by now, and as of `PlanRequest`.
    """

    robot: RobotModel
    seams: tuple[Seam, ...]
    settings: Mapping[str, Any]
    at_feed: Callable[[float], "SeamJob"] | None = None
    most_feed: float = FASTEST_FEED
    unjudged: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Notes before planning, see `Problem.remarks`; of alike ones that of the first seam."""
        remarks: dict[str, str] = {}
        for seam in self.seams:
            try:
                problem = self._problem(seam)
            except SelfmotionError:
                # It is told why when the seam is planned.
                continue
            for remark in problem.remarks:
                remarks.setdefault(remark.split(" at t =")[0], f"seam '{seam.name}': {remark}")
        return (*self.notes, *remarks.values())

    @property
    def problems(self) -> tuple[Problem, ...]:
        """The problem of each seam alone, without what others leave behind."""
        return tuple(map(self._problem, self.seams))

    def _problem(self, seam: Seam) -> Problem:
        clearances = as_clearances(self.settings.get("clearance", NO_OVERLAP))
        return problem_of_seam(self.robot, seam, self.settings["constraints"], clearances)

    def plan(self, **options: Any) -> Program:
        """Plan it; `options` are further ones of `plan_job`. At the highest feed if that is asked.

        See `highest_feed`.
        """
        at_feed = self.at_feed
        if at_feed is not None:
            if options.get("deadline") is not None:
                raise ProblemError(
                    "deadline: has no effect where the highest feed is looked for, which plans "
                    "several jobs; give a feed, or leave it out"
                )
            return highest_feed(lambda feed: at_feed(feed).plan(**options), self.most_feed).program
        program = plan_job(self.robot, self.seams, **{**self.settings, **options})
        return replace(program, unjudged=self.unjudged)


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
