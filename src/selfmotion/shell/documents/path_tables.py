"""Tables of tool motions in problem files: shapes, files of poses, and what is made of others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from typing_extensions import TypeAliasType

from selfmotion.basics import ProblemError, is_file, restore
from selfmotion.model.path import (
    Circle,
    Feed,
    Joined,
    Line,
    Path,
    Placed,
    Spiral,
    Weave,
    with_leads,
)
from selfmotion.model.task import SE3
from selfmotion.shell.documents.field_types import (
    Angle,
    File,
    Flag,
    Length,
    Lengths,
    Names,
    Number,
    Numbers,
    Text,
    Turn,
    key,
    needed,
)
from selfmotion.shell.documents.one_of import OneOf
from selfmotion.shell.documents.tables import Context, Pose, Table
from selfmotion.shop.cam import Reading, one_seam, read_path, times_of_events

TimeLaw = Literal["constant", "minimum_jerk"]
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


class OwnPath(PathTable, extra="allow"):
    """A tool motion of a class of the user's own."""

    path: ToolMotion = key("Another tool motion.")
    pieces: list[ToolMotion] = key("Other tool motions.")


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

    def shape(self, start: SE3, duration: float) -> Path:
        """Return the tool motion from a pose, at its own pace."""
        raise NotImplementedError

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


class FilePoses(FrameKeys, BoundsTable):
    """How poses of a file are read, whichever seam they are of; see `read_path`."""

    file: File = needed("The file of poses; see [paths from files](howto/seam.md).")
    feed: Length = key("Speed of the tool [m/s], from rest to rest, where the file has no times.")
    duration: Number = key(
        "Or the time of the whole motion [s], from rest to rest, at about constant speed between."
    )
    ramp: Number = key(
        "In so long [s] it is run up from rest, and down again. Of a duration it is a part: by "
        "default a quarter, at most 0.5 s."
    )
    corners: Text = key(
        "What to do in kinks: swing through the pose (blend), rest in it (stop), or, with a feed, "
        "pass it within `tolerance` between straight legs (round).",
        "blend",
    )
    tolerance: Length = key("How far the tool may pass from a corner [m].", 1e-3)
    corner_angle: Turn = key("Change of direction that counts as a kink [rad].", np.pi / 6)
    jump: Length = key("Distance from one pose to the next [m] that is refused.", 0.5)
    weave: WeaveTable = key()
    columns: Names = key(
        "Names of the columns of a table or of an array, in place of a header or where there is "
        'none; "-" leaves one out.'
    )
    flip_normals: Flag = key(
        "Whether `nx,ny,nz` point out of the part, as surface normals of CAD do.", False
    )
    standoff: Length = key("How far the tip is held back from the poses, along its z [m].", 0.0)
    along: Text = key(
        "Which axis of the tool is along the path (x, -x, y, -y), as of a knife or a nozzle; its z "
        "axis is that of the file, or points down. Legs are straight; in corners the tool turns on "
        'the spot (corners "stop") or within `tolerance` ("round"), and in bends smaller than '
        "`corner_angle` on its way."
    )
    lead: Angle = key(
        "By how much its z axis leans towards where it goes then [rad]; below 0 it lags.", 0.0
    )
    tilt: Angle = key(
        "By how much it leans to the left of where it goes, seen from the holder [rad]; below 0 to "
        "the right.",
        0.0,
    )
    lift: Length = key(
        "How far the tool leaves corners along its own z axis, before `lead` and `tilt`, to turn "
        'there and come back [m], with corners "stop". It is lifted at no feed that is judged.',
        0.0,
    )
    rotary: Text = key(
        "What `A B C` of G-code turn, where it does not say `G43.4`: the head, positions being "
        "those of the tip in the part, or a table with the part on it, positions being the "
        "machine's."
    )
    rotary_axes: Names = key(
        'A table\'s axes, from the machine to the part: "BC" for a C axis on a B axis, "AC", or '
        "one. Positive words move the tool right-handed about the axis relative to the part (ISO "
        '841); ["B", "-C"] where a positive C turns the table right-handed. With rotary = "head" '
        "the axes of a table under tool centre point control."
    )
    rotary_center: Lengths = key(
        "A point on all of a table's axes, in the program's coordinates [m]."
    )
    unit: Text = key("Of a drawing or APT that says none, or another one than it is written in.")

    @property
    def reading(self) -> dict[str, Any]:
        """The options of `read_path` that are given."""
        names = set(FilePoses.model_fields) - {"file", "frame", "leads", "weave"}
        values = {name: x for name, x in self.given.items() if name in names}
        if "columns" in values:
            # One text may have them all.
            values["columns"] = ",".join(values["columns"])
        return values

    def placed(self, context: Context, path: Path, place: SE3 | None) -> Path:
        """Return what was read with its leads, in its frame; a note says which."""
        path = path if self.leads is None else self.leads.applied(path)
        frame = framed(place, self.frame)
        if frame is not None:
            return Placed(path, frame)
        robot = context.robot
        root = (
            f"'{robot.urdf.root}', the arm's root" if robot.reference is None else robot.reference
        )
        told = f"no frame is given: places of the file are in that of {root} (else: frame, --frame)"
        return path.noted((*path.notes, told))


