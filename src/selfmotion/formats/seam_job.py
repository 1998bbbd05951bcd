"""From a file of many seams to a job."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import FileFormatError, SelfmotionError, as_path, nearest, shown
from selfmotion.constraints import Clearance
from selfmotion.formats.documents import in_si, read_document
from selfmotion.formats.job import Job
from selfmotion.formats.path_events import times_of_events
from selfmotion.formats.path_files import one_seam, read_seams
from selfmotion.formats.poses import pose_of
from selfmotion.formats.problem_file import job_of
from selfmotion.formats.problem_parts import FEED_BOUNDS, obstacle, start_of, woven
from selfmotion.formats.workpiece import NAME, placed_body, standing
from selfmotion.job import Program, Seam, plan_job
from selfmotion.path import Path, Placed, section_at_rest
from selfmotion.problem import NO_OVERLAP
from selfmotion.robot import RobotModel

# Keys of a job, of a seam besides those of a problem, and of seams in one table.
_JOB = ("start", "end", "order", "branches", "seconds_per_cost", "deadline", "rng")
_SEAM = ("name", "either_way", "after", "after_any", "wait", "events", "leaves", "may_meet")
_OF_PROBLEM = ("path", "task", "costs", "constraints", "relaxations")
_PLACED = ("file", "frame", "ramp", "weave")
_PACED = ("feed", "duration", "jump", "corners", "tolerance", "corner_angle", *FEED_BOUNDS)
_TABLE = (*_PLACED, *_PACED)


@dataclass(frozen=True, eq=False)
class SeamJob:
    """What a job file says: an arm, seams, and how to plan them.

    Attributes
    ----------
    robot : RobotModel
    seams : tuple of Seam
    settings : mapping
        What `plan_job` is given besides.
    """

    robot: RobotModel
    seams: tuple[Seam, ...]
    settings: Mapping[str, Any]

    def plan(self, **options: Any) -> Program:
        """Plan it; `options` are further ones of `plan_job`."""
        return plan_job(self.robot, self.seams, **{**self.settings, **options})


def read_seam_job(file: str | FilePath, *, allow_code: bool = False) -> SeamJob:
    """Read a job file: a problem file with seams instead of a path; TOML, or the same as JSON.

    Tables ``[robot]``, ``[[constraints]]``, ``[[costs]]``, ``[[relaxations]]`` and ``task`` are
    those of a problem file (`read_job`), and hold for all seams. ``[job]`` has the settings of
    `plan_job`. Seams are a list ``[[seams]]``, each with a ``name``, a ``path``, and what a `Seam`
    may say besides; or one table ``[seams]`` that names a ``file`` of poses with a column ``seam``,
    as `read_path` reads them, with a ``feed`` or ``duration``, and what else all of them have. That
    may be a program of a machine tool, whose cuts are seams. Rows with an ``event``, and cuts, are
    made one way only, unless ``either_way = true`` is said.

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
    document = read_document(path)
    given, settings = document.pop("seams", None), document.pop("job", {})
    if "path" in document or not isinstance(given, dict | list) or not given:
        raise FileFormatError(
            f"{path}: expected seams, a list [[seams]] or a table [seams] with a file, and no path "
            f"beside them"
        )
    if not isinstance(document.get(NAME, {}), Mapping):
        raise FileFormatError(f"{path}: {NAME}: expected a table [{NAME}]")
    reader = _Reader(path, document, allow_code, {})
    entries = [reader.of_table(given)] if isinstance(given, dict) else map(reader.of_list, given)
    seams = [seam for several in entries for seam in several]
    whole = reader.first
    apart = [item for item in whole.problem.constraints if isinstance(item, Clearance)]
    if len(apart) > 1:
        raise FileFormatError(f"{path}: constraints: two clearances, expected one for all")
    options = reader.settings(settings)
    kept = [item for item in reader.shared if not isinstance(item, Clearance)]
    clearance = apart[0] if apart else whole.problem.collision
    if apart or whole.problem.collision is not NO_OVERLAP:
        options["clearance"] = clearance
    return SeamJob(whole.problem.robot, tuple(seams), {**options, "constraints": kept})


