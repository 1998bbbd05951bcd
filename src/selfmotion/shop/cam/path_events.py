"""Times of the events of a table along the path that its rows make."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.path import (
    Feed,
    Joined,
    Path,
    Placed,
    Polyline,
    Retimed,
    Reversed,
    Section,
    Waypoints,
    Weave,
)
from selfmotion.shop.cam.pose_rows import PoseRows

# Length that counts as none [m].
_NOTHING = 1e-9
# Smallest number of times at which a path is compared with its rows.
_LOOKS = 2000
# Number of such times for each row.
_EACH = 20


def times_of_events(path: Path, rows: PoseRows) -> list[tuple[str, float]]:
    """Return events and their times along a path [s]: as it passes the poses of their rows.

    Where the times of poses are not known, a pose is passed where the path, of about as much of its
    length as the poses before, is nearest.
    """
    if not rows.events:
        return []
    passed = _poses_passed(path)
    if passed is not None and len(passed) == len(rows.positions):
        return [(event, float(passed[k])) for k, event in rows.events]
    t = np.linspace(0.0, path.duration, max(_LOOKS, _EACH * len(rows.positions)))
    points = path.samples(t).translation
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    chords = np.linalg.norm(np.diff(rows.positions, axis=0), axis=1)
    shares = np.append(0.0, np.cumsum(chords)) * (length[-1] / max(float(chords.sum()), _NOTHING))
    found = []
    for k, event in rows.events:
        early, late = shares[max(k - 1, 0)], shares[min(k + 1, len(shares) - 1)]
        near = np.flatnonzero((length >= early) & (length <= late))
        away = np.linalg.norm(points[near] - rows.positions[k], axis=1)
        at = float(t[near[int(away.argmin())]]) if len(near) else 0.0
        ends = {0: 0.0, len(shares) - 1: path.duration}
        found.append((event, float(ends.get(k, at))))
    return found


def _poses_passed(path: Path) -> Array | None:
    """Return when a path passes the poses that it was made of (N,), None where it has none."""
    match path:
        case Polyline():
            return path.pose_times
        case Waypoints():
            return np.asarray(path.waypoint_times - path.waypoint_times[0])
        case Feed() | Retimed():
            times = _poses_passed(path.original)
            if times is None:
                return None
            passed = np.where(times <= 0.0, 0.0, path.when(times))
            # Both ends exactly.
            return np.where(times >= path.original.duration, path.duration, passed)
        case Section() | Reversed() | Placed() | Weave():
            times = _poses_passed(path.original)
            # What happened before a section has happened when it begins.
            return None if times is None else np.clip(path.when(times), 0.0, path.duration)
        case Joined():
            found, start = [np.zeros(1)], 0.0
            for part in path.pieces:
                times = _poses_passed(part)
                if times is None:
                    return None
                found.append(start + times[1:])
                start += part.duration
            return np.concatenate(found)
    return None
