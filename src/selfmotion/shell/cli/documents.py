"""Documents that commands are given: problem files, or a robot, and what the shell says of it."""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import selfmotion as sm
from selfmotion.basics import ARCHIVE_SUFFIXES, DOCUMENT_SUFFIXES, read_document
from selfmotion.model.path import spread_along
from selfmotion.shell.cli import options
from selfmotion.shell.cli.app import StageDisplay, plan_with_progress, stages
from selfmotion.shell.documents import (
    flipped_normals,
    grid_documents,
    json_schema,
    named_from,
    parse_setting,
    plan_request_of,
    problem_document,
    seam_job_of,
    set_key,
)
from selfmotion.shop.cam import PATH_SUFFIXES, events_of, has_normals

# So many poses of a path are looked at for whether normals are meant the other way.
_LOOKS = 7


@dataclass(frozen=True)
class DocumentOptions:
    """What the shell says of a document: short forms of keys, and keys.

    Attributes
    ----------
    settings : list of str, optional
        ``KEY=VALUE`` of `--set`.
    path, feed, frame, task, start, tool : optional
        As typed.
    """

    settings: Sequence[str] | None = None
    path: Path | None = None
    feed: float | None = None
    frame: str | None = None
    task: str | None = None
    start: str | None = None
    tool: str | None = None

    def set_in(self, document: dict[str, Any], folder: Path) -> None:
        """Set it in a document of a folder, from where its files are named.

        Raises
        ------
        ProblemError
            Something is said twice.
        """
        before, after = dict[str, Any](), dict[str, Any]()
        if self.path is not None:
            path = {"kind": "file", "file": str(self.path)}
            before["path"] = named_from(path, Path.cwd(), folder.resolve(), "path")
        settings = [parse_setting(text, folder) for text in self.settings or ()]
        if self.feed is not None:
            after["path.feed"] = self.feed
        if self.frame is not None:
            after["path.frame"] = options.pose(self.frame, "--frame")
        for key, value in (("task", self.task), ("robot.tool", self.tool)):
            if value is not None:
                after[key] = value
        if self.start is not None:
            named = self.start in _STARTS
            after["start"] = (
                self.start if named else options.numbers(self.start, "--start").tolist()
            )
        pairs = [*before.items(), *settings, *after.items()]
        refuse_same_keys(pairs)
        for key, value in pairs:
            set_key(document, key, value)

    @property
    def by_option(self) -> dict[str, Any]:
        """What was typed, by the option."""
        names = ("path", "feed", "frame", "task", "start", "tool")
        return {"set": self.settings, **{name: getattr(self, name) for name in names}}


# Keys of a problem file that say how to plan, and nothing of the motion.
HOW_TO_PLAN = (
    *("goal", "keep", "parts", "search", "optimiser", "tolerance", "max_evaluations", "outputs"),
)
# Starts that have a name, as in problem files.
_STARTS = ("home", "dexterous", "free")
# Tool motions that may begin where the arm does.
_SHAPES = ("circle", "line", "spiral")


def refuse_same_keys(pairs: Iterable[tuple[str, Any]]) -> None:
    """Raise ProblemError where a key is set twice; the same in another unit is the same."""
    keys = [key.removesuffix("_deg").removesuffix("_mm") for key, _ in pairs]
    options.refuse_twice("--set", keys)


def document_of(file: Path, settings: Sequence[str] | None) -> dict[str, Any]:
    """Return what a file says, with what is set besides."""
    document = read_document(file)
    DocumentOptions(settings).set_in(document, file.parent)
    return document


def read(
    given: str,
    said: DocumentOptions,
    allow_code: bool = False,
    *,
    start: Any = None,
    usual: Mapping[str, Any] | None = None,
) -> sm.files.PlanRequest:
    """Return the request of a problem file, or of a robot, with what the shell says of it.

    Of a robot alone there are `usual` keys besides, and a shape begins at a `start`, by default
    the dexterous one.
    """
    if Path(given).suffix.lower() in PATH_SUFFIXES:
        raise sm.errors.ProblemError(
            f"{given}: is a path, expected a robot or a problem file first: selfmotion plan panda "
            f"--path {given}"
        )
    if Path(given).suffix in ARCHIVE_SUFFIXES:
        raise sm.errors.ProblemError(
            f"{given}: holds motions that are planned, expected a robot or a problem file; "
            f"planning begins at the motion of a plan (.npz) that is given as --from"
        )
    if Path(given).suffix in DOCUMENT_SUFFIXES:
        return of_file(Path(given), said, allow_code)
    document: dict[str, Any] = {"robot": {"name" if given in sm.NAMED_ARMS else "file": given}}
    document |= usual or {}
    said.set_in(document, Path())
    path = document.get("path")
    kind = path.get("kind") if isinstance(path, dict) else None
    if kind is None and _are_known(document):
        raise sm.errors.ProblemError(
            'give the tool motion: --path FILE, or --set \'path={kind="circle", radius=0.1, '
            "duration=4}' (or another kind of path, see `selfmotion schema`)"
        )
    if kind in _SHAPES and "start" not in {**document, **(path or {})}:
        document["start"] = "dexterous" if start is None else start
    return _request_of(document, None, allow_code)


