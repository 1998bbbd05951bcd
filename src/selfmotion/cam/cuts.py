"""What programs of machine tools do: cuts at a feed, rapids in between, arcs and holes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, FileFormatError, text_of
from selfmotion.cam.path_rows import PoseRows
from selfmotion.path import from_normal

# What programs of machine tools do: cuts at a feed, and rapids in between.

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

    @property
    def moved(self) -> bool:
        """Whether it has been anywhere that is known."""
        return bool(self.cuts) or not np.isnan(self.position).any()

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


# Arcs of machines as points: circles about an axis, and helices along it.

# Chords of arcs are off by this at most [m].
_CHORD = 1e-5
# Both ends of an arc are as far from its centre, and no farther apart than its circle is wide, but
# for this [m].
_ROUND = 2e-4
# Arcs of a larger radius [m] are a fault of what wrote them, and so are more chords.
_LARGEST, _POINTS = 1e5, 100_000


def arc_points(
    machine: Machine, start: Array, goal: Array, center: Array, axis: Array, more_turns: int = 0
) -> Array:
    """Return points (K, 3) of an arc, its end the last one.

    It goes right-handed about an axis through the centre, and evenly along it; where both ends are
    in one direction it is a whole turn.

    Parameters
    ----------
    machine : Machine
        Whose line is read.
    start, goal, center, axis : (3,)
    more_turns : int
        Whole turns besides.

    Raises
    ------
    FileFormatError
        The ends are not as far from the axis as each other, or the arc is too large.
    """
    if np.isnan(start).any() or np.isnan(goal).any():
        raise machine.fault(
            "an arc begins where X, Y or Z is not known yet: give X, Y and Z in a rapid before"
        )
    axis = axis / np.linalg.norm(axis)
    heights = (start - center) @ axis, (goal - center) @ axis
    arms = start - center - heights[0] * axis, goal - center - heights[1] * axis
    radius, other = (float(np.linalg.norm(arm)) for arm in arms)
    if radius < _SAME or abs(radius - other) > _ROUND:
        raise machine.fault(
            f"the arc begins {1e3 * radius:.4g} mm from its centre and ends "
            f"{1e3 * other:.4g} mm from it"
        )
    if radius > _LARGEST:
        raise machine.fault(f"the arc has a radius of {radius:.4g} m")
    x = arms[0] / radius
    y = np.cross(axis, x)
    turn = float(np.arctan2(arms[1] @ y, arms[1] @ x)) % (2.0 * np.pi)
    if turn < 1e-9:
        turn = 2.0 * np.pi
    turn += 2.0 * np.pi * more_turns
    count = max(2, int(np.ceil(turn / (2.0 * np.arccos(max(0.0, 1.0 - _CHORD / radius))))))
    if count > _POINTS:
        raise machine.fault(f"the arc takes {count} chords, expected {_POINTS} at most")
    share = np.arange(1, count + 1)[:, None] / count
    angle, radii = turn * share, radius + (other - radius) * share
    found = center + radii * (np.cos(angle) * x + np.sin(angle) * y)
    found = found + (heights[0] + (heights[1] - heights[0]) * share) * axis
    found[-1] = goal
    return np.asarray(found)


def center_by_radius(
    machine: Machine, start: Array, goal: Array, radius: float, sense: float
) -> Array:
    """Return the centre (2,) of an arc in its plane.

    Parameters
    ----------
    machine : Machine
        Whose line is read.
    start, goal : (2,)
    radius : float
        [m]; below 0 for an arc of more than half a turn.
    sense : float
        1 for an arc that goes right-handed, -1 for one that does not.

    Raises
    ------
    FileFormatError
        No such arc joins the ends.
    """
    chord = goal - start
    length = float(np.linalg.norm(chord))
    if length < _SAME or length > 2.0 * abs(radius) + _ROUND:
        raise machine.fault(
            f"no arc of radius {1e3 * radius:.4g} mm joins points {1e3 * length:.4g} mm apart"
        )
    height = np.sqrt(max(0.0, radius**2 - 0.25 * length**2))
    side = sense if radius > 0.0 else -sense
    normal = np.array([-chord[1], chord[0]]) / length
    return np.asarray(start + 0.5 * chord + side * height * normal)


# Holes that cycles of machines drill: down at the feed, and straight out again.

# How fast the tool goes where it is in a hole that is there already [m/s], unless it cuts faster;
# and how far it stays off the bottom then, or comes back to break chips [m].
OUT = 0.05
_OFF = 5e-4
_PECKS = 10_000


class Pecks(NamedTuple):
    """How a deep hole is drilled: so far at once [m], and out in between, or only a little back."""

    first: float
    others: float
    is_out: bool


def drill(
    machine: Machine,
    above: Array,
    bottom: Array,
    axis: Array,
    *,
    pecks: Pecks | None = None,
    dwell: str = "",
    feeds_out: bool = False,
) -> None:
    """Drill a hole, which is a cut of its own: from a place above it to its bottom and back.

    Parameters
    ----------
    machine : Machine
        Whose line is read; its feed is that of the cut.
    above, bottom : (3,)
        Where the feed begins, and the bottom [m].
    axis : (3,)
        From the bottom to above it.
    pecks : Pecks, optional
    dwell : str
        What happens at the bottom, if anything.
    feeds_out : bool
        Whether it comes out at the feed, not faster.

    Raises
    ------
    FileFormatError
        The hole has no depth, or needs too many pecks.
    """
    depth = float((above - bottom) @ axis)
    if not depth > 0.0:
        raise machine.fault(
            f"the hole ends {-1e3 * depth:.4g} mm above where it begins, expected a depth"
        )
    machine.rapid(above, axis)
    feed = machine.feed
    out = feed if feeds_out or feed == 0.0 else max(feed, OUT)
    done = 0.0
    for reached in _depths(machine, depth, pecks):
        if done > 0.0 and pecks is not None and pecks.is_out:
            _go(machine, above, axis, out)
            _go(machine, above - max(0.0, done - _OFF) * axis, axis, out)
        elif done > 0.0:
            _go(machine, above - max(0.0, done - _OFF) * axis, axis, feed)
        _go(machine, above - reached * axis, axis, feed)
        done = reached
    if dwell:
        machine.happens(dwell)
    _go(machine, above, axis, out)
    # What follows is no part of the hole.
    machine.rapid(above, axis)


def _depths(machine: Machine, depth: float, pecks: Pecks | None) -> list[float]:
    """Return how deep it is after each peck."""
    if pecks is None:
        return [depth]
    if not min(pecks.first, pecks.others) > 0.0 or depth / pecks.others > _PECKS:
        raise machine.fault(
            f"drills by {1e3 * pecks.others:.4g} mm at once, expected a step above 0 (Q, STEP)"
        )
    found, here = list[float](), pecks.first
    while here < depth:
        found.append(here)
        here += pecks.others
    return [*found, depth]


def _go(machine: Machine, place: Array, axis: Array, feed: float) -> None:
    cutting, machine.feed = machine.feed, feed
    machine.cut(place, axis)
    machine.feed = cutting
