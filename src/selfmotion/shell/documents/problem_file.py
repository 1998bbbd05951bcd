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
    memory: dict[str, Any] | None = None,
) -> PlanRequest:
    """Return the job that a document describes; `file` is where it comes from. See `read_job`.

    Where many documents are read, those with the same arm share it by `memory`.
    """
    from selfmotion.shell.documents.checking import checked

    with _named(file, ""):
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
            file, table, functions, _degrees_per_joint(document), {} if memory is None else memory
        ).job()


@contextmanager
def _named(file: FilePath | None, key: str) -> Iterator[None]:
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


def _degrees_per_joint(document: Any, where: str = "") -> str:
    """Return the first key that gives degrees joint by joint, "" for none."""
    items: Any = ()
    if isinstance(document, Mapping):
        items = document.items()
    elif isinstance(document, list):
        items = enumerate(document)
    for key, value in items:
        # Where a joint slides, degrees make no sense.
        name = str(key)
        joints = name.endswith("_deg") and name.removesuffix("_deg") in PER_JOINT
        if joints and isinstance(value, list):
            return f"{where}{key}"
        found = _degrees_per_joint(value, f"{where}{key}.")
        if found:
            return found
    return ""


# Note on a file that says a clearance as one of its constraints.
_MOVED = (
    'constraints: kind = "Clearance" is read for one more version; give the table [clearance], or '
    "[[clearance]] of several"
)