def _are_known(document: Mapping[str, Any]) -> bool:
    """Whether a document has no other keys at its top than problem files have."""
    return set(document) <= set(json_schema()["properties"])


def of_file(file: Path, said: DocumentOptions, allow_code: bool = False) -> sm.files.PlanRequest:
    """Return the request of a problem file, with what the shell says of it."""
    document = read_document(file)
    if "grid" in document:
        count = len(grid_documents(document))
        raise sm.errors.ProblemError(f"{file}: grid has {count} problems: use `selfmotion batch`")
    said.set_in(document, file.parent)
    return _request_of(document, file, allow_code)


def problem_of(file: Path, said: DocumentOptions, allow_code: bool = False) -> sm.Problem:
    """Return the problem of a problem file, or of a plan."""
    if file.suffix != ".npz":
        return of_file(file, said, allow_code).problem
    return changed(sm.load_plan(file).problem, said)


def changed(problem: sm.Problem, said: DocumentOptions) -> sm.Problem:
    """Return a problem with keys of its file set otherwise; the same one where nothing is said.

    Raises
    ------
    ProblemError
        A key says how to plan, or the problem is none with it.
    """
    if not any(said.by_option.values()):
        return problem
    refuse_how_to_plan(said)
    document = problem_document(problem, Path("problem.toml"))
    said.set_in(document, Path())
    return plan_request_of(document).problem


def refuse_how_to_plan(said: DocumentOptions, besides: str = "") -> None:
    """Raise ProblemError for a key that says how to plan a motion that is there.

    All but `besides`, a key that has an effect.
    """
    _refuse_keys(
        said,
        [part for part in HOW_TO_PLAN if part != besides],
        "says how to plan, and this motion is there already: leave it out (what check allows: "
        "--tolerance, --turn)",
    )


def refuse_costs(said: DocumentOptions) -> None:
    """Raise ProblemError for keys of costs, which no verdict depends on."""
    reason = "a verdict does not depend on costs: leave it out (compare tells what motions cost)"
    _refuse_keys(said, ["costs"], reason)


def _refuse_keys(said: DocumentOptions, parts: Sequence[str], reason: str) -> None:
    """Raise ProblemError, with a reason, where a key of some parts of a document is set."""
    for text in said.settings or ():
        key, _ = parse_setting(text)
        if key.partition(".")[0] in parts:
            raise sm.errors.ProblemError(f"--set {key}: {reason}")


def first_that_runs(texts: Iterable[str], file: Path, job: bool) -> str:
    """Return the first of several problem files whose motion is verified.

    Raises
    ------
    ProblemError
        None is; the last one's reason is reported.
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
        f"--tool, hold joints (--set robot.lock.NAME=VALUE), or leave out links that are made one "
        f'into the other (--set \'clearance.disabled=[["LINK", "LINK"]]\'; clearance=false leaves '
        f"out all)"
    )


def seams_of_file(file: Path, settings: Sequence[str] | None, allow_code: bool) -> sm.files.SeamJob:
    """Return the job of a file with seams, with what is set besides."""
    document = document_of(file, settings)
    job = seam_job_of(document, file, allow_code=allow_code)
    # A file with code of its own is not read twice for this.
    if not allow_code:
        _print_flip_of_seams(document, file, job)
    return job


def _request_of(
    document: dict[str, Any], file: Path | None, allow_code: bool
) -> sm.files.PlanRequest:
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
    flipped, said = flipped_normals(path)
    other = plan_request_of({**document, "path": flipped}, file).problem
    if _is_in_reach(other.robot, other.path, other.task):
        _flip_text("the path", said)


def _print_flip_of_seams(document: dict[str, Any], file: Path, job: sm.files.SeamJob) -> None:
    """Print the same of a job's first seam."""
    seams, first = document["seams"], job.seams[0]
    listed = isinstance(seams, list)
    path = seams[0].get("path") if listed else {**seams, "seam": first.name}
    if not (isinstance(path, dict) and has_normals(file.parent / str(path.get("file")), path)):
        return
    if _is_in_reach(job.robot, first.path, sm.Task(first.task)):
        return
    flipped, said = flipped_normals(path if listed else seams)
    turned = [{**seams[0], "path": flipped}, *seams[1:]] if listed else flipped
    other = seam_job_of({**document, "seams": turned}, file)
    if _is_in_reach(other.robot, other.seams[0].path, sm.Task(first.task)):
        _flip_text(f"seam '{first.name}'", said)


def _flip_text(what: str, said: str) -> None:
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
