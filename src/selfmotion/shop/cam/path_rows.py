"""Rows of poses from tables, arrays and ROS messages: columns, units and orientations."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import (
    LEFT_OUT,
    TURN,
    Array,
    FileFormatError,
    Flags,
    ProblemError,
    as_choice,
    nearest,
    read_arrays,
    read_rows,
    read_values,
    shown,
)
from selfmotion.shop.cam.rotary import Rotary

_POSITION = ("x", "y", "z")
# Suffixes of tables, of an array and of G-code.
TABLES = (".csv", ".txt", ".tsv")
ARRAY = ".npy"
PROGRAMS = (".nc", ".ngc", ".gcode", ".tap", ".cnc", ".eia", ".mpf", ".g", ".gc", ".gco")


# Columns of an orientation → its key in `ORIENTATIONS`.
_COLUMNS: Mapping[tuple[str, ...], str] = {
    ("qw", "qx", "qy", "qz"): "quaternion",
    ("rx", "ry", "rz"): "rotation_vector",
    ("roll", "pitch", "yaw"): "rpy",
    ("nx", "ny", "nz"): "normal",
}


_ROTATION_VECTOR = ("rx", "ry", "rz")
_ROTATION_VECTOR_NOTE = (
    "rx,ry,rz are read as a rotation vector: the axis of a turn, as long as its angle"
)
# Relative rounding that is allowed above half a turn.
_HALF_TURN = 2e-4


# Columns of a table without a header, by their number.
_HEADERS = {
    3: "x,y,z",
    4: "t,x,y,z",
    6: "x,y,z,nx,ny,nz",
    7: "x,y,z,qw,qx,qy,qz",
    8: "t,x,y,z,qw,qx,qy,qz",
}
# Columns of an array, by their number, unless options name them.
_ARRAYS = {3: ("x", "y", "z"), 4: ("t", "x", "y", "z")}
# Units in brackets behind a title → what its name ends in; other names of columns.
_BRACKETS = {"mm": "_mm", "mm/s": "_mm", "deg": "_deg", "°": "_deg", "degrees": "_deg"}
_BRACKETS |= {"cm": "_cm", "cm/s": "_cm", "in": "_in", "inch": "_in", "in/s": "_in"}
_BRACKETS |= dict.fromkeys(("m", "rad", "s", "m/s", "sec", "-", "1"), "")
_SYNONYMS = {"time": "t", "timestamp": "t"}
# Names of x or qx in other programs: pose.position.x, pos_x, px, tx; orientation.x, quat_x.
_POSITION_TITLES = re.compile(r"(?:[a-z]+[._])*(?:position|pos|translation)[._]([xyz])|[pt]([xyz])")
_QUATERNION_TITLES = re.compile(r"(?:[a-z]+[._])*(?:orientation|quaternion|quat|q)[._]([wxyz])")
# The first word of a program.
_GCODE_WORD = re.compile(r"[gmn][0-9]+|%")
_TITLE_WITH_UNIT = re.compile(r"([^\[(]*?)[\s_]*[\[(]([^\])]*)[\])]")
# Column with the name of a row's seam.
SEAM = "seam"
# Column with the events at a row.
EVENT = "event"
_KNOWN = {"t", "feed", *_POSITION, *(name for names in _COLUMNS for name in names)}


# Names of orientations of makers of controllers → their names here.
_MAKERS_TITLES = {
    **dict.fromkeys("abc", "A,B,C of KUKA are yaw_deg,pitch_deg,roll_deg here"),
    **dict.fromkeys(("w", "p", "r"), "W,P,R of Fanuc are roll_deg,pitch_deg,yaw_deg here"),
    **dict.fromkeys(("q1", "q2", "q3", "q4"), "q1,q2,q3,q4 of ABB are qw,qx,qy,qz here"),
}


# Columns of a frame of KUKA's → their names here.
_KUKA_TITLES = {
    "a": "yaw_deg",
    "b": "pitch_deg",
    "c": "roll_deg",
    "x": "x_mm",
    "y": "y_mm",
    "z": "z_mm",
}
_KUKA_NOTE = (
    "columns A,B,C are read as KUKA's: angles about z, y and x in turn in degrees, x,y,z in mm "
    "where they say no unit"
)
# Coordinate above which lengths are no metres: no arm reaches so far [m].
_MAX_METRES = 10.0


# Names that are offered as spelling suggestions.
_HINTED = ("feed", "roll", "pitch", "yaw")


_UNITS = {
    "_mm": ((*_POSITION, "feed"), 1e-3),
    "_cm": ((*_POSITION, "feed"), 1e-2),
    "_in": ((*_POSITION, "feed"), 25.4e-3),
    "_deg": (("rx", "ry", "rz", "roll", "pitch", "yaw"), None),
}


@dataclass(frozen=True, eq=False)
class PoseRows:
    """Poses of a file, with a label for each.

    Attributes
    ----------
    labels : sequence of str
        "line 7", "poses[6]", …
    positions : (N, 3)
    orientation : str
        Key in `ORIENTATIONS`; "" for none.
    values : (N, …)
        Orientations, in the form that `orientation` names.
    t : (N,) or None
    feed : (N,) or None
        Feed from each pose on [m/s].
    events : tuple of (int, str)
        Index of a pose, and the name of the event there.
    straight : bool
        Whether the tool goes straight from pose to pose.
    one_way : bool
        Whether its direction of travel is fixed, as that of machining cuts is.
    notes : tuple of str
        Assumptions that were made in reading the file.
    rapid : (N,) or None
        Whether the motion from each pose on is rapid, whatever the feed; None for nowhere.
    """

    labels: Sequence[str]
    positions: Array
    orientation: str
    values: Array
    t: Array | None
    feed: Array | None = None
    events: tuple[tuple[int, str], ...] = ()
    straight: bool = False
    one_way: bool = False
    notes: tuple[str, ...] = ()
    rapid: Flags | None = None


# Options of `read_path` about the contents of a file.
READING = ("columns", "rotary", "rotary_axes", "rotary_center", "unit")
# Units that may be given for drawings and cutter locations [m].
LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1.0, "in": 25.4e-3, "ft": 0.3048}
DRAWING = ".dxf"
# Suffixes of files of cutter locations: of APT, CATIA, NX and Creo.
CLDATA = (".apt", ".aptsource", ".cls", ".clsf", ".cl", ".ncl")


@dataclass(frozen=True)
class Reading:
    """Options for reading a file, for what the file does not state; see `read_path`.

    Attributes
    ----------
    columns : tuple of str or None
        Of a table.
    rotary : Rotary or None
        Of a program of a machine: what its rotary words turn.
    unit : str or None
        Of a drawing or of cutter locations, whatever the file says itself.
    """

    columns: tuple[str, ...] | None = None
    rotary: Rotary | None = None
    unit: str | None = None

    @classmethod
    def of(cls, file: FilePath, options: Mapping[str, Any]) -> "Reading":
        """Return those among the options of `read_path`; unrelated ones are ignored.

        Raises
        ------
        FileFormatError
            One is of the wrong kind, or of another kind of file.
        """
        try:
            rotary = Rotary.of(options)
        except (ValueError, ProblemError) as error:
            raise FileFormatError(f"{file}: {error}") from error
        if rotary is not None and file.suffix.lower() not in PROGRAMS:
            raise FileFormatError(f"{file}: rotary has no effect: it is no G-code; drop it")
        unit, columns = options.get("unit"), options.get("columns")
        if unit is not None:
            as_choice(unit, f"{file}: unit", tuple(LENGTH_UNITS), FileFormatError)
            if file.suffix.lower() not in (DRAWING, *CLDATA):
                raise FileFormatError(
                    f"{file}: unit has no effect: it is neither a drawing nor APT; drop it"
                )
        if columns is None:
            return cls(None, rotary, unit)
        if isinstance(columns, str):
            columns = columns.split(",")
        if not isinstance(columns, list | tuple) or not all(isinstance(x, str) for x in columns):
            raise FileFormatError(f"{file}: columns is {shown(columns)}, expected names")
        if file.suffix.lower() not in (*TABLES, ARRAY):
            raise FileFormatError(f"{file}: columns has no effect: it is no table; drop it")
        return cls(tuple(name.strip() for name in columns))


# Largest number of seams that a message names.
_MAX_LISTED = 5


def no_such_seam(file: FilePath, seam: str, names: Sequence[str]) -> FileFormatError:
    """Return an error that says which seams a file has, those of a like name if there are any."""
    listed = ", ".join(repr(name) for name in names[:_MAX_LISTED])
    more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
    return FileFormatError(
        f"{file}: has no seam '{seam}'{nearest(seam, names) or f'; it has {listed}{more}'}"
    )


def read_tables(file: FilePath, reading: Reading | None = None) -> dict[str, PoseRows]:
    """Return the rows of a table by the names in its column ``seam``, "" where it has none."""
    with_unit = set[str]()

    def normalised(title: str) -> str:
        """Return the column's name for a title, and record titles that state a unit."""
        name = column_name(title)
        if "[" in title or "(" in title:
            with_unit.add(name)
        return name

    header, table, lines, texts = read_rows(
        file,
        (SEAM, EVENT),
        check=lambda names: [_si_column(file, name) for name in _kuka_titles(names)],
        columns=None if reading is None else reading.columns,
        named=normalised,
        usual=_HEADERS,
    )
    labels = [f"line {number}" for number in lines]
    whole = rows_of_table(file, header, table, labels, texts, with_unit)
    if SEAM not in texts:
        return {"": whole}
    if not lines:
        raise FileFormatError(f"{file}: has 0 poses, expected at least two")
    names = texts[SEAM]
    blank = next((line for line, name in zip(lines, names, strict=True) if not name), None)
    if blank is not None:
        raise FileFormatError(f"{file}: line {blank}: names no seam")
    return {name: selected_rows(whole, [k for k, other in enumerate(names) if other == name])
            for name in dict.fromkeys(names)}  # fmt: skip


