"""Cuts of machine tools' programs at a feed, and rapids in between."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import Array, FileFormatError, text_of
from selfmotion.model.path import from_normal
from selfmotion.shop.cam.pose_rows import PoseRows

# Largest size of a file [bytes].
_MAX_FILE_SIZE = 200_000_000
# Largest number of poses of a cut.
_MAX_POSES = 1_000_000
# Largest distance of a place from zero [m].
_MAX_COORDINATE = 1e3
# Event where a printer draws filament back.
RETRACT = "retract"
# Event where a printer pushes it forward again.
PRIME = "prime"
# Events that stop something: after a cut they belong to that.
STOPS = ("M5", "M9", "SPINDL/OFF", "COOLNT/OFF", "ARCOFF", RETRACT)
# The suffix of programs of Siemens' controls.
_SIEMENS_SUFFIX = ".mpf"
# Remark on what no program of a machine tool states.
UNJUDGED = "stock and engagement are not judged"
# Note on a file that does not say how the tool stands.
UPRIGHT_NOTE = (
    "nothing says how the tool stands: its z axis points down, against that of the file, and "
    "places are those of its tip"
)
_FREE_MOTION_NOTE = (
    "only rapids along the tool's axis are made as the file has them, all others are free motions; "
    "let CAM write retracts and approaches along the axis"
)
_UP = np.array([0.0, 0.0, 1.0])
# Difference of positions and axes of poses that are the same [m].
SAME_POSE = 1e-9
# Largest speed of a rapid that is part of a cut [m/s].
RAPID = 0.1
# Largest distance from the tool's axis of a rapid along it, by rounding of files [m].
_LATERAL_TOLERANCE = 2e-5
# The same as a share of its length.
_TILT_TOLERANCE = 1e-3
# Difference from -1 of the cosine between axes of which no rotation is the shortest.
_OPPOSITE = 1e-9


@dataclass
class Cut:
    """A cut while it is read: where each pose stands in the file, and what happens.

    Rapids along the tool's axis, to it and from it, are part of it.

    Attributes
    ----------
    labels : list of str
    positions, axes : list of (3,)
        Of the tip [m], and from the tip to the holder.
    feeds : list of float
        To each pose [m/s], 0 where none is known.
    rapid : list of bool
        Whether the tool goes to each pose in a rapid.
    events : list of (int, str)
        At which pose what happens.
    is_hole : bool
        Whether it is a hole that is done: what is cut next is no part of it.
    """

    labels: list[str] = field(default_factory=list)
    positions: list[Array] = field(default_factory=list)
    axes: list[Array] = field(default_factory=list)
    feeds: list[float] = field(default_factory=list)
    rapid: list[bool] = field(default_factory=list)
    events: list[tuple[int, str]] = field(default_factory=list)
    is_hole: bool = False

    @property
    def cuts(self) -> bool:
        """Whether it goes anywhere at a feed."""
        return not all(self.rapid[1:])

    def add(
        self, label: str, position: Array, axis: Array, feed: float, *, rapid: bool = False
    ) -> None:
        """Add a pose, unless it is the last one again."""
        if self.positions:
            away = np.abs(position - self.positions[-1]).max(), np.abs(axis - self.axes[-1]).max()
            if max(away) < SAME_POSE:
                return
        self.labels.append(label)
        self.positions.append(position)
        self.axes.append(axis)
        self.feeds.append(feed)
        self.rapid.append(rapid)

    def ends(self, event: str) -> None:
        """Note what happens at its end."""
        self.events.append((len(self.labels) - 1, event))

    def rows(self) -> PoseRows:
        """Return the poses, the tool's z axis against the axes, turned as little as possible."""
        # The feed of a table is from a pose on, that of a machine up to one.
        feeds = np.array([*self.feeds[1:], self.feeds[-1]])
        rapid = np.array([*self.rapid[1:], self.rapid[-1]])
        rotations = _transported(-np.array(self.axes))
        return PoseRows(
            self.labels,
            np.array(self.positions),
            "rotation",
            rotations,
            None,
            feeds if feeds.all() else None,
            events=tuple(self.events),
            straight=True,
            rapid=rapid if rapid.any() else None,
        )