class _Reader:
    """Reads the seams of a file, with what they share."""

    def __init__(
        self, file: FilePath, shared: dict[str, Any], allow_code: bool, memory: dict[str, Any]
    ) -> None:
        self._file, self._shared, self._code, self._memory = file, shared, allow_code, memory
        # The arm and what all keep, read with any motion at all.
        self.first = self._read({"path": _ANY}, "seams")
        self.shared = list(self.first.problem.constraints)
        self._standing = standing(shared)

    def of_list(self, given: Any) -> list[Seam]:
        """Return the seam of an entry of [[seams]]."""
        if not isinstance(given, Mapping):
            raise FileFormatError(f"{self._file}: seams: an entry is no table, expected [[seams]]")
        name = given.get("name")
        where = f"seams, '{name}'"
        self._check(given, (*_SEAM, *_OF_PROBLEM), where)
        if "path" not in given:
            raise FileFormatError(f"{self._file}: {where}: path is missing")
        path = given["path"]
        if isinstance(path, Mapping) and path.get("kind") == "file" and "events" not in given:
            self._refuse_events(path, where)
        return [self._seam(given, None, where)]

    def _refuse_events(self, path: Mapping[str, Any], where: str) -> None:
        """Raise FileFormatError for events in the file of a path, which would be lost."""
        file = self._file.parent / str(path.get("file", ""))
        if file.is_file() and one_seam(file, path.get("seam")).events:
            raise FileFormatError(
                f"{self._file}: {where}: {file.name} has events, which are kept of a table [seams] "
                f"with that file; or say here when they are, events = [] for none"
            )

    def of_table(self, given: Mapping[str, Any]) -> list[Seam]:
        """Return the seams of a file with a column ``seam``."""
        self._check(given, (*_SEAM[1:], *_OF_PROBLEM[1:], *_TABLE), "seams")
        values = in_si(given)
        if "file" not in values:
            raise FileFormatError(f"{self._file}: seams: file is missing, or a list [[seams]]")
        try:
            frame = pose_of(values["frame"]) if "frame" in values else None
        except (SelfmotionError, ValueError) as error:
            raise FileFormatError(f"{self._file}: seams: frame: {error}") from error
        table = self._file.parent / values["file"]
        options = {key: values[key] for key in _PACED if key in values}
        rest = {key: value for key, value in given.items() if key not in _TABLE}
        found, seams = list[Seam](), read_seams(table, options)
        # What a machine switches stays switched in the cuts that follow: they keep their order.
        switched = any(rows.straight and rows.events for _, rows in seams.values())
        for name, (path, rows) in seams.items():
            if "ramp" in values:
                path = section_at_rest(path, ramp=values["ramp"])
            own = {**rest, "name": name}
            events = times_of_events(path, rows)
            if "weave" in values:
                path = woven(path, values["weave"])
            if events:
                own["events"] = [*events, *rest.get("events", [])]
            if events or rows.straight:
                # What happens where, and how a machine cuts, is meant one way.
                own.setdefault("either_way", False)
            if switched and found:
                own.setdefault("after", [found[-1].name])
            place = self._standing[0] if frame is None else self._standing[0] * frame
            if frame is not None or NAME in self._shared:
                path = Placed(path, place)
            found.append(self._seam(own, path, f"seams, '{name}'"))
        return found

    def settings(self, given: Any) -> dict[str, Any]:
        """Return the settings of [job]."""
        if not isinstance(given, Mapping):
            raise FileFormatError(f"{self._file}: job: expected a table [job]")
        values = in_si(given)
        self._check(values, _JOB, "job")
        robot, task = self.first.problem.robot, self.first.problem.task
        try:
            for name in ("start", "end"):
                if name in values:
                    values[name] = start_of(values[name], robot, task)
        except SelfmotionError as error:
            raise FileFormatError(f"{self._file}: job: {name}: {error}") from error
        return values

    def _seam(self, given: Mapping[str, Any], path: Path | None, where: str) -> Seam:
        own = {key: value for key, value in given.items() if key in _OF_PROBLEM}
        constraints = own.pop("constraints", [])
        whole = self._shared.get("constraints", [])
        document = {"path": _ANY, **own}
        if constraints:
            document["constraints"] = [*whole, *constraints]
        problem = self._read(document, where).problem
        besides = list(problem.constraints)[len(whole) :] if constraints else []
        values = {key: value for key, value in in_si(given).items() if key in _SEAM}
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

    def _read(self, own: Mapping[str, Any], where: str) -> Job:
        document = {**self._shared, **own}
        try:
            return job_of(document, self._file, allow_code=self._code, memory=self._memory)
        except SelfmotionError as error:
            text = str(error).removeprefix(f"{self._file}: ")
            raise FileFormatError(f"{self._file}: {where}: {text}") from error

    def _check(self, given: Mapping[str, Any], known: Sequence[str], where: str) -> None:
        for key in given:
            plain = key.removesuffix("_deg").removesuffix("_mm")
            if plain not in known:
                raise FileFormatError(
                    f"{self._file}: {where}: unknown key '{key}'{nearest(key, known)}; expected "
                    f"{', '.join(known)}"
                )
            kind, what = _KINDS.get(plain, (object, ""))
            if not isinstance(given[key], kind):
                raise FileFormatError(
                    f"{self._file}: {where}: {key} is {shown(given[key])}, expected {what}"
                )
        if not all(isinstance(item, Mapping) for item in given.get("leaves", ())):
            raise FileFormatError(f"{self._file}: {where}: leaves: expected tables of bodies")


# What is neither read by a model nor by what it is handed to.
_KINDS: Mapping[str, tuple[type, str]] = {
    "file": (str, "the name of a file"),
    "weave": (Mapping, "a table with amplitude and pitch"),
    **dict.fromkeys(("events", "leaves", "constraints", "costs", "relaxations"), (list, "a list")),
}
# A motion that any arm's tool may have, so that what seams share can be read.
_ANY = {
    "kind": "line",
    "start": {"position": [0.0, 0.0, 0.0]},
    "by": [0.0, 0.0, 0.01],
    "duration": 1.0,
}
