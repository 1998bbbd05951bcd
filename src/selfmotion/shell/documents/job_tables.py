"""The tables of job files: seams, as a list or in a file, and how they are planned."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from selfmotion.basics import FileFormatError, ProblemError, is_file, shown
from selfmotion.model.path import Feed, Path, with_run_ups
from selfmotion.model.task import Task
from selfmotion.problem.constraints import NO_OVERLAP, as_clearances, separate_clearances
from selfmotion.problem.problem import KEPT
from selfmotion.shell.documents.body_tables import CarriedBody, WorkpieceTable
from selfmotion.shell.documents.field_checks import of_kind
from selfmotion.shell.documents.field_types import (
    Checked,
    Flag,
    Length,
    Number,
    SeveralNames,
    Start,
    Text,
    Whole,
    key,
    needed,
)
from selfmotion.shell.documents.one_of import Either
from selfmotion.shell.documents.path_base import Events, after
from selfmotion.shell.documents.path_tables import ToolMotion
from selfmotion.shell.documents.pose_tables import FilePoses
from selfmotion.shell.documents.problem_table import PartTable, SharedTable, start_of
from selfmotion.shell.documents.seam_job import SeamJob
from selfmotion.shell.documents.tables import Context, Table
from selfmotion.shop.cam import UNJUDGED, read_seams, times_of_events
from selfmotion.work.job import FASTEST_FEED, Seam, problem_of_seam

# Value of `feed` that asks for the highest feed.
HIGHEST = "highest"
# At this share of the highest feed that is tried a file is read first, for all that it says.
_SLOW = 0.01


def _feed(value: Any) -> Any:
    return value if value == HIGHEST else of_kind((int, float), f"a number, or '{HIGHEST}'")(value)


_PAIRS = {"type": "array", "items": {"type": "array", "minItems": 2, "maxItems": 2}}
_FEED = {"anyOf": [{"type": "number"}, {"const": HIGHEST}]}
_Events = Annotated[list[Any], Checked(of_kind(list, "a list"), _PAIRS)]
_Feed = Annotated[Any, Checked(_feed, _FEED, ("_mm",))]


@dataclass(frozen=True)
class _Shared:
    """What the seams of a job have in common."""

    task: Task
    parts: Mapping[str, Any]
    constraints: list[Any]
    clearance: Any
    piece: WorkpieceTable | None


class SeamKeys(PartTable):
    """What is said of a seam besides its path."""

    either_way: Flag = key("Whether it may be made from its end to its start.", True)
    after: SeveralNames = key("Names of the seams that have to be made before it.")
    after_any: SeveralNames = key("Names of seams of which one has to be made before it.")
    wait: Number = key("How long the arm rests after it [s].", 0.0)
    events: _Events = key(
        'What happens how long after its start [s], whichever way it is made: `["arc on", 0.1]`.'
    )
    leaves: list[CarriedBody] = key("Bodies that are there from then on.", [])
    may_meet: SeveralNames = key(
        "Names of what others leave that it may meet, and the moves that lead to and from it."
    )

    def build(
        self, context: Context, shared: _Shared, name: str, path: Path, said: Mapping[str, Any]
    ) -> Seam:
        """Return the seam of a path; `said` is what its file says besides."""
        piece = shared.piece
        where = () if piece is None else (piece.place, piece.on)
        own = context.each("constraints", self.constraints or ())
        others, clearances = separate_clearances(own, ())
        keys = ("either_way", "after", "after_any", "wait", "events", "may_meet")
        with context.naming():
            seam = Seam(
                name,
                path,
                shared.task if self.task is None else self.task,
                constraints=[*others, *clearances],
                leaves=[body.build(context, *where) for body in self.leaves],
                **{**shared.parts, **self.built(context, "costs", "relaxations")},
                **{**{name: x for name, x in self.given.items() if name in keys}, **said},
            )
            apart = as_clearances(shared.clearance)
            problem = problem_of_seam(context.robot, seam, shared.constraints, apart)
            return replace(seam, costs=problem.costs)


class SeamTable(SeamKeys):
    """A seam: what is made once."""

    name: Text = needed("What it is called; each seam of a job has its own name.")
    path: ToolMotion = needed("The tool motion.")

    def seams(self, job: Context, shared: _Shared) -> Iterator[Seam]:
        """Yield the seam."""
        context, said = job.inside(f"seams, '{self.name}'"), dict[str, Any]()
        with context.naming("path"):
            if self.events is None:
                events, one_way = self.path.file_events(context)
                said |= {"events": events} if events else {}
                if (events or one_way) and "either_way" not in self.given:
                    said["either_way"] = False
            path = self.path.build(context, None if shared.piece is None else shared.piece.place)
        yield self.build(context, shared, self.name, path, said)


class SeamsFile(FilePoses, SeamKeys):
    """The seams of a file with a column `seam`, or of a program of a machine tool."""

    feed: _Feed = key(
        'Speed of the tool [m/s], from rest to rest, where the file has no times; or "highest", '
        "the highest one at which all are kept."
    )
    most_feed: Length = key('With feed = "highest": no more than this [m/s].')
    run_up: Flag = key(
        "Whether the tool runs up before the seam and stops behind it, so that it has its feed "
        "from begin to end.",
        False,
    )

    def seams(self, job: Context, shared: _Shared) -> Iterator[Seam]:
        """Yield the seams of the file."""
        file, place = job.beside(self.file), None if shared.piece is None else shared.piece.place
        changed = file.stat().st_mtime_ns if is_file(file) else 0
        with job.naming("seams"):
            # The same file is read once for many documents.
            described = ["seams", file, changed, self.reading]
            read = job.once(described, lambda: read_seams(file, self.reading))
        # What a machine switches stays switched in the cuts that follow: they keep their order.
        switched = any(rows.one_way and rows.events for _, rows in read.values())
        before = ""
        for name, (path, rows) in read.items():
            context, said = job.inside(f"seams, '{name}'"), dict[str, Any]()
            events = times_of_events(path, rows)
            with context.naming():
                path = path if self.weave is None else self.weave.applied(path)
                if self.run_up:
                    path, events = _run_up(path, events)
                if self.leads is not None:
                    events = after(events, self.leads.delay(path))
                path = self.placed(context, path, place)
            if events:
                said["events"] = [*events, *(self.events or ())]
            if (events or rows.one_way) and "either_way" not in self.given:
                # What happens where, and how a machine cuts, is meant one way.
                said["either_way"] = False
            if switched and before and "after" not in self.given:
                said["after"] = [before]
            yield self.build(context, shared, name, path, said)
            before = name


def _run_up(path: Path, events: Events) -> tuple[Path, Events]:
    """Return a path with run-ups, and its events as much later."""
    if not isinstance(path, Feed):
        raise ProblemError("run_up: is of seams with a feed, not a weave")
    stroke = with_run_ups(path)
    # When the same places are passed.
    original = path.pace(np.array([at for _, at in events]))[0] if events else np.zeros(0)
    first, _ = stroke.path.pace(np.array([stroke.begin]))
    times = stroke.path.when(first[0] + original) if events else original
    return stroke.path, [(name, float(at)) for (name, _), at in zip(events, times, strict=True)]


class JobTable(Table):
    """How a job is planned."""

    start: Start = key("Where it begins [rad or m]; by default at the first seam.", "free")
    end: Start = key("Where it ends [rad or m]; by default at the last seam.", "free")
    order: Literal["free", "given"] = key(
        "Whether the order is looked for, within what seams say comes after others, or is that of "
        "the list.",
        "free",
    )
    branches: Whole = key("Motions in different configurations that are planned for a seam.", 4)
    seconds_per_cost: Number = key(
        "What a unit of a seam's cost counts, beside the time of moves [s]; by default only time "
        "counts.",
        0.0,
    )
    move_seconds: Number = key(
        "After so many seconds of the processor a move counts as not found. A move that takes "
        "nearly as long may be found on one machine, and not on another.",
        10.0,
    )
    rng: Whole = key("Seed of everything that is drawn.", 0)

    def build(self, context: Context, task: Task) -> dict[str, Any]:
        """Return the settings of `plan_job`."""
        values = self.given
        for name in ("start", "end"):
            if name in values:
                with context.naming(f"job: {name}"):
                    values[name] = start_of(values[name], context.robot, task)
        return values


class JobFile(SharedTable):
    """A job of many seams."""

    job: JobTable = key()
    seams: Annotated[list[SeamTable] | SeamsFile, Either()] = needed(
        "Seams of a job, for `selfmotion job`: a list, or one table with a file of them."
    )

    def build(self, context: Context) -> SeamJob:
        """Return the job, at the highest feed where that is asked for."""
        if isinstance(self.seams, SeamsFile):
            if self.seams.feed == HIGHEST:
                return self._at_highest(context, self.seams)
            if self.seams.most_feed is not None:
                raise FileFormatError(
                    f"{context.file}: seams: most_feed: has no effect where feed is a number; give "
                    f"feed = '{HIGHEST}', or leave it out"
                )
        task = self.arm(context)
        kept, parts = self.kept(context), self.built(context, "costs", "relaxations")
        constraints = [*kept.get("constraints", KEPT), *self.limits(context)]
        apart = kept.get("clearance", NO_OVERLAP)
        shared = _Shared(task, parts, constraints, apart, self.workpiece)
        entries = self.seams if isinstance(self.seams, list) else [self.seams]
        seams = tuple(seam for entry in entries for seam in entry.seams(context, shared))
        settings = {} if self.job is None else self.job.build(context, task)
        if apart is not NO_OVERLAP:
            settings["clearance"] = apart
        is_cut = any(UNJUDGED in seam.path.notes for seam in seams)
        return SeamJob(
            context.robot,
            seams,
            {**settings, "constraints": constraints},
            unjudged=(UNJUDGED,) if is_cut else (),
            notes=tuple(context.notes),
        )

    def _at_highest(self, context: Context, seams: SeamsFile) -> SeamJob:
        """Return the job that asks for the highest feed."""
        most = FASTEST_FEED if seams.most_feed is None else seams.most_feed
        if not 0.0 < most <= FASTEST_FEED:
            raise FileFormatError(
                f"{context.file}: seams: most_feed is {shown(most)}, expected a feed up to "
                f"{FASTEST_FEED:g} m/s"
            )

        def at_feed(feed: float) -> SeamJob:
            table = seams.model_copy(update={"feed": feed, "most_feed": None})
            again = copy(context)
            again.notes = list(context.notes)
            return self.model_copy(update={"seams": table}).build(again)

        return replace(at_feed(_SLOW * most), at_feed=at_feed, most_feed=float(most))
