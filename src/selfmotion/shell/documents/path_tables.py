"""Tables of tool motions in problem files: shapes, and what is made of others."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from typing_extensions import TypeAliasType

from selfmotion.basics import ProblemError
from selfmotion.model.path import (
    Circle,
    Feed,
    Line,
    Path,
    Placed,
    Spiral,
)
from selfmotion.model.task import SE3
from selfmotion.shell.documents.field_types import (
    Flag,
    Length,
    Lengths,
    Number,
    Numbers,
    key,
    needed,
)
from selfmotion.shell.documents.one_of import OneOf
from selfmotion.shell.documents.path_base import (
    BoundsTable,
    FramedPath,
    PathTable,
    WeaveTable,
    framed,
)
from selfmotion.shell.documents.pose_tables import FilePath, PolylinePath, WaypointsPath
from selfmotion.shell.documents.tables import Context, Pose, Table

TimeLaw = Literal["constant", "minimum_jerk"]


class OwnPath(PathTable, extra="allow"):
    """A tool motion of a class of the user's own."""

    path: ToolMotion = key("Another tool motion.")
    pieces: list[ToolMotion] = key("Other tool motions.")


class ShapePath(FramedPath, BoundsTable):
    """A tool motion that may begin where the arm does, and have a feed."""

    start: Pose = key("Pose of the tool at the start [m]; by default that of the arm's start.")
    duration: Number = key("Length of the motion [s]; or give a feed.")
    feed: Length = key("Speed of the tool [m/s]; or give a duration.")
    weave: WeaveTable = key()

    def build(self, context: Context, place: SE3 | None = None) -> Path:
        """Return the tool motion; in a frame it has to say where it begins."""
        if place is not None and self.start is None:
            raise ProblemError(
                "start is missing: the tool's first pose in the frame of the workpiece"
            )
        return super().build(context, place)

    def made(self, context: Context) -> Path:
        """Return the tool motion, at its feed and with its swings."""
        start = self.start
        if start is None:
            if context.start is None:
                raise ProblemError(
                    "start: is missing, and there is no start configuration whose pose to take; "
                    "give the pose here, or the problem's start = 'dexterous' or numbers"
                )
            if self.frame is not None:
                raise ProblemError("frame: needs start, the tool's first pose in that frame")
            start = context.robot.pose(context.start)
        if self.bounds and self.feed is None:
            raise ProblemError(f"{next(iter(self.bounds))}: has no effect without a feed")
        require_one(self, "duration", "feed")
        # At a feed, the shape's own pace does not matter.
        path = self.shape(start, 1.0 if self.duration is None else self.duration)
        path = path if self.feed is None else Feed(path, self.feed, **self.bounds)
        return path if self.weave is None else self.weave.applied(path)

    @abstractmethod
    def shape(self, start: SE3, duration: float) -> Path:
        """Return the tool motion from a pose, at its own pace."""

    def some(self, *names: str) -> dict[str, Any]:
        """Return those of some keys that are given."""
        return {name: x for name, x in self.given.items() if name in names}


def require_one(table: Table, *names: str) -> None:
    """Raise ProblemError unless one of the keys is given, and no more."""
    present: Sequence[str] = [name for name in names if name in table.given]
    if len(present) != 1:
        listed = " and ".join(present) or "neither"
        raise ProblemError(f"has {listed}, expected either {' or '.join(names)}")


class CirclePath(ShapePath):
    """A circle, or an arc, about an axis."""

    kind: Literal["circle"]
    center: Lengths = key("A point on the axis [m]; or give the radius.")
    radius: Length = key("[m], where the centre follows from the start; or give the centre.")
    normal: Numbers = key(
        "Direction of the axis; the tool moves counter-clockwise about it.", [0.0, 0.0, 1.0]
    )
    turns: Number = key("Number of turns; negative for clockwise.", 1.0)
    turn_tool: Flag = key("Whether the tool turns with it; else its orientation stays.", False)
    time_law: TimeLaw = key("Speed along it.", "minimum_jerk")

    def shape(self, start: SE3, duration: float) -> Path:
        """Return the circle."""
        require_one(self, "center", "radius")
        rest = {"normal": self.normal, **self.some("turns", "turn_tool", "time_law")}
        if self.center is None:
            return Circle.around(start, self.radius, duration, **rest)
        return Circle(start, center=self.center, duration=duration, **rest)


class LinePath(ShapePath):
    """A straight line; the orientation turns about one fixed axis."""

    kind: Literal["line"]
    end: Pose = key("Pose of the tool at the end [m]; or give by.")
    by: Lengths = key("How far it goes from the start [m]; or give the end.")
    time_law: TimeLaw = key("Speed along it.", "minimum_jerk")

    def shape(self, start: SE3, duration: float) -> Path:
        """Return the line."""
        require_one(self, "end", "by")
        end = self.end
        if end is None:
            by = np.asarray(self.by, dtype=np.float64)
            if by.shape != (3,):
                raise ProblemError(f"by: is {by.tolist()}, expected three numbers [m]")
            end = SE3(start.rotation, start.translation + by)
        return Line(start, end, duration, **self.some("time_law"))


