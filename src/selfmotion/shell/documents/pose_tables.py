"""Tables of tool motions through poses: of a file, or given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from selfmotion.basics import is_file
from selfmotion.model.path import Path, Placed
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
from selfmotion.shell.documents.path_base import (
    BoundsTable,
    Events,
    FramedPath,
    FrameKeys,
    PathTable,
    WeaveTable,
    after,
    framed,
)
from selfmotion.shell.documents.tables import Context
from selfmotion.shop.cam import Reading, one_seam, read_path, times_of_events


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
