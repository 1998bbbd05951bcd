"""From rows of poses to a tool motion."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any, NamedTuple

import numpy as np

from selfmotion.basics import TURN, Array, FileFormatError, Ints, PathError, as_choice
from selfmotion.model.path import (
    ORIENTATIONS,
    TURN_NOTE,
    Feed,
    Joined,
    Path,
    Polyline,
    Waypoints,
    merged,
    section_at_rest,
)
from selfmotion.shop.cam.cuts import RAPID
from selfmotion.shop.cam.pose_rows import CLDATA, DRAWING, PROGRAMS, PoseRows
from selfmotion.shop.cam.tangents import AXES, sections_along, turning

# Largest coordinate in metres [m]; one beyond can only be meant in millimetres.
_MAX_COORDINATE = 50.0
# Distance of a pose from the one before that is a jump, unless another one is given [m].
JUMP = 0.5
# Rotation between poses that is a jump as well [rad]: its direction would be a guess.
_MAX_ROTATION = 2.6
# Difference of times that are the same [s].
_SAME_TIME = 1e-9
# Angle between legs from which on they make a corner, unless another one is given [rad].
_CORNER_ANGLE = np.pi / 6
# Distance of repeated poses [m].
_SAME_POSE = 1e-9
# Largest length of a stub, as a share of the steps beside it.
_STUB_SHARE = 0.05
# Largest rotation of the tool along a stub [rad].
_TURN_TOLERANCE = 1e-2
# Longest run-up of a path with a duration [s].
_RAMP = 0.5
# Number of places between two poses at which a curve is evaluated.
_SAMPLES = 9
# Difference from -1 of the cosine between legs of which the second goes back along the first.
_REVERSAL = 1e-3


@dataclass(frozen=True)
class Pacing:
    """Options of timing and corners of a path from a file; see `read_path`."""

    feed: float | None = None
    duration: float | None = None
    jump: float = JUMP
    corners: str = "blend"
    tolerance: float = 1e-3
    corner_angle: float | None = None
    turn_rate: float | None = None
    acceleration: float | None = None
    turn_acceleration: float | None = None
    smoothing: float | None = None
    within: float | None = None
    ramp: float | None = None
    standoff: float = 0.0
    along: str | None = None
    lead: float = 0.0
    tilt: float = 0.0
    lift: float = 0.0

    @property
    def bounds(self) -> dict[str, float]:
        """Bounds of a feed that are given."""
        names = ("turn_rate", "acceleration", "turn_acceleration", "smoothing", "within")
        limits = {name: getattr(self, name) for name in names}
        return {name: value for name, value in limits.items() if value is not None}


def path_of_rows(path: FilePath, rows: PoseRows, pacing: Pacing) -> Path:
    """Return the tool motion of rows of poses of a file; see `read_path`.

    Raises
    ------
    FileFormatError
        A row cannot be used; the line or pose is named.
    """
    if len(rows.positions) < 2:
        raise FileFormatError(f"{path}: has {len(rows.positions)} poses, expected at least two")
    _check_rows(path, rows)
    rotations = _rotations(path, rows)
    _check_jumps(path, rows, rotations, pacing.jump)
    rows, rotations = _without_stubs(rows, rotations, pacing)
    if pacing.standoff:
        rows = _with_standoff(path, rows, rotations, pacing.standoff)
    turns = _quaternions(rotations) if rows.orientation else None
    try:
        _check_corners(pacing)
        if pacing.along is not None:
            made = _aligned_path(rows, rotations, pacing)
        elif pacing.lead or pacing.tilt or pacing.lift:
            name = next(x for x in ("lead", "tilt", "lift") if getattr(pacing, x))
            raise PathError(
                f"{name} has no effect without along (x, -x, y, -y); drop it, or give it"
            )
        elif rows.straight:
            made = _cut_path(rows, turns, pacing)
        else:
            made = _table_path(path, rows, turns, pacing)
        is_ramped = pacing.ramp is not None and pacing.duration is None
        ramped = section_at_rest(made, ramp=pacing.ramp or 0.0) if is_ramped else made
    # Splines refuse times that differ, but by less than they can divide by.
    except (PathError, ValueError) as error:
        raise FileFormatError(f"{path}: {error}") from error
    turned = (TURN_NOTE,) if rows.orientation == "normal" else ()
    return ramped.noted((*rows.notes, *made.notes, *turned))


def _check_corners(pacing: Pacing) -> None:
    """Refuse what corners are not, and what has no effect on them."""
    as_choice(pacing.corners, "corners", ("blend", "stop", "round"), PathError)
    stops = pacing.corners == "stop"
    if pacing.corner_angle is not None and not stops:
        raise PathError(
            f"corner_angle has no effect where corners are '{pacing.corners}', only where they are "
            f"'stop'; drop one"
        )
    if pacing.ramp is not None and pacing.duration is not None and stops:
        raise PathError(
            "ramp has no effect on a duration where corners are 'stop', whose stretches rest at "
            "their ends; drop one"
        )


def _table_path(file: FilePath, rows: PoseRows, turns: Array | None, pacing: Pacing) -> Path:
    """Return the tool motion of a table."""
    feed, duration, bounds = pacing.feed, pacing.duration, pacing.bounds
    # The ramps are part of the duration, and go half as far as they last.
    moving = None if duration is None else _time_at_speed(file, duration, pacing)
    in_place = pacing.corners == "round" and moving is None
    t = _times(file, rows, feed, moving, turns_in_place=in_place)
    feeds = rows.feed if feed is None else np.full(len(rows.positions), feed)
    if bounds and feeds is None:
        raise PathError(f"{next(iter(bounds))} has no effect without a feed")
    if pacing.corners == "round":
        if feeds is None:
            raise PathError("corners are 'round', which needs a feed [m/s]; give it")
        legs = Polyline(rows.positions, turns, tolerance=pacing.tolerance)
        steady = _steady(rows.positions, feeds, pacing.tolerance)
        return _at_feed(legs, legs.pose_times, steady, bounds)
    return _with_deviation_note(_waypoint_path(t, rows, turns, feeds, pacing), t, rows, pacing)


def _waypoint_path(
    t: Array, rows: PoseRows, turns: Array | None, feeds: Array | None, pacing: Pacing
) -> Path:
    """Return a smooth path through poses."""
    bend = _CORNER_ANGLE if pacing.corner_angle is None else pacing.corner_angle
    through = Waypoints(t, rows.positions, turns, corners=pacing.corners, corner_angle=bend)
    through.samples([0.0])
    if feeds is None:
        return through if pacing.duration is None else _at_rest(through, pacing)
    sections: list[Path] = []
    passed = t - t[0]
    for section in through.between_corners():
        # From one rest to the next.
        here = (passed >= -_SAME_TIME) & (passed <= section.duration + _SAME_TIME)
        sections.append(_at_feed(section, passed[here], feeds[here], pacing.bounds))
        passed = passed - section.duration
    return sections[0] if len(sections) == 1 else Joined(sections)


def _time_at_speed(file: FilePath, duration: float, pacing: Pacing) -> float:
    """Return how long a path that is run up and down takes at its own speed [s]."""
    ramp = 0.0 if pacing.corners == "stop" else _ramp(pacing)
    if not 0.0 <= 2.0 * ramp <= duration:
        raise FileFormatError(
            f"{file}: ramp is {ramp:g} s, expected at most half of the duration, {duration:g} s"
        )
    return duration - ramp


def _at_rest(path: Path, pacing: Pacing) -> Path:
    """Return a path of a duration run up from rest, and down again, unless it rests anyway."""
    return path if pacing.corners == "stop" else section_at_rest(path, ramp=_ramp(pacing))


def _ramp(pacing: Pacing) -> float:
    """Return how long a path of a duration takes to run up [s]."""
    return min(_RAMP, 0.25 * (pacing.duration or 0.0)) if pacing.ramp is None else pacing.ramp


def _with_deviation_note(path: Path, t: Array, rows: PoseRows, pacing: Pacing) -> Path:
    """Give a path a note where it leaves the straight lines between its poses."""
    if pacing.corners != "blend" or rows.t is not None:
        return path
    legs = np.diff(rows.positions, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    sound = (lengths[:-1] > 0.0) & (lengths[1:] > 0.0)
    products = np.where(sound, lengths[:-1] * lengths[1:], 1.0)
    cosines = np.where(sound, (legs[:-1] * legs[1:]).sum(axis=1) / products, 1.0)
    if not (cosines < np.cos(_CORNER_ANGLE)).any():
        return path
    curve = Waypoints(t, rows.positions, corners="blend")
    shares = np.linspace(0.0, 1.0, _SAMPLES + 2)[1:-1]
    times = (t[:-1, None] + np.diff(t)[:, None] * shares - t[0]).ravel()
    points = curve.samples(times).translation.reshape(len(legs), _SAMPLES, 3)
    points = points - rows.positions[:-1, None]
    squares = np.where(lengths > 0.0, lengths**2, 1.0)
    along = np.clip(np.einsum("klc,kc->kl", points, legs) / squares[:, None], 0.0, 1.0)
    distances = np.linalg.norm(points - along[:, :, None] * legs[:, None], axis=2).max(axis=1)
    worst = int(distances.argmax())
    if distances[worst] > pacing.tolerance:
        has_feed = rows.feed is not None or pacing.feed is not None
        remedy = (
            f"corners round (--set path.corners=round) keeps {1e3 * pacing.tolerance:g} mm"
            if has_feed
            else "give more poses, or corners stop (--set path.corners=stop)"
        )
        # Of the ends of that leg, the one where it bends more.
        bends = np.concatenate([[1.0], cosines, [1.0]])[worst : worst + 2]
        kink = worst + int(bends.argmin())
        note = (
            f"the path leaves the straight lines between poses by up to "
            f"{1e3 * distances[worst]:.1f} mm at {rows.labels[kink]}: {remedy}"
        )
        return path.noted([note])
    return path


def _with_standoff(file: FilePath, rows: PoseRows, rotations: Array, standoff: float) -> PoseRows:
    """Return rows whose tip is held back along the tool's z axis."""
    if not rows.orientation:
        raise FileFormatError(
            f"{file}: standoff is along the tool's z axis, which it does not say; add nx,ny,nz"
        )
    return replace(rows, positions=rows.positions - standoff * rotations[:, :, 2])


