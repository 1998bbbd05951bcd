"""Bases of tables of tool motions: leads, swings, frames, and bounds of a feed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from selfmotion.basics import ProblemError, restore
from selfmotion.model.path import Feed, Joined, Path, Placed, Weave, with_leads
from selfmotion.model.task import SE3
from selfmotion.shell.documents.field_types import Angle, Length, Number, Numbers, key, needed
from selfmotion.shell.documents.tables import Context, Pose, Table

# Events of a path: what happens, and how long after its start [s].
Events = list[tuple[str, float]]


class LeadsTable(Table):
    """An approach and a retract along an axis of the tool."""

    length: Length = needed("Of each lead [m].")
    duration: Number = needed("Of each lead [s].")
    axis: Numbers = key("Direction of the retract in the tool's frame; by default back along z.")

    def applied(self, path: Path) -> Path:
        """Return a path with both.

        An end at which a program has a rapid of its own along the tool's axis gets none.
        """
        pieces = with_leads(path, **self.given).pieces
        first, last = rapid_ends(path)
        told = ("leads are left out where the program has a rapid along the tool's axis",)
        kept = Joined(pieces[int(first) : len(pieces) - int(last)])
        return kept.noted((*path.notes, *(told if first or last else ())))

    def delay(self, path: Path | None) -> float:
        """Return how much later a path begins with it [s]."""
        return 0.0 if path is not None and rapid_ends(path)[0] else self.duration


def rapid_ends(path: Path) -> tuple[bool, bool]:
    """Return whether a path begins, and whether it ends, with a rapid of a program."""
    pieces = path.pieces if isinstance(path, Joined) else (path,)
    first, last = pieces[0], pieces[-1]
    return (
        isinstance(first, Feed) and not first.required,
        isinstance(last, Feed) and not last.required,
    )


class WeaveTable(Table):
    """Swings of the tool beside a path, as welders make them."""

    amplitude: Length = needed("How far the tool goes to each side [m].")
    pitch: Length = needed("Length of a swing there and back [m], about: a whole number fits.")
    axis: Numbers = key("Direction of the swing in the tool's frame.")
    dwell: Number = key(
        "Share of a swing that the tool stays at each edge, from 0 to below 0.5. With 0 it is a "
        "sine; otherwise the tool goes from edge to edge with continuous accelerations.",
        0.0,
    )

    def applied(self, path: Path) -> Path:
        """Return a path with the swings."""
        return Weave(path, **self.given)


class PathTable(Table):
    """A tool motion.

    Attributes
    ----------
    besides : tuple of str
        Keys that its class does not know.
    """

    besides: ClassVar[tuple[str, ...]] = ()

    kind: str

    def build(self, context: Context, place: SE3 | None = None) -> Path:
        """Return the tool motion; with a `place`, of a workpiece that stands there."""
        path = self.made(context)
        return path if place is None else Placed(path, place)

    def made(self, context: Context) -> Path:
        """Return the tool motion without its leads, in its own frame."""
        given = {name: x for name, x in self.given.items() if name not in self.besides}
        values = {name: _built(value, context) for name, value in given.items()}
        try:
            with np.errstate(invalid="raise", over="raise"):
                path: Path = _of_others(values) if self.inner else restore(Path, values)
                path.samples([0.0, 0.5 * path.duration, path.duration])
        except (ArithmeticError, IndexError, TypeError, ValueError) as error:
            reason = " ".join(str(error).split())
            raise ProblemError(f"{self.kind}: is no path with these numbers: {reason}") from error
        return path

    @property
    def inner(self) -> list[PathTable]:
        """The tool motions that it is made of."""
        listed = (x if isinstance(x, list) else [x] for x in self.given.values())
        return [item for several in listed for item in several if isinstance(item, PathTable)]

    def file_events(self, context: Context) -> tuple[Events, bool]:
        """Return the events in the files of a path, and whether one is of a machine tool.

        Raises
        ------
        ProblemError
            The path has other times than a file in it that has events.
        """
        found = [item.file_events(context) for item in self.inner]
        events = [event for several, _ in found for event in several]
        if events and self.kind not in _IN_STEP:
            raise ProblemError(
                f"a path of kind '{self.kind}' has other times than the file in it, whose event "
                f"'{events[0][0]}' would be lost; say when in events, or put the file into the "
                f"path itself"
            )
        leads: LeadsTable | None = getattr(self, "leads", None)
        delay = None if leads is None else leads.delay(None)
        return after(events, delay), any(one_way for _, one_way in found)


# Paths of another one that are at its poses at the same times.
_IN_STEP = ("placed", "weave")


def after(events: Iterable[tuple[str, float]], delay: float | None) -> Events:
    """Return events that are later by a delay [s]."""
    return [(event, (delay or 0.0) + at) for event, at in events]


def _of_others(values: dict[str, Any]) -> Path:
    """Return a path that is made of others."""
    options = {name: value for name, value in values.items() if name != "kind"}
    return Path.kinds()[values["kind"]](**options)


def _built(value: Any, context: Context) -> Any:
    if isinstance(value, list):
        return [_built(item, context) for item in value]
    return value.build(context) if isinstance(value, PathTable) else value


class FrameKeys(Table):
    """Where a tool motion is placed, and how it is come to and left."""

    frame: Pose = key("Where it is placed: a pose in the frame of the reference.")
    leads: LeadsTable = key()


class FramedPath(PathTable, FrameKeys):
    """A tool motion that may stand in a frame, and have leads."""

    besides: ClassVar[tuple[str, ...]] = ("frame", "leads")

    def build(self, context: Context, place: SE3 | None = None) -> Path:
        """Return the tool motion with its leads, in its frame."""
        path = self.made(context)
        path = path if self.leads is None else self.leads.applied(path)
        frame = framed(place, self.frame)
        return path if frame is None else Placed(path, frame)


def framed(place: SE3 | None, frame: SE3 | None) -> SE3 | None:
    """Return the frame of a path in the workpiece, or in the world without one."""
    return frame if place is None else place * (SE3.Identity() if frame is None else frame)


class BoundsTable(Table):
    """Bounds of a feed."""

    turn_rate: Angle = key("The tool turns no faster than this [rad/s].", 1.0)
    acceleration: Length = key("It accelerates no more than this [m/s²].", 1.0)
    turn_acceleration: Angle = key("Likewise its turning [rad/s²].", 10.0)
    smoothing: Number = key("How long an acceleration takes to build up [s].", 0.05)
    within: Number = key(
        "Allowed relative error of the feed, except in run-up, run-down and rounded corners: a "
        "certificate judges it.",
        0.02,
    )

    @property
    def bounds(self) -> dict[str, Any]:
        """Those that are given."""
        return {name: x for name, x in self.given.items() if name in BoundsTable.model_fields}
