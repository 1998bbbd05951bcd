"""What all laws are made of: what is required, and how a failure is told."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from selfmotion.basics import Array, Saved, restore

# Exact gradients against central differences of F, relative to the largest entry.
GRADIENT = 1e-6


def require_gradient(
    value: Callable[[Array], float], gradient: Callable[[Array], Array], x: Array, what: str
) -> None:
    """Require that a gradient is that of a value at x, by central differences."""
    exact, differences = np.array(gradient(x)), np.empty_like(x)
    for i in range(len(x)):
        shift = np.zeros_like(x)
        shift[i] = 1e-5
        differences[i] = (value(x + shift) - value(x - shift)) / 2e-5
    # Where the self-motion leaves a value unchanged, its rounding remains.
    scale = max(float(np.abs(differences).max()), 1e-2 * abs(value(x)))
    near(exact, differences, GRADIENT * scale, f"{what}: gradient is not that of the value")


def saved(value: Any, family: type[Saved], **context: Any) -> Any:
    """Return a value after a way through a file's text; the family's restore reads it."""
    description = json.loads(json.dumps(value.to_dict()))
    again = restore(family, description, **context)
    require(type(again) is type(value), f"loaded, it is a {type(again).__name__}")
    require(again.to_dict() == value.to_dict(), "loaded, it describes itself differently")
    return again


def require(condition: bool, message: str) -> None:
    """Raise AssertionError unless a condition holds."""
    if not condition:
        raise AssertionError(message)


def near(
    actual: Array, expected: Array, tolerance: float, message: str, t: Array | None = None
) -> None:
    """Require that numbers are near others; says which is worst, and at which of times t."""
    miss = np.abs(actual - expected)
    # Written so that NaN fails.
    if not np.all(miss <= tolerance):
        worst = np.unravel_index(int(np.argmax(np.nan_to_num(miss, nan=np.inf))), miss.shape)
        when = "" if t is None else f" at t = {t[worst[0]]:.6g} s"
        raise AssertionError(
            f"{message}{when}: {actual[worst]:.9g} against {expected[worst]:.9g} (off by "
            f"{miss[worst]:.2e}, allowed {tolerance:.1e})"
        )
