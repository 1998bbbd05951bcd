"""Poses as files give them, before they are a path; and the options for reading such files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import (
    Array,
    FileFormatError,
    Flags,
    ProblemError,
    as_choice,
    nearest,
    shown,
)
from selfmotion.shop.cam.rotary import Rotary

# Suffixes of tables, of an array, of G-code, of drawings, and of files of cutter locations: of APT,
# CATIA, NX and Creo.
TABLES = (".csv", ".txt", ".tsv")
ARRAY = ".npy"
PROGRAMS = (".nc", ".ngc", ".gcode", ".tap", ".cnc", ".eia", ".mpf", ".g", ".gc", ".gco")
DRAWING = ".dxf"
CLDATA = (".apt", ".aptsource", ".cls", ".clsf", ".cl", ".ncl")


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

    def selected(self, indices: Sequence[int]) -> "PoseRows":
        """Return the rows with some indices, in that order."""
        new_index = {old: new for new, old in enumerate(indices)}
        return replace(
            self,
            labels=[self.labels[k] for k in indices],
            positions=self.positions[indices],
            values=self.values[indices],
            t=None if self.t is None else self.t[indices],
            feed=None if self.feed is None else self.feed[indices],
            events=tuple((new_index[k], event) for k, event in self.events if k in new_index),
            rapid=None if self.rapid is None else self.rapid[indices],
        )


# Options of `read_path` about the contents of a file.
READING = ("columns", "rotary", "rotary_axes", "rotary_center", "unit")
# Units that may be given for drawings and cutter locations [m].
LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1.0, "in": 25.4e-3, "ft": 0.3048}


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
