"""Columns of numbers and texts as poses: units, orientations, events, and what is refused."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import TURN, Array, FileFormatError
from selfmotion.shop.cam.column_names import (
    EVENT,
    ORIENTATION_COLUMNS,
    POSITION,
    column_name,
    kuka_titles,
    si_column,
)
from selfmotion.shop.cam.pose_rows import PoseRows

# Notes on how columns are read.
_KUKA_NOTE = (
    "columns A,B,C are read as KUKA's: angles about z, y and x in turn in degrees, x,y,z in mm "
    "where they say no unit"
)
_ROTATION_VECTOR_NOTE = (
    "rx,ry,rz are read as a rotation vector: the axis of a turn, as long as its angle"
)
_ROTATION_VECTOR = ("rx", "ry", "rz")
# Column without a unit → the unit that is taken, and names with other ones.
_DEFAULT_UNITS = {
    "t": ("seconds", ""),
    **dict.fromkeys(POSITION, ("metres", "x_mm, x_cm, x_in")),
    "feed": ("m/s", "feed_mm"),
    **dict.fromkeys(("roll", "pitch", "yaw"), ("radians about fixed axes", "roll_deg")),
    **dict.fromkeys(_ROTATION_VECTOR, ("radians", "rx_deg")),
}
# Relative rounding that is allowed above half a turn.
_ANGLE_ROUNDING = 2e-4
# Coordinate above which lengths are no metres: no arm reaches so far [m].
_MAX_METRES = 10.0


def rows_of_table(
    file: FilePath,
    header: Sequence[str],
    table: Array,
    labels: Sequence[str],
    texts: Mapping[str, Sequence[str]],
    with_unit: Collection[str] = (),
) -> PoseRows:
    """Return the poses of a table, from its columns of numbers and of texts.

    Parameters
    ----------
    file : Path
        Named in errors.
    header : sequence of str
        Names of the columns of numbers.
    table : (N, C)
        Numbers.
    labels : sequence of str
        Labels of the rows.
    texts : mapping
        Columns of texts by their names.
    with_unit : collection of str
        Columns that have a unit in their title, though not in their name.

    Raises
    ------
    FileFormatError
        A column is missing or there twice, or numbers are likely to be in other units.
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


def _check_millimetres(file: FilePath, titles: Sequence[str], table: Array) -> None:
    """Refuse positions beside A, B, C without a unit that are so small that they may be metres."""
    without_unit = [k for k, title in enumerate(titles) if column_name(title) in POSITION]
    if without_unit and len(table) and np.abs(table[:, without_unit]).max() < _MAX_METRES:
        raise FileFormatError(
            f"{file}: A,B,C are KUKA's, whose x,y,z are in mm, and all of these are below "
            f"{_MAX_METRES:g}: call them x_mm,y_mm,z_mm; of metres call A,B,C "
            f"yaw_deg,pitch_deg,roll_deg"
        )


def _si_columns(file: FilePath, header: Sequence[str], table: Array) -> dict[str, Array]:
    """Return the columns in SI units, by their names without units."""
    columns: dict[str, Array] = {}
    for k, title in enumerate(header):
        name, scale = si_column(file, title)
        if name in columns:
            raise FileFormatError(f"{file}: column '{name}' appears twice, in two units")
        columns[name] = scale * table[:, k]
    return columns


def _units_note(titles: Sequence[str]) -> tuple[str, ...]:
    """Return a note on the columns without a unit, with the unit that is taken."""
    without_unit: dict[tuple[str, str], list[str]] = {}
    for title in titles:
        name = column_name(title)
        if name in _DEFAULT_UNITS:
            without_unit.setdefault(_DEFAULT_UNITS[name], []).append(name)
    if not without_unit:
        return ()
    columns = "; ".join(
        f"{','.join(names)} for {unit}{f' (else: {others})' if others else ''}"
        for (unit, others), names in without_unit.items()
    )
    return (f"columns say no unit and are taken so: {columns}",)


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


def _check_rotation_vectors(
    file: FilePath, turns: Array, labels: Sequence[str], names: str
) -> None:
    """Refuse rotation vectors (K, 3) [rad] above half a turn: they may be roll, pitch and yaw."""
    sizes = np.linalg.norm(turns, axis=1)
    is_large = sizes > (1.0 + _ANGLE_ROUNDING) * np.pi
    # Degrees that are taken for radians are reported as such later on.
    is_large &= np.abs(turns).max(axis=1) <= TURN
    if is_large.any():
        k = int(np.argmax(is_large))
        raise FileFormatError(
            f"{file}: {labels[k]}: rx,ry,rz is an axis times an angle of "
            f"{np.degrees(sizes[k]):.7g}°, more than half a turn; are these angles about fixed "
            f"axes? Call them {names}; of a rotation vector take the shorter turn, the other way "
            f"round"
        )


def _split_events(text: str) -> list[str]:
    """Return the events of a row, with semicolons between them."""
    return [event.strip() for event in text.split(";") if event.strip()]