def selected_rows(rows: PoseRows, chosen: Sequence[int]) -> PoseRows:
    """Return some of the rows."""
    new = {old: k for k, old in enumerate(chosen)}
    return PoseRows(
        [rows.labels[k] for k in chosen],
        rows.positions[chosen],
        rows.orientation,
        rows.values[chosen],
        None if rows.t is None else rows.t[chosen],
        None if rows.feed is None else rows.feed[chosen],
        tuple((new[k], event) for k, event in rows.events if k in new),
        rows.straight,
        rows.one_way,
        rows.notes,
        None if rows.rapid is None else rows.rapid[chosen],
    )


def rows_of_table(
    file: FilePath,
    header: Sequence[str],
    table: Array,
    labels: Sequence[str],
    texts: Mapping[str, Sequence[str]],
    with_unit: Collection[str] = (),
) -> PoseRows:
    """Return the poses of a table, from its columns of numbers and of texts.

    Columns `with_unit` have a unit in the title, though not in their name.
    """
    notes: tuple[str, ...] = ()
    if (titles := _kuka_titles(header)) != list(header):
        _check_millimetres(file, header, table)
        header, notes = titles, (_KUKA_NOTE,)
    columns = _columns(file, header, table)
    notes += _units_note([title for title in header if title not in with_unit])
    events = texts.get(EVENT, [""] * len(labels))
    missing = [name for name in _POSITION if name not in columns]
    if missing:
        raise FileFormatError(
            f"{file}: column '{missing[0]}' is missing; the header is "
            f"{','.join((*header, *texts))}, expected x,y,z [m] (or x_mm,…), t [s], and an "
            f"orientation"
        )
    given = [names for names in _COLUMNS if set(names) & set(columns)]
    if len(given) > 1:
        raise FileFormatError(
            f"{file}: has columns {','.join(given[0])} and {','.join(given[1])}; keep one "
            f"orientation"
        )
    values = np.zeros((len(table), 0))
    for names in given:
        lacking = [name for name in names if name not in columns]
        if lacking:
            raise FileFormatError(
                f"{file}: column '{lacking[0]}' is missing, expected {','.join(names)}"
            )
        values = np.stack([columns[name] for name in names], axis=1)
    if given == [_ROTATION_VECTOR]:
        unit = "_deg" if any(column_name(title) == "rx_deg" for title in header) else ""
        angles = ",".join(f"{name}{unit}" for name in ("roll", "pitch", "yaw"))
        _check_rotation_vectors(file, values, labels, angles)
        notes += (f"{_ROTATION_VECTOR_NOTE}; angles about fixed axes are called {angles}",)
    return PoseRows(
        labels,
        np.stack([columns[name] for name in _POSITION], axis=1),
        _COLUMNS[given[0]] if given else "",
        values,
        columns.get("t"),
        columns.get("feed"),
        tuple((k, event) for k, text in enumerate(events) for event in _split_events(text)),
        notes=notes,
    )


