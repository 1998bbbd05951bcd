"""Minimisation; knows only numbers."""

from selfmotion.optimise.line_search import LineSearch
from selfmotion.optimise.quasi_newton import (
    Callback,
    Function,
    Iteration,
    Minimum,
    QuasiNewton,
    Status,
)

__all__ = [
    "Callback",
    "Function",
    "Iteration",
    "LineSearch",
    "Minimum",
    "QuasiNewton",
    "Status",
]
