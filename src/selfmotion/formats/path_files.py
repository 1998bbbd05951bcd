"""Tool motions from files: tables, arrays, and what ROS writes."""

from collections.abc import Mapping
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import (
    Array,
    FileFormatError,
    PathError,
    as_choice,
    as_number,
    as_path,
)
from selfmotion.formats.path_rows import READERS, PoseRows
from selfmotion.formats.poses import ORIENTATIONS
from selfmotion.path import Feed, Joined, Path, Polyline, Waypoints

# A coordinate beyond this [m] can only be meant in millimetres.
_FAR = 50.0
# An angle beyond this [rad] can only be meant in degrees.
_ROUND = 2.0 * np.pi + 1e-6
# Poses farther from their predecessor than this [m] are a jump, unless another length is given.
_JUMP = 0.5
# Rotations by more than this [rad] are a jump, too: their direction would be a guess.
_FLIP = 2.6
# Times this near [s] are the same.
_MOMENT = 1e-9
# Legs that bend by more than this [rad] make a corner, unless another angle is given.
_BEND = np.pi / 6


def read_path(
    file: str | FilePath,
    *,
    feed: float | None = None,
    duration: float | None = None,
    jump: float = _JUMP,
    corners: str = "blend",
    tolerance: float = 1e-3,
    corner_angle: float | None = None,
    turn_rate: float | None = None,
    acceleration: float | None = None,
    turn_acceleration: float | None = None,
    smoothing: float | None = None,
    within: float | None = None,
) -> Path:
    """Read a tool motion through poses.

    ==============  =================================================================
    .csv .txt .tsv  columns in any order: ``t`` [s], ``x,y,z`` [m], and one of
                    ``qw,qx,qy,qz``, ``rx,ry,rz`` (rotation vector [rad]),
                    ``roll,pitch,yaw`` [rad], ``nx,ny,nz`` (the tool's z axis) or
                    none; ``feed`` [m/s] from a pose on, instead of ``t``; ``x_mm``,
                    ``feed_mm`` and ``roll_deg`` are in those units
    .npy            (N, 4, 4) poses, or a table (N, 3) x,y,z; (N, 4) t,x,y,z;
                    (N, 7) x,y,z,qw,qx,qy,qz; (N, 8) with t first
    .yaml .json     ROS ``nav_msgs/Path``, ``geometry_msgs/PoseArray``
    ==============  =================================================================

    Parameters
    ----------
    file : path
    feed : float, optional
        Speed of the tool [m/s], from rest to rest, where the file has no times; see `Feed`.
    duration : float, optional
        Or the time of the whole motion [s], at about constant speed.
    jump : float
        Distance from one pose to the next [m] that is refused.
    corners : {"blend", "stop", "round"}
        What to do in kinks: swing through the pose or rest in it as `Waypoints` do, or, with a
        feed, pass it within `tolerance` between straight legs as a `Polyline` does.
    tolerance : float
        [m].
    corner_angle : float, optional
        As in `Waypoints`.
    turn_rate, acceleration, turn_acceleration, smoothing, within : float, optional
        Bounds of a feed, as in `Feed`.

    Raises
    ------
    FileFormatError
        The file cannot be read, or a row cannot be used: not finite, a zero quaternion, times that
        do not increase, a jump, other units. The line or pose is named.
    """
    path = as_path(file)
    jump = as_number(jump, f"{path}: jump", above=0.0, error=FileFormatError)
    for name, value in (("feed", feed), ("duration", duration)):
        if value is not None:
            as_number(value, f"{path}: {name}", above=0.0, error=FileFormatError)
    reader = READERS.get(path.suffix)
    if reader is None:
        raise FileFormatError(
            f"{path}: has suffix '{path.suffix}', expected one of {', '.join(READERS)}"
        )
    rows = reader(path)
    if len(rows.positions) < 2:
        raise FileFormatError(f"{path}: has {len(rows.positions)} poses, expected at least two")
    _check_rows(path, rows)
    rotations = _rotations(path, rows)
    _check_jumps(path, rows, rotations, jump)
    turns = _quaternions(rotations) if rows.orientation else None
    t = _times(path, rows, feed, duration)
    asked = {
        "turn_rate": turn_rate,
        "acceleration": acceleration,
        "turn_acceleration": turn_acceleration,
        "smoothing": smoothing,
        "within": within,
    }
    bounds = {name: value for name, value in asked.items() if value is not None}
    feeds = rows.feed if feed is None else np.full(len(rows.positions), feed)
    if bounds and feeds is None:
        raise FileFormatError(f"{path}: {next(iter(bounds))} has no effect without a feed")
    try:
        as_choice(corners, "corners", ("blend", "stop", "round"), PathError)
        if corners == "round":
            if feeds is None:
                raise PathError("corners are 'round', which needs a feed [m/s]; give it")
            legs = Polyline(rows.positions, turns, tolerance=tolerance)
            return _at_feed(legs, legs.pose_times, feeds, bounds)
        bend = _BEND if corner_angle is None else corner_angle
        through = Waypoints(t, rows.positions, turns, corners=corners, corner_angle=bend)
        through.samples([0.0])
        if feeds is None:
            return through
        pieces: list[Path] = []
        passed = t - t[0]
        for piece in through.between_corners():
            # From one rest to the next.
            here = (passed >= -_MOMENT) & (passed <= piece.duration + _MOMENT)
            pieces.append(_at_feed(piece, passed[here], feeds[here], bounds))
            passed = passed - piece.duration
        return pieces[0] if len(pieces) == 1 else Joined(pieces)
    # Splines refuse times that differ, but by less than they can divide by.
    except (PathError, ValueError) as error:
        raise FileFormatError(f"{path}: {error}") from error