class SpiralPath(ShapePath):
    """A spiral of Archimedes about an axis, or a helix: each turn is as far from the one before."""

    kind: Literal["spiral"]
    center: Lengths = needed("A point on the axis [m].")
    normal: Numbers = needed("Direction of the axis; the tool moves counter-clockwise about it.")
    turns: Number = needed("Number of turns; negative for clockwise.")
    radius: Length = needed("Distance from the axis at the end [m].")
    rise: Length = key("How far the end is along the axis from the start [m].", 0.0)
    turn_tool: Flag = key("Whether the tool turns with it; else its orientation stays.", False)
    time_law: TimeLaw = key("Speed along it.", "minimum_jerk")

    def shape(self, start: SE3, duration: float) -> Path:
        """Return the spiral."""
        rest = self.some(*("center", "normal", "turns", "radius", "rise", "turn_tool", "time_law"))
        return Spiral(start=start, duration=duration, **rest)


class DwellPath(PathTable):
    """The tool stays where it is."""

    kind: Literal["dwell"]
    at: Pose = needed("Where [m].")
    duration: Number = needed("How long [s].")


class FeedPath(FramedPath, BoundsTable):
    """A path at a constant feed, from rest to rest."""

    kind: Literal["feed"]
    path: ToolMotion = needed("Where the tool goes; its own pace does not matter.")
    feed: Length = needed("Speed of the tool [m/s].")
    stretches: list[Numbers] = key(
        "Times of the original [s], increasing, and the feed from each of them on [m/s], `feed` "
        "before the first. Before a slower feed starts, the tool has slowed down."
    )
    required: Flag = key(
        "Whether the feed has to be reached. Where it need not, as of retracts, it is a bound: the "
        "tool is as fast as the limits allow up to it.",
        True,
    )


class JoinedPath(FramedPath):
    """Paths one after the other."""

    kind: Literal["joined"]
    pieces: list[ToolMotion] = needed("Each starts at the end of the one before, and as fast.")


class PlacedPath(PathTable):
    """A path in a frame that stands somewhere in the world."""

    kind: Literal["placed"]
    path: ToolMotion = needed("Poses in the frame.")
    frame: Pose = needed("Pose of the frame in the world [m].")

    def build(self, context: Context, place: SE3 | None = None) -> Path:
        """Return the path in the frame."""
        return Placed(self.path.build(context), framed(place, self.frame))


class RetimedPath(PathTable):
    """The same geometric path at another pace: pose(t) is that of the original at σ(t)."""

    kind: Literal["retimed"]
    path: ToolMotion = needed("The original.")
    t: Numbers = needed("New times [s], increasing from 0.")
    sigma: Numbers = needed("Original times [s], from 0 to where the motion ends.")
    rate: Numbers = needed("dσ/dt ≥ 0.")
    bend: Numbers = key("d²σ/dt² [1/s], for a path as smooth as the original.")


class ReversedPath(PathTable):
    """A tool motion from its end to its start, as fast as from its start to its end."""

    kind: Literal["reversed"]
    path: ToolMotion = needed("The motion that is reversed.")


class SectionPath(PathTable):
    """A tool motion from one of its times to another, at its own pace."""

    kind: Literal["section"]
    path: ToolMotion = needed("The whole motion.")
    first: Number = needed("Start of the section [s].")
    last: Number = needed("End of the section [s].")
    crowding: Flag = key(
        "Whether knots crowd towards the end: a motion that ends near a singular pose changes "
        "there faster than any equal steps resolve.",
        False,
    )


class TwistPath(PathTable):
    """A start pose and a velocity over time."""

    kind: Literal["twist"]
    start: Pose = needed("Pose of the tool at t = 0 [m].")
    breaks: Numbers = needed("Times at which the polynomials change [s].")
    coefficients: Numbers = needed("Of the twist's six components between them, lowest first.")


class WeavePath(FramedPath, WeaveTable):
    """A path along which the tool swings from side to side, as welders do."""

    kind: Literal["weave"]
    path: ToolMotion = needed("The seam, at its own pace; its feed is that along the seam.")


PATHS = OneOf(
    "kind",
    lambda: (
        *(CirclePath, DwellPath, FeedPath, FilePath, JoinedPath, LinePath, PlacedPath),
        *(PolylinePath, RetimedPath, ReversedPath, SectionPath, SpiralPath, TwistPath),
        *(WaypointsPath, WeavePath),
    ),
    OwnPath,
    Path.kinds,
)
ToolMotion = TypeAliasType("ToolMotion", Annotated[PathTable, PATHS])
