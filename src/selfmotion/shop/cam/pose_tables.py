"""Reader of tables and arrays of poses."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import (
    LEFT_OUT,
    TURN,
    Array,
    FileFormatError,
    read_arrays,
    read_rows,
)
from selfmotion.shop.cam.column_names import (
    EVENT,
    ORIENTATION_COLUMNS,
    POSITION,
    SEAM,
    column_name,
    kuka_titles,
    si_column,
)
from selfmotion.shop.cam.pose_rows import PoseRows, Reading

# Columns of a table without a header, by their number.
_DEFAULT_HEADERS = {
    3: "x,y,z",
    4: "t,x,y,z",
    6: "x,y,z,nx,ny,nz",
    7: "x,y,z,qw,qx,qy,qz",
    8: "t,x,y,z,qw,qx,qy,qz",
}
# Columns of an array, by their number, unless options name them.
_ARRAY_COLUMNS = {3: ("x", "y", "z"), 4: ("t", "x", "y", "z")}
_KUKA_NOTE = (
    "columns A,B,C are read as KUKA's: angles about z, y and x in turn in degrees, x,y,z in mm "
    "where they say no unit"
)
_ROTATION_VECTOR = ("rx", "ry", "rz")
# Columns without a unit → the unit that is taken, and the ending for another one.
_DEFAULT_UNITS = {
    "t": ("seconds", ""),
    **dict.fromkeys(POSITION, ("metres", "x_mm, x_cm, x_in")),
    "feed": ("m/s", "feed_mm"),
    **dict.fromkeys(("roll", "pitch", "yaw"), ("radians about fixed axes", "roll_deg")),
    **dict.fromkeys(_ROTATION_VECTOR, ("radians", "rx_deg")),
}
_ROTATION_VECTOR_NOTE = (
    "rx,ry,rz are read as a rotation vector: the axis of a turn, as long as its angle"
)
# Relative rounding that is allowed above half a turn.
_HALF_TURN = 2e-4
# Coordinate above which lengths are no metres: no arm reaches so far [m].
_MAX_METRES = 10.0
# Note on 4 x 4 matrices, which say no unit.
MATRIX_NOTE = "matrices say no unit: their last columns are taken for metres"


def read_tables(file: FilePath, reading: Reading | None = None) -> dict[str, PoseRows]:
    """Return the rows of a table by the names in its column ``seam``, "" where it has none."""
    with_unit = set[str]()

    def read_title(title: str) -> str:
        """Return the name of a column for its title; record those whose title states a unit."""
        name = column_name(title)
        if "[" in title or "(" in title:
            with_unit.add(name)
        return name

    header, table, lines, texts = read_rows(
        file,
        (SEAM, EVENT),
        check=lambda names: [si_column(file, name) for name in kuka_titles(names)],
        columns=None if reading is None else reading.columns,
        named=read_title,
        usual=_DEFAULT_HEADERS,
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
    _check_rows_stand_together(file, names, lines)
    return {
        name: whole.selected([k for k, other in enumerate(names) if other == name])
        for name in dict.fromkeys(names)
    }


def _check_rows_stand_together(file: FilePath, names: Sequence[str], lines: Sequence[int]) -> None:
    """Refuse a seam that goes on after rows of another one.

    Two tables that were put together may use a name twice; the tool would go from the one seam
    straight to the other.
    """
    ended = set[str]()
    for before, name, line in zip(names, names[1:], lines[1:], strict=False):
        if name != before:
            ended.add(before)
        if name in ended:
            raise FileFormatError(
                f"{file}: line {line}: seam '{name}' goes on after rows of seam '{before}', "
                f"expected its rows one after the other: give these rows a name of their own, or "
                f"put them behind the others of '{name}'"
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
    if (titles := kuka_titles(header)) != list(header):
        _check_millimetres(file, header, table)
        header, notes = titles, (_KUKA_NOTE,)
    columns = _si_columns(file, header, table)
    notes += _units_note([title for title in header if title not in with_unit])
    events = texts.get(EVENT, [""] * len(labels))
    missing = [name for name in POSITION if name not in columns]
    if missing:
        raise FileFormatError(
            f"{file}: column '{missing[0]}' is missing; the header is "
            f"{','.join((*header, *texts))}, expected x,y,z [m] (or x_mm,…), t [s], and an "
            f"orientation"
        )
    orientation, values, orientation_notes = _orientations(file, header, columns, labels)
    return PoseRows(
        labels,
        np.stack([columns[name] for name in POSITION], axis=1),
        orientation,
        values,
        columns.get("t"),
        columns.get("feed"),
        tuple((k, event) for k, text in enumerate(events) for event in _split_events(text)),
        notes=notes + orientation_notes,
    )


def _orientations(
    file: FilePath, header: Sequence[str], columns: Mapping[str, Array], labels: Sequence[str]
) -> tuple[str, Array, tuple[str, ...]]:
    """Return the key of an orientation in `ORIENTATIONS` ("" for none), its values, and notes."""
    present = [names for names in ORIENTATION_COLUMNS if set(names) & set(columns)]
    if len(present) > 1:
        raise FileFormatError(
            f"{file}: has columns {','.join(present[0])} and {','.join(present[1])}; keep one "
            f"orientation"
        )
    if not present:
        return "", np.zeros((len(labels), 0)), ()
    (names,) = present
    missing = [name for name in names if name not in columns]
    if missing:
        raise FileFormatError(
            f"{file}: column '{missing[0]}' is missing, expected {','.join(names)}"
        )
    values = np.stack([columns[name] for name in names], axis=1)
    if names != _ROTATION_VECTOR:
        return ORIENTATION_COLUMNS[names], values, ()
    unit = "_deg" if any(column_name(title) == "rx_deg" for title in header) else ""
    angles = ",".join(f"{name}{unit}" for name in ("roll", "pitch", "yaw"))
    _check_rotation_vectors(file, values, labels, angles)
    note = f"{_ROTATION_VECTOR_NOTE}; angles about fixed axes are called {angles}"
    return ORIENTATION_COLUMNS[names], values, (note,)


def _units_note(titles: Sequence[str]) -> tuple[str, ...]:
    """Return a note on the columns without a unit, with the unit that is assumed."""
    without_unit: dict[tuple[str, str], list[str]] = {}
    for title in titles:
        if column_name(title) in _DEFAULT_UNITS:
            without_unit.setdefault(_DEFAULT_UNITS[column_name(title)], []).append(
                column_name(title)
            )
    if not without_unit:
        return ()
    columns = "; ".join(
        f"{','.join(names)} for {taken}{f' (else: {others})' if others else ''}"
        for (taken, others), names in without_unit.items()
    )
    return (f"columns say no unit and are taken so: {columns}",)


def _check_millimetres(file: FilePath, titles: Sequence[str], table: Array) -> None:
    """Refuse positions beside A, B, C without a unit that are so small that they may be metres."""
    without_unit = [k for k, title in enumerate(titles) if column_name(title) in POSITION]
    if without_unit and len(table) and np.abs(table[:, without_unit]).max() < _MAX_METRES:
        raise FileFormatError(
            f"{file}: A,B,C are KUKA's, whose x,y,z are in mm, and all of these are below "
            f"{_MAX_METRES:g}: call them x_mm,y_mm,z_mm; of metres call A,B,C "
            f"yaw_deg,pitch_deg,roll_deg"
        )


def _check_rotation_vectors(
    file: FilePath, turns: Array, labels: Sequence[str], angles: str
) -> None:
    """Refuse rotation vectors (K, 3) [rad] above half a turn: they may be roll, pitch and yaw."""
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


def _split_events(text: str) -> list[str]:
    """Return the events of a row, with semicolons between them."""
    return [event.strip() for event in text.split(";") if event.strip()]


def _si_columns(file: FilePath, header: Sequence[str], table: Array) -> dict[str, Array]:
    """Return the columns in SI units, by their names without units."""
    columns: dict[str, Array] = {}
    for k, title in enumerate(header):
        name, scale = si_column(file, title)
        if name in columns:
            raise FileFormatError(f"{file}: column '{name}' appears twice, in two units")
        columns[name] = scale * table[:, k]
    return columns


def read_array(file: FilePath, reading: Reading) -> PoseRows:
    """Return the rows of an array (N, 4, 4) of poses, or of a table (N, C) of numbers."""
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
    columns = reading.columns or _ARRAY_COLUMNS.get(array.shape[1])
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
    used = [k for k, name in enumerate(columns) if name != LEFT_OUT]
    numbers = array[:, used] * 1.0
    return rows_of_table(file, [columns[k] for k in used], numbers, labels, {})