# Columns without a unit → the unit that is taken, and the ending for another one.
_DEFAULT_UNITS = {
    "t": ("seconds", ""),
    **dict.fromkeys(_POSITION, ("metres", "x_mm, x_cm, x_in")),
    "feed": ("m/s", "feed_mm"),
    **dict.fromkeys(("roll", "pitch", "yaw"), ("radians about fixed axes", "roll_deg")),
    **dict.fromkeys(_ROTATION_VECTOR, ("radians", "rx_deg")),
}


def _units_note(titles: Sequence[str]) -> tuple[str, ...]:
    """Return a note of columns that say no unit, and of what they are taken for."""
    bare: dict[tuple[str, str], list[str]] = {}
    for title in titles:
        if column_name(title) in _DEFAULT_UNITS:
            bare.setdefault(_DEFAULT_UNITS[column_name(title)], []).append(column_name(title))
    if not bare:
        return ()
    columns = "; ".join(
        f"{','.join(names)} for {taken}{f' (else: {others})' if others else ''}"
        for (taken, others), names in bare.items()
    )
    return (f"columns say no unit and are taken so: {columns}",)


def _kuka_titles(titles: Sequence[str]) -> list[str]:
    """Return titles as they are called here where A, B and C are among them, as KUKA has them."""
    given = [column_name(title) for title in titles]
    return (
        [_KUKA_TITLES.get(name, name) for name in given]
        if {"a", "b", "c"} <= set(given)
        else [*titles]
    )


