"""Minimisation; knows only numbers."""

from selfmotion.optimise.base import (
    Callback,
    Function,
    Iteration,
    Minimum,
    Optimizer,
    Status,
    inverse_metric,
)
from selfmotion.optimise.line_search import LineSearch
from selfmotion.optimise.quasi_newton import QuasiNewton

__all__ = [
    "Callback",
    "Function",
    "Iteration",
    "LineSearch",
    "Minimum",
    "Optimizer",
    "QuasiNewton",
    "Status",
    "inverse_metric",
]
