"""From a problem file to a problem, and how to plan it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import (
    PER_JOINT,
    Array,
    FileFormatError,
    ProblemError,
    RobotError,
    SelfmotionError,
    as_path,
    in_si,
    read_document,
    restore,
)
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import disabled_links, srdf_notes
from selfmotion.model.follow import Follow
from selfmotion.model.motion import NullMotion
from selfmotion.model.robot import NAMED_ARMS, NAMED_PARTS, RobotModel, load_robot
from selfmotion.model.task import Damping, Relaxation, Task
from selfmotion.planning.optimise import LineSearch, QuasiNewton
from selfmotion.planning.planner import PlanRequest, Search
from selfmotion.problem.constraints import (
    NO_OVERLAP,
    Clearance,
    Constraint,
    clearances_among,
    separate_clearances,
)
from selfmotion.problem.costs import Cost, FunctionCost
from selfmotion.problem.problem import Problem
from selfmotion.shell.documents.joint_limits import joint_limit_notes, read_joint_limits
from selfmotion.shell.documents.problem_parts import (
    FUNCTION,
    name_kinds,
    obstacle,
    path_of,
    placed_table,
    start_of,
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
    from selfmotion.shell.documents.checking import checked

    with _naming_errors(file, ""):
        if "seams" in document or "job" in document:
            raise ProblemError(
                "has seams, so that it is a job: `selfmotion job` plans it (read_seam_job); of "
                "motions only its own .program is judged by it: `selfmotion check a.program`; of "
                "programs of controllers what was made of that: `check a.src --robot a.program`"
            )
        raw = in_si(document)
        functions = name_kinds(raw, FilePath() if file is None else file.parent, allow_code)
        table = placed_table(checked(raw, document))
        return _Reader(
            file, table, functions, _key_of_joint_degrees(document), {} if cache is None else cache
        ).request()


@contextmanager
def _naming_errors(file: FilePath | None, key: str) -> Iterator[None]:
    """Say of each error which file and key it is about, where there is a file."""
    try:
        yield
    except SelfmotionError as error:
        if file is None:
            raise
        text, start = str(error), f"{file}: "
        if text.startswith(start):
            raise
        where = f"{start}{key}: " if key else start
        raise FileFormatError(f"{where}{text.removeprefix(f'{key}: ')}") from error


def _key_of_joint_degrees(document: Any, where: str = "") -> str:
    """Return the first key that gives degrees joint by joint, "" for none."""
    items: Any = ()
    if isinstance(document, Mapping):
        items = document.items()
    elif isinstance(document, list):
        items = enumerate(document)
    for key, value in items:
        # Where a joint slides, degrees make no sense.
        name = str(key)
        is_per_joint = name.endswith("_deg") and name.removesuffix("_deg") in PER_JOINT
        if is_per_joint and isinstance(value, list):
            return f"{where}{key}"
        inner = _key_of_joint_degrees(value, f"{where}{key}.")
        if inner:
            return inner
    return ""


def _usual_task(robot: RobotModel) -> Task:
    """Return the task of a document that says none: of an arm in the plane of x and y that."""
    is_planar = robot.can_follow(Task.PLANAR) and not robot.can_follow(Task.POSITION)
    return Task.PLANAR if is_planar else Task.POSE


# Note on a file that says a clearance as one of its constraints.
_FORMER_CLEARANCE_NOTE = (
    'constraints: kind = "Clearance" is read for one more version; give the table [clearance], or '
    "[[clearance]] of several"
)


@dataclass(frozen=True, eq=False)
class _Reader:
    """Makes the objects that a checked table describes.

    Attributes
    ----------
    file : Path or None
        Where the table comes from; files that it names are looked for beside it.
    table : dict
        Of SI units, with poses as SE3; see `checked`. Reading leaves it as it is.
    functions : dict
        Functions of a user's own, by the text that names them.
    degrees_key : str
        A key that gives degrees joint by joint; "" for none.
    cache : dict
        Arms and starts that are made already, by what describes them.
    notes : list of str
        What files that the table names are taken to say.
    """

    file: FilePath | None
    table: Mapping[str, Any]
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    degrees_key: str = ""
    cache: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def request(self) -> PlanRequest:
        """Return the problem, and how it is planned."""
        table, file = self.table, self.file
        with _naming_errors(file, "robot"):
            robot = self._cached(table["robot"], self._robot)
        self._check_degrees(robot)
        task = Task.of(table["task"]) if "task" in table else _usual_task(robot)
        with _naming_errors(file, "start"):
            setting = table.get("start", "free")
            start = self._cached(
                (table["robot"], setting, task.value), lambda _: start_of(setting, robot, task)
            )
        with _naming_errors(file, "path"):
            path = path_of(table["path"], robot, start, self._file_beside)
        options: dict[str, Any] = {"rest": table.get("rest", True)}
        if "also" in table:
            options["also"] = self._items("also", lambda item: self._follow(item, robot, start))
        if "null_motion" in table:
            with _naming_errors(file, "null_motion"):
                options["null_motion"] = restore(NullMotion, table["null_motion"])
        for name, make in (
            ("costs", lambda item: self._cost(item, robot)),
            ("constraints", self._constraint),
            ("relaxations", lambda item: Relaxation(**item)),
        ):
            if name in table:
                options[name] = self._items(name, make)
        if table.get("damping") is not None:
            with _naming_errors(file, "damping"):
                options["damping"] = Damping(**table["damping"])
        if isinstance(table.get("clearance"), list):
            options["clearance"] = self._items("clearance", self._clearance)
        elif "clearance" in table:
            with _naming_errors(file, "clearance"):
                values = table["clearance"]
                options["clearance"] = None if values is None else self._clearance(values)
        if clearances_among(options.get("constraints", ())):
            self.notes.append(_FORMER_CLEARANCE_NOTE)
            options["constraints"], options["clearance"] = separate_clearances(
                options["constraints"], options.get("clearance", NO_OVERLAP)
            )
        with _naming_errors(file, ""):
            problem = Problem(robot, path, task, start, **options)
        if "joint_limits" in table:
            with _naming_errors(file, "joint_limits"):
                limits_file = self._file_beside(table["joint_limits"])
                limits = read_joint_limits(limits_file, robot)
                self.notes.extend(joint_limit_notes(limits_file, robot))
                problem = replace(problem, constraints=(*problem.constraints, *limits))
        return PlanRequest(problem, **self._plan_options(), notes=tuple(self.notes))

    def _cached(self, values: Any, make: Callable[[Any], Any]) -> Any:
        """Return what is made of values; the same object where the cache has it."""
        # With all digits of poses, which their own text leaves out.
        key = json.dumps(values, default=lambda pose: pose.homogeneous.tolist())
        if key not in self.cache:
            self.cache[key] = make(values)
        return self.cache[key]

    def _check_degrees(self, robot: RobotModel) -> None:
        slides = [name for name in robot.joint_names if robot.is_prismatic(name)]
        if self.degrees_key and slides:
            with _naming_errors(self.file, self.degrees_key):
                raise ProblemError(
                    f"joint '{slides[0]}' slides, its coordinate is in metres; give rad and m "
                    f"under the key without _deg"
                )

    def _robot(self, table: Mapping[str, Any]) -> RobotModel:
        # Copies: what is read describes other problems of a grid as well, and names cached objects.
        values = dict(table)
        parts = {name: dict(part) for name, part in values.pop("parts", {}).items()}
        values["bodies"] = [self._obstacle(item) for item in values.pop("bodies", [])]
        if "packages" in values:
            values["packages"] = [self._file_beside(name) for name in values["packages"]]
        for part in (values, *parts.values()):
            if "calibration" in part:
                part["calibration"] = self._file_beside(part["calibration"])
        if "parts" not in table:
            return load_robot(self._source(values), **values)
        for key in ("name", "file", "base", "arguments", "calibration"):
            if key in values:
                raise RobotError(f"{key}: is given in each of parts, where there are some")
        by_part = {
            key: {name: part[key] for name, part in parts.items() if key in part}
            for key in ("base", "on", "arguments", "calibration")
        }
        sources = {name: self._source(part, f"parts.{name}: ") for name, part in parts.items()}
        return load_robot(sources, **(values | by_part))

    def _source(self, values: dict[str, Any], where: str = "") -> str | FilePath:
        """Take the name of a robot, or its file, from a table."""
        name, file = values.pop("name", None), values.pop("file", None)
        if (name is None) == (file is None):
            raise RobotError(
                f"{where}expected either name (one of {', '.join(NAMED_ARMS)}) or file (.urdf, "
                f".xacro)"
            )
        if name is not None and name not in {**NAMED_ARMS, **NAMED_PARTS}:
            raise RobotError(f"{where}name: unknown robot '{name}', known: {', '.join(NAMED_ARMS)}")
        return name if file is None else self._file_beside(file)

    def _follow(self, table: Mapping[str, Any], robot: RobotModel, start: Array | None) -> Follow:
        if ("pose" in table) == ("path" in table):
            raise ProblemError("expected either path, or the pose that is held")
        values = dict(table)
        path = values.pop("pose", None)
        if path is None:
            path = path_of(values.pop("path"), robot, start, self._file_beside)
        return Follow(path, **values)

    def _cost(self, values: Mapping[str, Any], robot: RobotModel) -> Cost:
        if values["kind"] == FUNCTION:
            function = self.functions[values["code"]]
            name = values.get("name", getattr(function, "__name__", "function"))
            return FunctionCost(function, name=name)
        cost: Cost = restore(Cost, values, robot=robot)
        return cost

    def _constraint(self, values: Mapping[str, Any]) -> Constraint:
        if values["kind"] == Clearance.kind:
            return self._clearance({key: v for key, v in values.items() if key != "kind"})
        constraint: Constraint = restore(Constraint, values)
        return constraint

    def _clearance(self, values: Mapping[str, Any]) -> Clearance:
        options = dict(values)
        bodies = [self._obstacle(item) for item in options.pop("obstacles", [])]
        if "srdf" in options:
            # With what the arm's own xacro is given.
            robot = self.table["robot"]
            folders = [self._file_beside(name) for name in robot.get("packages", ())]
            srdf = self._file_beside(options.pop("srdf"))
            disabled = disabled_links(srdf, robot.get("arguments"), folders)
            self.notes.extend(srdf_notes(srdf, robot.get("arguments"), folders))
            options["disabled"] = (*options.get("disabled", ()), *disabled)
        return Clearance(tuple(bodies), **options)

    def _obstacle(self, values: Mapping[str, Any]) -> Any:
        return obstacle(values, self._file_beside)

    def _items(self, name: str, make: Callable[[Any], Any]) -> list[Any]:
        """Return what is made of each table of a list; errors name the list and the number."""
        items = []
        for k, item in enumerate(self.table[name]):
            with _naming_errors(self.file, f"{name}[{k}]"):
                items.append(make(item))
        return items

    def _plan_options(self) -> dict[str, Any]:
        """Return how the problem is planned: the rest of a `PlanRequest`."""
        table = self.table
        options: dict[str, Any] = {
            "goal": table.get("goal", "best"),
            "parts": table.get("parts"),
            "keep": table.get("keep"),
            "outputs": tuple(self._file_beside(name) for name in table.get("outputs", ())),
        }
        kinds: dict[str, Any] = {"search": Search, "tolerance": Tolerance}
        for name, kind in kinds.items():
            if name in table:
                with _naming_errors(self.file, name):
                    options[name] = kind(**table[name])
        if "optimiser" in table:
            with _naming_errors(self.file, "optimiser"):
                values = dict(table["optimiser"])
                if "line_search" in values:
                    values["line_search"] = LineSearch(**values["line_search"])
                options["optimizer"] = QuasiNewton(**values)
        if "max_evaluations" in table:
            options["max_evaluations"] = table["max_evaluations"]
        return options

    def _file_beside(self, name: str) -> FilePath:
        """Return the place of a file that the problem file names, from the folder of that."""
        return FilePath(name) if self.file is None else self.file.parent / name