def _at_feed(path: Path, t: Array, feeds: Array, bounds: Mapping[str, float]) -> Feed:
    """Return a path at the feeds (N,) that begin at its times (N,); the last one has no way."""
    changes = 1 + np.flatnonzero(np.diff(feeds[:-1]))
    stretches = np.stack([t[changes], feeds[changes]], axis=1) if len(changes) else None
    return Feed(path, float(feeds[0]), stretches=stretches, **bounds)


def _check_rows(file: FilePath, rows: PoseRows) -> None:
    parts = [("position", rows.positions), (rows.orientation, rows.values)]
    if rows.t is not None:
        parts.append(("time", rows.t[:, None]))
    for what, values in parts:
        flat = values.reshape(len(values), -1)
        bad = np.flatnonzero(~np.all(np.isfinite(flat), axis=1))
        if bad.size:
            place = rows.places[int(bad[0])]
            raise FileFormatError(f"{file}: {place}: the {what} is not finite; mend or drop it")
    for what, values, bound, remedy in (
        ("position", rows.positions, _FAR, "metres; say x_mm,y_mm,z_mm if it is millimetres"),
        ("angle", rows.values, _ROUND, "radians; say roll_deg,… or rx_deg,… if it is degrees"),
    ):
        if what == "angle" and rows.orientation not in ("rpy", "rotation_vector"):
            continue
        far = np.argwhere(np.abs(values) > bound)
        if len(far):
            row, column = far[0]
            found = f"{what} {values[row, column]:.6g}"
            raise FileFormatError(f"{file}: {rows.places[row]}: {found} is taken for {remedy}")
    if rows.t is not None:
        late = np.flatnonzero(np.diff(rows.t) <= 0.0)
        if late.size:
            row = int(late[0]) + 1
            raise FileFormatError(
                f"{file}: {rows.places[row]}: time {rows.t[row]:.6g} s does not come after "
                f"{rows.t[row - 1]:.6g} s; times must increase"
            )


def _rotations(file: FilePath, rows: PoseRows) -> Array:
    if not rows.orientation:
        return np.tile(np.eye(3), (len(rows.positions), 1, 1))
    _, rotation = ORIENTATIONS[rows.orientation]
    found = []
    for place, values in zip(rows.places, rows.values, strict=True):
        try:
            found.append(rotation(values))
        except (ValueError, PathError) as error:
            raise FileFormatError(f"{file}: {place}: {error}") from error
    return np.array(found)


def _check_jumps(file: FilePath, rows: PoseRows, rotations: Array, jump: float) -> None:
    steps = np.linalg.norm(np.diff(rows.positions, axis=0), axis=1)
    cosines = np.einsum("kij,kij->k", rotations[:-1], rotations[1:])
    turns = np.arccos(np.clip(0.5 * (cosines - 1.0), -1.0, 1.0))
    for what, amounts, bound, unit, remedy in (
        ("jumps by", steps, jump, "m", _remedy(jump)),
        ("turns by", turns, _FLIP, "rad", "which has no clear direction; add poses between"),
    ):
        far = np.flatnonzero(amounts > bound)
        if far.size:
            row = int(far[0]) + 1
            raise FileFormatError(
                f"{file}: {rows.places[row]}: the path {what} {amounts[row - 1]:.4g} {unit} from "
                f"the pose before, {remedy}"
            )


def _remedy(jump: float) -> str:
    return (
        f"more than {jump:g} m; give a larger jump if it is meant, or name the columns x_mm,… if "
        f"they are millimetres"
    )


def _times(file: FilePath, rows: PoseRows, feed: float | None, duration: float | None) -> Array:
    given = {"feed": feed, "duration": duration}
    named = [name for name, value in given.items() if value is not None]
    columns = [name for name, own in (("t", rows.t), ("feed", rows.feed)) if own is not None]
    if len(columns) > 1:
        raise FileFormatError(f"{file}: has times and a column feed; keep one of them")
    if columns and named:
        what = "times" if rows.t is not None else "a column feed"
        raise FileFormatError(f"{file}: has {what}, so that {named[0]} has no effect; drop one")
    if rows.t is not None:
        return rows.t
    if rows.feed is not None:
        bad = np.flatnonzero(~(rows.feed > 0.0) | ~np.isfinite(rows.feed))
        if bad.size:
            row = int(bad[0])
            raise FileFormatError(
                f"{file}: {rows.places[row]}: feed is {rows.feed[row]:.6g} m/s, expected a number "
                f"above 0"
            )
    elif len(named) != 1:
        raise FileFormatError(
            f"{file}: has no times; give either a feed [m/s] or a duration [s]"
            + (", not both" if named else "")
        )
    steps = np.linalg.norm(np.diff(rows.positions, axis=0), axis=1)
    still = np.flatnonzero(steps == 0.0)
    if still.size:
        raise FileFormatError(
            f"{file}: {rows.places[int(still[0]) + 1]}: the tool does not move from the pose "
            f"before, which takes no time by feed or duration; give a column t"
        )
    if rows.feed is not None:
        return np.append(0.0, np.cumsum(steps / rows.feed[:-1]))
    length = np.append(0.0, np.cumsum(steps))
    return length / feed if feed is not None else length * (float(duration or 0.0) / length[-1])


def _quaternions(rotations: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotations).as_quat(scalar_first=True))
