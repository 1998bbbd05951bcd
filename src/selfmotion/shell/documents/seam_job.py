"""From a file of many seams to a job."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import (
    FORMER_CLEARANCE,
    FileFormatError,
    ProblemError,
    SelfmotionError,
    as_path,
    in_si,
    is_file,
    nearest,
    read_document,
    shown,
)
from selfmotion.model.path import Feed, Path, Placed, pose_of, with_run_ups
from selfmotion.model.robot import RobotModel
from selfmotion.planning.planner import PlanRequest
from selfmotion.problem.constraints import NO_OVERLAP, Clearance, Constraint, as_clearances
from selfmotion.problem.problem import Problem
from selfmotion.shell.documents.problem_file import plan_request_of
from selfmotion.shell.documents.problem_parts import (
    FEED_BOUNDS,
    NAME,
    in_reference,
    obstacle,
    placed_body,
    rapid_ends,
    standing,
    start_of,
    with_lead_table,
    with_weave_table,
)
from selfmotion.shop.cam import (
    READING,
    UNJUDGED,
    Reading,
    one_seam,
    read_path,
    read_seams,
    times_of_events,
)
from selfmotion.work.job import (
    FASTEST_FEED,
    Program,
    Seam,
    highest_feed,
    plan_job,
    problem_of_seam,
)

# Keys of what seams share, of a job, of a seam besides those of a problem, of seams in one table.
SHARED = ("robot", NAME, "task", "costs", "constraints", "joint_limits", "relaxations", "clearance")
MOVE_SECONDS = "move_seconds"
FORMER_SECONDS = "deadline"
JOB = ("start", "end", "order", "branches", "seconds_per_cost", MOVE_SECONDS, "rng")
_RENAMED = (
    "job: 'deadline', seconds of the processor for each move, is called 'move_seconds' by now; "
    "--deadline ends the whole job"
)
SEAM = ("name", "either_way", "after", "after_any", "wait", "events", "leaves", "may_meet")
OF_PROBLEM = ("path", "task", "costs", "constraints", "relaxations")
_PLACED = ("file", "frame", "weave", "leads")
_PACED = (
    *("feed", "duration", "jump", "corners", "tolerance", "corner_angle", "ramp"),
    *("flip_normals", "standoff", "along", "lead", "tilt", "lift", *READING, *FEED_BOUNDS),
)
# Value of `feed` that asks for the highest feed.
HIGHEST = "highest"
# Keys of a table of seams that are about its feed.
_OF_FEED = ("most_feed", "run_up")
OF_TABLE = (*_PLACED, *_PACED, *_OF_FEED)


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
    seams_setting, settings = document.get("seams"), document.get("job", {})
    if isinstance(seams_setting, dict) and seams_setting.get("feed") == HIGHEST:
        return _at_highest(document, seams_setting, file, allow_code=allow_code)
    if isinstance(seams_setting, dict) and "most_feed" in seams_setting:
        raise FileFormatError(
            f"{file}: seams: most_feed: has no effect where feed is a number; give feed = "
            f"'{HIGHEST}', or leave it out"
        )
    shared = {key: value for key, value in document.items() if key not in ("seams", "job")}
    if "path" in shared or not isinstance(seams_setting, dict | list) or not seams_setting:
        raise FileFormatError(
            f"{file}: expected seams, a list [[seams]] or a table [seams] with a file, and no path "
            f"beside them"
        )
    for key in shared:
        if key not in (*SHARED, FORMER_CLEARANCE):
            raise FileFormatError(
                f"{file}: {key}: has no effect on a job{nearest(key, SHARED)}; leave it out; what "
                f"holds for all seams is {', '.join(SHARED)}; the rest is of [job], or of a seam"
            )
    if not isinstance(shared.get(NAME, {}), Mapping):
        raise FileFormatError(f"{file}: {NAME}: expected a table [{NAME}]")
    reader = _Reader(file, shared, allow_code, {} if cache is None else cache)
    entries = (
        [reader.of_table(seams_setting)]
        if isinstance(seams_setting, dict)
        else map(reader.of_list, seams_setting)
    )
    seams = [seam for several in entries for seam in several]
    first = reader.first
    options = reader.settings(settings)
    if first.problem.clearance is not NO_OVERLAP:
        options["clearance"] = first.problem.clearance
    is_cut = any(UNJUDGED in seam.path.notes for seam in seams)
    return SeamJob(
        first.problem.robot,
        tuple(seams),
        {**options, "constraints": list(first.problem.constraints)},
        unjudged=(UNJUDGED,) if is_cut else (),
        notes=(*first.notes, *([_RENAMED] if FORMER_SECONDS in settings else [])),
    )


def _at_highest(
    document: Mapping[str, Any], section: Mapping[str, Any], file: FilePath, *, allow_code: bool
) -> SeamJob:
    """Return the job of a document that asks for the highest feed."""
    most = section.get("most_feed", FASTEST_FEED)
    if not (isinstance(most, int | float) and 0.0 < most <= FASTEST_FEED):
        raise FileFormatError(
            f"{file}: seams: most_feed is {shown(most)}, expected a feed up to {FASTEST_FEED:g} m/s"
        )
    rest = {key: value for key, value in section.items() if key != "most_feed"}

    def at_feed(feed: float) -> SeamJob:
        with_feed = {**document, "seams": {**rest, "feed": feed}}
        return seam_job_of(with_feed, file, allow_code=allow_code)

    slow = at_feed(_SLOW * most)
    return replace(slow, at_feed=at_feed, most_feed=float(most))


# At this share of the highest feed that is tried a file is read first, for all that it says.
_SLOW = 0.01


class _Reader:
    """Reads the seams of a file, with what they share."""

    def __init__(
        self, file: FilePath, shared: dict[str, Any], allow_code: bool, cache: dict[str, Any]
    ) -> None:
        self._file, self._shared, self._code, self._cache = file, shared, allow_code, cache
        # The arm and what all keep, read with any motion at all.
        self.first = self._read({"path": _ANY}, "seams")
        self._standing = standing(shared)

    def of_list(self, entry: Any) -> list[Seam]:
        """Return the seam of an entry of [[seams]]."""
        if not isinstance(entry, Mapping):
            raise FileFormatError(f"{self._file}: seams: an entry is no table, expected [[seams]]")
        name = entry.get("name")
        where = f"seams, '{name}'"
        self._check(entry, (*SEAM, *OF_PROBLEM), where)
        if "path" not in entry:
            raise FileFormatError(f"{self._file}: {where}: path is missing")
        path, values = entry["path"], dict(entry)
        if isinstance(path, Mapping) and "events" not in entry:
            events, one_way = self._events_of(in_si(path), where)
            values |= {"events": events} if events else {}
            if events or one_way:
                values.setdefault("either_way", False)
        return [self._seam(values, None, where)]

    def _events_of(
        self, path: Mapping[str, Any], where: str
    ) -> tuple[list[tuple[str, float]], bool]:
        """Return the events in the files of a path [s], and whether one is of a machine tool."""
        kind, pieces = path.get("kind"), path.get("pieces")
        if kind == "file":
            return self._events_of_file(path, where)
        inner = [path.get("path"), *(pieces if isinstance(pieces, list) else [])]
        found_events = [
            self._events_of(in_si(one), where) for one in inner if isinstance(one, Mapping)
        ]
        events = [event for several, _ in found_events for event in several]
        if events and kind not in _IN_STEP:
            raise FileFormatError(
                f"{self._file}: {where}: path: a path of kind {shown(kind)} has other times than "
                f"the file in it, whose event '{events[0][0]}' would be lost; say when in events, "
                f"or put the file into the path itself"
            )
        return _after_lead(events, path.get("leads"), None), any(
            one_way for _, one_way in found_events
        )

    def _events_of_file(
        self, path: Mapping[str, Any], where: str
    ) -> tuple[list[tuple[str, float]], bool]:
        file = self._file.parent / str(path.get("file", ""))
        if not is_file(file):
            return [], False
        try:
            rows = one_seam(file, path.get("seam"), Reading.of(file, path))
            if not rows.events:
                return [], rows.one_way
            options = {key: path[key] for key in ("seam", *_PACED) if key in path}
            read = read_path(file, **options)
            events = times_of_events(read, rows)
            return _after_lead(events, path.get("leads"), read), rows.one_way
        except (SelfmotionError, TypeError) as error:
            raise FileFormatError(f"{self._file}: {where}: path: {error}") from error

    def of_table(self, section: Mapping[str, Any]) -> list[Seam]:
        """Return the seams of a file with a column ``seam``."""
        self._check(section, (*SEAM[1:], *OF_PROBLEM[1:], *OF_TABLE), "seams")
        values = in_si(section)
        if "file" not in values:
            raise FileFormatError(f"{self._file}: seams: file is missing, or a list [[seams]]")
        try:
            frame = pose_of(values["frame"]) if "frame" in values else None
        except (SelfmotionError, ValueError) as error:
            raise FileFormatError(f"{self._file}: seams: frame: {error}") from error
        table = self._file.parent / values["file"]
        options = {key: values[key] for key in _PACED if key in values}
        rest = {key: value for key, value in section.items() if key not in OF_TABLE}
        seams, paths = list[Seam](), self._seams_of(table, options)
        # What a machine switches stays switched in the cuts that follow: they keep their order.
        switched = any(rows.one_way and rows.events for _, rows in paths.values())
        for name, (path, rows) in paths.items():
            entry = {**rest, "name": name}
            events = times_of_events(path, rows)
            if "weave" in values:
                path = with_weave_table(path, values["weave"])
            if values.get("run_up"):
                path, events = _run_up(path, events, f"seams, '{name}'", self._file)
            if "leads" in values:
                events = _after_lead(events, values["leads"], path)
                path = with_lead_table(path, values["leads"])
            if events:
                entry["events"] = [*events, *rest.get("events", [])]
            if events or rows.one_way:
                # What happens where, and how a machine cuts, is meant one way.
                entry.setdefault("either_way", False)
            if switched and seams:
                entry.setdefault("after", [seams[-1].name])
            place = self._standing[0] if frame is None else self._standing[0] * frame
            if frame is not None or NAME in self._shared:
                path = Placed(path, place)
            else:
                path = in_reference(path, self.first.problem.robot)
            seams.append(self._seam(entry, path, f"seams, '{name}'"))
        return seams

    def _seams_of(self, table: FilePath, options: Mapping[str, Any]) -> Any:
        """Return the seams of a file; the same file is read once for many documents."""
        changed = table.stat().st_mtime_ns if is_file(table) else 0
        key = json.dumps(["seams", str(table), changed, options], default=str)
        if key not in self._cache:
            self._cache[key] = read_seams(table, options)
        return self._cache[key]

    def settings(self, section: Any) -> dict[str, Any]:
        """Return the settings of [job]."""
        if not isinstance(section, Mapping):
            raise FileFormatError(f"{self._file}: job: expected a table [job]")
        values = in_si(section)
        if FORMER_SECONDS in values and MOVE_SECONDS not in values:
            values[MOVE_SECONDS] = values.pop(FORMER_SECONDS)
        self._check(values, JOB, "job")
        robot, task = self.first.problem.robot, self.first.problem.task
        try:
            for name in ("start", "end"):
                if name in values:
                    values[name] = start_of(values[name], robot, task)
        except SelfmotionError as error:
            raise FileFormatError(f"{self._file}: job: {name}: {error}") from error
        return values

    def _seam(self, entry: Mapping[str, Any], path: Path | None, where: str) -> Seam:
        of_problem = {key: value for key, value in entry.items() if key in OF_PROBLEM}
        constraints = of_problem.pop("constraints", [])
        whole = self._shared.get("constraints", [])
        document = {"path": _ANY, **of_problem}
        if constraints:
            document["constraints"] = [*whole, *constraints]
        problem = self._read(document, where).problem
        besides = _besides(problem, whole, constraints)
        values = {key: value for key, value in in_si(entry).items() if key in SEAM}
        try:
            leaves = [self._left(in_si(item)) for item in values.pop("leaves", [])]
            return Seam(
                path=problem.path if path is None else path,
                task=problem.task,
                relaxations=problem.relaxations,
                costs=problem.costs,
                constraints=besides,
                leaves=leaves,
                **values,
            )
        except (SelfmotionError, TypeError) as error:
            raise FileFormatError(f"{self._file}: {where}: {error}") from error

    def _left(self, values: Mapping[str, Any]) -> Any:
        """Return a body that a seam leaves, where the workpiece stands if there is one."""
        if NAME in self._shared:
            values = placed_body(values, *self._standing)
        return obstacle(values, lambda name: self._file.parent / name)

    def _read(self, values: Mapping[str, Any], where: str) -> PlanRequest:
        document = {**self._shared, **values}
        try:
            return plan_request_of(document, self._file, allow_code=self._code, cache=self._cache)
        except SelfmotionError as error:
            text = str(error).removeprefix(f"{self._file}: ")
            raise FileFormatError(f"{self._file}: {where}: {text}") from error

    def _check(self, table: Mapping[str, Any], keys: Sequence[str], where: str) -> None:
        for key in table:
            plain = key.removesuffix("_deg").removesuffix("_mm")
            if plain not in keys:
                raise FileFormatError(
                    f"{self._file}: {where}: unknown key '{key}'{nearest(key, keys)}; expected "
                    f"{', '.join(keys)}"
                )
            kind, what = _KINDS.get(plain, (object, ""))
            if not isinstance(table[key], kind):
                raise FileFormatError(
                    f"{self._file}: {where}: {key} is {shown(table[key])}, expected {what}"
                )
        if not all(isinstance(item, Mapping) for item in table.get("leaves", ())):
            raise FileFormatError(f"{self._file}: {where}: leaves: expected tables of bodies")


def _besides(problem: Problem, shared: Sequence[Any], own: Sequence[Any]) -> list[Constraint]:
    """Return what a seam's own tables of constraints are read as.

    Its problem has those that it shares first, then its own, then limits of a file.
    """
    (first, before), (mine, others) = _by_kind(shared), _by_kind(own)
    clearances = problem.clearances[first : first + mine]
    return [*problem.constraints[before : before + others], *clearances]


def _by_kind(tables: Sequence[Any]) -> tuple[int, int]:
    """Return how many tables of constraints are clearances, and how many are not."""
    count = sum(item.get("kind") == Clearance.kind for item in tables)
    return count, len(tables) - count


def _run_up(
    path: Path, events: list[tuple[str, float]], where: str, file: FilePath
) -> tuple[Path, list[tuple[str, float]]]:
    """Return a path with run-ups, and its events as much later."""
    if not isinstance(path, Feed):
        raise FileFormatError(f"{file}: {where}: run_up: is of seams with a feed, not a weave")
    try:
        stroke = with_run_ups(path)
    except SelfmotionError as error:
        raise FileFormatError(f"{file}: {where}: {error}") from error
    # When the same places are passed.
    original = path.pace(np.array([at for _, at in events]))[0] if events else np.zeros(0)
    first, _ = stroke.path.pace(np.array([stroke.begin]))
    times = stroke.path.when(first[0] + original) if events else original
    return stroke.path, [(name, float(at)) for (name, _), at in zip(events, times, strict=True)]


def _after_lead(
    events: Sequence[tuple[str, float]], leads: Mapping[str, Any] | None, path: Path | None
) -> list[tuple[str, float]]:
    """Return events of a path [s] after its lead-in, whose faults are told where it is made."""
    has_own = path is not None and rapid_ends(path)[0]
    first = 0.0 if has_own else (leads or {}).get("duration", 0.0)
    later = first if isinstance(first, int | float) else 0.0
    return [(event, later + at) for event, at in events]


# Paths of another one that are at its poses at the same times.
_IN_STEP = ("placed", "weave")
# What is neither read by a model nor by what it is handed to.
_KINDS: Mapping[str, tuple[type, str]] = {
    "file": (str, "the name of a file"),
    "weave": (Mapping, "a table with amplitude and pitch"),
    "leads": (Mapping, "a table with length and duration"),
    "run_up": (bool, "true or false"),
    **dict.fromkeys(("events", "leaves", "constraints", "costs", "relaxations"), (list, "a list")),
}
# A motion that any arm's tool may have, so that what seams share can be read.
_ANY = {
    "kind": "line",
    "start": {"position": [0.0, 0.0, 0.0]},
    "by": [0.0, 0.0, 0.01],
    "duration": 1.0,
}
