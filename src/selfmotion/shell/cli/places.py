"""The command that looks for the place of a part, or of an arm."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

import selfmotion as sm
from selfmotion.basics import DOCUMENT_SUFFIXES, write_document
from selfmotion.shell.cli import documents, options, result_json
from selfmotion.shell.cli.app import (
    PLAN,
    StageDisplay,
    app,
    print_json,
    print_written,
    stages,
    terminal,
)
from selfmotion.shell.documents import SeamJob, belonging, moved_workpiece
from selfmotion.work.batch import processes

# Suffixes of pages and pictures.
_PAGE_SUFFIXES = (".html", ".png")


@app.command(
    epilog="Example: selfmotion place cell.toml --within x=-0.2,0.2 --within yaw=-0.5,0.5 --part "
    "block --out placed.toml --map map.html",
    rich_help_panel=PLAN,
)
def place(
    files: options.DocumentsArgument,
    within: Annotated[
        list[str] | None,
        typer.Option(
            metavar="COORDINATE=LOW,HIGH",
            help="Range of x, y, z (m), roll, pitch or yaw (rad), as x=-0.2,0.2. Repeatable.",
        ),
    ] = None,
    of: options.OfOption = None,
    part: options.PartOption = None,
    center: options.CenterOption = None,
    workers: options.WorkersOption = None,
    deadline: options.DeadlineOption = None,
    out: options.OutOption = None,
    drawn: options.MapOption = None,
    points: Annotated[int, typer.Option(help="Points of the map in each direction.", min=2)] = 9,
    settings: options.SetOption = None,
    allow_code: options.AllowCodeOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Find the place of the part, or of the arm, at which the motions cost least.

    Of problem files of one arm, or of the problems of plans (.npz). Problem files
    and plans (.npz) are written as --out, of several problems numbered.
    Of a job all seams are placed together, and a job file is written. What stands in the frame of
    a file's workpiece belongs to the part.
    """
    moved = _moved(of or ["part"])
    request = _Asked(
        tuple(files),
        tuple(out or ()),
        moved == "base",
        part,
        moved == "path",
        documents.DocumentOptions(settings),
    )
    request.check(drawn or [])
    read = request.documents()
    job = request.job(read, allow_code)
    problems = request.problems(allow_code) if job is None else list(job.problems)
    bounds = options.ranges(within)
    move_options = request.moving(read, center)
    if job is not None and out:
        _check_moved_bodies(files[0], read[0], job, move_options.get("part", ()))
    placement = _placed(workers, problems, bounds, deadline=deadline, **move_options)
    if not as_json:
        terminal.print(str(placement), markup=False, soft_wrap=True)
    written = list[Path]()
    for file in out or []:
        if job is None:
            written += _write(placement, file)
        else:
            written.append(_write_job(placement, read[0], problems[0], file))
    if drawn:
        _draw(placement, drawn, placement.map(points=points) if len(bounds) > 1 else None)
        written += drawn
    if as_json:
        print_json(result_json.placement_json(placement) | {"written": [*map(str, written)]})
    else:
        print_written(written)


def _moved(of: Sequence[str]) -> str:
    """Return the one thing that is moved."""
    if len(of) != 1 or of[0] not in _MOVED:
        raise sm.errors.ProblemError(
            f"--of is {', '.join(of)}, expected one of {', '.join(_MOVED)}"
        )
    return of[0]


_MOVED = ("part", "base", "path")


def _placed(workers: int | None, *given: Any, **settings: Any) -> sm.placement.Placement:
    """Return the best place, looked for in processes where `workers` are given; see `place`."""
    with ExitStack() as stack:
        display = stack.enter_context(StageDisplay(stages))
        if workers is not None:
            settings["executor"] = stack.enter_context(processes(workers))
        return sm.place(*given, progress=display.stage, **settings)