def _cut_path(rows: PoseRows, turns: Array | None, pacing: Pacing) -> Path:
    """Return the straight legs of a cut or stroke, which rests where it goes back on itself."""
    if pacing.duration is not None:
        raise PathError("straight legs go at a feed, so that duration has no effect; drop it")
    feeds = rows.feed if pacing.feed is None else np.full(len(rows.positions), pacing.feed)
    if feeds is None:
        raise PathError("it says no feed (programs: F, FEDRAT); give a feed [m/s]")
    unturned = np.tile([1.0, 0.0, 0.0, 0.0], (len(rows.positions), 1))
    orientations = unturned if turns is None else turns
    rapid = np.zeros(len(feeds), dtype=bool) if rows.rapid is None else rows.rapid
    changes = 1 + np.flatnonzero(np.diff(rapid[:-1]))
    sections: list[Path] = []
    for first, last in pairwise([0, *changes.tolist(), len(rows.positions) - 1]):
        is_rapid = bool(rapid[first])
        part = slice(first, last + 1)
        own = (
            feeds[part]
            if is_rapid
            else _steady(rows.positions[part], feeds[part], pacing.tolerance)
        )
        ends = first + _rest_poses(rows.positions[part], orientations[part], pacing)
        for begin, end in pairwise(ends.tolist()):
            leg = slice(begin, end + 1)
            section = Polyline(
                rows.positions[leg],
                None if turns is None else turns[leg],
                tolerance=pacing.tolerance,
            )
            at = own[begin - first : end + 1 - first]
            if is_rapid:
                sections.append(Feed(section, RAPID, required=False, **pacing.bounds))
            else:
                sections.append(_at_feed(section, section.pose_times, at, pacing.bounds))
    return sections[0] if len(sections) == 1 else Joined(sections)


