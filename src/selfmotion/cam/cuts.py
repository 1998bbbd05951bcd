"""What programs of machine tools do: cuts at a feed, and rapids in between."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array, FileFormatError, text_of
from selfmotion.cam.path_rows import PoseRows
from selfmotion.path import from_normal

# A file of a machine tool has less than so many bytes, a cut less than so many poses; nothing is
# farther away than this [m].
_BYTES, _POSES, _FAR = 200_000_000, 1_000_000, 1e3
# What stops something: after a cut it belongs to that.
RETRACT, PRIME = "retract", "prime"
STOPS = ("M5", "M9", "SPINDL/OFF", "COOLNT/OFF", "ARCOFF", RETRACT)
# Poses nearer than this [m, and of their axes] are the same.
_SAME = 1e-9
# Axes apart from their opposite by less than this have no shortest way.
_OPPOSITE = 1e-9


@dataclass
class Cut:
    """A stretch at a feed while it is read: where each pose stands in the file, and what happens.

    Attributes
    ----------
    places : list of str
    positions, axes : list of (3,)
        Of the tip [m], and from the tip to the holder.
    feeds : list of float
        To each pose [m/s], 0 where none is known.
    events : list of (int, str)
        At which pose what happens.
    """

    places: list[str] = field(default_factory=list)
    positions: list[Array] = field(default_factory=list)
    axes: list[Array] = field(default_factory=list)
    feeds: list[float] = field(default_factory=list)
    events: list[tuple[int, str]] = field(default_factory=list)

    def add(self, place: str, position: Array, axis: Array, feed: float) -> None:
        """Add a pose, unless it is the last one again."""
        if self.positions:
            away = np.abs(position - self.positions[-1]).max(), np.abs(axis - self.axes[-1]).max()
            if max(away) < _SAME:
                return
        self.places.append(place)
        self.positions.append(position)
        self.axes.append(axis)
        self.feeds.append(feed)

    def ends(self, event: str) -> None:
        """Note what happens at its end."""
        self.events.append((len(self.places) - 1, event))

    def rows(self) -> PoseRows:
        """Return the poses, the tool's z axis against the axes, turned as little as may be."""
        # The feed of a table is from a pose on, that of a machine up to one.
        feeds = np.array([*self.feeds[1:], self.feeds[-1]])
        rotations = _transported(-np.array(self.axes))
        return PoseRows(
            self.places,
            np.array(self.positions),
            "rotation",
            rotations,
            None,
            feeds if feeds.all() else None,
            events=tuple(self.events),
            straight=True,
        )


def _transported(axes: Array) -> Array:
    """Return rotations whose z axes are (N, 3), each turned from the last one about no z axis."""
    from scipy.spatial.transform import Rotation

    found = [from_normal(axes[0])]
    for axis in axes[1:]:
        before = found[-1][:, 2]
        if (axis == before).all():
            found.append(found[-1])
            continue
        cross, cosine = np.cross(before, axis), float(before @ axis)
        if cosine < _OPPOSITE - 1.0:
            found.append(from_normal(axis))
            continue
        sine = float(np.linalg.norm(cross))
        angle = np.arctan2(sine, cosine)
        turn = Rotation.from_rotvec(cross * (angle / sine if sine > 0.0 else 0.0))
        turned = turn.as_matrix() @ found[-1]
        # Exactly that axis, after many turns too.
        x = turned[:, 0] - axis * (axis @ turned[:, 0])
        x = x / np.linalg.norm(x)
        found.append(np.stack([x, np.cross(axis, x), axis], axis=1))
    return np.array(found)


