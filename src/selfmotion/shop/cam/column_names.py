"""Names of the columns of pose tables: spellings of other programs, units, and what is refused."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import FileFormatError, nearest

POSITION = ("x", "y", "z")
# Column with the name of a row's seam.
SEAM = "seam"
# Column with the events at a row.
EVENT = "event"
# Columns of an orientation → its key in `ORIENTATIONS`.
ORIENTATION_COLUMNS: Mapping[tuple[str, ...], str] = {
    ("qw", "qx", "qy", "qz"): "quaternion",
    ("rx", "ry", "rz"): "rotation_vector",
    ("roll", "pitch", "yaw"): "rpy",
    ("nx", "ny", "nz"): "normal",
}
# Names of all columns, without units.
_NAMES = {"t", "feed", *POSITION, *(name for names in ORIENTATION_COLUMNS for name in names)}

# Other spellings of names.
# Units in brackets behind a title → what its name ends in.
_LENGTHS = {"m": "", "mm": "_mm", "cm": "_cm", "in": "_in", "inch": "_in"}
_SPEEDS = {f"{unit}/s": ending for unit, ending in _LENGTHS.items()}
_ANGLES = {"rad": "", **dict.fromkeys(("deg", "°", "degrees"), "_deg")}
_TIMES, _NUMBERS = {"s": "", "sec": ""}, {"-": "", "1": ""}
_BRACKETS = _LENGTHS | _SPEEDS | _ANGLES | _TIMES | _NUMBERS
# Names → the units that their quantity may have: a speed or an angle is no position.
_OWN_BRACKETS: Mapping[str, Mapping[str, str]] = {
    "t": _TIMES,
    # As in ``feed_mm``, the second may be left out.
    "feed": _SPEEDS | _LENGTHS,
    **dict.fromkeys(POSITION, _LENGTHS),
    **dict.fromkeys(("roll", "pitch", "yaw", "rx", "ry", "rz"), _ANGLES),
    **dict.fromkeys(("qw", "qx", "qy", "qz", "nx", "ny", "nz"), _NUMBERS),
}
_TITLE_WITH_UNIT = re.compile(r"([^\[(]*?)[\s_]*[\[(]([^\])]*)[\])]")
_SYNONYMS = {"time": "t", "timestamp": "t"}
# Names of x or qx in other programs: pose.position.x, pos_x, px, tx; orientation.x, quat_x.
_POSITION_TITLES = re.compile(r"(?:[a-z]+[._])*(?:position|pos|translation)[._]([xyz])|[pt]([xyz])")
_QUATERNION_TITLES = re.compile(r"(?:[a-z]+[._])*(?:orientation|quaternion|quat|q)[._]([wxyz])")
# Columns of a frame of KUKA's → their names here.
_KUKA_TITLES = {
    "a": "yaw_deg",
    "b": "pitch_deg",
    "c": "roll_deg",
    "x": "x_mm",
    "y": "y_mm",
    "z": "z_mm",
}
# Names of orientations that are refused, by makers of controllers → their names here.
_MAKERS_TITLES = {
    **dict.fromkeys("abc", "A,B,C of KUKA are yaw_deg,pitch_deg,roll_deg here"),
    **dict.fromkeys(("w", "p", "r"), "W,P,R of Fanuc are roll_deg,pitch_deg,yaw_deg here"),
    **dict.fromkeys(("q1", "q2", "q3", "q4"), "q1,q2,q3,q4 of ABB are qw,qx,qy,qz here"),
}
# The first word of a program.
_GCODE_WORD = re.compile(r"[gmn][0-9]+|%")
# Names that are offered as spelling suggestions.
_SUGGESTED = ("feed", "roll", "pitch", "yaw", SEAM, EVENT)

# Units.
# Ending of a name → the columns that may have it, and the unit [m]; None for degrees.
_UNITS = {
    "_mm": ((*POSITION, "feed"), 1e-3),
    "_cm": ((*POSITION, "feed"), 1e-2),
    "_in": ((*POSITION, "feed"), 25.4e-3),
    "_deg": (("rx", "ry", "rz", "roll", "pitch", "yaw"), None),
}


def column_name(title: str) -> str:
    """Return the name of a column for its title: x_mm for "X [mm]"."""
    name = title.strip().lower()
    match = _TITLE_WITH_UNIT.fullmatch(name)
    if match and match[2].strip() in _BRACKETS:
        stem, unit = _usual_name(match[1]), match[2].strip()
        units = _OWN_BRACKETS.get(stem, _BRACKETS)
        return stem + units[unit] if unit in units else name
    stem, unit = name, ""
    for suffix in _UNITS:
        if name.endswith(suffix):
            stem, unit = name.removesuffix(suffix), suffix
    return _usual_name(stem) + unit


def _usual_name(stem: str) -> str:
    """Return the name here of a column, without its unit."""
    if position := _POSITION_TITLES.fullmatch(stem):
        return position[1] or position[2]
    if turn := _QUATERNION_TITLES.fullmatch(stem):
        return f"q{turn[1]}"
    return _SYNONYMS.get(stem, stem)


def kuka_titles(titles: Sequence[str]) -> list[str]:
    """Return titles; where A, B and C of KUKA are among them, the names that columns have here."""
    names = [column_name(title) for title in titles]
    if {"a", "b", "c"} <= set(names):
        return [_KUKA_TITLES.get(name, name) for name in names]
    return [*titles]


def si_column(file: FilePath, title: str) -> tuple[str, float]:
    """Return the name of a column without its unit, and the factor to SI units.

    Raises
    ------
    FileFormatError
        There is no such column; the message says what it is called here, if it is known elsewhere.
    """
    title = column_name(title)
    name, scale = title, 1.0
    for suffix, (names, factor) in _UNITS.items():
        if title.endswith(suffix) and title.removesuffix(suffix) in names:
            name, scale = title.removesuffix(suffix), factor or np.pi / 180.0
    _check_known(file, title, name)
    return name, scale


def _check_known(file: FilePath, title: str, name: str) -> None:
    """Raise FileFormatError for a name that is no column."""
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
    if name not in _NAMES:
        orientations = " or ".join(",".join(names) for names in ORIENTATION_COLUMNS)
        raise FileFormatError(
            f"{file}: unknown column '{title}'{nearest(title, _SUGGESTED)}, expected "
            f"t, feed, seam, event, x,y,z and {orientations}; to leave a column out, "
            f"call it - in columns (--set path.columns=-,x,y,z)"
        )