def _check_millimetres(file: FilePath, titles: Sequence[str], table: Array) -> None:
    """Refuse places beside A, B, C that say no unit and are as small as metres would be."""
    bare = [k for k, title in enumerate(titles) if column_name(title) in _POSITION]
    if bare and len(table) and np.abs(table[:, bare]).max() < _MAX_METRES:
        raise FileFormatError(
            f"{file}: A,B,C are KUKA's, whose x,y,z are in mm, and all of these are below "
            f"{_MAX_METRES:g}: call them x_mm,y_mm,z_mm; of metres call A,B,C "
            f"yaw_deg,pitch_deg,roll_deg"
        )


def _check_rotation_vectors(
    file: FilePath, turns: Array, labels: Sequence[str], angles: str
) -> None:
    """Refuse rotation vectors (K, 3) [rad] of more than half a turn, which angles look like."""
    sizes = np.linalg.norm(turns, axis=1)
    # Degrees that are taken for radians are reported as such later on.
    over = (sizes > (1.0 + _HALF_TURN) * np.pi) & (np.abs(turns).max(axis=1) <= TURN)
    if over.any():
        k = int(np.argmax(over))
        raise FileFormatError(
            f"{file}: {labels[k]}: rx,ry,rz is an axis times an angle of "
            f"{np.degrees(sizes[k]):.7g}°, more than half a turn; are these angles about fixed "
            f"axes? Call them {angles}; of a rotation vector take the shorter turn, the other way "
            f"round"
        )


def column_name(title: str) -> str:
    """Return a title as its column is called here: x_mm of "X [mm]"."""
    name = title.strip().lower()
    found = _TITLE_WITH_UNIT.fullmatch(name)
    if found and found[2].strip() in _BRACKETS:
        name = found[1] + _BRACKETS[found[2].strip()]
    stem, unit = name, ""
    for suffix in _UNITS:
        if name.endswith(suffix):
            stem, unit = name.removesuffix(suffix), suffix
    if position := _POSITION_TITLES.fullmatch(stem):
        stem = position[1] or position[2]
    elif turn := _QUATERNION_TITLES.fullmatch(stem):
        stem = f"q{turn[1]}"
    return _SYNONYMS.get(stem, stem) + unit


def _split_events(text: str) -> list[str]:
    """Return the events of a row, with semicolons between them."""
    return [event.strip() for event in text.split(";") if event.strip()]


def _columns(file: FilePath, header: Sequence[str], table: Array) -> dict[str, Array]:
    """Return the columns in SI units, by their names without unit."""
    columns: dict[str, Array] = {}
    for k, title in enumerate(header):
        name, scale = _si_column(file, title)
        if name in columns:
            raise FileFormatError(f"{file}: column '{name}' appears twice, in two units")
        columns[name] = scale * table[:, k]
    return columns