@dataclass(frozen=True, eq=False)
class _Reader:
    """Makes the objects that a checked table describes."""

    file: FilePath | None
    table: Mapping[str, Any]
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    degrees: str = ""
    memory: dict[str, Any] = field(default_factory=dict)
    # What files that it names are taken to say.
    notes: list[str] = field(default_factory=list)

    def job(self) -> PlanRequest:
        table, file = self.table, self.file
        with _named(file, "robot"):
            robot = self._once(table["robot"], self._robot)
        self._check_degrees(robot)
        task = Task.of(table.get("task", "pose"))
        with _named(file, "start"):
            given = table.get("start", "free")
            asked = (table["robot"], given, task.value)
            start = self._once(asked, lambda _: start_of(given, robot, task))
        with _named(file, "path"):
            path = path_of(table["path"], robot, start, self._beside)
        options: dict[str, Any] = {"rest": table.get("rest", True)}
        if "also" in table:
            options["also"] = self._each("also", lambda item: self._follow(item, robot, start))
        if "null_motion" in table:
            with _named(file, "null_motion"):
                options["null_motion"] = restore(NullMotion, table["null_motion"])
        for name, make in (
            ("costs", lambda item: self._cost(item, robot)),
            ("constraints", self._constraint),
            ("relaxations", lambda item: Relaxation(**item)),
        ):
            if name in table:
                options[name] = self._each(name, make)
        if table.get("damping") is not None:
            with _named(file, "damping"):
                options["damping"] = Damping(**table["damping"])
        if isinstance(table.get("clearance"), list):
            options["clearance"] = self._each("clearance", self._clearance)
        elif "clearance" in table:
            with _named(file, "clearance"):
                one = table["clearance"]
                options["clearance"] = None if one is None else self._clearance(one)
        if clearances_among(options.get("constraints", ())):
            self.notes.append(_MOVED)
            options["constraints"], options["clearance"] = separate_clearances(
                options["constraints"], options.get("clearance", NO_OVERLAP)
            )
        with _named(file, ""):
            problem = Problem(robot, path, task, start, **options)
        if "joint_limits" in table:
            with _named(file, "joint_limits"):
                limits = read_joint_limits(self._beside(table["joint_limits"]), robot)
                self.notes.extend(joint_limit_notes(self._beside(table["joint_limits"]), robot))
                problem = replace(problem, constraints=(*problem.constraints, *limits))
        return PlanRequest(problem, **self._settings(), notes=tuple(self.notes))

    def _once(self, values: Any, make: Callable[[Any], Any]) -> Any:
        # With all digits of poses, which their own text leaves out.
        key = json.dumps(values, default=lambda pose: pose.homogeneous.tolist())
        if key not in self.memory:
            self.memory[key] = make(values)
        return self.memory[key]

    def _check_degrees(self, robot: RobotModel) -> None:
        slides = [name for name in robot.joint_names if robot.is_prismatic(name)]
        if self.degrees and slides:
            with _named(self.file, self.degrees):
                raise ProblemError(
                    f"joint '{slides[0]}' slides, its coordinate is in metres; give rad and m "
                    f"under the key without _deg"
                )

    def _robot(self, given: Mapping[str, Any]) -> RobotModel:
        # Copies: what is read describes other problems of a grid as well, and names cached objects.
        values = dict(given)
        parts = {name: dict(part) for name, part in values.pop("parts", {}).items()}
        values["bodies"] = [self._obstacle(item) for item in values.pop("bodies", [])]
        if "packages" in values:
            values["packages"] = [self._beside(name) for name in values["packages"]]
        for table in (values, *parts.values()):
            if "calibration" in table:
                table["calibration"] = self._beside(table["calibration"])
        if "parts" not in given:
            return load_robot(self._source(values), **values)
        for key in ("name", "file", "base", "arguments", "calibration"):
            if key in values:
                raise RobotError(f"{key}: is given in each of parts, where there are some")
        base, on, arguments, measured = (
            {part: item[key] for part, item in parts.items() if key in item}
            for key in ("base", "on", "arguments", "calibration")
        )
        robots = {part: self._source(item, f"parts.{part}: ") for part, item in parts.items()}
        return load_robot(
            robots, **values, base=base, on=on, arguments=arguments, calibration=measured
        )

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
        return name if file is None else self._beside(file)

    def _follow(self, given: Mapping[str, Any], robot: RobotModel, start: Array | None) -> Follow:
        if ("pose" in given) == ("path" in given):
            raise ProblemError("expected either path, or the pose that is held")
        values = dict(given)
        path = values.pop("pose", None)
        if path is None:
            path = path_of(values.pop("path"), robot, start, self._beside)
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
        given = dict(values)
        bodies = [self._obstacle(item) for item in given.pop("obstacles", [])]
        if "srdf" in given:
            # With what the arm's own xacro is given.
            robot = self.table["robot"]
            folders = [self._beside(name) for name in robot.get("packages", ())]
            srdf = self._beside(given.pop("srdf"))
            read = disabled_links(srdf, robot.get("arguments"), folders)
            self.notes.extend(srdf_notes(srdf, robot.get("arguments"), folders))
            given["disabled"] = (*given.get("disabled", ()), *read)
        return Clearance(tuple(bodies), **given)

    def _obstacle(self, values: Mapping[str, Any]) -> Any:
        return obstacle(values, self._beside)

    def _each(self, name: str, make: Callable[[Any], Any]) -> list[Any]:
        found = []
        for k, item in enumerate(self.table[name]):
            with _named(self.file, f"{name}[{k}]"):
                found.append(make(item))
        return found

    def _settings(self) -> dict[str, Any]:
        table = self.table
        found: dict[str, Any] = {}
        kinds: dict[str, Any] = {"search": Search, "tolerance": Tolerance}
        for name, kind in kinds.items():
            if name in table:
                with _named(self.file, name):
                    found[name] = kind(**table[name])
        if "optimiser" in table:
            with _named(self.file, "optimiser"):
                values = dict(table["optimiser"])
                if "line_search" in values:
                    values["line_search"] = LineSearch(**values["line_search"])
                found["optimizer"] = QuasiNewton(**values)
        if "max_evaluations" in table:
            found["max_evaluations"] = table["max_evaluations"]
        outputs = tuple(self._beside(name) for name in table.get("outputs", ()))
        found |= {"outputs": outputs, "goal": table.get("goal", "best")}
        return found | {"parts": table.get("parts"), "keep": table.get("keep")}

    def _beside(self, name: str) -> FilePath:
        return FilePath(name) if self.file is None else self.file.parent / name
