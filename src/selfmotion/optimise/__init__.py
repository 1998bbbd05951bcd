"""Minimisation; knows only numbers."""

from selfmotion.optimise.banded import BandedRows as BandedRows, banded_optimum as banded_optimum
from selfmotion.optimise.base import (
    Callback as Callback,
    ConstrainedFunction as ConstrainedFunction,
    Function as Function,
    Iteration as Iteration,
    Minimum as Minimum,
    Optimizer as Optimizer,
    Residuals as Residuals,
    Status as Status,
    inverse_metric as inverse_metric,
)
from selfmotion.optimise.blocks import Banded as Banded
from selfmotion.optimise.line_search import LineSearch as LineSearch
from selfmotion.optimise.quadratic import minimize_quadratic as minimize_quadratic
from selfmotion.optimise.quasi_newton import QuasiNewton as QuasiNewton
from selfmotion.optimise.rows import (
    DenseRows as DenseRows,
    Rows as Rows,
    ScaledRows as ScaledRows,
    pulled_back as pulled_back,
)
from selfmotion.optimise.sqp import SequentialQuadratic as SequentialQuadratic
from selfmotion.optimise.step import Step as Step, best_step as best_step