def _si_column(file: FilePath, title: str) -> tuple[str, float]:
    """Return the name of a column without its unit, and that in SI units."""
    title = column_name(title)
    name, scale = title, 1.0
    for suffix, (names, factor) in _UNITS.items():
        if title.endswith(suffix) and title.removesuffix(suffix) in names:
            name, scale = title.removesuffix(suffix), factor or np.pi / 180.0
    if name in ("i", "j", "k"):
        raise FileFormatError(
            f"{file}: column '{name}': of machines i,j,k points out of the part; nx,ny,nz is the "
            f"tool's z axis here, into the part: call them nx,ny,nz, and say flip_normals where "
            f"they point out"
        )
    if _GCODE_WORD.match(title):
        raise FileFormatError(
            f"{file}: unknown column '{title}': if this is G-code, call the file .nc or .gcode"
        )
    if name in _MAKERS_TITLES:
        raise FileFormatError(f"{file}: unknown column '{title}': {_MAKERS_TITLES[name]}")
    if name not in _KNOWN:
        raise FileFormatError(
            f"{file}: unknown column '{title}'{nearest(title, (*_HINTED, SEAM, EVENT))}, expected "
            f"t, feed, seam, event, x,y,z and "
            f"{' or '.join(','.join(names) for names in _COLUMNS)}; to leave a column out, "
            f"call it - in columns (--columns -,x,y,z)"
        )
    return name, scale


def _read_array(file: FilePath, reading: Reading) -> PoseRows:
    (array,) = read_arrays(file).values()
    if array.dtype.kind not in "iuf":
        raise FileFormatError(f"{file}: holds no array of numbers")
    labels = [f"row {k}" for k in range(1, 1 + (len(array) if array.ndim else 0))]
    if array.ndim == 3 and array.shape[1:] == (4, 4):
        rotations = array[:, :3, :3] * 1.0
        rows = PoseRows(labels, array[:, :3, 3] * 1.0, "rotation", rotations, None)
        return replace(rows, notes=(MATRIX_NOTE,))
    if array.ndim != 2:
        raise FileFormatError(
            f"{file}: has shape {array.shape}, expected (N, 4, 4) poses, or a table (N, C)"
        )
    columns = reading.columns or _ARRAYS.get(array.shape[1])
    if columns is None and array.shape[1] in (7, 8):
        before = "t," * (array.shape[1] == 8)
        raise FileFormatError(
            f"{file}: has shape {array.shape}, which does not say in which order quaternions are; "
            f"give columns ('{before}x,y,z,qw,qx,qy,qz' or '{before}x,y,z,qx,qy,qz,qw')"
        )
    if columns is None or len(columns) != array.shape[1]:
        count = "no columns" if columns is None else f"{len(columns)} columns"
        raise FileFormatError(
            f"{file}: has shape {array.shape} and {count} are named, expected (N, 4, 4) poses, "
            f"(N, 3) x,y,z, (N, 4) t,x,y,z, or a name in columns for each"
        )
    chosen = [k for k, name in enumerate(columns) if name != LEFT_OUT]
    numbers = array[:, chosen] * 1.0
    return rows_of_table(file, [columns[k] for k in chosen], numbers, labels, {})


# Note on 4 x 4 matrices, which say no unit.
MATRIX_NOTE = "matrices say no unit: their last columns are taken for metres"


# Names of a list of messages.
_LISTS = ("paths", "rasters", "pose_arrays")


def _read_ros(file: FilePath) -> dict[str, PoseRows]:
    """Return the poses of a message, or of each of several ones (rasters) as a seam."""
    document = read_values(file)
    # Rasters of rasters are one list of strokes, and so are jobs of them.
    messages = list(_messages(document if isinstance(document, list) else [document]))
    if not messages:
        raise FileFormatError(
            f"{file}: holds no message with poses, expected a nav_msgs/Path or "
            f"geometry_msgs/PoseArray, or a list of these"
        )
    notes = _frame_notes(file, messages)
    if len(messages) == 1:
        return {"": replace(_of_message(file, messages[0], ""), notes=notes)}
    return {
        f"seam {number}": replace(_of_message(file, message, f"[{number - 1}]."), notes=notes)
        for number, message in enumerate(messages, 1)
    }