def flipped_normals(table: Mapping[str, Any]) -> tuple[dict[str, Any], str]:
    """Return a table of poses with its normals the other way, and how the shell says that."""
    flips = not table.get("flip_normals", False)
    said = "with --set path.flip_normals=true" if flips else "without path.flip_normals"
    return {**table, "flip_normals": flips}, said


class FilePath(PathTable, FilePoses):
    """A tool motion from a file of poses."""

    kind: Literal["file"]
    seam: Text = key("Which of several seams, cuts or strokes of the file.")

    def build(self, context: Context, place: SE3 | None = None) -> Path:
        """Return the tool motion with its swings and leads, in its frame."""
        path = self.made(context)
        path = path if self.weave is None else self.weave.applied(path)
        return self.placed(context, path, place)

    def made(self, context: Context) -> Path:
        """Return the tool motion that the file has."""
        return read_path(context.beside(self.file), seam=self.seam, **self.reading)

    def file_events(self, context: Context) -> tuple[Events, bool]:
        """Return the events in the file, and whether it is of a machine tool."""
        file = context.beside(self.file)
        if not is_file(file):
            return [], False
        rows = one_seam(file, self.seam, Reading.of(file, self.reading))
        if not rows.events:
            return [], rows.one_way
        path = self.made(context)
        delay = None if self.leads is None else self.leads.delay(path)
        return after(times_of_events(path, rows), delay), rows.one_way


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


class PosesPath(FramedPath):
    """A tool motion through poses."""

    positions: Lengths = needed("[m].")
    quaternions: Any = key("w, x, y, z of each pose, or 3 × 3 matrices; by default none.")
    quaternions_wxyz: Any = key("The same, as Python calls it.")


class PolylinePath(PosesPath):
    """Straight legs from pose to pose; corners are rounded within tolerances."""

    kind: Literal["polyline"]
    tolerance: Length = key("How far the tool may pass from a corner [m].", 1e-3)
    turn_tolerance: Turn = key("Likewise [rad].", 1e-2)


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


class WaypointsPath(PosesPath):
    """Poses with times, joined smoothly in position and on SO(3), exact at each waypoint."""

    kind: Literal["waypoints"]
    t: Numbers = needed("Times [s], increasing; the first one becomes 0.")
    corners: Text = key(
        "Motion at kinks of the path: a smooth one through the waypoint (blend), which deviates "
        "from the straight legs on both sides, or a rest in it, and at both ends, on the legs "
        "(stop). Either way each waypoint is reached at its time.",
        "blend",
    )
    corner_angle: Turn = key(
        "Change of direction from one leg to the next, of motion or of rotation, that counts as a "
        "kink [rad].",
        np.pi / 6,
    )


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
