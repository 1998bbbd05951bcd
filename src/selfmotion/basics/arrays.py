"""Read-only arrays of numbers, and values as messages show them."""

from __future__ import annotations

import reprlib
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics.errors import ProblemError

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

_short = reprlib.Repr()
_short.maxother = _short.maxstring = 60
_short.maxlist = _short.maxtuple = 8


def read_only(values: npt.ArrayLike) -> Array:
    """Return a float64 copy of `values` that refuses to be modified."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def plain(values: Array) -> Array:
    """Return an array as kernels take it: in C order and writeable; a copy where it is not.

    For each other kind of array numba would compile another kernel.
    """
    if values.dtype == np.float64 and values.flags.carray:
        return values
    return np.array(values, dtype=np.float64, order="C")


def per_joint(values: npt.ArrayLike, dof: int, what: str, *, positive: bool = False) -> Array:
    """Return one number for all joints, or one for each, as a read-only array (n,).

    Raises
    ------
    ProblemError
        Their number is wrong, one is NaN, or not positive if `positive`.
    """
    given = plain_numbers(values)
    if given is None or given.shape not in ((), (dof,)):
        size = "" if given is None else f" of shape {given.shape}"
        raise ProblemError(
            f"{what}: {shown(values)}{size}, expected one number, or one for each of the {dof} "
            f"joints"
        )
    array = read_only(np.broadcast_to(given, (dof,)))
    if np.any(np.isnan(array)) or (positive and not np.all(array > 0.0)):
        kind = "numbers > 0" if positive else "numbers"
        raise ProblemError(f"{what}: {shown(given)}, expected {kind}")
    return array


def plain_numbers(values: Any) -> Array | None:
    """Return numbers as they are, or None where they are none: texts, booleans, ragged lists."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        return None
    # Of a list NumPy takes a flag among numbers for one.
    if array.dtype.kind not in "iuf" or _has_flag(values):
        return None
    return np.asarray(array, dtype=np.float64)


def _has_flag(values: Any) -> bool:
    if isinstance(values, list | tuple):
        return any(map(_has_flag, values))
    return isinstance(values, bool | np.bool_)


def is_ragged(values: Any) -> bool:
    """Return whether it is a list of lists of different lengths."""
    rows = values if isinstance(values, list | tuple) else ()
    lengths = {len(row) for row in rows if isinstance(row, list | tuple | np.ndarray)}
    return len(lengths) > 1


def shown(value: Any) -> str:
    """Return a value for a message: short, on one line."""
    if isinstance(value, type):
        return f"the class {value.__name__}, not an object of it"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}" if value.size > 16 else str(value.tolist())
    return " ".join(_short.repr(value).split())
