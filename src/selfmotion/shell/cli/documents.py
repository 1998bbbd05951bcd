"""Options of ``selfmotion plan`` as the table of a problem file."""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import typer

import selfmotion as sm
from selfmotion.basics import read_document, restore
from selfmotion.model.path import pose_of, spread_along
from selfmotion.shell.cli import options
from selfmotion.shell.cli.app import StageDisplay, plan_with_progress, stages
from selfmotion.shell.documents import (
    grid_documents,
    parse_setting,
    path_of,
    plan_request_of,
    seam_job_of,
    set_key,
)
from selfmotion.shop.cam import PATH_SUFFIXES, events_of, has_normals

# Of problem files.
SUFFIXES = (".toml", ".json")
# So many poses of a path are looked at for whether normals are meant the other way.
_LOOKS = 7
# Costs and their first number, the weight that --cost may give.
_WEIGHTS = ("weight", "mu")


@dataclass
class Shell:
    """The options that say what to plan, as typed."""

    path: options.PathOption = None
    circle: options.CircleOption = None
    line: options.LineOption = None
    normal: options.NormalOption = None
    duration: options.DurationOption = None
    feed: options.FeedOption = None
    jump: options.JumpOption = None
    seam: options.SeamOption = None
    columns: options.ColumnsOption = None
    flip_normals: options.FlipOption = False
    standoff: options.StandoffOption = None
    along: options.AlongOption = None
    lead: options.LeadOption = None
    tilt: options.TiltOption = None
    lift: options.LiftOption = None
    rotary: options.RotaryOption = None
    rotary_axes: options.RotaryAxesOption = None
    rotary_center: options.RotaryCenterOption = None
    unit: options.UnitOption = None
    frame: options.FrameOption = None
    ramp: options.RampOption = None
    corners: options.CornersOption = None
    corner_tolerance: options.CornerToleranceOption = None
    task: options.PlannedTaskOption = None
    relax: options.RelaxOption = None
    start: options.StartOption = None
    tool: options.ToolOption = None
    reference: options.ReferenceOption = None
    lock: options.LockOption = None
    argument: options.ArgumentOption = None
    packages: options.PackagesOption = None
    degree: options.DegreeOption = None
    mu: options.MuOption = 0.0
    cost: options.CostOption = None
    velocity: options.VelocityOption = None
    acceleration: options.AccelerationOption = None
    joint_limits: options.JointLimitsOption = None
    closed: options.ClosedOption = False
    obstacles: options.ObstaclesOption = None
    clearance: options.ClearanceOption = 0.0
    srdf: options.SrdfOption = None
    disabled: options.DisabledOption = None
    no_collision: options.NoCollisionOption = False
    damped: options.DampedOption = False

    @classmethod
    def of(cls, context: typer.Context) -> "Shell":
        """Return what was typed, of a command that has all these options."""
        return cls(**{field.name: context.params[field.name] for field in fields(cls)})

    def document(self, robot: str, warm_start: sm.Plan | None) -> dict[str, Any]:
        """Return the table."""
        held, arguments = options.locks(self.lock), options.arguments(self.argument)
        arm = sm.load_robot(
            robot,
            self.tool,
            held,
            reference=self.reference,
            arguments=arguments,
            packages=self.packages or (),
        )
        task = self.task or ("planar" if _is_planar(arm) else "pose")
        normal = self.normal or ("z" if task.startswith("planar") else "x")
        table: dict[str, Any] = {
            "robot": {
                "name" if robot in sm.NAMED_ARMS else "file": robot,
                "lock": held,
            },
            "task": task,
            "start": self._start(warm_start),
            "path": self._path(normal),
            "costs": self._costs(),
            "constraints": self._constraints(arm),
            "relaxations": [_relaxation(text) for text in self.relax or []],
            "damping": self.damped,
            "clearance": self._clearance(),
        }
        if self.degree is not None:
            table["null_motion"] = {"kind": "PolynomialNullMotion", "degree": self.degree}
        if self.joint_limits is not None:
            table["joint_limits"] = str(self.joint_limits)
        if arguments:
            table["robot"]["arguments"] = arguments
        if self.packages:
            table["robot"]["packages"] = [str(folder) for folder in self.packages]
        for name in ("tool", "reference"):
            if getattr(self, name) is not None:
                table["robot"][name] = getattr(self, name)
        return table

    @contextmanager
    def named(self) -> Iterator[None]:
        """Give errors the option, or the file and its entry, in place of a table's key."""
        try:
            yield
        except sm.errors.FileFormatError as error:
            found = _ENTRY.sub(lambda entry: f"{self.obstacles}: {entry[1]}", str(error))
            if found == str(error):
                raise
            raise sm.errors.FileFormatError(found) from error
        except sm.errors.RobotError as error:
            if self.start is None or not str(error).startswith("configuration "):
                raise
            raise sm.errors.RobotError(f"--start: {error}") from error

    def _start(self, warm_start: sm.Plan | None) -> Any:
        if self.start in _STARTS:
            return self.start
        if self.start is not None:
            return options.numbers(self.start, "--start").tolist()
        if self.path is not None:
            return "free"
        # Shapes are drawn from where the arm starts.
        return "dexterous" if warm_start is None else warm_start.trajectory.q[0].tolist()

    def _path(self, normal: str) -> dict[str, Any]:
        if sum(option is not None for option in (self.path, self.circle, self.line)) != 1:
            raise sm.errors.ProblemError(
                "give the tool motion by one of --path, --circle and --line"
            )
        if self.normal is not None and self.circle is None:
            raise sm.errors.ProblemError(
                "--normal is for --circle, and has no effect on another motion"
            )
        if self.path is not None:
            return path_table(self.path, vars(self))
        for name in OF_PATH:
            if name not in _OF_SHAPE and getattr(self, name) not in (None, False):
                raise sm.errors.ProblemError(
                    f"--{name.replace('_', '-')} is for --path: a shape is one, and rests at its "
                    f"ends"
                )
        if self.feed is not None and self.duration is not None:
            raise sm.errors.ProblemError("give the pace by one of --feed and --duration")
        pace = {"feed": self.feed} if self.feed is not None else {"duration": self.duration or 4.0}
        if self.circle is not None:
            axis = [float(normal == name) for name in "xyz"]
            return {"kind": "circle", "radius": self.circle, "normal": axis, **pace}
        by = options.numbers(self.line or "", "--line", 3).tolist()
        return {"kind": "line", "by": by, **pace}

    def _costs(self) -> list[dict[str, Any]]:
        costs = [_cost(text) for text in self.cost or []] or [{"kind": "JointVelocity"}]
        if self.mu != 0.0:
            costs.append({"kind": "InverseManipulability", "mu": self.mu})
        return costs

    def _constraints(self, arm: sm.RobotModel) -> list[dict[str, Any]]:
        speed: dict[str, Any] = {"kind": "JointVelocityLimits"}
        if self.velocity is not None:
            speed["limit"] = options.one_or_each(self.velocity, "--velocity")
        acceleration: dict[str, Any] = {"kind": "JointAccelerationLimits"}
        if self.acceleration is not None:
            acceleration["limit"] = options.one_or_each(self.acceleration, "--acceleration")
        found: list[dict[str, Any]] = [{"kind": "JointPositionLimits"}, speed, acceleration]
        found.append({"kind": "JointJerkLimits"})
        if sm.constraints.PositionDependentVelocityLimits().applies(arm):
            found.append({"kind": "PositionDependentVelocityLimits"})
        if self.closed:
            found.append({"kind": "ClosedPath"})
        return found

    def _clearance(self) -> bool | dict[str, Any]:
        """Return the table of the clearance, or whether the default one applies."""
        if not any((self.obstacles, self.srdf, self.disabled)) and self.clearance == 0.0:
            return not self.no_collision
        if self.no_collision:
            raise sm.errors.ProblemError(
                "--no-self-collision has no effect beside --obstacles, --clearance, --srdf and "
                "--disabled, which keep links apart from each other as well; leave out pairs "
                "by --disabled or --srdf"
            )
        bodies = [] if self.obstacles is None else options.obstacle_tables(self.obstacles)
        clearance: dict[str, Any] = {"obstacles": bodies, "distance": self.clearance}
        if self.srdf is not None:
            clearance["srdf"] = str(self.srdf)
        if self.disabled:
            clearance["disabled"] = options.disabled_pairs(self.disabled)
        return clearance


