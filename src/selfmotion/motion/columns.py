"""Tables of motions: what their columns are called, and how they are read."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from selfmotion.basics import Array, FileFormatError, as_path, read_table

# What follows a joint's name in the header of the columns of its velocity and acceleration.
_MANY = {"_velocity": "velocities", "_acceleration": "accelerations"}
_RATES = tuple(_MANY)


def column_names(joint_names: Sequence[str]) -> list[str]:
    """Return what the columns of a motion's table are called: t, and each joint's q, q̇ and q̈."""
    return ["t", *(name + ending for ending in ("", *_RATES) for name in joint_names)]


def read_columns(
    file: str | Path, degrees: bool
) -> tuple[Array, tuple[str, ...], tuple[Array, Array | None, Array | None]]:
    """Return times (N,), the joints' names, and q, q̇, q̈ (N, n) as far as they are given.

    Raises
    ------
    FileFormatError
        The file cannot be read, or a column is missing.
    """
    header, table = read_table(as_path(file))
    column = {name: table[:, i] for i, name in enumerate(header)}
    names = tuple(name for name in header if name != "t" and not name.endswith(_RATES))
    if "t" not in column or not names:
        raise FileFormatError(
            f"{file}: the header is {','.join(header)}, expected t and a column per joint"
        )
    scale = np.pi / 180.0 if degrees else 1.0

    def table_of(ending: str) -> Array:
        return scale * np.stack([column[name + ending] for name in names], axis=1)

    rates: list[Array | None] = [None, None]
    for order, ending in enumerate(_RATES):
        given = {name for name in header if name.endswith(ending)}
        if not given:
            continue
        wanted = {name + ending for name in names}
        if given != wanted:
            raise FileFormatError(
                f"{file}: column '{min(given ^ wanted)}' does not match; {_MANY[ending]} are given "
                f"for all joints or for none, as NAME{ending}"
            )
        rates[order] = table_of(ending)
    if rates[0] is None and rates[1] is not None:
        raise FileFormatError(
            f"{file}: has accelerations but no velocities; give NAME{_RATES[0]} as well"
        )
    return column["t"], names, (table_of(""), rates[0], rates[1])