def _transported(axes: Array) -> Array:
    """Return rotations whose z axes are (N, 3), each turned from the last one about no z axis."""
    from scipy.spatial.transform import Rotation

    frames = [from_normal(axes[0])]
    for axis in axes[1:]:
        before = frames[-1][:, 2]
        if (axis == before).all():
            frames.append(frames[-1])
            continue
        cross, cosine = np.cross(before, axis), float(before @ axis)
        if cosine < _OPPOSITE - 1.0:
            frames.append(from_normal(axis))
            continue
        sine = float(np.linalg.norm(cross))
        angle = np.arctan2(sine, cosine)
        turn = Rotation.from_rotvec(cross * (angle / sine if sine > 0.0 else 0.0))
        turned = turn.as_matrix() @ frames[-1]
        # Exactly that axis, after many turns too.
        x = turned[:, 0] - axis * (axis @ turned[:, 0])
        x = x / np.linalg.norm(x)
        frames.append(np.stack([x, np.cross(axis, x), axis], axis=1))
    return np.array(frames)


class Machine:
    """State of a machine tool while its program is read, with the cuts so far.

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
        # Whether the file says how the tool stands.
        self.says_axis = False
        # The cut that is read, or the rapids that lead to one; what happens before the next.
        self._open: Cut | None = None
        self._next: list[str] = []
        self._held: list[str] | None = None
        # The highest place so far, and from where the tool comes down after it went up to a place
        # that is not known [m]; whether the last traverse went along the tool's axis as well.
        self._highest = self._above = -np.inf
        self._slanted = False

    @property
    def moved(self) -> bool:
        """Whether it has been anywhere that is known."""
        return bool(self.cuts) or not np.isnan(self.position).any()

    def fault(self, what: str) -> FileFormatError:
        """Return an error about the line that is read."""
        return FileFormatError(f"{self.file}: line {self.number}: {what}")

    def unread(self, what: str) -> FileFormatError:
        """Return an error about something that is not read."""
        siemens_words = (
            "of what only Siemens' controls know, TRAORI, TRAFOOF, X=… and A3= B3= C3= are read: "
            "let CAM write ISO G-code for the rest, or APT; "
        )
        siemens = siemens_words if self.file.suffix.lower() == _SIEMENS_SUFFIX else ""
        return self.fault(
            f"{what} is not read: {siemens}page 'Words of CAM files' of the docs lists what is "
            f"(read_path)"
        )

    def note(self, what: str) -> None:
        """Note what is to be known of the line that is read, once for what is said alike."""
        if not any(what in note for note in self.notes):
            self.notes.append(f"line {self.number}: {what}")

    def note_home(self, word: str, until: str) -> None:
        """Note that a word goes to a place of the machine's own."""
        self.note(
            f"{word} goes to a place of the machine's own, which is taken to be above all: the "
            f"tool goes up as high as it has been, and where it is then, is not known until {until}"
        )

    def note_tool(self, change: str) -> None:
        """Note that there is another tool."""
        self.note(f"{change}: the tip of the arm's tool is taken to be where that of each one is")

    def text(self) -> str:
        """Return the file's text."""
        try:
            content = self.file.read_bytes()
        except OSError as error:
            raise FileFormatError(
                f"{self.file}: cannot be read: {error.strerror or error}"
            ) from error
        if len(content) > _MAX_FILE_SIZE:
            raise FileFormatError(
                f"{self.file}: has {len(content)} bytes, expected {_MAX_FILE_SIZE} at most"
            )
        # DOS marks the end of a file.
        return text_of(self.file, content).rstrip("\x1a")

    def rapid(self, position: Array, axis: Array) -> None:
        """Go somewhere in a rapid: along the tool's axis as part of a cut, else between cuts."""
        self._check(position)
        known = not np.isnan(position).any()
        if self._open is not None and known and self._is_along(position, axis):
            self.release()
            self._open.add(self._label, position, axis, RAPID, rapid=True)
        else:
            self._leaves(position)
            if known:
                self._open = Cut()
                if self._above > self._height(position, axis):
                    # It comes down from where it went up to.
                    above = position + (self._above - self._height(position, axis)) * axis
                    self._open.add(self._label, above, axis, RAPID, rapid=True)
                self._open.add(self._label, position, axis, RAPID, rapid=True)
                self._above = -np.inf
        self._is_at(position, axis)

    def _is_at(self, position: Array, axis: Array) -> None:
        self.position, self.axis = position, axis
        height = self._height(position, axis)
        if np.isfinite(height):
            self._highest = max(self._highest, height)

    def climbs(self) -> None:
        """Go up along the tool's axis, nobody knows how far: as high as the tool has been."""
        height = self._height(self.position, self.axis)
        if np.isfinite(height) and self._highest > height:
            self.rapid(self.position + (self._highest - height) * self.axis, self.axis)
        self._above = self._highest

    def _height(self, position: Array, axis: Array) -> float:
        """Return the height of a place [m]; infinite where it is not known or the tool tilted."""
        is_up = float(np.abs(axis - _UP).max()) < SAME_POSE
        return float(position @ _UP) if is_up and not np.isnan(position).any() else np.inf

    def _is_along(self, position: Array, axis: Array) -> bool:
        """Return whether a place is above or below the tool along its axis."""
        step = position - self.position
        length = float(np.linalg.norm(step))
        aside = float(np.linalg.norm(step - (step @ axis) * axis))
        is_turned = np.abs(axis - self.axis).max() > _TILT_TOLERANCE
        return not is_turned and aside <= _LATERAL_TOLERANCE + _TILT_TOLERANCE * length

    def _leaves(self, position: Array) -> None:
        """End a cut."""
        left, self._open = self._open, None
        self._slanted = False
        if left is None:
            return
        if not np.isnan(position).any():
            step = position - left.positions[-1]
            away = float(step @ left.axes[-1])
            self._slanted = abs(away) > _LATERAL_TOLERANCE + _TILT_TOLERANCE * float(
                np.linalg.norm(step)
            )
        if not left.cuts:
            # It went nowhere, but what happened there did.
            self.cuts = [cut for cut in self.cuts if cut is not left]
            self._next = [*(event for _, event in left.events), *self._next]
        elif self._slanted and left.rapid[-1] is False:
            self.note(f"a rapid leaves a cut aside: {_FREE_MOTION_NOTE}")

    def cut(self, position: Array, axis: Array) -> None:
        """Go somewhere at the feed."""
        self._check(position)
        missing = [name for name, value in zip("XYZ", position, strict=True) if np.isnan(value)]
        if missing:
            raise self.fault(
                f"cuts, and {missing[0]} is not known yet: give X, Y and Z in a rapid before"
            )
        if self._open is None or self._open.is_hole:
            known = self._open is not None
            self._leaves(np.full(3, np.nan))
            self._open = Cut()
            if known:
                self._open.add(self._label, self.position, self.axis, RAPID, rapid=True)
        if not self.cuts or self.cuts[-1] is not self._open:
            self.cuts.append(self._open)
            self._open.events[:0] = [(0, event) for event in self._next]
            self._next = []
            if self._slanted and len(self._open.labels) == 1:
                self.note(f"a rapid comes to a cut aside: {_FREE_MOTION_NOTE}")
        self._open.add(self._label, position, axis, self.feed)
        if len(self._open.labels) > _MAX_POSES:
            raise self.fault(f"a cut has more than {_MAX_POSES} poses")
        self._is_at(position, axis)

    def ends_hole(self) -> None:
        """End a hole: what is cut next is another cut, but for rapids along the axis."""
        if self._open is not None:
            self._open.is_hole = True

    def hold(self) -> None:
        """Keep what happens until `release`."""
        self._held = []

    def release(self) -> None:
        """Note what happened since `hold`, now."""
        held, self._held = self._held, None
        for event in held or ():
            self.happens(event)

    def happens(self, event: str) -> None:
        """Note what happens: where the tool is, or where the next cut begins.

        What stops something between two cuts happens at the end of the one before.
        """
        if self._held is not None:
            self._held.append(event)
            return
        is_between = self._open is None or len(self._open.labels) == 1
        if is_between and event in STOPS and self.cuts and not self._waiting:
            self.cuts[-1].ends(event)
        elif self._open is None:
            self._next.append(event)
        else:
            self._open.events.append((len(self._open.labels) - 1, event))

    @property
    def _waiting(self) -> bool:
        """Whether something happens before the next cut."""
        return bool(self._next or (self._open and self._open.events))

    @property
    def _label(self) -> str:
        return f"line {self.number}"

    def _check(self, position: Array) -> None:
        if np.nanmax(np.abs(position), initial=0.0) > _MAX_COORDINATE:
            raise self.fault(f"{position.tolist()} m is farther than anything is")

    def seams(self) -> Mapping[str, PoseRows]:
        """Return the cuts as rows of poses, by names."""
        self._leaves(np.full(3, np.nan))
        moved = [cut for cut in self.cuts if cut.cuts]
        for event in self._next if moved else ():
            moved[-1].ends(event)
        self._next = []
        if not moved:
            raise FileFormatError(f"{self.file}: has no cut: no motion at a feed")
        unsaid = () if self.says_axis else (UPRIGHT_NOTE,)
        notes = (*self.notes, *unsaid, UNJUDGED)
        rows = (replace(cut.rows(), one_way=True, notes=notes) for cut in moved)
        return {f"cut {number}": each for number, each in enumerate(rows, 1)}


def unit_axis(values: Sequence[float], machine: Machine) -> Array:
    """Return the direction of a tool axis."""
    axis = np.array(values, dtype=np.float64)
    length = float(np.linalg.norm(axis))
    if not 1e-6 < length < 1e6:
        raise machine.fault(f"tool axis {axis.tolist()} has no direction")
    return axis / length