def _frame_notes(file: FilePath, messages: Sequence[Any]) -> tuple[str, ...]:
    """Return a note of the frame that messages name, which is not looked up.

    Raises
    ------
    FileFormatError
        Poses are in different frames: where these are to each other is not known.
    """
    frames: dict[str, None] = {}
    for message in messages:
        poses = message.get("poses") if isinstance(message, Mapping) else None
        for item in (message, *(poses if isinstance(poses, list) else ())):
            header = item.get("header") if isinstance(item, Mapping) else None
            name = header.get("frame_id") if isinstance(header, Mapping) else None
            # An empty one is that of the message.
            if isinstance(name, str) and name.strip("/ "):
                frames.setdefault(name.strip("/ "))
    if len(frames) > 1:
        first, second, *_ = frames
        raise FileFormatError(
            f"{file}: has poses in frame '{first}' and in '{second}', expected one: transform them "
            f"into the same, whose place is told by a frame (--frame)"
        )
    if not frames:
        return ("ROS: poses in metres, in no frame that is named",)
    return tuple(
        f"ROS: poses in metres in frame '{name}', which is taken for the root of the arm, or for "
        f"what frame (--frame) says"
        for name in frames
    )


def _messages(items: Sequence[Any]) -> Iterator[Any]:
    for item in items:
        keys = _LISTS if isinstance(item, Mapping) else ()
        listed = next((item[key] for key in keys if isinstance(item.get(key), list)), None)
        if listed is not None:
            yield from _messages(listed)
        elif isinstance(item, list) and item and not _is_pose(item[0]):
            yield from _messages(item)
        else:
            yield {"poses": item} if isinstance(item, list) else item


def _is_pose(item: Any) -> bool:
    return isinstance(item, Mapping) and ("position" in item or "pose" in item)


def _of_message(file: FilePath, message: Any, where: str) -> PoseRows:
    poses = message.get("poses") if isinstance(message, Mapping) else None
    if not isinstance(poses, list) or not poses:
        raise FileFormatError(
            f"{file}: {where and f'{where[:-1]} '}has no list of poses, expected a nav_msgs/Path "
            f"or geometry_msgs/PoseArray, or poses in a list or by names (waypoints), each with "
            f"position and orientation or x, y, z"
        )
    labels = [f"{where}poses[{k}]" for k in range(len(poses))]
    rows = [_ros_pose(file, label, pose) for label, pose in zip(labels, poses, strict=True)]
    stamps = [_stamp(file, label, pose) for label, pose in zip(labels, poses, strict=True)]
    # Publishers that know no times leave all stamps at the same one.
    t = None if len(set(stamps)) == 1 else np.array(stamps, dtype=np.float64) - (stamps[0] or 0.0)
    table = np.array(rows)
    return PoseRows(labels, table[:, :3], "quaternion", table[:, 3:], t)


def _ros_pose(file: FilePath, label: str, given: Any) -> list[float]:
    pose = given.get("pose", given) if isinstance(given, Mapping) else given
    found = []
    for part, keys in (("position", "xyz"), ("orientation", "wxyz")):
        for key in keys:
            try:
                found.append(float(pose[part][key]))
            except (KeyError, OverflowError, TypeError, ValueError):
                raise FileFormatError(
                    f"{file}: {label}: {part}.{key} is missing or no number"
                ) from None
    return found


def _stamp(file: FilePath, label: str, given: Mapping[str, Any]) -> float | None:
    header = given.get("header")
    if header is None:
        return None
    try:
        return 1e-9 * nanoseconds(header["stamp"])
    except (KeyError, OverflowError, TypeError, ValueError):
        raise FileFormatError(
            f"{file}: {label}: header.stamp is incomplete, expected sec and nanosec (ROS 1: secs "
            f"and nsecs)"
        ) from None


READERS: Mapping[str, Callable[[FilePath, Reading], Mapping[str, PoseRows]]] = {
    **dict.fromkeys(TABLES, read_tables),
    ARRAY: lambda file, reading: {"": _read_array(file, reading)},
    ".yaml": lambda file, _: _read_ros(file),
    ".yml": lambda file, _: _read_ros(file),
    ".json": lambda file, _: _read_ros(file),
}


def nanoseconds(stamp: Mapping[str, Any]) -> int:
    """Return a time of ROS 2, or of ROS 1, whose names differ [ns]; KeyError for what is none."""
    seconds, rest = ("secs", "nsecs") if "secs" in stamp else ("sec", "nanosec")
    return int(stamp[seconds]) * 1_000_000_000 + int(stamp[rest])