@dataclass(frozen=True)
class _Asked:
    """What is to be placed, and how it moves.

    Attributes
    ----------
    files, out : tuple of Path
    base, path_alone : bool
    part : list of str or None
    said : DocumentOptions
    """

    files: tuple[Path, ...]
    out: tuple[Path, ...]
    base: bool
    part: list[str] | None
    path_alone: bool
    said: documents.DocumentOptions

    def check(self, drawn: Sequence[Path]) -> None:
        """Raise where options contradict each other, or a file is of no known kind."""
        if self.part and self.path_alone:
            raise sm.errors.ProblemError(
                "--part and --of path say different things; give one of them"
            )
        for file in [*self.out, *drawn]:
            suffixes = (*DOCUMENT_SUFFIXES, ".npz") if file in self.out else _PAGE_SUFFIXES
            if file.suffix not in suffixes:
                raise sm.errors.FileFormatError(
                    f"{file}: expected a name that ends in {', '.join(suffixes)}"
                )

    def documents(self) -> list[Mapping[str, Any]]:
        """Return the documents of the files; an error where a job is one of several."""
        read = [
            {} if file.suffix == ".npz" else documents.document_of(file, self.said.settings)
            for file in self.files
        ]
        jobs = [file for file, found in zip(self.files, read, strict=True) if "seams" in found]
        if jobs and len(self.files) > 1:
            raise sm.errors.ProblemError(f"{jobs[0]}: is a job of many seams; give it alone")
        return list(read)

    def job(self, read: Sequence[Mapping[str, Any]], allow_code: bool) -> SeamJob | None:
        """Return the job that the file describes, which can be written at its place, or None."""
        if "seams" not in read[0]:
            return None
        job = documents.seams_of_file(self.files[0], self.said.settings, allow_code)
        _check_placed_jobs(self.files[0], self.out, self.base)
        return job

    def problems(self, allow_code: bool) -> list[sm.Problem]:
        """Return the problems of the files."""
        return [documents.problem_of(file, self.said, allow_code) for file in self.files]

    def moving(self, read: Sequence[Mapping[str, Any]], center: str | None) -> dict[str, Any]:
        """Return what moves, as `place` is told: the arm's base, or the part with its bodies."""
        if not (self.base or self.part or self.path_alone):
            for file, document in zip(self.files, read, strict=True):
                _check_stands(file, document)
        known_parts = [names for names in map(belonging, read) if names is not None]
        move_options: dict[str, Any] = {"of": "base" if self.base else "part"}
        if self.part or self.path_alone:
            move_options["part"] = self.part or ()
        elif known_parts and not self.base:
            move_options["part"] = sorted({name for names in known_parts for name in names})
        if center is not None:
            move_options["center"] = options.numbers(center, "--center", 3)
        return move_options


def _write_job(
    placement: sm.placement.Placement, document: Mapping[str, Any], problem: sm.Problem, file: Path
) -> Path:
    """Write the document of a job with its workpiece moved to the place."""
    # Paths are in the frame of the reference, which need not be the world.
    frame = problem.follows.items[0].chain.base_placement
    by = frame.inverse() * placement.displacement * frame
    write_document(file, moved_workpiece(document, by))
    return file


def _draw(placement: sm.placement.Placement, drawn: Sequence[Path], pictured: Any) -> None:
    """Write maps of places, as pages or pictures; of one coordinate there is no picture."""
    for file in drawn:
        if file.suffix == ".html":
            sm.files.write_placement(placement, file, pictured)
        elif pictured is None:
            raise sm.errors.ProblemError(f"{file}: a picture of places is over two coordinates")
        else:
            pictured.figure().savefig(file)


def _check_placed_jobs(job: Path, out: Sequence[Path], base: bool) -> None:
    """Raise where a job at its place cannot be written."""
    for file in out:
        if base:
            raise sm.errors.ProblemError(
                f"{file}: a job whose arm's base is moved is not written; set robot.base to the "
                f"place that is found"
            )
        if file.suffix not in DOCUMENT_SUFFIXES or file.resolve().parent != job.resolve().parent:
            raise sm.errors.FileFormatError(
                f"{file}: expected a job file ({', '.join(DOCUMENT_SUFFIXES)}) beside {job}, whose "
                f"files it names"
            )


def _check_stands(file: Path, document: Mapping[str, Any]) -> None:
    """Raise where bodies of a workpiece are not in the world, where places are."""
    link = document["workpiece"].get("on") if belonging(document) else None
    if link is not None:
        raise sm.errors.ProblemError(
            f"{file}: the workpiece is on '{link}', and its bodies with it; a part is placed in "
            f"the world: leave out workpiece.on, or give --of base"
        )


def _check_moved_bodies(
    file: Path, document: Mapping[str, Any], job: SeamJob, part: Sequence[str]
) -> None:
    """Raise where moving its workpiece would not move what was placed of a job."""
    own_bodies = belonging(document) or ()
    if set(part) != set(own_bodies):
        raise sm.errors.ProblemError(
            f"{file}: a job is written at its place with its [workpiece] moved, to which belongs "
            f"{', '.join(own_bodies) or 'no obstacle'}, not {', '.join(part) or 'nothing'}; "
            f"have in workpiece.obstacles what moves along, or leave out --out"
        )
    frame = job.problems[0].follows.items[0].chain.base_placement
    is_on = (document.get("workpiece") or {}).get("on") is not None
    bodies = own_bodies or any(seam.leaves for seam in job.seams)
    if bodies and not is_on and not frame.isIdentity(1e-9):
        raise sm.errors.ProblemError(
            f"{file}: paths are in the frame of '{job.robot.reference}', bodies of the workpiece "
            f"in the world, so that no frame of the workpiece moves both alike; leave out "
            f"robot.reference, or --out"
        )


def _write(placement: sm.placement.Placement, file: Path) -> list[Path]:
    """Write the problems or plans of a place, numbered where they are several."""
    several, written = len(placement.plans) > 1, list[Path]()
    for number, plan in enumerate(placement.plans):
        named = file.with_stem(f"{file.stem}-{number}") if several else file
        if named.suffix == ".npz":
            plan.save(named)
        else:
            sm.files.write_problem(plan.problem, named)
        written.append(named)
    return written