class Machine:
    """Where the tool is, and the cuts so far.

    Parameters
    ----------
    file : path
    """

    def __init__(self, file: FilePath) -> None:
        self.file = file
        self.number = 0
        self.position: Array = np.full(3, np.nan)
        self.axis: Array = np.array([0.0, 0.0, 1.0])
        self.feed = 0.0
        self.cuts: list[Cut] = []
        self.notes: list[str] = []
        self._open: Cut | None = None
        self._next: list[str] = []

    def fault(self, what: str) -> FileFormatError:
        """Return an error about the line that is read."""
        return FileFormatError(f"{self.file}: line {self.number}: {what}")

    def unread(self, what: str) -> FileFormatError:
        """Return an error about something that is not read."""
        return self.fault(f"{what} is not read: page 'Files' of the docs lists what is (read_path)")

    def note(self, what: str) -> None:
        """Note what is to be known of the line that is read, once for what is said alike."""
        if not any(what in note for note in self.notes):
            self.notes.append(f"line {self.number}: {what}")

    def text(self) -> str:
        """Return the file's text."""
        try:
            content = self.file.read_bytes()
        except OSError as error:
            raise FileFormatError(
                f"{self.file}: cannot be read: {error.strerror or error}"
            ) from error
        if len(content) > _BYTES:
            raise FileFormatError(
                f"{self.file}: has {len(content)} bytes, expected {_BYTES} at most"
            )
        # DOS marks the end of a file.
        return text_of(self.file, content).rstrip("\x1a")

    def rapid(self, position: Array, axis: Array) -> None:
        """Go somewhere without cutting, which ends a cut."""
        self._check(position)
        if self._open is not None and len(self._open.places) < 2:
            # It went nowhere, but what happened there did.
            self.cuts.remove(self._open)
            self._next = [*(event for _, event in self._open.events), *self._next]
        self._open = None
        self.position, self.axis = position, axis

    def cut(self, position: Array, axis: Array) -> None:
        """Go somewhere at the feed."""
        self._check(position)
        missing = [name for name, value in zip("XYZ", position, strict=True) if np.isnan(value)]
        if missing:
            raise self.fault(
                f"cuts, and {missing[0]} is not known yet: give X, Y and Z in a rapid before"
            )
        place = f"line {self.number}"
        if self._open is None:
            self._open = Cut()
            self.cuts.append(self._open)
            if not np.isnan(self.position).any():
                self._open.add(place, self.position, self.axis, self.feed)
            self._open.events += [(0, event) for event in self._next]
            self._next = []
        self._open.add(place, position, axis, self.feed)
        if len(self._open.places) > _POSES:
            raise self.fault(f"a cut has more than {_POSES} poses")
        self.position, self.axis = position, axis

    def happens(self, event: str) -> None:
        """Note what happens: where the tool is in a cut, or else where the next one begins.

        What stops something between two cuts happens at the end of the one before.
        """
        if self._open is None and event in STOPS and self.cuts and not self._next:
            self.cuts[-1].ends(event)
        elif self._open is None:
            self._next.append(event)
        else:
            self._open.events.append((len(self._open.places) - 1, event))

    def _check(self, position: Array) -> None:
        if np.nanmax(np.abs(position), initial=0.0) > _FAR:
            raise self.fault(f"{position.tolist()} m is farther than anything is")

    def seams(self) -> Mapping[str, PoseRows]:
        """Return the cuts as rows of poses, by names."""
        moved = [cut for cut in self.cuts if len(cut.places) > 1]
        left = [event for cut in self.cuts if len(cut.places) < 2 for _, event in cut.events]
        for event in (*left, *self._next) if moved else ():
            moved[-1].ends(event)
        self._next = []
        if not moved:
            raise FileFormatError(f"{self.file}: has no cut: no motion at a feed")
        notes = tuple(self.notes)
        rows = (replace(cut.rows(), one_way=True, notes=notes) for cut in moved)
        return {f"cut {number}": each for number, each in enumerate(rows, 1)}


def unit_axis(values: Sequence[float], machine: Machine) -> Array:
    """Return the direction of a tool axis."""
    axis = np.array(values, dtype=np.float64)
    length = float(np.linalg.norm(axis))
    if not 1e-6 < length < 1e6:
        raise machine.fault(f"tool axis {axis.tolist()} has no direction")
    return axis / length