# Key of an entry of --obstacles in a table made of options.
_ENTRY = re.compile(r"clearance\.obstacles(\[\d+\])")
# Options of the shell that say how --path is read; those of `plan` and of `check`.
OF_PATH = (
    *("feed", "duration", "jump", "seam", "columns", "flip_normals", "standoff", "rotary"),
    *("rotary_axes", "rotary_center", "unit", "frame", "ramp", "corners", "corner_tolerance"),
    *("along", "lead", "tilt", "lift"),
)


# Options of the tool's inclination along the path, and of its lift in corners.
_LEANS = ("lead", "tilt", "lift")
# Starts that have a name, as in problem files.
_STARTS = ("home", "dexterous", "free")
# Those that a shape has as well.
_OF_SHAPE = ("feed", "duration")


def path_table(file: Path, typed: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table of a path of a file, by the options `OF_PATH` as typed."""
    names = ("seam", "feed", "duration", "jump", "ramp", "standoff", "rotary", "unit")
    given = {name: typed[name] for name in (*names, "rotary_axes", "along", *_LEANS)}
    given["columns"] = None if typed["columns"] is None else typed["columns"].split(",")
    given["flip_normals"] = typed["flip_normals"] or None
    if typed["rotary_center"] is not None:
        center = options.numbers(typed["rotary_center"], "--rotary-center", 3)
        given["rotary_center"] = center.tolist()
    given["tolerance"] = typed["corner_tolerance"]
    if typed["frame"] is not None:
        given["frame"] = options.pose(typed["frame"], "--frame")
    table = {"kind": "file", "file": str(file), "corners": typed["corners"] or "blend"}
    return table | {key: value for key, value in given.items() if value is not None}


def followed(file: Path, typed: Mapping[str, Any], robot: sm.RobotModel) -> sm.paths.Path:
    """Return the tool motion of a file, by the options `OF_PATH` as typed."""
    table = path_table(file, typed)
    if "frame" in table:
        table["frame"] = pose_of(table["frame"])
    return path_of(table, robot, None, Path)


def _is_planar(robot: sm.RobotModel) -> bool:
    """Whether an arm moves its tool in the plane of x and y only."""
    tasks = sm.Task
    return robot.can_follow(tasks.PLANAR) and not robot.can_follow(tasks.POSITION)


def read(
    context: typer.Context,
    given: str,
    settings: list[str],
    allow_code: bool,
    warm_start: sm.Plan | None = None,
) -> sm.files.PlanRequest:
    """Return the job of a problem file, or of a robot with the options of the shell.

    Options that say what a problem file says itself are refused beside one.
    """
    if Path(given).suffix.lower() in PATH_SUFFIXES:
        raise sm.errors.ProblemError(
            f"{given}: is a path, expected a robot or a problem file first: selfmotion plan panda "
            f"--path {given}"
        )
    if Path(given).suffix not in SUFFIXES:
        shell = Shell.of(context)
        document = shell.document(given, warm_start)
        with shell.named():
            return _with_settings(document, None, settings, allow_code)
    typed = _typed(context)
    if typed:
        raise sm.errors.ProblemError(
            f"{given}: the problem is in the file, so that {typed[0]} has no effect; change the "
            f"file, or use --set KEY=VALUE"
        )
    return of_file(Path(given), settings, allow_code)


def of_file(file: Path, settings: list[str], allow_code: bool) -> sm.files.PlanRequest:
    """Return the job of a problem file."""
    document = read_document(file)
    if "grid" in document:
        count = len(grid_documents(document))
        raise sm.errors.ProblemError(f"{file}: grid has {count} problems: use `selfmotion batch`")
    return _with_settings(document, file, settings, allow_code)


def first_that_runs(texts: Iterable[str], file: Path, job: bool) -> str:
    """Return the first of several problem files whose motion is verified.

    Raises
    ------
    ProblemError
        None is; the last one's reason is told.
    """
    reason = ""
    for text in texts:
        document = tomllib.loads(text)
        try:
            if job:
                with StageDisplay(stages) as display:
                    program = seam_job_of(document, file).plan(progress=display.stage)
                verified, reason = program.verified, program.verdict
            else:
                certificate = plan_with_progress(
                    plan_request_of(document, file).problem
                ).certificate
                verified, reason = certificate.verified, certificate.verdict
        except sm.errors.PlanError as error:
            verified, reason = False, str(error)
        if verified:
            return text
    raise sm.errors.ProblemError(
        f"{file}: no example was found that this arm follows: {reason}; give another link as "
        f"--tool, hold joints (--lock), or leave out links that are made one into the other "
        f"(--disabled; --no-self-collision leaves out all)"
    )


def document_of(file: Path, settings: list[str]) -> dict[str, Any]:
    """Return what a file says, with what is set besides."""
    document = read_document(file)
    _set(document, settings)
    return document


def seams_of_file(file: Path, settings: list[str], allow_code: bool) -> sm.files.SeamJob:
    """Return the job of a file with seams."""
    document = document_of(file, settings)
    job = seam_job_of(document, file, allow_code=allow_code)
    # A file with code of its own is not read twice for this.
    if not allow_code:
        _print_flip_of_seams(document, file, job)
    return job


def _set(document: dict[str, Any], settings: list[str]) -> None:
    pairs = [parse_setting(text) for text in settings]
    # The same in another unit is the same.
    keys = [key.removesuffix("_deg").removesuffix("_mm") for key, _ in pairs]
    options.refuse_twice("--set", keys)
    for key, value in pairs:
        set_key(document, key, value)


def _with_settings(
    document: dict[str, Any], file: Path | None, settings: list[str], allow_code: bool
) -> sm.files.PlanRequest:
    _set(document, settings)
    job = plan_request_of(document, file, allow_code=allow_code)
    _print_left_out(document, file)
    _print_flip(document, file, job)
    return job


def _print_flip(document: dict[str, Any], file: Path | None, job: sm.files.PlanRequest) -> None:
    """Print that normals seem to point the other way, where only so the path is in reach."""
    path = document.get("path")
    if not (isinstance(path, dict) and path.get("kind") == "file"):
        return
    if not has_normals((file.parent if file else Path()) / str(path.get("file")), path):
        return
    problem = job.problem
    if _is_in_reach(problem.robot, problem.path, problem.task):
        return
    other = plan_request_of({**document, "path": _flipped(path)}, file).problem
    if _is_in_reach(other.robot, other.path, other.task):
        _flip_text("the path", path)


def _print_flip_of_seams(document: dict[str, Any], file: Path, job: sm.files.SeamJob) -> None:
    """Print the same of a job's first seam."""
    seams, first = document["seams"], job.seams[0]
    listed = isinstance(seams, list)
    path = seams[0].get("path") if listed else {**seams, "seam": first.name}
    if not (isinstance(path, dict) and has_normals(file.parent / str(path.get("file")), path)):
        return
    if _is_in_reach(job.robot, first.path, sm.Task(first.task)):
        return
    turned = [{**seams[0], "path": _flipped(path)}, *seams[1:]] if listed else _flipped(seams)
    other = seam_job_of({**document, "seams": turned}, file)
    if _is_in_reach(other.robot, other.seams[0].path, sm.Task(first.task)):
        _flip_text(f"seam '{first.name}'", path)


def _flipped(table: dict[str, Any]) -> dict[str, Any]:
    return {**table, "flip_normals": not table.get("flip_normals", False)}


def _flip_text(what: str, table: dict[str, Any]) -> None:
    flips = not table.get("flip_normals", False)
    said = "with --flip-normals (flip_normals)" if flips else "without flipping the normals"
    stages.print(
        f"note: poses of {what} are out of reach as read, and in reach {said}: nx,ny,nz is "
        f"the tool's z axis here, into the part; surface normals of CAD point out of it",
        markup=False,
        soft_wrap=True,
    )


def _is_in_reach(robot: sm.RobotModel, path: sm.paths.Path, task: sm.Task) -> bool:
    """Return whether some poses of a path are in reach, each on its own."""
    q = None
    for t in spread_along(path, _LOOKS):
        try:
            q = robot.inverse_kinematics(path.pose(t), task, q, attempts=8)
        except sm.errors.InverseKinematicsError:
            return False
    return True


def _print_left_out(document: dict[str, Any], file: Path | None) -> None:
    """Print which events of a table or a program of a machine tool a path leaves out."""
    path = document.get("path")
    if not (isinstance(path, dict) and path.get("kind") == "file"):
        return
    events = events_of((file.parent if file else Path()) / str(path.get("file")), path)
    if events:
        verb = "are" if len(events) > 1 else "is"
        text = f"note: {', '.join(events)} {verb} left out: `selfmotion job` keeps what happens"
        stages.print(text, markup=False, soft_wrap=True)


def _typed(context: typer.Context) -> list[str]:
    """Return those of the options of `Shell` that were typed."""
    names = {field.name for field in fields(Shell)}
    return [
        parameter.opts[0]
        for parameter in context.command.params
        if parameter.name in names
        and str(context.get_parameter_source(parameter.name or "")).endswith("COMMANDLINE")
    ]


def costs_of(texts: Sequence[str], robot: sm.RobotModel) -> list[sm.costs.Cost]:
    """Return the costs that are named as NAME or NAME=WEIGHT, for an arm."""
    return [restore(sm.costs.Cost, _cost(text), robot=robot) for text in texts]


def _cost(text: str) -> dict[str, Any]:
    kind, mark, value = text.partition("=")
    known = sm.costs.Cost.kinds()
    if kind not in known:
        raise sm.errors.ProblemError(
            f"--cost is '{text}', expected NAME or NAME=WEIGHT, NAME one of: {', '.join(known)}"
        )
    if not mark:
        return {"kind": kind}
    names = [name for name in _WEIGHTS if name in known[kind].__annotations__]
    names = names or [name for name in _WEIGHTS if hasattr(known[kind], name)]
    if not names:
        raise sm.errors.ProblemError(f"--cost: {kind} has no weight; give it without =")
    return {"kind": kind, names[0]: float(options.numbers(value, "--cost", 1)[0])}


def _relaxation(text: str) -> dict[str, Any]:
    found = options.relaxation(text).to_dict()
    return {key: value for key, value in found.items() if value is not None}