class _CutSection(NamedTuple):
    """A section of a path between corners, or a turn in one.

    Attributes
    ----------
    positions : (K, 3)
        [m]
    rotations : (K, 3, 3)
    feeds : (K,)
        From each pose on [m/s].
    is_free : bool
        Whether it is a rapid or a turn, at no feed that is judged.
    """

    positions: Array
    rotations: Array
    feeds: Array
    is_free: bool


def _aligned_path(rows: PoseRows, rotations: Array, pacing: Pacing) -> Path:
    """Return straight legs along which an axis of the tool points where it goes."""
    along = as_choice(pacing.along, "along", tuple(AXES), PathError)
    if pacing.corners == "blend":
        raise PathError(
            f"along = '{along}' turns the tool in corners: say corners stop (on the spot, at "
            f"rest) or round (within the tolerance)"
        )
    if pacing.lift and pacing.corners != "stop":
        raise PathError(
            f"lift has no effect where corners are '{pacing.corners}', only where they are 'stop'; "
            f"drop one"
        )
    count = len(rows.positions)
    if rows.t is not None or pacing.duration is not None:
        raise PathError(f"along = '{along}' is for paths at a feed, without times or a duration")
    if rows.feed is not None and pacing.feed is not None and not rows.straight:
        raise PathError("has a column feed, so that feed has no effect; drop one")
    feeds = rows.feed if pacing.feed is None else np.full(count, pacing.feed)
    if feeds is None:
        raise PathError(f"along = '{along}' needs a feed [m/s]; give it")
    axes = rotations[:, :, 2] if rows.orientation else np.tile([0.0, 0.0, -1.0], (count, 1))
    rapid = np.zeros(count, dtype=bool) if rows.rapid is None else rows.rapid
    bend = _CORNER_ANGLE if pacing.corner_angle is None else pacing.corner_angle
    aligned = sections_along(rows.positions, axes, rapid, along, (pacing.lead, pacing.tilt), bend)
    sections: list[_CutSection] = []
    for number, (first, last, turns) in enumerate(aligned):
        if number:
            before = turning(aligned[number - 1].rotations[-1], turns[0])
            # Of two cuts: a rapid leaves the part by itself.
            beside_rapid = rapid[aligned[number - 1].first] or rapid[first]
            is_lifted = pacing.lift > 0.0 and not beside_rapid
            offset = -pacing.lift * axes[first] if is_lifted else np.zeros(3)
            sections += _turn_sections(
                rows.positions[first], np.array(before), float(feeds[first]), offset
            )
        part = slice(first, last + 1)
        sections.append(_CutSection(rows.positions[part], turns, feeds[part], bool(rapid[first])))
    if pacing.corners == "round":
        sections = _joined_sections(sections, [bool(rapid[item.first]) for item in aligned])
    paths: list[Path] = []
    for points, turns, own, is_free in sections:
        if not is_free or np.ptp(points, axis=0).max() > 0.0 or _rotates(turns):
            legs = Polyline(points, _quaternions(turns), tolerance=pacing.tolerance)
            if is_free:
                paths.append(Feed(legs, RAPID, required=False, **pacing.bounds))
            else:
                steady = _steady(points, own, pacing.tolerance)
                paths.append(_at_feed(legs, legs.pose_times, steady, pacing.bounds))
    return paths[0] if len(paths) == 1 else Joined(paths)


