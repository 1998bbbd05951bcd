"""Minimisation; knows only numbers."""

from selfmotion.optimise.base import (
    Callback,
    ConstrainedFunction,
    Function,
    Iteration,
    Minimum,
    Optimizer,
    Residuals,
    Status,
    inverse_metric,
)
from selfmotion.optimise.line_search import LineSearch
from selfmotion.optimise.quadratic import minimize_quadratic
from selfmotion.optimise.quasi_newton import QuasiNewton
from selfmotion.optimise.rows import DenseRows, Rows, ScaledRows, pulled_back
from selfmotion.optimise.sqp import SequentialQuadratic
from selfmotion.optimise.step import Step, best_step

__all__ = [
    "Callback",
    "ConstrainedFunction",
    "DenseRows",
    "Function",
    "Iteration",
    "LineSearch",
    "Minimum",
    "Optimizer",
    "QuasiNewton",
    "Residuals",
    "Rows",
    "ScaledRows",
    "SequentialQuadratic",
    "Status",
    "Step",
    "best_step",
    "inverse_metric",
    "minimize_quadratic",
    "pulled_back",
]
