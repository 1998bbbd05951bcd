"""Values that users give: made into numbers, or refused in one sentence."""

from __future__ import annotations

from abc import ABCMeta
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from selfmotion.basics.arrays import Array, is_ragged, plain_numbers, read_only, shown
from selfmotion.basics.errors import ProblemError

_Kind = TypeVar("_Kind")
_Called = TypeVar("_Called", bound=Callable[..., Any])

# Larger angles [rad] are in degrees.
TURN = 2.0 * np.pi + 1e-6


def as_numbers(
    values: Any,
    what: str,
    expected: str = "finite numbers",
    shape: tuple[int, ...] | None = None,
    error: type[Exception] = ProblemError,
) -> Array:
    """Return `values` as finite numbers, read-only.

    Parameters
    ----------
    values : array_like
    what : str
        Their name in messages.
    expected : str
        Expected form, for messages.
    shape : tuple of int, optional
    error : type
        Class of the exception.

    Raises
    ------
    error
        They are texts, booleans, ragged, of another shape, or one is not finite: it is named.
    """
    array = plain_numbers(values)
    if array is None or (shape is not None and array.shape != shape):
        found = "" if array is None or array.size <= 1 else f" of shape {array.shape}"
        if array is None and is_ragged(values):
            found = ", whose rows have different lengths"
        raise error(f"{what} is {shown(values)}{found}, expected {expected}")
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))[0]
        where = f"[{', '.join(map(str, bad))}]" if array.ndim else ""
        raise error(f"{what}{where} is {array[tuple(bad)]}, expected {expected}")
    return read_only(array)


def as_number(
    value: Any,
    what: str,
    *,
    above: float = -np.inf,
    least: float = -np.inf,
    most: float = 1e100,
    error: type[Exception] = ProblemError,
) -> float:
    """Return `value` as a float that is > `above`, ≥ `least` and ≤ `most`.

    Raises
    ------
    error
        It is no such number; `what` is its name in the message.
    """
    array = plain_numbers(value)
    number = float(array) if array is not None and array.ndim == 0 else np.nan
    # Written so that NaN is refused too.
    if not (above < number <= most and number >= least):
        asked = {f"> {above:g}": np.isfinite(above), f"≥ {least:g}": np.isfinite(least)}
        asked[f"≤ {most:g}"] = np.isfinite(number) and number > most
        bounds = [bound for bound, said in asked.items() if said]
        kind = "number" if bounds and number != np.inf else "finite number"
        expected = " ".join(["a", kind, " and ".join(bounds)]).strip()
        raise error(f"{what} is {shown(value)}, expected {expected}")
    return number


def as_whole(
    value: Any, what: str, least: int, most: int, error: type[Exception] = ProblemError
) -> int:
    """Return `value` as an int from `least` to `most`.

    Raises
    ------
    error
        It is no whole number, or out of these bounds.
    """
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (whole and least <= value <= most):
        bounds = f"≥ {least}" if not whole or value < least else f"from {least} to {most}"
        raise error(f"{what} is {shown(value)}, expected a whole number {bounds}")
    return int(value)


def is_number(value: Any) -> bool:
    """Whether a value of a document is a number that floats can hold; True and False are none."""
    if isinstance(value, bool):
        return False
    return isinstance(value, float) or (isinstance(value, int) and value.bit_length() < 1024)


def number_in(text: str) -> float | None:
    """Return the number that a text of a file is, None where it is none.

    Python reads 1_0 as 10, programs that write files and others that read them do not.
    """
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def as_flag(value: Any, what: str, error: type[Exception] = ProblemError) -> bool:
    """Return `value`, True or False; `error` otherwise, with the name `what`."""
    if not isinstance(value, bool | np.bool_):
        raise error(f"{what} is {shown(value)}, expected True or False")
    return bool(value)


def as_called(value: _Called, what: str) -> _Called:
    """Return `value`, if callable; ProblemError otherwise, with the name `what`."""
    if not callable(value):
        raise ProblemError(f"{what} is {shown(value)}, expected a function")
    return value


def check_executor(value: Any) -> None:
    """Raise ProblemError for a value that is neither an executor nor None."""
    if value is not None and not callable(getattr(value, "submit", None)):
        raise ProblemError(
            f"executor is {shown(value)}, expected one of concurrent.futures, or None"
        )


def as_choice(
    value: Any, what: str, choices: tuple[str, ...], error: type[Exception] = ProblemError
) -> str:
    """Return `value`, one of `choices`.

    Raises
    ------
    error
        It is none of them.
    """
    if not (isinstance(value, str) and value in choices):
        names = ", ".join(f"'{choice}'" for choice in choices)
        raise error(f"{what} is {shown(value)}, expected one of: {names}")
    return value


# Namespaces of the classes that users derive from.
_NAMESPACES = {
    "Constraint": "constraints",
    "Cost": "costs",
    "NullMotion": "motion",
    "Obstacle": "obstacles",
    "Path": "paths",
    "Requirement": "certificate",
}


def public_name(kind: type) -> str:
    """Return the public name of a class to derive from: ``selfmotion.costs.Cost``."""
    return ".".join(("selfmotion", _NAMESPACES[kind.__name__], kind.__name__))


def as_several(items: Any, name: str, kind: type[_Kind]) -> tuple[_Kind, ...]:
    """Return one item or several of a kind as a tuple; ProblemError for anything else."""
    listed = (items,) if isinstance(items, kind) else items
    if not isinstance(listed, list | tuple):
        raise ProblemError(f"{name} are {shown(items)}, expected a list of {name}")
    for item in listed:
        if not isinstance(item, kind):
            raise ProblemError(f"{name}: {shown(item)}{_remedy(item, kind)}")
    return tuple(listed)


def _remedy(item: Any, kind: type) -> str:
    """Return the remedy for an item of the wrong kind."""
    if isinstance(item, type) and issubclass(item, kind):
        return f", expected a {kind.__name__}: {item.__name__}(…)"
    if not isinstance(kind, ABCMeta):
        return f", expected a {kind.__name__}"
    derive = f"derive a class of your own from {public_name(kind)}, which says what it has to give"
    if kind.__name__ == "Cost" and callable(item):
        return (
            f" is no Cost; give selfmotion.costs.FunctionCost(f) of a function f(qd, q, t), or "
            f"{derive}"
        )
    return f" is no {kind.__name__}; {derive}"


def random_numbers(rng: Any) -> np.random.Generator:
    """Return a generator of random numbers: itself, or one with that seed.

    Raises
    ------
    ProblemError
        It is neither a generator nor a seed.
    """
    try:
        return np.random.default_rng(rng)
    except (TypeError, ValueError):
        raise ProblemError(
            f"rng is {shown(rng)}, expected a whole number ≥ 0 or a numpy Generator"
        ) from None