def _turn_sections(corner: Array, turns: Array, feed: float, offset: Array) -> list[_CutSection]:
    """Return the sections of a turn at a corner: on the spot, or lifted by an offset (3,)."""
    count = len(turns)
    spot = _CutSection(np.tile(corner + offset, (count, 1)), turns, np.full(count, feed), True)
    if not offset.any() or not _rotates(turns):
        return [spot]
    sides = (([corner, corner + offset], turns[0]), ([corner + offset, corner], turns[-1]))
    up, down = (
        _CutSection(np.array(ends), np.array([turn, turn]), np.full(2, feed), True)
        for ends, turn in sides
    )
    return [up, spot, down]


def _rotates(turns: Array) -> bool:
    """Whether rotations differ by more than rounding."""
    return bool(np.abs(turns - turns[0]).max() > _SAME_POSE)


def _joined_sections(sections: Sequence[_CutSection], rapid: Sequence[bool]) -> list[_CutSection]:
    """Return sections of which those at a feed, and turns between two of them, are one."""
    merged: list[_CutSection] = []
    for number, section in enumerate(sections):
        # Turns stand between the sections of legs.
        is_rapid = rapid[number // 2 : number // 2 + 1 + number % 2]
        at_feed = not any(is_rapid)
        if merged and at_feed and not merged[-1].is_free:
            last = merged[-1]
            pairs = (
                (last.positions, section.positions),
                (last.rotations, section.rotations),
                (last.feeds, section.feeds),
            )
            joined = [np.concatenate([one, other[1:]]) for one, other in pairs]
            merged[-1] = _CutSection(joined[0], joined[1], joined[2], False)
        else:
            merged.append(section._replace(is_free=not at_feed))
    return merged


def _rest_poses(positions: Array, turns: Array, pacing: Pacing) -> Ints:
    """Return at which poses a tool rests: both ends, where it goes back on itself, or corners."""
    apart = merged(positions, turns, pacing.tolerance, _TURN_TOLERANCE).kept
    legs = np.diff(positions[apart], axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosines = (legs[:-1] * legs[1:]).sum(axis=1) / (lengths[:-1] * lengths[1:])
    least = _REVERSAL - 1.0
    if pacing.corners == "stop":
        least = np.cos(_CORNER_ANGLE if pacing.corner_angle is None else pacing.corner_angle)
    inner = apart[1 + np.flatnonzero(cosines < least)]
    return np.array([0, *inner.tolist(), len(positions) - 1])


def _steady(positions: Array, feeds: Array, tolerance: float) -> Array:
    """Return feeds (N,) without those that hold for less length than the tolerance."""
    steady = feeds.copy()
    steps = np.append(np.linalg.norm(np.diff(positions, axis=0), axis=1), 0.0)
    edges = [0, *(1 + np.flatnonzero(np.diff(feeds[:-1]))).tolist(), len(feeds)]
    before: float | None = None
    for first, last in reversed(list(pairwise(edges))):
        # A start that is as short goes at what follows it.
        if before is not None and steps[first:last].sum() < tolerance:
            steady[first:last] = before
        before = float(steady[first])
    return steady


def _without_stubs(rows: PoseRows, rotations: Array, pacing: Pacing) -> tuple[PoseRows, Array]:
    """Return rows without repeated ones and those of stubs, where the file says no times.

    A stub is a step shorter than the tolerance, and than a twentieth of those beside it: a curve
    through its ends would swing for it.
    """
    count = len(rows.positions)
    if rows.t is not None or rows.straight or count < 3:
        return rows, rotations
    chosen = [0]
    for k in range(1, count):
        step = float(np.linalg.norm(rows.positions[k] - rows.positions[chosen[-1]]))
        others = [
            float(np.linalg.norm(rows.positions[b] - rows.positions[a]))
            for a, b in ((k, k + 1), (chosen[-1] - 1, chosen[-1]))
            if a >= 0 and b < count
        ]
        short = step <= _SAME_POSE or (step < pacing.tolerance and step < _STUB_SHARE * min(others))
        cosine = 0.5 * (np.sum(rotations[k] * rotations[chosen[-1]]) - 1.0)
        if not (short and np.arccos(np.clip(cosine, -1.0, 1.0)) <= _TURN_TOLERANCE):
            chosen.append(k)
        elif k == count - 1 and len(chosen) > 1:
            # The end stays where it is.
            chosen[-1] = k
    if len(chosen) in (1, count):
        return rows, rotations
    return rows.selected(chosen), rotations[chosen]


def _at_feed(path: Path, t: Array, feeds: Array, bounds: Mapping[str, Any]) -> Feed:
    """Return a path at the feeds (N,) that begin at its times (N,); the last one has no length."""
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
            label = rows.labels[int(bad[0])]
            raise FileFormatError(f"{file}: {label}: the {what} is not finite; mend or drop it")
    for what, values, bound, remedy in (
        ("position", rows.positions, _MAX_COORDINATE, f"metres; {_units_remedy(file, rows)}"),
        ("angle", rows.values, TURN, "radians; say roll_deg,… or rx_deg,… if it is degrees"),
    ):
        if what == "angle" and rows.orientation not in ("rpy", "rotation_vector"):
            continue
        far = np.argwhere(np.abs(values) > bound)
        if len(far):
            row, column = far[0]
            value = f"{what} {values[row, column]:.6g}"
            raise FileFormatError(f"{file}: {rows.labels[row]}: {value} is taken for {remedy}")
    if rows.t is not None:
        late = np.flatnonzero(np.diff(rows.t) <= 0.0)
        if late.size:
            row = int(late[0]) + 1
            raise FileFormatError(
                f"{file}: {rows.labels[row]}: time {rows.t[row]:.6g} s does not come after "
                f"{rows.t[row - 1]:.6g} s; times must increase"
            )


def _rotations(file: FilePath, rows: PoseRows) -> Array:
    if not rows.orientation:
        return np.tile(np.eye(3), (len(rows.positions), 1, 1))
    _, rotation = ORIENTATIONS[rows.orientation]
    rotations = list[Array]()
    for k, (label, values) in enumerate(zip(rows.labels, rows.values, strict=True)):
        try:
            again = k > 0 and np.array_equal(values, rows.values[k - 1])
            rotations.append(rotations[-1] if again else rotation(values))
        except (ValueError, PathError) as error:
            raise FileFormatError(f"{file}: {label}: {error}") from error
    return np.array(rotations)


def _check_jumps(file: FilePath, rows: PoseRows, rotations: Array, jump: float) -> None:
    steps = np.linalg.norm(np.diff(rows.positions, axis=0), axis=1)
    if rows.rapid is not None:
        # A rapid goes straight as far as the file says.
        steps = np.where(rows.rapid[:-1], 0.0, steps)
    cosines = np.einsum("kij,kij->k", rotations[:-1], rotations[1:])
    turns = np.arccos(np.clip(0.5 * (cosines - 1.0), -1.0, 1.0))
    if len(steps) == 1 and jump >= JUMP and file.suffix.lower() != DRAWING:
        # Both ends of a seam: no pose between them is missing.
        steps = np.zeros(1)
    for what, amounts, bound, unit, remedy in (
        ("jumps by", steps, jump, "m", _jump_remedy(jump, _units_remedy(file, rows))),
        (
            "turns by",
            turns,
            _MAX_ROTATION,
            "rad",
            "which has no clear direction; add poses between",
        ),
    ):
        far = np.flatnonzero(amounts > bound)
        if far.size:
            row = int(far[0]) + 1
            raise FileFormatError(
                f"{file}: {rows.labels[row]}: the path {what} {amounts[row - 1]:.4g} {unit} from "
                f"the pose before, {remedy}"
            )


def _jump_remedy(jump: float, units: str) -> str:
    return f"more than {jump:g} m; give a larger jump if it is meant, or {units}"


def _units_remedy(file: FilePath, rows: PoseRows) -> str:
    """Return the remedy, in words, where lengths are in another unit than they are taken for."""
    if file.suffix.lower() == DRAWING:
        return "say in which unit it is drawn if $INSUNITS is wrong (unit = 'mm')"
    if file.suffix.lower() in (*PROGRAMS, *CLDATA):
        return "mend the file's units (G20, UNITS/INCHES: inches; G21, UNITS/MM: mm)"
    if rows.straight:
        return "write its places in the unit of its form, or as a table with x_mm,y_mm,z_mm"
    return "name the columns x_mm,y_mm,z_mm if they are millimetres"


def _times(
    file: FilePath,
    rows: PoseRows,
    feed: float | None,
    duration: float | None,
    *,
    turns_in_place: bool,
) -> Array:
    options = {"feed": feed, "duration": duration}
    named = [name for name, value in options.items() if value is not None]
    columns = [name for name, column in (("t", rows.t), ("feed", rows.feed)) if column is not None]
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
                f"{file}: {rows.labels[row]}: feed is {rows.feed[row]:.6g} m/s, expected a number "
                f"above 0"
            )
    elif len(named) != 1:
        raise FileFormatError(
            f"{file}: has no times; give either a feed [m/s] or a duration [s]"
            + (", not both" if named else "")
        )
    steps = np.linalg.norm(np.diff(rows.positions, axis=0), axis=1)
    standing = np.flatnonzero(steps == 0.0)
    if standing.size and not turns_in_place:
        raise FileFormatError(
            f"{file}: {rows.labels[int(standing[0]) + 1]}: the tool does not move from the pose "
            f"before, which takes no time by feed or duration; give a column t, or a feed with "
            f"corners round (--set path.corners=round), where the tool turns in place"
        )
    if rows.feed is not None:
        return np.append(0.0, np.cumsum(steps / rows.feed[:-1]))
    length = np.append(0.0, np.cumsum(steps))
    return length / feed if feed is not None else length * (float(duration or 0.0) / length[-1])


def _quaternions(rotations: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotations).as_quat(scalar_first=True))
